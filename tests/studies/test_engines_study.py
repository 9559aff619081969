"""The study of engines: errors against closed forms, orders and floors read off, and what its page says."""

import math

import numpy as np
import pytest
import xarray as xr
from symtop_studies.engines import facts, measures, study

import symtop
from symtop.methods.framework.registry import engines, integrator
from symtop.report.template import PARTIAL
from tests.templates import checked_page

GOLDSTEIN = symtop.scene("goldstein")


@pytest.fixture(scope="module")
def bodies():
    """Three maps and a method of the catalogue on both free bodies."""
    names = ["mujoco-euler[body]", "rkmk4[body]", "no-gyro[body]", "strang[body]"]
    rows = [xr.concat([study.measure(study.Case(key, name, {}, group="bodies")) for key in measures.BODIES], "scene")
            for name in names]  # fmt: skip
    return xr.concat(rows, "variant").assign_coords(scene=list(measures.BODIES), variant=names)


@pytest.fixture(scope="module")
def tree(bodies):
    """Two maps and a method of the catalogue on both tops and on twenty tops of the population."""
    names = ("mujoco-euler[axis]", "rapier-float32[attitude]", "no-gyro[axis]", "strang[axis]")
    settings = {"steps": 1e4, "long": 20.0}
    by_row = [xr.concat([study.measure(study.Case(scene, name, settings, group="tops")) for scene in measures.SCENES],
                        "scene", join="outer") for name in names]  # fmt: skip
    parts = [study.measure(study.Case("population", name, {"members": 20, "seed": 1}, group="pop")) for name in names]
    tops = xr.concat(by_row, "variant", join="outer").assign_coords(scene=list(measures.SCENES), variant=list(names))
    drawn = xr.concat(parts, "variant").expand_dims("scene").assign_coords(scene=["population"], variant=list(names))
    return xr.DataTree.from_dict({"tops": tops, "population": drawn, "bodies": bodies})


def test_every_map_has_a_row_whose_error_energy_and_spin_are_those_of_simulate():
    names = study.variant_names()
    assert {integrator(name).method for name in names} == {*engines(), *(row.split("[")[0] for row in study.COMPARED)}
    assert not any(name.endswith("[angles]") for name in names)
    row = measures.judged(GOLDSTEIN, integrator("yade[axis]"), 0.025, 10.0)
    run = symtop.simulate(GOLDSTEIN, "yade[axis]", step_size=0.025, horizon=10.0, samples=101, guard=False)
    assert row["axis"] == pytest.approx(float(symtop.errors(run)["axis"].max()), rel=1e-9)
    scale = abs(float(run["energy"][0])) + GOLDSTEIN.top.mgl
    assert row["energy"] == pytest.approx(float(run["energy"][-1] - run["energy"][0]) / scale, rel=1e-9)
    largest = max(abs(float(run[name][0])) for name in ("p_phi", "p_psi"))
    assert row["spin"] == pytest.approx(float(run["p_psi"][-1] - run["p_psi"][0]) / largest, rel=1e-9)
    row = measures.judged(symtop.scene("fast"), integrator("mujoco-euler[axis]"), 1.0 / 60.0, 100.0)
    assert row["axis"] == math.pi
    assert not math.isfinite(row["energy"])


def test_what_was_not_measured_is_none(tree):
    """On the fast top alone there is no error against steps; on the population no scene."""
    subset = xr.DataTree.from_dict({"tops": tree["tops"].to_dataset().sel(scene=["fast"])})
    answers = facts.facts(subset)
    assert answers["members"] is answers["energy_lost"] is None
    assert np.isnan([answers["wall"], answers["share_most"]]).all()
    assert [picture.name for picture in study.STUDY.pictures(subset)] == ["cost"]
    part = xr.DataTree.from_dict({"tops": tree["tops"].to_dataset().sel(variant=["no-gyro[axis]"])})
    for data, count in ((tree, 5), (part, 1)):  # entries of the key: what is drawn, and no more
        assert len(next(iter(study.STUDY.pictures(data))).figure.legends[0].get_texts()) == count
    population = xr.DataTree.from_dict({"population": tree["population"].to_dataset()})
    assert facts.facts(population)["share_most"] == facts.facts(tree)["share_most"]
    assert list(study.STUDY.pictures(population)) == []


