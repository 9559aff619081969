"""What a method needs, and whether it exists for a body without symmetry, of every integrator."""

import pytest

import symtop
from symtop.core.errors import SymtopError
from symtop.methods.framework.registry import ENGINE, INNER_LOOPS, NEEDS, Integrator, methods

EVERY = symtop.integrators()
NAMED = {
    "derivative": ("rk4", "rk45", "rk45-compiled", "dop853", "dop853-compiled", "tsit5", "vern9", "adams", "gauss-4",
                   "radau"),
    "expression": ("taylor", "taylor-quad", "series-general", "series-general-adaptive", "kahan"),
    "lagrangian": ("midpoint", "trapezoidal", "simpson-linear", "galerkin-simpson", "midpoint-unreduced"),
    "kicks": ("strang", "cayley", "stormer-verlet", "lie-variational", "euler-poincare", "no-squish", "dprkn8"),
    "group": ("rkmk-se3-4", "crouch-grossman-3", "simo-wong", "generalised-alpha", "collective-gauss-2", "bullet"),
    "this-top": ("series", "series-adaptive", "exact-discrete", "cayley-tuned"),
    "solution": ("exact",),
}  # fmt: skip


@pytest.mark.parametrize("name", EVERY)
def test_every_shipped_integrator_says_what_it_needs(name):
    method = EVERY[name]
    assert method.needs in NEEDS
    assert method.general in (True, False)
    assert method.inner_loop in INNER_LOOPS[:-1]
    assert (method.inner_loop == "Python") == (method.implementation == "python")
    assert (method.record()["needs"], method.record()["inner loop"]) == (method.needs, method.inner_loop)


@pytest.mark.parametrize("needs", NEEDS)
def test_well_known_methods_need_what_the_literature_gives_them(needs):
    assert {EVERY[name].needs for name in NAMED[needs]} == {needs}


def test_what_is_made_for_this_top_exists_for_no_other_body_and_is_said_beside_nothing_else():
    for method in EVERY.values():
        if method.needs in ("this-top", "solution"):
            assert not method.general
        if method.needs in ("derivative", "expression", "group"):
            assert method.general
    assert not EVERY["takahashi-imada"].general  # its processor has no elementary flow without symmetry
    assert EVERY["chin-4a"].general
    assert not EVERY["stormer-verlet"].general  # T(p_theta) + V(theta) takes two cyclic angles


def test_claims_agree_with_needs():
    """f alone, in coordinates that are not canonical, makes nothing symplectic; kicks and an action do."""
    for method in EVERY.values():
        if method.needs in ("derivative", "expression"):
            assert not method.symplectic
        if method.needs in ("kicks", "lagrangian") and method.name not in ("stormer-verlet-reversible", "dprkn8"):
            assert method.symplectic  # of those two one composes with adaptive steps, one is no composition at all
        if method.family == ENGINE:
            assert method.needs == ("kicks" if method.symplectic else "group")


def test_tables_of_ones_own_have_the_needs_of_their_family_and_a_plug_in_has_none():
    heun = symtop.runge_kutta("heun", ((), (1.0,)), (0.5, 0.5), order=2)
    assert (heun.needs, heun.general) == ("derivative", True)
    mine = Integrator(name="mine", family="other", summary="", solvers={"axis": print})
    assert (mine.needs, mine.general) == (None, None)
    assert mine.record()["needs"] == mine.record()["general"] == "unknown"
    with pytest.raises(SymtopError, match="needs must be 'derivative'"):
        Integrator(name="mine", family="other", summary="", solvers={"axis": print}, needs="luck")


def test_no_name_of_the_lists_above_is_an_engine_that_comparisons_leave_out_but_two():
    assert {name for names in NAMED.values() for name in names} - set(methods()) == {"no-squish", "bullet"}
