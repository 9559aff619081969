"""Lie-group integrators in lanes: one kernel for both charts and for all numbers; the bits are in `test_lanes`."""

import dataclasses

import numpy as np
import pytest

from symtop.methods.framework.lanes import W
from symtop.methods.lagrangian.discrete_lagrangian import discrete_lagrangian
from symtop.methods.lie_group.generalised_alpha import generalised_alpha
from symtop.methods.lie_group.runge_kutta import LieTable, lie_runge_kutta
from symtop.methods.lie_group.variational import EULER_POINCARE, Variational, lie_variational
from symtop.methods.runge_kutta.explicit import runge_kutta
from symtop.methods.splitting.coefficients import SUZUKI_4
from tests.methods.test_lanes import EXPLICIT, FAR, ITERATED, SOLVERS, assert_runs_alone, left_alone, members

CHARTS = ("axis", "attitude")


def test_kernels_are_shared_by_charts_compositions_and_numbers():
    """Axis and attitude differ in what is shown, compositions in the table; other equations are other kernels."""
    kernels = {
        (name, chart): SOLVERS[f"{name}[{chart}]"]._whole.blocks().march
        for name in (*EXPLICIT, *ITERATED)
        for chart in CHARTS
    }
    assert all(kernels[name, "axis"] is kernels[name, "attitude"] for name in (*EXPLICIT, *ITERATED))
    assert kernels["lie-variational", "axis"] is kernels["lie-variational-suzuki-4", "axis"]
    assert len(set(map(id, kernels.values()))) == 8
    other = generalised_alpha("other", 0.3).solvers["axis"]
    assert other._whole.blocks().march is kernels["generalised-alpha", "axis"]


def with_shares(name, shares):
    """A method as a composition of itself."""
    solver = SOLVERS[name]
    return dataclasses.replace(solver, rule=solver.rule._replace(shares=shares))


def of_table(*rows, bent=False):
    return lie_runge_kutta("any", rows, 1, "", "", bent=bent).solvers["attitude"]


@pytest.mark.parametrize(
    "solver",
    [
        of_table(((1.0,),)),
        of_table(((1.0,),), ((0.5, 0.5), (0.0, 0.0)), bent=True),
        lie_variational("any", Variational(EULER_POINCARE, SUZUKI_4.drift), 4, "", "").solvers["axis"],
        generalised_alpha("any", 0.0).solvers["axis"],
        with_shares("rkmk-se3-2[attitude]", (0.25, 0.75)),
        with_shares("generalised-alpha[axis]", (0.25, 0.5, 0.25)),
        runge_kutta("any", ((),), (1.0,)).solvers["axis"],
        runge_kutta("any", ((), (1 / 3,), (0.0, 2 / 3)), (0.25, 0.0, 0.75)).solvers["axis"],
        discrete_lagrangian("mixed", (0.0, 0.0, 0.3, 1.0), (0.1, 0.2, 0.3, 0.4)).solvers["angles"],
    ],
    ids=["euler", "heun", "euler-poincare-4", "alpha-0", "rkmk-twice", "alpha-thrice", "rk-1", "rk-3", "weights"],
)
def test_tables_and_compositions_of_ones_own_have_the_bits_of_runs_alone(solver):
    """A weight of 0 is carried out like any other, and each share of generalised-alpha goes on from the last one."""
    given = members(200, seed=12)
    assert solver.in_lanes
    assert_runs_alone(solver, *given, solver.many(*given))


def test_a_table_of_no_weight_but_zeros_stands_still():
    table = LieTable((0.0,), (1.0,))
    solver, given = dataclasses.replace(SOLVERS["rkmk-se3-2[attitude]"], rule=table), members(W, seed=13)
    done = solver.many(*given)
    assert (done.outcome == 0).all()
    assert_runs_alone(solver, *given, done)


@pytest.mark.parametrize("name", ["commutator-free-4", "generalised-alpha"])
def test_lanes_whose_exponential_turns_too_far_for_its_series_run_alone(name):
    solver, given = SOLVERS[f"{name}[axis]"], members(400, seed=11)
    left = set(left_alone(solver, *given).tolist())
    done = solver.many(*given)
    failed = set(np.flatnonzero(done.outcome != 0).tolist())
    assert failed < left  # some of those that are left end well, with sine and cosine
    assert len(set(range(400)[FAR]) & left) > 0.6 * len(range(400)[FAR])
    assert len(left) < 80


@pytest.mark.parametrize("name", ["lie-variational", "euler-poincare", "simo-wong"])
def test_cayleys_rotation_turns_as_far_as_it_likes_in_lanes(name):
    """Only members whose equation cannot be solved, or takes half of the passes or more, are left."""
    solver, given = SOLVERS[f"{name}[axis]"], members(400, seed=11)
    left, done = set(left_alone(solver, *given).tolist()), solver.many(*given)
    failed = set(np.flatnonzero(done.outcome != 0).tolist())
    assert failed <= left
    assert len(left) <= len(failed) + 5
    assert len(set(range(400)[FAR]) - left) > (0 if name == "lie-variational" else 5)
