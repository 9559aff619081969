"""The exact discrete top: the motion at any step, its discrete Lagrangian, and what rounding does to it."""

import dataclasses
import math

import numpy as np
import pytest

import symtop
from benchmarks import exactness
from symtop.methods.framework.loop import inside
from symtop.methods.lagrangian.oscillators import Map, numbers as exact_map, on_oscillators
from symtop.model import charts
from symtop.model.exact.digits import PreciseForm
from symtop.model.scenes import closed_form
from tests.slopes import slopes

METHOD = symtop.integrator("exact-discrete")
PERIODIC = [name for name in symtop.scenes() if name != "separatrix"]
UNSTABLE = {"sleeping-unstable": 2e-10}  # rounding of the start alone moves it by as much in ten nutations


def run(top, start, h, steps, chart="attitude", method=METHOD):
    """Samples after every step of exactly h."""
    return method.solvers[chart](top, start, symtop.Plan.steps(h, np.arange(steps + 1)))


def oscillators(scene, h, steps):
    """Of both: A, B, r and J, and Z of the closed form at every step, in the frame that turns by delta."""
    times, rule = h * np.arange(steps + 1), exact_map(scene.top, scene.start, h)
    par, start = on_oscillators(scene.top, scene.start)
    w, x, y, z = closed_form(scene).quaternion(times).T
    J = start[0] * start[5] - start[1] * start[4], start[2] * start[7] - start[3] * start[6]
    for chi, turn, aD, D, r, sigma, momentum in (
        (w - 1j * z, rule.turn1, rule.aD1, rule.D1, rule.r1, par.kappa, J[0]),  # twist and all
        (y - 1j * x, rule.turn2, rule.aD2, rule.D2, rule.r2, -par.kappa, J[1]),
    ):
        Z = chi * np.exp(0.5j * par.twist * times) * np.exp(-2j * np.pi * turn * np.arange(steps + 1))
        yield 1.0 + aD / D, -sigma / D, r, momentum, Z


@pytest.mark.parametrize("name", PERIODIC)
@pytest.mark.parametrize("steps", [100, 20, 4.37, 2.3, 2.0, 0.61, 2.0 / 3.0])
def test_the_step_is_the_motion_whatever_its_size(name, steps):
    scene = symtop.scene(name)
    h, count = scene.nutation_period / steps, math.ceil(10 * steps)
    result, bound = run(scene.top, scene.start, h, count), UNSTABLE.get(name, 1.5e-12)
    truth = closed_form(scene).state(h * np.arange(count + 1))
    assert result.outcome == "ok"
    assert charts.attitude_distance(result.states[:, :4], truth[:, :4]).max() < bound
    assert np.abs(result.states[:, 4:] - truth[:, 4:]).max() < bound * np.abs(truth[:, 4:]).max()
    axis = run(scene.top, scene.start, h, count, "axis")
    assert charts.axis_distance(axis.states[:, :3], charts.axis_from_quaternion(truth[:, :4])).max() < bound


def test_a_slow_top_keeps_its_energy_at_a_third_of_a_nutation_and_whole_ones_are_exact_beside_a_pole():
    top = symtop.SymmetricTop(1.0, 0.5, 1.0)
    for spin, share in ((0.3, 0.36), (0.3, 1.0 / 3.0), (0.0, 0.36)):
        scene = symtop.Scene("slow", top, symtop.Angles(1.0, psi_dot=spin), 1.0)
        h = share * scene.nutation_period
        data = symtop.simulate(scene, METHOD, step_size=h, horizon=900 * h, guard=False)
        assert np.ptp(data["energy"].values) < 1e-12
    starts = *map(symtop.Angles, (0.01, 1.0)), *(symtop.Angles(0.01, psi_dot=spin) for spin in (0.02, 3.95))
    beside_the_separatrix = symtop.Angles(1e-4, psi_dot=0.5), symtop.Angles(2.0, theta_dot=1.68295)  # over both poles
    for start in starts + beside_the_separatrix:
        form = symtop.ClosedForm(top, start)
        limit = 30 if start.theta == 1.0 else 8  # beside the separatrix short steps, too, lose 3e-9 in thirty of these
        for share, count in ((1.0, 30), (2.2, limit), (3.4, limit)) if start in starts else ((1.0, 10),):
            times = share * form.nutation_period * np.arange(count + 1)
            result = run(top, start, times[1], count, "axis")
            assert charts.axis_distance(result.states[:, :3], form.axis(times)).max() < 1e-9


