"""Peers are given the motion of the kernels and judged like us; the report says what was measured."""

import ctypes
import itertools
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from numba import cfunc, types
from scipy.integrate import solve_ivp

import symtop
from benchmarks import measured, peers
from benchmarks.peers import callbacks, common, measure, own, study, summary, together
from symtop.core import netcdf
from symtop.methods.framework.angles import field_angles, with_rates
from symtop.methods.framework.space import field_axis
from symtop.report import page, style
from symtop.run.simulation import make_plan
from symtop.runner import run as runner
from tests.commands import ROOT

DOUBLES = ctypes.POINTER(ctypes.c_double)
SPHEROID = symtop.scene("spheroid")


@cfunc(types.voidptr(types.voidptr))
def _numbers_of(vector):
    return callbacks._pointer_at(vector, 0)


class Core:
    """In place of SUNDIALS: an N_Vector is a struct that holds the address of its numbers and no more."""

    N_VGetArrayPointer = ctypes.CFUNCTYPE(DOUBLES, ctypes.c_void_p)(_numbers_of.address)


def _vector_field(function, state):
    numbers = [np.array(state), np.empty_like(state)]
    vectors = [np.array([row.ctypes.data], dtype=np.uint64) for row in numbers]
    assert function.ctypes(0.0, *(vector.ctypes.data for vector in vectors), None) == 0
    return numbers[1]


def test_all_right_hand_sides_are_the_kernels_own_and_split_halves_add_up():
    top, start = SPHEROID.top, SPHEROID.start
    y, (par, _) = common.start_of(top, start), common.on_axis(top, start)
    expected = np.array(field_axis(par, tuple(y)))
    filled, through_c = np.empty(6), np.empty(6)
    common.filling_field(top)(0.0, y, filled)
    callbacks.ode_field(top).ctypes(None, *(row.ctypes.data_as(DOUBLES) for row in (through_c, y)), 0.0)
    through_vectors = _vector_field(callbacks.vector_field(top, Core()), y)
    returned = [field(top)(0.0, y) for field in (common.python_field, common.compiled_field)]
    for derivative in (*returned, filled, through_c, through_vectors):
        assert np.allclose(derivative, expected, rtol=1e-15, atol=0.0)
    par, state = with_rates(top, start)
    expected = field_angles(par, state)
    for field in (common.python_angles, common.compiled_angles):
        assert np.allclose(field(top)(0.0, np.array(state)), expected, rtol=1e-14, atol=0.0)
    theta_dot, phi_dot, psi_dot, theta_ddot, *_ = expected
    expected = np.array([theta_dot, top.I1 * theta_ddot, phi_dot, psi_dot])
    y = np.array([start.theta, top.I1 * start.theta_dot, start.phi, start.psi])
    halves = [_vector_field(half, y) for half in callbacks.split_field(top, start, Core())]
    assert np.allclose(sum(halves), expected, rtol=1e-13, atol=0.0)
    assert not any(np.allclose(half, expected) for half in halves)
    force = _vector_field(callbacks.split_field(top, start, Core())[0], y + np.array([0.0, 1.0, 1.0, 1.0]))
    assert np.array_equal(force, halves[0])  # the force depends on theta alone: H is separable


def test_the_axis_as_a_particle_has_the_acceleration_of_the_axis():
    top, start = SPHEROID.top, SPHEROID.start
    y = common.start_of(top, start)
    e, momentum = y[:3], y[3:]
    velocity, torque = np.cross(momentum, e) / top.I1, top.mgl * np.array([-e[1], e[0], 0.0])
    expected = (np.cross(torque, e) + np.cross(momentum, velocity)) / top.I1
    particle = np.concatenate([e, velocity, np.zeros(3)])
    simulation = np.array([0, particle.ctypes.data], dtype=np.uint64)  # a struct with a pointer in its second place
    callbacks.particle_force(top, start, 8).ctypes(simulation.ctypes.data)
    assert np.allclose(particle[6:], expected, rtol=1e-13, atol=1e-13)
    assert not np.allclose(particle[6:], np.cross(torque, e) / top.I1)  # gravity alone


@pytest.mark.parametrize(("name", "setting"), [
    ("vern9-fixed", 0.1), ("rk4", 0.005), ("taylor", 1e-12), ("rk45-compiled", 1e-10)])  # fmt: skip
