"""A compiled cache that somebody else may write is never read: its index is a pickle, and a pickle is a program."""

import os
import pickle
import stat

import pytest

from symtop.cli import doctor
from symtop.core.errors import SymtopWarning
from symtop.core.jit import compile_kernel

pytestmark = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="this system has no owners of files")


def _doubled(x):
    return x + x


class Planted:
    """Writes a file when it is unpickled."""

    def __init__(self, mark):
        self.mark = mark

    def __reduce__(self):
        return os.mkdir, (str(self.mark),)


@pytest.fixture
def planted(tmp_path, monkeypatch):
    """A cache that holds a kernel and a program in its index, and the folder that the program makes."""
    root, mark = tmp_path / "new" / "cache", tmp_path / "ran"
    monkeypatch.setenv("SYMTOP_CACHE", str(root))
    before = os.umask(0o002)
    try:
        assert compile_kernel(_doubled)(2.0) == 4.0
    finally:
        os.umask(before)
    (index,) = root.rglob("*.nbi")
    index.write_bytes(pickle.dumps(Planted(mark)))
    return root, index, mark


def test_what_is_made_is_the_users_alone(planted):
    root, *_ = planted
    modes = {path.is_dir(): stat.S_IMODE(path.stat().st_mode) for path in (root.parent, root, *root.rglob("*"))}
    assert modes == {True: 0o700, False: 0o600}
    assert not [finding for finding in doctor._caches(root) if not finding.healthy]


def test_a_program_in_a_cache_of_our_own_is_ours_to_run(planted):
    """The control: this is what is refused below."""
    assert compile_kernel(_doubled)(2.0) == 4.0
    assert planted[2].exists()


@pytest.mark.parametrize("at", ["root", "kernels", "kernel", "index"])
@pytest.mark.parametrize("fault", ["group", "anybody", "owner"])
def test_what_others_may_write_is_not_read(planted, monkeypatch, at, fault):
    root, index, mark = planted
    path = {"root": root, "kernels": root / "kernels", "kernel": index.parent, "index": index}[at]
    if fault == "owner":
        if os.geteuid() != 0:
            pytest.skip("only the administrator gives files away")
        os.chown(path, 12345, -1)
    else:
        path.chmod(path.stat().st_mode | {"group": 0o020, "anybody": 0o002}[fault])
    words = "belongs to user 12345; set SYMTOP_CACHE" if fault == "owner" else "chmod -R go-w"
    (found,) = [finding for finding in doctor._caches(root) if not finding.healthy]
    assert found.topic == "compiled code"
    assert str(path) in found.result
    with pytest.warns(SymtopWarning, match=words) as told:
        assert [compile_kernel(_doubled)(2.0) for _ in range(2)] == [4.0, 4.0]
    assert len(told) == 1
    assert not mark.exists()
