"""Splitting methods: coefficients, constants, and what each is good at; their orders are in `test_structure`."""

import math

import numpy as np
import pytest

import symtop
from symtop.measure.accuracy import error_table
from symtop.measure.order import power_law
from symtop.measure.step_map import one_step, return_miss, symplectic_defect
from symtop.methods.splitting import coefficients as tables, rotor, space
from symtop.methods.splitting.composition import built_in, composition
from symtop.model.scenes import closed_form

TABLES = {name: item.table for name, item in tables.METHODS.items() if item.table.order > 1}  # of more than a sum of 1
METHODS = {method.name: method for method in built_in()}


def run(method, scene, h, marks, chart="attitude"):
    """A run of `marks[-1]` steps of exactly h."""
    return method.solvers[chart](scene.top, scene.start, symtop.Plan.steps(h, marks))


def quadrature_defect(table, order):
    """Largest |sum b t^k - 1/(k+1)| for k < order, t the time at each kick."""
    times = np.array([math.fsum(table.drift[:i]) for i in range(len(table.kick))])
    return max(abs(math.fsum(np.array(table.kick) * times**k) - 1.0 / (k + 1)) for k in range(order))


QUADRATURE = {"aba-8-6-4": 8, "aba-10-6-4": 10, "aba-10-4": 10, "takahashi-imada": 2}  # others: their order