def test_the_kernel_alone_ends_where_simulate_ends(name, setting):
    peer = peers.Peer(measure.OURS, symtop.integrator(name), own.LANGUAGE)
    call, loop = measure.ready(SPHEROID, peer, setting)
    data, dense = call(), measure.shown_by(peer) == common.DENSE
    assert data["time"].size == (measure.SHOWN if dense else min(data.attrs["steps"] + 1, measure.SHOWN))
    truth = symtop.reference(SPHEROID, data["time"].values[-1:])["axis"].values
    distance = float(common.charts.axis_distance(data["axis"].values[-1:], truth)[0])
    assert measure.end_error(SPHEROID, peer, loop) == pytest.approx(distance, rel=0.3, abs=1e-13)


def _scipy(row):
    return next(peer for peer in peers.load(("scipy", "odeint"))[0] if peer.row == row)


@pytest.mark.parametrize("row", [
    "scipy-dop853-python[axis]", "scipy-dop853-numba[angles]", "scipy-lsoda-numba[axis]", "scipy-odeint-numba[axis]",
])  # fmt: skip
def test_both_calls_of_scipy_end_at_the_truth(row):
    peer = _scipy(row)
    call, loop = measure.ready(SPHEROID, peer, 1e-11)
    assert len(call().states) == measure.SHOWN
    assert measure.end_error(SPHEROID, peer, loop) < 1e-7


def test_an_inner_loop_that_does_not_start_anew_is_seen():
    """CVODE and others keep their state: a second call that went on from the first would be 20 nutations on."""
    peer, horizon = _scipy("scipy-dop853-python[axis]"), measure.PERIODS * SPHEROID.nutation_period
    plan, _ = make_plan(SPHEROID, peer.method, tolerance=1e-9, horizon=horizon, samples=2)
    state = [common.start_of(SPHEROID.top, SPHEROID.start)]

    def call():
        field = common.python_field(SPHEROID.top)
        state[0] = solve_ivp(field, (0.0, plan.horizon), state[0], rtol=1e-9, atol=1e-9).y[:, -1]
        return state[0]

    assert measure.end_error(SPHEROID, peer, common.Inner(call, lambda last: last)) > 1e-2


def test_the_search_finds_the_loosest_setting_and_an_absent_peer_is_skipped(monkeypatch):
    for module in ("diffrax", "mujoco"):
        monkeypatch.setitem(sys.modules, module, None)  # an import of it fails
    available, missing = peers.load(("diffrax", "scipy", "mujoco"))
    assert {peer.package for peer in available} == {"scipy"}
    assert [sentence.split()[0] for sentence in missing] == ["diffrax", "mujoco"]
    assert all("skipped" in sentence for sentence in missing)
    scene, method = symtop.scene("goldstein"), symtop.integrator("takahashi-imada")
    points = measure.worth_timing(measure.search(scene, method, (1e-6,)), (1e-6,))
    meets = next(point for point in points if point.error <= 1e-6)
    assert measure.accuracy(scene, method, 1.15 * meets.setting).error > 1e-6
    assert points == sorted(points, key=lambda point: -point.error)


def _stored(times, spread=0.01):
    """A dataset as `measure` leaves it: one scene, one setting; seconds of the (public, inner) call of each package."""
    names, batches = list(times), 10
    wobble = 1.0 + spread * np.arange(batches) / batches
    samples = np.array([[[[pair[k] * wobble] for pair in times.values()]] for k in range(2)])
    flat = samples.min(axis=-1)
    dims, axes = ("scene", "variant", "setting"), ("call", "scene", "variant", "setting")
    words = {
        "package": ["rebound" if name == "rebound" else "scipy" if "scipy" in name else measure.OURS for name in names],
        "version": ["1"] * len(names),
        "chart": ["angles" if "[angles" in name else "axis" for name in names], "shows": ["dense output"] * len(names),
        "language": ["Python" if "Python" in name else "numba, called through Python" for name in names],
        "implementation": ["compiled"] * len(names), "formulation": ["as it is"] * len(names),
    }  # fmt: skip
    data = xr.Dataset({
        "axis": (dims, np.full_like(flat[0], 1e-10)), "steps": (dims, np.full_like(flat[0], 54.0)),
        **dict.fromkeys(("seconds", "first_call", "reliable"), (axes, flat)),
        "seconds_samples": ((*axes, "batch"), samples), **{key: ("variant", column) for key, column in words.items()},
    }, coords={"call": list(measure.CALLS), "scene": ["spheroid"], "variant": names})  # fmt: skip
    facts = measured.circumstances() | {"measured": "2001-02-03", "processor": "an abacus"}
    return netcdf.describe(data, "peers").assign_attrs(facts)


