"""What goes wrong although nothing looks wrong?

Three short experiments, each a few runs: a physics engine's step without the gyroscopic term, at shorter and shorter
steps; a run beside an unstable motion that keeps its energy; and one method in Euler's angles and on the axis on a
motion that grazes a pole.
"""

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from symtop.measure.errors import errors_against
from symtop.methods.framework.registry import integrator
from symtop.model.scenes import scene
from symtop.report.figures import label_lines
from symtop.report.style import BLUE, GREEN, VERMILLION, few_ticks, panels
from symtop.run.reference.truth import reference
from symtop.run.simulation import integrate
from symtop.runner.study import Case, Picture, Study

TERM, FALLING, POLE = "goldstein", "sleeping-unstable", "bruls-cardona-arnold"  # scenes
WITHOUT, WITH, RIGHT = "no-gyro[axis]", "jolt[axis]", "strang[axis]"  # engines without and with the term; a splitting
ANGLES, AXIS = "rk4[angles]", "rk4[axis]"
LADDER = [32.0 * 2.0**k for k in range(10)]  # steps a nutation
SAMPLES, CLOSE, WRONG = 301, 0.1, 0.01  # of a run; rad, a target for the engine with the term; rad, of a wrong run
ENDED = "ended, in the angles"
LABELS = {WITHOUT: "without the term", WITH: "with the term", RIGHT: "Strang splitting"}


def cases(quick: bool) -> list[Case]:
    """Each run or ladder of runs: scene, variant, steps a nutation, nutations."""
    ladder = LADDER[:6] if quick else LADDER
    return [
        *(Case(TERM, name, {"steps": ladder, "nutations": 10.0}) for name in (WITHOUT, WITH, RIGHT)),
        Case(FALLING, ANGLES, {"steps": [70.0], "nutations": 3.0}),
        *(Case(POLE, name, {"steps": [50.0], "nutations": 2.0}) for name in (ANGLES, AXIS)),
    ]


def measure(case: Case) -> xr.Dataset:
    """Errors of the axis (rad) and the energy (over the nutation's) over ``setting`` and ``sample``, NaN after the end.

    ``warned`` says whether the guard warned before the run.
    """
    on, variant, nutations = scene(case.scene), integrator(case.integrator), case.settings["nutations"]
    parts = []
    for steps in case.settings["steps"]:
        sentences: list[str] = []
        run = integrate(on, variant, step_size=on.nutation_period / steps, horizon=nutations * on.nutation_period,
                        samples=SAMPLES, observe="axis", guard=sentences.append)  # fmt: skip
        wrong = errors_against(on, run, reference(on, run.time, precision="closed-form"))
        valid = (run.time <= run.reached_time) | (run.outcome == "ok")
        row: dict[str, Any] = {name: ("sample", np.where(valid, wrong[name], np.nan)) for name in ("axis", "energy")}
        row |= {"time": ("sample", run.time / on.nutation_period), "outcome": run.outcome, "steps": steps,
                "warned": float(bool(sentences))}  # fmt: skip
        parts.append(xr.Dataset(row))
    return xr.concat(parts, "setting")


def run_of(data: xr.Dataset, on: str, name: str) -> xr.Dataset | None:
    """The runs of a variant on a scene, if they were made."""
    if on not in data["scene"].values or name not in data["variant"].values:
        return None
    runs = data.sel(scene=on, variant=name).dropna("setting", how="all", subset=["axis"])
    return runs if runs.sizes["setting"] else None


def facts(data: xr.Dataset) -> dict[str, Any]:
    """Largest errors of the axis (rad) and of the energy (relative) in each, and when the run at the pole ended."""
    keys = "steps", "without", "without_energy", "needed", "falling", "falling_energy", "ended"
    known: dict[str, Any] = dict.fromkeys(keys) | _warning_counts(data)
    if (runs := run_of(data, TERM, WITHOUT)) is not None:
        last = runs.isel(setting=-1)
        known |= {"steps": float(last["steps"]), "without": float(last["axis"].max()),  # rad
                  "without_energy": float(last["energy"].max())}  # fmt: skip
    if (term := run_of(data, TERM, WITH)) is not None:
        close = term["steps"].values[term["axis"].max("sample").values < CLOSE]
        known["needed"] = float(close.min()) if close.size else None
    if (falling := run_of(data, FALLING, ANGLES)) is not None:
        known |= {"falling": float(falling["axis"].max()), "falling_energy": float(falling["energy"].max())}
    if (ended := run_of(data, POLE, ANGLES)) is not None:
        known["ended"] = float(ended["time"].where(np.isfinite(ended["axis"])).max())
    return known


