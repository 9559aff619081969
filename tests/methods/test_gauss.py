"""Gauss methods: orders, the four constants at once, symmetry, stability at any step, and what they are not."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from symtop_studies.stability.linear_limits import linear_limits

import symtop
from symtop.measure.step_map import one_step as map_of, symplectic_defect
from symtop.methods.framework.loop import FixedStep
from symtop.methods.framework.registry import integrator
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
    solver = FixedStep(march_axis, gauss_rule(stages)._replace(mu=mu), on_axis, stages, implicit=True)
    return dataclasses.replace(integrator(f"gauss-{2 * stages}"), name="wrong", solvers={"axis": solver})


def one_step(stages, state, par, h):
    return march_axis(par, gauss_rule(stages), tuple(state), h, ONE).states[0]


# steps a nutation between which the error is asymptotic and above rounding
WINDOWS = {6: (25, 130), 10: (8, 26), 12: (5, 16)}  # `test_structure` has the orders up to 8


@pytest.mark.parametrize("scene", ["spheroid", "goldstein"])
@pytest.mark.parametrize("order", WINDOWS)
def test_order(scene, order):
    assert_order(scene, integrator(f"gauss-{order}"), order, 0.05 if order <= 6 else 0.3, WINDOWS[order])


def test_a_wrong_table_loses_the_order():
    with pytest.raises(AssertionError, match="order"):
        assert_order("spheroid", nudged(3, 1e-3, mirrored=True), 6, 0.05, WINDOWS[6])


@pytest.mark.parametrize("stages", STAGES)
def test_the_table(stages):
    mu, b = gauss_rule(stages)[:2]
    assert np.all(mu + mu.T == 1.0)  # to the last bit: this is what conserves
    c = mu @ b
    for k in range(1, 2 * stages + 1):
        assert abs(np.sum(b * c ** (k - 1)) - 1.0 / k) < 4e-16
    assert abs(np.sum(b * c ** (2 * stages)) - 1.0 / (2 * stages + 1)) > 1e-8  # no quadrature does better
    if stages == 2:
        np.testing.assert_allclose(mu[1, 0], 0.5 + 1.0 / np.sqrt(3.0), rtol=2e-16)


def test_one_stage_is_the_midpoint_rule():
    scene = symtop.scene("spheroid")
    par, state = on_axis(scene.top, scene.start)
    before = np.array(state)
    after = one_step(1, state, par, 0.02)
    slope = np.array(field_axis(par, tuple(0.5 * (before + after))))
    np.testing.assert_allclose(after, before + 0.02 * slope, rtol=0, atol=4e-15)


def assert_keeps_everything(method, scene, observe, nutation_steps, limit=1e-13, steps=100_000):
    """|e|, L.e, L_z and the energy together, over so many steps, relative."""
    h = symtop.scene(scene).nutation_period / nutation_steps
    run = symtop.simulate(scene, method, step_size=h, horizon=steps * h, samples=501, observe=observe, guard=False)
    assert run.attrs["outcome"] == "ok"
    for name in ("energy", "p_phi", "p_psi"):
        assert np.max(np.abs(run[name] / run[name][0] - 1.0)) < limit, name
    assert np.max(np.abs(np.linalg.norm(run["axis"], axis=1) - 1.0)) < limit, "length"


def test_a_table_that_is_not_antisymmetric_keeps_nothing():
    # 1e-12 is 4500 rounding units of one coefficient
    with pytest.raises(AssertionError, match=r"energy|p_psi"):
        assert_keeps_everything(nudged(3, 1e-12, mirrored=False), "spheroid", "axis", 30.3)
    # the order is lost but not the constants: they need only mu + mu^T = 1
    assert_keeps_everything(nudged(3, 1e-3, mirrored=True), "spheroid", "axis", 30.3)


def test_gauss_methods_are_not_poisson():
    """Why `symplectic` is false: the bracket is missed by the method's own local error, of order 2s + 1."""
    scene = symtop.scene("spheroid")

    def defect(order, h):
        return symplectic_defect(map_of(integrator(f"gauss-{order}"), "axis", scene, h), scene.start).size

    for order, h in ((2, 0.05), (4, 0.1)):
        coarse, fine = defect(order, h), defect(order, h / 2.0)
        assert abs(np.log2(coarse / fine) - (order + 1)) < 0.5, (order, coarse, fine)
    assert defect(12, 0.2) < 1e-9  # the exact map, as far as differences see


# ---- any step is stable ----------------------------------------------------------------------------------------------

LARGE = (2.0, 5.0, 10.0)  # h omega; sweeps converge up to about 1.6 with one stage
STEADY = symtop.scene("steady-fast")
OMEGA = STEADY.top.nutation_frequency(STEADY.top.momenta(STEADY.start))


