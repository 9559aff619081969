"""Peers are judged like us, by both calls; a peer that wins is named; the section outlives a rerun of the studies."""

import ctypes
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from numba import cfunc, types
from scipy.integrate import solve_ivp

import symtop
from benchmarks import measured, peers
from benchmarks.peers import callbacks, common, measure, own, study, summary
from benchmarks.peers.adapters import sundae
from symtop.base import datasets
from symtop.methods.euler_lagrange import field_angles, with_rates
from symtop.methods.plan import Plan
from symtop.methods.space import field_axis
from symtop.report import page, style
from symtop.run.simulation import make_plan
from symtop.runner import run as runner, store

ROOT = Path(__file__).resolve().parents[2]
DOUBLES = ctypes.POINTER(ctypes.c_double)


@pytest.fixture(scope="module")
def scene():
    return symtop.scene("spheroid")


def _pointer(row):
    return row.ctypes.data_as(DOUBLES)


# ---- right-hand sides ------------------------------------------------------------------------------------------------


@cfunc(types.voidptr(types.voidptr))
def _numbers_of(vector):
    return callbacks._pointer_at(vector, 0)


class Core:
    """In place of SUNDIALS: an N_Vector is a struct that holds the address of its numbers and no more."""

    def __init__(self):
        kind = ctypes.CFUNCTYPE(DOUBLES, ctypes.c_void_p)
        self.N_VGetArrayPointer = kind(_numbers_of.address)


def _vector_field(function, state):
    numbers = [np.array(state), np.empty_like(state)]
    vectors = [np.array([row.ctypes.data], dtype=np.uint64) for row in numbers]
    assert function.ctypes(0.0, *(vector.ctypes.data for vector in vectors), None) == 0
    return numbers[1]


def test_all_right_hand_sides_on_the_axis_are_the_kernels_own(scene):
    y = common.start_of(scene.top, scene.start)
    par, _ = common.on_axis(scene.top, scene.start)
    expected = np.array(field_axis(par, tuple(y)))
    filled, through_c = np.empty(6), np.empty(6)
    common.filling_field(scene.top)(0.0, y, filled)
    callbacks.ode_field(scene.top).ctypes(None, _pointer(through_c), _pointer(y), 0.0)
    for found in (
        common.python_field(scene.top)(0.0, y),
        common.compiled_field(scene.top)(0.0, y),
        filled,
        through_c,
        _vector_field(callbacks.vector_field(scene.top, Core()), y),
    ):
        assert np.allclose(found, expected, rtol=1e-15, atol=0.0)


def test_both_right_hand_sides_in_angles_are_the_kernels_own(scene):
    par, state = with_rates(scene.top, scene.start)
    expected = field_angles(par, state)
    for field in (common.python_angles, common.compiled_angles):
        assert np.allclose(field(scene.top)(0.0, np.array(state)), expected, rtol=1e-14, atol=0.0)


def test_the_halves_of_the_split_field_add_up_to_the_motion(scene):
    top, start = scene.top, scene.start
    par, state = with_rates(top, start)
    theta_dot, phi_dot, psi_dot, theta_ddot, *_ = field_angles(par, state)
    expected = np.array([theta_dot, top.I1 * theta_ddot, phi_dot, psi_dot])
    y = np.array([start.theta, top.I1 * start.theta_dot, start.phi, start.psi])
    halves = [_vector_field(half, y) for half in callbacks.split_field(top, start, Core())]
    assert np.allclose(sum(halves), expected, rtol=1e-13, atol=0.0)
    assert not any(np.allclose(half, expected) for half in halves)
    moved = _vector_field(callbacks.split_field(top, start, Core())[0], y + np.array([0.0, 1.0, 1.0, 1.0]))
    assert np.array_equal(moved, halves[0])  # the force depends on theta alone: H is separable


def test_the_axis_as_a_particle_has_the_acceleration_of_the_axis(scene):
    top, start = scene.top, scene.start
    y = common.start_of(top, start)
    e, momentum = y[:3], y[3:]
    velocity = np.cross(momentum, e) / top.I1
    torque = top.mgl * np.array([-e[1], e[0], 0.0])
    expected = (np.cross(torque, e) + np.cross(momentum, velocity)) / top.I1
    particle = np.concatenate([e, velocity, np.zeros(3)])
    simulation = np.array([0, particle.ctypes.data], dtype=np.uint64)  # a struct with a pointer in its second place
    callbacks.particle_force(top, start, 8).ctypes(simulation.ctypes.data)
    assert np.allclose(particle[6:], expected, rtol=1e-13, atol=1e-13)
    assert not np.allclose(particle[6:], np.cross(torque, e) / top.I1)  # gravity alone


# ---- the two calls ---------------------------------------------------------------------------------------------------


