"""An ensemble that goes to a file is the one in memory, and one that was killed ends as the same file, to the byte."""

import contextlib
import errno
import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.core import files
from symtop.run.ensemble import chunks, ensemble, ensemble as ensembles
from tests.commands import printed_by
from tests.conftest import defer

SOME = symtop.population(60, seed=5)
SETTINGS = {"per_nutation": 20, "nutations": 3, "samples": 21, "quiet": True}
MILLION = """
import resource, sys
import symtop
n, path = int(sys.argv[1]), sys.argv[2]
symtop.ensemble(symtop.population(n, seed=2), "strang[axis]", per_nutation=50, nutations=2, samples=3, path=path)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.fixture
def small_pieces(monkeypatch):
    monkeypatch.setattr(chunks, "CHUNK", 21 * 7)


def assert_refused(words, path, name="strang[axis]", **changes):
    """The ensemble is not written to that file."""
    with pytest.raises(symtop.SymtopError, match=words):
        symtop.ensemble(SOME, name, path=path, **SETTINGS | changes)


@pytest.mark.parametrize(("name", "settings"), [
    ("stormer-verlet", {}), ("strang[axis]", {"variables": ["energy", "p_phi"]}),
    ("exact", {"per_nutation": None, "nutations": None, "horizon": 2.0}), *defer(("strang[attitude]", {}),
          ("midpoint", {"nutations": None, "horizon": 0.7, "per_nutation": None, "step_size": 0.01})),
])  # fmt: skip
def test_the_file_holds_the_ensemble_in_memory(tmp_path, small_pieces, name, settings):
    expected = symtop.ensemble(SOME, name, **SETTINGS | settings)
    with symtop.ensemble(SOME, name, path=tmp_path / "runs.nc", **SETTINGS | settings) as data:
        assert data.load().identical(expected)
    assert [file.name for file in tmp_path.iterdir()] == ["runs.nc"]


@pytest.mark.parametrize("step", [{"step_size": 0.05}, {"step_size": 0.25, "horizon": 2.0}], ids=["many steps", "few"])
def test_times_that_all_share_are_a_row_in_the_file_as_well(tmp_path, small_pieces, step):
    scenes, settings = ["spheroid"] * 40, {**step, "samples": 21, "quiet": True}
    with symtop.ensemble(scenes, "strang", path=tmp_path / "runs.nc", **settings) as data:
        assert data["time"].dims == ("time",)
        assert data.load().identical(symtop.ensemble(scenes, "strang", **settings))


@pytest.mark.parametrize("threads", [1, 3])
def test_what_is_on_disk_is_not_computed_again_and_the_bytes_are_the_same(tmp_path, small_pieces, monkeypatch, threads):
    calm, path = tmp_path / "calm.nc", tmp_path / "runs.nc"
    symtop.ensemble(SOME, "strang[axis]", path=calm, **SETTINGS).close()
    starts, keep = [], ensemble.Stream.keep

    def interrupted(stream, piece, columns):
        if len(starts) == 4:
            raise KeyboardInterrupt
        starts.append(piece.start)
        keep(stream, piece, columns)

    monkeypatch.setattr(ensemble.Stream, "keep", interrupted)
    with pytest.raises(KeyboardInterrupt):
        symtop.ensemble(SOME, "strang[axis]", path=path, threads=threads, **SETTINGS)
    parts = {file.name for file in (tmp_path / "runs.nc.parts").glob("*.npz")}
    assert parts == {f"{first}-{first + 7}.npz" for first in starts}
    assert not path.exists()
    new_starts = []
    monkeypatch.setattr(ensemble.Stream, "keep", lambda *args: new_starts.append(args[1].start) or keep(*args))
    symtop.ensemble(SOME, "strang[axis]", path=path, threads=threads, **SETTINGS).close()
    assert (starts, new_starts) == ([0, 7, 14, 21], [28, 35, 42, 49, 56])
    assert path.read_bytes() == calm.read_bytes()


def test_the_beginning_of_another_ensemble_and_a_damaged_piece_are_refused(tmp_path, small_pieces, monkeypatch):
    path, folder = tmp_path / "runs.nc", tmp_path / "runs.nc.parts"
    with monkeypatch.context() as patch:
        patch.setattr(ensemble.Stream, "finish", lambda *_: xr.Dataset())
        symtop.ensemble(SOME, "strang[axis]", path=path, **SETTINGS)
    for changes in ({"samples": 20}, {"per_nutation": 21}, {"variables": ["axis"]}):
        assert_refused("beginning of another ensemble", path, **changes)
    assert_refused("beginning of another ensemble", path, "cayley[axis]")
    (folder / "7-14.npz").write_bytes((folder / "7-14.npz").read_bytes()[:-300])
    assert_refused(r"7-14.npz is damaged .*: remove it", path)
    (folder / "7-14.npz").unlink()
    with symtop.ensemble(SOME, "strang[axis]", path=path, **SETTINGS) as data:
        assert data.load().identical(symtop.ensemble(SOME, "strang[axis]", **SETTINGS))


def test_one_process_at_a_time_writes_a_file(tmp_path, small_pieces, monkeypatch):
    """A second one on the same path is told so in a sentence; another path, and the same one later, are free."""
    path, keep, calls = tmp_path / "runs.nc", ensemble.Stream.keep, []

    def disturbed(stream, piece, columns):
        if piece.start == 7 and not calls:
            calls.append(1)
            assert_refused(f"another process is writing {path}: wait until it has", path)
            symtop.ensemble(SOME, "strang[axis]", path=tmp_path / "other.nc", **SETTINGS).close()
        keep(stream, piece, columns)

    monkeypatch.setattr(ensemble.Stream, "keep", disturbed)
    with symtop.ensemble(SOME, "strang[axis]", path=path, **SETTINGS) as data:
        assert data.load().identical(symtop.ensemble(SOME, "strang[axis]", **SETTINGS))
    assert calls
    assert {file.name for file in tmp_path.iterdir()} == {"runs.nc", "other.nc"}


def test_a_piece_that_was_removed_is_not_called_damaged(tmp_path, small_pieces, monkeypatch):
    path, finish = tmp_path / "runs.nc", ensemble.Stream.finish

    def robbed(stream, pieces, added):
        (tmp_path / "runs.nc.parts" / "7-14.npz").unlink()
        return finish(stream, pieces, added)

    with monkeypatch.context() as patch:
        patch.setattr(ensemble.Stream, "finish", robbed)
        assert_refused(r"7-14.npz is not there any more, so somebody has removed it", path)
    with symtop.ensemble(SOME, "strang[axis]", path=path, **SETTINGS) as data:
        assert data.load().identical(symtop.ensemble(SOME, "strang[axis]", **SETTINGS))


def test_pieces_that_do_not_say_whose_they_are_belong_to_nobody(tmp_path, small_pieces, monkeypatch):
    """Such as those of an ensemble that was ended while it removed them."""
    path, settings = tmp_path / "runs.nc", {**SETTINGS, "path": tmp_path / "runs.nc"}
    unlink = Path.unlink

    def killed(file, **settings):
        if file.name == "28-35.npz":
            raise KeyboardInterrupt
        unlink(file, **settings)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", killed)
        with pytest.raises(KeyboardInterrupt):
            symtop.ensemble(SOME, "strang[axis]", **settings)
    members = symtop.population(60, seed=6)
    with pytest.raises(symtop.SymtopError, match="holds the beginning of another ensemble"):
        symtop.ensemble(members, "strang[axis]", **settings)
    content = path.read_bytes()
    symtop.ensemble(SOME, "strang[axis]", **settings).close()  # the same goes on, to the same file
    assert (path.read_bytes(), [file.name for file in tmp_path.iterdir()]) == (content, ["runs.nc"])
    folder = tmp_path / "runs.nc.parts"
    folder.mkdir()
    (folder / "0-7.npz").write_bytes(b"somebody's")
    assert_refused("does not say which ensemble it is of", path)
    assert ((folder / "0-7.npz").read_bytes(), path.read_bytes()) == (b"somebody's", content)


def test_nothing_is_replaced_that_is_no_netcdf_file(tmp_path, small_pieces):
    path = tmp_path / "mine.py"
    path.write_text("print(1)")
    assert_refused("it is there, and no netCDF file", path)
    assert path.read_text() == "print(1)"
    for place, words in ((tmp_path, "cannot write"), (tmp_path / "no" / "runs.nc", "path must be in a folder that is")):
        assert_refused(words, place)
    assert [file.name for file in tmp_path.iterdir()] == ["mine.py"]
    for name in ("strang[axis]", "rk4[axis]"):
        with symtop.ensemble(SOME, name, path=tmp_path / "runs.nc", **SETTINGS) as data:
            assert data.attrs["integrator"] == name


def test_what_a_killed_writer_left_is_swept_and_a_library_without_room_says_so(tmp_path, small_pieces, monkeypatch):
    path = tmp_path / "runs.nc"
    (tmp_path / ".runs.nc.abc.part").write_bytes(b"half")
    no_room = Mock(side_effect=RuntimeError("NetCDF: HDF error"))
    with monkeypatch.context() as patch:
        patch.setattr(ensemble, "_lay_out", no_room)
        assert_refused("is the disk full", path)
    assert {file.name for file in tmp_path.iterdir()} == {"runs.nc.parts"}
    (tmp_path / "runs.nc.parts" / ".0-7.npz.0123abcd.part.npz").write_bytes(b"half")
    monkeypatch.setattr(ensemble.Stream, "keep", no_room)  # nothing is left to be computed
    symtop.ensemble(SOME, "strang[axis]", path=path, **SETTINGS).close()
    assert [file.name for file in tmp_path.iterdir()] == ["runs.nc"]


def test_a_file_system_without_locks_is_written_to(tmp_path, monkeypatch):
    for number, fails in ((errno.ENOLCK, False), (errno.EIO, True)):
        monkeypatch.setattr(files.fcntl, "flock", Mock(side_effect=OSError(number, "no")))
        with pytest.raises(OSError, match="no") if fails else contextlib.nullcontext():
            symtop.ensemble(SOME, "strang[axis]", path=tmp_path / "runs.nc", **SETTINGS).close()


def test_what_does_not_fit_into_memory_needs_a_path(tmp_path, monkeypatch):
    monkeypatch.setattr(ensembles, "MOST_VALUES", 60 * 21 * 4)
    symtop.ensemble(SOME, "strang[axis]", variables=["axis"], **SETTINGS)
    with pytest.raises(symtop.SymtopError, match="give a path to stream them to a netCDF file"):
        symtop.ensemble(SOME, "strang[axis]", variables=["axis", "energy"], **SETTINGS)
    symtop.ensemble(SOME, "strang[axis]", path=tmp_path / "runs.nc", **SETTINGS).close()


@pytest.mark.slow
def test_a_million_members_take_little_memory_and_survive_a_kill(tmp_path):
    """Memory beyond that of the population (132 bytes a member) and of what is asked for does not grow with members."""
    calm, path, peak = tmp_path / "calm.nc", tmp_path / "runs.nc", {}
    for n, file in ((100_000, tmp_path / "few.nc"), (1_000_000, calm)):
        begin = time.monotonic()
        peak[n] = int(printed_by(MILLION, n, file)) / 1024
        print(f"{n} members: {time.monotonic() - begin:.1f} s, {peak[n]:.0f} MB at most")
    assert peak[1_000_000] - peak[100_000] < 500
    process = subprocess.Popen([sys.executable, "-c", MILLION, "1000000", str(path)], stdout=subprocess.DEVNULL)
    while len(list((tmp_path / "runs.nc.parts").glob("*.npz"))) < 15:
        time.sleep(0.02)
        assert process.poll() is None
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not path.exists()
    printed_by(MILLION, 1_000_000, path)
    assert path.read_bytes() == calm.read_bytes()
    with xr.open_dataset(path) as data:
        assert (data.outcome == "ok").mean() > 0.999
        last = symtop.ensemble(symtop.population(1_000_000, seed=2).isel(member=slice(-5, None)), "strang[axis]",
                               per_nutation=50, nutations=2, samples=3, quiet=True)  # fmt: skip
        np.testing.assert_array_equal(data.axis[-5:], last.axis)


INTERRUPTED = """
import atexit, os, signal, threading, time
import symtop
members, asked_at = symtop.population(4000, seed=1), []
def run(nutations):
    symtop.ensemble(members, NAME, quiet=True, threads=THREADS, nutations=nutations, SETTING)
def interrupt():
    asked_at.append(time.monotonic())
    os.kill(os.getpid(), signal.SIGINT)
def say():
    print(time.monotonic() - asked_at[0])
run(1)
threading.Timer(0.3, interrupt).start()
atexit.register(say)  # called once all threads have ended
try:
    run(LONG)
except KeyboardInterrupt:
    say()
"""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "setting", "long", "threads"), [
    ("strang[axis]", "per_nutation=200", 20_000, 1), ("strang[axis]", "per_nutation=200", 20_000, 2),
    ("gauss-12[attitude]", "per_nutation=50", 2000, 2), ("rk45-compiled[axis]", "tolerance=1e-9", 10_000, 2),
])  # fmt: skip
def test_an_interrupt_is_heard_within_a_second(name, setting, long, threads):
    code = INTERRUPTED.replace("NAME", repr(name)).replace("THREADS", str(threads))
    code = code.replace("SETTING", setting).replace("LONG", str(long))
    raise_time, end_time = map(float, printed_by(code).split())
    print(f"{name}: heard after {raise_time:.2f} s, ended after {end_time:.2f} s")
    assert raise_time < 1.0
    assert end_time < 4.0
