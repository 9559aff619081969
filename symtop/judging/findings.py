"""The claims table of an integrator, a `Ledger` with one finding per claim, as a dataset, as sentences, as a report.

A verdict is `confirmed`, `refuted`, `measured` (nothing was claimed), and with the reason `undecided`, `inapplicable`.
"""

import math
import textwrap
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from symtop.core.errors import SymtopError, shown

VERDICTS = ("confirmed", "refuted", "measured", "undecided", "inapplicable")
LONGEST, ELLIPSIS = 240, " [...]"  # characters of a foreign error message, and the end of one that was longer
WIDTH, AS_WITH = 100, "as with "  # characters in a line; the begin of a reason that refers to that of another claim
UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (0.0, "ns"))
NOUNS = {"energy": "the energy", "p_phi": "p_phi", "p_psi": "p_psi", "axis_length": "|e|", "momentum": "the momentum"}
PHRASES = {  # phrases for measured values: {0} is the number, {1} the text
    "wrong limit": "as h -> 0 it goes to another motion, {0:.1e} away",
    "kept": "kept, to {0:.0e}", "bounded": "bounded, within {0:.1e}", "drift": "drifts, by {0:.1e}",
    "random walk": "wanders as rounding does, by {0:.1e}", "growing": "changes, by {0:.1e}, and may grow",
    "symplectic yes": "yes, a step keeps the Poisson bracket to {0:.0e}",
    "symplectic no": "no, a step misses the Poisson bracket by {0:.1e}",
    "symmetric yes": "yes, a step back returns to the start to {0:.0e}",
    "symmetric no": "no, a step back misses the start by {0:.1e}",
    "work work": "{1} force evaluations a step", "time order": "order {1} where f depends on the time",
    "pole passes": "a run through the upright axis ends {0:.0e} rad off (good: 1e-7 or falling with h)",
    "pole ends there": "a run ends where the axis is upright (theta = 0)",
    "pole wrong": "a run through the upright axis comes out {0:.0e} rad off (good: 1e-7 or falling with h)",
}  # fmt: skip


def claim_name(claim: str) -> str:
    """The name of a claim in a sentence or a heading."""
    return claim if claim.startswith("p_") else claim.replace("_", " ")


class Reading(NamedTuple):
    """A measured value: a word (yes, drift, wrong limit) and a number."""

    kind: str = ""
    number: float = math.nan
    text: str = ""  # the whole as text, if that is not "kind, number"

    def __str__(self) -> str:
        if self.text or math.isnan(self.number):
            return self.text or self.kind
        return f"{self.kind}, {self.number:.0e}".replace("0e+00", "0")

    def __bool__(self) -> bool:
        """Was anything measured?"""
        return bool(str(self))


UNMEASURED = Reading()


class Finding(NamedTuple):
    """One row of the claims table."""

    claim: str
    declared: str
    measured: Reading
    verdict: str
    why: str  # a clause that completes "CLAIM is VERDICT: ..."
    value: float = math.nan  # the number that decides
    resolution: float = math.nan  # the least value that the battery can tell from a true claim

    def sentence(self, name: str) -> str:
        """The verdict in words."""
        claimed = f"claims {self.declared}" if self.declared else "claims nothing"
        return f"{name}, {claim_name(self.claim)}: {claimed}; {self.verdict}: {self.why}."

    def plain(self) -> dict[str, str | float | None]:
        """The finding as values for JSON; a number that is not finite becomes None."""
        numbers = {name: getattr(self, name) for name in ("value", "resolution")}
        finite = {name: number if math.isfinite(number) else None for name, number in numbers.items()}
        return self._asdict() | {"measured": str(self.measured)} | finite


def error_units(name: str) -> str:
    """The unit of an error of a trajectory, to append to a number: rad for angles, empty for lengths."""
    units = {"momentum": " times |L|", "rates": " rad per unit time"}
    return "" if name.endswith("_length") else units.get(name, " rad")


def yes_no(value: bool | int | None) -> str:
    """A claim as text: "yes", "no", a number, or "" for None."""
    if value is None:
        return ""
    return ("yes" if value else "no") if isinstance(value, bool) else str(value)


