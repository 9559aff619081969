"""The closed form against itself in 50 digits, published digits, an elementary solution and the equations of motion."""

import dataclasses
import json
import math
from decimal import Decimal
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest

from benchmarks.families import REGIMES, random_top
from symtop.core.errors import SymtopError
from symtop.model import charts
from symtop.model.charts import attitude_distance
from symtop.model.exact.closed_form import ClosedForm
from symtop.model.exact.digits import PreciseForm
from symtop.model.scenes import Scene, added_scenes, scene, scenes
from symtop.model.top import Angles, SymmetricTop, flat
from symtop.run.reference.independent_checks import integrate
from tests.model.theta_functions import theta_quaternion

EPS = float(np.finfo(float).eps)
TRUTH = json.loads((Path(__file__).parents[1] / "data" / "truth.json").read_text())
del TRUTH["_note"]
SPHEROID = (SymmetricTop(2.0, 1.0, 26.8657914456284), Angles(0.4, 0.1, 0.1, 0.1, 10.0, 0.1))


@pytest.fixture(autouse=True)
def _digits():
    with mp.workdps(60):
        yield


CONSTANTS = {name: name for name in ("p_phi", "p_psi", "a", "b", "alpha", "beta", "m", "Omega", "K", "nutation_period")}
CONSTANTS |= {"E": "energy", "dphi_per_period": "phi_per_period", "dpsi_per_period": "psi_per_period"}


@pytest.mark.parametrize("name", TRUTH)
def test_thirty_digits_of_the_published_states(name):
    entry = TRUTH[name]
    form = PreciseForm([entry[k] for k in ("I1", "I3", "mgl")], [*entry["q0_theta_phi_psi"], *entry["v0"]], digits=40)
    pairs = list(zip(form(entry["t"]), entry["state"].values(), strict=True))
    pairs += [(getattr(form, ours), entry[theirs]) for theirs, ours in CONSTANTS.items() if theirs in entry]
    pairs += zip(form.roots, entry["roots"], strict=True)
    pairs += [(mp.degrees(x), y) for x, y in zip(form.theta_range, entry["theta_range_deg"], strict=True)]
    if "axis_xyz" in entry:
        pairs += zip(form.axis(entry["t"]), entry["axis_xyz"], strict=True)
        pairs += zip(form.quaternion(entry["t"]), entry["quaternion_wxyz"], strict=True)
    long_values = [(x, y) for x, y in pairs if len(y) > 20]
    assert len(long_values) >= 9
    last = [mp.mpf(10) ** Decimal(y).as_tuple().exponent for _, y in long_values]  # units of the last digits
    assert all(abs(x - mp.mpf(y)) <= unit for (x, y), unit in zip(long_values, last, strict=True))
    assert all(abs(x - mp.mpf(y)) < 1e-12 for x, y in pairs)


def test_every_scene_has_its_landmarks_and_a_state_to_thirty_digits():
    numbers = [[*map(float, (e["I1"], e["I3"], e["mgl"], *e["q0_theta_phi_psi"], *e["v0"]))] for e in TRUTH.values()]
    matches = {scene.name: np.isclose(numbers, flat(scene.top, scene.start), 1e-14, 0.0) for scene in scenes().values()}
    lacking = [name for name, rows in matches.items() if name not in added_scenes() and not rows.all(axis=1).any()]
    assert not lacking, f"tests/data/truth.json lacks {lacking}: add numbers that the closed form did not make"


def _times(form, random):
    """The start, next to a turning point, within two periods, up to 1000, and about -+1e6."""
    period = form.nutation_period if math.isfinite(form.nutation_period) else 1.0
    precise_phase = float(form.tau0 / form.K) if form.Omega else 0.0
    turning = (random.integers(0, 40) - precise_phase + 10.0 ** random.uniform(-12, 0)) * float(period) / 2.0
    return np.array([0.0, turning, random.uniform(0.0, 2.0) * float(period), random.uniform(0.0, 1e3),
                     random.choice([-1e6, 1e6]) * random.uniform(0.5, 1.0)])  # fmt: skip


