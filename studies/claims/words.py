"""Tables and sentences of the study."""

from collections import Counter

import xarray as xr

from symtop.judging.battery import CLAIMS, SCENE
from symtop.judging.findings import VERDICTS, Finding, claim_name
from symtop.report.sentences import FEW, joined
from symtop.runner.study import Table

from .tables import findings

SYMBOLS = {"confirmed": "✓", "refuted": "✗", "measured": "○", "undecided": "?", "inapplicable": "∅"}
LEGEND = ", ".join(f"{SYMBOLS[verdict]} {verdict}" for verdict in VERDICTS)


def count_words(judged: dict[str, list[Finding]]) -> str:
    """How many claims have each verdict."""
    number = Counter(finding.verdict for row in judged.values() for finding in row)
    applicable = [verdict for verdict in VERDICTS if verdict != "inapplicable"]
    total = sum(number[verdict] for verdict in applicable)
    return f"{', '.join(f'{number[verdict]} {verdict}' for verdict in applicable)} of {total} that apply"


def with_verdict(judged: dict[str, list[Finding]], *verdicts: str) -> list[tuple[str, Finding]]:
    """(integrator, finding) of all findings with one of those verdicts."""
    return [(name, finding) for name, row in judged.items() for finding in row if finding.verdict in verdicts]


def tables(data: xr.Dataset) -> list[Table]:
    """Declared, measured and verdict of every cell; what was refuted or left open, in words; the long runs."""
    judged = findings(data)
    rows = [[name, *map(_cell, row)] for name, row in judged.items()]
    table = Table(f"Declared | measured, and the verdict: {LEGEND}", ["integrator", *map(claim_name, CLAIMS)], rows)
    reasons = [
        [name, claim_name(finding.claim), finding.declared, finding.verdict, finding.why]
        for name, finding in with_verdict(judged, "refuted", "undecided")
    ]
    title = f"What was refuted or left open, on {SCENE} where no other scene is named, and why"
    open_ = [Table(title, ["integrator", "claim", "declared", "verdict", "why"], reasons)] if reasons else []
    by_steps: dict[int, list[str]] = {}
    for name, made in steps_run(data).items():
        by_steps.setdefault(made, []).append(name)
    lengths = [[f"{made:,}", str(len(names)), ", ".join(names)] for made, names in sorted(by_steps.items())]
    runs = [Table("Steps of the long run", ["steps", "integrators", "which"], lengths)] if lengths else []
    return [table, *open_, *runs]


def _cell(finding: Finding) -> str:
    text = f" {finding.declared or 'nothing'} | {finding.measured or 'unknown'}"
    return SYMBOLS[finding.verdict] + ("" if finding.verdict == "inapplicable" else text)


def verdict(data: xr.Dataset) -> list[str]:
    """How many claims are confirmed, which are refuted, which could not be judged, and how long the long runs were."""
    judged = findings(data)
    refuted, undecided = with_verdict(judged, "refuted"), with_verdict(judged, "undecided")
    number = Counter(finding.verdict for row in judged.values() for finding in row)
    counted = (
        f"{number['confirmed']} claims of {len(judged)} integrators are confirmed and {len(refuted) or 'none'} "
        f"refuted. {number['measured']} properties that nobody claims are measured all the same."
    )
    sentences = [counted, *(finding.sentence(name) for name, finding in refuted[:FEW])]
    if len(refuted) > FEW:
        sentences.append(f"{len(refuted) - FEW} more claims are refuted; the table of what was refuted has them.")
    if undecided:
        by_claim = Counter(claim_name(finding.claim) for _, finding in undecided)
        listed = joined([f"{claim} with {count}" for claim, count in by_claim.most_common()])
        sentences.append(f"{len(undecided)} claims are undecided: {listed} integrators. A table says why.")
    return [*sentences, *long_runs(data)]


def steps_run(data: xr.Dataset) -> dict[str, int]:
    """The steps of the long run of every integrator that made one."""
    runs = data["steps_run"].isel(scene=0).values
    return {str(name): int(made) for name, made in zip(data["variant"].values, runs, strict=True) if made > 0}


def long_runs(data: xr.Dataset) -> list[str]:
    """How many steps the long runs took; nothing if there was none."""
    steps = steps_run(data)
    if not steps:
        return []
    ((usual, count),) = Counter(steps.values()).most_common(1)
    least, most = min(steps, key=lambda name: steps[name]), max(steps, key=lambda name: steps[name])
    said = (
        f"The long run has {usual:,} steps with {count} of {len(steps)} integrators. "
        f"{least} has the fewest, {steps[least]:,}; {most} has the most, {steps[most]:,}."
    )
    return [said]
