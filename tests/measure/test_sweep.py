"""sweep(): one dataset of errors, work and outcomes; kept in a file, resumed from it, and drawn."""

import json

import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.core import files, netcdf
from symtop.measure import sweep as module
from symtop.measure.accuracy import error_row
from symtop.measure.timing import Timing
from symtop.model.top import Angles, SymmetricTop

METHODS = ["strang", "rk4[axis]", "rk45-compiled", "exact"]
ARGUMENTS = {"step_size": [0.02, 0.01, 0.005], "tolerance": [1e-4, 1e-6], "horizon": 2.0, "quiet": True}


@pytest.fixture(scope="module")
def data():
    return symtop.sweep(["spheroid", "goldstein"], METHODS, **ARGUMENTS)


def test_each_entry_is_that_of_one_run_whose_settings_are_its_own(data):
    assert (dict(data.sizes), data.attrs["horizon"]) == ({"scene": 2, "variant": 4, "setting": 3}, 2.0)
    for scene in ("spheroid", "goldstein"):
        top, start = (json.loads(data.attrs[name])[scene] for name in ("top", "start"))
        assert (SymmetricTop(**top), Angles(**start)) == (symtop.scene(scene).top, symtop.scene(scene).start)
        row = error_row(symtop.scene(scene), symtop.integrator("strang"), 0.01, 2.0)
        cell = data.sel(scene=scene, variant="strang").isel(setting=1)
        for name in ("axis", "attitude_end", "energy_bound", "force_evaluations", "step_size", "outcome"):
            assert cell[name].values == row[name]
    adaptive, formula = (data.sel(variant=name, scene="spheroid") for name in ("rk45-compiled", "exact"))
    assert adaptive["outcome"].values.tolist() == ["ok", "ok", "not_run"]
    assert adaptive["tolerance"].values[:2].tolist() == [1e-4, 1e-6]
    assert np.isnan(adaptive["step_size"].values[:2]).all()
    assert formula["outcome"].values.tolist() == ["ok", "not_run", "not_run"]
    slope = np.diff(np.log2(data.sel(variant="rk4[axis]", scene="spheroid")["axis"].values))
    assert slope == pytest.approx([-4.0, -4.0], abs=0.3)


def test_one_thread_and_many_and_a_file_give_the_same(data, tmp_path):
    file = tmp_path / "sweep.nc"
    for options in ({"threads": 1}, {"path": file}):
        result = symtop.sweep(["spheroid", "goldstein"], METHODS, **ARGUMENTS, **options)
        xr.testing.assert_identical(result.drop_attrs(), data.drop_attrs())
    xr.testing.assert_identical(netcdf.read(file).drop_attrs(), data.drop_attrs())


def test_a_sweep_that_was_stopped_goes_on_from_its_file(tmp_path, monkeypatch):
    """Killed after three cells of eight, it computes the other five; a changed setting computes its own cells only."""
    file, table, calls = tmp_path / "sweep.nc", module._table, []
    record = lambda cell: calls.append((cell.scene.name, cell.method.name)) or table(cell)

    def stopping(cell):
        if len(calls) == 3:
            raise KeyboardInterrupt
        return record(cell)

    call = {**ARGUMENTS, "path": file, "threads": 1}
    monkeypatch.setattr(module, "_table", stopping)
    with pytest.raises(KeyboardInterrupt):
        symtop.sweep(["spheroid", "goldstein"], METHODS, **call)
    calls.clear()
    monkeypatch.setattr(module, "_table", record)
    data = symtop.sweep(["spheroid", "goldstein"], METHODS, **call)
    assert len(calls) == 5
    assert (data["made_of"] != "").all()
    calls.clear()
    symtop.sweep(["spheroid", "goldstein"], METHODS, **call)
    assert calls == []
    symtop.sweep(["spheroid", "goldstein"], METHODS, **{**call, "tolerance": [1e-5]})
    assert calls == [("spheroid", "rk45-compiled"), ("goldstein", "rk45-compiled")]
    symtop.sweep(["spheroid", "goldstein"], METHODS, **call, observe="axis")
    assert len(calls) == 2 + 8


