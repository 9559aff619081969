"""Closed forms of many tops: the bits of each alone, from one call, in any thread; a bad member is named."""

import math
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from benchmarks.families import tops
from symtop.core.errors import SymtopError
from symtop.model import charts
from symtop.model.charts import space_momenta
from symtop.model.exact import closed_form, samples
from symtop.model.exact.closed_form import NUMBERS, ClosedForm, ClosedForms
from symtop.model.lazy_kernel import LazyKernel
from symtop.model.top import Angles, SymmetricTop, flat
from tests.model.test_closed_form import SEPARATRIX

TIMES = np.array([0.0, 0.3, -17.1, 1e3, 1e6])
REFUSED = SymmetricTop(1.0, 0.5, 1.0), Angles(1e-160, 0.0, 0.0, 0.3, 0.4, 0.5)  # misses the pole by too little
ASLEEP = SymmetricTop(1.0, 1.0, 1.0), Angles(0.0, psi_dot=2.0)  # needs 40 digits


def _pairs(count):
    return [*tops(count, seed=31), SEPARATRIX, ASLEEP]


@pytest.fixture(params=["compiled", "interpreted"])
def implementation(request, monkeypatch):
    closed_form.compile_now()
    if request.param == "interpreted":
        monkeypatch.setattr(closed_form._build, "ready", lambda _: False)
        monkeypatch.setattr(closed_form._fill, "ready", lambda _: False)
        monkeypatch.setattr(closed_form._compare, "ready", lambda _: False)


def test_a_member_has_the_bits_of_its_own_form(implementation):
    pairs = _pairs(2)
    forms = ClosedForms([flat(*pair) for pair in pairs])
    assert len(forms) == len(pairs)
    motion, period, ends = forms(TIMES), forms.nutation_period, forms.theta_range
    views = {name: getattr(forms, name)(TIMES) for name in ("axis", "quaternion", "momentum", "state")}
    for i, pair in enumerate(pairs):
        form = ClosedForm(*pair)
        assert period[i] == form.nutation_period
        assert forms.precession_rate[i] == form.precession_rate
        assert forms.phi_per_period[i] == form.phi_per_period
        assert forms.psi_per_period[i] == form.psi_per_period
        assert tuple(ends[i]) == form.theta_range
        assert forms.arithmetic[i] == form.provenance.arithmetic
        for ours, theirs in zip(motion, form(TIMES), strict=True):
            assert ours[i].tobytes() == theirs.tobytes()
        for ours, theirs, same in zip(forms.turns(TIMES), form.turns(TIMES), (motion.phi, motion.psi), strict=True):
            assert ours[i].tobytes() == theirs.tobytes() == same[i].tobytes()
        for name, values in views.items():
            assert values[i].tobytes() == getattr(form, name)(TIMES).tobytes()
    assert forms.refused == {}
    assert forms.arithmetic[-2:] == ["double", "40 digits"]


def test_the_mean_precession_is_that_of_a_period():
    forms = ClosedForms([flat(*pair) for pair in _pairs(1) if math.isfinite(ClosedForm(*pair).nutation_period)])
    period = forms.nutation_period
    np.testing.assert_allclose(forms.precession_rate * period, forms.phi_per_period, rtol=1e-14, atol=1e-300)
    grown = np.diff(forms(np.stack([0.21 * period, 1.21 * period], axis=1)).phi, axis=1)[:, 0]
    gap = (grown - forms.phi_per_period) / math.pi  # phi jumps by pi where the axis passes through a pole
    assert np.abs(gap - np.rint(gap)).max() < 1e-12


def test_each_member_may_have_times_of_its_own():
    forms = ClosedForms([flat(*pair) for pair in _pairs(1)])
    times = np.random.default_rng(5).uniform(-10.0, 10.0, (len(forms), 7))
    each, strided = forms.axis(times), forms.axis(np.repeat(times, 2, axis=1)[:, ::2])
    assert each.tobytes() == strided.tobytes()
    for i in (0, len(forms) - 1):
        assert each[i].tobytes() == forms.axis(times[i])[i].tobytes()
    assert forms(times).theta.shape == (len(forms), 7)


def test_one_row_of_times_does_not_pass_for_a_row_of_each_member():
    forms = ClosedForms([flat(*SEPARATRIX), flat(*ASLEEP)])
    for bad in ([[0.0, 1.0]], [[0.0], [1.0], [2.0]], [[[0.0]]]):
        with pytest.raises(SymtopError, match=r"shape \(2, samples\)"):
            forms.axis(bad)
    with pytest.raises(SymtopError, match="must be finite numbers of at most 1e\\+100 in size, not inf"):
        forms.axis([[0.0, 1.0], [0.0, math.inf]])


