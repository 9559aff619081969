"""The table of errors: enough samples, both halves of the truth, and steps where the error is a power of the step."""

import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.core.numbers import EPSILON
from symtop.measure import order_table
from symtop.measure.accuracy import SAMPLES, enough_samples, error_table
from symtop.measure.errors import error_bound, errors_against
from symtop.measure.order import LARGEST_ERROR, order
from symtop.measure.order_table import asymptotic_steps, extended_errors, extended_order_data, order_fit
from symtop.model.charts import axis_from_angles, momentum_parts
from symtop.run.reference.independent_checks import have_heyoka
from symtop.run.simulation import integrate
from symtop.run.trajectory import Trajectory

DENSE, EVEN = 40_001, 331
HORIZONS = (10.037, 100.37, 250.37, 333.7, 1003.7)  # nutations; a stride of a quarter or a third is the worst


def largest_errors(name, method, nutations, samples):
    scene = symtop.scene(name)
    period = scene.nutation_period
    run = symtop.simulate(scene, method, step_size=period / 40.0, horizon=nutations * period, samples=samples,
                          observe="axis", guard=False)  # fmt: skip
    return symtop.errors(run)[["axis", "theta"]].max().to_array().values


def test_where_the_largest_error_scatters_the_order_is_that_at_the_end():
    h, scatter = 0.02 / 2.0 ** np.arange(9.0), 10.0 ** np.random.default_rng(0).uniform(-1.0, 1.0, 9)
    columns = {"step_size": h, "theta": h**2 * scatter, "theta_end": h**2, "theta_bound": np.full(9, 1e-14)}
    table = xr.Dataset({name: ("setting", column) for name, column in columns.items()})
    fit = order_fit(symtop.scene("spheroid"), symtop.integrator("rk4"), table, "theta", 8.0)
    assert fit.slope == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("name", ["spheroid", "goldstein", "grazing"])
@pytest.mark.parametrize("method", ["takahashi-imada", "rk4"])
def test_the_largest_error_of_enough_samples_is_that_of_a_dense_run_to_five_percent(name, method):
    period = symtop.scene(name).nutation_period
    for nutations in HORIZONS:
        samples = enough_samples(symtop.scene(name), nutations * period)
        assert SAMPLES <= samples < 2 * SAMPLES
        share = largest_errors(name, method, nutations, samples) / largest_errors(name, method, nutations, DENSE)
        assert np.all(share > 0.95)


def test_as_many_samples_at_one_phase_of_the_nutation_see_less():
    """1004 samples of 1003 nutations come at nearly the same phase of each, and their phase drifts once in the run."""
    scene = symtop.scene("goldstein")
    horizon = 1003.7 * scene.nutation_period
    stride = np.mod(horizon / (enough_samples(scene, horizon) - 1) / scene.nutation_period, 1.0)
    assert min(abs(stride - 0.618), abs(stride - 0.382)) < 0.02
    shares = [largest_errors("goldstein", "takahashi-imada", 1003.7, count)[1] for count in (EVEN, SAMPLES, DENSE)]
    assert min(shares[:2]) < 0.95 * shares[2]


@pytest.mark.skipif(not have_heyoka(), reason="long double needs heyoka")
def test_errors_are_taken_from_both_halves_of_the_reference():
    scene = symtop.scene("goldstein")
    truth = symtop.reference(scene, np.linspace(0.0, 20.0, 41), "longdouble")
    rounded = Trajectory.of_data(truth[["axis", "quaternion", "theta"]])  # right to the last digit
    with_low = errors_against(scene, rounded, truth)
    for name, low in (("axis", "axis_lo"), ("attitude", "quaternion_lo"), ("theta", "theta_lo")):
        assert 1e-18 < float(with_low[name].max()) < EPSILON
        assert float(np.abs(truth[low].values).max()) > 1e-18
        assert float(errors_against(scene, rounded, truth.drop_vars([low]))[name].max()) < 1e-20


def test_a_run_that_shows_its_quaternion_is_judged_without_the_rounding_of_its_angles():
    scene = symtop.scene("spheroid")
    angles, attitude = (integrate(scene, name, step_size=0.01, samples=101, observe="attitude")
                        for name in ("stormer-verlet", "gauss-12"))  # fmt: skip
    truth = symtop.reference(scene, angles.time, "closed-form")
    turn = float(np.max(np.abs(truth["phi"].values) + np.abs(truth["psi"].values)))
    wide, narrow = (float(error_bound(scene, run, truth, "attitude").max()) for run in (angles, attitude))
    assert wide - narrow == pytest.approx(0.5 * EPSILON * turn, rel=0.05)
    table = error_table(scene, symtop.integrator("stormer-verlet"), [0.01], 8.0, observe="attitude")
    assert float(table["attitude_bound"][0]) > 0.9 * wide  # the largest of the run
    assert errors_against(scene, attitude, truth)["attitude"][1] < 3.0 * narrow


