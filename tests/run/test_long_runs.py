"""Long runs: the same bits in stretches, after kill -9 and in one piece; flat memory; rounding at its best."""

import dataclasses
import signal
import subprocess
import sys
import time
import tracemalloc
from fractions import Fraction

import numpy as np
import pytest
from numba import njit
from symtop_studies.drift.runs import members, rounding

import symtop
from symtop.core.jit_functions import fused
from symtop.methods.framework import loop as drive
from symtop.run import long_run as longrun
from symtop.run.long_run import chart_of, leaves, long_run, regrown, scattered, windows
from tests.commands import ROOT, call, printed_by
from tests.conftest import defer

SCENE = symtop.scene("spheroid")
H = SCENE.nutation_period / 400.37


@pytest.mark.parametrize("name", ["rk4", "simo-wong", "kahan", "ode", "jolt", "strang", "gauss-4", "stormer-verlet"])
def test_the_energy_is_that_of_simulate_whether_or_not_the_momenta_are_kept(name):
    """With the p_psi of the start, simo-wong, which keeps the energy, seemed to lose 1e-4 of it, and ode to gain it."""
    steps, h = 3000, 0.002
    data = long_run(SCENE, name, steps=steps, step_size=h, quiet=True)
    row = symtop.integrator(name).variant(chart_of(symtop.integrator(name))[0])
    dense = symtop.simulate(SCENE, row, step_size=h, horizon=steps * h, samples=steps + 1, guard=False)
    change = (dense["energy"] - dense["energy"][0]).values / SCENE.energy_scale
    extremes = float(data["energy_least"].min()), float(data["energy_largest"].max())
    largest = max(map(abs, extremes))
    assert largest == pytest.approx(np.max(np.abs(change)), rel=2e-2, abs=1e-12)
    if name == "stormer-verlet":
        assert extremes == pytest.approx((change.min(), change.max()), rel=1e-2, abs=1e-9)
        assert float(data["theta_largest"].max()) == pytest.approx(float(dense["theta"].max()), abs=1e-3)
    if name == "simo-wong":
        assert largest < 1e-12
        assert np.ptp(dense["p_psi"].values) > 1e-6  # the control: it does not keep this one


@pytest.mark.parametrize(("files", "words"), [
    ({"output": "keep.py"}, "no netCDF file"), ({"output": ""}, "output must be a file, not the folder"),
    ({"checkpoint": ""}, "checkpoint must be a file, not the folder"), ({"output": "no/a.nc"}, "folder that is there"),
    ({"output": "a.nc", "checkpoint": "a.nc"}, "output and checkpoint must be two files"),
    ({"output": "a.nc", "checkpoint": "b/../a.nc"}, "output and checkpoint must be two files"),
])  # fmt: skip
def test_a_file_that_would_replace_something_else_is_refused_before_a_step(tmp_path, monkeypatch, files, words):
    (tmp_path / "keep.py").write_text("x = 1\n")
    settings = {"steps": 10, "step_size": H, "quiet": True}
    for _ in range(2):  # a result of its own is replaced
        long_run(SCENE, "strang", output=tmp_path / "run.nc", **settings)
    monkeypatch.setattr(longrun._Checkpoint, "resumed", lambda *_: pytest.fail("it begins"))
    with pytest.raises(symtop.SymtopError, match=words):
        long_run(SCENE, "strang", **{name: tmp_path / file for name, file in files.items()}, **settings)
    assert (tmp_path / "keep.py").read_text() == "x = 1\n"


@pytest.mark.parametrize("steps", [1, 9_999, 10_000, 123_456, 10**9])
def test_windows_and_samples_cover_a_run_once(steps):
    ends = windows(steps)
    assert (ends[-1], ends) == (steps, sorted(set(ends)))
    assert max(np.diff([0, *ends])) <= longrun.LONGEST_WINDOW
    marks = scattered(ends[-2] if len(ends) > 1 else 0, steps)
    assert marks[-1] == steps
    assert np.all(np.diff(marks) > 0)
    if marks.size > 100:
        assert np.unique(np.diff(marks)).size > 1  # no fixed stride


