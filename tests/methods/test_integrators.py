"""Discrete Lagrangians: exact values, orders, structure, failures; a wrong twin beside each right one."""

import math
import random

import numpy as np
import pytest
from scipy.optimize import root

import symtop
from symtop.measure.accuracy import error_table
from symtop.measure.order import order
from symtop.measure.step_map import StepMap, angles_at, one_step, return_miss, symplectic_defect
from symtop.methods.framework.angles import chart_outcome, ended_angles, on_angles
from symtop.methods.framework.loop import FixedStep, inside
from symtop.methods.framework.plan import LEFT_CHART, NOT_FINITE, OK
from symtop.methods.framework.registry import Integrator
from symtop.methods.lagrangian import discrete_lagrangian, galerkin, galerkin as kernel
from symtop.methods.lagrangian.discrete_lagrangian import Quadrature, forces, march, node_sums, opening
from symtop.methods.lagrangian.galerkin_gauss import gauss_rule
from symtop.methods.lagrangian.unreduced import unreduced
from symtop.model.top import Angles, SymmetricTop
from tests.conftest import defer, random_scenes


def fitted(scene_name, method, coarsest, column):
    """The fitted order over ten steps, from so many a nutation to 160 times as many."""
    scene = symtop.scene(scene_name)
    steps = [scene.nutation_period / (coarsest * 10 ** (2.2 * k / 9)) for k in range(10)]
    table = error_table(scene, method, steps, 8.0, observe="attitude")
    return order(table["step_size"], table[column], table["attitude_bound"], 2 * math.pi / scene.nutation_period)


@pytest.mark.parametrize(("name", "constant"), [("stormer-verlet", 35.3), ("midpoint", 137.3), ("trapezoidal", 127.9)])
def test_error_constants_are_the_known_ones(name, constant):
    """Attitude error C h^2 at t = 8 on spheroid, to 3 %."""
    fit = fitted("spheroid", symtop.integrator(name), 60.37, "attitude_end")
    assert fit.constant == pytest.approx(constant, rel=0.03)


def test_starting_from_q0_plus_h_v0_costs_an_order():
    """The negative control of every order test: the start that a public package uses."""

    def begun_wrongly(top, start):
        par, state = on_angles(top, start)
        rule, h = Quadrature((0.5,), (1.0,)), begun_wrongly.h
        # p1 = D2 Ld(q0, q0 + h v0) moved back by a step is the momentum that this start amounts to
        d = h * start.theta_dot
        sums = node_sums(rule, start.theta, d, opening(None, rule, start.theta))
        return par, (state[0], par.I1 * d / h + h * forces(par, sums).W0, *state[2:])

    def solve(top, start, plan):
        begun_wrongly.h = plan.step_size
        return FixedStep(march, Quadrature((0.5,), (1.0,)), begun_wrongly, 1, implicit=True)(top, start, plan)

    method = Integrator(name="badly-started-midpoint", family="other", summary="", solvers={"angles": solve})
    assert fitted("goldstein", method, 200.37, "attitude").slope == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("form", [lambda reduced: reduced, unreduced], ids=["reduced", "unreduced"])
def test_a_rule_that_is_not_symmetric_misses_the_start(form):
    lopsided = form(symtop.discrete_lagrangian("left", (0.0, 2.0 / 3.0), (0.25, 0.75)))
    assert lopsided.symmetric is False
    scene = random_scenes(1, seed=5)[0]
    assert return_miss(one_step(lopsided, "angles", scene, 0.02), scene.start) > 5e-9  # of the largest coordinate


IN_ANGLES = [name for name, method in symtop.integrators().items() if inside(method.solvers.get("angles")) is not None]


def violent(count, seed):
    """Random tops with steps that turn theta by up to a hundred radians, or by 1e20."""
    draw = random.Random(seed)
    for k in range(count):
        top = SymmetricTop(1.0, draw.uniform(0.05, 1.95), draw.uniform(-3.0, 3.0))
        theta = draw.choice([draw.uniform(0.0, math.pi), 10.0 ** draw.uniform(-6.0, -1.0)])
        y0 = Angles(theta, theta_dot=draw.gauss(0.0, 2.0), phi_dot=draw.gauss(0.0, 3.0), psi_dot=draw.gauss(0.0, 30.0))
        yield top, y0, 10.0 ** (draw.uniform(-3.0, 1.5) if k % 8 else draw.uniform(10.0, 20.0))


@pytest.mark.parametrize("theta", [0.0, -1e-300, math.pi, 4.0, 1e300])
def test_the_chart_ends_at_its_poles(theta):
    assert chart_outcome(theta) == LEFT_CHART
    assert chart_outcome(1.0) == chart_outcome(5e-324) == chart_outcome(math.nextafter(math.pi, 0.0)) == OK
    assert chart_outcome(math.nan) == chart_outcome(math.inf) == chart_outcome(-math.inf) == NOT_FINITE
    states = [(1.0, *row) for row in (*np.diag([math.inf] * 5).tolist(), [0.0] * 5)]
    assert [*map(ended_angles, states)] == [NOT_FINITE] * 5 + [OK]


