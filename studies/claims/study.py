"""Is every declared property of every integrator true?"""

from collections import Counter

import numpy as np
import xarray as xr

from symtop.judge.claims import SCENE, judge
from symtop.judge.ledger import CLAIMS, VERDICTS, Finding, read, spoken
from symtop.methods.registry import integrator, integrators
from symtop.model.scenes import added_scenes, scene
from symtop.report import figures, style
from symtop.runner.study import Case, Picture, Study, Table

SYMBOLS = {"confirmed": "✓", "refuted": "✗", "measured": "·", "undecided": "?", "inapplicable": "–"}
MARKED = ("midpoint", "strang", "galerkin-simpson", "sofroniou-spaletta-10", "gauss-4", "gauss-12", "rk4", "rk45")


def cases(quick: bool) -> list[Case]:
    """One case an integrator, on the most violent scene and on the user's own."""
    names = [SCENE, *added_scenes()]
    return [Case(name, method.name, {"quick": quick}) for name in names for method in integrators().values()]


def measure(case: Case) -> xr.Dataset:
    """The ledger of one integrator."""
    return judge(integrator(case.integrator), scene(case.scene), quick=case.settings["quick"]).dataset()


def ledgers(data: xr.Dataset) -> dict[tuple[str, str], list[Finding]]:
    """The findings of every integrator on every scene."""
    cells = [(str(s), str(m)) for s in data["scene"].values for m in data["integrator"].values]
    found = {cell: read(data.sel(scene=cell[0], integrator=cell[1])) for cell in cells}
    return {cell: row for cell, row in found.items() if any(one.verdict for one in row)}


def pictures(data: xr.Dataset) -> list[Picture]:
    """The verdicts at a glance, and what tells a symplectic map from one that is not."""
    found = ledgers(data)
    rows = {name if where == SCENE else f"{name} on {where}": row for (where, name), row in found.items()}
    count = Counter(one.verdict for row in rows.values() for one in row)
    matrix = Picture(
        "ledger",
        figures.verdict_matrix(rows, [spoken(claim) for claim in CLAIMS], SYMBOLS),
        f"Every claim of every integrator: {_counted(count)}. The text of a cell is what was measured; grey cells "
        "claim nothing, white ones do not apply.",
        "A matrix of integrators and claims with a symbol for each verdict: "
        + ", ".join(f"{SYMBOLS[verdict]} {verdict}" for verdict in VERDICTS) + ".",
    )  # fmt: skip
    known = [str(name) for name in data["integrator"].values if str(name) in MARKED]
    first = data.isel(scene=0).sel(integrator=known or data["integrator"].values)
    return [matrix, _defects(first)]


def _counted(count: Counter[str]) -> str:
    judged = sum(count.values()) - count["inapplicable"]
    parts = [f"{count[verdict]} {verdict}" for verdict in VERDICTS if verdict != "inapplicable"]
    return f"{', '.join(parts)} of {judged} that apply"


def _defects(data: xr.Dataset) -> Picture:
    figure, axes = style.panels(1, 1, height=4.4)
    axis = axes[0, 0]
    stays, falls = [], []
    for name in data["integrator"].values:
        cell, look = data.sel(integrator=name), style.look(str(name))
        width, raw = cell["defect_width"].values, cell["bracket_defect"].values
        good = np.isfinite(width) & np.isfinite(raw)
        if not good.any():
            continue
        axis.plot(width[good], raw[good], look.marker + "-", color=look.color, ms=look.size, label=str(name))
        (falls if raw[good][-1] < raw[good][0] / 100.0 else stays).append(str(name))
    axis.set(xscale="log", yscale="log", xlabel="differencing width", ylabel="defect of the bracket after one step")
    finest, coarsest = float(np.nanmin(data["defect_width"])), float(np.nanmax(data["defect_width"]))
    lowest = float(np.nanmin(data["bracket_defect"]))
    style.slope_guide(axis, 2.0, (1.4 * finest, 0.7 * coarsest), 0.5 * lowest, "width$^2$")
    style.legend_below(figure, axes)
    return Picture(
        "bracket",
        figure,
        "How far one step is from preserving the bracket, as the width of the central differences that measure it is "
        f"refined. It falls with the square of the width, all of it error of the differencing, for "
        f"{', '.join(falls) or 'none'}; it levels off, and is therefore real, for {', '.join(stays) or 'none'}.",
        "Log-log plot of the defect against the differencing width: lines of slope two for symplectic methods, level "
        "lines for the others.",
    )


def tables(data: xr.Dataset) -> list[Table]:
    """Declared, measured and verdict of every cell; then what was refuted or left open, in words."""
    found = ledgers(data)
    rows = [
        [name if where == SCENE else f"{name} on {where}", *(_cell(one) for one in row)]
        for (where, name), row in found.items()
    ]
    open_ones = [
        [name, where, spoken(one.claim), one.declared, one.verdict, one.why]
        for (where, name), row in found.items()
        for one in row
        if one.verdict in ("refuted", "undecided")
    ]
    legend = ", ".join(f"{SYMBOLS[verdict]} {verdict}" for verdict in VERDICTS)
    whole = Table(f"Declared | measured, and the verdict: {legend}", ["integrator", *map(spoken, CLAIMS)], rows)
    header = ["integrator", "scene", "claim", "declared", "verdict", "why"]
    return [whole, Table("What was refuted or left open, and why", header, open_ones)] if open_ones else [whole]


def _cell(one: Finding) -> str:
    said = f"{one.declared or 'nothing'} | {one.measured or 'unknown'}"
    return SYMBOLS[one.verdict] if one.verdict == "inapplicable" else f"{SYMBOLS[one.verdict]} {said}"


def verdict(data: xr.Dataset) -> list[str]:
    """How many claims stand, which do not, and which nobody could judge."""
    found = ledgers(data)
    everything = [(name, one) for (_, name), row in found.items() for one in row]
    count = Counter(one.verdict for _, one in everything)
    sentences = [f"Of the claims of {len(found)} integrators, {_counted(count)}."]
    refuted = [one.sentence(name) for name, one in everything if one.verdict == "refuted"]
    sentences += refuted or ["No claim is refuted."]
    unknown = [f"{spoken(one.claim)} of {name}" for name, one in everything if one.verdict == "undecided"]
    if unknown:
        sentences.append(f"Undecided: {', '.join(unknown)}.")
    short = [
        f"{name} ({int(steps)})"
        for name, steps in zip(data["integrator"].values, data["steps_run"].isel(scene=0).values, strict=True)
        if np.isfinite(steps) and 0 < steps < data["steps_run"].max()
    ]
    if short:
        most = int(data["steps_run"].max())
        sentences.append(f"The long run had fewer steps than the others' {most} for {', '.join(short)}.")
    return sentences


STUDY = Study(
    name="claims",
    title="Claims",
    question="Is every declared property of every integrator true?",
    how_to_read=(
        "One battery measures what each integrator claims about itself: order, structure of a step, constants of the "
        "motion over a million steps, cost, poles. A claim is confirmed or refuted only far beyond the doubt of the "
        "measurement; what nobody claimed is measured all the same. The second figure tells a defect from the error of "
        "measuring it."
    ),
    cases=cases,
    measure=measure,
    pictures=pictures,
    tables=tables,
    verdict=verdict,
)