@pytest.mark.parametrize(("name", "h"), [
    *((name, H) for name in ("stormer-verlet", "midpoint", "galerkin-simpson", "takahashi-imada", "gauss-4", "rk4",
                             "jsbsim-buss2", "jolt-float32", "no-squish", "lammps-rigid")),
    ("exact-discrete", SCENE.nutation_period / 4.37),
    *((f"gauss-{order}", phase * SCENE.nutation_period / (2.0 * np.pi)) for order in (2, 4, 12)
      for phase in (1.3, 5.0, 10.0)),
])  # fmt: skip
def test_a_run_in_stretches_has_the_bits_of_one_in_one_piece(name, h):
    """With large steps some of a Gauss method are swept and others are solved by Newton."""
    solver = chart_of(symtop.integrator(name))[1]
    par, rule, state = solver.setup(SCENE.top, SCENE.start, h)
    marks = np.array([3, 50, 51, 200])
    columns = slice(6 if name == "exact-discrete" else None)  # it steps eight numbers and shows six: others are not set
    expected = solver.loop(par, rule, state, h, marks)
    first, middle = solver.loop.advance(par, rule, solver.loop.start(par, rule, state, h), h, marks[:2])
    copy = middle._replace(carry=regrown(middle.carry, iter(leaves(middle.carry))))
    for position in (middle, copy):
        second, end = solver.loop.advance(par, rule, position, h, marks[2:])
        assert np.array_equal(np.concatenate([first.states, second.states])[:, columns], expected.states[:, columns])
        assert np.array_equal(np.concatenate([first.momenta, second.momenta])[1:], expected.momenta[1:])
        assert (end.k, middle.k) == (200, 50)


@pytest.mark.parametrize(("name", "h"), [("stormer-verlet", H), ("exact-discrete", SCENE.nutation_period / 4.37)])
def test_what_was_rounded_off_is_part_of_a_position(name, h):
    _, solver = chart_of(symtop.integrator(name))
    par, rule, state = solver.setup(SCENE.top, SCENE.start, h)
    _, stop = solver.loop.advance(par, rule, solver.loop.start(par, rule, state, h), h, np.array([1000]))
    sums = {"low": (0.0,) * 4} if name == "stormer-verlet" else {"carry": stop.carry[:4] + (0.0,) * 8}
    ends = [solver.loop.advance(par, rule, start, h, np.array([20_000]))[1] for start in (stop, stop._replace(**sums))]
    assert ends[0].state != ends[1].state


SCRIPT = """
import sys, symtop
from symtop.run import long_run as longrun
longrun.LONGEST_WINDOW, longrun.SAVE_SECONDS = 200_000, 0.0
scene = symtop.scene("spheroid")
longrun.long_run(scene, "gauss-2", steps=4_000_000, step_size=scene.nutation_period / 400.37, checkpoint=sys.argv[1])
"""


