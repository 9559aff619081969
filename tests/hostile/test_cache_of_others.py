"""A compiled cache that somebody else may write is never read: what it holds is a program."""

import json
import os
import shutil
import stat
import zlib

import pytest
import xarray as xr

import symtop
from symtop.cli import doctor
from symtop.core import files, jit
from symtop.core.jit import compile_kernel
from symtop.run.reference import truth

pytestmark = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="this system has no owners of files")


def _doubled(x):
    return x + x


def _planted(x):
    return x * x * x


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """A cache that holds a kernel whose bitcode is another's."""
    root, before = tmp_path_factory.mktemp("made") / "new" / "cache", os.umask(0o002)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SYMTOP_CACHE", str(root))
        assert compile_kernel(_doubled)(2.0) == 4.0
        os.umask(before)
        (file,), (code,) = root.rglob("*.bitcode"), root.rglob("*.code")
        kernel = compile_kernel(_planted)
        patch.setattr(kernel, "_cache", jit._Cache(root / "kernels" / "aside"))
        assert kernel(2.0) == 8.0
    (source,) = (root / "kernels" / "aside").glob("*.bitcode")
    jit._write(file, jit._read(source, jit._name(source)), jit._name(file))
    code.unlink()
    shutil.rmtree(source.parent)
    return root.parent


@pytest.fixture
def planted(cache, tmp_path, monkeypatch):
    """A copy of it, and the file of that kernel."""
    root = shutil.copytree(cache, tmp_path / "new") / "cache"
    monkeypatch.setenv("SYMTOP_CACHE", str(root))
    return root, next(root.rglob("*.bitcode"))


def test_what_is_made_is_the_users_alone_no_pickle_and_ours_to_run(planted):
    root, _ = planted
    modes = {path.is_dir(): stat.S_IMODE(path.stat().st_mode) for path in (root.parent, root, *root.rglob("*"))}
    assert modes == {True: 0o700, False: 0o600}
    assert not [finding for finding in doctor._caches(root) if not finding.healthy]
    # Reading it runs nothing: a line of JSON, and bitcode or machine code.
    head, _, bitcode = planted[1].read_bytes()[jit.HASH_BYTES :].partition(b"\n")
    assert json.loads(head)["returned"] == "float64"
    assert zlib.decompress(bitcode).startswith(b"BC\xc0\xde")
    assert compile_kernel(_doubled)(2.0) == 8.0  # the control: this is what is refused below
    (code,) = planted[0].rglob("*.code")
    before = code.stat().st_mtime_ns
    assert (compile_kernel(_doubled)(2.0), code.stat().st_mtime_ns) == (8.0, before)


@pytest.mark.parametrize("level", ["root", "kernels", "kernel", "file"])
@pytest.mark.parametrize("fault", ["group", "anybody", "owner"])
def test_what_others_may_write_is_not_read(planted, monkeypatch, level, fault):
    root, file = planted
    path = {"root": root, "kernels": root / "kernels", "kernel": file.parent, "file": file}[level]
    if fault == "owner":
        if os.geteuid() != 0:
            pytest.skip("only the administrator gives files away")
        os.chown(path, 12345, -1)
    else:
        path.chmod(path.stat().st_mode | {"group": 0o020, "anybody": 0o002}[fault])
    words = "belongs to user 12345; set SYMTOP_CACHE" if fault == "owner" else "chmod -R go-w"
    (finding,) = [finding for finding in doctor._caches(root) if not finding.healthy]
    assert finding.topic == "compiled code"
    assert str(path) in finding.result
    with pytest.warns(symtop.SymtopWarning, match=words) as record:
        assert [compile_kernel(_doubled)(2.0) for _ in range(2)] == [4.0, 4.0]
    assert len(record) == 1


def test_a_cache_that_cannot_be_looked_into_costs_time_and_no_run(monkeypatch):
    monkeypatch.setenv("SYMTOP_CACHE", "x" * 300)  # too long a name: refused as what lies in another user's folder is
    with pytest.raises(OSError, match="too long"):
        (files.cache_root() / "kernels").is_file()
    assert compile_kernel(_doubled)(2.0) == 4.0
    assert truth.cached(truth.place(_doubled), xr.Dataset, None).sizes == {}
    assert truth.certificate(symtop.scene("loop")) is None