def test_a_peer_that_is_not_installed_is_named_and_skipped(monkeypatch):
    for module in ("diffrax", "mujoco"):
        monkeypatch.setitem(sys.modules, module, None)  # an import of it fails
    found, missing = peers.load(("diffrax", "scipy", "mujoco"))
    assert {peer.package for peer in found} == {"scipy"}
    assert [sentence.split()[0] for sentence in missing] == ["diffrax", "mujoco"]
    assert all("skipped" in sentence for sentence in missing)


def test_nothing_is_missing_where_everything_is_there():
    found, missing = peers.load(("scipy", "odeint"))
    assert missing == []
    assert len({peer.row for peer in found}) == len(found)
    assert {(peer.package, peer.chart, peer.language) for peer in found} == {
        (package, chart, language)
        for package, charts in (("scipy", ("axis", "angles")), ("scipy-odeint", ("axis",)))
        for chart in charts
        for language in (common.PYTHON, common.NUMBA_IN_PYTHON)
    }


def _own(name):
    return peers.Peer(measure.OURS, symtop.integrator(name), own.LANGUAGE)


@pytest.mark.parametrize(
    ("name", "setting"), [("takahashi-imada", 0.01), ("rk4", 0.005), ("taylor", 1e-12), ("rk45-compiled", 1e-10)]
)
def test_the_kernel_alone_ends_where_simulate_ends(scene, name, setting):
    peer = _own(name)
    whole, loop = measure.ready(scene, peer, setting)
    data = whole()
    assert data["time"].size == measure.SHOWN
    truth = symtop.reference(scene, data["time"].values[-1:])["axis"].values
    there = float(common.charts.axis_distance(data["axis"].values[-1:], truth)[0])
    assert measure.end_error(scene, peer, loop) == pytest.approx(there, rel=0.3, abs=1e-13)


def _scipy(row):
    return next(peer for peer in peers.load(("scipy", "odeint"))[0] if peer.row == row)


@pytest.mark.parametrize(
    "row",
    ["scipy-dop853-python[axis]", "scipy-dop853-numba[angles]", "scipy-lsoda-numba[axis]", "scipy-odeint-numba[axis]"],
)
def test_both_calls_of_scipy_end_at_the_truth(scene, row):
    peer = _scipy(row)
    whole, loop = measure.ready(scene, peer, 1e-11)
    assert len(whole().states) == measure.SHOWN
    assert measure.end_error(scene, peer, loop) < 1e-7


def test_an_inner_loop_that_does_not_start_anew_is_seen(scene):
    """CVODE and others keep their state: a second call that went on from the first would be 20 nutations on."""
    peer = _scipy("scipy-dop853-python[axis]")
    horizon = measure.PERIODS * scene.nutation_period
    plan, _ = make_plan(scene, peer.method, tolerance=1e-9, horizon=horizon, samples=2)
    state = [common.start_of(scene.top, scene.start)]

    def call():
        field = common.python_field(scene.top)
        state[0] = solve_ivp(field, (0.0, plan.horizon), state[0], rtol=1e-9, atol=1e-9).y[:, -1]
        return state[0]

    assert measure.end_error(scene, peer, common.Inner(call, lambda last: last)) > 1e-2


def test_objects_are_built_inside_the_public_call_and_outside_the_inner_loop(scene):
    built = []

    class CVODE:
        def __init__(self, *_, **__):
            built.append(self)

        def solve(self, times, state):
            return SimpleNamespace(y=np.tile(state, (len(times), 1)), nfev=1)

        def init_step(self, time, state):
            self.state = state

        def step(self, time):
            return SimpleNamespace(y=self.state)

    library = sundae.Sundae(SimpleNamespace(CVODE=CVODE), "Adams")
    plan = Plan.until([0.0, 1.0, 2.0], 1e-6)
    for _ in range(3):
        library.public(scene.top, scene.start, plan)
    assert len(built) == 3
    loop = library.inner(scene.top, scene.start, plan)
    for _ in range(3):
        loop.call()
    assert len(built) == 4


# ---- accuracy and the search -----------------------------------------------------------------------------------------


def test_odeint_takes_the_steps_of_solve_ivps_lsoda_and_names_its_distribution(scene):
    new, old = (measure.accuracy(scene, _scipy(row).method, 1e-9)
                for row in ("scipy-lsoda-numba[axis]", "scipy-odeint-numba[axis]"))  # fmt: skip
    assert old.error == pytest.approx(new.error, rel=0.1)
    assert old.evaluations == pytest.approx(new.evaluations, rel=0.01)
    assert _scipy("scipy-odeint-numba[axis]").distribution == "scipy"


def test_an_odeint_that_gives_up_is_a_failure_and_not_a_row_of_zeros(scene, monkeypatch):
    monkeypatch.setattr("benchmarks.peers.adapters.odeint.MOST_STEPS", 5)
    with pytest.warns(Warning, match="Excess work"):
        assert np.isnan(measure.accuracy(scene, _scipy("scipy-odeint-python[axis]").method, 1e-9).error)


