"""The runner: resumes, recomputes nothing that is up to date, and survives damaged files."""

import dataclasses
import importlib
import json
import linecache
import math
import os
import re
import shutil
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner
from symtop_studies.reduction import commutation

import symtop
from symtop.cli.main import main
from symtop.core import code_hash, netcdf
from symtop.core.code_hash import PACKAGE
from symtop.methods.framework import registry
from symtop.methods.framework.fixed_step import inside
from symtop.methods.framework.registry import Integrator, is_built_in
from symtop.report import style
from symtop.runner import check, depends, run as runner, store
from symtop.runner.conclude import code_of
from symtop.runner.study import Case
from tests.commands import PROBE, ended, symtop as symtop_command


def measured(path: Path) -> list[xr.Dataset]:
    """The datasets of a study: one, or one a group."""
    return [group for group in netcdf.groups(netcdf.read_any(path)).values() if group.variables]


def test_every_study_leaves_a_dataset_figures_and_findings(quick_results):
    for name in runner.names():
        for data in measured(quick_results / f"{name}.nc"):
            assert {"scene", "variant"} <= set(data.dims)
            assert not {"method", "tolerance"} & set(data.dims)
        findings = json.loads((quick_results / f"{name}.json").read_text())
        assert findings["verdict"]
        assert findings["failures"] == []
        assert findings["pictures"]
        for picture in findings["pictures"]:
            assert (quick_results / "figures" / picture["file"]).stat().st_size > 5000
            assert picture["caption"]
            assert picture["alt"]


def test_the_second_time_nothing_is_computed_and_damaged_cases_are(quick_results, tmp_path):
    shutil.copytree(quick_results, tmp_path, dirs_exist_ok=True)
    study = runner.load("convergence")
    again = runner.run(study, tmp_path, quick=True, quiet=True, save=style.save)
    assert again["computed"] == 0
    before = netcdf.read(tmp_path / "convergence.nc")
    victims = sorted((tmp_path / "cases" / "convergence").glob("*.nc"))[:3]
    victims[0].write_bytes(victims[0].read_bytes()[:1000])
    victims[1].write_bytes(b"\0" * 4096)
    victims[2].unlink()
    mended = runner.run(study, tmp_path, quick=True, quiet=True, save=style.save)
    assert mended["computed"] == 3
    assert netcdf.read(tmp_path / "convergence.nc").equals(before)


def test_every_sentence_and_table_of_the_report_follows_from_a_stored_dataset(quick_results):
    """Nothing is said that the dataset on disk does not say again; `seconds` aside, nothing else is asked."""
    for name in runner.names():
        study, stored = runner.load(name), netcdf.read_any(quick_results / f"{name}.nc")
        said = json.loads((quick_results / f"{name}.json").read_text(encoding="utf-8"))
        assert study.verdict(stored) == said["verdict"], name
        assert json.loads(json.dumps([table._asdict() for table in study.tables(stored)])) == said["tables"], name
        assert any(digit in " ".join(said["verdict"]) for digit in "123456789"), name  # and there are numbers in it


def test_the_report_is_one_page_without_outside_references(quick_results):
    done = CliRunner().invoke(main, ["report", "--results", str(quick_results)])
    assert done.exit_code == 0, done.output
    text = (quick_results / "report.html").read_text()
    shown = re.findall(r'<img[^>]* src="([^"]*)"', text)
    assert len(shown) >= 4
    assert all((quick_results / source).is_file() for source in shown)
    for outside in ("http://", "https://", "<script src", "<link"):
        assert outside not in text
    for name in runner.names():
        assert f'id="{name}"' in text


# ---- what a case depends on ------------------------------------------------------------------------------------------


def pretend_edited(patch, path):
    """Let one file have another hash."""
    real = code_hash.file_hash
    patch.setattr(code_hash, "file_hash", lambda file: real(file) + ("edited" if file == path else ""))
    depends.hashes.cache_clear()