def test_random_tops_follow_the_closed_form_at_every_step():
    worst = 0.0
    for top, start in exactness.random_tops(300, seed=3):
        form = symtop.model.exact.closed_form.ClosedForm(top, start)
        for steps in (100.0, 4.37, 2.3, 1.43):
            h = form.nutation_period / steps
            if not math.isfinite(h):
                continue
            result = run(top, start, h, round(2 * steps))
            gap = charts.attitude_distance(result.states[:, :4], form.quaternion(h * np.arange(round(2 * steps) + 1)))
            worst = max(worst, gap.max() / (1.0 + form.phi_per_period + form.psi_per_period))
    assert worst < 2e-12


def test_a_step_agrees_with_fifty_digits_and_a_neighbour_of_the_map_is_no_motion():
    scene = symtop.scene("spheroid")
    precise, h = PreciseForm(scene.top, scene.start, digits=50), scene.nutation_period / 3.1
    result = run(scene.top, scene.start, h, 3)
    for k in range(1, 4):
        quaternion = charts.quaternion_from_angles(*(float(value) for value in precise(k * h)[:3]))
        assert charts.attitude_distance(result.states[k, :4], quaternion) < 5e-15
    h, kernel = scene.nutation_period / 20.0, inside(METHOD.solvers["axis"])
    par, _ = on_oscillators(scene.top, scene.start)
    true = exact_map(scene.top, scene.start, h)
    D = 1.0 / h**2  # Stormer-Verlet's: A = 1 + 3 b h^2/2, B = -sigma h^2, no turn
    verlet, gaps = Map(1.5 * par.b1, D, 1 / h, h, 0.0, 1.5 * par.b2, D, 1 / h, h, 0.0, 0.0), []
    for rule in (true, verlet):
        solver = dataclasses.replace(kernel, rule=lambda top, start, h, rule=rule: rule)
        state = solver(scene.top, scene.start, symtop.Plan.steps(h, [40])).states
        gaps.append(charts.axis_distance(state[:, :3], closed_form(scene).axis([40 * h]))[0])
    assert gaps[0] < 1e-13
    assert gaps[1] > 1e-3


def test_a_free_top_a_step_back_and_the_separatrix_where_large_steps_are_divided():
    top, start = symtop.SymmetricTop(2.0, 1.0, 0.0), symtop.Angles(0.7, 0.2, 0.1, 0.3, -0.8, 1.1)
    form, result = symtop.model.exact.closed_form.ClosedForm(top, start), run(top, start, 0.7, 30)
    assert charts.attitude_distance(result.states[:, :4], form.quaternion(0.7 * np.arange(31))).max() < 1e-13
    assert np.ptp(run(top, symtop.Angles(0.7, 0.2, 0.1), 0.7, 3).states, axis=0).max() < 1e-15  # at rest
    scene = symtop.scene("goldstein")
    backwards = run(scene.top, scene.start, -0.3, 20)
    truth = closed_form(scene).quaternion(-0.3 * np.arange(21))
    assert charts.attitude_distance(backwards.states[:, :4], truth).max() < 1e-13
    scene = symtop.scene("separatrix")
    h = scene.horizon / 4.0
    result, truth = run(scene.top, scene.start, h, 4), closed_form(scene).quaternion(h * np.arange(5))
    assert charts.attitude_distance(result.states[:, :4], truth).max() < 1e-6
    assert result.force_evaluations > result.steps
    scene = symtop.scene("spheroid")
    assert run(scene.top, scene.start, scene.nutation_period / 2.3, 8).force_evaluations == 8


def lagrangian(A, B, r, q0, q1):
    """L_d of one oscillator on two points of the plane, shape (2,), complex for a complex step."""
    delta, s = q1 - q0, [q @ q for q in (q0, q1)]
    return r * (0.5 * delta @ delta - 0.5 * sum(value - A / B * np.log(1.0 + B * value) for value in s))


@pytest.mark.parametrize("name", ["spheroid", "goldstein", "grazing", "hairer-lubich-wanner"])
@pytest.mark.parametrize("steps", [50, 4.37, 2.3])
def test_the_true_motion_solves_the_discrete_euler_lagrange_equations(name, steps):
    scene = symtop.scene(name)
    for A, B, r, J, Z in oscillators(scene, scene.nutation_period / steps, 12):
        q = np.stack([Z.real, Z.imag], axis=1)
        for before, middle, after in zip(q, q[1:], q[2:], strict=False):
            arrives = slopes(lagrangian, A, B, r, before, middle)[1]
            leaves, control = (slopes(lagrangian, start, B, r, middle, after)[0] for start in (A, 1.001 * A))
            assert np.abs(arrives + leaves).max() < 2e-14 * r
            assert np.abs(arrives + control).max() > 1e-8 * r
            assert middle[0] * arrives[1] - middle[1] * arrives[0] == pytest.approx(J, abs=2e-14 * r)  # Noether