@pytest.mark.parametrize("row", ["scipy-dop853-python[axis]", "scipy-dop853-python[angles]"])
def test_a_peers_error_falls_with_its_tolerance(scene, row):
    coarse, fine = (measure.accuracy(scene, _scipy(row).method, tolerance) for tolerance in (1e-4, 1e-10))
    assert coarse.error > 1e-4
    assert fine.bound < fine.error < 1e-7


def test_the_search_finds_the_loosest_setting():
    scene, method = symtop.scene("goldstein"), symtop.integrator("takahashi-imada")
    points = measure.worth_timing(measure.search(scene, method, (1e-6,)), (1e-6,))
    meets = next(point for point in points if point.error <= 1e-6)
    assert measure.accuracy(scene, method, 1.15 * meets.setting).error > 1e-6
    assert points == sorted(points, key=lambda point: -point.error)


def test_compiling_is_not_taken_for_a_slow_solver(scene, monkeypatch):
    """The first call of a jitted solver takes seconds; the ladder goes on all the same, until a run is slow itself."""
    method = symtop.integrator("rk4")
    calls = []

    def run(_scene, _method, setting):
        calls.append(setting)
        slow = len(calls) == 1 or len(calls) == 6
        return measure.Point(setting, 1.0, 0.0, 1, 1, 9.0 if slow else 0.0)

    monkeypatch.setattr(measure, "accuracy", run)
    assert len(measure.search(scene, method)) == 5
    assert calls[0] == calls[1]


# ---- words -----------------------------------------------------------------------------------------------------------


def _stored(times, spread=0.01):
    """A dataset as `measure` leaves it: one scene, one setting; seconds of the (public, inner) call of each package."""
    names, batches = list(times), 10
    wobble = 1.0 + spread * np.arange(batches) / batches
    samples = np.array([[[[pair[k] * wobble] for pair in times.values()]] for k in range(2)])
    flat = samples.min(axis=-1)
    one, each = ("scene", "integrator", "setting"), ("call", "scene", "integrator", "setting")
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
            **{key: ("integrator", column) for key, column in words.items()},
        },
        coords={"call": list(measure.CALLS), "scene": ["spheroid"], "integrator": [f"{name}-one" for name in names]},
    )
    facts = measured.circumstances() | {"measured": "2001-02-03", "processor": "an abacus"}
    return datasets.describe(data, "peers").assign_attrs(facts)


def test_both_ratios_against_scipy_stand_side_by_side_for_each_chart_and_language():
    data = _stored({
        "symtop": (1e-3, 2e-5), "scipy[axis] C": (6e-3, 4e-3), "scipy[axis] Python": (7e-3, 5e-3),
        "scipy[angles] Python": (1.2e-2, 1e-2),
    })  # fmt: skip
    said = {sentence.partition(":")[0]: sentence for sentence in summary.verdict(data)}
    for name, public, inner in (
        ("scipy[axis], C", "6", "200"), ("scipy[axis], Python", "7", "250"), ("scipy[angles], Python", "12", "500"),
    ):  # fmt: skip
        assert f"takes {public} to {public} times as long as `simulate` with" in said[name]
        assert f"takes {inner} to {inner} times as long as that kernel alone" in said[name]
    assert "spheroid, axis errors of 1e-06 and 1e-09, 10 nutations" in said["All ratios"]
    ratios = {row[0]: row[1:] for row in summary.tables(data)[0].rows}
    assert ratios["scipy[angles], Python"] == ["angles", "Python", "12 to 12", "500 to 500"]


def test_the_verdict_names_winners_losers_and_ties_of_each_call():
    data = (
        _stored({
            "symtop": (1e-3, 1e-4), "rebound": (2e-4, 3e-4), "diffrax": (1.05e-3, 1.05e-4), "drake": (np.nan, np.nan),
            "mujoco": (1e-2, 1e-2), "arkode": (2e-3, 5e-5),
        })
    )  # fmt: skip
    said = summary.verdict(data)
    public, inner = (next(line for line in said if line.startswith(word)) for word in ("Public call", "Inner loop"))
    assert "faster in 2 of 6 comparisons, level or within the noise in 2, slower in 2: rebound in 2 of 2 (" in public
    assert "faster in 2 of 6 comparisons, level or within the noise in 2, slower in 2: arkode in 2 of 2 (" in inner
    ratios = {row[0]: row[3:] for row in summary.tables(data)[0].rows}
    assert ratios["rebound"] == ["0.2 to 0.2", "3 to 3"]
    assert ratios["drake"] == ["not reached", "not reached"]


