"""Figures keep the colour of every integrator, whatever else is in the picture."""

import dataclasses

import pytest

import symtop
from symtop.report import style


def test_no_two_integrators_look_alike():
    looks = [(style.look(name).color, style.look(name).marker) for name in symtop.integrators()]
    assert len(set(looks)) == len(looks)


def test_a_formula_has_one_colour_with_and_without_fixed_steps_and_in_scipy():
    colors = {}
    for name in symtop.integrators():
        colors.setdefault(name.replace("-compiled", "").removesuffix("-fixed"), set()).add(style.look(name).color)
    assert [formula for formula, several in colors.items() if len(several) > 1] == []
    assert len({*colors["vern9"], *colors["tsit5"], *colors["rk45"], *colors["dop853"], *colors["rk4"]}) == 5


@pytest.mark.parametrize("model", ["rk4", "strang", "midpoint", "rk45", "taylor", "exact"])
def test_an_added_integrator_has_a_look_of_its_own_and_changes_nobodys(clean_registry, model):
    before = {name: style.look(name) for name in symtop.integrators()}
    for name in ("heun-3", "ralston"):
        symtop.register(dataclasses.replace(symtop.integrator(model), name=name))
        assert style.look(name)[:2] not in {look[:2] for look in before.values()}
        before[name] = style.look(name)
    assert {name: style.look(name) for name in before} == before
    assert model != "rk4" or before["heun-3"].color in style.ORANGES
