"""The runner: resumes, recomputes nothing that is up to date, and survives damaged files."""

import dataclasses
import json

import numpy as np
import xarray as xr

import symtop
from symtop.core import netcdf
from symtop.measure.datasets import differences
from symtop.methods.framework.registry import Integrator
from symtop.runner import run as runner, store
from tests.commands import PROBE, call, contents


def test_every_study_leaves_figures_and_findings_that_follow_from_its_dataset(quick_results, tmp_path):
    """Nothing is said that the dataset on disk does not say again; `seconds` aside, nothing else is asked."""
    for name in runner.names():
        study, stored = runner.load(name), netcdf.read_any(quick_results / f"{name}.nc")
        assert all({"scene", "variant"} <= {*data.dims} for data in netcdf.groups(stored).values() if data.variables)
        findings = json.loads((quick_results / f"{name}.json").read_text(encoding="utf-8"))
        assert findings["failures"] == []
        assert findings["pictures"] or findings["facts"]["busy"]  # times of a busy machine are not drawn
        for picture in findings["pictures"]:
            assert (quick_results / "figures" / picture["file"]).stat().st_size > 5000
        again = runner.findings_of(study, stored, tmp_path, None, failures=[], cases=findings["cases"])
        assert json.loads(json.dumps(again["facts"])) == findings["facts"], name
        assert any(type(value) in (int, float) for value in findings["facts"].values()), name
        assert again["tables"] == findings["tables"], name
        for table in findings["tables"]:
            file = f"tables/{table['file']}"
            assert (tmp_path / file).read_bytes() == (quick_results / file).read_bytes(), file


def probe(results, *words):
    return call("study", PROBE, "--quick", "--results", results, *words, code=None)


def test_status_says_what_is_missing_done_and_stale(tmp_path):
    assert probe(tmp_path, "--status").output.startswith("probe: 4 missing\n")
    assert not (tmp_path / "quick").exists()  # looking leaves nothing behind
    assert probe(tmp_path).exit_code == 0
    assert probe(tmp_path, "--status").output == "probe: 4 done\n"
    case = next((tmp_path / "quick" / "cases" / "probe").glob("loop--midpoint*.npz"))
    older = case.with_name(f"{store.identity_of(case)}--{'0' * 20}.npz")
    case.rename(older)
    rows = json.loads(probe(tmp_path, "--status", "--json").output)["probe"]
    assert [row["state"] for row in rows] == ["done", "done", "stale", "done"]
    assert "1 of 4 cases computed" in probe(tmp_path).output
    assert not older.exists()


def test_fresh_computes_everything_and_the_files_are_the_same_to_the_byte(tmp_path):
    assert probe(tmp_path).exit_code == 0

    def bytes_of():  # but for the record of the files' times
        files = (path for path in tmp_path.rglob("*") if path.is_file() and path.name != "manifest.json")
        return {path: path.read_bytes() for path in files}

    before = bytes_of()
    result = probe(tmp_path, "--fresh", "--json")
    assert result.exit_code == 0
    (summary,) = json.loads(result.output)
    assert summary["computed"] == summary["cases"] == 4
    assert before == bytes_of()


def test_every_file_says_where_it_comes_from(tmp_path):
    assert probe(tmp_path).exit_code == 0
    for name, data in contents(tmp_path / "quick", provenance=True).items():
        expected = set(netcdf.provenance())
        if name.endswith(".npz"):
            expected |= {"study", "settings", "sources", "made_of", "seed"}
            assert data.attrs["sources"] in name
        assert expected <= set(data.attrs), name
        assert not any("time" in key or "date" in key for key in data.attrs)


def test_check_finds_a_value_that_this_version_does_not_compute(tmp_path):
    assert probe(tmp_path, "--check").exit_code == 2  # nothing is stored
    assert probe(tmp_path).exit_code == 0
    result = probe(tmp_path, "--check", "--fresh")
    assert result.exit_code == 0, result.output
    assert "4 of 4 cases computed again, the same to the last bit" in result.output
    victim = next((tmp_path / "quick" / "cases" / "probe").glob("*.npz"))
    study = runner.load(str(PROBE))
    (case,) = [one for one in study.cases(True) if one.label == victim.name.split("--")[0] + "--" + one.integrator
               and victim.name.startswith(f"{one.label}--")]  # fmt: skip
    data = store.load_case(victim)
    data["energy"][3] = np.nextafter(data["energy"].values[3], np.inf)
    store.save_case(data, victim, study, case)  # well made, and wrong
    result = probe(tmp_path, "--check", "--fresh")
    assert result.exit_code == 1
    assert "energy differs by up to" in result.output


def test_differences_leave_out_times_and_nothing_else():
    one = xr.Dataset({"axis": ("x", [1.0, float("nan")]), "seconds": ("x", [1.0, 2.0])}, attrs={"seed": 0})
    assert differences(one, one.copy(deep=True)) == []
    assert differences(one, one.assign(seconds=one["seconds"] * 2)) == []
    assert differences(one, one.assign(axis=one["axis"] * 2)) == ["axis differs by up to 1"]
    assert differences(one, one.drop_vars("axis")) == ["axis is in one of them only"]
    assert differences(one, one.assign_attrs(seed=1)) == ["attribute seed differs: 0 and 1"]
    beside = [one.assign_attrs(timed_at_once=n, timed_slowdown=x) for n, x in ((1, float("nan")), (2, 1.01))]
    assert differences(*beside) == []  # as times are, how they were taken is another matter each time
    assert len(differences(one, one.isel(x=[0]))) == 2  # also of the times: their shape


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
        result = call("study", tmp_path / "grids.py", "--results", tmp_path / "r", "--json", *words)
        return json.loads(result.output)

    for words, count in (([], 2), (["--full"], 2), ([], 0), (["--full"], 0)):
        assert computed(*words)[0]["computed"] == count, words
        cases = list((tmp_path / "r" / "cases" / "grids").glob("*.npz"))
        assert len(cases) == (2 if words == [] and count else 4)
        assert netcdf.read(tmp_path / "r" / "grids.nc")["steps"].values.max() == (1000.0 if words else 10.0)
    assert [row["state"] for row in computed("--status")["grids"]] == ["done", "done"]


def test_a_failing_case_is_reported_and_the_others_go_on(tmp_path, clean_registry):
    def solve(top, start, plan):
        raise RuntimeError("no luck")

    unlucky = Integrator(name="unlucky", family="other", summary="", solvers={"angles": solve})
    whole = runner.load("stability")
    cases = [case for case in whole.cases(True) if case.scene == "goldstein" and case.integrator == "midpoint[angles]"]
    cases.append(dataclasses.replace(cases[0], integrator="unlucky[angles]"))
    small = dataclasses.replace(whole, cases=lambda quick: cases)
    symtop.register(unlucky)
    findings = runner.run(small, tmp_path, quick=True, quiet=True)
    (failure,) = findings["failures"]
    assert failure == "unlucky[angles] on goldstein failed: integrator unlucky[angles] failed: RuntimeError: no luck"
    assert list(netcdf.read(tmp_path / "stability.nc")["variant"].values) == ["midpoint[angles]"]
    assert runner.run(small, tmp_path, quick=True, quiet=True)["failures"]  # tried again, not forgotten