def pade(stages, x):
    """The stability function of a Gauss method, the diagonal approximant of exp, of a number or a square matrix."""
    one = np.eye(len(x)) if np.ndim(x) else 1.0
    power, above, below = one, 0.0, 0.0
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
    frequencies = np.linalg.eigvals(slope).imag
    h, tilt = phase / np.abs(frequencies).max(), 1e-6
    measured = np.empty((2, 2), dtype=complex)
    for column, (z, momentum) in enumerate(((tilt, 0.0), (0.0, tilt))):
        after = one_step(stages, (z, 0.0, up, momentum, 0.0, spin), par, h)
        measured[:, column] = after[0] + 1j * after[1], after[3] + 1j * after[4]
    np.testing.assert_allclose(measured / tilt, pade(stages, h * slope), rtol=0, atol=1e-8)
    np.testing.assert_allclose(np.abs(np.linalg.eigvals(measured / tilt)), 1.0, rtol=0, atol=1e-8)
    assert abs(abs(pade(stages, 1.0 + 1j * phase)) - 1.0) > 1e-3  # off the imaginary axis it is not one


@pytest.mark.parametrize("stages", STAGES)
def test_small_nutations_are_stable_at_any_step(stages):
    method = integrator(f"gauss-{2 * stages}")
    assert math.isnan(linear_limits(method, STEADY, np.linspace(0.02, 10.0, 200) / OMEGA)[0])
    for phase in LARGE:
        at = trace(method, STEADY, phase / OMEGA)
        assert abs(at.trace) < 2.0
        assert abs(at.theta - STEADY.start.theta) < 1e-12  # where the reduced energy is least, whatever the step
        gap = abs(at.trace - 2.0 * pade(stages, 1j * phase).real)
        faster = steady(200.0)  # precesses 10 times slower, and a nutation turns 10 times faster
        omega = faster.top.nutation_frequency(faster.top.momenta(faster.start))
        gap_faster = abs(trace(method, faster, phase / omega).trace - 2.0 * pade(stages, 1j * phase).real)
        assert gap < 0.15
        assert gap_faster < max(0.02 * gap, 1e-6)  # theory holds as precession / nutation goes to nothing, squared


def test_verlet_and_rk4_are_not():
    for name, phase in (("stormer-verlet", 2.0), ("rk4", 5.0)):
        assert not trace(integrator(name), STEADY, 1.001 * phase / OMEGA).growth <= 1.0 + 1e-4


@pytest.mark.parametrize(
    ("stages", "scene", "observe"),
    [*((stages, "spheroid", "axis") for stages in STAGES), (3, "goldstein", "axis"), (3, "goldstein", "attitude")],
)
def test_everything_is_kept(stages, scene, observe):
    assert_keeps_everything(integrator(f"gauss-{2 * stages}"), scene, observe, 30.3)


@pytest.mark.parametrize(
    ("scene", "observe"), [("spheroid", "axis"), ("goldstein", "axis"), ("cusp", "axis"), ("cusp", "attitude")]
)
@pytest.mark.parametrize("stages", STAGES)
def test_everything_is_kept_at_large_steps(stages, scene, observe):
    for phase in LARGE:
        method = integrator(f"gauss-{2 * stages}")
        assert_keeps_everything(method, scene, observe, 2.0 * math.pi / phase, steps=500)


@pytest.mark.parametrize("theta", [1e-9, 0.4, np.pi / 2, np.pi - 1e-9])
def test_frames_are_attitudes(theta):
    # half-turns about every axis are where three of the four rows of q q^T vanish
    phi, psi = (values.ravel() for values in np.meshgrid(np.linspace(-3, 3, 7), np.linspace(0, 6, 7)))
    quaternion = charts.quaternion_from_angles(theta, phi, psi)
    axis = charts.axis_from_quaternion(quaternion)
    across = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()[..., 0]
    frames = np.concatenate([axis, np.zeros_like(axis), across], axis=1)
    again = frame_to_attitude(SpaceTop(1.0, 1.0, 0.0), np.zeros(phi.size), frames)[:, :4]
    assert np.max(charts.attitude_distance(again, quaternion)) < 2e-15


def test_the_frame_turns_with_the_body():
    """A free top: the frame is carried, and the twist about the axis is exact."""
    top, start = symtop.SymmetricTop(2.0, 1.0, 0.0), symtop.Angles(theta=0.7, psi_dot=3.0, phi_dot=0.4)
    par, state = on_frame(top, start)
    h, marks = 0.01, np.array([0, 500, 1000])
    states = march_frame(par, gauss_rule(6), state, h, marks).states
    attitude = frame_to_attitude(par, h * marks, states)
    exact = symtop.ClosedForm(top, start).quaternion(h * marks)
    assert np.max(charts.attitude_distance(attitude[:, :4], exact)) < 1e-13
