"""The runner: resumes, recomputes nothing that is up to date, and survives damaged files."""

import dataclasses
import json

import numpy as np
import pytest
import xarray as xr
from symtop_studies.grid import grid_scenes

import symtop
from symtop.core import netcdf
from symtop.core.errors import SymtopError
from symtop.measure import datasets
from symtop.measure.datasets import differences
from symtop.methods.framework.registry import Integrator
from symtop.model import scenes as catalogue
from symtop.model.scenes import TAGS
from symtop.runner import run as runner, store
from symtop.runner.study import Case
from tests.commands import PROBE, call, contents, probe


def test_every_study_leaves_figures_and_findings_that_follow_from_its_dataset(quick_results, tmp_path):
    """Nothing is said that the dataset on disk does not say again; `seconds` aside, nothing else is asked."""
    for name in runner.names():
        study, tree = runner.load(name), netcdf.read_any(quick_results / f"{name}.nc")
        assert all({"scene", "variant"} <= {*data.dims} for data in netcdf.groups(tree).values() if data.variables)
        findings = json.loads((quick_results / f"{name}.json").read_text(encoding="utf-8"))
        assert findings["failures"] == []
        assert findings["pictures"] or findings["facts"]["busy"]  # times of a busy machine are not drawn
        for picture in findings["pictures"]:
            assert (quick_results / "figures" / picture["file"]).stat().st_size > 5000
        repeat = runner.findings_of(study, tree, tmp_path, None, failures=[], cases=findings["cases"])
        assert json.loads(json.dumps(repeat["facts"])) == findings["facts"], name
        assert any(type(value) in (int, float) for value in findings["facts"].values()), name
        assert repeat["tables"] == findings["tables"], name
        for table in findings["tables"]:
            file = f"tables/{table['file']}"
            assert (tmp_path / file).read_bytes() == (quick_results / file).read_bytes(), file


def test_fresh_computes_everything_and_the_files_are_the_same_to_the_byte(tmp_path):
    probe(tmp_path)

    def bytes_of():  # but for the record of the files' times
        files = (path for path in tmp_path.rglob("*") if path.is_file() and path.name != "manifest.json")
        return {path: path.read_bytes() for path in files}

    before = bytes_of()
    (summary,) = json.loads(probe(tmp_path, "--fresh", "--json"))
    assert summary["computed"] == summary["cases"] == 4
    assert before == bytes_of()


def test_status_says_what_is_missing_and_every_file_where_it_comes_from(tmp_path):
    assert probe(tmp_path, "--status").startswith("probe: 4 missing\n")
    assert not (tmp_path / "quick").exists()  # looking leaves nothing behind
    probe(tmp_path)
    assert probe(tmp_path, "--status") == "probe: 4 done\n"
    case = next((tmp_path / "quick" / "cases" / "probe").glob("loop--midpoint*.npz"))
    older = case.with_name(f"{store.identity_of(case)}--{'0' * 20}.npz")
    case.rename(older)
    rows = json.loads(probe(tmp_path, "--status", "--json"))["probe"]
    assert [row["state"] for row in rows] == ["done", "done", "stale", "done"]
    assert "1 of 4 cases computed" in probe(tmp_path)
    assert not older.exists()
    probe(tmp_path)
    for name, data in contents(tmp_path / "quick", provenance=True).items():
        expected = set(netcdf.provenance())
        if name.endswith(".npz"):
            expected |= {"study", "settings", "sources", "made_of", "seed"}
            assert data.attrs["sources"] in name
        assert expected <= set(data.attrs), name
        assert not any("time" in key or "date" in key for key in data.attrs)


def test_check_finds_a_value_that_this_version_does_not_compute(tmp_path):
    probe(tmp_path, "--check", code=2)  # nothing is stored
    probe(tmp_path)
    assert "4 of 4 cases computed again, the same to the last bit" in probe(tmp_path, "--check", "--fresh")
    path, study = next((tmp_path / "quick" / "cases" / "probe").glob("*.npz")), runner.load(str(PROBE))
    (case,) = [case for case in study.cases(True) if case.label == path.name.split("--")[0] + "--" + case.integrator
               and path.name.startswith(f"{case.label}--")]  # fmt: skip
    data = store.load_case(path)
    data["energy"][3] = np.nextafter(data["energy"].values[3], np.inf)
    store.save_case(data, path, study, case)  # well made, and wrong
    assert "energy differs by up to" in probe(tmp_path, "--check", "--fresh", code=1)


