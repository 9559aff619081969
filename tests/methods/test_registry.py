"""What notebooks show of the registry, and fields of an integrator that make no sense."""

import re
import time
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np
import pytest

import symtop
from symtop.core.errors import SymtopError
from symtop.methods.framework import registry
from symtop.methods.framework.registry import Integrator
from symtop.methods.runge_kutta import gauss


def test_the_registry_is_a_dict_that_a_notebook_shows_as_a_table():
    integrators = symtop.integrators()
    html = integrators._repr_html_()
    assert isinstance(integrators, dict)
    assert all(f"<td>{name}</td>" in html for name in integrators)
    assert html.count("<tr") == len(integrators) + 1
    assert all(entry.summary.replace("'", "&#x27;") in html.replace("'", "&#x27;") for entry in integrators.values())


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


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"symplectic": "yes"}, "symplectic must be True, False or None, not 'yes'"),
        ({"symmetric": []}, "symmetric must be True, False or None"),
        ({"exact_steps": "no"}, "exact_steps must be True or False, not 'no'"),
        ({"default_tolerance": -1}, "default_tolerance must be above zero"),
        ({"default_tolerance": "a"}, "default_tolerance must be a finite number, not 'a'"),
        ({"default_tolerance": 1e-9, "least_tolerance": 1e-6}, "default_tolerance must be above zero, at least 1e-06"),
        ({"least_tolerance": "a"}, "least_tolerance must be a finite number, not 'a'"),
        ({"least_tolerance": -1.0}, "least_tolerance must be at least 0"),
        ({"reference": 5}, "reference must be text, not 5"),
        ({"same_steps_as": 3}, "same_steps_as must be a name or None, not 3"),
        ({"modified_energy": "E"}, "modified_energy must be a function or None, not 'E'"),
    ],
)
def test_a_field_that_makes_no_sense_is_refused_and_one_that_does_is_not(fields, says):
    right = {"name": "mine", "family": "other", "summary": "", "solvers": {"angles": print}}
    with pytest.raises(SymtopError, match=f"^{re.escape(says)}"):
        Integrator(**right | fields)
    claims = {"explicit": True, "symplectic": False, "symmetric": np.bool_(True), "least_tolerance": 0}
    assert Integrator(**right | claims, default_tolerance=1e-6, reference="x").record()["symmetric"] == "yes"