def test_on_free_bodies_the_order_and_the_term_decide(bodies):
    names = [str(name) for name in bodies["variant"].values]
    data = xr.DataTree.from_dict({"bodies": bodies})
    brick = bodies["attitude"].sel(scene="check-case-2")
    by_rate = dict(zip(names, np.log2(brick.sel(rate=60.0) / brick.sel(rate=240.0)) / 2.0, strict=True))
    assert float(by_rate["mujoco-euler[body]"]) == pytest.approx(1.0, abs=0.1)
    assert float(by_rate["rkmk4[body]"]) == pytest.approx(4.0, abs=0.1)
    assert float(by_rate["strang[body]"]) == pytest.approx(2.0, abs=0.1)
    assert abs(float(by_rate["no-gyro[body]"])) < 0.01
    assert float(bodies["energy"].sel(scene="check-case-2", variant="no-gyro[body]").max()) < 1e-13
    answers = facts.facts(data)
    assert (answers["body_maps"], answers["case_best_variant"]) == (2, "rkmk4[body]")
    assert answers["case_worst"] == float(brick.sel(variant="mujoco-euler[body]", rate=240.0))
    assert answers["case_wall"] == pytest.approx(1.23, abs=0.01)
    assert (len(facts.lines(data)), next(iter(facts.tables(data)["bodies"]["variant"]))) == (0, "rkmk4[body]")
    assert len(facts.tables(xr.DataTree())["bodies"]) == 0


@pytest.mark.parametrize("rate", [2.5, -0.7])
def test_the_azimuth_is_counted_over_whole_turns_and_in_both_directions(rate):
    time = np.linspace(0.0, 40.0, 400)
    tilt = 0.6 + 0.1 * np.sin(3.0 * time)
    e = np.stack([np.sin(tilt) * np.cos(rate * time), np.sin(tilt) * np.sin(rate * time), np.cos(tilt)], axis=1)
    assert measures.azimuth(e) == pytest.approx(40.0 * rate, rel=1e-12)
    assert math.isnan(measures.azimuth(np.vstack([e, np.full(3, np.nan)])))


def test_a_fast_top_precesses_as_a_spherical_one_without_the_term_and_four_evaluations_cost_a_quarter_of_the_steps():
    """mgl/(I3 w3) becomes mgl/(I1 w3): half of it, as I1 = 2 I3; with the term it is the rate of the top."""
    fast = symtop.scene("fast")
    ratio = fast.top.I3 / fast.top.I1 - 1.0
    no_gyro, whole = (measures.judged(fast, integrator(name), 1e-3, 10.0) for name in ("no-gyro[axis]", "strang[axis]"))
    assert no_gyro["precession"] == pytest.approx(ratio, abs=2e-3)
    assert abs(whole["precession"]) < 1e-4
    long = measures.judged(GOLDSTEIN, integrator("strang[axis]"), 0.02, 1000.0)
    assert abs(long["precession"]) < 0.01  # of more turns than samples that are shown
    rkmk4 = measures.frames(GOLDSTEIN, integrator("rkmk4[axis]"), (10.0, 11.0))
    implicit = measures.frames(GOLDSTEIN, integrator("mujoco-implicit[axis]"), (10.0, 11.0))
    assert float(rkmk4["forces_a_step"]) == 4.0
    made_long = rkmk4.sel(horizon=10.0)
    assert float(made_long["level_axis"].sel(rate=240.0)) == float(made_long["frame_axis"].sel(rate=60.0))
    assert float(implicit["forces_a_step"]) == 1.0
    assert implicit["level_axis"].values.tolist() == implicit["frame_axis"].values.tolist()


