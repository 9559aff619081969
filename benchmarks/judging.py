"""`judge` on every method of `tests/judging/blind`: a line for each kind of claim, with its resolution and its cost.

    python -m benchmarks.judging          or with --full, of judging without --quick

A wrong method is caught if the line that names its defect is refuted, and a right one passes if nothing is. Time is of
the processor, of this process and those that it starts.
"""

import argparse
import os
import statistics
from itertools import groupby

import symtop
from tests.judging.blind import right, wrong
from tests.judging.test_blind import SHOWN, step_of

right.TOP = symtop.scene("spheroid").top


def processor_time():
    """Seconds of the processor so far, of this process and its children."""
    return sum(os.times()[:4])


def ledger_of(step, claims, options, *, quick):
    """The ledger of a method and the seconds that it cost."""
    before = processor_time()
    ledger = symtop.judge(step, quick=quick, seed=1, **claims, **options)
    return ledger, processor_time() - before


def main():
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.judging", description=str(__doc__).partition("\n")[0])
    parser.add_argument("--full", action="store_true", help="judge without --quick")
    quick, rows, costs = not parser.parse_args().full, [], []
    for name, (claims, line, options) in wrong.CLAIMS.items():
        ledger, cost = ledger_of(step_of(name, wrong, right), claims, options, quick=quick)
        costs.append((cost, name))
        rows.append((line, line in ledger.refuted, ledger[line].resolution, name))
    print("| refuted by | wrong methods | caught | resolution |\n|---|---|---|---|")
    for line, group in groupby(sorted(rows, key=lambda row: row[0]), key=lambda row: row[0]):
        of_line = list(group)
        low, high = (choose(row[2] for row in of_line) for choose in (min, max))
        passing = ", ".join(row[3] for row in of_line if not row[1])
        print(f"| {line} | {len(of_line)} | {sum(row[1] for row in of_line)} | {low:.0e} to {high:.0e} |", passing)
    bad = []
    for name, (claims, options) in right.CLAIMS.items():
        ledger, cost = ledger_of(step_of(name, right), claims, options, quick=quick)
        costs.append((cost, name))
        doubted = [claim for claim in claims if claim in SHOWN and ledger[claim].verdict != "confirmed"]
        bad += [f"{name}: {'/'.join(ledger.refuted)} refuted, {'/'.join(doubted)} not confirmed"] * bool(
            ledger.refuted or doubted
        )
    print(f"\n{len(right.CLAIMS)} right methods, {len(bad)} not confirmed", *bad, sep="\n")
    times = sorted(costs)
    middle = statistics.median(cost for cost, _ in times)
    print(f"\nprocessor: median {middle:.1f} s, most", *(f"{cost:.1f} s {name}" for cost, name in times[-5:]))


if __name__ == "__main__":
    main()