def stale_after(edited: str, study) -> set[str]:
    """Integrators of a study's cases whose digest changes with one file of the package."""
    path = PACKAGE / edited
    assert path.is_file()
    cases = study.cases(True)
    before = [depends.digest(study, case) for case in cases]
    with pytest.MonkeyPatch.context() as patch:
        pretend_edited(patch, path)
        after = [depends.digest(study, case) for case in cases]
    depends.hashes.cache_clear()
    assert before == [depends.digest(study, case) for case in cases]
    return {case.integrator for case, one, two in zip(cases, before, after, strict=True) if one != two}


def of_everyone():
    """The probe with every integrator of the registry."""
    cases = [Case("goldstein", name, {}) for name in symtop.integrators()]
    return dataclasses.replace(runner.load(str(PROBE)), cases=lambda quick: cases)


GAUSS = {f"gauss-{order}" for order in (2, 4, 6, 8, 10, 12)}
COLLECTIVE = {f"collective-gauss-{order}" for order in (2, 4, 6)}
PAIRS = {"rk45-compiled", "extrapolation"} | {
    f"{pair}{end}" for pair in ("tsit5", "dop853-compiled", "vern9") for end in ("", "-fixed")
}
SCIPY = {"rk45", "dop853", "lsoda", "radau"}
SPLITTING = {name for name, method in symtop.integrators().items() if method.family == "splitting"}
STRAIGHT = {"midpoint", "trapezoidal", "simpson-linear", "midpoint-unreduced", "trapezoidal-unreduced"}


@pytest.mark.parametrize(
    ("edited", "stale"),
    [
        ("methods/runge_kutta/gauss.py", GAUSS | COLLECTIVE),
        ("methods/lagrangian/galerkin.py", {"galerkin-simpson"}),
        ("methods/lagrangian/unreduced.py", {"midpoint-unreduced", "trapezoidal-unreduced"}),
        ("methods/lagrangian/discrete_lagrangian.py", STRAIGHT),
        ("methods/framework/newton.py", STRAIGHT | {"galerkin-simpson"}),
        ("methods/library/scipy_ivp.py", SCIPY),
        ("methods/runge_kutta/pairs.py", PAIRS),
        ("methods/runge_kutta/explicit.py", {"rk4"} | PAIRS),
        ("methods/framework/equations.py", {"rk4"} | PAIRS | SCIPY),
        ("methods/framework/angles.py", {"rk4"} | PAIRS | SCIPY),
        ("methods/library/exact.py", {"exact"}),
        ("methods/splitting/loop.py", SPLITTING),
        ("methods/taylor/heyoka.py", {"taylor", "taylor-longdouble", "taylor-quad"}),
        ("cli/main.py", set()),
        ("report/figures.py", set()),
        ("measure/accuracy.py", set()),
    ],
)
def test_editing_a_kernel_makes_the_cases_that_use_it_stale_and_no_others(edited, stale):
    """In a study that runs every integrator and compares with no reference, which is made by `taylor.py`."""
    found = stale_after(edited, of_everyone())
    assert {name for name in found if is_built_in(name)} == stale  # other tests add methods of their own


@pytest.mark.parametrize(
    ("edited", "again"),
    [("measure/ranking.py", True), ("report/figures.py", True), ("measure/step_map.py", False), ("cli/main.py", False)],
)
def test_findings_are_made_again_when_what_judges_them_is_edited(edited, again, monkeypatch):
    study = runner.load("work_precision")
    before = code_of(study, style.save)
    pretend_edited(monkeypatch, PACKAGE / edited)
    after = code_of(study, style.save)
    monkeypatch.undo()
    depends.hashes.cache_clear()
    assert (after != before) is again


def test_what_all_cases_depend_on_makes_all_stale():
    convergence = runner.load("convergence")
    for edited in ("model/top.py", "model/scenes.py", "run/simulation.py", "methods/framework/registry.py"):
        assert stale_after(edited, of_everyone()) == set(symtop.integrators()), edited
    for edited in ("run/reference/truth.py", "methods/taylor/heyoka.py", "measure/accuracy.py"):
        assert stale_after(edited, convergence) == {case.integrator for case in convergence.cases(True)}, edited


