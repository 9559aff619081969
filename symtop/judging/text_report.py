"""The report of a judged step: a line a claim, the reasons that matter, and what the method is in one sentence."""

import math
import textwrap
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from symtop.judging.findings import NOTHING, Finding, Measured, claim_name

COLUMNS = {"claim": 13, "claimed": 12, "measured": 24, "verdict": 12}
WIDTH = 100
UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (0.0, "ns"))
KEPT = {"energy": "the energy", "p_phi": "p_phi", "p_psi": "p_psi", "axis_length": "|e|"}


def heading(about: Mapping[str, Any], scene: str) -> str:
    """What is judged, and the names of the columns."""
    pace = about["seconds_a_step"]
    unit = next(one for one in UNITS if pace >= one[0])
    cost = f", {pace / (unit[0] or 1e-9):.3g} {unit[1]} a step" if pace else ""
    names = "".join(name.ljust(width) for name, width in COLUMNS.items())
    chart = f" in the {about['chart']} chart" if about["chart"] else ""
    return f"{about['name']}{chart} on {scene}{cost}\n\n{names}the number that decides"


def line(finding: Finding, width: int = WIDTH) -> str:
    """A finding in one line, and its reason below where it is no plain number; empty if nobody asked what cannot be."""
    if finding.verdict == "inapplicable" and not finding.declared:
        return ""
    cells = (claim_name(finding.claim), finding.declared or "-", str(finding.measured) or "-", finding.verdict)
    shown = "".join(
        f"{cell if len(cell) < size else cell[: size - 2] + '~'}".ljust(size)
        for cell, size in zip(cells, COLUMNS.values(), strict=True)
    )
    if math.isfinite(finding.value):
        shown += f"{finding.value:.3g}"
        shown += f" (resolved: {finding.resolution:.1g})" if math.isfinite(finding.resolution) else ""
    if finding.verdict in ("confirmed", "measured") and not (finding.claim == "calls" and ";" in finding.why):
        return shown.rstrip()
    return shown.rstrip() + "\n" + textwrap.indent(textwrap.fill(f"{finding.why}.", width - 4), "    ")


def description(findings: Sequence[Finding]) -> str:
    """What the method is, whatever is claimed of it: "order 2, symplectic, reversible, keeps p_phi; not p_psi"."""
    measured = {one.claim: one.measured for one in findings}
    errors = {one.claim.removesuffix("_error"): one.value for one in findings if one.claim.endswith("_error")}
    words = [f"{name} within {value:.1e} rad of the truth" for name, value in errors.items()]  # of a trajectory
    words += [_order(measured["order"])] if measured.get("order") else []
    for claim, yes in (("symplectic", "symplectic"), ("symmetric", "reversible")):
        answer = measured.get(claim, NOTHING).kind
        words += [yes] if answer == "yes" else [f"not {yes}"] if answer == "no" else []

    def of_kind(*kinds: str) -> str:
        return _listed([name for claim, name in KEPT.items() if measured.get(claim, NOTHING).kind in kinds])

    kept, bounded, lost = of_kind("kept"), of_kind("bounded"), of_kind("drift", "growing", "random walk")
    words += [f"keeps {kept}"] if kept else []
    words += [f"{bounded} bounded"] if bounded else []
    return (", ".join(words) or "nothing could be measured") + (f"; not {lost}" if lost else "")


def _order(measured: Measured) -> str:
    if measured.kind == "wrong limit":
        return "converges to another motion"
    number = measured.number
    return f"order {round(number)}" if abs(number - round(number)) < 0.3 else f"order {number:.1f}"


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), *names[-1:]] if len(names) > 1 else names)


def summary(findings: Sequence[Finding], implied: Collection[str] = ()) -> str:
    """What the method is, and how many claims hold: those that were made, and those that follow from them."""
    own = _counted([one for one in findings if one.declared and one.claim not in implied])
    theirs = _counted([one for one in findings if one.declared and one.claim in implied])
    claims = f"Claims: {own}" if own else "No claims were made"
    follow = (
        f". Implied by them ({_listed([claim_name(name) for name in sorted(implied)])}): {theirs}" if theirs else ""
    )
    return f"\nIt is: {description(findings)}.\n{claims}{follow}."


def _counted(findings: Sequence[Finding]) -> str:
    counts = Counter(one.verdict for one in findings)
    return ", ".join(f"{counts[word]} {word}" for word in ("confirmed", "refuted", "undecided") if counts[word])
