"""The claims ledger: one finding a claim, one ledger an integrator, as a dataset, as sentences and as a report.

A verdict is `confirmed`, `refuted`, `measured` (nothing was claimed), `undecided` (and why), or `inapplicable` (and
why). `value` is the number that a verdict rests on, `resolution` the least that the battery can tell from a true claim.
"""

import math
import textwrap
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from symtop.core.errors import SymtopError, shown

VERDICTS = ("confirmed", "refuted", "measured", "undecided", "inapplicable")
LONGEST = 240  # characters of somebody else's error message


def claim_name(claim: str) -> str:
    """The name of a claim in a sentence or a heading."""
    return claim if claim.startswith("p_") else claim.replace("_", " ")


class Measured(NamedTuple):
    """A measured value: a word (yes, drift, wrong limit) and a number."""

    kind: str = ""
    number: float = math.nan
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
        numbers = {name: getattr(self, name) for name in ("value", "resolution")}
        finite = {name: number if math.isfinite(number) else None for name, number in numbers.items()}
        return self._asdict() | {"measured": str(self.measured)} | finite


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

    def dataset(self) -> xr.Dataset:
        """Dimensions ``claim``, ``setting`` (of the order), ``width`` (of the differencing), ``window`` (in time)."""
        rows = [one._replace(measured=str(one.measured)) for one in self.findings]  # type: ignore[arg-type]
        columns: dict[str, Any] = {
            name: ("claim", [getattr(one, name) for one in rows]) for name in Finding._fields[1:]
        }
        axes = dict.fromkeys(("step_size", "error", "fitted"), "setting")
        axes |= dict.fromkeys(("long_nutations", "energy_change"), "window")
        for name, row in self.traces.items():
            columns[name] = ((axes.get(name, "width"),) if row.ndim else (), row.astype(float))
        return xr.Dataset(columns, coords={"claim": list(self)})


def read(data: xr.Dataset) -> list[Finding]:
    """The findings of one integrator out of a dataset of the claims study."""
    rows = zip(*(data[name].values.tolist() for name in Finding._fields), strict=True)
    return [Finding(*row)._replace(measured=Measured(text=row[2])) for row in rows]


class About(NamedTuple):
    """What is judged through an adapter, once it is open."""

    name: str
    chart: str
    implementation: str
    seconds_a_step: float
    seed: int = 0  # of what was drawn at random


@dataclass(frozen=True)
class StepLedger(Ledger):
    """The findings on a step that came through an adapter; shown as the report of the command."""

    about: About
    implied: frozenset[str] = frozenset()  # claims that follow from those that were made

    def __str__(self) -> str:
        lines = [heading(self.about, self.scene), *filter(None, map(line, self.findings))]
        return "\n".join([*lines, summary(self.findings, self.implied)])

    def dataset(self) -> xr.Dataset:
        """As of any ledger, with attributes that say what was judged."""
        return super().dataset().assign_attrs(self.about._asdict(), scene=self.scene)


COLUMNS = {"claim": 13, "claimed": 12, "measured": 24, "verdict": 12}
WIDTH = 100
UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (0.0, "ns"))
KEPT = {"energy": "the energy", "p_phi": "p_phi", "p_psi": "p_psi", "axis_length": "|e|"}


def heading(about: About, scene: str) -> str:
    """What is judged, and the names of the columns."""
    pace = about.seconds_a_step
    unit, name = next(one for one in UNITS if pace >= one[0])
    cost = f", {pace / (unit or 1e-9):.3g} {name} a step" if pace else ""
    chart = f" in the {about.chart} chart" if about.chart else ""
    drawn = f", seed {about.seed}" if about.seed else ""
    names = "".join(name.ljust(width) for name, width in COLUMNS.items())
    return f"{about.name}{chart} on {scene}{cost}{drawn}\n\n{names}the number that decides"


def line(finding: Finding, width: int = WIDTH) -> str:
    """A finding in one line, and its reason below where it is no plain number; empty if nobody asked what cannot be."""
    if finding.verdict == "inapplicable" and not finding.declared:
        return ""
    cells = (claim_name(finding.claim), finding.declared or "-", str(finding.measured) or "-", finding.verdict)
    sized = zip(cells, COLUMNS.values(), strict=True)
    text = "".join((cell if len(cell) < size else cell[: size - 2] + "~").ljust(size) for cell, size in sized)
    if math.isfinite(finding.value):
        text += f"{finding.value:.3g}"
        text += f" (resolved: {finding.resolution:.1g})" if math.isfinite(finding.resolution) else ""
    if finding.verdict in ("confirmed", "measured") and not (finding.claim == "calls" and ";" in finding.why):
        return text.rstrip()
    return text.rstrip() + "\n" + textwrap.indent(textwrap.fill(f"{finding.why}.", width - 4), "    ")


def description(findings: Sequence[Finding]) -> str:
    """What the method is, whatever is claimed of it: "order 2, symplectic, reversible, keeps p_phi; not p_psi"."""
    measured = {one.claim: one.measured for one in findings}
    errors = {one.claim.removesuffix("_error"): one.value for one in findings if one.claim.endswith("_error")}
    words = [f"{name} within {value:.1e} rad of the truth" for name, value in errors.items()]  # of a trajectory
    if order := measured.get("order"):
        wrong, p = order.kind == "wrong limit", order.number
        whole = not wrong and abs(p - round(p)) < 0.3
        words += ["converges to another motion" if wrong else f"order {round(p)}" if whole else f"order {p:.1f}"]
    for claim, yes in (("symplectic", "symplectic"), ("symmetric", "reversible")):
        answer = measured.get(claim, NOTHING).kind
        words += [yes] if answer == "yes" else [f"not {yes}"] if answer == "no" else []

    def of_kind(*kinds: str) -> str:
        return _listed([name for claim, name in KEPT.items() if measured.get(claim, NOTHING).kind in kinds])

    kept, bounded, lost = of_kind("kept"), of_kind("bounded"), of_kind("drift", "growing", "random walk")
    words += [f"keeps {kept}"] if kept else []
    words += [f"{bounded} bounded"] if bounded else []
    return (", ".join(words) or "nothing could be measured") + (f"; not {lost}" if lost else "")


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), *names[-1:]] if len(names) > 1 else names)


def summary(findings: Sequence[Finding], implied: Collection[str] = ()) -> str:
    """What the method is, and how many claims hold: those that were made, and those that follow from them."""
    own = _counted([one for one in findings if one.declared and one.claim not in implied])
    theirs = _counted([one for one in findings if one.declared and one.claim in implied])
    claims = f"Claims: {own}" if own else "No claims were made"
    names = _listed([claim_name(name) for name in sorted(implied)])
    follow = f". Implied by them ({names}): {theirs}" if theirs else ""
    return f"\nIt is: {description(findings)}.\n{claims}{follow}."


def _counted(findings: Sequence[Finding]) -> str:
    counts = Counter(one.verdict for one in findings)
    return ", ".join(f"{counts[word]} {word}" for word in ("confirmed", "refuted", "undecided") if counts[word])
