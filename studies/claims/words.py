"""Captions, tables and sentences of the study."""

import xarray as xr

from symtop.judge.claims import SCENE
from symtop.judge.ledger import CLAIMS, VERDICTS, Finding, spoken
from symtop.runner.study import Table

from .tables import Defect, Findings, counts, findings, shorter_runs, with_verdict

SYMBOLS = {"confirmed": "✓", "refuted": "✗", "measured": "·", "undecided": "?", "inapplicable": "–"}
LEGEND = ", ".join(f"{SYMBOLS[verdict]} {verdict}" for verdict in VERDICTS)


def row_name(scene: str, integrator: str) -> str:
    """The name of a row: the integrator, and the scene where it is a user's."""
    return integrator if scene == SCENE else f"{integrator} on {scene}"


def count_words(judged: Findings) -> str:
    """How many claims have each verdict."""
    number = counts(judged)
    parts = [f"{count} {verdict}" for verdict, count in number.items() if verdict != "inapplicable"]
    return f"{', '.join(parts)} of {sum(number.values()) - number['inapplicable']} that apply"


def matrix(judged: Findings) -> str:
    """Caption of the matrix of verdicts."""
    return (
        f"Every claim of every integrator: {count_words(judged)}. The text of a cell is what was measured; grey cells "
        "claim nothing, white ones do not apply."
    )


def bracket(measured: dict[str, Defect]) -> str:
    """Caption of the defects of a step."""
    falling = ", ".join(name for name, defect in measured.items() if defect.falls)
    level = ", ".join(name for name, defect in measured.items() if not defect.falls)
    return (
        "How far one step is from preserving the Poisson bracket, which a symplectic step does, against the width of "
        "the central differences that measure it. For a symplectic step the defect is an error of the differencing and "
        f"falls with the square of the width: {falling or 'none'}. For the others it is real and levels off: "
        f"{level or 'none'}."
    )


def tables(data: xr.Dataset) -> list[Table]:
    """Declared, measured and verdict of every cell; then what was refuted or left open, in words."""
    judged = findings(data)
    rows = [[row_name(*cell), *(_cell(finding) for finding in row)] for cell, row in judged.items()]
    table = Table(f"Declared | measured, and the verdict: {LEGEND}", ["integrator", *map(spoken, CLAIMS)], rows)
    reasons = [
        [name, scene, spoken(finding.claim), finding.declared, finding.verdict, finding.why]
        for scene, name, finding in with_verdict(judged, "refuted", "undecided")
    ]
    header = ["integrator", "scene", "claim", "declared", "verdict", "why"]
    return [table, Table("What was refuted or left open, and why", header, reasons)] if reasons else [table]


def _cell(finding: Finding) -> str:
    text = f"{finding.declared or 'nothing'} | {finding.measured or 'unknown'}"
    symbol = SYMBOLS[finding.verdict]
    return symbol if finding.verdict == "inapplicable" else f"{symbol} {text}"


def verdict(data: xr.Dataset) -> list[str]:
    """How many claims are confirmed, which are refuted, and which could not be judged."""
    judged = findings(data)
    sentences = [f"Of the claims of {len(judged)} integrators, {count_words(judged)}."]
    refuted = [finding.sentence(name) for _, name, finding in with_verdict(judged, "refuted")]
    sentences += refuted or ["No claim is refuted."]
    undecided = [f"{spoken(finding.claim)} of {name}" for _, name, finding in with_verdict(judged, "undecided")]
    if undecided:
        sentences.append(f"Undecided: {', '.join(undecided)}.")
    most, shorter = shorter_runs(data)
    if shorter:
        listed = ", ".join(f"{name} ({steps})" for name, steps in shorter.items())
        sentences.append(f"The long run had fewer steps than the others' {most} for {listed}.")
    return sentences
