"""The study of cost twice from nothing: do its called winners, its shares and its prices come out the same?

    python -m benchmarks.repeat [--quick] [--results DIR]      half an hour of a quiet machine; DIR/first, DIR/second
    python -m benchmarks.repeat --compare DIR DIR              two folders with a cost.nc that are there

Winners are compared where both runs call one. A share overlaps if the two intervals of the same variant in the same
cell do. Then five prices of the second run are compared with `timeit` on a run of another length, and heyoka's with a
`taylor_adaptive` that is written down here. Exit code 1 if a called winner differs, fewer than 95 % of the shares
overlap, or heyoka's price is off by more than 15 %. In full it writes results/repeat.json, which the report cites.
"""

import argparse
import subprocess
import sys
import timeit
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from benchmarks import measured, pages
from symtop.core import netcdf
from symtop.methods.framework.registry import integrator
from symtop.runner import scripts

scripts.install()

from symtop_studies.cost import cells, prices as pricing  # noqa: E402
from symtop_studies.cost.cells import GENERAL, POPULATIONS, Cell  # noqa: E402
from symtop_studies.cost.ranking import Contest, Safe, Standing  # noqa: E402
from symtop_studies.cost.tops import KINDS, NATURAL  # noqa: E402

OVERLAP, BARE = 0.95, 0.15
BY_HAND = ("rk4[axis]", "strang[axis]", "dop853-compiled[axis]", "takahashi-imada[axis]", "gauss-4[axis]")
LENGTH = 20.0  # nutations of the runs by hand
MOVED = (  # between two runs of the studies that this one replaced
    Cell("short", "axis", 1e-3, NATURAL),
    Cell("long", "axis", 1e-12, NATURAL),
    Cell("short", "attitude", 1e-3, NATURAL),
)
SHOWN = 20


def every_cell(data: xr.DataTree) -> Iterator[Cell]:
    """All cells that the study judges."""
    groups = [("axis", tops, needs) for tops in POPULATIONS for needs in cells.CLASSES]
    groups += [(quantity, NATURAL, GENERAL) for quantity in ("attitude", "energy")]
    for quantity, tops, needs in groups:
        yield from cells.cells(data, quantity, tops, needs)
    for kind in KINDS[:-2]:
        yield from (cell for cell in cells.cells(data, "axis", kind) if cell.horizon == "short")


def label(cell: Cell) -> str:
    """A cell in words."""
    return f"{cell.quantity} {cell.target:.0e}, {cell.horizon}, {cell.tops}, {cell.needs}"


def compare(first: xr.DataTree, second: xr.DataTree) -> dict[str, Any]:
    """Print and count what agrees between the two runs and what differs."""
    both, asked = (first, second), list(every_cell(first))
    compare_prices(*(pricing.prices(data) for data in both))
    winners = [winners_of(tuple(cells.contest(data, cell) for data in both)) for cell in asked]
    safe = [safe_of(tuple(cells.safest(data, cell) for data in both)) for cell in asked]
    for protocol, pairs in (("in hindsight", winners), ("safe", safe)):
        print(f"winners called in both runs, {protocol}: {sum(map(bool, pairs))}; they differ in")
        lines = [
            f"  {label(cell)}: {' and '.join(pair)}" for cell, pair in zip(asked, pairs, strict=True) if len(pair) > 1
        ]
        print("\n".join(lines) or "  none")
    shares = [(cell, pair) for cell in asked for pair in shares_of(*(cells.contest(data, cell) for data in both))]
    disjoint = [(cell, pair) for cell, pair in shares if pair[0].low > pair[1].high or pair[1].low > pair[0].high]
    overlap = 1.0 - len(disjoint) / max(len(shares), 1)
    print(f"shares that overlap: {overlap:.1%} of {len(shares)} (goal {OVERLAP:.0%}); the first that do not:")
    print("\n".join(f"  {label(cell)}: {words(*pair)}" for cell, pair in disjoint[:SHOWN]))
    print("cells that moved before:")
    for cell in MOVED:
        contests = [cells.contest(data, cell) for data in both]
        standings = words(*(contest.first for contest in contests if contest.first))
        print(f"  {label(cell)}: {standings}, called {[contest.called for contest in contests]}")
    calls = sum(cells.contest(first, cell).called + cells.safest(first, cell)[1] for cell in asked)
    called, different = sum(map(bool, winners + safe)), sum(len(pair) > 1 for pair in winners + safe)
    return {
        "first": calls, "winners": called, "different": different, "confirmed": called - different,
        "shares": len(shares), "overlap": overlap,
    }  # fmt: skip


def compare_prices(first: pricing.Prices, second: pricing.Prices) -> None:
    """The ratios of prices and calls at the usual tolerance."""
    for quantity, part in (("prices", 0), ("calls", 1)):
        mine, theirs = (np.array([known.at(name, np.array([pricing.TOLERANCE]))[part][0] for name in first.names])
                        for known in (first, second))  # fmt: skip
        good = (mine > 0.0) & (theirs > 0.0)
        ratio = theirs[good] / mine[good]
        low, middle, high = np.quantile(ratio, (0.1, 0.5, 0.9))
        print(f"{quantity}, second over first: median {middle:.3f}, 80 % from {low:.3f} to {high:.3f}, all from "
              f"{ratio.min():.3f} to {ratio.max():.3f}")  # fmt: skip
    print(f"marked: {first.marked} and {second.marked}")


def winners_of(pair: tuple[Contest, ...]) -> set[str]:
    """The winners of a cell in hindsight, if both runs call one."""
    return {run.first.name for run in pair if run.first} if all(run.called for run in pair) else set()