def agreement(
    claim: str, declared: bool | None, holds: bool | None, why: str, value: float, resolution: float
) -> Finding:
    """The finding on a claim that is true or false, from the measured answer `holds`; None is undecided."""
    verdict = "measured" if declared is None else "confirmed" if declared == holds else "refuted"
    measured, verdict = (UNMEASURED, "undecided") if holds is None else (Reading(yes_no(holds), value), verdict)
    return Finding(claim, yes_no(declared), measured, verdict, why, value, resolution)


def undecided(claim: str, declared: str, why: str) -> Finding:
    """The finding on a claim that could not be judged; a reason above `LONGEST` characters is cut."""
    text = why.rstrip(".") if len(why) <= LONGEST else why[: LONGEST - len(ELLIPSIS)].rsplit(" ", 1)[0] + ELLIPSIS
    return Finding(claim, declared, UNMEASURED, "undecided", text)


def inapplicable(claim: str, why: str, declared: str = "") -> Finding:
    """The finding on a claim that does not apply, with the reason."""
    return Finding(claim, declared, UNMEASURED, "inapplicable", why)


class About(NamedTuple):
    """Facts about a step that is judged through an adapter."""

    name: str = ""
    chart: str = ""
    implementation: str = ""
    seconds_a_step: float = 0.0
    seed: int = 0  # of the random starts, times and steps
    nutation: float = math.nan  # period of the scene, in its unit of time


@dataclass(frozen=True)
class Ledger:
    """The claims table of one integrator; as text, the report of `symtop judge`."""

    integrator: str
    scene: str
    findings: tuple[Finding, ...]
    traces: dict[str, np.ndarray]  # data for figures: errors by step, defects by differencing width, long runs
    about: About = field(default_factory=About)  # facts about a step from an adapter
    implied: frozenset[str] = frozenset()  # claims that follow from those that were made

    def __str__(self) -> str:
        return "\n".join([heading(self.about, self.scene), *filter(None, map(line, self.findings)), summary(self)])

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
        """Iterate over the names of the claims, which ``in`` tests."""
        return iter([finding.claim for finding in self.findings])

    def dataset(self) -> xr.Dataset:
        """The table as a dataset over ``claim``, with traces over ``setting`` (order), ``width`` and ``window``."""
        rows = [finding._replace(measured=str(finding.measured)) for finding in self.findings]  # type: ignore[arg-type]
        columns: dict[str, Any] = {
            name: ("claim", [getattr(row, name) for row in rows]) for name in Finding._fields[1:]
        }
        axes = dict.fromkeys(("step_size", "error", "fitted"), "setting")
        axes |= dict.fromkeys(("long_nutations", "energy_change"), "window")
        for name, row in self.traces.items():
            columns[name] = ((axes.get(name, "width"),) if row.ndim else (), row.astype(float))
        attributes = self.about._asdict() | {"scene": self.scene} if self.about.name else {}
        return xr.Dataset(columns, {"claim": list(self)}, attributes)


def as_time(seconds: float) -> str:
    """A short time as text with a suitable unit: 5.4 us, 4.8 ms."""
    size, unit = next(pair for pair in UNITS if not float(f"{seconds:.3g}") < pair[0])
    return f"{seconds / (size or 1e-9):.3g} {unit}"


def heading(about: About, scene: str) -> str:
    """The first line of a report: name, chart, scene, time of a step and seed."""
    cost = f", {as_time(about.seconds_a_step)} a step" if about.seconds_a_step else ""
    chart = f" in the {about.chart} chart" if about.chart else ""
    seed = f", seed {about.seed}" if about.seed else ""
    return f"{about.name}{chart} on {scene}{cost}{seed}\n"


def line(finding: Finding, width: int = WIDTH) -> str:
    """A finding in one line, with the reason below it if a claim does not hold; empty for trivial findings."""
    claim, declared, measured, verdict, why, value, _ = finding
    trivial = verdict == "inapplicable" or claim == "explicit" or measured.kind in ("a function", "its states'")
    if trivial and not declared:
        return ""
    phrase = PHRASES.get(f"{claim} {measured.kind}") or ("{1}" if measured.text else PHRASES.get(measured.kind, "{1}"))
    number = value if math.isnan(measured.number) else measured.number
    words = phrase.format(number, measured).replace("to 0e+00", "to the last bit") if measured else verdict
    text = f"{claim_name(claim):<14} {words}"
    if declared:
        text += f" (claimed: {declared}{f'; {verdict}' if measured else ''})"
    if verdict in ("confirmed", "measured") and claim != "calls":
        return text
    if why.startswith(AS_WITH):
        return f"{text}, {why}"
    return text + "\n" + textwrap.indent(textwrap.fill(f"{why}.", width - 4), "    ")


