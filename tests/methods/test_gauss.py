"""Gauss methods: orders, the four constants at once, symmetry, stability at any step, and stages beyond sweeps."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from symtop_studies.stability.linear_limits import linear_limits

import symtop
from symtop.measure.step_map import one_step as map_of, symplectic_defect
from symtop.methods.framework.space import SpaceTop, field_axis, frame_to_attitude, on_axis, on_frame
from symtop.methods.runge_kutta.gauss import STAGES, gauss_rule, march_axis, march_frame
from symtop.model import charts
from symtop.model.scenes import steady
from symtop.run.linear_stability import trace
from tests.slopes import assert_order

ONE = np.array([1])


def nudged(stages, by, mirrored):
    """mu with one entry moved; `mirrored` keeps mu + mu^T = 1."""
    mu = gauss_rule(stages).mu.copy()
    mu[1, 0] += by
    if mirrored:
        mu[0, 1] -= by
    solver = symtop.FixedStep(march_axis, gauss_rule(stages)._replace(mu=mu), on_axis, stages, implicit=True)
    return dataclasses.replace(symtop.integrator(f"gauss-{2 * stages}"), name="wrong", solvers={"axis": solver})


def one_step(stages, state, par, h):
    return march_axis(par, gauss_rule(stages), tuple(state), h, ONE).states[0]


# steps a nutation between which the error is asymptotic and above rounding
WINDOWS = {6: (25, 130), 10: (8, 26), 12: (5, 16)}  # `test_structure` has the orders up to 8


@pytest.mark.parametrize("scene", ["spheroid", "goldstein"])
@pytest.mark.parametrize("order", WINDOWS)
def test_order(scene, order):
    assert_order(scene, symtop.integrator(f"gauss-{order}"), order, 0.05 if order <= 6 else 0.3, WINDOWS[order])


def assert_keeps_everything(method, scene, observe, nutation_steps, limit=1e-13, steps=100_000):
    """|e|, L.e, L_z and the energy together, over so many steps, relative."""
    h = symtop.scene(scene).nutation_period / nutation_steps
    run = symtop.simulate(scene, method, step_size=h, horizon=steps * h, samples=501, observe=observe, guard=False)
    assert run.attrs["outcome"] == "ok"
    for name in ("energy", "p_phi", "p_psi"):
        assert np.max(np.abs(run[name] / run[name][0] - 1.0)) < limit, name
    assert np.max(np.abs(np.linalg.norm(run["axis"], axis=1) - 1.0)) < limit, "length"


def test_a_wrong_table_loses_the_order_or_the_constants_and_no_gauss_method_is_poisson():
    with pytest.raises(AssertionError, match="order"):
        assert_order("spheroid", nudged(3, 1e-3, mirrored=True), 6, 0.05, WINDOWS[6])
    with pytest.raises(AssertionError, match=r"energy|p_psi"):  # 1e-12 is 4500 rounding units of one coefficient
        assert_keeps_everything(nudged(3, 1e-12, mirrored=False), "spheroid", "axis", 30.3)
    # the order is lost but not the constants: they need only mu + mu^T = 1
    assert_keeps_everything(nudged(3, 1e-3, mirrored=True), "spheroid", "axis", 30.3)
    # Why `symplectic` is false: the bracket is missed by the method's own local error, of order 2s + 1.
    scene = symtop.scene("spheroid")

    def defect(order, h):
        return symplectic_defect(map_of(symtop.integrator(f"gauss-{order}"), "axis", scene, h), scene.start).size

    for order, h in ((2, 0.05), (4, 0.1)):
        coarse, fine = defect(order, h), defect(order, h / 2.0)
        assert abs(np.log2(coarse / fine) - (order + 1)) < 0.5, (order, coarse, fine)
    assert defect(12, 0.2) < 1e-9  # the exact map, as far as differences see


LARGE = (2.0, 5.0, 10.0)  # h omega; sweeps converge up to about 1.6 with one stage
STEADY = symtop.scene("steady-fast")
OMEGA = STEADY.top.nutation_frequency(STEADY.top.momenta(STEADY.start))


def pade(stages, x):
    """The stability function of a Gauss method, the diagonal approximant of exp, of a number or a square matrix."""
    power, above, below = np.eye(len(x)) if np.ndim(x) else 1.0, 0.0, 0.0
    for k in range(stages + 1):
        weight = math.comb(stages, k) * math.factorial(2 * stages - k) / math.factorial(2 * stages)
        above, below = above + weight * power, below + (-1) ** k * weight * power
        power = power @ x if np.ndim(x) else power * x
    return np.linalg.solve(below, above) if np.ndim(x) else above / below


@pytest.mark.parametrize("up", [1.0, -1.0])
@pytest.mark.parametrize("phase", LARGE)
@pytest.mark.parametrize("stages", STAGES)
def test_a_step_next_to_a_vertical_top_is_the_stability_function(stages, phase, up):
    """There the equations of z = e_x + i e_y and l = L_x + i L_y are linear: the step is R(h J), entry by entry."""
    top = symtop.SymmetricTop(2.0, 1.0, 3.0)
    par, _ = on_axis(top, symtop.Angles(theta=1.0))
    spin = 7.0  # p_psi = L_z; upright tops sleep from 2 sqrt(I1 mgl) = 4.9 on
    slope = 1j * np.array([[spin / top.I1, -up / top.I1], [top.mgl, 0.0]])
    h, tilt = phase / np.abs(np.linalg.eigvals(slope).imag).max(), 1e-6
    matrix = np.empty((2, 2), dtype=complex)
    for column, (z, momentum) in enumerate(((tilt, 0.0), (0.0, tilt))):
        after = one_step(stages, (z, 0.0, up, momentum, 0.0, spin), par, h)
        matrix[:, column] = after[0] + 1j * after[1], after[3] + 1j * after[4]
    np.testing.assert_allclose(matrix / tilt, pade(stages, h * slope), rtol=0, atol=1e-8)
    np.testing.assert_allclose(np.abs(np.linalg.eigvals(matrix / tilt)), 1.0, rtol=0, atol=1e-8)
    assert abs(abs(pade(stages, 1.0 + 1j * phase)) - 1.0) > 1e-3  # off the imaginary axis it is not one


@pytest.mark.parametrize(("scene", "observe"), [
    ("spheroid", "axis"), *((scene, observe) for scene in ("goldstein", "cusp") for observe in ("axis", "attitude")),
])  # fmt: skip
@pytest.mark.parametrize("stages", STAGES)
def test_everything_is_kept_also_at_large_steps(stages, scene, observe):
    method = symtop.integrator(f"gauss-{2 * stages}")
    assert_keeps_everything(method, scene, observe, 30.3)
    for phase in LARGE:
        assert_keeps_everything(method, scene, observe, 2.0 * math.pi / phase, steps=500)


@pytest.mark.parametrize("theta", [1e-9, 0.4, np.pi / 2, np.pi - 1e-9])
def test_frames_are_attitudes(theta):
    # half-turns about every axis are where three of the four rows of q q^T vanish
    phi, psi = (values.ravel() for values in np.meshgrid(np.linspace(-3, 3, 7), np.linspace(0, 6, 7)))
    quaternion = charts.quaternion_from_angles(theta, phi, psi)
    axis = charts.axis_from_quaternion(quaternion)
    first_axis = Rotation.from_quat(np.roll(quaternion, -1, axis=1)).as_matrix()[..., 0]
    frames = np.concatenate([axis, np.zeros_like(axis), first_axis], axis=1)
    attitudes = frame_to_attitude(SpaceTop(1.0, 1.0, 0.0), np.zeros(phi.size), frames)[:, :4]
    assert np.max(charts.attitude_distance(attitudes, quaternion)) < 2e-15


def test_the_frame_turns_with_the_body():
    """A free top: the frame is carried, and the twist about the axis is exact."""
    top, start = symtop.SymmetricTop(2.0, 1.0, 0.0), symtop.Angles(theta=0.7, psi_dot=3.0, phi_dot=0.4)
    par, state = on_frame(top, start)
    h, marks = 0.01, np.array([0, 500, 1000])
    attitude = frame_to_attitude(par, h * marks, march_frame(par, gauss_rule(6), state, h, marks).states)
    exact = symtop.ClosedForm(top, start).quaternion(h * marks)
    assert np.max(charts.attitude_distance(attitude[:, :4], exact)) < 1e-13


def newton_step(par, stages, y, h):
    """One step by Newton on all 6 s increments, from zero increments, and the size of the last correction."""
    mu, b = gauss_rule(stages)[:2]
    parts, change = np.zeros((stages, 6)), math.inf
    for _ in range(30):
        places = y + mu @ parts
        defect = np.array([h * b[i] * np.array(field_axis(par, places[i])) - parts[i] for i in range(stages)])
        system = np.eye(6 * stages)
        for i, y_i in enumerate(places):  # central differences are exact for a quadratic field but for rounding
            columns = [np.subtract(field_axis(par, y_i + e), field_axis(par, y_i - e)) / 2.0 for e in np.eye(6)]
            system[6 * i : 6 * i + 6] -= h * b[i] * np.kron(mu[i], np.transpose(columns))
        fix = np.linalg.solve(system, defect.ravel()).reshape(stages, 6)
        parts, change = parts + fix, np.abs(fix).max()
        if change < 1e-13:
            break
    return y + parts.sum(axis=0), change


def sweep_step(par, stages, y, h, sweeps=100):
    """One step by sweeps from h b_i f(y), and the size of the last correction."""
    mu, b = gauss_rule(stages)[:2]
    parts, change = np.outer(h * b, field_axis(par, y)), math.inf
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(sweeps):
            last = parts.copy()
            for i in range(stages):
                parts[i] = h * b[i] * np.array(field_axis(par, y + mu[i] @ parts))
            change = np.abs(parts - last).max()
    return y + parts.sum(axis=0), change


def started(scene, phase):
    """Numbers of the top, state and the step at so many h omega."""
    scene = symtop.scene(scene)
    par, state = on_axis(scene.top, scene.start)
    return par, np.array(state), phase * scene.nutation_period / (2.0 * math.pi)


@pytest.mark.parametrize("scene", ["goldstein", "cusp"])
@pytest.mark.parametrize("stages", STAGES)
def test_a_step_is_what_newton_finds_and_sweeps_do_not(stages, scene):
    par, y, h = started(scene, 0.3)
    after = march_axis(par, gauss_rule(stages), tuple(y), h, ONE).states[0]
    for solve in (newton_step, sweep_step):  # at a small step both, and they agree
        solution, change = solve(par, stages, y, h)
        assert change < 1e-13
        np.testing.assert_allclose(after, solution, rtol=0, atol=1e-13)
    for phase in (5.0, 8.0):
        par, y, h = started(scene, phase)
        result = march_axis(par, gauss_rule(stages), tuple(y), h, ONE)
        solution, change = newton_step(par, stages, y, h)
        assert result.outcome == 0
        assert change < 1e-13
        np.testing.assert_allclose(result.states[0], solution, rtol=0, atol=1e-12 * np.abs(solution).max())
    par, y, h = started(scene, 10.0)
    assert not sweep_step(par, stages, y, h)[1] < 1e3  # diverges


def test_a_sweep_ends_at_its_own_limit_and_a_step_beyond_newtons_reach_is_grown():
    """In `steady-fast` sweeps of one stage contract up to h omega = 1.9; the step there and beyond is one function."""
    par, state = on_axis(STEADY.top, STEADY.start)
    y = np.array(state) + 1e-3
    assert sweep_step(par, 1, y, 1.6 / OMEGA, 400)[1] < 1e-12
    assert not sweep_step(par, 1, y, 2.2 / OMEGA, 400)[1] < 1e-2
    for phase in np.linspace(1.2, 2.4, 49):
        result = march_axis(par, gauss_rule(1), tuple(y), phase / OMEGA, ONE)
        np.testing.assert_allclose(result.states[0], newton_step(par, 1, y, phase / OMEGA)[0], rtol=0, atol=1e-13)
    par, y, h = started("spheroid", 10.0)
    constants = lambda z: (z[:3] @ z[:3], z[:3] @ z[3:], z[5], z[3:] @ z[3:] + 2.0 * par.I1 * par.mgl * z[2])
    for stages in STAGES:
        result = march_axis(par, gauss_rule(stages), tuple(y), h, ONE)
        assert result.outcome == 0
        assert result.work > 20
        assert constants(result.states[0]) == pytest.approx(constants(y), rel=1e-13)


@pytest.mark.parametrize("stages", STAGES)
def test_the_table_keeps_small_nutations_stable_at_any_step_and_the_frame_orthonormal(stages):
    mu, b = gauss_rule(stages)[:2]
    assert np.all(mu + mu.T == 1.0)  # to the last bit: this is what conserves
    c = mu @ b
    for k in range(1, 2 * stages + 1):
        assert abs(np.sum(b * c ** (k - 1)) - 1.0 / k) < 4e-16
    assert abs(np.sum(b * c ** (2 * stages)) - 1.0 / (2 * stages + 1)) > 1e-8  # no quadrature does better
    if stages == 2:
        np.testing.assert_allclose(mu[1, 0], 0.5 + 1.0 / np.sqrt(3.0), rtol=2e-16)
    method = symtop.integrator(f"gauss-{2 * stages}")
    assert math.isnan(linear_limits(method, STEADY, np.linspace(0.02, 10.0, 200) / OMEGA)[0])
    for phase in LARGE:
        record = trace(method, STEADY, phase / OMEGA)
        assert abs(record.trace) < 2.0
        assert abs(record.theta - STEADY.start.theta) < 1e-12  # where the reduced energy is least, whatever the step
        gap = abs(record.trace - 2.0 * pade(stages, 1j * phase).real)
        fast_scene = steady(200.0)  # precesses 10 times slower, and a nutation turns 10 times faster
        omega = fast_scene.top.nutation_frequency(fast_scene.top.momenta(fast_scene.start))
        gap_faster = abs(trace(method, fast_scene, phase / omega).trace - 2.0 * pade(stages, 1j * phase).real)
        assert gap < 0.15
        assert gap_faster < max(0.02 * gap, 1e-6)  # theory holds as precession / nutation goes to nothing, squared
    # At large steps a' = L x a / I1 is solved too: the frame's axis is that of the run on (e, L).
    scene = symtop.scene("goldstein")
    par, state = on_frame(scene.top, scene.start)
    marks = np.arange(0, 201, 20)
    for phase in (2.0, 5.0, 10.0):
        h = phase * scene.nutation_period / (2.0 * math.pi)
        result = march_frame(par, gauss_rule(stages), state, h, marks)
        e, a = result.states[:, :3], result.states[:, 6:]
        assert result.outcome == 0
        assert np.abs(np.sum(e * a, axis=1)).max() < 1e-13
        assert np.abs(np.sum(a * a, axis=1) - 1.0).max() < 1e-13
        axis_run = march_axis(*on_axis(scene.top, scene.start)[:1], gauss_rule(stages), state[:6], h, marks[:2])
        np.testing.assert_allclose(result.states[1, :6], axis_run.states[1], rtol=0, atol=1e-9)
        quaternion = frame_to_attitude(par, h * marks, result.states)[:, :4]
        assert charts.axis_distance(charts.axis_from_quaternion(quaternion), e).max() < 1e-13
