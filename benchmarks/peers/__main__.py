"""Measure all peers that are installed: results/peers.nc, results/peers.json, results/figures/peers-fronts.png.

make peers        (makes benchmarks/peers/.venv once)
"""

import argparse
from pathlib import Path

from benchmarks.peers import ADAPTERS, load, summary, together
from benchmarks.peers.adapters.diffrax import PACKAGE as DIFFRAX, SOLVERS
from benchmarks.peers.measure import SCENES, measure
from benchmarks.peers.study import STUDY, findings
from symtop.core import netcdf
from symtop.measure import columns


def main() -> None:
    """Measure, print and write down."""
    parser = argparse.ArgumentParser(description="symtop beside other libraries")
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--scenes", nargs="+", default=list(SCENES))
    parser.add_argument("--only", nargs="+", default=list(ADAPTERS), help="these libraries")
    parser.add_argument("--redraw", action="store_true", help="use the stored dataset")
    options = parser.parse_args()
    file, page = options.results / "peers.nc", options.results / "peers.json"
    if options.redraw:
        data, stored = netcdf.read(file), netcdf.read_json(page) or {}
        many = [together.Row(**row) for row in stored.get("together", [])]
        missing = stored.get("failures", [])
    else:
        peers, missing = load(tuple(options.only))
        for sentence in missing:
            print(sentence)
        own_columns = netcdf.read_columns(Path(__file__).parent / "columns.tsv")
        data = columns.described(measure(peers, options.scenes), own=own_columns)
        data = netcdf.describe(data, STUDY.title, question=STUDY.question)
        netcdf.write(data, file)
        many = together.measure(SOLVERS if any(peer.package == DIFFRAX for peer in peers) else ())
    netcdf.write_json(page, findings(data, many, options.results, missing))
    sentences = [*summary.pairs(data), *summary.verdict(data), ""]
    print("\n".join([summary.tables(data)[1].text, *sentences, together.table(many).text, *together.verdict(many)]))


if __name__ == "__main__":
    main()
