"""The convergence study: variants, adaptive methods beside them, and one rule for verdicts."""

import math
import re

import numpy as np
import pytest
import xarray as xr
from symtop_studies.convergence import figures, study, tables, words

import symtop
from symtop.judging.battery import CLAIMS
from symtop.judging.claims.order import measured_order
from symtop.measure.order import BESIDE, order_verdict
from symtop.methods.framework.registry import integrator, methods, split_name, variants
from symtop.report import style
from symtop.runner import store
from symtop.runner.study import Case

ROWS = ("midpoint[angles]", "trapezoidal[angles]", "stormer-verlet[angles]", "strang[axis]", "strang[attitude]",
        "rk4[angles]", "rk4[axis]", "gauss-12[attitude]", "rk45[angles]", "rk45-compiled[angles]", "radau[angles]",
        "taylor[axis]")  # fmt: skip


@pytest.fixture(scope="module")
def data():
    """A small grid on one scene."""
    chosen = [case for case in study.on_scene("goldstein", quick=True) if case.integrator in ROWS]
    assert {case.integrator for case in chosen} == set(ROWS)
    longer = [Case(case.scene, case.integrator, case.settings | {"dense": True}) for case in chosen]
    return store.combine([(case, study.measure(case)) for case in longer])


def test_every_chart_of_every_method_is_a_row_and_a_formula_is_none():
    names = {case.integrator for case in study.cases(False)}
    with_order = {name for name, one in methods().items() if one.control and not one.exact_steps}
    assert names == {row.name for row in variants() if row.control is not None and not row.exact_steps}
    assert {split_name(name)[0] for name in names} == with_order
    assert not any(split_name(name)[0] == "exact" for name in names)


def test_every_row_shows_the_axis_and_the_attitude_where_its_chart_does(data):
    for name in ROWS:
        cell = data.sel(scene="goldstein", variant=name)
        assert np.isfinite(cell["axis"]).any()
        assert bool(np.isfinite(cell["attitude"]).any()) is (split_name(name)[1] != "axis")


def test_verdicts_are_those_of_the_one_rule_and_no_interval_misses_the_order(data):
    results = tables.judged(data)
    assert {name for _, name in results} == {name for name in ROWS if integrator(name).fixed_step}
    for (_, name), (word, slopes) in results.items():
        declared, main = integrator(name).order, slopes["axis"]
        others = [fit for quantity, fit in slopes.items() if quantity != "axis"]
        assert word == order_verdict(declared, main, others)
        if math.isfinite(main.slope):
            assert abs(main.slope - declared) <= main.interval + BESIDE, name
    assert sum(word == "confirmed" for word, _ in results.values()) >= 7


def test_a_wrong_declaration_is_refuted(data, monkeypatch):
    monkeypatch.setattr(tables, "declared_order", lambda name: 3)
    assert {tables.judged(data)["goldstein", name].verdict for name in ("strang[axis]", "rk4[axis]")} == {"refuted"}


def test_rows_with_the_same_errors_are_drawn_as_one(data):
    labels = tables.merged(tables.stepping(data), "axis")
    assert labels["strang[axis]"] == "strang[axis, attitude]"
    assert "strang[attitude]" not in labels
    assert labels["rk4[angles]"] == "rk4[angles]"  # another chart, other errors
    assert labels["rk4[axis]"] == "rk4[axis]"


def test_adaptive_methods_are_drawn_against_their_tolerance(data):
    fitted = tables.tolerance_fits(data)
    assert {name for _, name in fitted} == {name for name in ROWS if integrator(name).adaptive}
    assert fitted["goldstein", "rk45[angles]"].slope == pytest.approx(1.0, abs=0.15)
    (sentence,) = words.tolerance_sentence(data)
    assert "fall as tolerance^" in sentence
    slopes = words.by_tolerance(data)["rk45[angles]"].slopes
    assert slopes == [fitted["goldstein", "rk45[angles]"].slope]
    assert words.tolerance_sentence(tables.stepping(data)) == []


def test_the_first_figure_shows_the_five_named_methods_by_step_tolerance_and_work(data):
    drawn = figures.pictures(data)
    assert [picture.name for picture in drawn] == ["named-methods", "constants", "tolerance"]
    steps, tolerances, work, energy = (
        {split_name(label)[0] for label in axis.get_legend_handles_labels()[1] if "[" in label}
        for axis in drawn[0].figure.axes
    )
    assert work == steps | tolerances == set(figures.NAMED)
    assert steps == {"midpoint", "trapezoidal", "stormer-verlet"}
    assert energy == set()  # these cases have no history: they are not of the scene that has one
    assert not drawn[0].figure.axes[3].get_visible()


