"""The engines as a section of the report: which was run, whether the map is its own, and what follows."""

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks import pages
from benchmarks.engines.measure import COMPARED, COUNT, LEVEL, STEPS, agrees
from benchmarks.pages import Table
from symtop.methods.framework.registry import integrator
from symtop.report.formats import MOST_NAMES, counted

NAME = "live-engines"  # of the findings; `engines` is the study of the maps
UNRUN = "YADE is not run: its map is held by its formula and a reference value alone."
HEADER = (
    "engine", "version", "setting", "body", "map", "axis error (rad)",
    *(f"{name}: {suffix}" for name in STEPS for suffix in ("one step", f"{COMPARED} steps")), "same map",
)  # fmt: skip
HOW_TO_READ = (
    "Each engine steps one body with a fixed centre in the torque mgl k x e, taken at the start of the step (Exudyn: "
    "in each stage), or the same top on its own ball joint in its own gravity. Damping, limits of speed, sleep and "
    f"contacts are off. Steps: {', '.join(f'{step:g} s on {name}' for name, step in STEPS.items())}. Chart: attitude. "
    "A difference is the largest of that of the quaternions and of that of the angular velocities over the first "
    f"one, after one step and within {COMPARED}. The axis error is the largest within {COUNT} steps of goldstein. "
    f"A map is called the engine's own if one step agrees to {LEVEL[False]:.0e} in double and to {LEVEL[True]:.0e} in "
    "single precision on both scenes. A setting without a map shows its error alone, which on the engine's own joint "
    f"is that of integrator and joint solver together. {UNRUN}"
)


def _number(row: dict[str, Any], key: str) -> str:
    return f"{row[key]:.1e}" if key in row else ""


def cells(row: dict[str, Any]) -> list[str]:
    """One line of the table."""
    differences = [_number(row, f"{name}_{suffix}") for name in STEPS for suffix in ("step", "steps")]
    same = "yes" if agrees(row) else row.get("failed") or ("no" if row["method"] else "none in the catalogue")
    start = [str(row[key]) for key in ("engine", "version", "name", "held", "method")]
    return [*start, _number(row, "goldstein_axis"), *differences, same]


def _largest(rows: Sequence[dict[str, Any]], suffix: str) -> str:
    return f"{max((row[f'{name}_{suffix}'] for row in rows for name in STEPS), default=0.0):.0e}"


def few(names: Sequence[str], noun: str) -> str:
    """The names, if they are few; otherwise how many there are."""
    return ", ".join(names) if len(names) <= MOST_NAMES else counted(len(names), noun)


def verdict(rows: Sequence[dict[str, Any]]) -> list[str]:
    """How many settings have the map of the catalogue, to what, and which have not."""
    sentences, compared = [], [row for row in rows if row["method"]]
    for precision, single in (("double", False), ("single", True)):
        part = [row for row in compared if (integrator(row["method"]).precision == "single") is single]
        same = [row for row in part if agrees(row)]
        if part:
            sentences.append(
                f"{len(same)} of {len(part)} settings in {precision} precision step by the map of the catalogue: they "
                f"differ by at most {_largest(same, 'step')} after one step and {_largest(same, 'steps')} within "
                f"{COMPARED}."
            )
    others = [f"{row['engine']} ({row['name']}, {row['held']})" for row in compared if not agrees(row)]
    none = [row for row in rows if not row["method"]]
    if others:
        sentences.append(f"Not the map: {few(others, 'setting')}.")
    if none:
        engines = list(dict.fromkeys(row["engine"] for row in none))
        sentences.append(
            f"{counted(len(none), 'setting')} of {few(engines, 'engine')} ran without a map in the catalogue, and "
            "show their error alone in the table."
        )
    return sentences


def findings(rows: Sequence[dict[str, Any]], missing: Sequence[str], record: Mapping[str, Any]) -> dict[str, Any]:
    """What the report wants, and the numbers themselves."""
    failed = [f"{row['engine']} ({row['name']}): {row['failed']}" for row in rows if "failed" in row]
    table = Table("Engines against their maps", HEADER, [cells(row) for row in rows])
    return pages.findings(
        NAME, "Engines against their maps", "Are the maps of the catalogue those that the engines take?", verdict(rows),
        HOW_TO_READ, [table], failures=[*missing, *failed], cases=len(rows),
        rows=list(rows), missing=list(missing), **record,
    )  # fmt: skip
