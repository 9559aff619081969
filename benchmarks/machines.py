"""Does another processor choose the same methods? The front page's table, priced on several machines.

    symtop study cost; python -m benchmarks.machines NAME   keeps this machine's choices as results/machines/NAME.json
    python -m benchmarks.machines                           compares what is kept

Errors and evaluations depend on the method only; the cost of an evaluation also depends on the processor: how wide its
vectors are, how long a division and a mispredicted branch take. A cell of the table is a class of `needs` and an error;
of each the seconds of its safe choices are kept, or of the first alone, which can be priced elsewhere but prices none.
What one machine chooses is *the same* on another if that chooses it, too, and otherwise costs there so many times the
best.
"""

import argparse
import itertools
import json
import math
import sys
from pathlib import Path
from typing import Any

import xarray as xr

from benchmarks import measured, pages
from symtop.core import netcdf
from symtop.core.errors import SymtopError
from symtop.report.formats import number
from symtop.runner import scripts

scripts.install()

from symtop_studies.cost import cells  # noqa: E402
from symtop_studies.cost.cells import Cell  # noqa: E402
from symtop_studies.cost.tops import NATURAL  # noqa: E402

RESULTS = Path("results")
KEPT = RESULTS / "machines"
ROWS = [*((needs, False) for needs in cells.CLASSES[:-1]), (cells.CLASSES[0], True)]  # and those that keep constants
NEAR = 10.0  # times the best: safe choices that are kept


def choices(data: xr.DataTree) -> list[dict[str, Any]]:
    """Of each cell the seconds of its safe choices, the fastest first, and whether its lead is called."""
    table = []
    for (needs, keeping), target in itertools.product(ROWS, cells.targets(data)):
        each, called = cells.safest(data, Cell("short", "axis", target, NATURAL, needs), keeping)
        seconds = {one.name: one.seconds for one in each if one.seconds <= NEAR * each[0].seconds < math.inf}
        if seconds:
            table.append({"needs": needs, "keeping": keeping, "target": target, "called": called, "seconds": seconds})
    return table


def compare(one: list[dict[str, Any]], other: list[dict[str, Any]]) -> dict[str, Any]:
    """Costs of the one's choices on the other: cells, the same, those called, the most that another choice costs."""
    there = {_cell(row): row["seconds"] for row in other if len(row["seconds"]) > 1}
    costs = dict[tuple[Any, ...], float]()
    for row in one:
        if (seconds := there.get(_cell(row))) is not None:
            costs[_cell(row)] = seconds.get(next(iter(row["seconds"])), math.inf) / min(seconds.values())
    called = [costs[_cell(row)] for row in one if row["called"] and _cell(row) in costs]
    return {
        "cells": len(costs), "same": sum(cost == 1.0 for cost in costs.values()),
        "most": max(costs.values(), default=math.nan),
        "called": len(called), "called_same": sum(cost == 1.0 for cost in called),
        "called_most": max(called, default=math.nan),
    }  # fmt: skip


def _cell(row: dict[str, Any]) -> tuple[Any, ...]:
    return row["needs"], row["keeping"], row["target"]


def main() -> int:
    """Keep the choices of this machine, or compare what is kept; exit code 1 if there is nothing to compare."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("name", nargs="?")
    parser.add_argument("--results", type=Path, default=RESULTS)
    options = parser.parse_args()
    if options.name is not None:
        try:
            data = netcdf.read_any(options.results / "cost.nc")
        except SymtopError as error:
            sys.exit(f"machines: {error}; run symtop study cost first")
        about = measured.circumstances()
        netcdf.write_json(KEPT / f"{options.name}.json", {"processor": about["processor"], "choices": choices(data)})
    kept = {file.stem: json.loads(file.read_text(encoding="utf-8")) for file in sorted(KEPT.glob("*.json"))}
    pairs = [(one, other, fact) for one, other in itertools.permutations(kept, 2)
             if (fact := compare(kept[one]["choices"], kept[other]["choices"]))["cells"]]  # fmt: skip
    if not pairs:
        print("machines: two machines have to be kept to compare them")
        return 1
    header = ["chosen on", "run on", "cells", "the same", "others cost there, at most",
              "clear leads", "the same", "others, at most"]  # fmt: skip
    rows = [[kept[one]["processor"], kept[other]["processor"], f"{fact['cells']}", f"{fact['same']}",
             f"{number(fact['most'])} times", f"{fact['called']}", f"{fact['called_same']}",
             f"{number(fact['called_most'])} times"] for one, other, fact in pairs]  # fmt: skip
    table = pages.Table("Choices of one processor on another", header, rows)
    print(table.text)
    worst = max((fact for *_, fact in pairs), key=lambda fact: fact["most"])
    facts = worst | {"machines": len(kept)}
    page = pages.findings(
        "machines", "Other processors", "Does another processor choose the same methods?", table,
        "A cell is a class of what can be supplied and an error, of the front page's table. Errors and evaluations are "
        "the same on every processor, prices are not.", [], cases=len(kept), facts=facts,
        **measured.record(measured.circumstances(), "python -m benchmarks.machines"),
    )  # fmt: skip
    netcdf.write_json(RESULTS / "machines.json", page)
    return 0


if __name__ == "__main__":
    sys.exit(main())