def test_differences_leave_out_times_and_nothing_else():
    data = xr.Dataset({"axis": ("x", [1.0, float("nan")]), "seconds": ("x", [1.0, 2.0])}, attrs={"seed": 0})
    assert differences(data, data.copy(deep=True)) == []
    assert differences(data, data.assign(seconds=data["seconds"] * 2)) == []
    assert differences(data, data.assign(axis=data["axis"] * 2)) == ["axis differs by up to 1"]
    priced, steps = (data.rename(axis=name) for name in ("price", "sampled_steps"))
    assert differences(priced, priced.assign(price=priced["price"] * 2)) == []
    assert len(differences(steps, steps.assign(sampled_steps=steps["sampled_steps"] * 2))) == 1
    assert differences(data, data.drop_vars("axis")) == ["axis is in one of them only"]
    assert differences(data, data.assign_attrs(seed=1)) == ["attribute seed differs: 0 and 1"]
    pair = [data.assign_attrs(timed_at_once=n, timed_slowdown=x) for n, x in ((1, float("nan")), (2, 1.01))]
    assert differences(*pair) == []  # as times are, how they were taken is another matter each time
    assert len(differences(data, data.isel(x=[0]))) == 2  # also of the times: their shape


GRIDS = """
import xarray as xr
from symtop.runner.study import Case, Picture, Study

def grid(count):
    return [Case("spheroid", name, {"steps": count}) for name in ("midpoint", "strang")]

def measure(case):
    return xr.Dataset({"steps": float(case.settings["steps"])})

STUDY = Study("grids", "Grids", "Kept?", lambda quick: grid(10), measure, full=lambda: grid(1000))
"""


def test_the_full_grid_and_the_ordinary_one_keep_each_others_cases(tmp_path):
    """Same scene and integrator, other settings: neither replaces the other."""
    (tmp_path / "grids.py").write_text(GRIDS)

    def computed(*words):
        return json.loads(call("study", tmp_path / "grids.py", "--results", tmp_path / "r", "--json", *words).output)

    for words, count in (([], 2), (["--full"], 2), ([], 0), (["--full"], 0)):
        assert computed(*words)[0]["computed"] == count, words
        assert len(list((tmp_path / "r" / "cases" / "grids").glob("*.npz"))) == (2 if words == [] and count else 4)
        assert netcdf.read(tmp_path / "r" / "grids.nc")["steps"].values.max() == (1000.0 if words else 10.0)
    assert [row["state"] for row in computed("--status")["grids"]] == ["done", "done"]


def test_a_failing_case_is_reported_and_the_others_go_on(tmp_path, clean_registry):
    def solve(top, start, plan):
        raise RuntimeError("no luck")

    unlucky = Integrator(name="unlucky", family="other", summary="", solvers={"angles": solve})
    study = runner.load("stability")
    cases = [case for case in study.cases(True) if case.scene == "goldstein" and case.integrator == "midpoint[angles]"]
    cases.append(dataclasses.replace(cases[0], integrator="unlucky[angles]"))
    small = dataclasses.replace(study, cases=lambda quick: cases)
    symtop.register(unlucky)
    (failure,) = runner.run(small, tmp_path, quick=True, quiet=True)["failures"]
    assert failure == "unlucky[angles] on goldstein failed: integrator unlucky[angles] failed: RuntimeError: no luck"
    assert list(netcdf.read(tmp_path / "stability.nc")["variant"].values) == ["midpoint[angles]"]
    assert runner.run(small, tmp_path, quick=True, quiet=True)["failures"]  # tried again, not forgotten


@pytest.mark.parametrize("study", ["convergence", "drift", "claims"])
@pytest.mark.parametrize("quick", [False, True])
def test_a_scene_that_joins_the_catalogue_is_in_every_study(study, quick, monkeypatch):
    new = dataclasses.replace(symtop.scene("loop"), name="brand-new", tags=())
    scenes = catalogue._catalogue()
    monkeypatch.setattr(catalogue, "_catalogue", lambda: {**scenes, new.name: new})
    assert [*dict.fromkeys(case.scene for case in runner.load(study).cases(quick))][-1] == new.name


def test_scenes_are_left_out_by_the_question_and_by_their_tags():
    assert "separatrix" not in grid_scenes({}, lambda scene: scene.nutation_period < 70.0)
    assert "separatrix" in grid_scenes({})
    assert grid_scenes(TAGS) == ["spheroid"]
    assert "loop" in grid_scenes({"steady": "no nutation"})
    assert "steady" not in grid_scenes({"steady": "no nutation"})
    with pytest.raises(symtop.SymtopError, match="left_out 'staedy' is unknown; did you mean steady"):
        grid_scenes({"staedy": "no nutation"})


