"""No number depends on an integrator's name: a method registered under another one gives the same bits everywhere."""

import dataclasses

import numpy as np
import pytest
from symtop_studies.stability.linear_limits import linear_limits, sleeping_threshold

import symtop
from symtop.judging.claims import constants
from symtop.methods.framework import registry
from symtop.methods.lagrangian.discrete_lagrangian import is_midpoint
from symtop.run.guard import forecast
from symtop.run.modified_energy import modified_energy
from symtop.run.simulation import make_plan

SCENE = symtop.scene("spheroid")
MADE = {
    "stormer-verlet": lambda: symtop.composition("renamed", (1.0,), (0.5, 0.5), order=2),
    "midpoint": lambda: symtop.discrete_lagrangian("renamed", (0.5,), (1.0,), order=2),
    "strang": lambda: symtop.composition("renamed", (1.0,), (0.5, 0.5), chart="space", order=2),
    "cayley": lambda: symtop.composition("renamed", (1.0,), (0.5, 0.5), chart="space", rotation="cayley", order=2),
}


@pytest.mark.parametrize(("name", "how"), [("strang", "a copy"), *((name, "made anew") for name in MADE)])
def test_long_run_modified_energy_stability_and_forecast_do_not_look_at_the_name(clean_registry, name, how):
    base = symtop.integrator(name)
    twin = symtop.register(dataclasses.replace(base, name="renamed") if how == "a copy" else MADE[name](), replace=True)
    h = SCENE.nutation_period / 137.3
    runs = [symtop.long_run(SCENE, method.name, steps=20_000, step_size=h, quiet=True) for method in (base, twin)]
    for variable in runs[0]:
        np.testing.assert_array_equal(runs[0][variable].values, runs[1][variable].values)
    chart = base.chart_for("axis")
    states = np.random.default_rng(5).normal(1.0, 0.1, (50, 4 if chart == "angles" else 6))
    first, second = (modified_energy(SCENE, method, chart, states, h) for method in (base, twin))
    np.testing.assert_array_equal(first, second)
    assert np.max(np.abs(first - modified_energy(SCENE, "rk4", chart, states, h))) > 1e-6  # it is not the energy itself
    steady, grid = symtop.scene("steady-fast"), np.linspace(0.02, 0.5, 12)
    limits, expected = (linear_limits(method, steady, grid) for method in (base, twin))
    assert limits == pytest.approx(expected, rel=0, abs=0, nan_ok=True)
    assert (base.sleeps_from is None) == (twin.sleeps_from is None)
    assert base.sleeps_from is None or base.sleeps_from(0.4) == twin.sleeps_from(0.4)
    assert sleeping_threshold(base, 0.4) == sleeping_threshold(twin, 0.4)
    plans = [make_plan(SCENE, method, h, horizon=8.0, samples=101)[0] for method in (base, twin)]
    assert forecast(SCENE, base, chart, plans[0]) == forecast(SCENE, twin, chart, plans[1])


def test_closed_forms_belong_to_the_four_methods_they_are_of():
    names = [name for name, method in symtop.integrators().items() if method.modified_energy is not None]
    assert sorted(names) == sorted(MADE)
    assert [name for name, method in symtop.integrators().items() if method.sleeps_from] == ["strang", "cayley"]
    assert symtop.composition("other", (0.5, 0.5), (0.25, 0.5, 0.25)).modified_energy is None
    assert symtop.composition("other", (1.0,), (1.0, 0.0)).modified_energy is None
    assert symtop.discrete_lagrangian("other", (0.0, 1.0), (0.5, 0.5)).modified_energy is None


def test_slow_solvers_and_software_arithmetic_are_known_by_traits_and_rules_by_numbers():
    base = symtop.integrator("rk45")
    twin = dataclasses.replace(base, name="renamed")
    variant = dataclasses.replace(base, name="renamed", same_steps_as=None)
    plan, _ = make_plan(SCENE, base, None, 1e-8, horizon=8.0, samples=101)
    expected = forecast(SCENE, base, "angles", plan)
    np.testing.assert_equal(tuple(forecast(SCENE, twin, "angles", plan)), tuple(expected))  # some are nan
    partial = forecast(SCENE, variant, "angles", plan)  # without it a tenth of the run is all that is probed
    assert partial.axis_error != expected.axis_error
    assert (symtop.integrator("taylor-quad").speed, symtop.integrator("taylor").speed) == (0.002, 1.0)
    strang = symtop.integrator("strang")
    variant = dataclasses.replace(strang, name="renamed", speed=0.02)
    steps = [constants.long_run(method, SCENE, "axis", quick=True).steps for method in (strang, variant)]
    assert steps[1] == pytest.approx(0.02 * steps[0], rel=0.01)
    assert is_midpoint(symtop.discrete_lagrangian("mine", (0.5,), (1.0,)))
    assert not is_midpoint(symtop.integrator("trapezoidal"))
    assert not is_midpoint(symtop.integrator("midpoint-unreduced"))


@pytest.mark.parametrize("conserves", [{"charm"}, "energy", 3, {"energy", "p_theta"}])
def test_what_a_method_may_claim_to_conserve_is_known(conserves):
    with pytest.raises(symtop.SymtopError, match="conserves"):
        dataclasses.replace(symtop.integrator("strang"), conserves=conserves)
    assert dataclasses.replace(symtop.integrator("strang"), conserves=["energy"]).conserves == {"energy"}


def test_charts_are_chosen_by_what_they_show_and_a_row_is_a_method_in_one():
    strang = symtop.integrator("strang")
    assert [strang.chart_for(what) for what in ("nutation", "axis", "attitude")] == ["axis", "axis", "attitude"]
    assert strang.chart_for("axis", among=["attitude"]) == "attitude"
    assert strang.variant("attitude").charts() == ("attitude",)
    with pytest.raises(symtop.SymtopError, match="cannot show the attitude"):
        strang.variant("axis").chart_for("attitude")
    on_axis = symtop.integrator("rk4[axis]")
    assert (on_axis.name, on_axis.method, on_axis.charts()) == ("rk4[axis]", "rk4", ("axis",))
    assert on_axis.variant("axis") is on_axis
    names = [row.name for row in registry.variants()]
    assert len(names) == len(set(names)) == sum(len(entry.charts()) for entry in registry.methods().values())
    assert {row.charts()[0] for row in registry.variants("attitude")} == {"angles", "attitude"}


def test_a_variant_is_made_once_and_again_when_its_method_is_replaced(monkeypatch):
    monkeypatch.setattr(registry, "_registry", dict(symtop.integrators()))
    first = symtop.integrator("rk4[axis]")
    assert symtop.integrator("rk4[axis]") is first
    symtop.register(dataclasses.replace(symtop.integrator("rk4"), order=3), replace=True)
    assert (first.order, symtop.integrator("rk4[axis]").order) == (4, 3)


@pytest.mark.parametrize("name", ["strang[angles]", "rk4[nutation]", "rk5[axis]", "[axis]", "rk4[]", "rk4[ ]", "[]"])
def test_a_row_that_does_not_exist_is_refused(name):
    with pytest.raises(symtop.SymtopError, match=r"is unknown; (known|did you mean)"):
        symtop.integrator(name)
    with pytest.raises(symtop.SymtopError, match="one of its variants"):
        symtop.register(symtop.integrator("rk4[axis]"))
    with pytest.raises(symtop.SymtopError, match="needs one solver"):
        dataclasses.replace(symtop.integrator("strang"), name="strang[axis]")
