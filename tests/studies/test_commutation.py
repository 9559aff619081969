"""Reduce, then discretise, against discretise, then reduce."""

import dataclasses

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import root
from symtop_studies.reduction import commutation, facts, figures, study
from symtop_studies.reduction.commutation import gap, kernel_path, path, reduced_first
from symtop_studies.reduction.measures import Ratio, chart_ratios, commutation_table, time_to_error, unreduced_forms

import symtop
from symtop.measure import datasets
from symtop.measure.order import power_law
from symtop.methods.framework import registry
from symtop.methods.lagrangian.discrete_lagrangian import Quadrature
from tests.conftest import random_scenes
from tests.templates import checked_page

SCENES = ("spheroid", "goldstein")


def commutes(scene, method, h=0.02, steps=200):
    """Within rounding of two compensated sums."""
    return gap(scene, reduced_first(scene, method), method, h, steps) < 1e-13


@pytest.mark.parametrize("node", [0.0, 0.3, 1.0])
def test_every_rule_of_one_node_commutes_with_the_reduction(node):
    assert commutes(random_scenes(1, seed=31)[0], symtop.discrete_lagrangian("one", (node,), (1.0,)))


@pytest.mark.parametrize("scene_name", SCENES)
@pytest.mark.parametrize(("name", "power"), [("trapezoidal", 2.0), ("simpson-linear", 2.0), ("galerkin-simpson", 4.0)])
def test_other_rules_do_not_commute_and_the_difference_falls_as_a_power_of_h(scene_name, name, power):
    """Over two nutations."""
    scene, method = symtop.scene(scene_name), symtop.integrator(name)
    assert not commutes(scene, method)
    table = commutation_table(scene, method, 2.0 * scene.nutation_period, (100, 200, 400, 800))
    assert power_law(table["commutation_step_size"], table["commutation_gap"]).slope == pytest.approx(power, abs=0.05)


@pytest.mark.parametrize("scene_name", SCENES)
def test_the_trapezoidal_routhian_is_stormer_verlet(scene_name):
    scene, verlet = symtop.scene(scene_name), symtop.integrator("stormer-verlet")
    for rule, agrees in ((Quadrature((0.0, 1.0), (0.5, 0.5)), True), (Quadrature((0.0, 1.0), (0.4, 0.6)), False)):
        assert (gap(scene, commutation.routhian_step(scene, rule), verlet, 0.02, 200) < 1e-13) is agrees


def lobatto_step(top, point, h):
    """One step of Lobatto IIIA-IIIB, order 4, on the Hamiltonian of the whole top: theta and p_theta afterwards."""
    IIIA = np.array([[0.0, 0.0, 0.0], [5 / 24, 1 / 3, -1 / 24], [1 / 6, 2 / 3, 1 / 6]])
    IIIB, weights = np.array([[1 / 6, -1 / 6, 0.0], [1 / 6, 1 / 3, 0.0], [1 / 6, 5 / 6, 0.0]]), IIIA[2]
    theta, _, _, p_theta, p_phi, p_psi = point
    # the force on phi and psi is zero, so that their stage momenta are p_phi and p_psi
    slopes = lambda stages: np.array([top.potential_slope(t, top.momenta(start_with(t))) for t in stages])

    def start_with(t):
        rate = (p_phi - p_psi * np.cos(t)) / (top.I1 * np.sin(t) ** 2)
        return symtop.Angles(t, phi_dot=rate, psi_dot=p_psi / top.I3 - rate * np.cos(t))

    def equations(unknown):
        places, momenta = unknown[:3], unknown[3:]
        residual = places - theta - h * IIIA @ momenta / top.I1
        return np.concatenate([residual, momenta - p_theta + h * IIIB @ slopes(places)])

    stages = root(equations, np.array([theta] * 3 + [p_theta] * 3), tol=1e-14).x
    return theta + h * weights @ stages[3:] / top.I1, p_theta - h * weights @ slopes(stages[:3])


