"""Kernels against C, alone and in lanes, the cost of starting, the time to an accuracy: writes results/bench.json.

make bench        (needs gcc; the twins are built into benchmarks/build)
"""

import argparse
import sys
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks import ensemble, kernels, lanes, measured, pages, startup, targets, truth, twin, whole_run
from benchmarks.pages import Table
from symtop.core import netcdf
from symtop.core.errors import SymtopWarning


class Results(NamedTuple):
    """The results of all benchmarks of this page."""

    kernels: Sequence[kernels.Row]
    startup: Mapping[str, float]
    closed_form: Sequence[truth.Row]
    accuracy: float  # rad, of the attitude that `targets` meet
    targets: Sequence[targets.MethodCost]
    parts: Sequence[whole_run.Item]
    one_step: Mapping[str, float]
    ensemble: Sequence[ensemble.Item]
    ensemble_calls: Sequence[ensemble.Call]
    lanes: lanes.LaneTimes


def tables(results: Results) -> list[Table]:
    """All tables; the page shows the first."""
    parts, one_step = whole_run.tables(results.parts, results.one_step)
    return [
        kernels.table(results.kernels), targets.table(results.targets, results.accuracy),
        truth.table(results.closed_form), parts, *lanes.tables(results.lanes), one_step,
        ensemble.table(results.ensemble), startup.table(results.startup),
    ]  # fmt: skip


def verdict(results: Results) -> list[str]:
    """The conclusions, as sentences."""
    run, one_step = whole_run.verdict(results.parts, results.one_step)
    return [
        *kernels.verdict(results.kernels), *lanes.verdict(results.lanes), *ensemble.verdict(results.ensemble),
        *ensemble.call_sentences(results.ensemble_calls), run, one_step,
    ]  # fmt: skip


def findings(results: Results, facts: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers in the form in which the report shows a study."""
    how_to_read = (
        "In lanes: many tops side by side in one vector of the processor (SIMD). One process, all kernels and their C "
        f"twins (gcc) interleaved in random order; {kernels.SCENE}, a step of "
        f"1/{kernels.PER_NUTATION:g} of a nutation. The spread is what five fifths of the batches would have said."
    )
    return pages.findings(
        "bench", "Kernels beside C", "Are the kernels as fast as the same loop in C, and what does a call add to them?",
        verdict(results), how_to_read, tables(results), cases=len(results.kernels),
        **measured.record(facts, "make bench"),
    )  # fmt: skip


def rows(items: Sequence[Any]) -> list[dict[str, Any]]:
    """Named tuples as dictionaries for JSON."""
    return [item._asdict() for item in items]


def main() -> None:
    """Measure, print and write down."""
    parser = argparse.ArgumentParser(description="Kernels against C, start-up, and time to an accuracy")
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--accuracy", type=float, default=targets.ACCURACY)
    options = parser.parse_args()
    if twin.compiler() is None:
        sys.exit("make bench needs gcc for the C twins, and there is none on the path")
    facts = measured.circumstances()
    warnings.simplefilter("ignore", SymtopWarning)  # the guard's, of runs that are made for their time
    results = Results(
        kernels.measure(), startup.measure(), truth.measure(), options.accuracy, targets.measure(options.accuracy),
        whole_run.measure(), whole_run.one_step(), ensemble.measure(), ensemble.calls(), lanes.measure(),
    )  # fmt: skip
    print("\n".join([*(table.text for table in tables(results)), *verdict(results)]), end="\n\n")
    options.results.mkdir(exist_ok=True)
    target = options.results / "bench.json"
    numbers = {
        "kernels": rows(results.kernels),
        "startup": results.startup,
        "closed_form": rows(results.closed_form),
        "run": {"parts": rows(results.parts), "one_step": results.one_step},
        "ensemble": rows(results.ensemble),
        "ensemble_calls": rows(results.ensemble_calls),
        "lanes": {name: rows(part) for name, part in results.lanes._asdict().items()},
        "targets": {"accuracy": options.accuracy, "methods": rows(results.targets)},
    }
    netcdf.write_json(target, findings(results, facts) | numbers)
    print(f"written to {target}")


if __name__ == "__main__":
    main()
