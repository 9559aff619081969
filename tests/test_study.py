"""The runner: resumes, recomputes nothing, survives damaged files, and runs a user's plug-in through every study."""

import dataclasses
import json
from pathlib import Path

import pytest
from click.testing import CliRunner

import symtop
from symtop import datasets
from symtop.cli import main
from symtop.integrators import registry
from symtop.integrators.registry import Integrator
from symtop.study import run as runner

PLUGIN = """\
import symtop

symtop.register(symtop.discrete_lagrangian("simpson-of-a-user", (0, 0.5, 1), (1 / 6, 2 / 3, 1 / 6), order=2))
top, start = symtop.SymmetricTop(1.5, 1.0, 3.0), symtop.Angles(theta=1.0, psi_dot=4.0)
symtop.register_scene(symtop.Scene("mine", top, start, horizon=6.0))
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    """Every study, quickly, with a plug-in of four lines that adds a method and a scene."""
    folder = tmp_path_factory.mktemp("results")
    plugin = folder / "plugin.py"
    plugin.write_text(PLUGIN)
    done = CliRunner().invoke(main, ["study", "--all", "--quick", "--results", str(folder), "--plugin", str(plugin)])
    assert done.exit_code == 0, done.output
    return folder / "quick"


def test_every_study_leaves_a_dataset_figures_and_findings(results):
    for name in runner.names():
        data = datasets.read(results / f"{name}.nc")
        assert {"scene", "integrator"} <= set(data.dims)
        assert not {"method", "tolerance"} & set(data.dims)
        findings = json.loads((results / f"{name}.json").read_text())
        assert findings["verdict"]
        assert findings["failures"] == []
        assert findings["pictures"]
        for picture in findings["pictures"]:
            assert (results / "figures" / picture["file"]).stat().st_size > 5000
            assert picture["caption"]
            assert picture["alt"]


def test_a_plugins_method_and_scene_are_in_every_study(results):
    for name in ("convergence", "work_precision", "drift", "stability"):
        data = datasets.read(results / f"{name}.nc")
        assert "simpson-of-a-user" in data["integrator"].values
        assert "mine" in data["scene"].values


def test_the_second_time_nothing_is_computed_and_damaged_cases_are(results):
    study = runner.load("convergence")
    again = runner.run(study, results, quick=True, quiet=True)
    assert again["computed"] == 0
    before = datasets.read(results / "convergence.nc")
    victims = sorted((results / "cases" / "convergence").glob("*.nc"))[:3]
    victims[0].write_bytes(victims[0].read_bytes()[:1000])
    victims[1].write_bytes(b"\0" * 4096)
    victims[2].unlink()
    mended = runner.run(study, results, quick=True, quiet=True)
    assert mended["computed"] == 3
    assert datasets.read(results / "convergence.nc").equals(before)


def test_the_report_is_one_page_without_outside_references(results):
    done = CliRunner().invoke(main, ["report", "--results", str(results)])
    assert done.exit_code == 0, done.output
    text = (results / "report.html").read_text()
    assert text.count("data:image/png;base64,") >= 4
    for outside in ("http://", "https://", "<script src", "<link"):
        assert outside not in text
    for name in runner.names():
        assert f'id="{name}"' in text


def test_a_failing_case_is_reported_and_the_others_go_on(tmp_path):
    def solve(top, start, plan):
        raise RuntimeError("no luck")

    unlucky = Integrator(name="unlucky", family="other", summary="", solvers={"angles": solve})
    whole = runner.load("stability")
    cases = [case for case in whole.cases(True) if case.scene == "goldstein" and case.integrator == "midpoint"]
    cases.append(dataclasses.replace(cases[0], integrator="unlucky"))
    small = dataclasses.replace(whole, cases=lambda quick: cases)
    symtop.register(unlucky)
    try:
        found = runner.run(small, tmp_path, quick=True, quiet=True)
    finally:
        registry._registry.pop("unlucky")
    assert found["failures"] == ["unlucky on goldstein failed: RuntimeError: no luck"]
    assert list(datasets.read(tmp_path / "stability.nc")["integrator"].values) == ["midpoint"]
    assert runner.run(small, tmp_path, quick=True, quiet=True)["failures"]  # tried again, not forgotten