@pytest.mark.parametrize("scene", random_scenes(4, seed=32), ids=lambda s: s.name)
def test_lobatto_on_the_whole_top_is_galerkin_on_the_routhian_and_not_on_the_top(scene):
    """The two are one method for a constant mass only; the inertia of the top is not constant."""
    angles, momenta, h = scene.start, scene.top.momenta(scene.start), 0.05
    point = (angles.theta, angles.phi, angles.psi, scene.top.I1 * angles.theta_dot, momenta.p_phi, momenta.p_psi)
    lobatto, start = lobatto_step(scene.top, point, h), np.array([angles.theta, point[3]])
    first = path(scene, commutation.routhian_galerkin_step(scene), h, 1)[1]
    last = kernel_path(scene, symtop.integrator("galerkin-simpson"), h, 1)[1]
    assert first == pytest.approx(lobatto, abs=1e-13)
    assert not np.allclose(last, lobatto, rtol=0.0, atol=1e-12)
    assert np.max(np.abs(last - lobatto)) < 1e-3 * np.max(np.abs(np.array(lobatto) - start))


def test_what_a_reduced_kernel_saves_is_split_into_iterations_and_the_time_of_one():
    dims = ("scene", "variant", "kernel", "twin_step")
    data = xr.Dataset({
        "seconds_per_step": (dims, [[[[1e-7, 1e-7], [2e-7, 3e-7]]]]),
        "iterations_per_step": (dims, [[[[2.0, 1.5], [3.0, 4.5]]]]),
        "twin_step_size": (("scene", "variant", "twin_step"), [[[0.1, 0.01]]]),
    }, {"scene": ["spheroid"], "variant": ["midpoint"], "kernel": ["reduced", "unreduced"]})  # fmt: skip
    answers, table = facts.facts(data), facts.tables(data)["kernels"]
    assert list(table["time (ratio)"]) == pytest.approx([2.0, 3.0])
    assert list(table["iterations (ratio)"]) == pytest.approx([1.5, 3.0])
    assert list(table["time of an iteration (ratio)"]) == pytest.approx([4.0 / 3.0, 1.0])
    assert (answers["step_least"], answers["step_most"]) == pytest.approx((2.0, 3.0))
    assert (answers["commuting"], answers["attitude_count"], answers["twins_gap"]) == (None, None, None)
    h, dims = 0.1 / 2.0 ** np.arange(4), ("scene", "variant", "commutation_step")
    gaps = [[[3e-15, 1e-15, 1e-15, 1e-15], [8e-14, 1e-15, 1e-15, 1e-15], 1e-3 * h**2 * [3.0, 1.0, 1.0, 1.0]]]
    data = xr.Dataset({"commutation_gap": (dims, gaps), "commutation_step_size": (dims, np.tile(h, (1, 3, 1)))},
                      {"scene": ["spheroid"], "variant": ["a", "b", "c"]})  # fmt: skip
    answers, table = facts.facts(data), facts.tables(data)["commutation"]
    assert (answers["commuting"], answers["commuting_gap"], answers["others"]) == ("a, b", 8e-14, "c")
    assert (answers["power_most"], table["at the finest step (rad)"][2]) == pytest.approx((2.0, gaps[0][2][-1]))