def test_failures_are_rows():
    """A run that leaves its chart, and a method that raises, beside one that is well."""

    def broken(top, start, plan):
        raise ZeroDivisionError("of its own")

    entry = symtop.Integrator(name="broken", family="other", summary="raises", solvers={"axis": broken})
    data = symtop.sweep("spheroid", [entry, "stormer-verlet", "strang"], step_size=[1.0, 0.01], horizon=8.0, quiet=True)
    outcomes = data["outcome"].values[0]
    assert outcomes[0].tolist() == ["raised", "raised"]
    assert "ZeroDivisionError: of its own" in str(data["message"].values[0, 0, 0])
    assert data["step_size"].values[0, 0].tolist() == [1.0, 0.01]
    assert (outcomes[1].tolist(), outcomes[2].tolist()) == (["left_chart", "ok"], ["ok", "ok"])
    assert np.isnan(data["axis"].values[0, 0]).all()


def test_a_file_with_other_cells_is_refused_and_left_as_it_is(tmp_path, monkeypatch):
    """So is a damaged one, one that another process writes, and one that cannot be written; more cells are not."""
    file, arguments = tmp_path / "sweep.nc", {"step_size": [0.02, 1.0], "horizon": 2.0, "quiet": True}
    symtop.sweep("spheroid", ["rk4[axis]", "strang"], path=file, **arguments)
    before, table = file.read_bytes(), module._table
    monkeypatch.setattr(module, "_table", lambda _: pytest.fail("it computes"))
    for scene, names, cells in (
        ("spheroid", ["strang"], r"rk4\[axis\] on spheroid"),
        ("spheroid", ["midpoint"], r"rk4\[axis\] on spheroid, strang on spheroid"),
        ("goldstein", ["rk4[axis]", "strang"], r"rk4\[axis\] on spheroid, strang on spheroid"),
    ):
        with pytest.raises(symtop.SymtopError, match=f"holds what was not asked for, {cells}: ask for these as well"):
            symtop.sweep(scene, names, path=file, **arguments)
    with files.locked(tmp_path / "sweep.nc.parts", wait=True), pytest.raises(symtop.SymtopError, match="is writing"):
        symtop.sweep("spheroid", ["rk4[axis]", "strang"], path=file, **arguments)
    assert file.read_bytes() == before
    netcdf.write(netcdf.read(file).assign(axis=lambda data: 3.0 * data["axis"]), file)
    for path, message in ((file, "damaged, its numbers are not those that were"), (file / "x.nc", "in a folder")):
        with pytest.raises(symtop.SymtopError, match=message):
            symtop.sweep("spheroid", ["rk4[axis]", "strang"], path=path, **arguments)
    file.write_bytes(before)
    small = symtop.sweep("spheroid", ["strang", "rk4[axis]"], path=file, **arguments)
    xr.testing.assert_identical(netcdf.read(file).drop_attrs(), small.drop_attrs())
    monkeypatch.setattr(module, "_table", table)
    large = symtop.sweep(["spheroid", "goldstein"], ["strang", "stormer-verlet", "rk4[axis]"], path=file, **arguments)
    assert {*large["outcome"].values.flat} - {*small["outcome"].values.flat} == {"left_chart"}
    xr.testing.assert_identical(netcdf.read(file).drop_attrs(), large.drop_attrs())
    assert (large["axis"].sel(scene=small["scene"], variant=small["variant"]) == small["axis"]).all()


def test_a_cell_that_raised_is_tried_again_and_one_that_ended_early_is_not(tmp_path, monkeypatch):
    file, disk, solver = tmp_path / "sweep.nc", tmp_path / "disk", symtop.integrator("strang[axis]").solvers["axis"]
    calls, table = [], module._table

    def moody(top, start, plan):
        if not disk.exists():  # a list of calls would be part of what the numbers depend on
            disk.touch()
            raise OSError("the disk is away")
        return solver(top, start, plan)

    monkeypatch.setattr(module, "_table", lambda cell: calls.append(cell.method.name) or table(cell))
    method = symtop.Integrator(name="moody", family="other", summary="raises once", solvers={"axis": moody})
    expected = (["raised", "ok"], ["stormer-verlet", "moody"]), (["ok", "ok"], ["moody"]), (["ok", "ok"], [])
    for outcomes, names in expected:
        arguments = {"step_size": [1.0, 0.02], "path": file, "threads": 1, "quiet": True}
        data = symtop.sweep("spheroid", ["stormer-verlet", method], **arguments)
        assert data["outcome"].sel(variant="moody").values[0].tolist() == outcomes
        assert data["outcome"].sel(variant="stormer-verlet").values[0].tolist() == ["left_chart", "ok"]
        assert calls == names
        calls.clear()
        xr.testing.assert_identical(netcdf.read(file).drop_attrs(), data.drop_attrs())