@pytest.mark.parametrize("family", [discrete_lagrangian, galerkin], ids=lambda family: family.__name__)
def test_an_iteration_that_wanders_off_ends_as_with_the_sines_of_the_library(family):
    """One step in Python, whose sines are the library's, and compiled; where roots compete, a rounding may decide."""
    name = {discrete_lagrangian: "trapezoidal", galerkin: "galerkin-simpson"}[family]
    loop, rule = family.march, inside(symtop.integrator(name).solvers["angles"]).rule
    ends = []
    for top, start, h in violent(400, seed=3):
        par, state = on_angles(top, start)
        interpreted = family.march.increment(par, rule, state, family.begin(par, rule, state, h), h)[3]
        ends.append((interpreted, loop(par, rule, state, h, np.array([1])).outcome))
    assert {OK, LEFT_CHART} < {outcome for outcome, _ in ends}  # and not converged
    assert sum(first != second for first, second in ends) <= 4


@pytest.mark.quick
@pytest.mark.parametrize("name", IN_ANGLES)
def test_a_nan_stays_one(name):
    solver, scene = inside(symtop.integrator(name).solvers["angles"]), symtop.scene("spheroid")
    par, rule, state = solver.setup(scene.top, scene.start, 0.01)
    assert solver.loop(par, rule, state, 0.01, np.array([3])).outcome == OK
    broken = solver.loop(par, rule, (math.nan, *state[1:]), 0.01, np.array([3]))
    assert broken.outcome != OK
    assert broken.steps == 0


NAME = "galerkin-simpson"
SIMPSON = (0.0, 0.5, 1.0), (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)
GALERKIN = {NAME: (2, *SIMPSON)} | {f"galerkin-gauss-{2 * s}": (s, *gauss_rule(s)[:2]) for s in (2, 3, 4)}


def derivatives(top, theta, rate):
    """dL/dq' and dL/dq of the Lagrangian in three angles."""
    s, c = np.sin(theta), np.cos(theta)
    spin = top.I3 * (rate[2] + rate[1] * c)
    momentum = np.array([top.I1 * rate[0], top.I1 * rate[1] * s * s + spin * c, spin])
    return momentum, np.array([s * (top.I1 * rate[1] ** 2 * c - spin * rate[1] + top.mgl), 0.0, 0.0])


def independent_step(top, point, h, degree, nodes, weights):
    """One step from the stationary polynomial: equations for all its places, nothing eliminated, SciPy's solver."""
    q0, k, grid = point[:3], np.arange(degree + 1), np.linspace(0.0, 1.0, degree + 1)[:, None]
    c, basis = np.array(nodes)[:, None], np.linalg.inv(grid**k)
    values, rates = c**k @ basis, k * c ** np.maximum(k - 1, 0) @ basis  # at the nodes, of places at equal distances

    def slopes(unknown):
        q = np.concatenate([q0, unknown]).reshape(-1, 3)
        parts = [derivatives(top, place[0], rate / h) for place, rate in zip(values @ q, rates @ q, strict=True)]
        P, F = (np.array(column) * np.array(weights)[:, None] for column in zip(*parts, strict=True))
        return h * values.T @ F + rates.T @ P

    def equations(unknown):
        residual = slopes(unknown)[:-1]
        residual[0] += point[3:]
        return residual.ravel()

    start = angles_at(top, point)
    guess = q0 + h * grid[1:] * np.array([start.theta_dot, start.phi_dot, start.psi_dot])
    solution = root(equations, guess.ravel(), tol=1e-14)
    assert np.max(np.abs(solution.fun)) < 1e-12
    return np.concatenate([solution.x[-3:], slopes(solution.x)[-1]])


@pytest.mark.parametrize("name", GALERKIN)
@pytest.mark.parametrize("scene", random_scenes(8, seed=21), ids=lambda s: s.name)
def test_one_step_is_that_of_the_stationary_polynomial(name, scene):
    """The reduction to theta alone, and all six results of a step, against the equations of the whole top."""
    degree, nodes, weights = GALERKIN[name]
    for h in (0.1, 0.02):
        step = StepMap(symtop.integrator(name), "angles", scene.top, 1.0, h)
        point = step.point(scene.start)
        assert np.max(np.abs(step.image(point) - independent_step(scene.top, point, h, degree, nodes, weights))) < 2e-12
        if h == 0.1 and scene.name == "random-0":  # the control: other weights are another method
            wrong_weights = (weights[0] + 0.01, *weights[1:-1], weights[-1] - 0.01)
            image = independent_step(scene.top, point, h, degree, nodes, wrong_weights)
            assert not np.max(np.abs(step.image(point) - image)) < 2e-12