def test_facts_and_page_are_those_of_the_rules_and_charts(tmp_path):
    """Every rule on one scene, and one method in its charts, all with short runs."""
    overrides = {"counts": [50, 100, 200, 400], "batches": 1, "horizon": 2.0, "step_sizes": [0.1, 0.01]}
    parts = []
    for case in study.cases(True):
        if case.scene == "spheroid" and (case.settings["part"] != "charts" or case.integrator == "euler-poincare"):
            settings = {key: overrides.get(key, value) for key, value in case.settings.items()}
            parts.append((case, study.measure(dataclasses.replace(case, settings=settings))))
    data = datasets.combine(parts)
    answers = facts.facts(data)
    assert answers["commuting_gap"] < 1e-13
    assert answers["others"] == "trapezoidal, simpson-linear, galerkin-simpson"
    assert (answers["power_least"], answers["power_most"]) == pytest.approx((2.0, 4.0), abs=0.2)
    assert (answers["commuting"], answers["rules"]) == ("midpoint", "midpoint, trapezoidal")
    assert 0.0 < answers["twins_gap"] < 1e-11  # rounding over 10 000 steps without compensation
    assert answers["attitude_count"] == len(facts.tables(data)["charts"])
    assert not (data[["p_phi_drift", "p_psi_drift"]].to_dataarray() < 0.0).any()
    assert 1.0 <= data["iterations_per_step"].min() <= data["iterations_per_step"].max() < 10.0
    part = data.isel(commutation_step=slice(2))  # too few for an order, and no less apart
    assert facts.facts(part)["others"] == answers["others"]
    assert np.isnan(facts.facts(part)["power_least"])
    assert len(figures.pictures(part)) == 1
    checked_page("reduction", data, tmp_path)


@pytest.mark.parametrize(("failed", "ratio"), [(np.nan, 2.0), (0.1, 1.75)])
def test_a_run_that_failed_has_no_part_in_the_time_of_a_chart(failed, ratio, monkeypatch):
    axis = np.array([[np.nan] * 4, [1e-2, 1e-3, 1e-4, 1e-5], [failed, 2e-3, 5e-5, 3e-5]])
    seconds = np.array([[np.nan] * 4, [1.0] * 4, [0.5, 1.5, 2.0, 2.5]])  # what fails early is fast
    dims, bounds = ("chart", "setting"), np.tile([1e-15, 1e-15, 1e-15, 2e-6], (3, 1))
    cell = xr.Dataset({"axis": (dims, axis), "axis_bound": (dims, bounds), "seconds": (dims, seconds)},
                      {"chart": ["angles", "axis", "attitude"]})  # fmt: skip
    (row,) = chart_ratios(cell)
    ratios = [Ratio("attitude", "axis", 9.0, 1.0, x) for x in (1.2, 1.05, 0.95, 0.85, 0.8, np.nan)]
    monkeypatch.setattr(facts, "chart_ratios", lambda _: [*ratios, Ratio("angles", "axis", 9.0, 1.0, 3.0)])
    values = facts.facts(cell.expand_dims(scene=["spheroid"], variant=["gauss-2"]))
    assert [values[f"attitude_{x}"] for x in ("count", "longer", "shorter", "median", "most")] == [5, 1, 2, 0.95, 1.2]
    assert (row.chart, row.base, row.time, values["angles_slowest"]) == ("attitude", "axis", ratio, "gauss-2[angles]")
    back = time_to_error(*(cell.sel(chart=chart) for chart in ("attitude", "axis")))
    # Twice and half as large; the last are next to their bound. The errors 1e-3 and 1e-4 lie between 2e-3 and 5e-5.
    assert [row.error, row.to_error, 1.0 / back] == pytest.approx([1.0, 3.0**0.5, 3.0**0.5])


def test_a_kernel_is_known_under_any_name_and_a_method_without_a_twin_refused(monkeypatch):
    with pytest.raises(symtop.SymtopError, match="must be a reduced discrete Lagrangian, not 'rk45'"):
        commutation_table(symtop.scene("spheroid"), symtop.integrator("rk45"), 1.0, (10,))
    entries = dict(registry.integrators())
    entries["whole"] = dataclasses.replace(entries.pop("midpoint-unreduced"), name="whole")
    monkeypatch.setattr(registry, "_registry", entries)
    assert unreduced_forms() == {"midpoint": "whole", "trapezoidal": "trapezoidal-unreduced"}
    assert commutation.is_galerkin(dataclasses.replace(symtop.integrator("galerkin-simpson"), name="mine"))
    assert not commutation.is_galerkin(symtop.integrator("midpoint"))
