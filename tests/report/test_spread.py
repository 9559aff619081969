"""Errors of an ensemble are those of each member, and a failed member is among the worst."""

import numpy as np
import pytest

import symtop
from symtop.report.spread import LEVELS, at_places, largest, member_errors, spread

SOME = symtop.population(30, seed=7)
ASKED = {"per_nutation": 30, "nutations": 2, "samples": 41, "quiet": True}


def test_errors_are_those_of_the_ensemble():
    data = symtop.ensemble(SOME, "strang[axis]", **ASKED)
    wrong = symtop.errors(data, SOME)
    np.testing.assert_allclose(member_errors(SOME, data, "axis"), wrong["axis"], rtol=1e-6, atol=1e-14)
    some = slice(None, None, 7)  # none of them begins beside a pole, where the start's own energy is rounded
    changed = np.abs(wrong["energy"].values[some])
    np.testing.assert_allclose(member_errors(SOME, data, "energy")[some], changed, rtol=1e-6, atol=1e-13)


def test_quantiles_are_members_and_a_failed_one_is_infinitely_wrong():
    data = symtop.ensemble(symtop.population(200, seed=3), "stormer-verlet", **ASKED)
    errors = member_errors(symtop.population(200, seed=3), data, "axis")
    failed = data.outcome.values != "ok"
    assert 0 < failed.sum() < 100
    np.testing.assert_array_equal(np.isinf(largest(errors)), failed)
    quantiles = spread(errors)
    assert quantiles.shape == (len(LEVELS), 41)
    assert np.isfinite(quantiles[2]).all()
    assert np.isinf(quantiles[4, -1])  # more than 1 % have failed
    assert np.isin(quantiles[:, -1], errors[:, -1]).all()
    np.testing.assert_array_equal(np.sort(quantiles, axis=0), quantiles)


def test_samples_that_a_run_has_not_are_no_errors():
    errors = np.array([[0.0, 1.0, np.nan], [0.0, 3.0, 5.0], [0.0, 2.0, np.nan]])
    np.testing.assert_array_equal(spread(errors, (0.0, 0.5, 1.0)), [[0.0, 1.0, 5.0], [0.0, 2.0, 5.0], [0.0, 3.0, 5.0]])
    assert np.isnan(spread(np.full((2, 1), np.nan))).all()
    assert largest(errors).tolist() == [1.0, 5.0, 2.0]


def test_errors_at_a_place_are_those_of_the_same_time():
    """Runs of 4, 5 and 40 steps: at each place the latest sample of each, from where all of them have stepped."""
    some = SOME.isel(member=slice(3))
    data = symtop.ensemble(some, "strang[axis]", per_nutation=[4, 5, 40], nutations=1, samples=101, quiet=True)
    errors = member_errors(some, data, "axis")
    places, latest = at_places(data, errors)
    np.testing.assert_allclose(places, np.arange(10, 41) / 40.0, atol=1e-12)
    assert np.isfinite(latest).all()
    np.testing.assert_array_equal(latest[2], errors[2, 10:41])
    for i, steps in enumerate((4, 5)):
        ranks = np.floor(places * steps + 1e-6).astype(int)
        np.testing.assert_array_equal(latest[i], errors[i, ranks])
    assert not np.array_equal(latest[0], errors[0, 10:41])  # as samples of the same index would be


def test_runs_that_have_all_samples_are_compared_by_their_index():
    data = symtop.ensemble(SOME, "strang[axis]", **ASKED)
    errors = member_errors(SOME, data, "axis")
    places, same = at_places(data, errors)
    assert same is errors
    np.testing.assert_allclose(places, np.arange(41) / 40.0, atol=0.013)  # half an interval
    short = symtop.ensemble(SOME, "strang[axis]", **ASKED | {"per_nutation": 2, "nutations": 2})
    places, few = at_places(short, member_errors(SOME, short, "axis"))
    np.testing.assert_allclose(places, [0.25, 0.5, 0.75, 1.0], atol=1e-12)
    np.testing.assert_array_equal(few, member_errors(SOME, short, "axis")[:, 1:5])


def test_members_of_other_labels_are_refused():
    one, other = (SOME.assign_coords(member=labels) for labels in (range(30), range(30, 60)))
    data = symtop.ensemble(one, "strang[axis]", **ASKED)
    assert np.array_equal(member_errors(SOME, data, "axis"), member_errors(one, data, "axis"))
    with pytest.raises(symtop.SymtopError, match="their labels are others"):
        member_errors(other, data, "axis")


@pytest.mark.parametrize(("members", "quantity", "reason"), [
    (SOME, "phi", "quantity 'phi' is unknown"), (SOME.isel(member=slice(3)), "axis", "members must be the 30"),
    (SOME, "energy", "without the variable energy"),
])  # fmt: skip
def test_what_cannot_be_compared_is_refused(members, quantity, reason):
    data = symtop.ensemble(SOME, "strang[axis]", variables=["axis"], **ASKED)
    with pytest.raises(symtop.SymtopError, match=reason):
        member_errors(members, data, quantity)
