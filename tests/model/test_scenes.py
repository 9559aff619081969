"""The scenes, whose failure is built in, and starts and tops from what other programs hold."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import symtop
from symtop.methods.framework.registry import bibliography
from symtop.model import charts
from symtop.model.scenes import closed_form, energy_scales, grazing, sleeping, steady
from symtop.model.top import flat
from tests.conftest import random_scenes


def test_what_users_write_is_escaped_and_whole():
    purpose = "a < b & <script>, and a sentence that is longer than the fifty characters a table has by default"
    html = symtop.Scene("mine", symtop.SymmetricTop(1.0, 1.0, 1.0), symtop.Angles(1.0), 1.0, purpose)._repr_html_()
    words = "a &lt; b &amp; &lt;script&gt;, and a sentence that is longer than the fifty characters"
    assert (words in html, "<script>" in html) == (True, False)


@pytest.mark.parametrize("scene", symtop.scenes().values(), ids=symtop.scenes())
def test_tags_say_what_the_motion_does(scene):
    low, high = closed_form(scene).theta_range
    assert set(scene.reference.split()) <= set(bibliography())
    assert ("steady" in scene.tags) == (high - low < 1e-6)
    assert ("near_pole" in scene.tags) == (low < 2e-3 or high > math.pi - 2e-3)


def test_the_gyroscope_of_kinon_and_betsch_is_a_cone_of_aluminium():
    height, radius, gravity = 0.1, 0.05, 9.81
    mass = 2700.0 * math.pi * radius**2 * height / 3.0
    across, along = 3.0 / 80.0 * mass * (4.0 * radius**2 + height**2), 0.3 * mass * radius**2
    cone = symtop.SymmetricTop.from_inertia(mass, across, along, 0.75 * height, gravity)
    top = symtop.scene("kinon-betsch").top
    assert (top.I1, top.I3, top.mgl) == pytest.approx((cone.I1, cone.I3, cone.mgl), rel=2e-12, abs=0.0)


def test_the_scale_of_the_energy_of_many_tops_is_that_of_each():
    scenes = symtop.scenes().values()
    numbers = np.array([flat(scene.top, scene.start) for scene in scenes])
    scales = energy_scales(numbers, np.array([closed_form(scene).theta_range for scene in scenes]))
    np.testing.assert_allclose(scales, [scene.energy_scale for scene in scenes], rtol=1e-12)


@pytest.mark.parametrize("delta", [1e-1, 1e-3, -1e-3, 1e-6])
def test_grazing_misses_the_pole_by_eleven_tenths_of_its_gap(delta):
    scene = grazing(delta)
    momenta = scene.top.momenta(scene.start)
    assert momenta.north == pytest.approx(delta, rel=1e-9)
    assert momenta.p_psi == pytest.approx(1.0, rel=1e-15)
    assert closed_form(scene).theta_range[0] == pytest.approx(1.105 * abs(delta), rel=0.05)
    assert scene.nutation_period == pytest.approx(scene.horizon, rel=0.03)


def test_a_top_sleeps_above_the_threshold_precesses_steadily_above_a_spin_and_never_comes_back_on_the_separatrix():
    assert closed_form(sleeping(2.05)).theta_range[1] < 0.01
    scene = sleeping(1.9, 1e-5)
    assert closed_form(scene).theta_range[1] == pytest.approx(math.acos(0.5 * 1.9**2 - 1.0), rel=1e-6)
    theta = closed_form(scene)(np.array([20.0, 22.0])).theta
    assert math.log(theta[1] / theta[0]) / 2.0 == pytest.approx(0.5 * math.sqrt(4.0 - 1.9**2), rel=1e-3)
    for spin in (2.8285, 20.0, 100.0):
        low, high = closed_form(steady(spin)).theta_range
        assert high - low < 1e-7
    with pytest.raises(symtop.SymtopError, match="spin must be at least"):
        steady(2.8284)
    scene, times = symtop.scene("separatrix"), np.array([1.0, 5.0, 15.0])
    cosine = np.cos(closed_form(scene)(times).theta)
    assert cosine == pytest.approx(1.0 / (1.0 + 1.0 / np.cosh(times)), abs=1e-12)  # g = 1


@pytest.mark.parametrize("name", ["spheroid", "goldstein", "fast", "simo-wong", "bruls-cardona-arnold", "separatrix"])
def test_energies_are_measured_by_the_nutation_and_not_by_the_spin(name):
    """Over the true motion the kinetic energy of theta goes from 0 to the energy of the nutation, where V is least."""
    scene = symtop.scene(name)
    motion = closed_form(scene)(np.linspace(0.0, min(scene.nutation_period, scene.horizon), 20_001))
    assert np.max(0.5 * scene.top.I1 * motion.theta_dot**2) == pytest.approx(scene.energy_scale, rel=1e-5)


def test_on_a_fast_top_the_energy_of_the_spin_hides_the_nutation():
    scene = symtop.scene("fast")
    kinetic = scene.top.energy(scene.start) + scene.top.mgl
    assert scene.energy_scale == pytest.approx(9.2e-5, rel=0.01)
    assert kinetic / scene.energy_scale > 5e7
    assert scene.energy_grain == pytest.approx(kinetic / scene.energy_scale, rel=1e-3)


@pytest.mark.parametrize("spin", [4.0, 20.0])
def test_a_steady_precession_measures_energies_by_a_nutation_of_one_radian(spin):
    scene = steady(spin)
    top, amplitude = scene.top, 1e-3
    momenta = top.momenta(scene.start)
    gain = top.potential(scene.start.theta + amplitude, momenta) - top.potential(scene.start.theta, momenta)
    assert gain / scene.energy_scale == pytest.approx(amplitude**2, rel=0.01)


@pytest.mark.parametrize("start", [{"theta": 0.0, "psi_dot": 3.0}, {"theta": 0.0, "psi_dot": 1.0}, {"theta": 1.0},
                                   {"theta": math.pi, "psi_dot": 1.0}, {"theta": 0.5, "psi_dot": 3e14}])  # fmt: skip
@pytest.mark.parametrize(("I3", "mgl"), [(1.0, 1.0), (1.0, 0.0), (1.0, -1.0), (1e-13, 1.0)])
def test_every_start_has_an_energy_scale(start, I3, mgl):
    scene = symtop.Scene("any", symtop.SymmetricTop(1.0, I3, mgl), symtop.Angles(**start), 1.0)
    assert 0.0 < scene.energy_scale < math.inf
    assert 1.0 <= scene.energy_grain < math.inf


def body_rates(start):
    """The angular velocity in the body frame, by Goldstein's formulas."""
    c, s = math.cos(start.psi), math.sin(start.psi)
    swing = start.phi_dot * math.sin(start.theta)
    return np.array([start.theta_dot * c + swing * s, swing * c - start.theta_dot * s, start.spin])


