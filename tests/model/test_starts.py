"""Starts and tops from what other programs hold: there and back, at the poles too, and bad input in one sentence."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import symtop
from symtop.model import charts
from tests.conftest import random_scenes

POLES = [((1.0, 0.0, 0.0, 0.0), 0.0), ((0.0, 1.0, 0.0, 0.0), math.pi), ((0.6, 0.0, 0.0, 0.8), 0.0)]


def body_rates(at):
    """The angular velocity in the body frame, by Goldstein's formulas."""
    c, s = math.cos(at.psi), math.sin(at.psi)
    swing = at.phi_dot * math.sin(at.theta)
    return np.array([at.theta_dot * c + swing * s, swing * c - at.theta_dot * s, at.spin])


def matrix(q):
    """The rotation from body to space."""
    return Rotation.from_quat(q, scalar_first=True).as_matrix()


@pytest.mark.parametrize("scene", random_scenes(20, seed=5))
def test_a_start_goes_to_a_quaternion_and_back(scene):
    at, top = scene.start, scene.top
    q, body = charts.quaternion_from_angles(at.theta, at.phi, at.psi), body_rates(at)
    for kind, omega in (("omega_body", body), ("omega_space", matrix(q) @ body)):
        back = symtop.Angles.from_quaternion(q, **{kind: omega})
        for name in ("theta", "theta_dot", "phi_dot", "psi_dot"):
            assert getattr(back, name) == pytest.approx(getattr(at, name), abs=1e-12)
        for name in ("phi", "psi"):
            assert math.remainder(getattr(back, name) - getattr(at, name), 2.0 * math.pi) == pytest.approx(0, abs=1e-12)
    wrong = symtop.Angles.from_quaternion(q, omega_body=matrix(q) @ body)  # the frame matters
    assert abs(wrong.theta_dot - at.theta_dot) + abs(wrong.phi_dot - at.phi_dot) > 1e-6
    state = charts.space_state("axis", top, at)
    same = symtop.Angles.from_axis(top, state[:3], state[3:])
    assert top.energy(same) == pytest.approx(top.energy(at), rel=1e-13)
    np.testing.assert_allclose(charts.space_state("axis", top, same), state, atol=1e-12)


@pytest.mark.parametrize(("quaternion", "theta"), POLES)
def test_a_start_on_a_pole_keeps_its_motion(quaternion, theta):
    """The rates hold the whole angular velocity, and the attitude is the one that was given."""
    omega = np.array([0.3, -0.4, 5.0])
    at = symtop.Angles.from_quaternion(quaternion, omega_body=omega)
    assert at.theta == theta
    q = charts.quaternion_from_angles(at.theta, at.phi, at.psi)
    assert float(charts.attitude_distance(q, np.array(quaternion))) < 1e-15
    np.testing.assert_allclose(body_rates(at), omega, atol=1e-14)
    top = symtop.SymmetricTop(2.0, 1.0, 1.0)
    L = matrix(quaternion) @ (omega * [2.0, 2.0, 1.0])
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
        at = symtop.Angles.from_quaternion(q, omega_body=omega)
        made = charts.quaternion_from_angles(at.theta, at.phi, at.psi)
        assert float(charts.attitude_distance(made, np.array(q))) < 3e-9
        np.testing.assert_allclose(body_rates(at), omega, atol=3e-7)
        assert abs(at.spin - omega[2]) < 3e-7
        e, L = matrix(q)[:, 2], matrix(q) @ (omega * [1.0, 1.0, 0.8])
        np.testing.assert_allclose(
            charts.space_state("axis", top, symtop.Angles.from_axis(top, e, L))[3:], L, atol=1e-6
        )
        for rates in ([0.0, 0.0, 50.3], None):
            still = symtop.Angles.from_quaternion(q, omega_body=rates)
            assert still.theta == pytest.approx(abs(pole - tilt), rel=1e-15)
    assert at.theta == pytest.approx(abs(pole - 1e-6), abs=1e-15)


def test_a_body_from_its_moments_about_the_centre_is_the_spheroid():
    mass, polar, equatorial, arm = 1.3, 0.2, 0.1, 0.25
    spheroid = symtop.SymmetricTop.from_spheroid(mass, polar, equatorial, pivot_distance=arm)
    across, along = mass * (polar**2 + equatorial**2) / 5.0, 0.4 * mass * equatorial**2
    made = symtop.SymmetricTop.from_inertia(mass, across, along, arm)
    assert (made.I1, made.I3, made.mgl) == pytest.approx((spheroid.I1, spheroid.I3, spheroid.mgl), rel=1e-15)
    assert symtop.SymmetricTop.from_inertia(mass, across, along, -arm).mgl == -made.mgl
    assert symtop.SymmetricTop.from_inertia(mass, across, along, arm, gravity=1.62).mgl == pytest.approx(
        mass * 1.62 * arm
    )


@pytest.mark.parametrize(("call", "words"), [
    (
        lambda: symtop.Angles.from_quaternion([1, 0, 0, 0], omega_body=[1, 1, 1], omega_space=[1, 1, 1]),
        "give omega_body or omega_space, not both",
    ),
    (lambda: symtop.Angles.from_axis(symtop.SymmetricTop(1, 1, 1), [0, 0, 2], [0, 0, 1]), "axis must have unit"),
    (lambda: symtop.SymmetricTop.from_inertia(1, 1, 3, 1), "axial must be at most 2 at_centre"),
    (lambda: symtop.RigidBody.from_inertia(5.0), "matrix must be rows of 3 numbers, not 5.0"),
    (lambda: symtop.RigidBody.from_points(2.0, [[0, 0, 1]]), "masses must be a row of numbers, not 2.0"),
    (lambda: symtop.RigidBody.from_points([2.0], 1.0), "places must be rows of 3 numbers, not 1.0"),
    (lambda: symtop.RigidBody.from_inertia(np.eye(3), mass=2.0), "needs mgl, which is mass times gravity times"),
    (lambda: symtop.SymmetricTop.from_inertia(1, 1, 1, 1, gravity=-9.81), "gravity must be at least 0"),
])  # fmt: skip
def test_bad_input_is_one_sentence(call, words):
    with pytest.raises(symtop.SymtopError, match=words):
        call()
