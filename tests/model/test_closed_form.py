"""The closed form of a top and of many: arithmetic and accuracy, and the same bits compiled, in bulk, in threads."""

import itertools
import math
import threading
from concurrent.futures import ThreadPoolExecutor

import mpmath as mp
import numpy as np
import pytest

import symtop
from benchmarks import accuracy
from benchmarks.accuracy import LIMITS, deviation, short
from benchmarks.families import REGIMES, tops
from symtop.model import charts
from symtop.model.charts import space_momenta
from symtop.model.exact import closed_form, constants, double_double, elliptic, layout as at, samples, turning_points
from symtop.model.exact.closed_form import NUMBERS, ClosedForm, ClosedForms
from symtop.model.exact.digits import PreciseForm, precise_constants
from symtop.model.lazy_kernel import LazyKernel
from symtop.model.scenes import grazing, scene, sleeping
from symtop.model.top import Angles, SymmetricTop, flat, is_loose
from symtop.run.reference.truth import ROUNDING
from tests.commands import ROOT, printed_by

EPS = float(np.finfo(float).eps)
SEPARATRIX = SymmetricTop(1.0, 0.5, -1.0), Angles(0.0, theta_dot=2.0)


def _double(monkeypatch):
    """Double arithmetic in place of double-double."""
    doubles = {"add": lambda a, b: (a[0] + b[0], 0.0), "sub": lambda a, b: (a[0] - b[0], 0.0),
               "mul": lambda a, b: (a[0] * b[0], 0.0), "div": lambda a, b: (a[0] / b[0], 0.0),
               "square": lambda a: (a[0] * a[0], 0.0), "root": lambda a: (math.sqrt(max(a[0], 0.0)), 0.0)}  # fmt: skip
    for module in (turning_points, elliptic, constants, double_double):
        for name, function in doubles.items():
            if hasattr(module, name):
                monkeypatch.setattr(module, name, function)


def test_double_arithmetic_in_place_of_double_double_is_seen(monkeypatch):
    for top, start in tops(1, 22, ["generic", "grazes the top"]):
        precise = precise_constants(top, start)
        assert (deviation(short(top, start)[0], precise) <= LIMITS).all()
        with monkeypatch.context() as patch:
            _double(patch)
            for module, name in itertools.product((constants, turning_points), ("RATE", "VALUE")):
                patch.setattr(module, name, math.inf)
            ours, status = short(top, start)
        assert status == constants.UNMET or deviation(ours, precise)[0] > 1e-18


def test_the_bound_sends_tops_to_quad_double_that_need_it(monkeypatch):
    """With double-double sums alone the rates of some of them are wrong; the bound says so of every one."""
    misses, longer = 0, 0
    kinds = ["nearly steady", "near the separatrix", "threshold of sleep", "pendulum to the top"]
    for top, start in tops(4, 23, kinds):
        ours, _ = short(top, start)
        if ours[at.ARITHMETIC] != at.QUAD_DOUBLE:
            continue
        longer += 1
        true = precise_constants(top, start)
        assert (deviation(ours, true) <= LIMITS).all()
        with monkeypatch.context() as patch:
            patch.setattr(turning_points, "long_sums", turning_points.short_sums)
            for module, name in itertools.product((constants, turning_points), ("RATE", "VALUE")):
                patch.setattr(module, name, math.inf)
            rounded, status = short(top, start)
        assert status != constants.DONE or max(rounded[at.RATE_ERROR], rounded[at.VALUE_ERROR]) > turning_points.RATE
        misses += status != constants.DONE or (deviation(rounded, true) > LIMITS).any()
    assert longer >= 4
    assert misses >= 1


def test_the_arithmetic_is_recorded():
    assert ClosedForm(scene("spheroid").top, scene("spheroid").start).provenance.arithmetic == "double-double"
    steady = scene("steady")
    provenance = ClosedForm(steady.top, steady.start).provenance
    assert provenance.arithmetic == "quad-double"
    assert 0.0 <= provenance.rate_error < turning_points.RATE
    far = ClosedForm(SymmetricTop(1.0, 0.5, 1.0), Angles(1.0, 3e12, 0.2, 0.3, 0.4, 0.5))
    assert (far.provenance.arithmetic, far.provenance.rate_error) == ("40 digits", closed_form.DIGITS_ERROR)
    assert "range" in far.provenance.reason
    asleep = ClosedForm(SymmetricTop(1.0, 1.0, 1.0), Angles(0.0, psi_dot=2.0))  # I3 w3 = 2 sqrt(I1 mgl)
    assert asleep.provenance.arithmetic == "40 digits"
    assert "tell the turning points apart" in asleep.provenance.reason
    assert ClosedForm(*SEPARATRIX).provenance == ("double", 0.0, "")