@pytest.mark.skipif(not have_heyoka(), reason="long double needs heyoka")
@pytest.mark.skipif(np.finfo(np.longdouble).eps == np.finfo(float).eps, reason="long double is double here")
@pytest.mark.parametrize("name", ["goldstein", "spheroid"])
def test_a_composition_in_long_double_has_its_order_where_double_runs_out(name):
    """Order 10 falls from 1e-10 to 1e-17: in double only the first decades of it are above round-off."""
    scene = symtop.scene(name)
    data = extended_errors(scene, symtop.integrator("sofroniou-spaletta-10"))
    error = data["extended_error"].values
    assert error.min() < 1e-17 < EPSILON < 1e-11 < error.max()
    omega = 2.0 * np.pi / scene.nutation_period
    fit = order(*extended_order_data(data), omega, 10, symmetric=True)
    assert abs(fit.slope - 10.0) <= fit.interval < 0.15
    mask = error > 1e-13  # what double can judge
    double = order(*(values[mask] for values in extended_order_data(data)), omega, 10, symmetric=True)
    assert not double.interval < 0.15  # NaN, or wide


def axis_after(scene, stages, horizon, count):
    """The axis after `count` steps of a composition, by vectors, one step at a time."""
    top, start = scene.top, scene.start
    angles = [np.longdouble(value) for value in (start.theta, start.phi)]
    e = axis_from_angles(*angles)
    L = np.array(momentum_parts(np, top, *angles, start.theta_dot, start.phi_dot, start.psi_dot))
    h, up = np.longdouble(horizon) / count, np.array([0.0, 0.0, 1.0], np.longdouble)
    kicks, drifts = (np.array(row, np.longdouble) / sum(map(np.longdouble, row)) for row in (stages.kick, stages.drift))
    for _ in range(count):
        for kick, drift in zip(kicks, [*drifts, 0.0], strict=True):
            L = L + h * kick * top.mgl * np.cross(up, e)
            length = np.sqrt(L @ L)
            n, angle = L / length, h * drift * length / top.I1
            e = np.cos(angle) * e + np.sin(angle) * np.cross(n, e) + (1 - np.cos(angle)) * (n @ e) * n
    return e


@pytest.mark.parametrize("name", ["strang", "kahan-li-6"])
def test_runs_side_by_side_in_long_double_are_those_alone(name):
    scene = symtop.scene("spheroid")
    horizon, counts = 1.37 * scene.nutation_period, np.array([7, 8, 40])
    stages = order_table._composition(scene, symtop.integrator(name))
    for count, end in zip(counts, order_table._ends(scene, stages, horizon, counts), strict=True):
        assert np.array_equal(end, order_table._ends(scene, stages, horizon, np.array([count]))[0])
        assert np.abs(end - axis_after(scene, stages, horizon, count)).max() < 1e-15
        assert np.abs(end - axis_after(scene, stages, horizon, count + 1)).max() > 1e-12  # the control


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("psi_dot", [0.0, 3.0])
def test_a_free_top_is_run_in_long_double_without_a_warning(psi_dot):
    """Its kicks are zero, and so is its momentum if it rests."""
    scene = symtop.Scene("free", symtop.SymmetricTop(1.0, 0.5, 0.0), symtop.Angles(1.0, phi_dot=psi_dot / 3.0), 5.0)
    ends = order_table._ends(scene, order_table._composition(scene, symtop.integrator("strang")), 2.0, np.array([7, 8]))
    assert np.abs(ends.astype(float) - symtop.ClosedForm(scene.top, scene.start).axis([2.0])[0]).max() < 1e-14


def test_added_steps_lie_where_the_error_is_a_power_and_only_plain_compositions_run_in_long_double():
    scene, method = symtop.scene("goldstein"), symtop.integrator("sofroniou-spaletta-10")
    horizon = 5.0 * scene.nutation_period
    coarse = error_table(scene, method, list(scene.nutation_period / np.geomspace(6.0, 80.0, 9)), horizon, "attitude")
    table = error_table(scene, method, asymptotic_steps(coarse, "attitude", 10), horizon, "attitude")

    def judged(part):
        return int(np.sum((part["attitude"] > 10.0 * part["attitude_bound"]) & (part["attitude"] < LARGEST_ERROR)))

    assert judged(table) >= 10 > judged(coarse)
    assert asymptotic_steps(coarse.assign(attitude=coarse["attitude_bound"]), "attitude", 10) == []
    for name in ("takahashi-imada", "cayley", "gauss-4", "stormer-verlet", "rk4", "rk45"):
        assert extended_errors(scene, symtop.integrator(name)) is None
