"""A byte that has flipped in a file: nothing is believed, nothing crashes, and what was computed is computed again."""

import random
import warnings

import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.core import jit, netcdf
from symtop.core.jit import compile_kernel, is_cached
from symtop.run import long_run as longrun

FLIPS = [pytest.param(12, id="few"), pytest.param(200, id="many", marks=pytest.mark.slow)]


def flip_bit(path, draw):
    """Flip a random bit of a random byte of a file; returns what it held."""
    content = path.read_bytes()
    buffer = bytearray(content)
    buffer[draw.randrange(len(content))] ^= 1 << draw.randrange(8)
    path.write_bytes(bytes(buffer))
    return content


def _tripled(x):
    return x + x + x


@pytest.mark.parametrize("flips", FLIPS)
def test_a_damaged_kernel_is_compiled_again(tmp_path, monkeypatch, flips):
    """On disk it is machine code: where one was believed, the process ended."""
    monkeypatch.setenv("SYMTOP_CACHE", str(tmp_path))
    draw, kernel = random.Random(5), compile_kernel(_tripled)
    assert kernel(2.0) == 6.0
    (signature,) = kernel.overloads
    code, bitcode, _ = kernel._cache.files(signature, kernel.targetctx.codegen())
    entry = jit._read(bitcode, jit._name(bitcode))
    assert jit._read(code, entry)  # the control
    for file, key in ((code, entry), (bitcode, jit._name(bitcode))):
        for _ in range(flips):
            content = flip_bit(file, draw)
            with pytest.raises(ValueError, match="damaged"):
                jit._read(file, key)
            file.write_bytes(content)
    for files in ([code], [bitcode], [code, bitcode]):
        for file in files:
            flip_bit(file, draw)
        kernel = compile_kernel(_tripled)
        assert is_cached(kernel, signature)  # as far as one can tell without reading
        assert kernel(2.0) == 6.0
        assert jit._read(code, jit._read(bitcode, jit._name(bitcode)))  # they are whole on disk again
    for length in (0, 10, 40):
        bitcode.write_bytes(content[:length])
        assert compile_kernel(_tripled)(2.0) == 6.0


_MADE = xr.Dataset({"theta": ("time", np.linspace(0.0, 1.0, 40))}, coords={"time": np.arange(40.0)})


@pytest.mark.parametrize("flips", FLIPS)
def test_a_damaged_file_is_data_or_one_sentence(tmp_path, flips):
    """Whoever reads it, in a runner or not: no error but SymtopError."""
    draw, path, count = random.Random(7), tmp_path / "case.nc", 0
    tree = xr.DataTree.from_dict({"one": _MADE.assign_attrs(title="x"), "two": _MADE})
    for data, read in ((_MADE, netcdf.read), (tree, netcdf.read_any)):
        netcdf.write(data, path)
        for _ in range(flips):
            content = flip_bit(path, draw)
            try:
                read(path)
            except symtop.SymtopError:
                count += 1
            path.write_bytes(content)
    assert count


H = 0.002


@pytest.mark.parametrize("flips", FLIPS)
def test_a_damaged_checkpoint_is_not_gone_on_from(tmp_path, monkeypatch, flips):
    monkeypatch.setenv("SYMTOP_CACHE", str(tmp_path / "cache"))
    draw, scene, method = random.Random(8), symtop.scene("spheroid"), symtop.integrator("midpoint")
    _, solver = longrun.chart_of(method)
    par, rule, state = solver.setup(scene.top, scene.start, H)
    start = solver.loop.start(par, rule, state, H)
    for file in (True, tmp_path / "own.nc"):
        book = longrun._Checkpoint(file, "an identity")
        book.latest = start._replace(k=7), [[0.5] * 15] * 3
        book.save()
        expected = book.resumed(start)
        assert (expected[0].k, expected[1]) == (7, [[0.5] * 15] * 3)
        restarts = refusals = 0
        for _ in range(flips):
            content = flip_bit(book.file, draw)
            with warnings.catch_warnings(record=True, action="always") as record:
                try:
                    read_state, rows = book.resumed(start)
                except symtop.SymtopError as error:
                    assert "remove it" in str(error)  # noqa: PT017
                    assert file is not True
                    refusals += 1
                else:
                    restarts += read_state.k == 0
                    assert read_state in (expected[0], start)
                    assert rows in (expected[1], [])
                    assert (read_state.k == 0) == any("damaged" in str(warning.message) for warning in record)
            book.file.write_bytes(content)
        assert restarts if file is True else refusals