def _excess(top, start, precise, times):
    """Largest error over its allowance, of theta, phi, psi, quaternion, axis."""
    form = ClosedForm(top, start)
    motion, attitude, axis = form(times), form.quaternion(times), form.axis(times)
    worst = np.zeros(5)
    for i, time in enumerate(times):
        true = precise(time)
        theta, phi, psi = (abs(ours[i] - exact) for ours, exact in zip(motion[:3], true[:3], strict=True))
        worst = np.maximum(worst, [
            float(theta) / (1e-15 if true.theta < 2.0 else 2.0 * math.ulp(math.pi)),
            float(phi / (EPS * abs(true.phi) + 1e-15)),
            float(psi / (EPS * abs(true.psi) + 1e-15)),
            float(max(abs(x - y) for x, y in zip(attitude[i], precise.quaternion(time), strict=True))) / 1e-15,
            float(max(abs(x - y) for x, y in zip(axis[i], precise.axis(time), strict=True))) / 1e-15,
        ])  # fmt: skip
    return worst


@pytest.mark.parametrize(("count", "seed"), [(1, 1), pytest.param(10, 2, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", REGIMES)
def test_double_precision_agrees_with_fifty_digits(kind, count, seed):
    random = np.random.default_rng([seed, REGIMES.index(kind)])
    for _ in range(count):
        top, start = random_top(kind, random)
        precise = PreciseForm(top, start, digits=50)
        excess = _excess(top, start, precise, _times(precise, random))
        assert (excess <= 1.0).all(), (top, start, excess)


@pytest.mark.parametrize("field", ["I1", "I3", "mgl"])
def test_a_parameter_wrong_in_the_thirteenth_digit_is_seen(field):
    top, start = SPHEROID
    precise, times = PreciseForm(top, start, digits=50), np.array([900.0])
    values = {name: getattr(top, name) for name in ("I1", "I3", "mgl")}
    values[field] *= 1.0 + 1e-13
    assert (_excess(top, start, precise, times) <= 1.0).all()
    assert _excess(SymmetricTop(**values), start, precise, times).max() > 20.0


@pytest.mark.parametrize("kind", [
    "generic", "fast", "nearly steady", "near the separatrix", "threshold of sleep", "grazes the top", "asleep",
    "pendulum to the top",
])  # fmt: skip
def test_as_many_digits_are_right_as_are_asked_for(kind):
    random = np.random.default_rng([4, REGIMES.index(kind)])
    top, start = random_top(kind, random)
    time = float(random.uniform(0.0, 1e3))
    short, long = PreciseForm(top, start, digits=30)(time), PreciseForm(top, start, digits=90)(time)
    with mp.workdps(110):
        assert all(abs(x - y) <= mp.mpf(10) ** -30 * max(1, abs(y)) for x, y in zip(short, long, strict=True))


@pytest.mark.parametrize("kind", [
    "generic", "turning point", "cusp", "plane pendulum", "grazes the top", "grazes the bottom", "through the top",
    "through the bottom", "flat body", "free", "hanging", "from the top", "asleep below", "nearly steady", "fast",
])  # fmt: skip
def test_an_integration_of_the_attitude_ends_where_the_closed_form_says(kind):
    pytest.importorskip("heyoka")
    top, start = random_top(kind, np.random.default_rng([6, REGIMES.index(kind)]))
    form, times = ClosedForm(top, start), np.linspace(0.1, 5.0, 21)
    states = integrate(Scene(kind.replace(" ", "-"), top, start, 5.0), times, "double")[0]
    reach = 1.0 + np.abs(states[:, 4:]).max()
    assert attitude_distance(form.quaternion(times), states[:, :4]).max() < 3e-13 * reach
    assert np.abs(form.momentum(times) - states[:, 4:]).max() < 3e-13 * reach
    assert attitude_distance(form.quaternion(times + 1e-9), states[:, :4]).max() > 1e-10


@pytest.mark.parametrize("body", [(2, 1, 2), (1, 2, 5), (3, 3, "0.7")])
def test_elementary_separatrix(body):
    """Released at 60 degrees onto it: Woodhouse, Introduction to Analytical Dynamics, problem 5.3.

    u = 1/(1 + sech gt); a start rounded in the 150th digit leaves it as exp(gt) times that.
    """
    with mp.workdps(150):
        I1, I3, mgl = map(mp.mpf, body)
        g = mp.sqrt(mgl / I1)
        start = mp.pi / 3, 0, 0, 0, 2 * g / mp.sqrt(3), (3 * I1 - I3) * g / (I3 * mp.sqrt(3))
        form = PreciseForm((I1, I3, mgl), start, digits=60)
        assert form.m < 1 < form.m + mp.mpf(10) ** -100
        for gt in (mp.mpf("0.5"), 3, 20):
            true_phi, q = mp.sqrt(3) / 2 * gt + mp.atan(mp.tanh(mp.mpf(gt) / 2) / mp.sqrt(3)), form(gt / g)
            assert abs(mp.cos(q.theta) - 1 / (1 + mp.sech(gt))) < mp.mpf(10) ** -60
            assert abs(q.phi - true_phi) < mp.mpf(10) ** -58
            assert abs(q.psi - (mp.sqrt(3) * gt * (I1 / I3 - 1) + true_phi)) < mp.mpf(10) ** -58
            assert abs(q.phi - true_phi - mp.mpf(10) ** -50) > mp.mpf(10) ** -51


def test_the_axis_stands_still_at_a_cusp():
    """Where phi' vanishes as t^2 it is no difference of its two fractions, whose rounding is 1e-15."""
    cusp = scene("cusp")
    times = cusp.nutation_period * np.linspace(-1e-4, 1e-4, 9)
    rates = [float(PreciseForm(cusp.top, cusp.start)(t)[4]) for t in times]
    np.testing.assert_allclose(ClosedForm(cusp.top, cusp.start)(times).phi_dot, rates, rtol=0.0, atol=1e-18)


def test_steady_precession_keeps_its_angles():
    top = SymmetricTop(1.0, 1.0, 8.0)  # I1 = I3 and mgl = I3 phi' psi': steady in exact arithmetic, at any inclination
    start = Angles(1.1, 0.3, 0.2, 0.0, 2.0, 4.0)
    form, times = ClosedForm(top, start), np.array([0.0, 1.0, 77.7])
    motion = form(times)
    assert form.theta_range[0] == form.theta_range[1] == motion.theta[2] == 1.1
    np.testing.assert_allclose(motion.phi, 0.3 + 2.0 * times, rtol=2 * EPS)
    np.testing.assert_allclose(motion.psi, 0.2 + 4.0 * times, rtol=2 * EPS)
    assert not motion.theta_dot.any()
    limit = ClosedForm(top, Angles(1.1, 0.3, 0.2, 1e-7, 2.0, 4.0)).nutation_period
    assert form.nutation_period == pytest.approx(limit, rel=1e-13)
    omega = math.sqrt(top.potential_curvature(1.1, top.momenta(start)) / top.I1)
    assert form.nutation_period == pytest.approx(2.0 * math.pi / omega, rel=1e-14)
    low, high = ClosedForm(top, Angles(1.1, 0.3, 0.2, 0.0, 2.0, 4.0 + 1e-12)).theta_range
    assert high - low > 1e-14


@pytest.mark.parametrize("gap", [1e-6, 1e-10, 1e-14])
def test_nearly_steady_precession_nutates_by_the_gap(gap):
    top = SymmetricTop(1.0, 1.0, 8.0)
    form = ClosedForm(top, Angles(1.1, 0.0, 0.0, 0.0, 2.0, 4.0 + gap))
    frequency2 = top.potential_curvature(1.1, top.momenta(form.start)) / top.I1
    push = math.sin(1.1) * (form.start.phi_dot * (form.start.psi_dot * top.I3) - top.mgl) / top.I1
    swing = 2.0 * abs(push) / frequency2 * math.sin(1.1)
    assert float(PreciseForm(top, form.start).curve.swing) == pytest.approx(swing, rel=1e-5 if gap > 1e-13 else 0.2)


@pytest.mark.parametrize(("w3", "stable"), [(2.5, True), (1.5, False), (2.0, False)])
def test_sleeping_top_stands_and_its_period_is_that_of_its_neighbours(w3, stable):
    top = SymmetricTop(1.0, 1.0, 1.0)  # threshold I3 w3 = 2 sqrt(I1 mgl) = 2
    form, times = ClosedForm(top, Angles(0.0, 0.2, 0.1, 0.0, 0.7, w3 - 0.7)), np.array([0.0, 3.0, 1e4])
    motion = form(times)
    assert not motion.theta.any()
    assert [*PreciseForm(top, Angles(0.0, psi_dot=w3)).roots] == sorted([1.0, 1.0, 0.5 * w3**2 - 1.0])
    np.testing.assert_allclose(motion.phi + motion.psi, 0.3 + w3 * times, rtol=2 * EPS)
    np.testing.assert_allclose(form.axis(times), [[0.0, 0.0, 1.0]] * 3, atol=0)
    nearby = ClosedForm(top, Angles(1e-6, 0.2, 0.1, 0.0, 0.5 * w3, 0.5 * w3))
    if stable:
        assert form.nutation_period == pytest.approx(math.pi / math.sqrt(w3**2 / 4.0 - 1.0), rel=1e-14)
        assert nearby.nutation_period == pytest.approx(form.nutation_period, rel=1e-9)
        assert nearby.theta_range[1] < 2e-6
    else:
        assert form.nutation_period == math.inf
        assert form.phi_per_period == form.psi_per_period == math.inf
        assert nearby.theta_range[1] > (0.5 if w3 < 2.0 else 9e-7)


@pytest.mark.parametrize("mgl", [1.0, 0.0, -1.0])
@pytest.mark.parametrize("theta", [0.0, math.pi, 1.0])
def test_a_top_without_motion(mgl, theta):
    """On the upper pole, or free, it stays where it is; pi in double is 1.2e-16 away from the lower one."""
    form, start = ClosedForm(SymmetricTop(1.0, 0.5, mgl), Angles(theta, 0.3, 0.2)), [theta, 0.3, 0.2, 0.0, 0.0, 0.0]
    motion = np.array(form([0.0, 1.0]))
    np.testing.assert_allclose(motion[:, 0], start, atol=2 * EPS)
    if mgl == 0.0 or theta == 0.0:
        np.testing.assert_allclose(motion[:, 1], start, atol=2 * EPS)
    else:
        assert np.abs(motion[:, 1] - start).max() > 1e-17
    assert np.isinf(form.nutation_period) == (mgl == 0.0 or (mgl > 0.0 and theta == 0.0))


@pytest.mark.parametrize("kind", [ClosedForm, PreciseForm])
@pytest.mark.parametrize("facing", [1.0, -1.0])
@pytest.mark.parametrize("rate", [2.0, -2.0])
def test_a_start_at_the_pole_moves_the_way_it_is_pushed(facing, rate, kind):
    form, soon = kind(SymmetricTop(1.0, 0.5, facing), Angles(0.0, 0.3, 0.0, rate, 0.0, 3.0)), 1e-6
    axis = [float(part) for part in form.axis(soon)]
    np.testing.assert_allclose(axis[:2], rate * soon * np.array([math.sin(0.3), -math.cos(0.3)]), rtol=1e-5)
    assert [float(value) for value in form(0.0)[:4]] == pytest.approx([0.0, 0.3, 0.0, rate], rel=2 * EPS)


@pytest.mark.parametrize("kind", REGIMES)
def test_views_of_one_motion_and_theta_functions_agree(kind):
    random = np.random.default_rng([3, REGIMES.index(kind)])
    top, start = random_top(kind, random)
    form = PreciseForm(top, start, digits=50)
    for time in _times(form, random)[[1, 4]]:
        gap = max(abs(x - y) for x, y in zip(form.quaternion(time), theta_quaternion(form, time), strict=True))
        assert gap < mp.mpf(10) ** -50
    backwards = PreciseForm(top, dataclasses.replace(start, theta_dot=-start.theta_dot))
    if form.curve.swing > 1e-3 and start.theta_dot:
        gap = max(abs(x - y) for x, y in zip(form.quaternion(1.7), theta_quaternion(backwards, 1.7), strict=True))
        assert gap > 1e-10
    top, start = random_top(kind, np.random.default_rng([7, REGIMES.index(kind)]))
    form, times = ClosedForm(top, start), np.linspace(-3.0, 9.0, 401)
    motion, attitude, axis, momentum = form(times), form.quaternion(times), form.axis(times), form.momentum(times)
    grain = 4 * EPS * (1.0 + np.abs([motion.phi, motion.psi]).max())
    assert attitude_distance(charts.quaternion_from_angles(*motion[:3]), attitude).max() < 2 * grain
    np.testing.assert_allclose(charts.axis_from_quaternion(attitude), axis, atol=8 * EPS)
    np.testing.assert_allclose(charts.axis_from_angles(motion.theta, motion.phi), axis, atol=2 * grain)
    size, momenta = np.linalg.norm(momentum, axis=-1).max(), top.momenta(start)
    np.testing.assert_allclose(momentum[:, 2], momenta.p_phi, atol=16 * EPS * size)
    np.testing.assert_allclose(np.sum(momentum * axis, axis=-1), momenta.p_psi, atol=16 * EPS * size)
    first = charts.space_state("axis", top, start)[3:]
    np.testing.assert_allclose(form.momentum(0.0), first, atol=16 * EPS * max(size, 1e-300))
    assert motion.theta.min() >= form.theta_range[0] - 4 * EPS
    assert motion.theta.max() <= form.theta_range[1] + 4 * EPS


def test_a_free_top_precesses_about_its_momentum_and_one_period_adds_the_precession_and_the_spin():
    top, start = SymmetricTop(2.0, 1.3, 0.0), Angles(1.0, 0.2, 0.3, 0.4, 0.5, 3.0)
    form, times = ClosedForm(top, start), np.linspace(0.0, 1e4, 11)
    momentum = charts.space_state("axis", top, start)[3:]
    np.testing.assert_allclose(form.momentum(times), [momentum] * 11, atol=8 * EPS * np.linalg.norm(momentum))
    assert form.nutation_period == pytest.approx(2.0 * math.pi * top.I1 / np.linalg.norm(momentum), rel=2 * EPS)
    form = PreciseForm(*SPHEROID, digits=40)
    first, second = form("0.4"), form(mp.mpf("0.4") + form.nutation_period)
    assert abs(second.theta - first.theta) < 1e-38
    assert abs(second.phi - first.phi - form.phi_per_period) < 1e-38
    assert abs(second.psi - first.psi - form.psi_per_period) < 1e-38
    double = ClosedForm(*SPHEROID)
    assert double.nutation_period == float(form.nutation_period)
    assert (double.phi_per_period, double.psi_per_period) == (float(form.phi_per_period), float(form.psi_per_period))


@pytest.mark.parametrize(("body", "state", "words"), [
    (("1", "1"), ("1", 0, 0, 0, 0, 0), "numbers"),
    (("1", "x", "1"), ("1", 0, 0, 0, 0, 0), "I3 must be a finite number"),
    (("1", "1", math.nan), ("1", 0, 0, 0, 0, 0), "mgl must be a finite number"),
    (("1", "2.1", "1"), ("1", 0, 0, 0, 0, 0), "I3 must be at most"),
    (("1", "1", "1"), ("3.2", 0, 0, 0, 0, 0), "theta must lie in"),
])  # fmt: skip
def test_values_outside_the_model_are_refused(body, state, words):
    with pytest.raises(SymtopError, match=words):
        PreciseForm(body, state)


def test_kinds_of_numbers_and_the_working_precision_of_the_caller_do_not_matter():
    mixed = PreciseForm((mp.mpf(2), 1, "26.5"), ("0.5", 0.125, mp.mpf("0.25"), "0", 10, -0.5))
    floats = PreciseForm(SymmetricTop(2.0, 1.0, 26.5), Angles(0.5, 0.125, 0.25, 0.0, 10.0, -0.5))
    assert mixed("1.5") == floats(mp.mpf(1.5)) == floats(1.5)
    decimal, double = (PreciseForm((2, 1, "26.5"), (theta, 0, 0, 0, 10, 0)) for theta in ("0.1", 0.1))
    assert decimal(1) != double(1)
    with mp.workdps(5):
        low = PreciseForm(*SPHEROID, digits=40)(8)
        assert mp.mp.dps == 5
    assert low == PreciseForm(*SPHEROID, digits=40)(8)