def matrix(q):
    """The rotation from body to space."""
    return Rotation.from_quat(np.roll(q, -1)).as_matrix()


@pytest.mark.parametrize("scene", random_scenes(20, seed=5))
def test_a_start_goes_to_a_quaternion_and_back(scene):
    start, top = scene.start, scene.top
    q, body = charts.quaternion_from_angles(start.theta, start.phi, start.psi), body_rates(start)
    for kind, omega in (("omega_body", body), ("omega_space", matrix(q) @ body)):
        back = symtop.Angles.from_quaternion(q, **{kind: omega})
        for name in ("theta", "theta_dot", "phi_dot", "psi_dot"):
            assert getattr(back, name) == pytest.approx(getattr(start, name), abs=1e-12)
        for name in ("phi", "psi"):
            assert math.remainder(getattr(back, name) - getattr(start, name), math.tau) == pytest.approx(0, abs=1e-12)
    control = symtop.Angles.from_quaternion(q, omega_body=matrix(q) @ body)  # the frame matters
    assert abs(control.theta_dot - start.theta_dot) + abs(control.phi_dot - start.phi_dot) > 1e-6
    state = charts.space_state("axis", top, start)
    twin = symtop.Angles.from_axis(top, state[:3], state[3:])
    assert top.energy(twin) == pytest.approx(top.energy(start), rel=1e-13)
    np.testing.assert_allclose(charts.space_state("axis", top, twin), state, atol=1e-12)


@pytest.mark.parametrize(("quaternion", "theta"), [
    ((1.0, 0.0, 0.0, 0.0), 0.0), ((0.0, 1.0, 0.0, 0.0), math.pi), ((0.6, 0.0, 0.0, 0.8), 0.0)])  # fmt: skip
def test_a_start_on_a_pole_keeps_its_motion(quaternion, theta):
    """The rates hold the whole angular velocity, and the attitude is the one that was given."""
    omega = np.array([0.3, -0.4, 5.0])
    start = symtop.Angles.from_quaternion(quaternion, omega_body=omega)
    assert start.theta == theta
    q = charts.quaternion_from_angles(start.theta, start.phi, start.psi)
    assert float(charts.attitude_distance(q, np.array(quaternion))) < 1e-15
    np.testing.assert_allclose(body_rates(start), omega, atol=1e-14)
    top, L = symtop.SymmetricTop(2.0, 1.0, 1.0), matrix(quaternion) @ (omega * [2.0, 2.0, 1.0])
    state = charts.space_state("axis", top, symtop.Angles.from_axis(top, matrix(quaternion)[:, 2], L))
    np.testing.assert_allclose(state[3:], L, atol=1e-14)