@pytest.mark.parametrize("named", [
    scene("spheroid"), scene("steady"), sleeping(2.05), sleeping(1.9), grazing(1e-4), grazing(-1e-12)])  # fmt: skip
def test_the_last_resort_gives_the_same_motion(named, monkeypatch):
    times, ours = np.linspace(-20.0, 1e3, 301), ClosedForm(named.top, named.start)
    monkeypatch.setattr(constants, "motion_constants", lambda *_: constants.UNMET)
    monkeypatch.setattr(closed_form._build, "ready", lambda _: False)
    digits = ClosedForm(named.top, named.start)
    assert ours.provenance.arithmetic != digits.provenance.arithmetic == "40 digits"
    for name in ("nutation_period", "phi_per_period", "psi_per_period", "theta_range"):
        assert getattr(ours, name) == getattr(digits, name)
    for first, second in zip(ours(times), digits(times), strict=True):
        np.testing.assert_allclose(first, second, rtol=EPS, atol=4 * EPS)
    np.testing.assert_allclose(ours.axis(times), digits.axis(times), rtol=0, atol=2 * EPS)


def test_compiled_and_interpreted_functions_give_the_same_bits():
    closed_form.compile_now()
    times = np.array([0.0, 0.3, -17.1, 1e3, 1e6, 1e17])
    for top, start in [*tops(4, seed=24), SEPARATRIX]:
        record, status = short(top, start)
        out = np.empty((1, at.SIZE))
        closed_form._build.compiled(np.array([flat(top, start)]), out)
        record[at.STATUS] = status
        assert out.tobytes() == record.tobytes()
        if status != constants.DONE:
            continue
        for view, width in enumerate(samples.WIDTHS):
            shape = (1, width, times.size) if view in samples.ROWS else (1, times.size, width)
            ours, theirs = np.empty(shape), np.empty(shape)
            samples.all_samples([record.tolist()], [times.tolist()], view, ours)
            closed_form._fill.compiled(out, times[None], view, theirs)
            assert ours.tobytes() == theirs.tobytes()
        axes = np.random.default_rng(3).normal(size=(1, times.size, 3))
        axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
        ours, theirs = np.empty((1, times.size)), np.empty((1, times.size))
        samples.all_gaps([record.tolist()], [times.tolist()], axes, ours)
        closed_form._compare.compiled(out, times[None], axes, theirs)
        assert ours.tobytes() == theirs.tobytes()


@pytest.mark.parametrize("numbers", [
    (1.0, 0.5, 1.0, math.nan, 0.0, 0.0, 0.0, 0.0, 0.0), (1.0, 0.5, 1e-70, 1.0, 0.0, 0.0, 0.1, 0.2, 0.3),
    (1e-40, 1e-40, 1e40, 1.0, 0.0, 0.0, 1e40, -1e40, 1e40), (1.0, 0.5, 1.0, 1e-130, 0.0, 0.0, 0.0, 1e-59, 1e-59),
    (1.0, 0.5, 1e40, 3.0, 0.0, 0.0, 1e-59, 0.0, 0.0), (1e40, 1e40, 1e-59, 1.0, 0.0, 0.0, 1e-59, 1e40, 1e-59),
])  # fmt: skip
def test_values_at_the_ends_of_the_range_end_in_a_status(numbers):
    """Neither way raises, and both say the same."""
    closed_form.compile_now()
    record, out = [0.0] * at.SIZE, np.empty((1, at.SIZE))
    failed = closed_form._build.compiled(np.array([numbers]), out)
    status = constants.motion_constants(numbers, record)
    assert out[0, at.STATUS] == status
    assert failed == (status != constants.DONE)
    assert status in closed_form.REASONS


