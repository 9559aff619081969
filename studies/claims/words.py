"""Tables and sentences of the study."""

from collections import Counter

import xarray as xr

from symtop.judging.claims import SCENE
from symtop.judging.ledger import CLAIMS, VERDICTS, Finding, spoken
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
    """Declared, measured and verdict of every cell; then what was refuted or left open, in words."""
    judged = findings(data)
    rows = [[name, *map(_cell, row)] for name, row in judged.items()]
    table = Table(f"Declared | measured, and the verdict: {LEGEND}", ["integrator", *map(spoken, CLAIMS)], rows)
    reasons = [
        [name, spoken(finding.claim), finding.declared, finding.verdict, finding.why]
        for name, finding in with_verdict(judged, "refuted", "undecided")
    ]
    title = f"What was refuted or left open, on {SCENE} where no other scene is named, and why"
    return [table, Table(title, ["integrator", "claim", "declared", "verdict", "why"], reasons)] if reasons else [table]


def _cell(finding: Finding) -> str:
    text = f" {finding.declared or 'nothing'} | {finding.measured or 'unknown'}"
    return SYMBOLS[finding.verdict] + ("" if finding.verdict == "inapplicable" else text)


def verdict(data: xr.Dataset) -> list[str]:
    """How many claims are confirmed, which are refuted, and which could not be judged."""
    judged = findings(data)
    refuted = [finding.sentence(name) for name, finding in with_verdict(judged, "refuted")]
    undecided = [f"{spoken(finding.claim)} of {name}" for name, finding in with_verdict(judged, "undecided")]
    sentences = [
        f"Of the claims of {len(judged)} integrators, {count_words(judged)}.",
        *(refuted or ["No claim is refuted."]),
    ]
    if undecided:
        sentences.append(f"Undecided: {', '.join(undecided)}.")
    runs, most = data["steps_run"].isel(scene=0), int(data["steps_run"].max())
    steps = dict(zip(data["integrator"].values, runs.values, strict=True))
    shorter = ", ".join(f"{name} ({int(made)})" for name, made in steps.items() if 0 < made < most)
    if shorter:
        sentences.append(f"The long run had fewer steps than the others' {most} for {shorter}.")
    return sentences
