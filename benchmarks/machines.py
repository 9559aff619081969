"""Does another processor choose the same methods? The front page's table, priced on several machines.

    symtop study cost; python -m benchmarks.machines NAME   keeps this machine's choices as results/machines/NAME.json
    python -m benchmarks.machines                           compares what is kept

Errors and evaluations hang on the method alone; what an evaluation costs hangs on the processor, too: how wide its
vectors are, what a division and a wrong guess of a branch take. A cell of the table is a class of `needs` and an error;
of each the seconds of its safe choices are kept, or of the first alone, which can be priced elsewhere but prices none.
"""

import argparse
import itertools
import json
import math
import re
import sys
from pathlib import Path
from typing import Any, NamedTuple

import xarray as xr

from benchmarks import measured, pages
from symtop.core import netcdf
from symtop.core.errors import SymtopError
from symtop.methods.framework.registry import NEEDS
from symtop.report.formats import number, typeset
from symtop.runner import scripts

scripts.install()

from symtop_studies.cost import cells  # noqa: E402
from symtop_studies.cost.cells import Cell  # noqa: E402
from symtop_studies.cost.tops import NATURAL  # noqa: E402

RESULTS = Path("results")
KEPT = RESULTS / "machines"
UNKNOWN = "not kept"  # a cost on a machine of which the first choice alone is kept
NEAR = 10.0  # times the best: safe choices that are kept
LEAST = 1e-9  # rad: the least error of the table on the front page; choices for smaller ones are kept, too


def choices(data: xr.DataTree) -> list[dict[str, Any]]:
    """Of each cell the seconds of its safe choices, the fastest first, and whether its lead is called."""
    table = []
    for (needs, keeping), target in itertools.product(cells.ROWS, cells.targets(data)):
        safes, called = cells.safest(data, Cell("short", "axis", target, NATURAL, needs), keeping)
        seconds = {safe.name: safe.seconds for safe in safes if safe.seconds <= NEAR * safes[0].seconds < math.inf}
        if seconds:
            table.append({"needs": needs, "keeping": keeping, "target": target, "called": called, "seconds": seconds})
    return table


class Pair(NamedTuple):
    """Two machines: cells that both have, those whose choice is the same, and what the others cost."""

    cells: int
    same: int
    clear: int  # cells whose lead is beyond the error of measurement on one of them at least
    clear_same: int
    most: float  # times the best of a machine: the dearest choice of the other there; NaN where no price is known
    differing: list[list[str]]  # rows: the cell, both choices, what each costs on the other machine


def compare(first: list[dict[str, Any]], second: list[dict[str, Any]]) -> Pair:
    """What two machines choose, and what the choice of each costs on the other."""
    theirs = {_cell(row): row for row in second if row["target"] >= LEAST}
    pairs = [(row, theirs[_cell(row)]) for row in first if _cell(row) in theirs]
    differing = [pair for pair in pairs if _first(pair[0]) != _first(pair[1])]
    clear = [pair for pair in pairs if pair[0]["called"] or pair[1]["called"]]
    costs = [(_cost(a, b), _cost(b, a)) for a, b in differing]
    rows = [[_words(a), _first(a), _first(b), _times(on_second), _times(on_first)]
            for (a, b), (on_second, on_first) in zip(differing, costs, strict=True)]  # fmt: skip
    known = [cost for pair in costs for cost in pair if not math.isnan(cost)]
    return Pair(len(pairs), len(pairs) - len(differing), len(clear), sum(pair not in differing for pair in clear),
                max(known, default=math.nan), rows)  # fmt: skip


def least_alike(kept: list[dict[str, Any]]) -> tuple[dict[str, Any], dict[str, Any], Pair] | None:
    """The two machines with the least share of equal choices, of the cells that both have; None without such two."""
    pairs = [(*two, compare(*(machine["choices"] for machine in two))) for two in itertools.combinations(kept, 2)]
    return min((row for row in pairs if row[2].cells), key=lambda row: row[2].same / row[2].cells, default=None)


def _first(row: dict[str, Any]) -> str:
    return next(iter(row["seconds"]))


def _cost(chosen: dict[str, Any], machine: dict[str, Any]) -> float:
    """What a choice costs on another machine, in units of the best there; NaN if no other price is kept."""
    seconds = machine["seconds"]
    return seconds.get(_first(chosen), math.inf) / min(seconds.values()) if len(seconds) > 1 else math.nan


def _times(cost: float) -> str:
    return UNKNOWN if math.isnan(cost) else f"over {NEAR:g}" if math.isinf(cost) else number(cost, 3)


def _words(row: dict[str, Any]) -> str:
    error = typeset(f"{row['target']:.0e}")
    return f"{NEEDS[row['needs']]}{', all constants kept' * row['keeping']}, to {error} rad"


def _cell(row: dict[str, Any]) -> tuple[Any, ...]:
    return row["needs"], row["keeping"], row["target"]


def main() -> int:
    """Keep the choices of this machine, or compare what is kept; exit code 1 if there is nothing to compare."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("name", nargs="?")
    parser.add_argument("--results", type=Path, default=RESULTS)
    options = parser.parse_args()
    if options.name is not None and not re.fullmatch(r"[\w-]+", options.name):
        parser.error(f"NAME must be of letters, digits and hyphens, as it names a file, not {options.name!r}")
    if options.name is not None:
        try:
            data = netcdf.read_any(options.results / "cost.nc")
        except SymtopError as error:
            sys.exit(f"machines: {error}; run symtop study cost first")
        content = {"processor": str(data.attrs["processor"]), "choices": choices(data)}
        netcdf.write_json(KEPT / f"{options.name}.json", content)
    kept = [json.loads(file.read_text(encoding="utf-8")) for file in sorted(KEPT.glob("*.json"))]
    if (apart := least_alike(kept)) is None:
        print("machines: two machines have to be kept to compare them")
        return 1
    first, second, pair = apart
    names = first["processor"], second["processor"]
    costs = ["the first's choice on the second", "the second's choice on the first"]
    known = [k for k in range(2) if any(row[3 + k] != UNKNOWN for row in pair.differing)]
    header = ["what can be supplied, and error", *(f"on {name}" for name in names), *(costs[k] for k in known)]
    rows = [[*row[:3], *(row[3 + k] for k in known)] for row in pair.differing]
    table = pages.Table("Where two processors choose differently", header, rows)
    least = f", of {len(kept)} processors the two that agree least" * (len(kept) > 2)
    sentence = (
        f"{pair.same} of the {pair.cells} choices of the front page's first table that both have kept are the same on "
        f"{names[0]} and on {names[1]}{least}: {pair.clear_same} of {pair.clear} where either shows a lead beyond the "
        f"error of measurement. Where they differ, the choice of one takes on the other at most {_times(pair.most)} "
        "times as long as the best."
    )
    print(f"{table.text}\n{sentence}")
    page = pages.findings(
        "machines", "Another processor", "Does another processor choose the same methods?", table,
        "Errors and evaluations are the same on every processor, to rounding; prices are not. A choice on the other "
        "processor is timed in units of the least there.", [], answer=sentence, cases=len(kept),
        facts=pair._asdict() | {"differing": len(pair.differing), "processors": len(kept)},
        **measured.record(measured.circumstances(), "python -m benchmarks.machines"),
    )  # fmt: skip
    netcdf.write_json(RESULTS / "machines.json", page)
    return 0


if __name__ == "__main__":
    sys.exit(main())
