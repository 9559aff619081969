"""The registry: what notebooks show of it, fields that make no sense, a paragraph and sources of every method."""

import copy
import pickle
import re
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Barrier

import numpy as np
import pytest

import symtop
from symtop.methods.framework import registry
from symtop.methods.framework.loop import inside
from symtop.methods.framework.registry import ENGINE, NEEDS, Integrator, bibliography, citation_keys, paragraphs
from symtop.methods.runge_kutta import gauss
from symtop.methods.splitting.body import _TURNS, free_motion
from symtop.methods.splitting.coefficients import METHODS, STRANG


@pytest.mark.parametrize("catalogue", [symtop.integrators, symtop.scenes])
def test_a_catalogue_is_a_dict_that_a_notebook_shows_as_a_table(catalogue):
    html = catalogue()._repr_html_()
    assert isinstance(catalogue(), dict)
    assert all(f"<td>{name}</td>" in html for name in catalogue())
    assert html.count("<tr") == len(catalogue()) + 1
    assert all(f"<td>{name}</td>" in entry._repr_html_() for name, entry in catalogue().items())


def test_a_registered_one_is_pickled_by_its_name_and_no_other():
    for method in map(symtop.integrator, ("rk4", "dop853", "strang[axis]")):
        assert pickle.loads(pickle.dumps(method)) is method
        with pytest.raises(TypeError, match="cannot pickle"):
            pickle.dumps(variant := replace(method, order=7))
        assert copy.copy(variant) == variant


def test_two_threads_that_make_the_very_first_call_together_see_every_integrator(monkeypatch):
    built_in, barrier = gauss.built_in, Barrier(4)

    def slow():
        time.sleep(0.05)
        return built_in()

    def first_call(_):
        barrier.wait(10.0)
        return list(registry.integrators())

    shipped = [name for name in registry.integrators() if registry.is_built_in(name)]
    monkeypatch.setattr(gauss, "built_in", slow)
    for name, empty in (("_registry", {}), ("_loaded", []), ("_announced", []), ("_shipped", set())):
        monkeypatch.setattr(registry, name, empty)
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(first_call, range(4))) == [shipped] * 4


@pytest.mark.parametrize(("fields", "message"), [
    ({"symplectic": "yes"}, "symplectic must be True, False or None, not 'yes'"),
    ({"exact_steps": "no"}, "exact_steps must be True or False, not 'no'"),
    ({"default_tolerance": -1}, "default_tolerance must be above zero"),
    ({"default_tolerance": 1e-9, "least_tolerance": 1e-6}, "default_tolerance must be above zero, at least 1e-06"),
    ({"least_tolerance": -1.0}, "least_tolerance must be at least 0"),
    ({"reference": 5}, "reference must be text, not 5"),
])  # fmt: skip
def test_a_field_that_makes_no_sense_is_refused_and_one_that_does_is_not(fields, message):
    arguments = {"name": "mine", "family": "other", "summary": "", "solvers": {"angles": print}}
    with pytest.raises(symtop.SymtopError, match=f"^{re.escape(message)}"):
        Integrator(**arguments | fields)
    claims = {"explicit": True, "symplectic": False, "symmetric": np.bool_(True), "least_tolerance": 0}
    assert Integrator(**arguments | claims, default_tolerance=1e-6, reference="x").record()["symmetric"] == "yes"


EVERY = symtop.integrators()
NAMED = {
    "derivative": ("euler", "rk4", "rk45", "rk45-compiled", "dop853", "dop853-compiled", "tsit5", "vern9", "adams",
                   "gauss-4", "radau"), "constants": ("dop853-projected", "vern9-projected"),
    "expression": ("taylor", "taylor-quad", "series-general", "series-general-adaptive", "kahan"),
    "lagrangian": ("midpoint", "trapezoidal", "simpson-linear", "galerkin-simpson", "midpoint-unreduced",
                   "galerkin-gauss-8"),
    "kicks": ("strang", "cayley", "stormer-verlet", "lie-variational", "euler-poincare", "no-squish", "dprkn8",
              "symplectic-euler"),
    "group": ("rkmk-se3-8", "crouch-grossman-3", "simo-wong", "generalised-alpha", "collective-gauss-2", "bullet"),
    "this-top": ("series", "series-adaptive", "exact-discrete", "cayley-tuned"), "solution": ("exact",),
}  # fmt: skip


@pytest.mark.parametrize("needs", NEEDS)
def test_well_known_methods_need_what_the_literature_gives_them(needs):
    assert {EVERY[name].needs for name in NAMED[needs]} == {needs}


