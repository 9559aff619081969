"""The bundle: whole, described to the last variable, checkable, and only of what is in the report."""

import hashlib
import re
import zipfile

import pandas as pd
import pytest
import xarray as xr

import symtop
from symtop.core import netcdf
from symtop.measure import datasets
from symtop.report import archive, style
from symtop.runner import run as runner
from tests.core.test_conventions import lacking


def draw(data):
    """One figure."""
    figure, axes = style.panels(1, 1)
    axes[0, 0].plot(data["x"].values.ravel())
    return [symtop.Picture("line", figure)]


STUDY = symtop.Study(
    name="small", title="Small", question="Is it bundled?", cases=lambda _: [symtop.Case("spheroid", "strang", {})],
    measure=lambda case: xr.Dataset({"x": ("step_size", [1.0, 2.0], {"long_name": "a number", "units": "rad"})},
                                    {"step_size": [0.1, 0.2]}),
    pictures=draw, facts=lambda data: {"answer": "yes"},
    tables=lambda data: {"one": pd.DataFrame({"a": [1], "b": [2.5]})},
)  # fmt: skip


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A results folder with one small study, a case, a figure that nothing shows and a file of somebody else's."""
    folder = tmp_path_factory.mktemp("bundled") / "results"
    (case,) = STUDY.cases(True)
    data = netcdf.describe(datasets.combine([(case, STUDY.measure(case))]), "Small", question=STUDY.question)
    netcdf.write(data, folder / "small.nc")
    findings = runner.findings_of(STUDY, data, folder, style.save, failures=[], cases=1)
    netcdf.write_json(folder / "peers.json", findings | {"study": "peers", "measured": "once"})
    (folder / "cases" / "small").mkdir(parents=True)
    (folder / "cases" / "small" / "one.nc").write_bytes(b"a case")
    (folder / "figures" / "old.png").write_bytes(b"not shown")
    return folder


@pytest.fixture(scope="module")
def scenes():
    """Three scenes for all of the test set, whose 30 digits `test_scene_states` checks."""
    subset = {name: scene for name, scene in symtop.scenes().items() if name in ("spheroid", "goldstein", "sleeping")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(archive, "scenes", lambda: subset)
        yield subset


@pytest.fixture(scope="module")
def bundled(results, scenes):
    """Its bundle: contents by name, without the folder that they are in."""
    path = archive.bundle(results)
    assert path == results / f"{archive.NAME}.zip"
    with zipfile.ZipFile(path) as file:
        assert file.testzip() is None
        return {name.removeprefix(f"{archive.NAME}/"): file.read(name) for name in file.namelist()}


def test_it_holds_what_the_report_is_made_of_each_with_its_sum_and_its_words(bundled):
    assert bundled.keys() == {
        "README.md", "SHA256SUMS", "citations.bib", "machine.txt", "versions.txt", "results/small.nc",
        "results/peers.json", "results/report.html", "results/report.md", "results/reference.md",
        "results/figures/small-line.png", "results/tables/small-one.csv",
        "scenes/scenes.csv", "scenes/states.csv", "scenes/states.nc",
    }  # fmt: skip
    sums = dict(reversed(line.split("  ")) for line in bundled["SHA256SUMS"].decode().splitlines())
    assert sums.keys() == bundled.keys() - {"SHA256SUMS"}
    assert all(hashlib.sha256(bundled[name]).hexdigest() == digest for name, digest in sums.items())
    readme = bundled["README.md"].decode()
    assert all(f"| {name} |" in readme for name in bundled.keys() - {"README.md", "SHA256SUMS"})
    assert "| x | scene (1) x variant (1) x step_size (2) | rad | a number |" in readme
    states = readme.partition("### scenes/states.nc")[2]
    assert re.findall(r"\| theta_lo \| scene \(\d+\) x sample \(10\) \| rad \| \S", states)
    assert netcdf.provenance()["symtop_revision"] in readme
    assert max(map(len, readme.partition("## Files")[0].splitlines())) <= 120


def test_its_states_can_be_read_and_the_same_results_make_the_same_bundle(bundled, scenes, tmp_path, results):
    (tmp_path / "states.nc").write_bytes(bundled["scenes/states.nc"])
    states = netcdf.read(tmp_path / "states.nc")
    assert list(states["scene"].values) == list(scenes)
    assert (states["quaternion_lo"].dims, lacking(states)) == (("scene", "sample", "part"), [])
    with zipfile.ZipFile(archive.bundle(results, tmp_path / "again.zip")) as file:
        second = {name.removeprefix(f"{archive.NAME}/"): file.read(name) for name in file.namelist()}
    dated = {"results/report.html", "SHA256SUMS"}  # the page says the day
    assert {name for name in bundled if second[name] != bundled[name]} <= dated