@pytest.mark.parametrize(
    "name", ["galerkin-gauss-4", *defer(*(key for key in GALERKIN if key != "galerkin-gauss-4"), "galerkin-gauss-12")]
)
def test_momenta_are_those_of_the_steps_made_however_long(name):
    """Of slow tops, whose steps are too long for one solution alone: a second solution would show other momenta."""
    tops, momenta = symtop.population(200, seed=1, kind="slow"), ["p_phi", "p_psi"]
    runs = symtop.ensemble(tops, name, per_nutation=8, nutations=10, samples=41, variables=momenta, quiet=True)
    for momentum in (runs[name].values[runs["outcome"].values == "ok"] for name in momenta):
        assert len(momentum) > 100
        change = np.nanmax(np.abs(momentum - momentum[:, :1]), axis=1)
        assert np.max(change / np.nanmax(np.abs(momentum), axis=1)) < 1e-9


def test_a_step_without_its_last_force_is_neither_symplectic_nor_symmetric():
    """The negative control of both: p_theta moved by the forces of the first two nodes only."""
    method = symtop.integrator(NAME)

    def solve(top, start, plan):
        run = method.solvers["angles"](top, start, plan)
        states = run.states.copy()
        states[:, 1] += plan.step_size / 6.0 * top.potential_slope(states[:, 0], top.momenta(start))
        return run._replace(states=states)

    variant = symtop.Integrator(name="wrong", family="other", summary="", solvers={"angles": solve})
    scene = random_scenes(1, seed=22)[0]
    assert symplectic_defect(one_step(variant, "angles", scene, 0.02), scene.start).size > 1e-5
    assert return_miss(one_step(variant, "angles", scene, 0.02), scene.start) > 1e-5


@pytest.mark.parametrize("scene", random_scenes(4, seed=25), ids=lambda s: s.name)
def test_every_derivative_of_a_trial_is_right(scene):
    """The analytic Jacobian against central differences; one that is off by a thousandth is seen."""
    par, (theta, *_) = on_angles(scene.top, scene.start)
    start, m, d, e = kernel.node_at(par, theta), 0.03, 0.07, 1e-5
    trial = lambda shift_m, shift_1: kernel._evaluate(par, start, theta + m + shift_m, theta + d + shift_1)

    def agree(factor):
        jets = trial(0.0, 0.0)
        by_m = [(a.value - b.value) / (2 * e) for a, b in zip(trial(e, 0.0), trial(-e, 0.0), strict=True)]
        by_1 = [(a.value - b.value) / (2 * e) for a, b in zip(trial(0.0, e), trial(0.0, -e), strict=True)]
        pairs = [(jet.by_m, value) for jet, value in zip(jets, by_m, strict=True)]
        pairs += [(jet.by_1, value) for jet, value in zip(jets, by_1, strict=True)]
        scale = max(abs(value) for _, value in pairs)
        return max(abs(factor * exact - value) for exact, value in pairs) < 1e-6 * scale

    assert agree(1.0)
    assert not agree(1.001)


@pytest.mark.parametrize("scene_name", ["spheroid", "goldstein"])
def test_the_iteration_ends_soon(scene_name):
    """At 200 steps a nutation the cubic predictor leaves two iterations; at 2000, one."""
    scene = symtop.scene(scene_name)
    for resolution, limit in ((200.0, 2.1), (2000.0, 1.3)):
        run = symtop.simulate(scene, NAME, step_size=scene.nutation_period / resolution)
        assert run.attrs["newton_iterations"] / run.attrs["steps"] < limit


def test_midpoint_is_the_implicit_midpoint_rule_to_rounding_also_near_a_pole():
    """theta1 - theta0 = h p_mid/I1, p1 - p0 = -h V'(theta_mid); a loose stop rule shows as an error."""
    scene = symtop.scene("spheroid")
    par, state = on_angles(scene.top, scene.start)
    h, marks = 0.02, np.arange(0, 40)

    def residual(tolerance):
        result = march(par, Quadrature((0.5,), (1.0,), tolerance), state, h, marks)
        theta, p = result.states[:, 0], result.states[:, 1]
        middle, momenta = 0.5 * (theta[1:] + theta[:-1]), scene.top.momenta(scene.start)
        assert np.diff(theta) == pytest.approx(h * 0.5 * (p[1:] + p[:-1]) / scene.top.I1, abs=5e-16)
        return np.max(np.abs(np.diff(p) + h * scene.top.potential_slope(middle, momenta)))

    assert residual(1e-8) < 5e-14
    assert residual(1e3) > 1e-9
    # theta swings through 1e-4 of the pole: the momenta of every step are still those of the start.
    top = symtop.SymmetricTop(1.0, 1.0, 1.0)
    scene = symtop.Scene("grazing", top, angles_at(top, (1e-4, 0.0, 0.0, 1e-4, 1.0 + 1e-8, 1.0)), 1.0)
    run = symtop.simulate(scene, NAME, step_size=0.01, samples=101)
    assert run.attrs["outcome"] == "ok"
    assert np.max(np.abs((run["p_phi"] - run["p_psi"]).values - top.momenta(scene.start).north)) < 4e-16