def test_a_study_that_asks_the_registry_depends_on_all_of_it_unless_it_says_what_it_uses():
    reduction = runner.load("reduction")
    twins = next(case for case in reduction.cases(True) if case.settings["part"] == "twins")
    assert depends.used(reduction, twins) == sorted([twins.integrator, f"{twins.integrator}-unreduced"])
    silent = dataclasses.replace(reduction, uses=None)
    assert depends.used(silent, twins) == sorted(symtop.integrators())
    starred = Case("goldstein", "*", {})
    assert depends.used(of_everyone(), starred) == sorted(symtop.integrators())


LOOKUPS = ("convergence", "drift", "stability", "reduction", "truth")


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOKUPS)
def test_no_case_runs_an_integrator_that_it_is_not_said_to_depend_on(name, monkeypatch):
    """Every quick case is measured with a registry that notes who is run."""
    study, ran = runner.load(name), set()

    def noting(method):
        def solver(chart):
            def solve(top, start, plan):
                ran.add(method.name)
                return method.solvers[chart](top, start, plan)

            solve.solve = inside(method.solvers[chart])  # a long run steps the loop itself
            return solve

        return dataclasses.replace(method, solvers={chart: solver(chart) for chart in method.solvers})

    cases = study.cases(True)[::7]
    allowed = {case.label: set(depends.used(study, case)) for case in cases}
    known = registry.integrators()
    rules = {n: m for n, m in known.items() if commutation.rule_of(m) is not None}  # told by the type of their solver
    monkeypatch.setattr(registry, "_registry", {n: m if n in rules else noting(m) for n, m in known.items()})
    for case in cases:
        ran.clear()
        study.measure(case)
        assert ran <= allowed[case.label], case


def test_a_constant_of_the_script_counts_and_a_caption_does_not(tmp_path):
    script = tmp_path / "counted.py"
    text = PROBE.read_text()
    digests = set()
    for version in (
        text,
        text.replace('"Energy."', '"Another caption."'),
        text.replace("samples=51", "samples=STEPS").replace("METHODS = (", "STEPS = 51\nMETHODS = ("),
        text.replace("samples=51", "samples=STEPS").replace("METHODS = (", "STEPS = 52\nMETHODS = ("),
        text.replace("samples=51", "samples=len(helper())") + "\n\ndef helper():\n    return range(51)\n",
        text.replace("samples=51", "samples=len(helper())") + "\n\ndef helper():\n    return range(53)\n",
        text.replace("samples=51", "samples=cached()") + "\n\n@functools.cache\ndef cached():\n    return 51\n",
        text.replace("samples=51", "samples=cached()") + "\n\n@functools.cache\ndef cached():\n    return 53\n",
        text.replace("samples=51", "samples=Few().count()")
        + "\n\nclass Few:\n    def count(self):\n        return 51\n",
        text.replace("samples=51", "samples=Few().count()")
        + "\n\nclass Few:\n    def count(self):\n        return 53\n",
    ):
        script.write_text("import functools\n" + version)
        sys.modules.pop("symtop_study_counted", None)
        linecache.checkcache()
        importlib.invalidate_caches()
        shutil.rmtree(tmp_path / "__pycache__", ignore_errors=True)
        study = runner.load(str(script))
        digests.add(depends.digest(study, study.cases(True)[0]))
    assert len(digests) == 9  # the caption alone changes nothing


def test_a_users_package_is_drawn_again_when_what_stands_beside_its_script_is_edited(tmp_path, monkeypatch):
    """Its cases depend on the file that measures, and its figures on every file that it imports."""
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "__init__.py").touch()
    text = (
        PROBE.read_text()
        .replace('STUDY = Study("probe"', 'STUDY = Study("mine"')
        .replace("samples=51", "samples=count()")
    )
    (folder / "study.py").write_text(f"from .words import said\nfrom .tables import count\n{text}")
    (folder / "words.py").write_text("def said():\n    return 'nothing'\n")
    (folder / "tables.py").write_text("def count():\n    return 51\n")
    study = runner.load(str(folder / "study.py"))
    case = study.cases(True)[0]

    def made():
        return depends.digest(study, case), code_of(study, style.save)

    before = made()
    for name, measured_again in (("words.py", False), ("tables.py", True)):
        pretend_edited(monkeypatch, folder / name)
        after = made()
        monkeypatch.undo()
        depends.hashes.cache_clear()
        assert (after[0] != before[0]) is measured_again, name
        assert after[1] != before[1], name
    assert made() == before


