"""Kernels beside C, alone and in lanes, what starting costs, the time to an accuracy: results/bench.json in the report.

make bench        (needs gcc; the twins are built into benchmarks/build)
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks import ensemble, kernels, lanes, measured, pages, startup, targets, truth, twin, whole_run
from benchmarks.pages import Table
from symtop.core import netcdf


def findings(
    rows: Sequence[kernels.Row],
    started: Mapping[str, float],
    forms: Sequence[truth.Row],
    reached: Sequence[targets.Reached],
    items: Sequence[whole_run.Item],
    one_step: Mapping[str, float],
    many: Sequence[ensemble.Item],
    called: Sequence[ensemble.Call],
    together: lanes.Measured,
    accuracy: float,
    facts: Mapping[str, Any],
) -> dict[str, Any]:
    """The numbers in the form in which the report shows a study."""
    said = kernels.verdict(rows)
    took = {item.name: item.seconds * 1e6 for item in items}
    slowest = max(one_step, key=lambda name: one_step[name])
    run = (
        f"`simulate` takes {took['simulate']:.0f} us for {whole_run.STEPS} steps of "
        f"{whole_run.METHOD}[{whole_run.CHART}] on {whole_run.SCENE}, {took['solver, every step shown']:.0f} in the "
        f"solver and {took['guard']:.0f} in the guard."
    )
    kernel_rows = [
        [f"{row.name}[{row.chart}]", f"{row.nanoseconds:.1f}", f"{row.in_c:.1f}", f"{row.ratio:.2f}",
         f"{row.ratio_low:.2f} to {row.ratio_high:.2f}",
         "yes" if row.difference == 0.0 else f"{row.difference:.0e}", f"{row.verlet_steps:.2f}"]
        for row in rows
    ]  # fmt: skip
    reached_rows = [
        [row.name, str(row.steps), f"{row.seconds * 1e6:.1f}", f"{row.verlet_steps:.0f}"] for row in reached
    ]
    tables = [
        Table(
            "A step of every kernel",
            [
                "kernel",
                "ns a step",
                "in C",
                "of C's",
                "spread of the fifths",
                "same bits as C",
                "steps of stormer-verlet",
            ],
            kernel_rows,
        ),
        Table(
            f"Time to an attitude error of {accuracy:g} on spheroid at t = {targets.HORIZON:g}",
            ["method", "steps", "us", "steps of stormer-verlet"],
            reached_rows,
        ),
        Table(
            "The closed form",
            ["call", "median us", "99 % below, us"],
            [[row.name, f"{row.median * 1e6:.3g}", f"{row.slow * 1e6:.3g}"] for row in forms],
        ),
        Table(
            f"A run of {whole_run.STEPS} steps of {whole_run.METHOD} on {whole_run.SCENE}, by its parts",
            ["part", "us", "steps of the method"],
            [[item.name, f"{item.seconds * 1e6:.1f}", f"{item.steps:.0f}"] for item in items],
        ),
        *lanes.tables(together),
        Table("A run of one step", ["method", "us"], [[name, f"{s * 1e6:.2f}"] for name, s in one_step.items()]),
        Table(
            f"A member of an ensemble: {ensemble.NUTATIONS * ensemble.PER_NUTATION} steps of {ensemble.METHOD} "
            f"[{ensemble.CHART}], {ensemble.SAMPLES} samples, {ensemble.MEMBERS} tops",
            ["what", "us a member", "times faster than `simulate`"],
            [[item.name, f"{item.seconds * 1e6:.2f}", f"{item.ratio:.3g}"] for item in many],
        ),
        Table("Starting", ["what", "ms"], [[name, f"{seconds * 1e3:.2f}"] for name, seconds in started.items()]),
    ]
    sentences = [
        *said, *lanes.verdict(together), *ensemble.verdict(many), *ensemble.said_of(called), run,
        f"A run of one step takes {one_step[slowest] * 1e6:.1f} us at most, with {slowest}.",
    ]  # fmt: skip
    how_to_read = (
        f"One process, all kernels and their C twins (gcc) interleaved in random order; {kernels.SCENE}, a step of "
        f"1/{kernels.PER_NUTATION:g} of a nutation. The spread is what five fifths of the batches would have said."
    )
    return pages.findings(
        "bench", "Kernels beside C", "Are the kernels as fast as the same loop in C, and what does a call add to them?",
        sentences, how_to_read, tables, cases=len(rows), measured=measured.sentence(facts, "make bench"),
        provenance={key: facts[key] for key in facts if key not in ("measured", "cores", "load_before")},
    )  # fmt: skip


def main() -> None:
    """Measure, print and write down."""
    parser = argparse.ArgumentParser(description="Kernels against C, start-up, and time to an accuracy")
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--accuracy", type=float, default=targets.ACCURACY)
    options = parser.parse_args()
    if twin.compiler() is None:
        sys.exit("make bench needs gcc for the C twins, and there is none on the path")
    facts = measured.circumstances()
    rows = kernels.measure()
    started = startup.measure()
    forms = truth.measure()
    reached = targets.measure(options.accuracy)
    items, one_step = whole_run.measure(), whole_run.one_step()
    many, called = ensemble.measure(), ensemble.calls()
    together = lanes.measure()
    for table in (
        kernels.lines(rows),
        startup.lines(started),
        truth.lines(forms),
        targets.lines(reached, options.accuracy),
        whole_run.lines(items, one_step),
        ensemble.lines(many),
        lanes.lines(together),
    ):
        print("\n".join(table), end="\n\n")
    options.results.mkdir(exist_ok=True)
    target = options.results / "bench.json"
    numbers = {
        "kernels": [row._asdict() for row in rows],
        "startup": started,
        "closed_form": [row._asdict() for row in forms],
        "run": {"parts": [item._asdict() for item in items], "one_step": one_step},
        "ensemble": [item._asdict() for item in many],
        "ensemble_calls": [call._asdict() for call in called],
        "lanes": {name: [row._asdict() for row in rows] for name, rows in together._asdict().items()},
        "targets": {"accuracy": options.accuracy, "methods": [row._asdict() for row in reached]},
    }
    content = findings(rows, started, forms, reached, items, one_step, many, called, together, options.accuracy, facts)
    netcdf.write_json(target, content | numbers)
    print(f"written to {target}")


if __name__ == "__main__":
    main()
