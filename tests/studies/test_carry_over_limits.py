"""Linear limits of steady bodies beside those of tops and of pendulums, resonances, and the maps of engines."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.linalg import expm
from symtop_studies.carry_over import comparison as by, facts, limits as of
from symtop_studies.carry_over.bodies import FAMILIES, FREE, SYMMETRIC, bodies_of
from symtop_studies.stability.linear_limits import sign_changes, sleep_margin

from symtop.methods.framework.registry import integrator
from symtop.model.charts import BODY

GRID = 0.1


@dataclass
class Longer:
    """A solver whose steps are longer than it says: a planted lower limit."""

    solver: Any
    factor: float

    def many(self, rows, h, marks):
        return self.solver.many(rows, self.factor * h, marks)


def planted(name, factor):
    return SimpleNamespace(solvers={BODY: Longer(integrator(f"{name}[{BODY}]").solvers[BODY], factor)})


def tilted(n, size=0.05):
    return np.tile([size, 0.0, 0.0, 0.0], (n, 1))


def limit(variant, bodies):
    omega, _, stable = of.reach(bodies, tilted(len(bodies.spin)))
    assert stable.all()
    return of.limits(variant, bodies, omega, GRID)


@pytest.mark.parametrize("spin", [2.5, 3.0, 4.0])
def test_a_body_that_is_a_top_has_the_limit_that_the_study_of_stability_finds(spin):
    bodies = of.Upright(np.ones((1, 3)), np.ones(1), np.array([spin]))
    omega = of.reach(bodies, tilted(1))[0]
    ends = sign_changes(lambda h: sleep_margin(integrator("strang"), spin, h), np.linspace(0.05, 8.0 / spin, 300))
    assert limit(integrator("strang[body]"), bodies) / omega == pytest.approx(ends[:1], rel=1e-5)
    assert limit(planted("strang", 1.05), bodies) / omega == pytest.approx([ends[0] / 1.05], rel=1e-5)


def test_a_body_that_hangs_has_the_limits_of_the_oscillator_and_a_planted_one_is_seen():
    """rk4 2 sqrt 2, the splitting of kicks and free motion 2, whatever the moments; tops have 2.83 in angles too."""
    bodies = of.Upright(np.array([[1.0, 1.3, 0.5], [1.0, 1.0, 0.5]]), -np.ones(2), np.zeros(2))
    for name, known in (("rk4", np.sqrt(8.0)), ("strang", 2.0)):
        assert limit(integrator(f"{name}[{BODY}]"), bodies) == pytest.approx([known] * 2, rel=1e-4)
        assert limit(planted(name, 1.25), bodies) == pytest.approx([known / 1.25] * 2, rel=1e-4)


@pytest.mark.parametrize("family", ["0.3", FREE])
def test_small_motions_are_those_of_the_matrix(family):
    bodies, time = of.upright(family, 4, 3), 1.7
    y = np.tile([3e-6, -2e-6, 1e-6, 4e-6], (4, 1))
    out = of.displaced(integrator("kahan-li-8[body]"), bodies.rows(y[:, None])[:, 0], np.full(4, time / 400),
                       np.array([400]))[:, 0]  # fmt: skip
    right = np.stack([expm(time * slopes) @ one for slopes, one in zip(bodies.slopes, y, strict=True)])
    np.testing.assert_allclose(out, right, atol=1e-11)
    wrong = of.upright(SYMMETRIC, 4, 3)
    far = np.stack([expm(time * slopes) @ one for slopes, one in zip(wrong.slopes, y, strict=True)])
    assert np.abs(out - far).max(axis=1).min() > 1e-8


def test_an_unstable_rotation_is_told_and_has_no_limit(monkeypatch):
    falls = of.Upright(np.array([[1.0, 1.1, 0.5], [1.0, 1.3, 1.15]]), np.array([1.0, 0.0]), np.array([0.5, 3.0]))
    assert not of.reach(falls, tilted(2))[2].any()  # too slow to sleep; about the middle axis
    monkeypatch.setattr(of, "upright", lambda family, count, seed: falls)
    table = of.steady_table(integrator("strang[body]"), 2, 1, 1.0, 2)
    assert (table["limit"] == 0.0).all()
    assert table["grown"].isnull().all()


def test_a_tilt_grows_beyond_the_limit_and_not_at_short_steps():
    variant, bodies = integrator("strang[body]"), of.upright("0.3", 6, 1)
    omega, most, _ = of.reach(bodies, tilted(6))
    ends = of.limits(variant, bodies, omega, GRID)
    h = ends[:, None] * np.array([0.05, 0.2, 1.02]) / omega[:, None]
    far = of.radius(variant, bodies, h)[:, 2] > 1.05  # one body has left a narrow window by then
    assert far.sum() == 5
    assert of.grown(variant, bodies, h, tilted(6), most).tolist() == [[False, False, grows] for grows in far]


def test_engines_that_leave_out_a_term_lose_bodies_and_those_of_order_four_do_not():
    drawn = {name: bodies_of(name, 6, 1, 10.0) for name in (SYMMETRIC, "0.3")}
    bad, good = (of.engine_table(integrator(f"{name}[{BODY}]"), drawn) for name in ("no-gyro", "rkmk4"))
    assert not good["lost"].any()
    assert bad["lost"].mean() > 0.3
    ratio = (good["error"].isel(steps=0) / good["error"].isel(steps=1)).median("member")
    assert (ratio > 4.0**3).all()  # of order four, two halvings of the step
    assert (ratio < 4.0**5).all()


def dataset(limits, grown, errors):
    """Two methods and six maps on ten bodies of each family: numbers by family, a row of errors by map."""
    steady = {name: (("variant", "family", "member"), np.broadcast_to(
        np.array([given[one] for one in of.STEADY])[None, :, None], (2, len(of.STEADY), 10)))
        for name, given in (("limit", limits), ("grown", grown))}  # fmt: skip
    error = np.array([errors[name] for name in FAMILIES]).T[:, :, None, None] * np.ones((1, 1, 2, 10))
    over = ("variant", "family", "steps", "member")
    engines = xr.Dataset({"error": (over, error), "lost": (over, 1.0 * (error > 3.0))},
                         {"variant": [f"map-{k}[body]" for k in range(6)], "family": [*FAMILIES]})  # fmt: skip
    first = xr.Dataset(steady, {"variant": ["strang[body]", "rk4[body]"], "family": list(of.STEADY)})
    return xr.DataTree.from_dict({"/steady": first.expand_dims("scene"), "/engines": engines.expand_dims("scene")})


def test_planted_limits_resonances_and_rankings_of_engines_are_found():
    row = 2.0 ** np.arange(-3.0, 3.0)
    errors = dict.fromkeys(FAMILIES, row) | {FREE: row[::-1], "0.1": 0.99 * row}
    limits = dict.fromkeys(of.STEADY, 2.0) | {"0.1": 1.2, "0.3": 0.8, FREE: np.nan}
    grown = dict.fromkeys(of.STEADY, 0.02) | {"0.1": 0.05, "0.3": 0.2}
    data = dataset(limits, grown, errors)
    told = {family: [cell(data, family)[1] for cell in (facts.limit_cell, facts.resonance_cell, facts.engine_cell)]
            for family in ("0.01", "0.1", "0.3", FREE)}  # fmt: skip
    assert told["0.01"] == [by.YES] * 3
    assert told["0.1"] == [by.FACTOR, by.FACTOR, by.YES]
    assert told["0.3"] == [by.NO, by.NO, by.YES]
    assert told[FREE] == [by.YES, by.YES, by.NO]
    assert by.limit_factors(data, FREE) == pytest.approx(of.MOST / 2.0)  # a limit that is not found is no lower
    assert np.isnan(by.limit_factors(dataset(limits | {"0.3": 0.0}, grown, errors), "0.3")).all()
    assert len(facts.limit_table(data)) == 2 + 2 + 4 * 6
