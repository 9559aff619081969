"""The paragraph and the sources of every integrator: there, and right where a number can be compared."""

import re

import pytest

import symtop
from symtop.methods.framework.loop import inside
from symtop.methods.framework.registry import bibliography, paragraphs

NAMES = tuple(symtop.integrators())
DESCRIBED = tuple(paragraphs())
COUNTED = """zero one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen sixteen
seventeen"""
NUMBERS = {word: value for value, word in enumerate(COUNTED.split())} | {"nineteen": 19, "thirty-five": 35}
COST = re.compile(r"(\S+) force evaluations? (a step|an iteration|a sweep)")


def cost_in_words(text):
    """What a paragraph says of the force evaluations: number and unit, the first time that it says so."""
    word, unit = COST.search(text).groups()
    return NUMBERS[word], unit


def test_other_integrators_that_a_paragraph_names_exist():
    for text in paragraphs().values():
        for name in re.findall(r"`([a-z0-9-]+)`", text):
            assert name in (*NAMES, *symtop.scenes()), name


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


@pytest.mark.parametrize("name", [name for name in DESCRIBED if symtop.integrator(name).control == "step_size"])
def test_no_paragraph_names_another_cost_than_the_one_that_is_counted(name):
    method = symtop.integrator(name)
    number, unit = cost_in_words(method.about)
    run = symtop.simulate("spheroid", method, step_size=0.01, horizon=1.0, guard=False)
    forces, steps, iterations = (run.attrs[key] for key in ("force_evaluations", "steps", "newton_iterations"))
    if method.explicit:
        assert unit == "a step"
        assert forces == number * steps
    else:
        assert unit in ("an iteration", "a sweep")
        each_step = inside(next(iter(method.solvers.values()))).each_step
        assert ("one more at the start of a step" in method.about) == (each_step == 1)
        assert forces == number * iterations + each_step * steps


@pytest.mark.parametrize("name", NAMES)
def test_every_integrator_names_sources_that_are_known_and_its_paragraph_their_years(name):
    method = symtop.integrator(name)
    keys = method.reference.split()
    assert keys
    assert set(keys) <= set(bibliography())
    for key in keys:
        year = re.search(r"^  year = \{(\d{4})\},$", bibliography()[key], re.MULTILINE)[1]
        assert f"({year})" in method.about or name not in DESCRIBED
        assert symtop.citation(name).count(bibliography()[key]) == 1


def test_an_integrator_of_ones_own_cites_nobody_that_is_known_here():
    with pytest.raises(symtop.SymtopError, match="names no source that is known here"):
        symtop.citation(symtop.composition("mine", (1.0,), (0.5, 0.5)))
