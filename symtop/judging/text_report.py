"""The report of a judged step: a line a claim, the reasons that matter, and what the method is in one sentence."""

import math
import textwrap
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from symtop.judging.findings import Finding, spoken

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
    cells = (spoken(finding.claim), finding.declared or "-", str(finding.measured) or "-", finding.verdict)
    columns = "".join(_cut(cell, size) for cell, size in zip(cells, COLUMNS.values(), strict=True))
    shown = columns + _number(finding)
    if finding.verdict in ("confirmed", "measured") and ";" not in (finding.why if finding.claim == "calls" else ""):
        return shown.rstrip()
    return (
        shown.rstrip() + "\n" + textwrap.fill(f"{finding.why}.", width, initial_indent="    ", subsequent_indent="    ")
    )


def _cut(text: str, size: int) -> str:
    return f"{text if len(text) < size else text[: size - 2] + '~'}".ljust(size)


def _number(finding: Finding) -> str:
    if not math.isfinite(finding.value):
        return ""
    number = f"{finding.value:.3g}"
    return f"{number} (resolved: {finding.resolution:.1g})" if math.isfinite(finding.resolution) else number


def described(findings: Sequence[Finding]) -> str:
    """What the method is, whatever is claimed of it: "order 2, symplectic, reversible, keeps p_phi; not p_psi"."""
    by_claim = {one.claim: one for one in findings}
    words = [_order(by_claim)]
    for claim, yes in (("symplectic", "symplectic"), ("symmetric", "reversible")):
        answer = by_claim[claim].measured.kind if claim in by_claim else ""
        words += [yes] if answer == "yes" else [f"not {yes}"] if answer == "no" else []
    kinds = {name: by_claim[name].measured.kind for name in KEPT if name in by_claim}
    kept = [KEPT[name] for name, kind in kinds.items() if kind == "kept"]
    lost = [KEPT[name] for name, kind in kinds.items() if kind in ("drift", "growing", "random walk")]
    bounded = [KEPT[name] for name, kind in kinds.items() if kind == "bounded"]
    words += [f"keeps {_listed(kept)}"] if kept else []
    words += [f"{_listed(bounded)} bounded"] if bounded else []
    wrong = {name.removesuffix("_error"): one for name, one in by_claim.items() if name.endswith("_error")}
    if wrong:  # a trajectory
        words = [f"{name} within {one.value:.1e} rad of the truth" for name, one in wrong.items()] + words
    sentence = ", ".join(word for word in words if word)
    return (sentence or "nothing could be measured") + (f"; not {_listed(lost)}" if lost else "")


def _order(by_claim: Mapping[str, Finding]) -> str:
    one = by_claim.get("order")
    if one is None or not one.measured:
        return ""
    if one.measured.kind == "wrong limit":
        return "converges to another motion"
    number = one.measured.number
    return f"order {round(number)}" if abs(number - round(number)) < 0.3 else f"order {number:.1f}"


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def ending(findings: Sequence[Finding], implied: Collection[str] = ()) -> str:
    """What the method is, and how many claims hold: those that were made, and those that follow from them."""
    own = _counted([one for one in findings if one.declared and one.claim not in implied])
    theirs = _counted([one for one in findings if one.declared and one.claim in implied])
    claims = f"Claims: {own}" if own else "No claims were made"
    follow = f". Implied by them ({_listed([spoken(name) for name in sorted(implied)])}): {theirs}" if theirs else ""
    return f"\nIt is: {described(findings)}.\n{claims}{follow}."


def _counted(findings: Sequence[Finding]) -> str:
    counts = Counter(one.verdict for one in findings)
    return ", ".join(
        f"{counts[verdict]} {verdict}" for verdict in ("confirmed", "refuted", "undecided") if counts[verdict]
    )


def screen(
    about: Mapping[str, Any], scene: str, findings: Sequence[Finding], width: int = WIDTH, implied: Collection[str] = ()
) -> str:
    """All of it."""
    lines = [text for one in findings if (text := line(one, width))]
    return "\n".join([heading(about, scene), *lines, ending(findings, implied)])
