"""What the phase diagram says in sentences and tables, all of it from its datasets."""

from collections import Counter
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.report.sentences import counted, joined
from symtop.runner.study import Table

from . import checks, tables as diagrams
from .runs import POPULATION, QUANTITIES
from .tables import CHECKS, LADDERS, SCENE, TARGETS, TIE, diagram

CLOSE = 0.2  # of the cost: a foretold cell within it is right
PANELS = {
    "axis": "axis: angle between the axes (rad)",
    "energy": "energy: relative change",
    "shape": "shape: distance to the true orbit",
}
HOW_TO_READ = (
    "A variant is a method in one chart. A cell is an allowed error and a horizon; its colour is the variant of the "
    "least cost, or the family of that method. The cost is force evaluations a nutation times the measured price of "
    "one, without the call, at the step or tolerance of the cell; of the population the median. No run was timed. The "
    "evaluations are those of the coarsest step or tolerance whose error stays below the target up "
    "to the horizon, interpolated between settings a factor of 2 in the step or 10 in the tolerance apart. "
    "Errors are measured to 10^6 nutations at most, as far as the budget of a run goes. Beyond, they are predicted "
    "from the growth of the same run: one power of the horizon or the sum of two, and a walk of rounding known to an "
    "order of magnitude. Hatched cells are predicted. Energy and shape are asked from 4 steps a nutation on, and not "
    "of the Gauss methods, which keep both at any step. Left out are exact and exact-discrete, closed forms of "
    "constant cost."
)
NEXT = 3  # variants that the table of shares names after the first
CELLS = ["tops", "quantity", "target", "nutations", "cheapest", "ns a nutation", "next", "ratio", "kind"]
SPOTS = ["quantity", "target", "nutations", "cheapest, predicted", "ns a nutation, predicted",
         "by the evaluations of its runs", "next, by those of its runs", "right"]  # fmt: skip
LAWS = ["tops", "variant", "setting", "measured to", *(f"{name}: power" for name in QUANTITIES),
        *(f"{name}: exponent" for name in QUANTITIES)]  # fmt: skip


class Spot(NamedTuple):
    """A foretold cell and the costs by its runs in full: ns a nutation of the winner, and of the next variant.

    Their errors and evaluations are measured; the cost is evaluations times the price of one, as in the diagram.
    """

    quantity: str
    target: float
    horizon: float
    rows: list[str]
    foretold: float
    by_runs: list[float]

    @property
    def winner(self) -> bool:
        """Is the winner cheaper than the next variant in the runs as well?"""
        return self.by_runs[0] < self.by_runs[1]

    @property
    def close(self) -> bool:
        """Is its cost foretold to `CLOSE`?"""
        return abs(self.foretold / self.by_runs[0] - 1.0) <= CLOSE


def spots(data: xr.DataTree) -> list[Spot]:
    """The checks."""
    if CHECKS not in data.children:
        return []
    group, each = data[CHECKS].to_dataset().isel(scene=0), []
    panels = {name: diagram(data, SCENE, name) for name in QUANTITIES}
    for name in group["variant"].values:
        one = group.sel(variant=name)
        quantity, rows = str(one["quantity"].values), [str(name) for name in one["contender"].values]
        target, horizon = float(one["target"]), float(one["checked_horizon"])
        panel = panels[quantity]
        foretold = 1e9 * float(panel.costs[panel.names.index(rows[0]), *panel.place(target, horizon)])
        costs = [
            1e9 * checks.cost(one, rank, diagrams.price(data, row, one["setting_value"].values[rank]))
            for rank, row in enumerate(rows)
        ]
        each.append(Spot(quantity, target, horizon, rows, foretold, costs))
    return each


def spot_sentence(data: xr.DataTree) -> str:
    """How many checks are right, and the worst."""
    each = spots(data)
    if not each:
        return "No predicted cell was run: none is cheap enough."
    off = [abs(one.foretold / one.by_runs[0] - 1.0) for one in each]
    lengths = [f"{count} at {horizon:.2g}" for horizon, count in sorted(Counter(one.horizon for one in each).items())]
    return (
        f"To check the prediction, {counted(len(each), 'predicted cell')} were run in full on {SCENE}, "
        f"{joined(lengths)} nutations, and none beyond: {sum(one.winner for one in each)} have the predicted winner, "
        f"and {sum(one.close for one in each)} its cost, evaluations times the price of one, within {CLOSE:.0%} (off "
        f"by {np.median(off):.1%} in the median, {max(off):.1%} at most). No run was timed."
    )


def named(name: str) -> str:
    """The population or the scene in words."""
    return "random tops" if name == POPULATION else name


