"""The engines as a section of the report: which was run, whether the map is its own, and what follows."""

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks import pages
from benchmarks.engines.measure import COMPARED, COUNT, LEVEL, STEPS, agrees
from benchmarks.pages import Table
from symtop.methods.framework.registry import integrator
from symtop.report.formats import FEW, counted

NAME = "live-engines"  # of the findings; `engines` is the study of the maps
UNRUN = "YADE is not run: its map is held by its formula and a reference value alone."
HEADER = (
    "engine", "version", "setting", "body", "map", "axis error (rad)",
    *(f"{name}: {what}" for name in STEPS for what in ("one step", f"{COMPARED} steps")), "same map",
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


def _number(made: dict[str, Any], key: str) -> str:
    return f"{made[key]:.1e}" if key in made else ""


def cells(made: dict[str, Any]) -> list[str]:
    """One line of the table."""
    differences = [_number(made, f"{name}_{what}") for name in STEPS for what in ("step", "steps")]
    same = "yes" if agrees(made) else made.get("failed") or ("no" if made["method"] else "none in the catalogue")
    start = [str(made[key]) for key in ("engine", "version", "name", "held", "method")]
    return [*start, _number(made, "goldstein_axis"), *differences, same]


def _largest(rows: Sequence[dict[str, Any]], what: str) -> str:
    return f"{max((made[f'{name}_{what}'] for made in rows for name in STEPS), default=0.0):.0e}"


def few(names: Sequence[str], noun: str) -> str:
    """The names, if they are few; otherwise how many there are."""
    return ", ".join(names) if len(names) <= FEW else counted(len(names), noun)


def verdict(rows: Sequence[dict[str, Any]]) -> list[str]:
    """How many settings have the map of the catalogue, to what, and which have not."""
    said, compared = [], [made for made in rows if made["method"]]
    for precision, single in (("double", False), ("single", True)):
        part = [made for made in compared if (integrator(made["method"]).precision == "single") is single]
        same = [made for made in part if agrees(made)]
        if part:
            said.append(
                f"{len(same)} of {len(part)} settings in {precision} precision step by the map of the catalogue: they "
                f"differ by at most {_largest(same, 'step')} after one step and {_largest(same, 'steps')} within "
                f"{COMPARED}."
            )
    others = [f"{made['engine']} ({made['name']}, {made['held']})" for made in compared if not agrees(made)]
    none = [made for made in rows if not made["method"]]
    if others:
        said.append(f"Not the map: {few(others, 'setting')}.")
    if none:
        engines = list(dict.fromkeys(made["engine"] for made in none))
        said.append(
            f"{counted(len(none), 'setting')} of {few(engines, 'engine')} ran without a map in the catalogue, and "
            "show their error alone in the table."
        )
    return said


def findings(rows: Sequence[dict[str, Any]], missing: Sequence[str], record: Mapping[str, Any]) -> dict[str, Any]:
    """What the report wants, and the numbers themselves."""
    failed = [f"{made['engine']} ({made['name']}): {made['failed']}" for made in rows if "failed" in made]
    table = Table("Engines against their maps", HEADER, [cells(made) for made in rows])
    return pages.findings(
        NAME, "Engines against their maps", "Are the maps of the catalogue those that the engines take?", verdict(rows),
        HOW_TO_READ, [table], failures=[*missing, *failed], cases=len(rows),
        rows=list(rows), missing=list(missing), **record,
    )  # fmt: skip
