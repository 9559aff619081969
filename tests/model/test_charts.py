"""The three charts: maps both ways, poles, honest small distances, and readers of states that show one thing."""

import math

import numpy as np
import pytest

import symtop
from symtop import Angles, SymmetricTop
from symtop.methods.framework.calling import solve
from symtop.model import charts
from symtop.model.charts import CHARTS, DIMENSIONS, View, axis_of, space_momenta
from symtop.model.scenes import closed_form, scene
from tests.conftest import random_scenes
from tests.judging.blind.right import product


def turns(back, start):
    """Differences of phi and of psi but for whole turns."""
    return [math.remainder(getattr(back, name) - getattr(start, name), 2.0 * math.pi) for name in ("phi", "psi")]


@pytest.mark.parametrize("scene", random_scenes(40, seed=7), ids=lambda s: s.name)
def test_attitude_and_back(scene):
    back = charts.angles_from_attitude(scene.top, charts.space_state("attitude", scene.top, scene.start))
    assert back.theta == pytest.approx(scene.start.theta, abs=4e-16)
    assert turns(back, scene.start) == pytest.approx([0.0, 0.0], abs=1e-15)
    for rate in ("theta_dot", "phi_dot", "psi_dot"):
        assert getattr(back, rate) == pytest.approx(getattr(scene.start, rate), rel=1e-13, abs=1e-13)


@pytest.mark.parametrize("scene", random_scenes(40, seed=8), ids=lambda s: s.name)
def test_space_frame_constants_are_those_of_the_angles(scene):
    state = charts.space_state("axis", scene.top, scene.start)
    axis, momentum, momenta = state[:3], state[3:], scene.top.momenta(scene.start)
    assert momentum[2] == pytest.approx(momenta.p_phi, rel=1e-14, abs=1e-14)
    assert axis @ momentum == pytest.approx(momenta.p_psi, rel=1e-14, abs=1e-14)
    node = np.array([math.cos(scene.start.phi), math.sin(scene.start.phi), 0.0])
    assert momentum @ node == pytest.approx(scene.top.I1 * scene.start.theta_dot, abs=1e-14)
    energy = momentum @ momentum / (2 * scene.top.I1) + scene.top.mgl * axis[2]
    energy += 0.5 * momenta.p_psi**2 * (1 / scene.top.I3 - 1 / scene.top.I1)
    assert energy == pytest.approx(scene.top.energy(scene.start), rel=1e-14, abs=1e-14)


@pytest.mark.parametrize("theta", [1e-3, 1e-6, 1e-9, math.pi - 1e-3, math.pi - 1e-6])
def test_close_to_a_pole_the_attitude_keeps_theta_and_the_sum_or_difference(theta):
    top = SymmetricTop(2.0, 1.0, 3.0)
    start = Angles(theta=theta, phi=0.7, psi=-1.9, theta_dot=0.2, phi_dot=1.5, psi_dot=4.0)
    back = charts.angles_from_attitude(top, charts.space_state("attitude", top, start))
    assert back.theta == pytest.approx(theta, rel=1e-15)
    assert turns(back, start) == pytest.approx([0.0, 0.0], abs=1e-15)
    assert back.theta_dot == pytest.approx(0.2, rel=1e-13)
    assert back.phi_dot == pytest.approx(1.5, rel=1e-14 / math.sin(theta))  # L through a lever


@pytest.mark.parametrize("size", [1e-15, 1e-12, 1e-8, 1e-3, 1.0, 3.0])
def test_distances_measure_small_and_large_angles(size):
    distance = charts.axis_distance(charts.axis_from_angles(1.0, 0.3), charts.axis_from_angles(1.0 + size, 0.3))
    assert distance == pytest.approx(min(size, 2 * math.pi - size), rel=1e-12, abs=3e-16)
    base = charts.quaternion_from_angles(1.0, 0.3, 0.2)
    turned = charts.quaternion_from_angles(1.0, 0.3, 0.2 + size)
    assert charts.attitude_distance(base, turned) == pytest.approx(size, rel=1e-12, abs=5e-16)
    assert charts.attitude_distance(base, -turned) == pytest.approx(size, rel=1e-12, abs=5e-16)


def test_a_quaternion_is_the_product_of_its_three_rotations_and_its_length_is_no_part_of_an_angle():
    """z-x-z: turn by psi about z, by theta about x, by phi about z."""

    def about(axis, angle):
        q = np.zeros(4)
        q[0], q[1 + "xyz".index(axis)] = math.cos(angle / 2), math.sin(angle / 2)
        return q

    turned = product(product(about("z", 0.7), about("x", 1.1)), about("z", -2.3))
    assert charts.quaternion_from_angles(1.1, 0.7, -2.3) == pytest.approx(turned, abs=4e-16)
    base, turned = (charts.quaternion_from_angles(1.0, 0.3, psi) for psi in (0.2, 0.2 + 1e-6))
    for length in (1.0 - 1e-6, 1.0, 1.0 + 1e-6, 2.0):  # a difference of 1e-6 in length would look like 2e-6 rad
        assert charts.attitude_distance(length * turned, base) == pytest.approx(1e-6, rel=1e-9)
    low = np.array([3e-17, -1e-17, 2e-17, 1e-17])  # of the reference: a gap below the spacing of doubles is seen
    across = low - (low @ base) * base
    assert charts.attitude_distance(base, base, low) == pytest.approx(2.0 * math.sqrt(across @ across), rel=1e-9)