@pytest.mark.slow
def test_a_copy_of_the_package_with_one_kernel_edited(tmp_path):
    """Through the command line: an edit, the status, and a run that computes what is stale and nothing else."""
    for name in ("symtop", "studies"):
        shutil.copytree(PACKAGE.parent / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    words = ["study", PROBE, "--results", tmp_path / "r"]
    assert ended(symtop_command(*words, cwd=tmp_path, PYTHONPATH=tmp_path))[0] == 0
    with (tmp_path / "symtop" / "methods" / "gauss.py").open("a") as file:
        file.write("\n# edited\n")
    code, out, _ = ended(symtop_command(*words, "--status", "--json", cwd=tmp_path, PYTHONPATH=tmp_path))
    assert code == 0
    rows = json.loads(out)["probe"]
    assert {row["integrator"] for row in rows if row["state"] == "stale"} == {"gauss-4"}
    assert sum(row["state"] == "done" for row in rows) == 10
    code, out, _ = ended(symtop_command(*words, "--status", "--why", cwd=tmp_path, PYTHONPATH=tmp_path))
    assert out == (
        "probe: 10 done, 2 stale\n  2 stale: file symtop/methods/runge_kutta/gauss.py: gauss-4 on goldstein, loop\n"
    )
    code, out, _ = ended(symtop_command(*words, cwd=tmp_path, PYTHONPATH=tmp_path))
    assert "2 of 12 cases computed" in out
    code, out, _ = ended(symtop_command(*words, "--status", cwd=tmp_path, PYTHONPATH=tmp_path))
    assert out == "probe: 12 done\n"


# ---- status, fresh, check --------------------------------------------------------------------------------------------


def probe(results, *words):
    return CliRunner().invoke(main, ["study", str(PROBE), "--quick", "--results", str(results), *words])


def test_status_says_what_is_missing_done_and_stale(tmp_path):
    assert probe(tmp_path, "--status").output.startswith("probe: 4 missing\n")
    assert not (tmp_path / "quick").exists()  # looking leaves nothing behind
    assert probe(tmp_path).exit_code == 0
    assert probe(tmp_path, "--status").output == "probe: 4 done\n"
    case = next((tmp_path / "quick" / "cases" / "probe").glob("loop--midpoint*.nc"))
    older = case.with_name(f"{store.identity_of(case)}--{'0' * 20}.nc")
    case.rename(older)
    rows = json.loads(probe(tmp_path, "--status", "--json").output)["probe"]
    assert [row["state"] for row in rows] == ["done", "done", "stale", "done"]
    assert "1 of 4 cases computed" in probe(tmp_path).output
    assert not older.exists()


def test_fresh_computes_everything_and_the_files_are_the_same_to_the_byte(tmp_path):
    assert probe(tmp_path).exit_code == 0

    def bytes_of():  # but for the record of the files' times
        return {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file() and path.name != "seen.json"}

    before = bytes_of()
    done = probe(tmp_path, "--fresh", "--json")
    assert done.exit_code == 0
    (said,) = json.loads(done.output)
    assert said["computed"] == said["cases"] == 4
    assert before == bytes_of()


def test_every_file_says_where_it_comes_from(tmp_path):
    assert probe(tmp_path).exit_code == 0
    for path in (tmp_path / "quick").rglob("*.nc"):
        data = netcdf.read(path)
        asked = set(netcdf.provenance())
        if path.parent.name == "probe":
            asked |= {"study", "settings", "sources", "made_of", "seed", "content"}
            assert data.attrs["sources"] in path.name
        assert asked <= set(data.attrs), path.name
        assert not any("time" in key or "date" in key for key in data.attrs)


def test_check_finds_a_value_that_this_version_does_not_compute(tmp_path):
    assert probe(tmp_path, "--check").exit_code == 2  # nothing is stored
    assert probe(tmp_path).exit_code == 0
    done = probe(tmp_path, "--check", "--fresh")
    assert done.exit_code == 0, done.output
    assert "4 of 4 cases computed again, the same to the last bit" in done.output
    victim = next((tmp_path / "quick" / "cases" / "probe").glob("*.nc"))
    data = netcdf.read(victim)
    data["energy"][3] = np.nextafter(data["energy"].values[3], np.inf)
    netcdf.write(data.assign_attrs(content=netcdf.content_hash(data)), victim)  # well made, and wrong
    done = probe(tmp_path, "--check", "--fresh")
    assert done.exit_code == 1
    assert "energy differs by up to" in done.output


def test_differences_leave_out_times_and_nothing_else():
    one = xr.Dataset({"axis": ("x", [1.0, float("nan")]), "seconds": ("x", [1.0, 2.0])}, attrs={"seed": 0})
    assert check.differences(one, one.copy(deep=True)) == []
    assert check.differences(one, one.assign(seconds=one["seconds"] * 2)) == []
    assert check.differences(one, one.assign(axis=one["axis"] * 2)) == ["axis differs by up to 1"]
    assert check.differences(one, one.drop_vars("axis")) == ["axis is in one of them only"]
    assert check.differences(one, one.assign_attrs(seed=1)) == ["attribute seed differs: 0 and 1"]
    beside = [one.assign_attrs(timed_at_once=n, timed_slowdown=x) for n, x in ((1, float("nan")), (2, 1.01))]
    assert check.differences(*beside) == []  # as times are, how they were taken is another matter each time
    assert len(check.differences(one, one.isel(x=[0]))) == 2  # also of the times: their shape


GRIDS = """
import xarray as xr
from symtop.runner.study import Case, Picture, Study

def grid(count):
    return [Case("spheroid", name, {"steps": count}) for name in ("midpoint", "strang")]

def measure(case):
    return xr.Dataset({"steps": float(case.settings["steps"])})

STUDY = Study("grids", "Grids", "Kept?", "", lambda quick: grid(10), measure, lambda data: [],
              lambda data: ["It ran."], full=lambda: grid(1000))
"""


def test_the_full_grid_and_the_ordinary_one_keep_each_others_cases(tmp_path):
    """Same scene and integrator, other settings: neither replaces the other."""
    (tmp_path / "grids.py").write_text(GRIDS)

    def computed(*words):
        done = CliRunner().invoke(
            main, ["study", str(tmp_path / "grids.py"), "--results", str(tmp_path / "r"), "--json", *words]
        )
        assert done.exit_code == 0, done.output
        return json.loads(done.output)

    for words, count in (([], 2), (["--full"], 2), ([], 0), (["--full"], 0)):
        assert computed(*words)[0]["computed"] == count, words
        cases = list((tmp_path / "r" / "cases" / "grids").glob("*.nc"))
        assert len(cases) == (2 if words == [] and count else 4)
        assert netcdf.read(tmp_path / "r" / "grids.nc")["steps"].values.max() == (1000.0 if words else 10.0)
    assert [row["state"] for row in computed("--status")["grids"]] == ["done", "done"]


# ---- failures --------------------------------------------------------------------------------------------------------


def test_a_failing_case_is_reported_and_the_others_go_on(tmp_path):
    def solve(top, start, plan):
        raise RuntimeError("no luck")

    unlucky = Integrator(name="unlucky", family="other", summary="", solvers={"angles": solve})
    whole = runner.load("stability")
    cases = [case for case in whole.cases(True) if case.scene == "goldstein" and case.integrator == "midpoint[angles]"]
    cases.append(dataclasses.replace(cases[0], integrator="unlucky[angles]"))
    small = dataclasses.replace(whole, cases=lambda quick: cases)
    symtop.register(unlucky)
    try:
        found = runner.run(small, tmp_path, quick=True, quiet=True)
    finally:
        registry._registry.pop("unlucky")
    assert found["failures"] == [
        "unlucky[angles] on goldstein failed: integrator unlucky[angles] failed: RuntimeError: no luck"
    ]
    assert list(netcdf.read(tmp_path / "stability.nc")["variant"].values) == ["midpoint[angles]"]
    assert runner.run(small, tmp_path, quick=True, quiet=True)["failures"]  # tried again, not forgotten


CLOCKED = """
import os, time
from pathlib import Path
import matplotlib.pyplot as plt
import xarray as xr
from symtop.runner.study import Case, Picture, Study

def cases(quick):
    return [Case("spheroid", ("midpoint", "strang")[k % 2], {"k": k}, k >= 8, f"case-{k}") for k in range(16)]

def measure(case):
    begin, crew = time.monotonic(), Path(os.environ["CREW"])
    (crew / str(os.getpid())).touch()
    while not case.timed and len(list(crew.iterdir())) < 2 and time.monotonic() < begin + 60.0:
        time.sleep(0.01)  # until the second worker has begun a case, too
    time.sleep(0.05)
    one = xr.Dataset({"begin": begin, "end": time.monotonic(), "process": os.getpid(), "timed": float(case.timed)})
    return one.expand_dims(k=[case.settings["k"]])

STUDY = Study("clocked", "Clocked", "Alone?", "", cases, measure, lambda data: [], lambda data: ["It ran."])
"""


@pytest.mark.parametrize("count", [8, 2])
def test_timed_cases_run_one_at_a_time_in_workers_that_are_there_already(tmp_path, monkeypatch, count):
    """Few of them, too: workers have the kernels, this process has not. (Side by side: `test_trial`.)"""
    monkeypatch.setattr("symtop.runner.trial.slowdown", lambda *_: math.inf)
    (tmp_path / "crew").mkdir()
    monkeypatch.setenv("CREW", str(tmp_path / "crew"))
    (tmp_path / "clocked.py").write_text(CLOCKED.replace("range(16)", f"range({8 + count})"))
    runner.run(runner.load(str(tmp_path / "clocked.py")), tmp_path / "r", jobs=2, quiet=True)
    found = [netcdf.read(path) for path in (tmp_path / "r").rglob("cases/clocked/*.nc")]
    spans = {timed: sorted((float(one["begin"][0]), float(one["end"][0])) for one in found if one["timed"][0] == timed)
             for timed in (0.0, 1.0)}  # fmt: skip
    crew = {timed: {int(one["process"][0]) for one in found if one["timed"][0] == timed} for timed in (0.0, 1.0)}
    assert [len(spans[timed]) for timed in (0.0, 1.0)] == [8, count]
    assert all(end <= begin for (_, end), (begin, _) in pairwise(spans[1.0]))
    assert max(end for _, end in spans[0.0]) <= spans[1.0][0][0]
    assert any(begin < end for (_, end), (begin, _) in pairwise(spans[0.0]))  # the control: two at once
    assert crew[1.0] <= crew[0.0]
    assert os.getpid() not in crew[0.0]


def test_a_timed_case_with_a_method_of_this_process_runs_here_though_workers_are_open(tmp_path):
    """Its name stands in the settings; that of shipped methods (the control) goes to the workers."""
    from symtop.runner.execute import HERE, size_for
    from symtop.runner.pools import Workers
    from symtop.runner.work import Task

    def sizes(name):
        case = Case("spheroid", "together", {"integrators": ["strang", name]}, timed=True)
        return size_for([Task("", case, "", (), 1.0)], workers, timed=True)

    symtop.register(dataclasses.replace(symtop.integrator("strang"), name="mine"))
    try:
        with Workers(2) as workers:
            assert sizes("midpoint") == HERE  # nobody is there
            workers.pool(2)
            assert sizes("midpoint") == 2
            assert sizes("mine") == HERE
    finally:
        registry._registry.pop("mine")