def test_claims_agree_with_needs_and_what_is_made_for_this_top_exists_for_no_other_body():
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
        if method.needs in ("this-top", "solution"):
            assert not method.general
        if method.needs in ("derivative", "expression", "group"):
            assert method.general
    assert not EVERY["takahashi-imada"].general  # its processor has no elementary flow without symmetry
    assert EVERY["chin-4a"].general
    assert not EVERY["stormer-verlet"].general  # T(p_theta) + V(theta) takes two cyclic angles


def test_tables_of_ones_own_have_the_needs_of_their_family_and_a_plug_in_has_none():
    heun = symtop.runge_kutta("heun", ((), (1.0,)), (0.5, 0.5), order=2)
    assert (heun.needs, heun.general) == ("derivative", True)
    method = Integrator(name="mine", family="other", summary="", solvers={"axis": print})
    assert (method.needs, method.general) == (None, None)
    assert method.record()["needs"] == method.record()["general"] == "unknown"
    with pytest.raises(symtop.SymtopError, match="needs must be 'derivative'"):
        Integrator(name="mine", family="other", summary="", solvers={"axis": print}, needs="luck")


NAMES = tuple(symtop.integrators())
DESCRIBED = tuple(paragraphs())
COUNTED = """zero one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen sixteen
seventeen"""
NUMBERS = {word: value for value, word in enumerate(COUNTED.split())} | {"nineteen": 19, "thirty-five": 35}
COST = re.compile(r"(\S+) force evaluations? (a step|an iteration|a sweep)")


@pytest.mark.parametrize("name", DESCRIBED)
def test_no_paragraph_names_another_order_or_another_property_than_the_record(name):
    method, about = symtop.integrator(name), symtop.integrator(name).about
    orders = {int(number) for number in re.findall(r"\bOrder (\d+)", about)}
    assert orders == (set() if method.order is None else {method.order})
    assert ("not symplectic" in about) == (not method.symplectic)
    assert "symplectic" in about
    assert ("not symmetric" in about) == (not method.symmetric)
    assert "symmetric" in about
    for quantity in method.conserves & {"p_phi", "p_psi", "energy"}:
        assert quantity in about


@pytest.mark.quick
@pytest.mark.parametrize("name", [name for name in DESCRIBED if symtop.integrator(name).control == "step_size"])
def test_no_paragraph_names_another_cost_than_the_one_that_is_counted(name):
    method = symtop.integrator(name)
    word, unit = COST.search(method.about).groups()  # the first time that it says so
    run = symtop.simulate("spheroid", method, step_size=0.01, horizon=1.0, guard=False)
    number = NUMBERS[word]
    forces, steps, iterations = (run.attrs[key] for key in ("force_evaluations", "steps", "newton_iterations"))
    if method.explicit:
        assert (unit, forces) == ("a step", number * steps)
    else:
        assert unit in ("an iteration", "a sweep")
        each_step = inside(next(iter(method.solvers.values()))).each_step
        assert ("one more at the start of a step" in method.about) == (each_step == 1)
        assert forces == number * iterations + each_step * steps


@pytest.mark.parametrize("name", NAMES)
def test_every_integrator_names_sources_that_are_known_and_its_paragraph_their_years(name):
    method, keys = EVERY[name], citation_keys(EVERY[name])
    assert len(keys) == len(method.reference.split()) > 0
    for key in keys:
        year = re.search(r"^  year = \{(\d{4})\},$", bibliography()[key], re.MULTILINE)[1]
        assert f"({year})" in method.about or name not in DESCRIBED
        assert symtop.citation(name).count(bibliography()[key]) == 1


TURNS = {STRANG: set(), **dict(zip(_TURNS, ({"blanes-moan-2002"}, *[{"kahan-li-1997"}] * 2), strict=True))}


@pytest.mark.parametrize("name", [name for name in METHODS if "body" in EVERY[name].solvers])
def test_a_splitting_cites_the_table_of_its_turns_in_the_chart_of_a_body_alone(name):
    top, body = (citation_keys(EVERY[name].variant(chart)) for chart in ("axis", "body"))
    turns = free_motion(EVERY[name].solvers["body"].rule.rule, EVERY[name].order)
    assert (len(top), {*body}) == (1 + (name == "suzuki-umeno-8"), {*top} | TURNS[turns])  # that one was found twice


def test_other_integrators_that_a_paragraph_names_exist_and_one_of_ones_own_cites_nobody():
    for text in paragraphs().values():
        for name in re.findall(r"`([a-z0-9-]+)`", text):
            assert name in (*NAMES, *symtop.scenes()), name
    with pytest.raises(symtop.SymtopError, match="names no source that is known here"):
        symtop.citation(symtop.composition("mine", (1.0,), (0.5, 0.5)))
