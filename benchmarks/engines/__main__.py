"""Run all engines that are installed against their maps: results/live-engines.json.

make engines        (makes benchmarks/engines/.venv and a second one with the last MuJoCo 3 once)
"""

import argparse
from pathlib import Path

from benchmarks.engines import ADAPTERS, load
from benchmarks.engines.measure import row
from benchmarks.engines.study import NAME, findings, verdict
from benchmarks.measured import circumstances, record
from symtop.core import netcdf


def main() -> None:
    """Measure, print and write down."""
    parser = argparse.ArgumentParser(description="physics engines against their maps")
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--only", nargs="+", default=list(ADAPTERS), help="these engines")
    parser.add_argument("--add", action="store_true", help="to what is stored, in place of the same versions")
    options = parser.parse_args()
    file = options.results / f"{NAME}.json"
    settings, missing = load(tuple(options.only))
    facts, rows = circumstances(), [row(setting) for setting in settings]
    if options.add and (stored := netcdf.read_json(file)):
        added = {(entry["engine"], entry["version"]) for entry in rows}
        rows = [entry for entry in stored["rows"] if (entry["engine"], entry["version"]) not in added] + rows
        missing = [*stored["missing"], *missing]
    versions: dict[str, list[str]] = {}
    for entry in rows:
        known = versions.setdefault(entry["engine"], [])
        known += [entry["version"]] if entry["version"] not in known else []
    about = record(facts, "make engines", {engine: " and ".join(known) for engine, known in versions.items()})
    page = findings(rows, missing, about)
    netcdf.write_json(file, page)
    for line in (*verdict(rows), *page["failures"]):
        print(line)


if __name__ == "__main__":
    main()
