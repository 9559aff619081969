"""The convergence study: variants, adaptive methods beside them, and one rule for verdicts."""

import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.convergence import facts, measures, study

import symtop
from symtop.measure import datasets
from symtop.measure.order import CONFIRMED_BEYOND, Fit, order_verdict
from symtop.methods.framework.registry import integrator, methods, split_name, variants
from tests.templates import checked_page

ROWS = ("midpoint[angles]", "trapezoidal[angles]", "stormer-verlet[angles]", "strang[axis]", "strang[attitude]",
        "rk4[angles]", "rk4[axis]", "gauss-12[attitude]", "rk45[angles]", "rk45-compiled[angles]", "radau[angles]",
        "taylor[axis]")  # fmt: skip


@pytest.fixture(scope="module")
def data():
    """A small grid on one scene."""
    cases = [case for case in study.on_scene("goldstein", quick=True) if case.integrator in ROWS]
    assert {case.integrator for case in cases} == set(ROWS)
    dense = [symtop.Case(case.scene, case.integrator, case.settings | {"dense": True}) for case in cases]
    return datasets.combine([(case, study.measure(case)) for case in dense])


def test_every_chart_of_every_method_is_a_row_and_a_formula_is_none():
    names = {case.integrator for case in study.cases(False)}
    with_order = {name for name, method in methods().items() if method.control and not method.exact_steps}
    assert names == {row.name for row in variants() if row.control is not None and not row.exact_steps}
    assert {split_name(name)[0] for name in names} == with_order
    assert not any(split_name(name)[0] == "exact" for name in names)


def test_verdicts_are_those_of_the_one_rule_and_a_wrong_declaration_is_refuted(data, monkeypatch):
    results = measures.judged(data)
    assert {name for _, name in results} == {name for name in ROWS if integrator(name).fixed_step}
    for (_, name), (word, slopes) in results.items():
        declared, main = integrator(name).order, slopes["axis"]
        assert word == order_verdict(declared, main, [fit for quantity, fit in slopes.items() if quantity != "axis"])
        if math.isfinite(main.slope):
            assert abs(main.slope - declared) <= main.interval + CONFIRMED_BEYOND, name
    assert sum(word == "confirmed" for word, _ in results.values()) >= 7
    offset = 3e-3 * (data["variant"] == "midpoint[angles]")
    shifted = data.assign({name: data[name] + offset for name in ("axis", "axis_end")})
    pair = facts.tables(shifted)["orders"].set_index("variant")["verdict"], facts.facts(shifted)["wrong"]
    assert (pair[0]["midpoint[angles]"], pair[0]["rk4[axis]"], pair[1]) == ("wrong limit", "confirmed", 1)
    monkeypatch.setattr(measures, "declared_order", lambda name: 3)
    assert {measures.judged(data)["goldstein", name].verdict for name in ("strang[axis]", "rk4[axis]")} == {"refuted"}
    monkeypatch.setattr(facts, "declared_order", lambda name: 3)
    words = facts.tables(data)["orders"].set_index("variant")["verdict"]
    assert (words["strang[axis]"], words["rk4[axis]"]) == ("lower", "higher")
    monkeypatch.setattr(facts, "ratios", lambda _: {"a": np.array([1.0, 1.0, 9.0]), "b": np.full(4, 5.0)})
    values = [facts.facts(data)[f"ratio_{name}"] for name in ("most_variant", "most", "middle", "runs")]
    assert values == ["a", 9.0, 5.0, 7]


def test_a_median_over_few_scenes_is_not_ranked(data, monkeypatch):
    scenes = ["goldstein", "spheroid", "loop"]
    stack = xr.concat([data.assign_coords(scene=[name]) for name in scenes], "scene")
    works = {(scene, "rk4[axis]"): measures.Efficiency(100.0, False) for scene in scenes}
    works["loop", "strang[axis]"] = measures.Efficiency(1.0, True)
    monkeypatch.setattr(facts, "efficiencies", lambda *_: works)
    table = facts.cheapest(stack)
    extra = {"midpoint[angles]": 10.0, "stormer-verlet[angles]": 20.0, "trapezoidal[angles]": 80.0}
    extra = {(scene, name): measures.Efficiency(work * (part if work == 80.0 else 1.0), False)
             for name, work in extra.items() for scene, part in zip(scenes, (1.0, 1.0, 9.0), strict=True)}  # fmt: skip
    monkeypatch.setattr(facts, "efficiencies", lambda *_: works | extra)
    answers, count = facts.facts(stack), measures.stepping(data).sizes["variant"]
    assert (answers["span"], answers["span_order"], answers["unknown"]) == (8.0, 2, count - 5)
    monkeypatch.setattr(facts, "efficiencies", lambda *_: works)
    assert table["variant"].tolist() == ["rk4[axis]", "strang[axis, attitude]"]
    assert table[["ranked", "of these extrapolated"]].to_numpy().tolist() == [[True, 0], [False, 1]]
    assert facts.cheapest(data)["ranked"].all()  # the control: a dataset of one scene has no more