def test_a_few_forms_import_no_slow_library_and_many_samples_are_worth_compiling(monkeypatch):
    code = (
        "import sys, symtop\n"
        "for scene in symtop.scenes().values(): symtop.ClosedForm(scene.top, scene.start).axis([0.0, 1.0])\n"
        "print(*({'numba', 'mpmath', 'scipy', 'heyoka'} & set(sys.modules)))"
    )
    assert printed_by(code, cwd=ROOT).strip() == ""
    kernel = closed_form.LazyKernel(samples.all_samples, closed_form._fill.arguments, patience=0.2)
    monkeypatch.setattr(kernel, "_worth", lambda: kernel.patience)
    assert not kernel.ready(0.1)
    monkeypatch.setattr(kernel, "compile", lambda: setattr(kernel, "compiled", True))
    assert kernel.ready(0.11)
    assert kernel.ready(0.0)


def test_what_another_process_has_compiled_is_loaded_before_patience_ends(monkeypatch, tmp_path):
    monkeypatch.setenv("SYMTOP_CACHE", str(tmp_path))
    waiting, compiler = (LazyKernel(charts._unwrap, charts._unwrapper.arguments, patience=100.0) for _ in range(2))
    assert not waiting.ready(10.0)
    compiler.compile()
    assert not waiting.ready(1.0)  # it looks at the cache again when it has spent as much again
    assert waiting.ready(10.0)
    assert waiting.compiled is not None


@pytest.mark.parametrize("rate", [2.0, -2.0])
def test_the_exact_separatrix_climbs_for_ever(rate):
    """theta = 4 atan tanh(g t/2), g = sqrt(abs(mgl)/I1), in double and in 40 digits; a pole is passed at time 0."""
    top, start = SymmetricTop(4.0, 2.5, -4.0), Angles(0.0, 0.3, 0.2, rate, 0.7, -0.7)
    form, precise = ClosedForm(top, start), PreciseForm(top, start)
    times = np.array([-30.0, -1.0, 0.0, 1e-9, 0.5, 3.0, 40.0])
    motion, axis = form(times), form.axis(times)
    assert precise.climbs
    assert form.nutation_period == precise.nutation_period == math.inf
    assert form.theta_range == (0.0, math.pi)
    assert form.phi_per_period == 0.0
    for i, time in enumerate(times):
        true = precise(time)
        with mp.workdps(50):
            assert abs(true.theta - 4 * mp.atan(mp.tanh(abs(mp.mpf(time)) / 2))) < 1e-28
        for ours, theirs in zip(motion, true, strict=True):
            assert abs(ours[i] - float(theirs)) <= 4 * EPS
        np.testing.assert_allclose(axis[i], [float(x) for x in precise.axis(time)], atol=2 * EPS)
    energy = 0.5 * top.I1 * motion.theta_dot**2 + top.mgl * np.cos(motion.theta)
    np.testing.assert_allclose(energy, top.energy(start), rtol=4 * EPS)
    assert np.sign(motion.theta_dot).tolist() == [-1.0, -1.0, math.copysign(1.0, rate), 1.0, 1.0, 1.0, 1.0]
    np.testing.assert_allclose(form.momentum(0.0), 4.0 * rate * np.array([math.cos(0.3), math.sin(0.3), 0.0]),
                               rtol=4 * EPS)  # fmt: skip


def test_a_scene_on_the_separatrix_is_simulated_and_has_a_reference(monkeypatch, tmp_path):
    climbing = symtop.Scene("climbing", *SEPARATRIX, 5.0)
    run = symtop.simulate(climbing, "strang", step_size=0.01)
    closed_form.compile_now()
    monkeypatch.setenv("SYMTOP_CACHE", str(tmp_path))  # it holds no reference
    assert run.attrs["outcome"] == "ok"
    assert np.abs(np.arccos(run["axis"].values[:, 2]) - 4.0 * np.arctan(np.tanh(0.5 * run["time"].values))).max() < 1e-3
    truth = symtop.reference(climbing, [0.0, 1.0, 5.0], precision="closed-form")
    np.testing.assert_allclose(truth["theta"], 4.0 * np.arctan(np.tanh([0.0, 0.5, 2.5])), atol=4 * EPS)
    assert truth["theta_error_bound"].max() < 1e-13


