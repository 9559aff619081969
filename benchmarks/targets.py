"""Time to an attitude error on spheroid at t = 8, in microseconds and in steps of Stormer-Verlet, in one run.

    make bench        or        python benchmarks/targets.py --accuracy 1e-9

For every fixed-step method that shows the attitude: the coarsest step on a fine ladder that meets the accuracy (all
finer ones do too), and the time of that run with everything a call costs. The last column scales it to a machine on
which Verlet takes 30 ns a step, so that machines can be compared.
"""

import argparse

import numpy as np

import symtop
from symtop import charts
from symtop.integrators.registry import Plan
from symtop.measure.timing import timings

HORIZON = 8.0
LADDER = np.unique(np.rint(np.geomspace(24, 60_000, 260)).astype(int))  # steps, 3 % apart


def plan_of(steps: int) -> Plan:
    """Start to horizon, one sample."""
    return Plan(np.array([HORIZON]), HORIZON, HORIZON / steps, np.array([steps]), np.nan)


def steps_needed(method: symtop.Integrator, scene: symtop.Scene, chart: str, accuracy: float) -> int | None:
    """The fewest steps on the ladder from which on every run is accurate enough."""
    true = symtop.ClosedForm(scene.top, scene.start).quaternion([HORIZON])[0]
    fewest = None
    for steps in LADDER[::-1]:
        state = method.solvers[chart](scene.top, scene.start, plan_of(int(steps))).states[-1]
        turned = chart == "angles"
        found = charts.quaternion_from_angles(state[0], state[2], state[3]) if turned else state[:4]
        if not charts.attitude_distance(found, true) <= accuracy:
            return fewest
        fewest = int(steps)
    return fewest


def main() -> None:
    """Find the steps, time the runs, print the table."""
    parser = argparse.ArgumentParser(description="Time to an attitude error on spheroid at t = 8")
    parser.add_argument("--accuracy", type=float, default=1e-9)
    options = parser.parse_args()
    scene = symtop.scene("spheroid")
    found = {}
    for method in symtop.integrators().values():
        chart = "attitude" if "attitude" in method.solvers else "angles"
        if method.knob == "step_size" and chart in method.solvers:
            steps = steps_needed(method, scene, chart, options.accuracy)
            if steps is not None:
                found[method.name] = (method.solvers[chart], steps)
    verlet = symtop.integrator("stormer-verlet").solvers["angles"]
    base = 200_000
    calls = [lambda: verlet(scene.top, scene.start, plan_of(base))]
    calls += [lambda s=solve, n=steps: s(scene.top, scene.start, plan_of(n)) for solve, steps in found.values()]
    step, *times = (timing.best for timing in timings(calls))
    step /= base
    print(f"Stormer-Verlet: {step * 1e9:.1f} ns a step; attitude error {options.accuracy:g} on spheroid, t = 8")
    print(f"{'method':<32}{'steps':>8}{'us':>10}{'Verlet steps':>14}{'us at 30 ns':>13}")
    for (name, (_, steps)), seconds in sorted(zip(found.items(), times, strict=True), key=lambda pair: pair[1]):
        print(f"{name:<32}{steps:>8}{seconds * 1e6:>10.1f}{seconds / step:>14.0f}{seconds / step * 0.03:>13.1f}")


if __name__ == "__main__":
    main()
