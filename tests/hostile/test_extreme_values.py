"""Values at the end of what numbers can say: an answer or one sentence, and at once."""

import datetime
import decimal
import fractions
import math

import numpy as np
import pytest

import symtop
from symtop.core.numbers import real_numbers
from symtop.model.exact.closed_form import ClosedForm, ClosedForms

ODD_TIMES = [
    10**400, [10**400], 1j, [1j], np.array([1.0 + 0j]), {1: 2}, {}, {0.0}, "abc", "1", ["1"], b"1", np.array(["1"]),
    None, [None], object(), [object()], [[1.0, 2.0], [3.0]], np.datetime64("2020"), datetime.date(2020, 1, 1), [True],
    True, iter([1.0]), lambda: 1.0, [math.nan], [math.inf], 1e101,
]  # fmt: skip
SPHEROID = symtop.scene("spheroid")
FORM = ClosedForm(SPHEROID.top, SPHEROID.start)
FORMS = ClosedForms([[2.0, 1.0, 1.0, 0.5, 0, 0, 0, 0, 5.0]])


@pytest.mark.parametrize("times", ODD_TIMES, ids=lambda times: repr(times)[:20])
def test_odd_times_are_refused_in_one_sentence(times):
    functions = [FORM, FORM.turns, FORM.quaternion, FORM.axis, FORM.run, FORMS, FORMS.axis, FORMS.turns]
    functions += [lambda row: symtop.reference(SPHEROID, row), lambda row: FORM.axis_distance(row, np.ones((1, 3)))]
    for ask in functions:
        with pytest.raises(symtop.SymtopError, match="times must be") as info:
            ask(times)
        assert len(str(info.value)) < 300


@pytest.mark.parametrize("numbers", ODD_TIMES, ids=lambda numbers: repr(numbers)[:20])
def test_odd_tops_are_refused_in_one_sentence(numbers):
    with pytest.raises(symtop.SymtopError):
        ClosedForms(numbers)


def test_numbers_of_every_kind_are_read():
    kinds = [1], np.array([1], np.int8), np.array([1.0], np.float16), [fractions.Fraction(1)], [decimal.Decimal(1)]
    for row in kinds:
        assert real_numbers("row", row).tolist() == [1.0]
    assert real_numbers("row", [10**30]).tolist() == [1e30]
    assert real_numbers("row", 2.5).shape == ()
    assert FORM(np.ones((2, 3))[:, ::2]).theta.shape == (2, 2)


@pytest.mark.parametrize("name", ["rk45", "rk45-compiled", "lsoda", "radau", "dop853", "taylor", "strang", "exact"])
def test_a_horizon_too_short_for_a_step_is_refused(name):
    method = symtop.integrator(name)
    for horizon in (5e-324, 1e-320, 1e-305, 1e-101):
        control = {None: {}, "tolerance": {"tolerance": 1e-6}, "step_size": {"step_size": horizon}}[method.control]
        with pytest.raises(symtop.SymtopError, match="horizon must be at least 1e-100"):
            symtop.simulate(SPHEROID, name, horizon=horizon, **control)
    control = {None: {}, "tolerance": {"tolerance": 1e-6}, "step_size": {"step_size": 1e-100}}[method.control]
    assert symtop.simulate(SPHEROID, name, horizon=1e-100, **control).attrs["outcome"] == "ok"


def extreme(I1, I3, mgl, spin):
    return symtop.Scene("extreme", symtop.SymmetricTop(I1, I3, mgl), symtop.Angles(1.0, psi_dot=spin), 10.0)


SLOW = [(1e-30, 1e-31, 1e30), (1e30, 1e30, 1e-30), (1e-30, 1e-30, 1e-30)]
TOPS = [(1e-30, 1e-30, 1e30), (1, 1e-30, 1), *(pytest.param(numbers, marks=pytest.mark.slow) for numbers in SLOW)]


@pytest.mark.parametrize("spin", [0.0, 2.0])
@pytest.mark.parametrize("numbers", TOPS)
def test_references_of_extreme_tops_are_told_or_refused(numbers, spin):
    scene = extreme(*numbers, spin)
    assert np.isfinite(symtop.reference(scene, [0.0, 1.0])["theta"]).all()
    pytest.importorskip("heyoka")
    for options in ({"precision": "double"}, {"certify": "integration"})[: 1 if spin else 2]:
        try:
            assert np.isfinite(symtop.reference(scene, [0.0, 1.0], **options)["theta"]).all()
        except symtop.SymtopError as error:
            assert "ends at t = 0" in str(error)  # noqa: PT017
            assert numbers[2] == 1e30


@pytest.mark.parametrize("theta", [5e-324, 1e-320, 1e-200, 1e-162])
def test_a_swing_too_narrow_for_numbers_is_refused_and_one_that_is_not_is_followed(theta):
    """A hanging top that swings through the pole: its distance from it is theta^2/2."""
    hanging = symtop.SymmetricTop(1.0, 1.5, -1.0)
    for ask in (
        lambda: ClosedForm(hanging, symtop.Angles(theta)),
        lambda: symtop.simulate(symtop.Scene("s", hanging, symtop.Angles(theta), 3.0), "rk4", step_size=0.01),
    ):
        with pytest.raises(symtop.SymtopError, match="leave it by as much"):
            ask()
    swing = ClosedForm(hanging, symtop.Angles(1e-140))(np.array([0.0, 1.0])).theta
    assert swing[0] == pytest.approx(1e-140, rel=1e-12)
    assert abs(swing[1]) == pytest.approx(1e-140 * math.cos(1.0), rel=1e-6)