class Share(NamedTuple):
    """Who owns how much of a panel."""

    tops: str  # in words
    reached: int  # cells that some variant reaches
    foretold: int  # of these
    close: float  # share of these in which another variant costs less than `TIE` times as much
    owners: list[tuple[str, float]]  # variants with their share of these, the largest first


def winners(data: xr.DataTree, quantity: str) -> list[Share]:
    """Which variants own how much of the panels of an error, measured and predicted."""
    shares = []
    for name in diagrams.tops_run(data):
        panel = diagram(data, name, quantity)
        won = panel.winner >= 0
        count = max(int(won.sum()), 1)
        owners = Counter(panel.names[k] for k in panel.winner[won].tolist())
        most = [(row, cells / count) for row, cells in owners.most_common(1 + NEXT)]
        close = float((panel.ratio[won] < TIE).mean()) if won.any() else 0.0
        shares.append(Share(named(name), int(won.sum()), int(panel.foretold.sum()), close, most))
    return shares


def winners_sentence(data: xr.DataTree, quantity: str) -> str:
    """Which variants are the cheapest in the most cells, of the population and of the scene."""
    said = [
        f"on {one.tops} {', then '.join(f'{row} in {share:.0%}' for row, share in one.owners[:2])}"
        for one in winners(data, quantity)
        if one.owners
    ]
    error, _, meaning = PANELS[quantity].partition(": ")
    if not said:
        return f"No variant reaches any target of the {error} ({meaning})."
    return (
        f"The cheapest variants for the {error} ({meaning.replace(' (', ', ').rstrip(')')}) are {', and '.join(said)} "
        "of the cells that some variant reaches."
    )


def _shares(data: xr.DataTree) -> Table:
    """The variants that own the most of each panel."""
    lines = []
    for quantity in QUANTITIES:
        for one in winners(data, quantity):
            cells = [f"{row} {share:.0%}" for row, share in one.owners]
            lines.append([PANELS[quantity].partition(":")[0], one.tops, str(one.reached), str(one.foretold),
                          f"{one.close:.0%}", *cells, *[""] * (1 + NEXT - len(cells))])  # fmt: skip
    header = ["error", "tops", "cells reached", "of them predicted", f"another variant within {TIE:g} times",
              "cheapest in most", *(["next"] * NEXT)]  # fmt: skip
    return Table("The cheapest variants, by the share of the cells that some variant reaches", header, lines)


def leaders(data: xr.DataTree, name: str) -> dict[str, tuple[str, float]]:
    """Of each error the variant that is the cheapest in the most cells of these tops, and its share of them."""
    most = {}
    for quantity in QUANTITIES:
        panel = diagram(data, name, quantity)
        won = panel.winner[panel.winner >= 0]
        if won.size:
            k, count = Counter(won.tolist()).most_common(1)[0]
            most[quantity] = panel.names[k], count / won.size
    return most


def message(data: xr.DataTree, name: str) -> str:
    """The figure's one message of these tops: the variant that is cheapest most often, for each of the three errors."""
    shares: dict[str, list[str]] = {}
    for quantity, (row, share) in leaders(data, name).items():
        said = f"{share:.0%}{'' if shares else ' of the cells that any method reaches'} for "
        shares.setdefault(row, []).append(f"{said}the {quantity}")
    each = "; ".join(f"{row} is the cheapest method in {', '.join(parts)}" for row, parts in shares.items())
    return f"On {'' if name == POPULATION else 'the scene '}{named(name)} {each}"


def foretold_share(data: xr.DataTree, name: str) -> float:
    """Of the cells of these tops that any variant reaches, the share that is foretold."""
    panels = [diagram(data, name, quantity) for quantity in QUANTITIES]
    reached = sum(int((panel.winner >= 0).sum()) for panel in panels)
    return sum(int((panel.foretold & (panel.winner >= 0)).sum()) for panel in panels) / max(reached, 1)


def taking_part(data: xr.DataTree) -> list[str]:
    """The variants of the diagram, those on the axis without their chart."""
    variants = map(str, data[LADDERS].to_dataset()["variant"].values)
    return [row.removesuffix("[axis]") for row in variants]


def part_sentence(data: xr.DataTree) -> str:
    """How many variants take part, and why another study may have another winner."""
    return (
        f"{counted(len(taking_part(data)))} take part. Others, as taylor-longdouble and taylor-quad, can be faster "
        "where errors are close to the rounding of double precision, as the study work_precision shows."
    )


