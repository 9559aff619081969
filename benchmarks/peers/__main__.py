"""Measure all peers that are installed: results/peers.nc, results/peers.json, results/figures/peers-fronts.png.

make peers        (makes benchmarks/peers/.venv once)
"""

import argparse
from pathlib import Path

from benchmarks.peers import ADAPTERS, load
from benchmarks.peers.measure import SCENES, measure
from benchmarks.peers.study import STUDY, measured
from benchmarks.peers.summary import lines
from symtop.base import datasets
from symtop.report import style
from symtop.runner import run, store


def main() -> None:
    """Measure, print and write down."""
    parser = argparse.ArgumentParser(description="symtop beside other libraries")
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--scenes", nargs="+", default=list(SCENES))
    parser.add_argument("--only", nargs="+", default=list(ADAPTERS), help="these libraries")
    parser.add_argument("--redraw", action="store_true", help="use the stored dataset")
    options = parser.parse_args()
    file = options.results / "peers.nc"
    peers, missing = load(tuple(options.only))
    for sentence in missing:
        print(sentence)
    if options.redraw:
        data = datasets.read(file)
    else:
        data = datasets.describe(measure(peers, options.scenes), STUDY.title, question=STUDY.question)
        datasets.write(data, file)
    findings = run.findings_of(
        STUDY, data, options.results, style.save, failures=missing, cases=data["seconds"].count().item()
    )
    store.write_json(options.results / "peers.json", findings | {"measured": measured(data)})
    print("\n".join(lines(data)))


if __name__ == "__main__":
    main()