def test_a_win_is_one_of_every_batch_and_the_first_numbers_are_over_methods_on_f_alone():
    data = _stored({"vern9-fixed[axis]": (1e-4, 1e-4), "rebound": (1.02e-4, 0.98e-4)})
    places = " and ".join(f"rebound (1.02 times, inner loop, spheroid at {error})" for error in ("10⁻⁶", "10⁻⁹"))
    clause = "are faster than symtop's fastest methods on f(t, y) alone (vern9-fixed[axis]); symtop is faster in "
    won = f"{places} {clause}2 of 2 and 0 of 2 comparisons (public call and inner loop), level in 0 and 0."
    assert summary.verdict(data)[0] == won
    assert "of 4 comparisons with symtop's fastest" in (sentence := summary.answer(data))
    assert "is faster in 2 and slower in 2. You lose the exact motion" in sentence
    data["seconds_samples"].values[:, 0, :, 0, 4] *= 1.03  # one batch of each was slow
    assert "0 of 2 and 0 of 2 comparisons (public call and inner loop), level in 2 and 2." in summary.verdict(data)[0]
    scipys = {f"scipy[axis] {language}": (8e-4, 9e-4) for language in ("numba", "Python")}
    data = _stored({"series[axis]": (1e-4, 1e-5), "rk4[axis]": (4e-4, 4e-5), "strang[axis]": (2e-4, 4e-5)} | scipys)
    data["steps"].loc[{"variant": "strang[axis]"}] = 500.0  # it alone returns 501 samples
    assert "return one a step, 55 to 55: a call of solve_ivp" in summary.verdict(data)[2]
    assert "takes 2 to 2 times as long as theirs, and 4 to 4 times as long as symtop's" in summary.verdict(data)[2]
    assert "solve_ivp takes 2 to 2 times as long as symtop's fastest on f(t, y) alone" in study.caption(data)[0]


def test_the_section_outlives_a_rerun_of_a_study_and_keeps_its_own_machine(tmp_path, quick_results):
    data = _stored({"rk4[axis]": (1e-3, 2e-5), "scipy[axis]": (6e-3, 4e-3)})
    findings = study.findings(data, [], tmp_path, ["drake was skipped."])
    findings["provenance"] = {**findings["provenance"], "processor": "an abacus"}
    netcdf.write_json(tmp_path / "peers.json", findings)
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
    names = {"report.md", *re.findall(r"^!results/([^/\n]+)$", (ROOT / ".gitignore").read_text(), re.MULTILINE)}
    for name in names | {"claims.nc", "claims.json"}:
        (tmp_path / "results" / name).touch()
    subprocess.run(["make", "clean"], cwd=tmp_path, check=True, capture_output=True)
    assert {path.name for path in (tmp_path / "results").iterdir()} == names > {"peers.nc", "guard.json"}


def test_the_stored_measurement_is_whole_and_its_inner_loops_did_the_work():
    data = netcdf.read(ROOT / "results" / "peers.nc")
    timed = np.isfinite(data["axis"].values)
    assert timed.sum() > 100
    assert np.isfinite(data["seconds"].values[:, timed]).all()  # both calls of every run
    mask = timed & (data["axis"].values < 1e-3)
    error, bound, end = (data[name].values[mask] for name in ("axis", "axis_bound", "end_error"))
    assert np.all(end <= 3.0 * error + bound)  # CVODE's first step depends on the first time that is asked for
    assert {"spheroid", "goldstein"} <= set(data["scene"].values.tolist())
    assert set(data["shows"].sel(variant=summary.groups(data)["symtop"]).values) == {common.FIXED_STEPS}
    names = ("symtop", "scipy[axis], numba", "scipy[angles], Python", "cvode", "rebound", "arkode-sprk")
    for cell in itertools.product(summary.NAMES, ("spheroid", "goldstein"), names, summary.JUDGED):
        call, scene, name, target = cell
        assert summary.best_of(data, call, scene, summary.groups(data)[name], target) is not None, cell


def test_all_ways_of_running_many_tops_end_at_the_same_axes():
    numbers = together.neighbours(11)  # no whole number of heyoka's batches
    pytest.importorskip("heyoka")
    batch = together.batched(numbers, 1e-9)
    assert together.worst(batch, numbers) < 1e-8
    assert batch()[1] > 10.0
    assert together.worst(together.fixed("srkn-14-6", "axis", numbers, 400), numbers) < 1e-8
    coarse, fine = (together.coarsest("rk4", "axis", numbers, error) for error in (1e-2, 1e-4))
    assert coarse < fine
    assert together.coarsest("rk4", "axis", numbers, 1e-15) is None