def test_next_to_the_separatrix_the_motion_is_periodic():
    top, start = SEPARATRIX
    assert top.nutation_period(start) == ClosedForm(top, start).nutation_period == math.inf
    assert ClosedForm(top, start)(1.0).theta == pytest.approx(4.0 * math.atan(math.tanh(0.5)), rel=EPS)
    for rate in (math.nextafter(2.0, 0.0), math.nextafter(2.0, 3.0)):
        form = ClosedForm(top, Angles(0.0, theta_dot=rate))
        assert 30.0 < form.nutation_period < 100.0
        assert abs(form(1.0).theta - ClosedForm(top, start)(1.0).theta) < 1e-15
    T = [ClosedForm(top, Angles(0.0, theta_dot=2.0, psi_dot=10.0**-k)).nutation_period for k in (9, 74.5, 140)]
    assert T[0] < 100.0
    assert T[2] - T[1] == pytest.approx(T[1] - T[0], rel=1e-12)  # a logarithm


@pytest.mark.parametrize(("start", "rest"), [
    (Angles(1.0, 0.0, 0.0, 1e-144, 1.0, 1.0), Angles(1.0, phi_dot=1.0, psi_dot=1.0)),
    (Angles(1.0, phi_dot=1e-143), Angles(1.0)),
])  # fmt: skip
def test_a_start_that_all_but_rests_moves_as_from_rest_and_a_rate_of_1e_300_is_refused(start, rest):
    top, times = SymmetricTop(1.0, 1.0, 1.0), np.linspace(0.0, 7.0, 29)
    near, still = (ClosedForm(top, angles)(times).theta for angles in (start, rest))
    np.testing.assert_allclose(near, still, rtol=0.0, atol=4 * EPS)
    with pytest.raises(symtop.SymtopError, match="must meet a pole or miss it"):
        ClosedForm(top, Angles(1.0, phi_dot=1e-300))


@pytest.mark.parametrize("spin", [0.0, 1.0, 1.9])
def test_the_period_of_a_scene_is_that_of_the_closed_form_where_rounding_may_move_it_and_there_alone(spin):
    for tilt in 10.0 ** -np.arange(2.0, 8.0, 0.25):
        case = sleeping(spin, tilt)
        exact, rounded = ClosedForm(case.top, case.start).nutation_period, case.top.nutation_period(case.start)
        loose = is_loose(case.top, case.start, *case.top.turning_cosines(case.start))
        assert loose or math.isclose(rounded, exact, rel_tol=1e-6)
        assert not loose or tilt < 1e-4
        assert case.nutation_period == (exact if abs(rounded / exact - 1.0) > 1e-6 else rounded)
    assert not math.isclose(rounded, exact, rel_tol=1e-5)  # what it replaces


def test_after_as_many_turns_as_doubles_count_the_attitude_is_within_its_bound():
    case, limit = scene("spheroid"), 2.0**52
    form, precise = ClosedForm(case.top, case.start), PreciseForm(case.top, case.start, 60)
    times = np.random.default_rng(0).uniform(limit, 2.0 * limit, 12) * form.nutation_period / 4.0
    true = np.array([[float(part) for part in precise.quaternion(float(time))] for time in times])
    assert charts.attitude_distance(form.quaternion(times), true).max() < 1e-14


@pytest.mark.parametrize("count", [1, pytest.param(40, marks=pytest.mark.slow)])
def test_every_family_keeps_the_accuracy_that_is_claimed(count):
    """So many of each; `python -m benchmarks.accuracy` measures ten thousand."""
    accuracies = accuracy.measure(count, jobs=1)
    assert (accuracies.tops, accuracies.broken) == (count * len(REGIMES), [])
    assert accuracies.share("double-double") > 0.7
    assert accuracies.share("40 digits") == 0.0
    assert all(accuracies.largest(name) < 0.6 * bound for name, bound in ROUNDING.items() if name != "attitude")


