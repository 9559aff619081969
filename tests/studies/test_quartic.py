"""The planar quartic oscillator: its exact map, the neighbours of it, and the line from the seed to the top."""

import math

import numpy as np
import pytest
from symtop_studies.oscillators import quartic
from symtop_studies.oscillators.quartic import Quartic, discrete_lagrangian, discrete_path, exact, mcmillan, true_path
from symtop_studies.oscillators.quartic_measures import MAPS, PLAIN, QUARTICS, oscillator_of, quartic_table

import symtop
from symtop.measure.order import power_law
from symtop.model.scenes import closed_form
from tests.slopes import slopes


@pytest.mark.parametrize("name", QUARTICS)
@pytest.mark.parametrize("steps", [40.0, 4.37, 2.05])
def test_the_exact_map_is_the_motion_at_any_step_and_its_neighbours_are_not(name, steps):
    oscillator = oscillator_of(name)
    h = oscillator.period / steps
    true = true_path(oscillator, h * np.arange(6))
    gaps = {method: np.abs(discrete_path(oscillator, method, h, 5) - true).max() for method in MAPS}
    assert gaps.pop("exact-discrete") < 3e-14 * np.abs(true).max()
    assert min(np.nan_to_num(gap, nan=np.inf) for gap in gaps.values()) > 1e-5


@pytest.mark.parametrize("name", QUARTICS)
def test_the_neighbours_have_order_two(name):
    oscillator = oscillator_of(name)
    horizon, counts = 0.9 * oscillator.period, np.array([100, 200, 400])
    end = true_path(oscillator, [horizon])[0]
    for method in MAPS[1:]:
        errors = [abs(discrete_path(oscillator, method, horizon / count, count)[-1] - end) for count in counts]
        assert power_law(1.0 / counts, errors).slope == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("name", QUARTICS)
def test_the_midpoint_rule_and_stormer_verlet_solve_their_equations(name):
    """x'' over three positions: the force in the middle one, or the mean of those in the middles of both steps."""
    oscillator = oscillator_of(name)
    h = oscillator.period / 20.0
    paths = {method: discrete_path(oscillator, method, h, 30) for method in ("midpoint", "stormer-verlet")}
    for method, x in paths.items():
        middle, inner = (oscillator.slope(np.abs(y) ** 2) * y for y in (0.5 * (x[1:] + x[:-1]), x[1:-1]))
        forces = {"midpoint": 0.5 * (middle[1:] + middle[:-1]), "stormer-verlet": inner}
        gaps = {rule: np.abs(np.diff(x, 2) - h * h * force).max() for rule, force in forces.items()}
        assert gaps.pop(method) < 2e-14 * np.abs(x).max()
        assert max(gaps.values()) > 1e-6


@pytest.mark.parametrize("name", PLAIN)
@pytest.mark.parametrize("steps", [30.0, 4.37, 2.1])
def test_the_motion_solves_the_discrete_euler_lagrange_equations(name, steps):
    oscillator = oscillator_of(name)
    h = oscillator.period / steps
    rule = exact(oscillator, h)
    motion = true_path(oscillator, h * np.arange(6)) * np.exp(-1j * rule.delta * np.arange(6))
    points, wrong = np.stack([motion.real, motion.imag], axis=1), rule._replace(lift=rule.lift + 1e-6)
    for before, now, after in zip(points, points[1:], points[2:], strict=False):
        arrives = slopes(discrete_lagrangian, rule, before, now)[1]
        assert np.abs(arrives + slopes(discrete_lagrangian, rule, now, after)[0]).max() < 2e-14 * rule.r
        assert now[0] * arrives[1] - now[1] * arrives[0] == pytest.approx(oscillator.momentum, abs=1e-13)
        gap = slopes(discrete_lagrangian, wrong, before, now)[1] + slopes(discrete_lagrangian, wrong, now, after)[0]
        assert np.abs(gap).max() > 1e-8 * rule.r


