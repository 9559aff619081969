"""Growth laws, phases and horizons: planted ones are found, and the integrators show theirs."""

import numpy as np
import pytest
from symtop_studies.drift.growth import ensemble_growth, history, horizon, lost_at
from symtop_studies.drift.phase_loss import phase_loss
from symtop_studies.drift.runs import elapsed_steps, members

import symtop
from symtop.measure.conservation import growth, law
from symtop.measure.phase import nutation_phase
from symtop.run import modified_energy as shadow
from symtop.run.long_run import chart_of, scattered, watch

TIME = np.linspace(0.0, 1000.0, 4001) + 0.3 * np.sin(np.arange(4001))


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
def test_a_planted_exponent_is_found_under_an_oscillation(exponent):
    fit = growth(TIME, 1e-6 * np.abs(TIME) ** exponent + 1e-6 * np.sin(5.3 * TIME))
    assert fit.slope == pytest.approx(exponent, abs=0.05)
    assert law(fit) == {1.0: "linear", 1.5: "t^3/2", 2.0: "quadratic"}[exponent]


def test_an_oscillation_is_bounded_and_an_odd_exponent_keeps_its_number():
    assert law(growth(TIME, np.sin(5.3 * TIME))) == "bounded"
    assert law(growth(TIME, np.abs(TIME) ** 0.75)) == "t^0.75"


def test_a_law_is_not_named_where_the_interval_holds_two():
    fit = growth(TIME, np.abs(TIME))
    assert law(fit) == "linear"
    assert law(fit._replace(slope=0.8, interval=0.4)) == "undecided"


def test_the_horizon_of_a_phase_is_its_first_crossing_even_if_the_error_falls_again():
    t = np.linspace(0.0, 100.0, 5001)
    bump = 1e-3 * t + np.exp(-(((t - 30.0) / 3.0) ** 2))
    assert 25.0 < lost_at(t, bump, 0.5) < 30.0


def test_an_ensemble_tells_a_walk_from_a_drift():
    draw = np.random.default_rng(3)
    steps = np.unique(np.rint(np.geomspace(10, 100_000, 40)).astype(int))
    walks = np.cumsum(draw.standard_normal((8, 100_000)), axis=1)[:, steps - 1]
    walk, drift = ensemble_growth(steps, walks, 20.0), ensemble_growth(steps, walks + 0.2 * steps, 20.0)
    assert abs(walk.fit.slope - 0.5) < walk.fit.interval < 0.3
    assert drift.fit.slope - drift.fit.interval > 0.65


def test_the_variance_of_means_of_a_random_walk_grows_with_the_steps_between_them():
    ends = np.array([100, 130, 200, 400, 1000])
    walks = np.cumsum(np.random.default_rng(4).standard_normal((20_000, 1000)), axis=1)
    means = np.stack([part.mean(axis=1) for part in np.split(walks, ends[:-1], axis=1)])
    variance = np.mean((means[1:] - means[0]) ** 2, axis=1)
    assert np.isnan(elapsed_steps(ends)[0])
    assert variance == pytest.approx(elapsed_steps(ends)[1:], rel=0.05)
    assert abs(variance[0] / ends[1] - 1.0) > 0.5  # the control: counted from the start


@pytest.mark.parametrize("name", ["stormer-verlet", "midpoint", "strang", "cayley"])
def test_the_mean_of_a_window_is_known_far_better_than_the_energy_has_digits(name):
    """Rounded to one double, the level of the modified energy would put 3.5e-17 of |E| into every window."""
    where, method = symtop.scene("spheroid"), symtop.integrator(name)
    found = []
    for one in members(where, 6):
        h = one.nutation_period / 1000.37
        solver = chart_of(method)[1]
        par, rule, state = solver.setup(one.top, one.start, h)
        done = solver.loop(par, rule, state, h, scattered(0, 5000))
        level = watch(one, method, h)(done.states, done.momenta)["modified_energy"].mean()
        found.append(level / one.energy_grain)  # relative to |E|, whose rounding it is
    assert np.sqrt(np.mean(np.square(found))) < 1.2e-17


@pytest.mark.parametrize("bend", [0.0, 3e-9])
def test_a_horizon_is_predicted_from_a_tenth_of_it(bend):
    t = np.linspace(0.0, 10_000.0, 20_001)
    error = 2e-6 + 1e-6 * t + bend * t * t + 1e-6 * np.sin(5.3 * t)
    short = t < 1000.0
    tolerance = abs(float(error[-1])) * 0.8
    true = lost_at(t, error, tolerance)
    assert horizon(t[short], error[short], tolerance).time == pytest.approx(true, rel=0.02)
    assert horizon(t[short], -error[short], tolerance).time == pytest.approx(true, rel=0.02)