@pytest.mark.parametrize("name", TABLES)
def test_tables_sum_to_one_read_the_same_from_both_ends_and_integrate_polynomials(name):
    table = TABLES[name]
    for row in (table.drift, table.kick):
        assert row == row[::-1]
        assert abs(math.fsum(row) - 1.0) <= np.spacing(abs(row[len(row) // 2]))
    order = QUADRATURE.get(name, table.order)
    assert quadrature_defect(table, order) < 3e-15
    control = table._replace(kick=(table.kick[0] + 1e-9, *table.kick[1:-1], table.kick[-1] - 1e-9))
    assert quadrature_defect(control, order) > 1e-10


@pytest.mark.parametrize("chart", ["space", "angles"])
def test_a_table_without_a_last_kick_kicks_with_the_newest_axis(chart):
    # the force that the last drift leads to is the next step's first, whether or not the table kicks with it before
    scene, errors = symtop.scene("spheroid"), {}
    for kick in ((1.0, 0.0), (0.0, 1.0)):
        method = composition("euler", (1.0,), kick, chart=chart, order=1)
        once = symtop.simulate(scene, method, step_size=1e-3, horizon=0.5, samples=2)
        errors[kick] = abs(float(once["energy"][-1] - once["energy"][0]))
        assert once.attrs["force_evaluations"] == once.attrs["steps"]
    assert 0.5 < errors[1.0, 0.0] / errors[0.0, 1.0] < 2.0  # adjoint methods: errors of one size


@pytest.mark.parametrize("x", [0.3, 0.999, 1.001, 2.0, 40.0])
def test_a_drift_turns_by_its_angle_in_series_and_beyond(x):
    s, m = rotor.exact(x * x, 0.5)  # by 2 x, for |L| = 2 x
    np.testing.assert_allclose([2.0 * x * s, m], [np.sin(x), -2.0 * np.sin(0.5 * x) ** 2], rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("name", ["strang", "cayley", "yoshida-4", "srkn-14-6"])
@pytest.mark.parametrize("chart", ["axis", "attitude"])
def test_lengths_and_momenta_have_no_trend_in_a_million_steps(name, chart):
    scene = symtop.scene("spheroid")
    result = run(METHODS[name], scene, scene.nutation_period / 20.2, np.arange(0, 1_000_001, 100_000), chart)
    assert np.abs(np.linalg.norm(result.states[:, :-3], axis=1) - 1.0).max() < 2e-15
    assert np.ptp(result.states[:, -1]) == 0.0  # L_z
    assert np.abs(result.p_psi - result.p_psi[0]).max() < 5e-13 * max(abs(result.p_phi[0]), abs(result.p_psi[0]))


def cayley_drift(method, scene, h, tau, steps):
    states = run(method, scene, h, np.linspace(0, steps, 101).astype(np.int64), "axis").states
    energy = space.cayley_energy(scene.top, h, tau, states[:, :3], states[:, 3:])
    return np.abs(energy / energy[0] - 1.0).max()


@pytest.mark.parametrize(("scene_name", "steps"), [("spheroid", 10_000_000), ("goldstein", 1_000_000)])
def test_cayley_keeps_its_own_energy_for_millions_of_steps(scene_name, steps):
    scene = symtop.scene(scene_name)
    h = scene.nutation_period / 100.0
    tau = 0.5 * h / scene.top.I1
    assert cayley_drift(METHODS["cayley"], scene, h, tau, steps) < 1e-14
    tuned = tau * space.tangent_scale(scene.top, scene.start, h)
    assert cayley_drift(METHODS["cayley-tuned"], scene, h, tuned, steps) < 1e-14
    assert cayley_drift(METHODS["strang"], scene, h, tau, 10_000) > 1e-10
    assert cayley_drift(METHODS["cayley"], scene, h, 1.001 * tau, 10_000) > 1e-10


@pytest.mark.parametrize("kick", [(0.5, 0.5), (0.3, 0.7)])
def test_a_splitting_claims_the_cayley_energy_where_it_keeps_it(kick):
    scene = symtop.scene("spheroid")
    h = scene.nutation_period / 100.0
    method = symtop.composition("own", (1.0,), kick, chart="space", rotation="cayley")
    drift = cayley_drift(method, scene, h, 0.5 * h / scene.top.I1, 10_000)
    assert (drift < 1e-13) == ("cayley_energy" in method.conserves)


@pytest.mark.parametrize("nutations", [0.1, 0.5, 1.03, 2.0])
@pytest.mark.parametrize("name", ["cayley", "cayley-tuned"])
def test_cayley_never_blows_up(name, nutations):
    scene = symtop.scene("spheroid")  # the rounding of steps this large adds up: 5e-10 at most was seen in 1e7 of them
    h = nutations * scene.nutation_period
    scale = space.tangent_scale(scene.top, scene.start, h) if name == "cayley-tuned" else 1.0
    assert cayley_drift(METHODS[name], scene, h, 0.5 * h / scene.top.I1 * scale, 1_000_000) < 1e-9


@pytest.mark.parametrize("name", ["spheroid", "goldstein", "fast", "hairer-lubich-wanner", "cusp"])
def test_the_mean_square_momentum_is_that_of_the_closed_form(name):
    scene = symtop.scene(name)
    times, momenta = (np.arange(2000) + 0.5) / 2000 * scene.nutation_period, scene.top.momenta(scene.start)
    potential = scene.top.mgl * np.cos(closed_form(scene)(times).theta).mean()
    mean = 2.0 * scene.top.I1 * (scene.top.energy(scene.start) - potential)
    mean += momenta.p_psi**2 * (1.0 - scene.top.I1 / scene.top.I3)
    assert space.mean_square_momentum(scene.top, scene.start) == pytest.approx(mean, rel=1e-13)


def largest_error(name, scene, h, horizon):
    return float(error_table(scene, METHODS[name], [h], horizon, observe="attitude")["axis"][0])


def test_the_tuned_step_is_symplectic_but_for_its_number_and_strang_accurate_in_the_fast_top():
    start = symtop.Angles(theta=0.7, phi=0.3, psi=-0.2, theta_dot=0.4, phi_dot=0.9, psi_dot=2.0)
    scene = symtop.Scene("map", symtop.SymmetricTop(2.0, 0.7, 3.0), start, 1.0)
    defect = symplectic_defect(one_step(METHODS["cayley-tuned"], "attitude", scene, 0.2), start)
    assert defect.size > 1e-4 > 1e6 * defect.rest
    assert space.tangent_scale(scene.top, start, -0.2) == space.tangent_scale(scene.top, start, 0.2) > 1.0
    defect = symplectic_defect(one_step(symtop.integrator("gauss-4"), "attitude", scene, 0.2), start)
    assert defect.rest > 1e-7  # a number of the start explains nothing here
    euler = composition("euler", (1.0,), (1.0, 0.0), chart="space", order=1)
    assert not euler.symmetric
    assert return_miss(one_step(euler, "attitude", scene, 0.1), start) > 1e-3
    assert tables.exact_sum((1.0, 0.0)) == (1.0, 0.0)
    closed = tables.exact_sum((0.7, 0.2, 0.1 - 1e-10, 0.0))
    assert closed == pytest.approx((0.7, 0.2 + 5e-11, 0.1 - 5e-11, 0.0), abs=1e-15)
    for name, better in (("fast", True), ("goldstein", False)):
        scene = symtop.scene(name)
        h = scene.nutation_period / 193.7
        verlet, strang = (largest_error(method, scene, h, 8.0) for method in ("stormer-verlet", "strang"))
        assert (verlet > 50.0 * strang) is better


def spin_power(name):
    """p in error ~ spin^-p at a fixed number of steps a nutation: 2 for each power of gravity over spin energy."""
    errors, spins = [], (40.0, 80.0, 160.0)
    for spin in spins:
        scene = symtop.Scene("spun", symtop.SymmetricTop(2.0, 1.0, 2.0), symtop.Angles(theta=0.5, psi_dot=spin), 1.0)
        period = scene.nutation_period
        errors.append(largest_error(name, scene, period / 4.3, 20.0 * period))
    return -power_law(spins, errors).slope


@pytest.mark.parametrize("name", ["aba-8-6-4", "aba-10-6-4", "aba-10-4"])
def test_generalised_orders_remove_the_first_power_of_gravity(name):
    assert spin_power(name) > 3.9
    assert spin_power("suzuki-4") < 2.2  # order 4 too, but its error is of the first power


def test_a_new_composition_compiles_nothing():
    """One kernel takes tables of any length, but for those of one and two drifts, which are compiled for it."""
    scene = symtop.scene("spheroid")
    run(METHODS["yoshida-4"], scene, 0.01, [1], "axis")
    march = METHODS["yoshida-4"].solvers["axis"]._whole.alone[0]
    count = len(march.signatures)
    run(composition("thirds", (1 / 3,) * 3, (1 / 6, 1 / 3, 1 / 3, 1 / 6), chart="space"), scene, 0.01, [1], "axis")
    bent = composition("bent", (0.2, 0.6, 0.2), (0.1, 0.4, 0.4, 0.1), (0, 1e-3, 1e-3, 0), chart="space")
    run(bent, scene, 0.01, [1], "axis")
    assert len(march.signatures) == count
    assert bent.solvers["axis"]._whole.alone[0] is march
    assert METHODS["strang"].solvers["axis"]._whole.alone[0] is not march


@pytest.mark.parametrize(("words", "arguments", "options"), [
    ("kick must have one coefficient more", ((1.0,), (1.0,)), {}),
    ("drift coefficients must sum to 1", ((0.9,), (0.5, 0.5)), {}),
    ("gradient must have as many", ((1.0,), (0.5, 0.5), (0.0,)), {"chart": "space"}),
    ("gradient must be zero where kick is", ((0.5, 0.5), (0.0, 1.0, 0.0), (0.1, 0.0, 0.0)), {"chart": "space"}),
    ("chart must be 'space'", ((1.0,), (0.5, 0.5), (0.1, 0.1)), {}),
    ("rotation 'caley' is unknown; did you mean cayley", ((1.0,), (0.5, 0.5)), {"rotation": "caley"}),
])  # fmt: skip
def test_bad_tables_are_refused_in_one_sentence(words, arguments, options):
    with pytest.raises(symtop.SymtopError, match=words):
        composition("bad", *arguments, **options)