def test_without_the_quartic_term_it_is_the_exact_discrete_lagrangian_of_the_textbooks():
    oscillator = PLAIN["planar-harmonic"]
    omega, draw = math.sqrt(-3.0 * oscillator.b), np.random.default_rng(1)
    for h in (0.01, 0.7, 1.5):
        rule = exact(oscillator, h)
        assert (rule.B, rule.delta) == (0.0, 0.0)
        first, second = draw.normal(size=(2, 2))
        squares, product = first @ first + second @ second, first @ second
        action = omega * (squares * math.cos(omega * h) - 2.0 * product) / (2.0 * math.sin(omega * h))
        assert discrete_lagrangian(rule, first, second) == pytest.approx(action, rel=1e-13, abs=1e-13 / h)


@pytest.mark.parametrize("name", QUARTICS[1:])
def test_the_constants_tend_to_those_of_stormer_verlet(name):
    oscillator = oscillator_of(name)
    steps = oscillator.period / np.array([40.0, 80.0, 160.0])
    gaps = np.array([np.abs(np.subtract(exact(oscillator, h), mcmillan(oscillator, h))) for h in steps])
    for column, power in ((0, 4.0), (1, 4.0), (3, 3.0)):
        assert power_law(steps, gaps[:, column]).slope == pytest.approx(power, abs=0.05)


def test_the_truth_is_the_closed_form_and_any_planar_oscillator_has_its_own_function():
    scene, times = symtop.scene("spheroid"), np.linspace(0.0, 3.0, 40)
    oscillators = quartic.of_top(scene)
    first, second = (true_path(oscillator, times) for oscillator in oscillators)
    axis = closed_form(scene).axis(times)
    assert np.abs(np.abs(first) ** 2 - np.abs(second) ** 2 - axis[:, 2]).max() < 1e-14
    assert np.abs(2.0 * np.conj(first) * second - (axis[:, 0] + 1j * axis[:, 1])).max() < 1e-14
    control = oscillators[0]._replace(b=1.0001 * oscillators[0].b)
    assert np.abs(np.abs(true_path(control, times)) ** 2 - np.abs(first) ** 2).max() > 1e-5
    oscillator = Quartic(-0.7, 0.4, 0.9 + 0.1j, 0.2 + 0.6j)  # a potential with a hump in the middle
    assert 1.0 + exact(oscillator, 0.5 * oscillator.period).lift == pytest.approx(0.0, abs=1e-7)
    first, second = np.abs(true_path(oscillator, oscillator.period * np.array([0.3, 1.3])))
    assert first == pytest.approx(second, abs=1e-14)


def test_mcmillans_map_keeps_a_biquadratic_and_a_map_that_leaves_ends():
    """x0^2 + x1^2 - 2 A x0.x1 + B |x0|^2 |x1|^2 of the radial map, at a step that is not small."""
    oscillator = oscillator_of("planar-hardening")
    h = oscillator.period / 6.0
    for method, keeps in (("mcmillan", True), ("stormer-verlet", False)):
        rule, path = mcmillan(oscillator, h), discrete_path(oscillator, method, h, 500)
        first, second = path[:-1], path[1:]
        s0, s1 = np.abs(first) ** 2, np.abs(second) ** 2
        invariant = s0 + s1 - 2.0 * (1.0 + rule.lift) * (np.conj(first) * second).real + rule.B * s0 * s1
        assert (np.ptp(invariant) < 1e-12) == keeps
    path = discrete_path(oscillator, "stormer-verlet", oscillator.period / 2.1, 200)
    assert np.isnan(path[-1])
    assert np.isfinite(path[:3]).all()
    table = quartic_table("planar-hardening", "exact-discrete", (40.0, 2.1), 1.0)
    assert float(table["quartic_error"].max()) < 1e-14
    assert quartic.Map(0.0, 0.0, 1.0, 0.0).kick(3.0) == 0.0
    oscillator, h = PLAIN["planar-softening"], PLAIN["planar-softening"].period / 40.0
    gap = discrete_path(oscillator, "midpoint", h, 40) - (true := true_path(oscillator, h * np.arange(41)))
    table = quartic_table("planar-softening", "midpoint", (40.0,), 1.0)
    assert table["quartic_error"][0] == pytest.approx(np.abs(gap).max() / np.abs(true).max())