def test_a_member_without_a_form_fails_alone():
    closed_form.compile_now()
    forms = ClosedForms([flat(*SEPARATRIX), flat(*REFUSED), flat(*ASLEEP)])
    assert list(forms.refused) == [1]
    assert "must meet a pole or miss it by 1e-145" in forms.refused[1]
    assert forms.arithmetic[1] == ""
    assert np.isnan(forms.nutation_period[1])
    for values in (forms.state(TIMES), forms.axis(TIMES), forms(TIMES).phi):
        assert np.isnan(values[1]).all()
        assert np.isfinite(values[[0, 2]]).all()


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("I1", -1.0, "member 1: I1 must be above zero, not -1.0"),
        ("I3", 2.5, "member 1: I3 must be at most 2 I1"),
        ("mgl", math.nan, "member 1: mgl must be a finite number"),
        ("theta", 3.2, "member 1: theta must lie in"),
        ("psi_dot", 1e41, "member 1: psi_dot must be between"),
    ],
)
def test_a_row_that_is_no_top_is_named(column, value, words):
    rows = np.array([flat(*ASLEEP)] * 3)
    rows[1, NUMBERS.index(column)] = value
    with pytest.raises(SymtopError, match=words):
        ClosedForms(rows)
    with pytest.raises(SymtopError, match=r"shape \(n, 9\)"):
        ClosedForms(rows[:, :8])


def test_no_members_and_no_times_are_no_trouble(implementation):
    assert ClosedForms(np.empty((0, 9))).axis(TIMES).shape == (0, 5, 3)
    assert ClosedForms([flat(*ASLEEP)]).state([]).shape == (1, 0, 7)


def test_threads_share_forms_and_kernels():
    """A kernel that several threads ask for at once is made once, and none of them sees half of it."""
    rows = np.array([flat(*pair) for pair in _pairs(1)])
    alone = ClosedForms(rows).state(TIMES).tobytes()
    forms, begin = ClosedForms(rows), threading.Barrier(8)
    kernel = LazyKernel(samples.all_samples, closed_form._fill.arguments, patience=1e9)

    def work(_):
        begin.wait()
        kernel.compile()
        assert kernel.compiled is not None
        return forms.state(TIMES).tobytes(), ClosedForms(rows).state(TIMES).tobytes()

    with ThreadPoolExecutor(8) as pool:
        for result in pool.map(work, range(8)):
            assert result == (alone, alone)


def test_distances_from_an_axis_are_those_of_the_chart(implementation):
    """However small: an axis turned by 1e-12 is 1e-12 away; and strided axes, as a state has them."""
    forms = ClosedForms([flat(*pair) for pair in _pairs(1)])
    axes, turn = forms.axis(TIMES[1:4]), 1e-12
    across = np.cross(axes, [0.36, 0.48, 0.8])
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    states = np.concatenate([math.cos(turn) * axes + math.sin(turn) * across, axes], axis=-1)
    gap = closed_form.distances(forms.constants, TIMES[None, 1:4], states[..., :3])
    np.testing.assert_allclose(gap, turn, rtol=1e-3)
    far = charts.axis_distance(-axes, axes)
    np.testing.assert_allclose(closed_form.distances(forms.constants, TIMES[None, 1:4], -axes), far, atol=1e-15)
    pair = _pairs(1)[0]
    alone = ClosedForm(*pair).axis_distance(TIMES[1:4], states[0, :, :3])
    assert alone.tobytes() == gap[0].tobytes()


def test_momenta_of_a_run_are_read_off_its_states():
    forms = ClosedForms([flat(*pair) for pair in _pairs(1)])
    states, momenta = forms.run(TIMES)
    assert states.tobytes() == forms.state(TIMES).tobytes()
    p_phi, p_psi = space_momenta("attitude", states)
    np.testing.assert_array_equal(momenta[..., 0], p_phi)
    size = np.abs(states[..., 4:]).max()
    np.testing.assert_allclose(momenta[..., 1], p_psi, rtol=0, atol=4e-16 * size)
    np.testing.assert_allclose(momenta[..., 1], np.broadcast_to(forms.p_psi[:, None], p_psi.shape), atol=8e-16 * size)
