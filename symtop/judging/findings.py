"""The claims ledger as data: one finding a claim, one ledger an integrator, and both as a dataset and as sentences.

A verdict is `confirmed`, `refuted`, `measured` (nothing was claimed), `undecided` (and why), or `inapplicable` (and
why). `value` is the number that a verdict rests on, `resolution` the least that the battery can tell from a true claim.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.core.errors import SymtopError, shown

VERDICTS = ("confirmed", "refuted", "measured", "undecided", "inapplicable")
LONGEST = 240  # characters of somebody else's error message


def claim_name(claim: str) -> str:
    """The name of a claim in a sentence or a heading."""
    return claim if claim.startswith("p_") else claim.replace("_", " ")


class Measured(NamedTuple):
    """A measured value: a word (yes, drift, wrong limit), and a number with its 95 % interval and unit."""

    kind: str = ""
    number: float = math.nan
    interval: float = math.nan
    unit: str = ""
    text: str = ""  # of the whole, where it is not "kind, number"

    def __str__(self) -> str:
        if self.text or math.isnan(self.number):
            return self.text or self.kind
        return f"{self.kind}, {self.number:.0e}".replace("0e+00", "0")

    def __bool__(self) -> bool:
        """Was anything measured?"""
        return bool(str(self))


NOTHING = Measured()


class Finding(NamedTuple):
    """One cell of the ledger."""

    claim: str
    declared: str
    measured: Measured
    verdict: str
    why: str  # a clause that completes "CLAIM is VERDICT: ..."
    value: float = math.nan  # the number that the verdict rests on
    resolution: float = math.nan  # the least such number that the battery can tell from a true claim

    def sentence(self, name: str) -> str:
        """The verdict in words."""
        claimed = f"claims {self.declared}" if self.declared else "claims nothing"
        return f"{name}, {claim_name(self.claim)}: {claimed}; {self.verdict}: {self.why}."

    def plain(self) -> dict[str, str | float | None]:
        """The finding as JSON can hold it: no number is null."""
        values = self._asdict() | {"measured": str(self.measured)}
        return {
            name: None if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in values.items()
        }


def yes_no(value: bool | int | None) -> str:
    """A claim in a word: yes, no, a number, or nothing."""
    if value is None:
        return ""
    return ("yes" if value else "no") if isinstance(value, bool) else str(value)


def agreement(*, declared: bool | None, measured: bool | None) -> str:
    """The verdict on a claim that is true or false."""
    if measured is None:
        return "undecided"
    return "measured" if declared is None else "confirmed" if declared == measured else "refuted"


def undecided(claim: str, declared: str, why: str) -> Finding:
    """A claim that could not be judged; somebody else's long message is cut."""
    short = why if len(why) <= LONGEST else why[:LONGEST].rsplit(" ", 1)[0] + " ..."
    return Finding(claim, declared, NOTHING, "undecided", short.rstrip("."))


def inapplicable(claim: str, why: str, declared: str = "") -> Finding:
    """A claim that cannot be asked, and why."""
    return Finding(claim, declared, NOTHING, "inapplicable", why)


@dataclass(frozen=True)
class Ledger:
    """Everything the battery found about one integrator."""

    integrator: str
    scene: str
    findings: tuple[Finding, ...]
    traces: dict[str, np.ndarray]  # errors by step, defects by differencing width, length of the long run

    @property
    def refuted(self) -> list[str]:
        """The claims that are false."""
        return [finding.claim for finding in self.findings if finding.verdict == "refuted"]

    def __getitem__(self, claim: str) -> Finding:
        by_claim = {finding.claim: finding for finding in self.findings}
        if claim not in by_claim:
            raise SymtopError(f"claim {shown(claim)} is not in this ledger, which has {', '.join(by_claim)}")
        return by_claim[claim]

    def __iter__(self) -> Iterator[str]:
        """The claims, so that ``in`` asks for one of them."""
        return iter([finding.claim for finding in self.findings])

    def sentences(self) -> list[str]:
        """One sentence a verdict."""
        return [finding.sentence(self.integrator) for finding in self.findings]

    def dataset(self) -> xr.Dataset:
        """Dimensions ``claim``, ``setting`` (of the order), ``width`` (of the differencing), ``window`` (in time)."""
        columns = {name: ("claim", [getattr(one, name) for one in self.findings]) for name in Finding._fields[1:]}
        columns["measured"] = ("claim", [str(one.measured) for one in self.findings])
        axes = {"step_size": "setting", "error": "setting", "fitted": "setting"}
        axes |= {"long_nutations": "window", "energy_change": "window"}
        traces = {
            name: ((axes.get(name, "width"),) if row.ndim else (), row.astype(float))
            for name, row in self.traces.items()
        }
        return xr.Dataset({**columns, **traces}, coords={"claim": list(self)})


def read(data: xr.Dataset) -> list[Finding]:
    """The findings of one integrator out of a dataset of the claims study."""
    rows = zip(*(data[name].values.tolist() for name in Finding._fields), strict=True)
    return [Finding(*row)._replace(measured=Measured(text=row[2])) for row in rows]
