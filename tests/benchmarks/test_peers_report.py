"""What the measured peers say: both ratios, winners and losers by name, in a section that outlives the studies."""

import itertools
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from benchmarks import measured
from benchmarks.peers import measure, study, summary, together
from symtop.core import netcdf
from symtop.report import page, style
from symtop.runner import run as runner

ROOT = Path(__file__).resolve().parents[2]


def _stored(times, spread=0.01):
    """A dataset as `measure` leaves it: one scene, one setting; seconds of the (public, inner) call of each package."""
    names, batches = list(times), 10
    wobble = 1.0 + spread * np.arange(batches) / batches
    samples = np.array([[[[pair[k] * wobble] for pair in times.values()]] for k in range(2)])
    flat = samples.min(axis=-1)
    one, each = ("scene", "variant", "setting"), ("call", "scene", "variant", "setting")
    words = {
        "package": [name.partition("[")[0] for name in names],
        "version": ["1"] * len(names),
        "chart": ["angles" if "[angles" in name else "axis" for name in names],
        "language": ["Python" if "Python" in name else "numba, called from C" for name in names],
        "implementation": ["compiled"] * len(names),
        "formulation": ["as it is"] * len(names),
        "shows": ["dense output"] * len(names),
    }
    data = xr.Dataset(
        {
            "axis": (one, np.where(np.isfinite(flat[0]), 1e-10, np.nan)),
            **dict.fromkeys(("seconds", "first_call", "reliable"), (each, flat)),
            "seconds_samples": ((*each, "batch"), samples),
            **{key: ("variant", column) for key, column in words.items()},
        },
        coords={"call": list(measure.CALLS), "scene": ["spheroid"], "variant": [f"{name}-one" for name in names]},
    )
    facts = measured.circumstances() | {"measured": "2001-02-03", "processor": "an abacus"}
    return netcdf.describe(data, "peers").assign_attrs(facts)


def test_noise_is_not_called_a_win():
    data = _stored({"symtop": (1e-4, 1e-4), "rebound": (1.4e-4, 1.4e-4)})
    assert "faster in 2 of 2 comparisons, level or within the noise in 0" in summary.verdict(data)[0]
    data["seconds_samples"].values[:, 0, 0, 0, 0::5] *= 2.0  # one fifth of our batches was slow
    level = "faster in 0 of 2 comparisons, level or within the noise in 2"
    assert all(level in said for said in summary.verdict(data)[1:])


def test_methods_on_f_alone_are_counted_by_themselves():
    scipys = {f"scipy[axis] {language}": (8e-4, 9e-4) for language in ("C", "Python")}
    data = _stored({"symtop": (1e-4, 1e-5), "rebound": (2e-4, 2e-4)} | scipys)
    data = data.assign_coords(variant=["series[axis]", *data["variant"].values[1:]])
    assert summary.general(data) == []
    slow = data.isel(variant=[0]).assign_coords(variant=["rk4[axis]"])
    for name in ("seconds", "seconds_samples"):
        slow[name] = 4.0 * slow[name]
    both = xr.concat([data, slow], "variant").assign_attrs(data.attrs)
    assert summary.general(both) == ["rk4[axis]"]
    assert summary.score(both, "public", ["rk4[axis]"]).slower == {"rebound": "2 of 2"}
    assert "are faster in 4 of 6 comparisons" in summary.verdict(both)[2]
    assert "solve_ivp takes 2 to 2 times and 22.5 to 22.5" in study.caption(both)[0]


def _peers_into(folder):
    data = _stored({"symtop": (1e-3, 2e-5), "scipy[axis] C": (6e-3, 4e-3)})
    found = study.findings(data, [], folder, ["drake was skipped."])
    found["provenance"] = {**found["provenance"], "processor": "an abacus"}
    netcdf.write_json(folder / "peers.json", found)


def test_the_section_outlives_a_rerun_of_a_study_and_keeps_its_own_machine(tmp_path, quick_results):
    _peers_into(tmp_path)
    shutil.copytree(quick_results / "cases" / "truth", tmp_path / "cases" / "truth")  # it only has to be drawn
    (tmp_path / "report.md").write_text("what an earlier run left")
    truth = runner.load("truth")
    runner.run(truth, tmp_path, quick=True, jobs=1, quiet=True, save=style.save)
    page.write(tmp_path)
    text = (tmp_path / "report.md").read_text() + (tmp_path / "reference.md").read_text()
    sections = re.findall(r"^## (.+)$", text, re.MULTILINE)
    assert study.STUDY.question in sections
    assert truth.question in sections
    assert "Measured on 2001-02-03" in text
    assert "an abacus" not in text.partition("## Provenance")[2]  # the studies were run here


@pytest.mark.skipif(shutil.which("make") is None, reason="there is no make here")
def test_cleaning_spares_what_the_studies_do_not_make(tmp_path):
    shutil.copy(ROOT / "Makefile", tmp_path)
    (tmp_path / "results").mkdir()
    for name in ("peers.nc", "peers.json", "bench.json", "claims.nc", "claims.json", "report.md"):
        (tmp_path / "results" / name).touch()
    subprocess.run(["make", "clean"], cwd=tmp_path, check=True, capture_output=True)
    left = {path.name for path in (tmp_path / "results").iterdir()}
    assert left == {"peers.nc", "peers.json", "bench.json", "report.md"}


def test_the_stored_measurement_is_whole_and_its_inner_loops_did_the_work():
    data = netcdf.read(ROOT / "results" / "peers.nc")
    timed = np.isfinite(data["axis"].values)
    assert timed.sum() > 100
    assert np.isfinite(data["seconds"].values[:, timed]).all()  # both calls of every run
    good = timed & (data["axis"].values < 1e-3)
    error, bound, end = (data[name].values[good] for name in ("axis", "axis_bound", "end_error"))
    assert np.all(end <= 3.0 * error + bound)  # CVODE's first step depends on the first time that is asked for
    assert {"spheroid", "goldstein"} <= set(data["scene"].values.tolist())
    names = ("symtop", "scipy[axis], numba", "scipy[angles], Python", "cvode", "rebound", "arkode-sprk")
    for asked in itertools.product(summary.NAMES, ("spheroid", "goldstein"), names, summary.JUDGED):
        call, scene, name, target = asked
        assert summary.best_of(data, call, scene, summary.groups(data)[name], target) is not None, asked


def test_all_ways_of_running_many_tops_end_at_the_same_axes():
    numbers = together.neighbours(11)  # no whole number of heyoka's batches
    pytest.importorskip("heyoka")
    batch = together.batched(numbers, 1e-9)
    assert together.worst(batch, numbers) < 1e-8
    assert batch()[1] > 10.0
    assert together.worst(together.fixed("srkn-14-6", "axis", numbers, 400), numbers) < 1e-8
    few, many = (together.coarsest("rk4", "axis", numbers, error) for error in (1e-2, 1e-4))
    assert few < many
    assert together.coarsest("rk4", "axis", numbers, 1e-15) is None