def test_the_titles_have_numbers_that_their_figures_show(data):
    _, constants, tolerance = figures.pictures(data)
    for picture in (constants, tolerance):
        title = " ".join(picture.figure.get_suptitle().split("\n"))
        said = [text.get_text() for axis in picture.figure.axes for text in axis.texts]
        assert said
        assert any(text in title for text in said)
    heads = [text for axis in constants.figure.axes for text in axis.get_yticklabels() if text.get_weight() == "bold"]
    assert {text.get_text() for text in heads} == {"order 2", "order 4"}
    (axis,) = tolerance.figure.axes
    numbers = re.findall(r"[\d.]+ times", " ".join(tolerance.figure.get_suptitle().split("\n")))
    assert numbers == [text.get_text() for text in sorted(axis.texts, key=lambda text: text.xy[0])]
    ratios = np.concatenate([line.get_xdata() for line in axis.get_lines() if line.get_markersize() == 2.5])
    fitted = tables.tolerance_fits(data)
    assert ratios.size == sum(
        int(fit.used.sum()) for fit in fitted.values()
    )  # every run that counts is drawn, no other
    assert numbers == [f"{style.number(value)} times" for value in (np.median(ratios), ratios.max())]
    (equal,) = [line for line in axis.get_lines() if line.get_label() == "error = tolerance"]
    assert set(equal.get_xdata()) == {1.0}


def test_the_energy_over_time_is_that_of_the_run_that_it_names():
    scene = symtop.scene("spheroid")
    verlet, taylor = (tables.energy_history(scene, integrator(name), 20.0) for name in ("stormer-verlet", "taylor"))
    assert float(verlet["history_time"].max()) == pytest.approx(20.0)
    run = symtop.simulate(scene, "stormer-verlet", step_size=scene.nutation_period / 100.0,
                          horizon=20.0 * scene.nutation_period, samples=801, guard=False)  # fmt: skip
    largest = float(np.abs(run["energy"] - run["energy"][0]).max())
    assert float(verlet["history_energy"].max()) == pytest.approx(largest / scene.energy_scale, rel=1e-6)
    assert float(taylor["history_energy"].max()) < 1e-12 < float(verlet["history_energy"].max())
    assert np.isnan(verlet["history_tolerance"])
    assert float(taylor["history_tolerance"]) > 0.0


def test_the_work_of_an_error_constant_is_the_work_of_a_run_with_that_error(data):
    """error = C h^p: a target that some run met costs what that run cost; four times less error, twice the work."""
    cell = data.sel(scene="goldstein", variant="stormer-verlet[angles]")
    fit = tables.fits(data, "axis")["goldstein", "stormer-verlet[angles]"]
    k = np.flatnonzero(fit.used)[-1]
    error, work = float(cell["axis"][k]), float(tables.evaluations_a_nutation(cell, "goldstein")[k])
    found = tables.efficiencies(data, error)["goldstein", "stormer-verlet[angles]"]
    assert found.work == pytest.approx(work, rel=0.1)
    assert not found.foreseen
    beyond = tables.efficiencies(data, error / 4.0)["goldstein", "stormer-verlet[angles]"]
    assert beyond.work == pytest.approx(2.0 * found.work, rel=1e-6)
    assert tables.efficiencies(data, 1e-14)["goldstein", "stormer-verlet[angles]"].foreseen
    assert ("goldstein", "rk45[angles]") not in tables.efficiencies(data, error)  # it has no step to choose


def test_work_is_counted_per_nutation(data):
    cell = data.sel(scene="goldstein", variant="stormer-verlet[angles]")
    work = tables.evaluations_a_nutation(cell, "goldstein")
    period = symtop.scene("goldstein").nutation_period
    good = np.isfinite(work)
    assert work[good] == pytest.approx(period / cell["step_size"].values[good], rel=0.05)


def test_the_ledger_and_the_study_say_the_same_of_an_order():
    """An interval that holds the order confirms it in both; what is neither 5 nor clearly another is open in both."""
    assert "order" in CLAIMS
    radau = measured_order(integrator("radau"), symtop.scene("spheroid"), quick=True)
    assert order_verdict(5, radau.fits[radau.observed]) != "confirmed"
    verlet = measured_order(integrator("stormer-verlet"), symtop.scene("spheroid"), quick=True)
    assert order_verdict(2, verlet.fits[verlet.observed], verlet.fits.values()) == "confirmed"


def test_tables_hold_a_row_for_every_pair_and_say_what_a_chart_does_not_show(data):
    *_, orders, tolerances = words.tables(data)
    assert len(orders.rows) == len(tables.judged(data))
    by_name = {row[1]: row for row in orders.rows}
    assert "not shown" in by_name["strang[axis]"]
    assert "not shown" not in by_name["strang[attitude]"]
    assert {row[1] for row in tolerances.rows} == {name for name in ROWS if integrator(name).adaptive}
    assert isinstance(data, xr.Dataset)