@pytest.mark.parametrize("blow", [signal.SIGKILL, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_a_killed_run_resumes_to_the_same_bits(tmp_path, monkeypatch, blow):
    file = tmp_path / "run.nc"
    with subprocess.Popen([sys.executable, "-c", SCRIPT, str(file)], cwd=ROOT) as child:
        try:
            deadline = time.monotonic() + 120.0
            while not file.is_file() and child.poll() is None and time.monotonic() < deadline:
                time.sleep(0.01)
            time.sleep(0.1)
            child.send_signal(blow)
            code = child.wait(60)
        finally:
            child.kill()  # it is waited for even if the machine was too slow for the minute
    assert code == (-signal.SIGKILL if blow == signal.SIGKILL else 128 + signal.SIGTERM)
    monkeypatch.setattr(longrun, "LONGEST_WINDOW", 200_000)
    steps_done, steps = longrun.netcdf.read(file)["steps_done"].item(), 4_000_000
    assert 10_000 <= steps_done < steps
    positions, resume = [], longrun._Checkpoint.resumed

    def noting(self, start):
        position, rows = resume(self, start)
        positions.append(position.k)
        return position, rows

    monkeypatch.setattr(longrun._Checkpoint, "resumed", noting)  # a checkpoint holds a hash of the loop itself
    resumed = long_run(SCENE, "gauss-2", steps=steps, step_size=H, checkpoint=file, quiet=True)
    assert steps_done in positions  # it did go on from there
    assert not file.exists()
    assert resumed.identical(long_run(SCENE, "gauss-2", steps=steps, step_size=H, quiet=True))


def test_a_checkpoint_knows_a_method_by_what_it_holds_and_not_by_its_name():
    h = SCENE.nutation_period / 100.37

    def triple(x):
        return symtop.composition("triple", (x, 1.0 - 2.0 * x, x), (x / 2, (1 - x) / 2, (1 - x) / 2, x / 2), order=2)

    identity = lambda method: longrun._identity(SCENE, method, h, 500, True)
    assert identity(triple(0.3)) == identity(triple(0.3))  # the control: made twice, it is the same
    assert identity(triple(0.3)) != identity(triple(0.3000001))
    method = symtop.integrator("stormer-verlet")
    renamed = dataclasses.replace(symtop.integrator("strang"), name=method.name)
    assert identity(renamed) != identity(method)  # another kernel
    assert identity(dataclasses.replace(method, summary="said otherwise")) == identity(method)
    runs = [(SCENE, 2.0 * h, 500, True), (SCENE, h, 501, True), (SCENE, h, 500, False)]
    runs.append((symtop.scene("goldstein"), h, 500, True))
    assert len({longrun._identity(scene, method, *run) for scene, *run in runs} | {identity(method)}) == 5


def test_an_interrupt_keeps_every_finished_window(tmp_path, monkeypatch):
    file, calls = tmp_path / "run.nc", []
    note = longrun._Checkpoint.note

    def tired(self, position, rows):
        calls.append(1)
        if len(calls) == 5:
            raise KeyboardInterrupt
        note(self, position, rows)

    monkeypatch.setattr(longrun._Checkpoint, "note", tired)
    with pytest.raises(KeyboardInterrupt):
        long_run(SCENE, "rk4", steps=50_000, step_size=H, checkpoint=file, quiet=True)
    resumed = long_run(SCENE, "rk4", steps=50_000, step_size=H, checkpoint=file, quiet=True)
    assert len(calls) == 5 + resumed.sizes["window"] - 4
    assert resumed.identical(long_run(SCENE, "rk4", steps=50_000, step_size=H, quiet=True))


def test_a_result_that_cannot_be_written_leaves_the_checkpoint(tmp_path, monkeypatch):
    """The disk is full when the run is done: the same call writes what was computed, without a step."""
    output, file, write = tmp_path / "windows.nc", tmp_path / "run.nc", longrun.netcdf.write
    settings = {"steps": 50_000, "step_size": H, "checkpoint": file, "output": output, "quiet": True}

    def full(data, path):
        if path == output:
            raise symtop.SymtopError(f"cannot write {path}: No space left on device")
        return write(data, path)

    monkeypatch.setattr(longrun.netcdf, "write", full)
    with pytest.raises(symtop.SymtopError, match=r"No space left on device; the steps are kept in .*run.nc"):
        long_run(SCENE, "rk4", **settings)
    assert file.is_file()
    monkeypatch.undo()
    monkeypatch.setattr(longrun._Checkpoint, "note", lambda *_: pytest.fail("it steps"))
    data = long_run(SCENE, "rk4", **settings)
    assert not file.exists()
    assert longrun.netcdf.read(output).identical(data)
    monkeypatch.undo()
    assert data.identical(long_run(SCENE, "rk4", steps=50_000, step_size=H, quiet=True))


def test_checkpoints_of_other_runs_are_refused_and_a_failed_run_shows_the_windows_it_had(tmp_path):
    file = tmp_path / "run.nc"
    book = longrun._Checkpoint(file, "another")
    book.note(drive.Position((1.0,), (0.0,), (), 7), [[0.0]])
    book.save()
    with pytest.raises(symtop.SymtopError, match="belongs to another run"):
        long_run(SCENE, "cayley", steps=1000, step_size=H, checkpoint=file, quiet=True)
    data = long_run("bruls-cardona-arnold", "stormer-verlet", steps=10**6, step_size=2e-3, quiet=True)
    assert data.attrs["outcome"] == "left_chart"


@pytest.mark.parametrize("name", ["midpoint", "strang", "cayley", *defer("stormer-verlet")])
def test_compensated_sums_drift_less_than_plain_ones(name):
    data = rounding(SCENE, symtop.integrator(name), 300_000, 1000.37, 3)
    assert float(data["end"]) < 2e-15
    assert float(data["gain"]) > 8.0
    assert max(float(data["p_phi"]), float(data["p_psi"])) < 2e-14


def test_a_fused_sum_is_rounded_once_and_memory_does_not_grow_with_the_steps():
    tiny = 2.0**-30

    @njit
    def compiled(a, b, c):
        return fused(a, b, c)

    assert compiled(1.0 + tiny, 1.0 - tiny, -1.0) == -(tiny**2)
    assert (1.0 + tiny) * (1.0 - tiny) - 1.0 == 0.0
    assert fused(Fraction(1, 3), Fraction(3), Fraction(1)) == 2
    peaks = []
    for steps in (100_000, 1_000_000):
        long_run(SCENE, "stormer-verlet", steps=steps, step_size=H, quiet=True)
        tracemalloc.start()
        long_run(SCENE, "stormer-verlet", steps=steps, step_size=H, quiet=True)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 1_000_000


def test_the_command_runs_and_says_what_changed(tmp_path):
    files = ["--checkpoint", tmp_path / "c.nc", "-o", tmp_path / "long.nc"]
    assert "modified_energy" in call("long", "spheroid", "cayley", "--steps", "2e4", *files).output
    assert (tmp_path / "long.nc").is_file()
    result = call("long", "spheroid", "rk45", "--steps", "10", "--step-size", "0.1", code=2)
    assert "rk45 has no compiled loop of fixed steps, as strang has, to be run" in result.stderr


@pytest.mark.parametrize("name", ["strang", *defer("gauss-4")])  # the latter turns back what it steps, to show it
def test_a_body_is_watched_as_simulate_shows_it(name):
    scene = symtop.scene("heavy-brick", bodies=True)
    steps, h = 10_000, scene.nutation_period / 50.37
    data = long_run(scene, name, steps=steps, step_size=h, quiet=True)
    dense = symtop.simulate(scene, name, step_size=h, horizon=steps * h, samples=steps + 1, guard=False)
    length = np.linalg.norm(dense.momentum, axis=1)
    changes = {"energy": (dense.energy - scene.top.energy(scene.start)) / scene.energy_scale,
               "p_phi": (dense.p_phi - scene.top.momenta(scene.start).p_phi) / scene.momentum_scale,
               "momentum": length / scene.momentum_scale - 1.0,
               "theta": dense.theta}  # fmt: skip
    for quantity, values in changes.items():
        span = float(values.max() - values.min())
        assert float(data[f"{quantity}_least"].min()) == pytest.approx(float(values.min()), abs=0.05 * span + 1e-15)
        assert float(data[f"{quantity}_largest"].max()) == pytest.approx(float(values.max()), abs=0.05 * span + 1e-15)
    scene = symtop.Scene("free", symtop.RigidBody(1.0, 1.2, 0.6), symtop.Attitude((1, 0, 0, 0), (0.2, 0.3, 5.0)), 200.0)
    data = long_run(scene, "rk4", steps=2000, step_size=0.1, quiet=True)
    run = symtop.simulate(scene, "rk4", step_size=0.1, guard=False)
    assert data.outcome == run.outcome == "not_normalised"
    assert abs(data.reached_time - run.reached_time) < 0.02 * run.reached_time


def test_what_a_free_body_keeps_grows_as_rounding_and_what_it_does_not_keep_as_the_time(tmp_path):
    command = ["long", "tennis-racket", "--steps", "1e5", "--per-nutation", "60.37", "--checkpoint", tmp_path / "c.nc"]
    sizes = {}
    for name in ("strang", "rk4"):
        row = next(line.split() for line in call(*command, name).output.splitlines() if line.startswith("|L|"))
        sizes[name] = max(abs(float(row[1])), abs(float(row[2]))), float(row[4].removeprefix("t^"))
    assert sizes["strang"][0] < 1e-14
    assert sizes["rk4"][0] > 1e-6
    assert sizes["rk4"][1] == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_a_small_correction_is_not_rounded_to_one_side_and_no_checkpoint_depends_on_earlier_runs():
    """This start lost 1.5e-14 of its energy in 5e7 steps while midpoint rounded its last correction by itself."""
    start = members(SCENE, 15)[14]
    run = long_run(start, "midpoint", steps=50_000_000, step_size=start.nutation_period / 1000.37, quiet=True)
    assert abs(float(run["modified_energy_mean"][-1])) / start.energy_grain < 5e-15
    # Told before and after other work by a new process, and by this one.
    script = """
import symtop
from symtop.run import long_run
def identity():
    return long_run._identity(symtop.scene("spheroid"), symtop.integrator("midpoint"), 0.01, 1000, True)
print(identity())
symtop.simulate("spheroid", "strang", step_size=0.01, samples=3)
symtop.reference("spheroid", [1.0])
symtop.ensemble(symtop.population(40, seed=1), "midpoint", per_nutation=50, nutations=1, samples=3)
for name in ("galerkin-simpson", "gauss-4", "stormer-verlet"):  # each builds another loop round shared functions
    symtop.kernel_loop.plain.func(long_run.chart_of(symtop.integrator(name))[1].loop)
print(identity())
"""
    output = printed_by(script, cwd=ROOT).split()
    assert output == [str(longrun._identity(SCENE, symtop.integrator("midpoint"), 0.01, 1000, True))] * 2