def safe_of(pair: tuple[tuple[list[Safe], bool], ...]) -> set[str]:
    """The safe choices that are first in a cell, if both runs call one."""
    return {choices[0].name for choices, _ in pair} if all(called for _, called in pair) else set()


def shares_of(first: Contest, second: Contest) -> list[tuple[Standing, Standing]]:
    """The standings in both runs of each variant that wins on some top in one of them."""
    by_name = {standing.name: standing for standing in second.standings}
    pairs = [(standing, by_name[standing.name]) for standing in first.standings if standing.name in by_name]
    return [pair for pair in pairs if pair[0].share or pair[1].share]


def words(*standings: Standing) -> str:
    """Shares with their intervals."""
    return ", ".join(f"{entry.name} {entry.share:.3f} ({entry.low:.3f} to {entry.high:.3f})" for entry in standings)


def by_hand(data: xr.DataTree) -> dict[str, float]:
    """Evaluations times the price, plus the call, over `timeit` of a run of another length, by variant."""
    known, ratios = pricing.prices(data), {}
    for name in BY_HAND:
        call, evaluations = pricing.run_of(integrator(name), pricing.TOLERANCE, LENGTH)
        once = min(timeit.repeat(call, number=20, repeat=50)) / 20
        price, base = (float(part[0]) for part in known.at(name, np.array([pricing.TOLERANCE])))
        whole = evaluations * price + base
        ratios[name] = whole / once
        print(f"{name:26} {evaluations:7.0f} f x {1e9 * price:6.2f} ns + {1e6 * base:4.1f} us = {1e6 * whole:8.1f} us; "
              f"timeit {1e6 * once:8.1f} us, ratio {whole / once:.3f}")  # fmt: skip
    return ratios


def bare_heyoka(data: xr.DataTree) -> float:
    """The price of `taylor[axis]` over that of heyoka on equations that are written down here."""
    import heyoka as hy

    from symtop.methods.taylor.heyoka import start_numbers

    top, start, period = pricing.timed_top()
    *e, lx, ly, lz = hy.make_vars("ex", "ey", "ez", "lx", "ly", "lz")
    inverse, weight = hy.par[0], hy.par[1]
    turns = [ly * e[2] - lz * e[1], lz * e[0] - lx * e[2], lx * e[1] - ly * e[0]]
    system = [*((x, inverse * turn) for x, turn in zip(e, turns, strict=True)),
              (lx, -weight * e[1]), (ly, weight * e[0]), (lz, hy.expression(0.0))]  # fmt: skip
    state, _ = start_numbers("axis", "double", top, start)
    stepper = hy.taylor_adaptive(system, list(map(float, state)), tol=pricing.TOLERANCE, pars=[1.0 / top.I1, top.mgl])
    values = np.array(stepper.state)

    def run(nutations: float) -> float:
        stepper.time = 0.0
        stepper.state[:] = values
        return float(stepper.propagate_until(nutations * period)[3] * stepper.order)

    n_short, n_long = (run(length) for length in pricing.LENGTHS)
    slopes = []
    for _ in range(5):
        short, long = (min(timeit.repeat(lambda length=length: run(length), number=10, repeat=20)) / 10
                       for length in pricing.LENGTHS)  # fmt: skip
        slopes.append((long - short) / (n_long - n_short))
    bare, known = float(np.median(slopes)), pricing.prices(data)
    price = float(known.at(pricing.HEYOKA, np.array([pricing.TOLERANCE]))[0][0])
    print(f"heyoka: {1e9 * price:.2f} ns in the study, {1e9 * bare:.2f} ns bare, ratio {price / bare:.3f}; with dense "
          f"output {known.sampled:.2f} times the study's")  # fmt: skip
    return price / bare


def main() -> int:
    """Run twice, or take what is there, and compare."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--results", type=Path, default=Path("results/repeat"))
    parser.add_argument("--compare", type=Path, nargs=2, metavar="DIR")
    options = parser.parse_args()
    folders = options.compare or [options.results / name for name in ("first", "second")]
    for folder in () if options.compare else folders:
        command = [sys.executable, "-m", "symtop.cli", "study", "cost", "--results", str(folder)]
        subprocess.run([*command, *(["--quick"] if options.quick else [])], check=True)
    inner = "quick" if options.quick else ""
    first, second = (netcdf.read_any(folder / inner / "cost.nc") for folder in folders)
    facts = compare(first, second)
    ratios = by_hand(second)
    if pricing.HEYOKA in pricing.prices(second).names:
        ratios["heyoka"] = bare_heyoka(second)
    if not options.quick:
        write(facts, ratios)
    good = not facts["different"] and facts["overlap"] >= OVERLAP and abs(ratios.get("heyoka", 1.0) - 1.0) <= BARE
    return 0 if good else 1


def write(facts: dict[str, Any], ratios: dict[str, float]) -> None:
    """What the report cites, as results/repeat.json."""
    sentence = (
        f"The first run calls a winner in {facts['first']} comparisons, both in {facts['winners']}, of which "
        f"{facts['different']} differ. The "
        f"intervals of {facts['overlap']:.1%} of {facts['shares']} shares overlap."
    )
    table = pages.Table(
        "Cost by the model over the time by hand", list(ratios), [[f"{ratio:.3f}" for ratio in ratios.values()]]
    )
    about = measured.circumstances()
    page = pages.findings(
        "repeat", "Two runs", "Does the study of cost say the same twice?", [sentence],
        "A ratio is the cost that the study gives a run, over `timeit` of that run; for heyoka, of the prices alone.",
        [table], cases=2, facts=facts, **measured.record(about, "python -m benchmarks.repeat"),
    )  # fmt: skip
    netcdf.write_json(Path("results/repeat.json"), page)


if __name__ == "__main__":
    sys.exit(main())
