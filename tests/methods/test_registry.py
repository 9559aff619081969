"""What notebooks show of the registry, fields of an integrator that make no sense, and what each method needs."""

import re
import time
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np
import pytest

import symtop
from symtop.core.errors import SymtopError
from symtop.methods.framework import registry
from symtop.methods.framework.registry import ENGINE, NEEDS, Integrator
from symtop.methods.runge_kutta import gauss


@pytest.mark.parametrize("catalogue", [symtop.integrators, symtop.scenes])
def test_a_catalogue_is_a_dict_that_a_notebook_shows_as_a_table(catalogue):
    html = catalogue()._repr_html_()
    assert isinstance(catalogue(), dict)
    assert all(f"<td>{name}</td>" in html for name in catalogue())
    assert html.count("<tr") == len(catalogue()) + 1


def test_two_threads_that_make_the_very_first_call_together_see_every_integrator(monkeypatch):
    built_in, barrier = gauss.built_in, Barrier(4)

    def slow():
        time.sleep(0.05)
        return built_in()

    def first_call(_):
        barrier.wait(10.0)
        return list(registry.integrators())

    names = list(registry.integrators())
    shipped = [name for name in names if registry.is_built_in(name)]
    monkeypatch.setattr(gauss, "built_in", slow)
    for name, empty in (("_registry", {}), ("_loaded", []), ("_announced", []), ("_shipped", set())):
        monkeypatch.setattr(registry, name, empty)
    with ThreadPoolExecutor(4) as pool:
        results = list(pool.map(first_call, range(4)))
    assert results == [shipped] * 4


@pytest.mark.parametrize(("fields", "says"), [
    ({"symplectic": "yes"}, "symplectic must be True, False or None, not 'yes'"),
    ({"exact_steps": "no"}, "exact_steps must be True or False, not 'no'"),
    ({"default_tolerance": -1}, "default_tolerance must be above zero"),
    ({"default_tolerance": 1e-9, "least_tolerance": 1e-6}, "default_tolerance must be above zero, at least 1e-06"),
    ({"least_tolerance": -1.0}, "least_tolerance must be at least 0"),
    ({"reference": 5}, "reference must be text, not 5"),
])  # fmt: skip
def test_a_field_that_makes_no_sense_is_refused_and_one_that_does_is_not(fields, says):
    right = {"name": "mine", "family": "other", "summary": "", "solvers": {"angles": print}}
    with pytest.raises(SymtopError, match=f"^{re.escape(says)}"):
        Integrator(**right | fields)
    claims = {"explicit": True, "symplectic": False, "symmetric": np.bool_(True), "least_tolerance": 0}
    assert Integrator(**right | claims, default_tolerance=1e-6, reference="x").record()["symmetric"] == "yes"


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
        assert method.needs in NEEDS
        assert method.general in (True, False)
        assert method.inner_loop is not None
        assert (method.inner_loop == "Python") == (method.implementation == "python")
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
