"""A million steps: what the discrete methods keep, and what RK45 loses."""

import numpy as np
import pytest

import symtop
from symtop.measure.conservation import growth, residuals, trend
from symtop.run.simulation import integrate

DISCRETE = ("midpoint", "trapezoidal", "stormer-verlet")


@pytest.fixture(scope="module")
def million():
    """10^6 steps of each discrete method on spheroid."""
    where = symtop.scene("spheroid")
    return {
        name: integrate(where, name, step_size=0.01, horizon=10_000.0, samples=4001, observe="nutation")
        for name in DISCRETE
    }


@pytest.mark.parametrize("name", DISCRETE)
def test_recomputed_momenta_stay_put_without_a_trend(million, name):
    run = million[name]
    assert run.steps == 1_000_000
    for quantity in ("p_phi", "p_psi"):
        change = residuals(symtop.scene("spheroid"), run)[quantity]
        assert np.max(np.abs(change)) < 1e-11
        assert not trend(run.time, change).significant


@pytest.mark.parametrize("name", DISCRETE)
def test_energy_error_is_bounded_without_a_trend(million, name):
    run = million[name]
    change = residuals(symtop.scene("spheroid"), run)["energy"]
    line, power = trend(run.time, change), growth(run.time, change)
    assert not line.significant
    assert abs(power.slope) < 0.05
    assert 1e-6 < np.max(np.abs(change)) < 1e-3  # of second order in the step: bounded, not small


def test_the_energy_of_rk45_falls_linearly_and_its_momenta_drift():
    where = symtop.scene("spheroid")
    run = integrate(where, "rk45", tolerance=1e-6, horizon=200.0, samples=1001)
    lost = float(run.energy[0] - run.energy[-1])
    assert 4e-3 < lost < 7e-3
    change = residuals(where, run)["energy"]
    assert trend(run.time, change).significant
    assert growth(run.time, change).slope == pytest.approx(1.0, abs=0.25)
    for quantity in ("p_phi", "p_psi"):
        assert np.ptp(getattr(run, quantity)[[0, -1]]) > 1e-5


def test_momenta_are_recomputed_and_not_copied():
    """A kernel that moves phi by the wrong amount shows it in p_phi."""
    from symtop.methods.framework.angles import on_angles
    from symtop.methods.framework.loop import kernel_loop
    from symtop.methods.lagrangian import discrete_lagrangian as family

    where = symtop.scene("spheroid")
    par, state = on_angles(where.top, where.start)
    right = family.increment

    def wrong(par, rule, state, carry, h):
        step, carry, effort, outcome = right(par, rule, state, carry, h)
        return (step[0], step[1], step[2] * (1.0 + 1e-6), step[3]), carry, effort, outcome

    loop = kernel_loop(family.begin, wrong, family.observe)
    done = loop(par, family.Quadrature((0.5,), (1.0,)), state, 0.01, np.array([0, 100]))
    momenta = where.top.momenta(where.start)
    assert abs(done.momenta[-1, 0] / momenta.p_phi - 1.0) > 1e-8


def test_trend_sees_a_drift_of_a_few_rounding_units_and_ignores_an_oscillation():
    t = np.linspace(0.0, 1000.0, 4001) + 0.3 * np.sin(np.arange(4001))
    wave = 1e-5 * np.sin(5.3 * t)
    assert not trend(t, wave).significant
    drifting = trend(t, wave + 1e-8 * t)
    assert drifting.significant
    assert drifting.rise == pytest.approx(1e-5, rel=0.3)
