"""Errors of `exact-discrete` against fifty digits: short, long and very long runs, steps of all sizes, random tops.

    python -m benchmarks.exactness [scenes] [tops] [edges] [constants]          (all but the last: two minutes)

A run of N steps of h ends at the time N h, a product of two doubles that the truth takes exactly. Errors are those of
the whole attitude, in radians. `constants` measures what rounding does to the energy and both momenta over a thousand
million steps, of several runs with steps a little apart, so that a walk shows in their spread and a drift of one sign
in their mean: five minutes on a quiet machine. `forgetful` is the same map whose sums lose what they round off: it
walks, like the square root of the time.
"""

import argparse
import dataclasses
import math
from collections.abc import Iterator
from decimal import Decimal, localcontext
from typing import Any

import numpy as np

import symtop
from symtop.methods.framework.loop import FixedStep, Loop, inside
from symtop.methods.framework.plan import Plan
from symtop.methods.lagrangian import exact_discrete
from symtop.methods.lagrangian.oscillators import numbers as exact_map
from symtop.methods.vectors import accumulate_plainly
from symtop.model import charts
from symtop.model.exact.digits import PreciseForm
from symtop.model.top import Angles, SymmetricTop

METHOD = "exact-discrete"
DIGITS = 50
NUTATIONS = (1, 1_000, 1_000_000)
STEPS = (100.3, 20.1, 4.37, 2.3, 0.61)  # a nutation
LEFT_OUT = ("separatrix",)  # its nutation has no length
TOPS, SEED = 10_000, 20
MARKS = 7  # samples of a random top's run, over two nutations
WALK, WALK_STEPS, WALKERS = 1_000_000_000, 4.37, 8  # steps; steps a nutation of the first of so many runs
LAST_PLACE = 2.0**-53
PARTS = ("scenes", "tops", "edges", "constants")


def attitude_error(precise: PreciseForm, state: np.ndarray, h: float, steps: int) -> float:
    """Distance of a state from the motion after exactly steps h, rad."""
    with localcontext() as exactly:
        exactly.prec = 60
        motion = precise(str(Decimal(h) * steps))
    truth = charts.quaternion_from_angles(float(motion[0]), float(motion[1]), float(motion[2]))
    return float(charts.attitude_distance(state[:4], truth))


def of_scenes() -> Iterator[str]:
    """A line for each scene and step."""
    method = symtop.integrator(METHOD)
    for name, scene in symtop.scenes().items():
        if name in LEFT_OUT:
            continue
        precise = PreciseForm(scene.top, scene.start, digits=DIGITS)
        for steps in STEPS:
            h = scene.nutation_period / steps
            marks = [round(count * steps) or 1 for count in NUTATIONS]
            states = method.solvers["attitude"](scene.top, scene.start, Plan.steps(h, marks)).states
            errors = (attitude_error(precise, state, h, mark) for state, mark in zip(states, marks, strict=True))
            yield f"{name:<22}{steps:7.2f} steps a nutation" + "".join(f"{error:10.0e}" for error in errors)