def test_the_energy_over_time_is_that_of_the_run_that_it_names():
    scene = symtop.scene("spheroid")
    verlet, taylor = (measures.energy_history(scene, integrator(name), 20.0) for name in ("stormer-verlet", "taylor"))
    assert float(verlet["history_time"].max()) == pytest.approx(20.0)
    run = symtop.simulate(scene, "stormer-verlet", step_size=scene.nutation_period / 100.0,
                          horizon=20.0 * scene.nutation_period, samples=801, guard=False)  # fmt: skip
    largest = float(np.abs(run["energy"] - run["energy"][0]).max())
    assert float(verlet["history_energy"].max()) == pytest.approx(largest / scene.energy_scale, rel=1e-6)
    assert float(taylor["history_energy"].max()) < 1e-12 < float(verlet["history_energy"].max())
    assert np.isnan(verlet["history_tolerance"])
    assert float(taylor["history_tolerance"]) > 0.0


def test_work_follows_from_runs_beside_it_or_from_its_error_constant(data):
    """error = C h^p: a target that some run met costs what that run cost; four times less error, twice the work."""
    pair = "goldstein", "stormer-verlet[angles]"
    cell, fit = data.sel(scene=pair[0], variant=pair[1]), measures.fits(data, "axis")[pair]
    k = np.flatnonzero(fit.used)[-1]
    error, work = float(cell["axis"][k]), float(measures.evaluations_a_nutation(cell, "goldstein")[k])
    answers = measures.efficiencies(data, error)[pair]
    assert answers.work == pytest.approx(work, rel=0.1)
    assert not answers.foreseen
    assert measures.efficiencies(data, 1e3)[pair].foreseen  # all runs are closer: a longer step was not tried
    coarse, fine = (measures.efficiencies(data, target)[pair] for target in (1e-14, 25e-16))
    assert coarse.foreseen
    assert fine.work == pytest.approx(2.0 * coarse.work, rel=1e-6)
    assert ("goldstein", "rk45[angles]") not in measures.efficiencies(data, error)  # it has no step to choose
    # An implicit method iterates more at longer steps: the evaluations of other steps say nothing of these.
    pair = "goldstein", "midpoint[angles]"
    cell = data.sel(scene=pair[0], variant=pair[1])
    k = int(np.flatnonzero(measures.fits(data, "axis")[pair].used)[-1])
    error, forces = float(cell["axis"][k]), data["force_evaluations"].copy()
    forces.loc[{"scene": pair[0], "variant": pair[1], "setting": forces["setting"][k]}] *= 3.0
    variant = data.assign(force_evaluations=forces)
    before, after = (measures.efficiencies(each, error)[pair].work for each in (data, variant))
    assert after == pytest.approx(3.0 * before, rel=1e-9)


def test_a_variant_whose_order_cannot_be_judged_has_the_work_of_its_runs(data, monkeypatch):
    pair = "goldstein", "midpoint[angles]"
    expected = measures.efficiencies(data, 1e-4)[pair]
    unjudged = Fit(math.nan, math.nan, math.nan, np.zeros(data.sizes["setting"], bool))
    monkeypatch.setattr(measures, "fits", lambda *_: {pair: unjudged})
    assert (measures.efficiencies(data, 1e-4), measures.efficiencies(data, 1e-14)) == ({pair: expected}, {})
    monkeypatch.setattr(facts, "efficiencies", lambda *_: {pair: expected})
    assert facts.facts(data)["unknown"] == measures.stepping(data).sizes["variant"] - 1


def test_rows_show_the_axis_the_attitude_where_they_can_and_work_a_nutation_and_equal_ones_are_drawn_as_one(data):
    for name in ROWS:
        cell = data.sel(scene="goldstein", variant=name)
        assert np.isfinite(cell["axis"]).any()
        assert bool(np.isfinite(cell["attitude"]).any()) is (split_name(name)[1] != "axis")
    labels = measures.merged(measures.stepping(data), "axis")
    assert labels["strang[axis]"] == "strang[axis, attitude]"
    assert "strang[attitude]" not in labels
    assert labels["rk4[angles]"] == "rk4[angles]"  # another chart, other errors
    assert labels["rk4[axis]"] == "rk4[axis]"
    cell = data.sel(scene="goldstein", variant="stormer-verlet[angles]")
    work = measures.evaluations_a_nutation(cell, "goldstein")
    period, mask = symtop.scene("goldstein").nutation_period, np.isfinite(work)
    assert work[mask] == pytest.approx(period / cell["step_size"].values[mask], rel=0.05)


def test_the_page_says_what_was_measured_and_adaptive_errors_follow_their_tolerance(data, tmp_path):
    fits = measures.tolerance_fits(data)
    tolerance = 10.0 ** -np.arange(2.0, 10.0)  # errors near the bound are the reference's: they follow no tolerance
    columns = {"tolerance": tolerance, "axis": np.maximum(0.1 * tolerance, 5e-8), "axis_bound": np.full(8, 1e-8)}
    rows = {name: (("scene", "variant", "setting"), column[None, None]) for name, column in columns.items()}
    (fit,) = measures.tolerance_fits(xr.Dataset(rows, {"scene": ["goldstein"], "variant": ["rk45[angles]"]})).values()
    assert (fit.slope, fit.used.sum()) == (pytest.approx(1.0), 4)
    assert {name for _, name in fits} == {name for name in ROWS if integrator(name).adaptive}
    assert fits["goldstein", "rk45[angles]"].slope == pytest.approx(1.0, abs=0.15)
    checked_page("convergence", data, tmp_path)
    answers = facts.facts(data)
    assert answers["pairs"] == answers["confirmed"] + answers["refuted"] + answers["undecided"]
    assert answers["ratio_runs"] == sum(map(len, measures.ratios(data).values())) < answers["ratio_asked"]
    assert answers["ratio_most"] == max(float(values.max()) for values in measures.ratios(data).values() if values.size)