def _warning_counts(data: xr.Dataset) -> dict[str, int]:
    """How many runs were wrong or ended early, how many were not, and in how many of each the guard warned."""
    ran = np.isfinite(data["steps"])
    bad = ((data["axis"].max("sample") > WRONG) | (data["outcome"] != "ok")) & ran
    warned = data["warned"] > 0.0
    counts = {"bad": bad, "bad_warned": bad & warned, "good": ran & ~bad, "good_warned": ran & ~bad & warned}
    return {name: int(mask.sum()) for name, mask in counts.items()}


def tables(data: xr.Dataset) -> dict[str, pd.DataFrame]:
    """Every run with its largest errors and how it ended, the shortest step of each variant first."""
    parts = []
    for on in map(str, data["scene"].values):
        for name in map(str, data["variant"].values):
            if (runs := run_of(data, on, name)) is not None:
                worst = runs[["steps", "outcome", "warned"]].assign(runs[["axis", "energy"]].max("sample"))
                worst["warned"] = worst["warned"].astype(bool)
                parts.append(worst.isel(setting=slice(None, None, -1)).to_pandas().assign(scene=on, variant=name))
    names = {"steps": "steps a nutation", "axis": "axis error (rad)", "energy": "energy error / energy of the nutation",
             "warned": "guard warned"}  # fmt: skip
    rows = pd.concat([part.reset_index(drop=True) for part in parts]).sort_index(kind="stable").rename(columns=names)
    return {"runs": rows[["scene", "variant", *names.values(), "outcome"]]}


def lines(data: xr.Dataset) -> list[list[tuple[str, str, Any, Any]]]:
    """Name, colour, x and y of the lines of each panel."""
    curves: list[list[tuple[str, str, Any, Any]]] = [[], [], []]
    for name, color in ((WITHOUT, VERMILLION), (WITH, BLUE), (RIGHT, GREEN)):
        if (runs := run_of(data, TERM, name)) is not None:
            curves[0].append((LABELS[name], color, runs["steps"].values, runs["axis"].max("sample").values))
    if (runs := run_of(data, FALLING, ANGLES)) is not None:
        late = runs.isel(setting=0, sample=slice(1, None))
        for key, color, label in (("axis", VERMILLION, "axis (rad)"), ("energy", BLUE, "energy (relative)")):
            curves[1].append((label, color, late["time"].values, late[key].values))
    for name, color, label in ((ANGLES, VERMILLION, ENDED), (AXIS, GREEN, "on the axis")):
        if (runs := run_of(data, POLE, name)) is not None:
            late = runs.isel(setting=0, sample=slice(1, None))
            curves[2].append((label, color, late["time"].values, late["axis"].values))
    return [[(label, color, x[y > 0.0], y[y > 0.0]) for label, color, x, y in panel] for panel in curves]


def pictures(data: xr.Dataset) -> list[Picture]:
    """Three small panels beside each other."""
    figure, axes = panels(1, 3)
    figure.set_figheight(2.2)  # inches; the front page shows it among others
    titles = ("no gyroscopic term", "energy kept, motion wrong", "a pole in Euler's angles")
    curves = lines(data)
    for place, (axis, title, panel) in enumerate(zip(axes[0], titles, curves, strict=True)):
        axis.set(title=title, yscale="log", xlabel="nutations", ylabel="error of the axis (rad)")
        for label, color, x, y in panel:
            axis.plot(x, y, color=color, marker="" if place else "o", ms=2.5)
            if label == ENDED:
                axis.plot(x[-1], y[-1], "X", color=color, ms=7)
        low, high = axis.get_ylim()
        axis.set_ylim(low, 30.0 * high)  # with room for the labels
    axes[0, 0].set(xscale="log", xlabel="steps a nutation")
    axes[0, 1].set_ylabel("error")
    few_ticks(*axes[0], most=5)
    for axis, panel in zip(axes[0], curves, strict=True):
        label_lines(axis, panel)
    return [Picture("three", figure)]


STUDY = Study(
    name="pitfalls", title="Pitfalls", question="What goes wrong although nothing looks wrong?", cases=cases,
    measure=measure, facts=facts, tables=tables, pictures=pictures,
)  # fmt: skip