def test_noise_is_not_called_a_win():
    data = _stored({"symtop": (1e-4, 1e-4), "rebound": (1.4e-4, 1.4e-4)})
    assert "faster in 2 of 2 comparisons, level or within the noise in 0" in summary.verdict(data)[0]
    data["seconds_samples"].values[:, 0, 0, 0, 0::5] *= 2.0  # one fifth of our batches was slow
    assert all(
        "faster in 0 of 2 comparisons, level or within the noise in 2" in said for said in summary.verdict(data)[1:]
    )


def test_the_price_of_a_callback_through_python_is_told():
    said = summary.verdict(_stored({"symtop": (1e-3, 1e-4), "cvode": (4e-4, 2e-4), "scikit-sundae": (3e-3, 2.4e-3)}))
    assert "CVODE takes 12 to 12 times as long where each call of its right-hand side goes through Python" in said[-1]


def test_every_row_names_its_chart_its_language_and_what_its_call_shows():
    given = summary.tables(_stored({"symtop": (1e-3, 1e-4), "scipy[angles] Python": (1e-2, 1e-2)}))[-1]
    columns = {name: [row[i] for row in given.rows] for i, name in enumerate(given.header)}
    assert columns["chart"] == ["axis", "angles"]
    assert columns["right-hand side"] == ["numba, called from C", "Python"]
    assert all(cell for row in given.rows for cell in row)


# ---- the report ------------------------------------------------------------------------------------------------------


def _peers_into(folder):
    data = _stored({"symtop": (1e-3, 2e-5), "scipy[axis] C": (6e-3, 4e-3)})
    found = runner.findings_of(study.STUDY, data, folder, style.save, failures=["drake was skipped."], cases=2)
    found["provenance"] = {**found["provenance"], "processor": "an abacus"}
    store.write_json(folder / "peers.json", found | {"measured": study.measured(data)})


def test_the_report_shows_the_peers_with_date_machine_and_versions(tmp_path):
    _peers_into(tmp_path)
    text = page.write(tmp_path).read_text()
    for words in (study.STUDY.title, "200 to 200 times as long as that kernel alone", "drake was skipped.",
                  "Measured on 2001-02-03", "an abacus", "scipy 1", "make peers"):  # fmt: skip
        assert words in text
        assert words in (tmp_path / "report.md").read_text()
    (tmp_path / "figures" / "peers-fronts.png").unlink()
    with pytest.raises(symtop.SymtopError, match="make peers"):
        page.write(tmp_path)


def test_the_section_outlives_a_rerun_of_a_study_and_keeps_its_own_machine(tmp_path):
    _peers_into(tmp_path)
    (tmp_path / "report.md").write_text("what an earlier run left")
    truth = runner.load("truth")
    runner.run(truth, tmp_path, quick=True, jobs=1, quiet=True, save=style.save)
    page.write(tmp_path)
    text = (tmp_path / "report.md").read_text()
    sections = re.findall(r"^## (.+)$", text, re.MULTILINE)
    assert study.STUDY.title in sections
    assert truth.title in sections
    assert "Measured on 2001-02-03" in text
    assert "an abacus" not in text.partition("## Provenance")[2]  # the studies were run here


def test_what_the_readme_cites_is_in_the_checkout():
    cited = set(re.findall(r"results/[\w/-]+\.(?:nc|json|md|png)", (ROOT / "README.md").read_text()))
    assert {"results/bench.json", "results/peers.nc"} <= cited
    studies = {f"results/{name}.{kind}" for name in runner.names() for kind in ("nc", "json")}
    kept = subprocess.run(["git", "ls-files", "results"], cwd=ROOT, capture_output=True, text=True, check=False).stdout
    assert not {path for path in cited - studies if not (ROOT / path).is_file()}
    if kept:  # a checkout, not an archive
        assert {path for path in cited - studies if "/figures/" not in path} <= set(kept.split())


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
    data = datasets.read(ROOT / "results" / "peers.nc")
    timed = np.isfinite(data["axis"].values)
    assert timed.sum() > 100
    assert np.isfinite(data["seconds"].values[:, timed]).all()  # both calls of every run
    good = timed & (data["axis"].values < 1e-3)
    error, bound, end = (data[name].values[good] for name in ("axis", "axis_bound", "end_error"))
    assert np.all(end <= 3.0 * error + bound)  # CVODE's first step depends on the first time that is asked for
    assert {"spheroid", "goldstein"} <= set(data["scene"].values.tolist())
    for scene in ("spheroid", "goldstein"):
        for target in summary.JUDGED:
            for call in summary.NAMES:
                for name in (
                    "symtop",
                    "scipy[axis], numba",
                    "scipy[angles], Python",
                    "cvode",
                    "rebound",
                    "arkode-sprk",
                ):
                    assert summary.best_of(data, call, scene, summary.groups(data)[name], target) is not None
