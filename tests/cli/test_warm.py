"""``symtop doctor --warm``: every compiled method in each chart, and nothing left to compile the second time."""

import shutil

import pytest
from click.testing import CliRunner

import symtop
from symtop.cli import warm
from symtop.cli.main import main
from symtop.core.files import cache_root


def test_every_compiled_method_is_run_in_each_of_its_charts():
    todo = warm.tasks()
    for kind in ("alone", "together"):
        names = [name for what, name in todo if what == kind]
        assert len(names) == len(set(names))
        for method in symtop.integrators().values():
            rows = {f"{method.name}[{chart}]" for chart in method.charts()}
            assert rows <= set(names) if method.implementation != "python" else not rows & set(names)


def test_a_run_that_fails_is_named(monkeypatch):
    monkeypatch.setattr(warm, "tasks", lambda: [("alone", "strang[axis]"), ("alone", "no-such-method[axis]")])
    _, failed = warm.warm(jobs=1)
    assert [why.partition(":")[0] for why in failed] == ["no-such-method[axis]"]


@pytest.mark.slow
def test_kernels_are_on_disk_afterwards(monkeypatch, tmp_path):
    monkeypatch.setenv("SYMTOP_CACHE", str(tmp_path))
    monkeypatch.setattr(warm, "tasks", lambda: [("alone", "strang[axis]")])
    count, _ = warm.warm(jobs=1)
    assert count == warm.kernels() >= 1
    assert warm.warm(jobs=1)[0] == 0


@pytest.mark.slow
def test_all_of_them_are_compiled_once(monkeypatch, tmp_path):
    """From the kernels that other tests have left, less an eighth: all of them take six minutes."""
    (cache_root() / "kernels").mkdir(parents=True, exist_ok=True)
    shutil.copytree(cache_root() / "kernels", tmp_path / "kernels")
    for folder in sorted((tmp_path / "kernels").iterdir())[::8]:
        shutil.rmtree(folder)
    monkeypatch.setenv("SYMTOP_CACHE", str(tmp_path))
    done = CliRunner().invoke(main, ["doctor", "--warm", "--results", str(tmp_path / "r")])
    assert done.exit_code == 0, done.output
    assert warm.kernels() > 100
    assert "not run" not in done.output
    again = CliRunner().invoke(main, ["doctor", "--warm", "--results", str(tmp_path / "r")])
    assert "kernels compiled: 0;" in again.output
