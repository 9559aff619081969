"""The model: derivatives, poles, periods, and roots by Newton's method within a bracket."""

import math

import mpmath
import pytest
from scipy.optimize import brentq

from symtop import Angles, SymmetricTop, scene
from symtop.model.top import effective_force, newton_between
from tests.conftest import random_scenes


@pytest.mark.parametrize("case", random_scenes(8, seed=1), ids=lambda s: s.name)
def test_slope_and_curvature_are_the_derivatives_of_the_potential(case):
    top, start, momenta = case.top, case.start, case.top.momenta(case.start)
    energy = top.reduced_energy(start.theta, top.I1 * start.theta_dot, momenta.p_phi, momenta.p_psi)
    assert energy == pytest.approx(top.energy(start), rel=1e-13, abs=1e-13)
    with mpmath.workdps(40):
        n, s, I1, mgl = (mpmath.mpf(v) for v in (momenta.north, momenta.south, top.I1, top.mgl))

        def potential(theta):
            p_phi, p_psi = (n + s) / 2, (s - n) / 2
            square = (p_phi - p_psi * mpmath.cos(theta)) ** 2
            return square / (2 * I1 * mpmath.sin(theta) ** 2) + mgl * mpmath.cos(theta)

        for theta in (0.5, 1.2, 2.4):
            values = [mpmath.diff(potential, mpmath.mpf(theta), k) for k in range(3)]
            assert top.potential(theta, momenta) == pytest.approx(float(values[0]), rel=1e-13, abs=1e-13)
            assert top.potential_slope(theta, momenta) == pytest.approx(float(values[1]), rel=1e-12, abs=1e-12)
            assert top.potential_curvature(theta, momenta) == pytest.approx(float(values[2]), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("distance", [1e-4, 1e-7])
@pytest.mark.parametrize("pole", [0.0, math.pi])
def test_the_potential_keeps_its_digits_at_a_pole_where_the_textbook_form_does_not(distance, pole):
    """The naive numerator has relative error 1e-8 at theta = 1e-4 (PHYSICS 1); ours stays at rounding."""
    theta = distance if pole == 0.0 else pole - distance
    top, start = SymmetricTop(1.3, 0.7, 2.0), Angles(theta=theta, phi_dot=0.4, psi_dot=3.0)
    momenta = top.momenta(start)
    with mpmath.workdps(50):
        t = mpmath.mpf(theta)
        p_psi = top.I3 * (mpmath.mpf(start.psi_dot) + mpmath.mpf(start.phi_dot) * mpmath.cos(t))
        p_phi = top.I1 * start.phi_dot * mpmath.sin(t) ** 2 + p_psi * mpmath.cos(t)
        exact = (p_phi - p_psi * mpmath.cos(t)) ** 2 / (2 * top.I1 * mpmath.sin(t) ** 2) + top.mgl * mpmath.cos(t)
        exact_rate = (p_phi - p_psi * mpmath.cos(t)) / (top.I1 * mpmath.sin(t) ** 2)
    assert top.potential(theta, momenta) == pytest.approx(float(exact), rel=4e-15)
    rate = effective_force(theta, momenta.north, momenta.south, top.I1, top.mgl)[1]
    assert rate == pytest.approx(float(exact_rate), rel=4e-15)
    naive = (momenta.p_phi - momenta.p_psi * math.cos(theta)) / (top.I1 * math.sin(theta) ** 2)
    assert abs(naive / float(exact_rate) - 1.0) > 1e-10


def test_nutation_frequency_is_the_limit_of_small_nutations_and_has_the_classical_threshold():
    case = scene("steady")
    momenta = case.top.momenta(case.start)
    assert case.top.steady_theta(momenta) == pytest.approx(math.pi / 3, abs=1e-8)
    # V'' at the precession Omega = 1: omega^2 = (p_psi - 2 I1 Omega c)^2/I1^2 + Omega^2 s^2 + c [...]/I1 = 1
    assert case.top.nutation_frequency(momenta) == pytest.approx(1.0, rel=1e-8)
    nudged = Angles(theta=case.start.theta + 1e-4, phi_dot=case.start.phi_dot, psi_dot=case.start.psi_dot)
    period = case.top.nutation_period(nudged)
    assert 2.0 * math.pi / period == pytest.approx(case.top.nutation_frequency(case.top.momenta(nudged)), rel=1e-6)
    # Stable for I3 w3 > 2 sqrt(I1 mgl): omega^2 = p_psi^2/4 I1^2 - mgl/I1 at theta = 0.
    asleep = SymmetricTop(1.0, 1.0, 1.0)
    awake = asleep.momenta(Angles(theta=0.0, psi_dot=2.5))
    assert asleep.steady_theta(awake) == 0.0
    assert asleep.nutation_frequency(awake) == pytest.approx(math.sqrt(2.5**2 / 4 - 1.0), rel=1e-14)
    assert asleep.steady_theta(asleep.momenta(Angles(theta=0.0, psi_dot=1.5))) > 0.1


@pytest.mark.parametrize("theta", [0.0, 0.3, 1.0, math.pi])
@pytest.mark.parametrize("psi_dot", [0.0, 1e-200])
def test_a_free_top_at_rest_keeps_its_inclination(theta, psi_dot):
    """The nutation cubic vanishes at every cosine."""
    cosine = math.cos(theta)
    assert SymmetricTop(1.0, 0.5, 0.0).turning_cosines(Angles(theta, psi_dot=psi_dot)) == (cosine, cosine)


def test_spheroids_have_the_notebooks_inertia_and_a_top_that_falls_from_rest_moves():
    top = SymmetricTop.from_spheroid(mass=1, polar_radius=2.7386127875258306, equatorial_radius=1.5811388300841898)
    assert pytest.approx((2.0, 1.0), rel=1e-15) == (top.I1, top.I3)
    assert top.mgl == pytest.approx(26.86579, abs=5e-6)
    hung = SymmetricTop.from_spheroid(2.0, 2.0, 1.0, gravity=10.0, pivot_distance=0.5)
    assert pytest.approx(2.0 * 5.0 / 5.0 + 2.0 * 0.25) == hung.I1  # Huygens-Steiner
    assert hung.mgl == pytest.approx(2.0 * 10.0 * 0.5)
    top = SymmetricTop(1.0, 0.5, 0.0)
    for swing in (0.2, 1e-200):  # a great circle through both poles, however slowly
        assert top.turning_cosines(Angles(1.0, theta_dot=swing)) == (-1.0, 1.0)
    low, high = SymmetricTop(1.0, 0.5, 1.0).turning_cosines(Angles(1.0))
    assert (low, high) == (-1.0, pytest.approx(math.cos(1.0), abs=1e-15))


LN2 = 0.6931471805599453
FUNCTIONS = {
    "convex": (lambda x: math.exp(x) - 2.0, math.exp, -5.0, 8.0, LN2),
    "a pole at the left": (lambda x: 1.0 - 1e-24 / x**3, lambda x: 3e-24 / x**4, 1e-9, 3.0, 1e-8),
    "flat, where Newton's steps leave": (math.atan, lambda x: 1.0 / (1.0 + x * x), -1.0, 1e6, 0.0),
    "a slope that turns": (lambda x: x**3 - 2.0 * x - 5.0, lambda x: 3.0 * x * x - 2.0, -1.0, 6.0, 2.0945514815423265),
    "a jump": (lambda x: math.copysign(1.0, x - 0.3), lambda x: 0.0, 0.0, 1.0, 0.3),
    "no finite slope": (lambda x: x - 0.3, lambda x: math.nan, 0.0, 1.0, 0.3),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_root_is_found_to_its_last_places(name):
    value, slope, below, above, root = FUNCTIONS[name]
    assert newton_between(value, slope, below, above) == pytest.approx(root, rel=1e-15, abs=1e-200)
    if root:
        assert brentq(value, below, above, xtol=1e-30, rtol=1e-15) == pytest.approx(root, rel=1e-14)


def test_a_slope_that_is_wrong_costs_steps_and_a_few_units_in_the_last_place():
    calls = []

    def value(x):
        calls.append(x)
        return math.exp(x) - 2.0

    assert newton_between(value, math.exp, -5.0, 8.0) == pytest.approx(LN2, abs=2.0 * math.ulp(LN2))
    count = len(calls)
    bound = (2.0 * 3.7 + 2.0) * math.ulp(LN2)  # the last step is too short, and exp(x) - 2 is rounded
    assert newton_between(value, lambda x: 3.7 * math.exp(x), -5.0, 8.0) == pytest.approx(LN2, abs=bound)
    assert count < 15 < len(calls) - count < 200