def parts_table(data: xr.DataTree) -> Table:
    """Every variant that takes part, and in which panels."""
    tops = diagrams.tops_run(data)[0]
    variants = [str(row) for row in data[LADDERS].to_dataset()["variant"].values]
    panels = {quantity: set(diagrams.rows_of(data, tops, quantity)) for quantity in QUANTITIES}
    marks = [[row, *("yes" if row in panels[quantity] else "no" for quantity in QUANTITIES)] for row in variants]
    names = [PANELS[quantity].partition(":")[0] for quantity in QUANTITIES]
    return Table("The variants that take part, and in which errors", ["variant", *names], marks)


def level_sentence(data: xr.DataTree, name: str) -> str:
    """How many cells of these tops are level."""
    panels = [diagram(data, name, quantity) for quantity in QUANTITIES]
    ratios = np.concatenate([panel.ratio[panel.winner >= 0] for panel in panels])
    share = (ratios < TIE).mean() if ratios.size else 0.0
    return (
        f"In {share:.0%} of the cells that any variant reaches another variant costs less than {TIE:g} times as much."
    )


def population_sentence(data: xr.DataTree) -> str:
    """What was run."""
    group = data[LADDERS].to_dataset()
    members = int(
        group["error"].sel(scene=POPULATION).notnull().any(["variant", "quantity", "setting", "horizon"]).sum()
    )
    reach = float(group["reach"].max())
    return (
        f"{group.sizes['variant']} variants on {members} random tops (seed 1) and on {SCENE}: measured to "
        f"{reach:.2g} nutations, predicted to {float(group['horizon'].max()):.0e}."
    )


def sentences(data: xr.DataTree) -> list[str]:
    """The panels, the checks, and what was run."""
    panels = [winners_sentence(data, name) for name in QUANTITIES]
    return [*panels, spot_sentence(data), population_sentence(data), part_sentence(data)]


def tables(data: xr.DataTree) -> list[Table]:
    """Shares of the cells, the checks, who takes part, every cell, and the laws of growth."""
    return [_shares(data), _spots(data), parts_table(data), _cells(data), _laws(data)]


def _cells(data: xr.DataTree) -> Table:
    lines = []
    for name in diagrams.tops_run(data):
        for quantity in QUANTITIES:
            panel = diagram(data, name, quantity)
            for t, h in np.ndindex(panel.winner.shape):
                if panel.winner[t, h] < 0 or t % 2:
                    continue
                first, second = panel.winner[t, h], panel.second[t, h]
                ratio = panel.ratio[t, h]
                lines.append(
                    [named(name), quantity, f"{TARGETS[t]:.0e}", f"{panel.horizons[h]:.2g}", panel.names[first],
                     f"{1e9 * panel.costs[first, t, h]:.3g}", panel.names[second] if np.isfinite(ratio) else "none",
                     f"{ratio:.2f}" if np.isfinite(ratio) else "", "predicted" if panel.foretold[t, h] else "measured"]
                )  # fmt: skip
    return Table("The cheapest variant of each cell, whole decades of the error", CELLS, lines)


def _spots(data: xr.DataTree) -> Table:
    lines = []
    for one in spots(data):
        right = " and ".join(word for word, holds in (("winner", one.winner), ("cost", one.close)) if holds)
        costs = [f"{cost:.4g}" if np.isfinite(cost) else "not reached" for cost in one.by_runs]
        lines.append(
            [one.quantity, f"{one.target:.1e}", f"{one.horizon:.2g}", one.rows[0], f"{one.foretold:.4g}", costs[0],
             f"{one.rows[1]} {costs[1]}", right or "neither"]
        )  # fmt: skip
    return Table(
        f"Predicted cells run in full on {SCENE}: costs are evaluations times the price of one, and no run was "
        f"timed; right: the winner, or the cost within {CLOSE:.0%}",
        SPOTS,
        lines,
    )


def _laws(data: xr.DataTree) -> Table:
    lines = []
    for name in diagrams.tops_run(data):
        for variant in map(str, data[LADDERS].to_dataset()["variant"].values):
            one = diagrams.cell(data, name, variant)
            for k, value in enumerate(one["setting_value"].values):
                part = one.isel(setting=k)
                middle = {key: part[key].median("member").values for key in ("power", "slope", "interval")}
                slopes = zip(middle["slope"], middle["interval"], strict=True)
                if not np.isfinite(middle["power"]).any():
                    continue
                lines.append(
                    [named(name), variant, f"{value:.3g}", f"{float(part['reach']):.2g}",
                     *(f"{power:g}" for power in middle["power"]),
                     *(f"{slope:.2f} +- {wide:.2f}" for slope, wide in slopes)]
                )  # fmt: skip
    return Table(
        "Growth of the error with the horizon, by setting (steps a nutation or tolerance), medians", LAWS, lines
    )