def test_a_form_that_is_wrong_in_the_fifteenth_digit_breaks_the_claim(monkeypatch):
    honest = accuracy.ClosedForm

    def wrong(top, start):
        form = honest(top, start)
        form._constants[at.SCALE] *= 1.0 + 3e-15
        return form

    monkeypatch.setattr(accuracy, "ClosedForm", wrong)
    assert accuracy.examine("generic", 2, 0).broken


TIMES = np.array([0.0, 0.3, -17.1, 1e3, 1e6])
REFUSED = SymmetricTop(1.0, 0.5, 1.0), Angles(1e-160, 0.0, 0.0, 0.3, 0.4, 0.5)  # misses the pole by too little
ASLEEP = SymmetricTop(1.0, 1.0, 1.0), Angles(0.0, psi_dot=2.0)  # needs 40 digits


def _pairs(count):
    return [*tops(count, seed=31), SEPARATRIX, ASLEEP]


@pytest.fixture(params=["compiled", "interpreted"])
def implementation(request, monkeypatch):
    closed_form.compile_now()
    if request.param == "interpreted":
        for kernel in (closed_form._build, closed_form._fill, closed_form._compare):
            monkeypatch.setattr(kernel, "ready", lambda _: False)


def test_a_member_has_the_bits_of_its_own_form(implementation):
    pairs = _pairs(2)
    forms = ClosedForms([flat(*pair) for pair in pairs])
    assert len(forms) == len(pairs)
    motion, period, ends = forms(TIMES), forms.nutation_period, forms.theta_range
    views = {name: getattr(forms, name)(TIMES) for name in ("axis", "quaternion", "momentum", "state")}
    for i, pair in enumerate(pairs):
        form = ClosedForm(*pair)
        assert (period[i], forms.precession_rate[i]) == (form.nutation_period, form.precession_rate)
        assert (forms.phi_per_period[i], forms.psi_per_period[i]) == (form.phi_per_period, form.psi_per_period)
        assert (tuple(ends[i]), forms.arithmetic[i]) == (form.theta_range, form.provenance.arithmetic)
        for ours, theirs in zip(motion, form(TIMES), strict=True):
            assert ours[i].tobytes() == theirs.tobytes()
        for ours, theirs, angle in zip(forms.turns(TIMES), form.turns(TIMES), (motion.phi, motion.psi), strict=True):
            assert ours[i].tobytes() == theirs.tobytes() == angle[i].tobytes()
        for name, values in views.items():
            assert values[i].tobytes() == getattr(form, name)(TIMES).tobytes()
    assert (forms.refused, forms.arithmetic[-2:]) == ({}, ["double", "40 digits"])


def test_the_mean_precession_is_that_of_a_period_and_each_member_may_have_times_of_its_own():
    forms = ClosedForms([flat(*pair) for pair in _pairs(1) if math.isfinite(ClosedForm(*pair).nutation_period)])
    period = forms.nutation_period
    np.testing.assert_allclose(forms.precession_rate * period, forms.phi_per_period, rtol=1e-14, atol=1e-300)
    growth = np.diff(forms(np.stack([0.21 * period, 1.21 * period], axis=1)).phi, axis=1)[:, 0]
    gap = (growth - forms.phi_per_period) / math.pi  # phi jumps by pi where the axis passes through a pole
    assert np.abs(gap - np.rint(gap)).max() < 1e-12
    forms = ClosedForms([flat(*pair) for pair in _pairs(1)])
    times = np.random.default_rng(5).uniform(-10.0, 10.0, (len(forms), 7))
    axes, strided = forms.axis(times), forms.axis(np.repeat(times, 2, axis=1)[:, ::2])
    assert axes.tobytes() == strided.tobytes()
    for i in (0, len(forms) - 1):
        assert axes[i].tobytes() == forms.axis(times[i])[i].tobytes()
    assert forms(times).theta.shape == (len(forms), 7)
    forms = ClosedForms([flat(*SEPARATRIX), flat(*ASLEEP)])
    for times in ([[0.0, 1.0]], [[0.0], [1.0], [2.0]], [[[0.0]]]):
        with pytest.raises(symtop.SymtopError, match=r"shape \(2, samples\)"):
            forms.axis(times)
    with pytest.raises(symtop.SymtopError, match="must be finite numbers of at most 1e\\+100 in size, not inf"):
        forms.axis([[0.0, 1.0], [0.0, math.inf]])