@pytest.mark.parametrize("pole", [0.0, math.pi])
def test_a_start_next_to_a_pole_keeps_its_motion(pole):
    """A quaternion that was computed is off the pole by a rounding, and phi' would round the spin away.

    The control: where nothing turns the axis the tilt stays, and that of a millionth in any case.
    """
    omega, top = np.array([0.1, 0.7, 50.3]), symtop.SymmetricTop(1.0, 0.8, 1.0)
    for tilt in (1e-17, 1.2e-16, 1e-15, 1e-12, 1e-10, 1e-9, 1e-8, 1e-6):
        x = 0.5 * tilt
        q = (math.cos(x), math.sin(x), 0.0, 0.0) if pole == 0.0 else (math.sin(x), math.cos(x), 0.0, 0.0)
        y0 = symtop.Angles.from_quaternion(q, omega_body=omega)
        assert charts.attitude_distance(charts.quaternion_from_angles(y0.theta, y0.phi, y0.psi), np.array(q)) < 3e-9
        np.testing.assert_allclose(body_rates(y0), omega, atol=3e-7)
        assert abs(y0.spin - omega[2]) < 3e-7
        e, L = matrix(q)[:, 2], matrix(q) @ (omega * [1.0, 1.0, 0.8])
        twin = symtop.Angles.from_axis(top, e, L)
        np.testing.assert_allclose(charts.space_state("axis", top, twin)[3:], L, atol=1e-6)
        for rates in ([0.0, 0.0, 50.3], None):
            still = symtop.Angles.from_quaternion(q, omega_body=rates)
            assert still.theta == pytest.approx(abs(pole - tilt), rel=1e-15)
    assert y0.theta == pytest.approx(abs(pole - 1e-6), abs=1e-15)


def test_a_body_from_its_moments_about_the_centre_is_the_spheroid():
    mass, polar, equatorial, arm = 1.3, 0.2, 0.1, 0.25
    spheroid = symtop.SymmetricTop.from_spheroid(mass, polar, equatorial, pivot_distance=arm)
    across, along = mass * (polar**2 + equatorial**2) / 5.0, 0.4 * mass * equatorial**2
    top = symtop.SymmetricTop.from_inertia(mass, across, along, arm)
    assert (top.I1, top.I3, top.mgl) == pytest.approx((spheroid.I1, spheroid.I3, spheroid.mgl), rel=1e-15)
    assert symtop.SymmetricTop.from_inertia(mass, across, along, -arm).mgl == -top.mgl
    on_the_moon = symtop.SymmetricTop.from_inertia(mass, across, along, arm, gravity=1.62)
    assert on_the_moon.mgl == pytest.approx(mass * 1.62 * arm)
    assert symtop.SymmetricTop.from_inertia(1.32, 1.32 * 3 * 0.85**2 / 12, 1.32 * 0.85**2 / 2, 0.0).mgl == 0.0  # a disc


@pytest.mark.parametrize(("call", "words"), [
    (lambda: symtop.Angles.from_quaternion([1, 0, 0, 0], omega_body=[1, 1, 1], omega_space=[1, 1, 1]),
     "give omega_body or omega_space, not both"),
    (lambda: symtop.Angles.from_axis(symtop.SymmetricTop(1, 1, 1), [0, 0, 2], [0, 0, 1]), "axis must have unit"),
    (lambda: symtop.SymmetricTop.from_inertia(1, 1, 3, 1), "axial must be at most 2 at_centre"),
    (lambda: symtop.scene("tennis-racket"), r"not tennis-racket, a RigidBody: symtop.scene\(name, bodies=True\) ret"),
    (lambda: symtop.field("axis", "spheroid").state([0.4]), "a start must be an instance of symtop.Angles, not .0.4"),
    (lambda: symtop.RigidBody.from_inertia(5.0), "matrix must be rows of 3 numbers, not 5.0"),
    (lambda: symtop.RigidBody.from_points(2.0, [[0, 0, 1]]), "masses must be a row of numbers, not 2.0"),
    (lambda: symtop.RigidBody.from_points([2.0], 1.0), "places must be rows of 3 numbers, not 1.0"),
    (lambda: symtop.RigidBody.from_inertia(np.eye(3), mass=2.0), "needs mgl, which is mass times gravity times"),
    (lambda: symtop.SymmetricTop.from_inertia(1, 1, 1, 1, gravity=-9.81), "gravity must be at least 0"),
    (lambda: symtop.simulate(symtop.SymmetricTop(1, 1, 1), "rk4"), r"a SymmetricTop: symtop.Scene\(name, top, start,"),
    (lambda: symtop.simulate("spheroid", "rk4", step_size=0.1, observe="theta"), "nutation, which shows theta"),
    *((lambda tags=tags: symtop.Scene("mine", symtop.SymmetricTop(1, 1, 1), symtop.Angles(1), 1.0, tags=tags), words)
      for tags, words in (("steady" * 99, "tags must be a list of names, .{304} [.]{3}$"), (np.array(5), "not array"),
                          (["staedy"], "tags 'staedy' is unknown"), ([["steady"]], r"tags \['steady'\] is unknown"))),
])  # fmt: skip
def test_bad_input_is_one_sentence(call, words):
    with pytest.raises(symtop.SymtopError, match=words):
        call()
