"""Every kernel beside C, what starting costs, and the time to an accuracy: one table, kept in results/bench.json.

make bench        (needs gcc; the twins are built into benchmarks/build)
"""

import argparse
import sys
from pathlib import Path

from benchmarks import kernels, startup, targets, twin
from symtop.base import datasets
from symtop.runner import store


def main() -> None:
    """Measure, print and write down."""
    parser = argparse.ArgumentParser(description="Kernels against C, start-up, and time to an accuracy")
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--accuracy", type=float, default=targets.ACCURACY)
    options = parser.parse_args()
    if twin.compiler() is None:
        sys.exit("make bench needs gcc for the C twins, and there is none on the path")
    rows = kernels.measure()
    started = startup.measure()
    reached = targets.measure(options.accuracy)
    for table in (kernels.lines(rows), startup.lines(started), targets.lines(reached, options.accuracy)):
        print("\n".join(table), end="\n\n")
    options.results.mkdir(exist_ok=True)
    target = options.results / "bench.json"
    store.write_json(
        target,
        {
            "kernels": [row._asdict() for row in rows],
            "startup": started,
            "targets": {"accuracy": options.accuracy, "methods": [row._asdict() for row in reached]},
            "provenance": datasets.provenance(),
        },
    )
    print(f"written to {target}")


if __name__ == "__main__":
    main()