def description(findings: Sequence[Finding]) -> str:
    """The measured properties of a method in a phrase: "order 2, symplectic, reversible, keeps p_phi; not p_psi"."""
    measured = {finding.claim: finding.measured for finding in findings}
    decided = {finding.claim: finding.measured for finding in findings if finding.verdict != "undecided"}
    errors = {row.claim.removesuffix("_error"): row.value for row in findings if row.measured and "_error" in row.claim}
    words = [f"{name} within {value:.1e}{error_units(name)} of {'one' if name.endswith('_length') else 'the truth'}"
             for name, value in errors.items()]  # fmt: skip
    if order := measured.get("order"):
        p, limits = order.number, {"wrong limit": "converges to another motion", "converges": order.text}
        words += [limits.get(order.kind) or (f"order {round(p)}" if abs(p - round(p)) < 0.3 else f"order {p:.1f}")]
        words[-1] += " or more" * order.text.endswith("or more")
    for claim, word in (("symplectic", "symplectic"), ("symmetric", "reversible")):
        kind = measured.get(claim, UNMEASURED).kind
        words += [word] if kind == "yes" else [f"not {word}"] if kind == "no" else []

    def of_kind(*kinds: str) -> str:
        return _listed([name for claim, name in NOUNS.items() if decided.get(claim, UNMEASURED).kind in kinds])

    constant, bounded = of_kind("kept"), of_kind("bounded")
    changing = of_kind("drift", "growing", "random walk", "blows up")
    words += [f"keeps {constant}"] if constant else []
    words += [f"{bounded} bounded"] if bounded else []
    negation = "not" if constant or bounded else "does not keep"
    words = [", ".join(words)] * bool(words) + [f"{negation} {changing}"] * bool(changing)
    return "; ".join(words) or "nothing could be measured"


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), *names[-1:]] if len(names) > 1 else names)


def summary(ledger: Ledger) -> str:
    """The end of a report: the runs, the measured properties, and the verdicts on the claims made and implied."""
    counts = []
    for implied in (False, True):
        claimed = [row for row in ledger.findings if row.declared and (row.claim in ledger.implied) is implied]
        count = Counter(row.verdict for row in claimed)
        counts.append(", ".join(f"{count[word]} {word}" for word in VERDICTS if count[word]))
    claims = f"Claims: {counts[0]}" if counts[0] else "No claims were made"
    names = _listed([claim_name(name) for name in sorted(ledger.implied)])
    claims += f". Implied by them ({names}): {counts[1]}" if counts[1] else ""
    return f"\n{_runs(ledger)}It is: {description(ledger.findings)}.\n{claims}."


def _runs(ledger: Ledger) -> str:
    """The steps per nutation and the lengths of the runs, and the steps that failed; empty for a trajectory."""
    traces, words, of_body = ledger.traces, [], ledger.about.chart == "body"
    period = "natural period" if of_body else "nutation"
    ladder = ledger.about.nutation / np.asarray(traces.get("step_size", []))  # NaN where no run was made
    if np.isfinite(ladder).any():
        failed = ladder[np.isnan(traces["error"]) & np.isfinite(ladder)]
        note = f" ({failed.max():.0f} and fewer fail)" if failed.size else ""
        density = ledger.about.nutation / traces.get("structure_step", math.nan)
        structure = f", {density:.1f} for the structure" if math.isfinite(density) else ""
        span = f"{np.nanmin(ladder):.0f} to {np.nanmax(ladder):.0f}"
        words.append(f"{span} steps a {period} for the order{note}{structure}")
    if "steps_run" in traces and (steps := float(traces["steps_run"])):
        periods = float(traces["nutations_run"])
        length = f"{steps:.0f} steps over {periods:.3g} {period}s ({steps / periods:.0f} a {period})"
        scales = "kinetic one of the start and |mgl|, of the momentum to |L|"
        scales = scales if of_body else "nutation's, of momenta to the larger one"
        words += [f"{length} for the constants", f"changes of the energy are relative to the {scales}"]
    text = ";\n    ".join(words)
    return f"Its runs: {text}.\n" if words else ""