def test_reduction_commutes_with_the_step():
    """The heights of the axis alone obey wp's own exact map, of which the two oscillators know nothing."""
    scene = symtop.scene("spheroid")
    h = scene.nutation_period / 4.37
    par, _ = on_oscillators(scene.top, scene.start)
    P, u = exact_map(scene.top, scene.start, h).D1 + par.b1, run(scene.top, scene.start, h, 200, "axis").states[:, 2]
    y = 0.5 * (par.kappa * u + (par.b1 + par.b2))  # wp, for b1 + b2 = -mu
    sums = (2 * P * y**2 + (2 * P**2 - par.g2 / 2) * y - P * par.g2 / 2 - par.g3) / (y - P) ** 2
    assert np.abs(y[2:] + y[:-2] - sums[1:-1]).max() < 1e-12 * np.abs(y).max()
    assert np.abs(y[2:] + y[:-2] - (1 + 1e-6) * sums[1:-1]).max() > 1e-8


@pytest.mark.parametrize("name", ["spheroid", "goldstein"])
@pytest.mark.parametrize("steps", [40, 4.37, 2.3])
def test_the_discrete_routhians_of_both_oscillators_are_one_map_of_the_height(name, steps):
    """Reduced by J = r Im(conj(Z0) Z1), x = Re(conj(Z0) Z1): x+ + x- = 2 A s/(1 + B s), s+ = (x+^2 + (J/r)^2)/s."""
    scene = symtop.scene(name)
    h = scene.nutation_period / steps
    true = closed_form(scene).axis(h * np.arange(13))[:, 2]
    for error in (0.0, 1e-6):
        gaps = []
        for (A, B, r, J, Z), sign in zip(oscillators(scene, h, 12), (1.0, -1.0), strict=True):
            s, x, swept = abs(Z[1]) ** 2, (np.conj(Z[0]) * Z[1]).real, (J / r * (1.0 + error)) ** 2
            heights = []
            for _ in range(11):
                x = 2.0 * A * s / (1.0 + B * s) - x
                s = (x * x + swept) / s
                heights.append(sign * (2.0 * s - 1.0))
            gaps.append(np.abs(np.array(heights) - true[2:]).max())
        assert min(gaps) > 1e-8 if error else max(gaps) < 1e-12


def test_constants_stay_over_long_runs_and_edges_are_met_to_rounding():
    marks = np.arange(20_000, 2_000_001, 20_000)
    changes = np.abs(exactness.constants_of(4.37, marks)).max(axis=1)
    assert changes[0] < 2e-14
    assert changes[1:].max() < 1e-14
    assert np.abs(exactness.constants_of(4.37, marks, exactness.forgetful()))[:3].max(axis=1).min() > 2e-14  # they walk
    for line in exactness.of_edges():
        assert float(line.split()[-3]) < (1e-5 if "separatrix" in line else 1e-12), line


def stay(marks, errors):
    """Do errors of several runs, shape (runs, marks), neither grow nor lean to one side?"""
    exponent = np.polyfit(np.log(marks), np.log(np.maximum(np.sqrt((errors**2).mean(axis=0)), 1e-16)), 1)[0]
    mean, spread = errors[:, -1].mean(), errors[:, -1].std(ddof=1) / math.sqrt(len(errors))
    return abs(exponent) < 0.25 and abs(mean) < 4.0 * max(spread, 1e-16)


@pytest.mark.slow
def test_a_thousand_random_tops_and_long_runs_keep_energy_and_momenta():
    """`python -m benchmarks.exactness` takes ten thousand."""
    errors = exactness.of_random_tops(1000)
    assert errors.shape == (1000, 4)
    assert np.median(errors) < 1e-15
    assert errors.max() < 1e-12
    for line in exactness.of_scenes():
        name, *_, one, thousand, million = line.split()
        bounds = (1e-11, 1e-9, 1e-4) if name in UNSTABLE else (3e-13, 3e-10, 1e-4)
        assert all(float(error) < bound for error, bound in zip((one, thousand, million), bounds, strict=True)), line
    # A walk, which sums of one double make, or a drift of 1e-21 a step would be seen: the negative controls.
    marks = np.unique(np.geomspace(1e6, 1e8, 9).astype(np.int64))
    errors = exactness.walkers(marks)
    assert np.abs(errors[:, 3]).max() < 1e-14
    for k in range(3):
        assert np.abs(errors[:, k]).max() < 2e-14
        assert stay(marks, errors[:, k])
        assert not stay(marks, errors[:, k] + 1e-21 * marks)
    marks = np.unique(np.geomspace(1e5, 1e7, 9).astype(np.int64))
    assert not stay(marks, exactness.walkers(marks, exactness.forgetful())[:, 1])
