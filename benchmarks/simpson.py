"""Published properties of the Simpson variational integrator on the Lagrange top, each measured again, and its cost.

    python -m benchmarks.simpson [SCENE]

Rojas-Quintero, Dubois and Jourdan (arXiv:2512.03330) put the Galerkin integrator with a parabola in time and Simpson's
rule (`galerkin-simpson`) beside the midpoint rule on this top and its exact solution. Their points:

    order        inclination and energy converge with order 4; with order 2 by the midpoint rule
    momenta      p_phi and p_psi are conserved
    energy       its error does not grow with time
    reduced      a classical method of order 4 on the reduced top departs from it by an amount of order 4

Each is measured here with a control that lacks the property. They give no times; `cost` adds these: the bare compiled
loop at the coarsest step that meets an accuracy, in one run.
"""

import argparse
from typing import NamedTuple

import numpy as np

import symtop
from symtop.measure.order import power_law
from symtop.measure.timing import bare_run, timings
from symtop.model.scenes import Scene, scenes

SIMPSON, MIDPOINT, CLASSICAL = "galerkin-simpson", "midpoint", "rk4"
OTHERS = ("strang", "gauss-4", "takahashi-imada")  # for `cost`: the usual splitting, Gauss of the same order, the best
ROWS = (f"{SIMPSON}[angles]", f"{MIDPOINT}[angles]", f"{CLASSICAL}[angles]", *(f"{name}[axis]" for name in OTHERS))
PER_NUTATION = (60, 90, 135, 200)
LONG = 1000.0  # nutations
ACCURACY, NUTATIONS = 1e-6, 10.0


class Point(NamedTuple):
    """One point: the Simpson integrator and its control."""

    name: str
    simpson: float
    control: float
    of: str  # the control


class Cost(NamedTuple):
    """A variant at the coarsest step that meets the accuracy of the inclination."""

    row: str
    per_nutation: float
    seconds: float


def convergence(scene: Scene) -> list[Point]:
    """Orders of the inclination and of the energy over ten nutations."""
    horizon = NUTATIONS * scene.nutation_period
    rows = [f"{name}[angles]" for name in (SIMPSON, MIDPOINT)]
    data = symtop.sweep(scene, rows, per_nutation=PER_NUTATION, horizon=horizon, quiet=True).isel(scene=0)
    steps = 1.0 / np.array(PER_NUTATION)
    orders = {name: [power_law(steps, data[name].values[k]).slope for k in range(2)] for name in ("theta", "energy")}
    return [Point(f"order of {name}", *pair, MIDPOINT) for name, pair in orders.items()]


def conservation(scene: Scene) -> list[Point]:
    """Largest change of a momentum, and growth of the energy error from the first tenth of a long run to its last."""
    step, horizon = scene.nutation_period / PER_NUTATION[0], LONG * scene.nutation_period
    moved, grown = [], []
    for row in (f"{SIMPSON}[angles]", f"{CLASSICAL}[axis]"):
        run = symtop.simulate(scene, row, step_size=step, horizon=horizon, samples=20_001, guard=False)
        scale = max(abs(float(run["p_phi"][0])), abs(float(run["p_psi"][0])))
        moved.append(max(float(np.abs(run[name] - run[name][0]).max()) / scale for name in ("p_phi", "p_psi")))
        error = np.abs(run["energy"].values - run["energy"].values[0])
        tenth = error.size // 10
        grown.append(float(error[-tenth:].max() / error[:tenth].max()))
    return [Point("momenta", *moved, f"{CLASSICAL}[axis]"), Point("energy grows by", *grown, f"{CLASSICAL}[axis]")]


def reduced(scene: Scene) -> Point:
    """Order of the difference from RK4 on the reduced top; of the midpoint rule's as the control."""
    horizon = NUTATIONS * scene.nutation_period
    differences: dict[str, list[float]] = {SIMPSON: [], MIDPOINT: []}
    for count in PER_NUTATION:
        states = {
            name: symtop.simulate(
                scene, f"{name}[angles]", step_size=scene.nutation_period / count, horizon=horizon, guard=False
            )["theta"].values
            for name in (SIMPSON, MIDPOINT, CLASSICAL)
        }
        for name, gaps in differences.items():
            gaps.append(float(np.abs(states[name] - states[CLASSICAL]).max()))
    orders = [power_law(1.0 / np.array(PER_NUTATION), gaps).slope for gaps in differences.values()]
    return Point(f"order of the difference from {CLASSICAL}[angles]", *orders, MIDPOINT)


def points(scene: Scene) -> list[Point]:
    """All published properties, measured on a scene."""
    return [*convergence(scene), *conservation(scene), reduced(scene)]


def cost(scene: Scene) -> list[Cost]:
    """Times of all variants at the accuracy, each at the coarsest of steps 5 % apart that meets it."""
    horizon = NUTATIONS * scene.nutation_period
    ladder = np.unique(np.rint(np.geomspace(20, 20_000, 143)))
    data = symtop.sweep(scene, ROWS, per_nutation=ladder, horizon=horizon, quiet=True).isel(scene=0)
    good = data["theta"].values <= ACCURACY  # (row, step)
    chosen = [float(ladder[int(np.argmax(np.logical_and.accumulate(row[::-1])[::-1]))]) for row in good]
    assert good[:, -1].all()
    methods = [symtop.integrator(row) for row in ROWS]
    calls = [
        bare_run(scene, method, method.chart_for("axis"), scene.nutation_period / count, horizon)
        for method, count in zip(methods, chosen, strict=True)
    ]
    return [Cost(row, count, timing.best) for row, count, timing in zip(ROWS, chosen, timings(calls), strict=True)]


def main() -> None:
    """Print the points and the costs of a scene, spheroid by default."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.simpson", description=str(__doc__).partition("\n")[0])
    parser.add_argument("scene", nargs="?", default="spheroid", choices=scenes())
    scene = scenes()[parser.parse_args().scene]
    print(f"{scene.name}: {NUTATIONS:g} nutations, {PER_NUTATION[0]} to {PER_NUTATION[-1]} steps each; {LONG:g} of "
          f"{PER_NUTATION[0]} steps for what is conserved")  # fmt: skip
    for point in points(scene):
        print(f"{point.name:40} {SIMPSON} {point.simpson:9.3g}   {point.of} {point.control:9.3g}")
    costs = cost(scene)
    print(f"inclination to {ACCURACY:g} rad over {NUTATIONS:g} nutations: steps a nutation, time, over {SIMPSON}")
    for run in costs:
        print(f"{run.row:26} {run.per_nutation:7g} {1e6 * run.seconds:9.1f} us {run.seconds / costs[0].seconds:7.2f}")


if __name__ == "__main__":
    main()