def test_orders_walls_and_floors_are_read_off_and_shares_count_tops_within_five_degrees(tree):
    """A method whose error is rounding alone has no order; one without the term is counted to order 0."""
    lines = facts.lines(tree)
    assert lines["order"]["mujoco-euler[axis]"] == pytest.approx(1.0, abs=0.15)
    assert lines["order"]["strang[axis]"] == pytest.approx(2.0, abs=0.05)
    assert abs(lines["order"]["no-gyro[axis]"]) < 0.05
    assert dict(lines["group"]) == {
        "mujoco-euler[axis]": 1.0, "rapier-float32[attitude]": 1.0, "no-gyro[axis]": 0.0, "strang[axis]": 2.0,
    }  # fmt: skip
    tops = tree["tops"].to_dataset()
    rounded = xr.DataTree.from_dict({"tops": tops.assign(axis=tops["axis"].where(tops["axis"].isnull(), 1e-15))})
    assert facts.lines(rounded)["order"].isna().all()
    by_order = facts.tables(tree)["orders"].set_index("measured order")["maps"]
    assert [*by_order.items()] == [(0.0, 1), (1.0, 1)]  # in double
    angles = tree["population"]["off"].sel(scene="population", variant="strang[axis]").values
    assert lines["share"]["strang[axis]"] == np.mean(np.degrees(angles) <= 5.0) > lines["share"]["no-gyro[axis]"]


def test_facts_are_those_of_the_runs_and_the_page_has_them(tree, tmp_path):
    """The wall of a map without the term, its distance from the spherical top, and the ends of the field."""
    answers, lines, tops = facts.facts(tree), facts.lines(tree), tree["tops"].to_dataset()
    axis, row = tops["axis"].sel(scene="goldstein"), tops.sel(scene="goldstein", rate=240.0, horizon=10.0)
    assert answers["wall"] == float(axis.sel(variant="no-gyro[axis]").min()) > 1.5
    assert answers["spherical"] == float(row["frame_spherical"].sel(variant="no-gyro[axis]")) < 0.01
    assert float(row["frame_spherical"].sel(variant="mujoco-euler[axis]")) > 0.1
    assert answers["best"] == answers["worst"] == float(row["frame_axis"].sel(variant="mujoco-euler[axis]"))
    assert (answers["maps"], answers["turned"], answers["singles"], answers["members"]) == (2, 1, 1, 20)
    assert answers["lost"] == 1  # mujoco-euler flies apart on the fast top
    float32 = "rapier-float32[attitude]"
    assert lines["best_count"][float32] == float(axis.sel(variant=float32).idxmin("per_nutation"))
    variant = tops.assign_coords(per_nutation=4.0 * tops["per_nutation"]).assign(frame_axis=0.0 * tops["frame_axis"])
    variant["axis"] = (1.0 / np.minimum(variant["per_nutation"], 3000.0)).where(variant["axis"].notnull())
    variant["frame_energy"] = xr.where(tops["variant"] == "no-gyro[axis]", np.nan, -0.5) + 0.0 * tops["frame_energy"]
    variant = xr.DataTree.from_dict({"tops": variant})
    assert (facts.facts(variant)["lost"], facts.facts(variant)["energy_lost"]) == (1, 2)  # one of them has ended
    assert facts.lines(variant)["order"]["strang[axis]"] == pytest.approx(1.0)
    worse = tops.assign(axis=2.0 * tops["axis"]).sel(variant=["no-gyro[axis]"])
    data = xr.concat([tops, worse.assign_coords(variant=["no-gyro-linear[axis]"])], "variant")
    assert facts.facts(xr.DataTree.from_dict({"tops": data}))["wall"] == answers["wall"]
    assert answers["single_best"] > 1e-3
    assert PARTIAL not in checked_page("engines", tree, tmp_path)
