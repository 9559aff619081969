"""Rounding of four methods against the same maps in 80-bit arithmetic: a second opinion on the drift study's ensembles.

    python -m benchmarks.roundoff --steps 1e7        (needs gcc and a long double of 80 bits)

Both runs start from the same doubles and are compared at the same steps, so that nothing has to be known about the
oscillation of the energy: the modified energy of the one less that of the other, in long double, is rounding alone. The
column beside it is what `symtop.long_run` finds from the double run by itself, and the last is the phase-like error of
theta, which grows as n^3/2.
"""

import argparse
import ctypes

import numpy as np

import symtop
from benchmarks.twin import library
from symtop.methods.framework.loop import inside
from symtop.run.long_run import PER_NUTATION, chart_of, long_run, windows
from symtop.run.modified_energy import modified_energy

WIDE = np.longdouble


def main() -> None:
    """Run both, side by side, and print the drifts at the ends of some windows."""
    parser = argparse.ArgumentParser(description="Drift by rounding against 80-bit arithmetic")
    parser.add_argument("--steps", type=float, default=1e6)
    options = parser.parse_args()
    if np.finfo(WIDE).nmant < 63:
        print("long double is no wider than double here: nothing to compare with")
        return
    maps, spheroid = library("extended", (), ("-O3",)), symtop.scene("spheroid")
    h, ends = spheroid.nutation_period / PER_NUTATION, windows(int(options.steps))
    print(f"{'method':<16}{'steps':>12}{'80 bits':>12}{'by itself':>12}{'theta':>12}")
    for name, method in symtop.integrators().items():
        if method.modified_energy is None:
            continue
        chart, solver = chart_of(method)
        assert inside(solver) is solver
        par, rule, state = solver.setup(spheroid.top, spheroid.start, h)
        run = long_run(spheroid, name, steps=int(options.steps), step_size=h, quiet=True)
        drifts = run["modified_energy_mean"].values
        size = 2 if chart == "angles" else 6
        wide = np.array(state[:size], dtype=WIDE)
        momenta = spheroid.top.momenta(spheroid.start)
        top = np.array([spheroid.top.I1, spheroid.top.mgl, momenta.north, momenta.south], dtype=WIDE)
        step, function = np.array([h], dtype=WIDE), maps[name.replace("-", "_")]
        at, last = solver.loop.start(par, rule, state, h), 0
        for place, end in enumerate(ends):
            _, at = solver.loop.advance(par, rule, at, h, np.array([end]))
            function(top.ctypes.data_as(ctypes.c_void_p), wide.ctypes.data_as(ctypes.c_void_p),
                     ctypes.c_longdouble(step[0]), ctypes.c_long(end - last))  # fmt: skip
            last = end
            ours = np.array(at.state[:size], dtype=WIDE) + np.array(at.low[:size], dtype=WIDE)
            pair = np.stack([ours, wide])
            energies = modified_energy(spheroid, name, chart, pair, h)
            drift = float((energies[0] - energies[1]) / spheroid.energy_scale)
            theta = pair[:, 0] if chart == "angles" else np.arccos(pair[:, 2])
            if place % 6 == 0 or end == ends[-1]:
                print(f"{name:<16}{end:>12}{drift:>12.1e}{drifts[place]:>12.1e}{float(theta[0] - theta[1]):>12.1e}")


if __name__ == "__main__":
    main()
