"""What a case looks up in the registry while it is measured is among the integrators that its study says it uses."""

import dataclasses

import pytest

from symtop.methods.framework import registry
from symtop.methods.framework.registry import split_name
from symtop.runner import scripts
from symtop.runner.study import REFERENCE


class Recording(dict):
    """A registry that notes the names under which integrators are looked up."""

    def __init__(self, entries, names):
        super().__init__(entries)
        self.names = names

    def __getitem__(self, name):
        self.names.add(split_name(name)[0])
        return super().__getitem__(name)


class Listed(Recording, registry._Integrators):
    """The same of what `integrators` returns."""


def kinds(study):
    """A case of the quick grid for each group, part of the question and set of settings."""
    cases = {}
    for case in study.grid(quick=True):
        cases.setdefault((case.group, case.settings.get("part"), *sorted(case.settings)), case)
    return list(cases.values())


def smaller(case):
    """The same case with at most two of the integrators that its settings list."""
    names = case.settings.get("integrators")
    return case if names is None else dataclasses.replace(case, settings={**case.settings, "integrators": names[:2]})


@pytest.fixture
def looked_up(monkeypatch):
    """The names that are looked up from now on."""
    registry.integrators()
    names = set()
    monkeypatch.setattr(registry, "_registry", Recording(registry._registry, names))
    monkeypatch.setattr(registry, "_Integrators", lambda entries: Listed(entries, names))
    return names


def undeclared(study, looked_up):
    """By label of a case: what it looked up and its study does not say it uses."""
    missing = {}
    for case in map(smaller, kinds(study)):
        declared = case.integrators if study.uses is None else study.uses(case)
        looked_up.clear()
        study.measure(case)
        if names := looked_up - {split_name(name)[0] for name in declared} - {REFERENCE}:
            missing[case.label] = names
    return missing


@pytest.mark.slow
@pytest.mark.parametrize("name", scripts.names())
def test_a_study_declares_the_integrators_that_its_cases_run(name, looked_up):
    assert undeclared(scripts.load(name), looked_up) == {}


def test_a_lookup_that_is_not_declared_is_found(looked_up):
    study = scripts.load("convergence")
    case = dataclasses.replace(study.grid(quick=True)[0], settings={})
    variant = dataclasses.replace(study, cases=lambda _: [case], measure=lambda _: registry.integrator("rk4[axis]"))
    assert undeclared(variant, looked_up) == {case.label: {"rk4"}}