def random_tops(count: int, seed: int = SEED) -> Iterator[tuple[SymmetricTop, Angles]]:
    """Inertias, gravity of either sign and rates over one or three decades, the axis in any direction."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        I1 = 10.0 ** rng.uniform(-0.5, 0.5)
        top = SymmetricTop(I1, I1 * rng.uniform(0.1, 1.9), 10.0 ** rng.uniform(-2, 1) * rng.choice([1.0, -1.0]))
        angles = np.arccos(rng.uniform(-1.0, 1.0)), *rng.uniform(-np.pi, np.pi, 2)
        yield top, Angles(*map(float, angles), *map(float, rng.normal(size=3) * 10.0 ** rng.uniform(-1, 1)))


def of_random_tops(count: int = TOPS) -> np.ndarray:
    """Errors after two nutations, shape (tops, steps), over the radians that phi and psi have turned."""
    method, rows = symtop.integrator(METHOD), []
    for top, start in random_tops(count):
        form = symtop.model.exact.closed_form.ClosedForm(top, start)
        angle = 1.0 + 2.0 * (abs(form.phi_per_period) + abs(form.psi_per_period))
        row = []
        for steps in STEPS[:4]:
            h = form.nutation_period / steps
            marks = np.unique(np.linspace(1, round(2 * steps), MARKS).astype(int))
            states = method.solvers["attitude"](top, start, Plan.steps(h, marks)).states
            row.append(charts.attitude_distance(states[:, :4], form.quaternion(h * marks)).max() / angle)
        rows.append(row)
    return np.array(rows)


def of_edges() -> Iterator[str]:
    """A line for each special case of a step, with the error and the number of parts of the step."""
    spheroid, separatrix = symtop.scene("spheroid"), symtop.scene("separatrix")
    start, T = spheroid.start, spheroid.nutation_period
    free = SymmetricTop(spheroid.top.I1, spheroid.top.I3, 0.0)
    hanging = SymmetricTop(1.0, 0.5, -1.0)
    cases = [
        ("half a nutation: A is a rounded zero", spheroid.top, start, 0.5 * T),
        ("a whole nutation: the map of what is left of it", spheroid.top, start, T),
        ("17 nutations and a half", spheroid.top, start, 17.5 * T),
        ("a step of 1e-9 nutations", spheroid.top, start, 1e-9 * T),
        ("a step back", spheroid.top, start, -T / 4.37),
        ("no gravity: B = 0", free, start, 0.7),
        ("a hanging top at rest", hanging, Angles(0.0), 0.7),
        ("a hanging top through the pole", hanging, Angles(0.0, theta_dot=0.5), 0.7),
        ("a separatrix, an eighth of the climb", separatrix.top, separatrix.start, separatrix.horizon / 8.0),
        ("a separatrix, up and to the next climb", separatrix.top, separatrix.start, separatrix.horizon / 2.0),
    ]
    method, steps = symtop.integrator(METHOD), 4
    for words, top, start, h in cases:
        states = method.solvers["attitude"](top, start, Plan.steps(h, [steps])).states
        precise = PreciseForm(top, start, digits=DIGITS)
        parts = exact_map(top, start, h).parts
        yield f"{words:<52}{attitude_error(precise, states[0], h, steps):8.0e}{parts:6.0f} parts"


def forgetful() -> Loop:
    """The loop of the map with sums in one double, which lose what they round off."""
    return Loop(exact_discrete.begin, _forgetting, exact_discrete.observe, exact_discrete.enter,
                  exact_discrete.present_axis, accumulate_plainly)  # fmt: skip


def _forgetting(par: Any, rule: Any, state: Any, carry: Any, h: float) -> Any:
    dstate, after, work, outcome = exact_discrete.increment(par, rule, state, carry, h)
    return dstate, after[:4] + (0.0,) * 8, work, outcome


def constants_of(steps: float, marks: np.ndarray, loop: Loop | None = None) -> np.ndarray:
    """Relative errors of the energy, p_psi and p_phi of spheroid at the marks, and of |e|, shape (4, marks)."""
    scene, solver = symtop.scene("spheroid"), inside(symtop.integrator(METHOD).solvers["axis"])
    assert isinstance(solver, FixedStep)
    if loop is not None:
        solver = dataclasses.replace(solver, loop=loop)
    run = solver(scene.top, scene.start, Plan.steps(scene.nutation_period / steps, marks))
    e, L = run.states[:, :3], run.states[:, 3:]
    L0 = charts.space_state("axis", scene.top, scene.start)[3:]
    start = 0.5 * (L0 @ L0) / scene.top.I1 + scene.top.mgl * math.cos(scene.start.theta)
    energy = 0.5 * (L * L).sum(axis=1) / scene.top.I1 + scene.top.mgl * e[:, 2]
    momenta = scene.top.momenta(scene.start)
    ratios = energy / start, run.p_psi / momenta.p_psi, run.p_phi / momenta.p_phi, np.linalg.norm(e, axis=1)
    return np.array(ratios) - 1.0


def walkers(marks: np.ndarray, loop: Loop | None = None) -> np.ndarray:
    """`constants_of` for steps a little apart, shape (`WALKERS`, 4, marks)."""
    return np.array([constants_of(WALK_STEPS + k * math.pi / 1e4, marks, loop) for k in range(WALKERS)])


def of_constants() -> Iterator[str]:
    """rms errors of the constants of all walkers, and their mean over its standard error: beyond 3 it is a drift."""
    for words, steps, loop in (("sums of two doubles", WALK, None), ("sums of one", WALK // 100, forgetful())):
        marks = np.unique(np.geomspace(steps / 1e4, steps, 9).astype(np.int64))
        errors = walkers(marks, loop)
        spread, mean = np.sqrt((errors**2).mean(axis=0)), errors.mean(axis=0)
        deviation = errors.std(axis=0, ddof=1) / math.sqrt(len(errors))
        for name, row, middle, unsure in zip(("energy", "p_psi", "p_phi"), spread, mean, deviation, strict=False):
            slope = np.polyfit(np.log(marks), np.log(np.maximum(row, LAST_PLACE)), 1)[0]
            yield f"{name}, {words}: rms {row[0]:.1e} at {marks[0]:.0e} steps to {row[-1]:.1e} at {marks[-1]:.0e}"
            ratio = abs(middle[-1]) / max(unsure[-1], LAST_PLACE)
            yield f"    exponent {slope:.2f}, mean {middle[-1]:+.1e}, {ratio:.1f} standard errors"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description="Errors of exact-discrete against fifty digits")
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(PARTS)}")
    parts = parser.parse_args().parts or PARTS[:3]
    if not set(parts) <= set(PARTS):
        parser.error(f"parts must be of {', '.join(PARTS)}, not {' '.join(parts)}")
    if "scenes" in parts:
        print("error of the attitude, rad, after " + ", ".join(f"{count:,}" for count in NUTATIONS) + " nutations")
        for line in of_scenes():
            print(line, flush=True)
        print(f"left out: {', '.join(LEFT_OUT)}, whose nutation never ends; see the edges")
    if "tops" in parts:
        errors = of_random_tops()
        print(f"\n{TOPS} random tops, two nutations, error over the angle turned: median, 99.9 %, largest")
        for steps, column in zip(STEPS, errors.T, strict=False):
            quantiles = (np.median(column), np.quantile(column, 0.999), column.max())
            print(f"{steps:7.2f} steps a nutation" + "".join(f"{value:10.0e}" for value in quantiles))
    if "edges" in parts:
        print("\nno step is refused; at the edges, error of the attitude after four steps, rad, and parts of a step")
        for line in of_edges():
            print(line, flush=True)
    if "constants" in parts:
        print(f"\nconstants of spheroid over {WALK:.0e} steps, {WALKERS} runs")
        for line in of_constants():
            print(line, flush=True)


if __name__ == "__main__":
    main()