LONG = xr.Dataset({"energy": ("window", [1.0, 2.0, 3.0]), "outcome": "ok", "steps": 3})
SHORT = xr.Dataset({"energy": ("window", [4.0]), "outcome": "ok", "steps": 1})
PHASE = xr.Dataset({"energy": ("sample", np.arange(4, dtype=np.uint8))})


def tree(phase: xr.Dataset = PHASE) -> xr.DataTree:
    return datasets.combine([
        (Case("spheroid", "midpoint", group="windows"), LONG), (Case("goldstein", "midpoint", group="windows"), SHORT),
        (Case("spheroid", "strang", group="phases"), phase),
    ])  # fmt: skip


def test_single_precision_stays_and_is_stored_in_little_space(tmp_path):
    """Ten bits of each number; the same in double precision, which is not compressed, for comparison."""
    size, power = np.frexp(np.random.default_rng(1).lognormal(size=(3, 40_000)))
    rounded, sizes = np.ldexp(np.rint(np.ldexp(size, 10)), power - 10), {}
    for kind in (np.float32, np.float64):
        cases = [(Case("spheroid", name), xr.Dataset({"cost": ("member", row.astype(kind)[: 40_000 - (k == 2)])}))
                 for k, (name, row) in enumerate(zip(("rk4", "strang", "midpoint"), rounded, strict=True))]  # fmt: skip
        path = netcdf.write(datasets.combine(cases), tmp_path / f"{kind.__name__}.nc")
        data = netcdf.read(path)["cost"].sel(scene="spheroid")
        assert data.dtype == kind
        np.testing.assert_array_equal(data.values[:2], rounded[:2])
        assert np.isnan(data.values[2, -1])  # what a shorter case does not fill
        sizes[kind] = path.stat().st_size
    assert sizes[np.float32] < 0.25 * sizes[np.float64]


def test_a_tree_is_read_as_it_was_written_and_a_check_names_the_group_that_differs(tmp_path):
    data = netcdf.describe(tree(), "Groups", question="Does it come back?")
    copy = netcdf.read_any(netcdf.write(data, tmp_path / "groups.nc"))
    assert (differences(data, copy), copy["phases/energy"].dtype) == ([], np.uint8)
    assert (copy.attrs["question"], copy["windows/energy"].attrs["long_name"]) == ("Does it come back?", "total energy")
    assert differences(tree(), tree()) == []
    (difference,) = differences(tree(), tree(PHASE + np.uint8(1)))
    assert difference.startswith("phases: energy differs")
    partial = tree()
    del partial["phases"]
    assert differences(tree(), partial) == ["group phases is in one of them only"]
    assert differences(LONG, LONG) == []


def test_cases_that_would_replace_each_other_or_have_no_group_are_refused():
    """A study of three steps of each method, say, whose cases differ in their settings alone."""
    steps = [(Case("spheroid", "rk4", {"n": n}), LONG) for n in (6, 3)]
    with pytest.raises(SymtopError, match="two cases of rk4 on spheroid measure energy, and one would replace the"):
        datasets.combine(steps)
    timing = LONG.rename(energy="seconds", outcome="told", steps="calls")
    data = datasets.combine([steps[0], (steps[1][0], timing)])  # the control: a round that measures something else
    assert {"energy", "seconds"} <= set(data.data_vars)
    separate = datasets.combine([(Case("spheroid", "rk4", {"n": n}, group=f"n-{n}"), LONG) for n in (6, 3)])
    assert set(separate.children) == {"n-6", "n-3"}
    cases = [(Case("spheroid", "midpoint"), LONG), (Case("spheroid", "strang", group="windows"), LONG)]
    with pytest.raises(SymtopError, match="case spheroid--midpoint has no group"):
        datasets.combine(cases)


def test_cases_that_differ_in_their_group_alone_have_files_and_scenes_of_their_own(tmp_path):
    data = tree()
    assert isinstance(data, xr.DataTree)
    assert not data.to_dataset().variables
    assert dict(data["windows"].sizes) == {"scene": 2, "variant": 1, "window": 3}
    assert dict(data["phases"].sizes) == {"scene": 1, "variant": 1, "sample": 4}
    values = data["windows/energy"].sel(scene="goldstein", variant="midpoint").values
    np.testing.assert_array_equal(values, [4.0, np.nan, np.nan])
    study = runner.load("drift")
    cases = [Case("spheroid", "strang", {"steps": 1}, group=group) for group in ("windows", "rounding")]
    paths = [store.case_path(tmp_path, study, case) for case in cases]
    assert len({store.identity_of(path) for path in paths}) == 2
    assert len({store.digest_of(path) for path in paths}) == 2