@pytest.mark.parametrize(("words", "message"), [
    ({}, "strang has a fixed step: give step_size or per_nutation"),
    ({"step_size": 0.1, "integrators": "rk45"}, "rk45 is adaptive: give tolerance"),
    ({"step_size": 0.1, "scenes": ["spheroid", "spheroid"]}, "scenes must be one or more, each once"),
    ({"step_size": 0.1, "scenes": {"I1": [1.0]}}, "for a dataset of tops there is ensemble"),
])  # fmt: skip
def test_bad_input_is_one_sentence(words, message):
    with pytest.raises(symtop.SymtopError, match=message):
        symtop.sweep(**{"scenes": "spheroid", "integrators": "strang", **words})


def test_steps_a_nutation_are_those_of_each_scene_and_a_file_of_something_else_is_refused(tmp_path):
    file = tmp_path / "run.nc"
    symtop.simulate("spheroid", "strang", step_size=0.01).to_netcdf(file)
    before = file.read_bytes()
    with pytest.raises(symtop.SymtopError, match="path must be a new file or that of a sweep"):
        symtop.sweep("spheroid", "strang", step_size=0.01, path=file)
    assert file.read_bytes() == before
    data = symtop.sweep(["spheroid", "goldstein"], "strang", per_nutation=[50], horizon=2.0, quiet=True)
    for name in ("spheroid", "goldstein"):
        steps = 2.0 / round(2.0 * 50 / symtop.scene(name).nutation_period)
        assert data.sel(scene=name)["step_size"].item() == pytest.approx(steps)


def test_times_are_those_of_runs_that_ended_well_and_are_kept(tmp_path):
    options = {"step_size": [0.001, 3.0], "horizon": 20.0, "timed": True, "quiet": True, "path": tmp_path / "sweep.nc"}
    data = symtop.sweep("spheroid", ["rk4", "strang"], **options)
    ok = data["outcome"].values == "ok"
    assert 0 < ok.sum() < ok.size
    assert (np.isfinite(data["seconds"].values) == ok).all()
    assert (data["seconds"].values[ok] > 0.0).all()
    assert "one call of the method's solver" in data.attrs["timed"]
    repeat = symtop.sweep("spheroid", ["rk4", "strang"], **options)
    np.testing.assert_array_equal(repeat["seconds"].values, data["seconds"].values)
    solvers = {"attitude": lambda *_: pytest.fail("another chart"), "axis": symtop.integrator("rk4").solvers["axis"]}
    method, arguments = symtop.Integrator("both", "other", "", solvers), options | {"path": None, "observe": "axis"}
    assert symtop.sweep("spheroid", method, **arguments)["seconds"].values[0, 0, 0] > 0.0
    data = symtop.sweep(["spheroid", "goldstein"], "rk4", step_size=0.1, quiet=True)
    assert json.loads(data.attrs["horizon"]) == {name: symtop.scene(name).horizon for name in data["scene"].values}
    assert ("seconds" in data, data.attrs["timed"][:7]) == (False, "nothing")
    with pytest.raises(symtop.SymtopError, match="timed must be"):
        symtop.sweep("spheroid", "rk4", step_size=0.1, timed="yes")


def test_what_is_timed_has_been_called_before(monkeypatch):
    """A first call, which loads code, takes as long as a batch has to, and was the only one in each of them."""
    solve, calls = symtop.integrator("exact").solvers["attitude"], []
    solvers = {"attitude": lambda *words: calls.append(words) or solve(*words)}
    formula = symtop.Integrator("slow", "other", "", solvers, control=None)
    monkeypatch.setattr(module, "timings", lambda runs, *_, **__: [Timing((float(len(calls)),), 0.0) for _ in runs])
    module.timed_rows([(symtop.scene("spheroid"), formula, 1.0, rows := [{"setting_value": np.nan, "outcome": "ok"}])])
    assert rows[0]["seconds"] == 1.0


def test_a_variant_fails_at_the_finest_of_its_coarsest_failed_runs():
    rows = {"step_size": [1.0, 4.0, 2.0, 0.5], "tolerance": [np.nan] * 4}
    rows["outcome"] = ["ok", "not_finite", "not_finite", "left_chart"]
    cell = xr.Dataset({name: ("setting", row) for name, row in rows.items()})
    assert module.failed_setting(cell) == "fails at 2, not finite"