def test_a_phase_that_is_not_lost_has_no_horizon():
    error = 1e-6 * np.sin(5.3 * TIME)
    assert np.isnan(lost_at(TIME, error, 1e-2))
    assert horizon(TIME, error, 1e-2).time > 1e3 * TIME[-1]


@pytest.mark.parametrize("name", ["spheroid", "goldstein", "cusp", "fast", "hairer-lubich-wanner"])
def test_the_truth_is_never_late_and_a_shift_is_measured(name):
    where = symtop.scene(name)
    exact = symtop.ClosedForm(where.top, where.start)
    times = np.linspace(0.0, 300.7 * where.nutation_period, 3001)
    motion = exact(times)
    assert np.max(np.abs(nutation_phase(where, times, motion.theta, motion.theta_dot))) < 1e-9
    ahead = exact(times * (1.0 + 1e-4))
    expected = 2.0 * np.pi * 1e-4 * times / where.nutation_period
    assert nutation_phase(where, times, ahead.theta, ahead.theta_dot) == pytest.approx(expected, abs=1e-9)


def test_a_steady_precession_and_a_failed_sample_have_no_phase():
    steady, spheroid = symtop.scene("steady"), symtop.scene("spheroid")
    times = np.linspace(0.0, 9.0, 101)
    for where, phased in ((steady, 0), (spheroid, 60)):
        motion = symtop.ClosedForm(where.top, where.start)(times)
        theta = np.where(np.arange(101) < 60, motion.theta, np.nan)
        phase = nutation_phase(where, times, theta, motion.theta_dot)
        assert np.isfinite(phase).sum() == phased
        assert not np.isfinite(phase[60:]).any()


def test_laws_of_growth_of_a_symplectic_method_and_of_runge_kutta():
    where = symtop.scene("spheroid")
    period = where.nutation_period
    found = {
        name: history(where, symtop.integrator(name), horizon=6000.0 * period, samples=3001, **control)
        for name, control in {
            "stormer-verlet": {"step_size": period / 60.37},
            "strang": {"step_size": period / 60.37},
            "rk4": {"step_size": period / 60.37},  # a wrong frequency rules for the first 75 nutations, energy then
            "rk45-compiled": {"tolerance": 1e-8},
        }.items()
    }
    for name, energy, phase in (("stormer-verlet", 0.0, 1.0), ("strang", 0.0, 1.0), ("rk4", 1.0, 2.0),
                                ("rk45-compiled", 1.0, 2.0)):  # fmt: skip
        assert float(found[name]["energy_exponent"]) == pytest.approx(energy, abs=0.1), name
        assert float(found[name]["phase_exponent"]) == pytest.approx(phase, abs=0.2), name
        assert float(found[name]["phase_exponent_interval"]) < 0.2


@pytest.mark.parametrize("name", ["gauss-8", "kahan-li-6", "rk4"])
def test_a_lost_phase_is_predicted(name):
    found = phase_loss(symtop.scene("spheroid"), symtop.integrator(name), short=100.0, target=250.0)
    assert float(found["measured"]) > 150.0
    assert float(found["ratio"]) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("name", ["stormer-verlet", "midpoint", "strang", "cayley"])
def test_a_modified_energy_oscillates_with_the_fourth_power_of_the_step(name):
    where = symtop.scene("spheroid")
    chart, solver = chart_of(symtop.integrator(name))
    plain, modified, rest = [], [], []
    for steps in (100.37, 200.37):
        h = where.nutation_period / steps
        par, rule, state = solver.setup(where.top, where.start, h)
        states = solver.loop(par, rule, state, h, scattered(0, 4000, 2000)).states
        values = shadow.modified_energy(where, name, chart, states, h)
        on = shadow.section(chart, states)
        plain.append(np.ptp(shadow.energy(where, chart, states)))
        modified.append(np.ptp(values))
        rest.append(np.ptp(shadow.oscillation(*on, values)(*on, values)))
    assert plain[0] / plain[1] == pytest.approx(4.0, rel=0.1)  # the control: H itself, of second order
    if name == "cayley":
        assert max(modified) < 1e-12
    else:
        assert modified[0] / modified[1] == pytest.approx(16.0, rel=0.1)
    assert max(rest) < 1e-12