def test_a_member_without_a_form_fails_alone():
    forms = ClosedForms([flat(*SEPARATRIX), flat(*REFUSED), flat(*SEPARATRIX)])
    assert list(forms.refused) == [1]
    assert "must meet a pole or miss it by 1e-145" in forms.refused[1]
    assert forms.arithmetic[1] == ""
    assert np.isnan(forms.nutation_period[1])
    for values in (forms.state(TIMES), forms.axis(TIMES), forms(TIMES).phi):
        assert np.isnan(values[1]).all()
        assert np.isfinite(values[[0, 2]]).all()


@pytest.mark.parametrize(("column", "value", "words"), [
    ("I1", -1.0, "member 1: I1 must be above zero, not -1.0"), ("I3", 2.5, "member 1: I3 must be at most 2 I1"),
    ("mgl", math.nan, "member 1: mgl must be a finite number"), ("theta", 3.2, "member 1: theta must lie in"),
    ("psi_dot", 1e41, "member 1: psi_dot must be between"),
])  # fmt: skip
def test_a_row_that_is_no_top_is_named(column, value, words):
    rows = np.array([flat(*ASLEEP)] * 3)
    rows[1, NUMBERS.index(column)] = value
    with pytest.raises(symtop.SymtopError, match=words):
        ClosedForms(rows)
    with pytest.raises(symtop.SymtopError, match=r"shape \(n, 9\)"):
        ClosedForms(rows[:, :8])


def test_no_members_and_no_times_are_no_trouble(implementation):
    assert ClosedForms(np.empty((0, 9))).axis(TIMES).shape == (0, 5, 3)
    assert ClosedForms([flat(*ASLEEP)]).state([]).shape == (1, 0, 7)


def test_distances_from_an_axis_are_those_of_the_chart(implementation):
    """However small: an axis turned by 1e-12 is 1e-12 away; and strided axes, as a state has them, by one kernel."""
    forms = ClosedForms([flat(*pair) for pair in _pairs(1)])
    axes, turn = forms.axis(TIMES[1:4]), 1e-12
    across = np.cross(axes, [0.36, 0.48, 0.8])
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    states = np.concatenate([math.cos(turn) * axes + math.sin(turn) * across, axes], axis=-1)
    gap = closed_form.distances(forms.constants, TIMES[None, 1:4], states[..., :3])
    np.testing.assert_allclose(gap, turn, rtol=1e-3)
    np.testing.assert_allclose(closed_form.distances(forms.constants, TIMES[None, 1:4], -axes), math.pi, atol=1e-15)
    assert len(getattr(closed_form._compare.compiled, "overloads", [0])) == 1
    assert ClosedForm(*_pairs(1)[0]).axis_distance(TIMES[1:4], states[0, :, :3]).tobytes() == gap[0].tobytes()


def test_members_momenta_and_threads():
    """A kernel that several threads ask for at once is made once, and none of them sees half of it."""
    rows = np.array([flat(*pair) for pair in _pairs(1)])
    expected = ClosedForms(rows).state(TIMES).tobytes()
    forms, begin = ClosedForms(rows), threading.Barrier(8)
    kernel = LazyKernel(samples.all_samples, closed_form._fill.arguments, patience=1e9)

    def work(_):
        begin.wait()
        kernel.compile()
        assert kernel.compiled is not None
        return forms.state(TIMES).tobytes(), ClosedForms(rows).state(TIMES).tobytes()

    with ThreadPoolExecutor(8) as pool:
        for result in pool.map(work, range(8)):
            assert result == (expected, expected)
    forms = ClosedForms([flat(*pair) for pair in _pairs(1)])
    states, momenta = forms.run(TIMES)
    assert states.tobytes() == forms.state(TIMES).tobytes()
    p_phi, p_psi = space_momenta("attitude", states)
    np.testing.assert_array_equal(momenta[..., 0], p_phi)
    size = np.abs(states[..., 4:]).max()
    np.testing.assert_allclose(momenta[..., 1], p_psi, rtol=0, atol=4e-16 * size)
    np.testing.assert_allclose(momenta[..., 1], np.broadcast_to(forms.p_psi[:, None], p_psi.shape), atol=8e-16 * size)