def test_an_unwrapped_angle_follows_an_error_of_many_turns_and_has_the_bits_of_numpy():
    """The guide supplies the turns between samples, and nothing of the error: it may lag by more than half a turn."""
    t = np.linspace(0.0, 40.0, 60)
    guide, angle = 0.3 + 11.0 * t, 0.3 + 10.2 * t  # lags by 32 rad in the end
    wrapped = np.remainder(angle + np.pi, 2 * np.pi) - np.pi
    assert charts.unwrapped(wrapped, guide) == pytest.approx(angle, abs=1e-12)
    assert np.abs(wrapped + 2 * np.pi * np.rint((guide - wrapped) / (2 * np.pi)) - angle).max() > 6.0  # the control
    # At angles that jump often, rarely, never, by about half a turn, and where a run has failed; compiled as well.
    draw = np.random.default_rng(2)
    charts._unwrapper.compile()
    for k in range(300):
        guide = np.cumsum(draw.normal(size=200) * 10.0 ** draw.uniform(-2, 1))
        angle = np.remainder(guide + np.cumsum(draw.normal(size=200) * 0.05), 2.0 * np.pi) - np.pi
        if k % 4 == 1:
            angle[draw.integers(0, 200, 9)] = np.nan
        if k % 4 == 2:
            angle, guide = np.pi * draw.integers(-3, 4, 200), np.zeros(200)
        if k % 4 == 3:
            turn = draw.choice([np.pi, -np.pi, np.nextafter(np.pi, 4.0), 7.0 * np.pi, 1e6])
            angle, guide = np.cumsum(np.tile([0.0, turn, 0.1, -turn], 50)), np.zeros(200)
        lag = np.unwrap(angle - guide)
        expected = guide + (lag - 2.0 * np.pi * np.rint(lag[0] / (2.0 * np.pi)))
        np.testing.assert_array_equal(charts.unwrapped(angle, guide), expected)
        np.testing.assert_array_equal(charts.continuous(angle[None], guide[None]), expected[None])


TOP, START = symtop.scene("spheroid").top, symtop.scene("spheroid").start


def shown(chart, steps=800, h=0.005):
    method = symtop.integrator("stormer-verlet-blanes-moan-6" if chart == "angles" else "srkn-14-6")
    run = solve(method, chart, TOP, START, symtop.Plan.steps(h, np.arange(0, steps + 1, 40)))
    return View(chart, TOP, run.states, run.p_phi, run.p_psi)


@pytest.mark.parametrize("chart", CHARTS)
def test_every_quantity_is_that_of_the_true_motion(chart):
    view, truth = shown(chart), symtop.reference("spheroid", 0.2 * np.arange(21), "closed-form")
    assert view.states.shape == (21, DIMENSIONS[chart])
    assert view.axis == pytest.approx(truth["axis"].values, abs=1e-7)
    assert view.theta == pytest.approx(truth["theta"].values, abs=1e-7)
    assert view.energy == pytest.approx(truth["energy"].values, rel=1e-8)
    assert np.cos(view.phi - truth["phi"].values) == pytest.approx(1.0, abs=1e-12)
    if chart == "axis":
        assert view.psi is None
        assert view.quaternion is None
    else:
        assert np.cos(view.psi - truth["psi"].values) == pytest.approx(1.0, abs=1e-12)
        assert np.abs(np.sum(view.quaternion * truth["quaternion"].values, axis=1)) == pytest.approx(1.0, abs=1e-12)


def test_the_charts_agree_on_momentum_and_energy_in_the_precision_of_the_states():
    momenta = TOP.momenta(START)
    angles, *space = (shown(chart) for chart in CHARTS)
    for view in space:
        assert view.p_theta == pytest.approx(angles.p_theta, abs=1e-6)
        constant = view.nutation_energy(momenta) - angles.nutation_energy(momenta)  # p_psi^2/2 I1 is in one alone
        assert np.ptp(constant) < 1e-7
    states = shown("attitude").states.astype(np.longdouble)
    p_phi, p_psi = space_momenta("attitude", states)
    assert p_phi.dtype == p_psi.dtype == axis_of("attitude", states).dtype == np.longdouble
    assert float(p_psi[0]) == pytest.approx(TOP.momenta(START).p_psi, rel=1e-15)


@pytest.mark.parametrize("chart", ["axis", "attitude"])
@pytest.mark.parametrize("count", [401, 250], ids=["whole", "broken off"])
def test_axis_energy_and_momentum_have_the_bits_of_a_view(chart, count):
    form = closed_form(scene("spheroid"))
    states = form.state(np.linspace(0.0, 40.0, 401))
    states[count:] = np.nan
    if chart == "axis":
        states = np.concatenate([charts.axis_from_quaternion(states[:, :4]), states[:, 4:]], axis=1)
    view = View(chart, scene("spheroid").top, states, np.full(401, form.p_phi), np.full(401, form.p_psi))
    charts._reader.compile()
    readings = [*charts.readings(view), charts.axes(chart, states)]
    for ours, theirs in zip(readings, (view.axis, view.energy, view.p_theta, view.axis), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    moved = View(chart, view.top, states * (1.0 + 2e-16), view.p_phi, view.p_psi)
    assert not np.array_equal(charts.readings(moved)[1], view.energy, equal_nan=True)
