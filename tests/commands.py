"""The command line in this process, and in processes of its own on the probe study."""

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import xarray as xr
from click.testing import CliRunner, Result

from symtop.cli.main import main
from symtop.core import netcdf
from symtop.runner import store

PROBE = Path(__file__).parent / "probe.py"
ROOT = Path(__file__).resolve().parents[1]


def call(*words: object, code: int | None = 0, **environment: str) -> Result:
    """Run a command in this process; it must end with that exit code, or with any if that is None."""
    result = CliRunner().invoke(main, [str(word) for word in words], env=environment)
    assert code is None or result.exit_code == code, result.output
    return result


def probe(results: Path, *words: object, code: int = 0) -> str:
    """What the quick probe prints in this process; it must end with that exit code, and without a traceback."""
    status, output = code_and_output("study", PROBE, "--quick", "--results", results, *words)
    assert status == code, output
    return output


def code_and_output(*words: object) -> tuple[int, str]:
    """Exit code and output of a command in this process, which raises nothing and prints no traceback."""
    result = call(*words, code=None)
    assert "Traceback" not in result.output, result.output
    assert result.exception is None or isinstance(result.exception, SystemExit), repr(result.exception)
    return result.exit_code, result.output


def printed_by(code: str, *words: object, cwd: Path | None = None, **environment: object) -> str:
    """What a new process of Python prints that runs some code, without an error."""
    settings = {**os.environ, **{name: str(value) for name, value in environment.items()}}
    command = [sys.executable, "-c", code, *map(str, words)]
    result = subprocess.run(command, cwd=cwd, env=settings, capture_output=True, text=True, timeout=600, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout


def symtop(*words: object, cwd: Path | None = None, **environment: object) -> subprocess.Popen:
    """Start a command; its output is read by `finish`."""
    return subprocess.Popen(
        [sys.executable, "-m", "symtop.cli", *map(str, words)], text=True, cwd=cwd, start_new_session=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env={**os.environ, **{name: str(value) for name, value in environment.items()}},
    )  # fmt: skip


def customized(folder: Path, text: str) -> Callable[..., subprocess.CompletedProcess]:
    """A function that runs symtop, or Python code, in a tree of processes whose `sitecustomize` is this text."""
    (folder / "custom").mkdir()
    hiding = "import sys\nsys.modules['dask'] = None\n"  # as `tests/bare`, whose place this one takes
    (folder / "custom" / "sitecustomize.py").write_text(hiding + text)
    paths = [str(folder / "custom"), str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}

    def run(*arguments: object, python: str | None = None) -> subprocess.CompletedProcess:
        command = [sys.executable, "-c", python] if python else [sys.executable, "-m", "symtop", *map(str, arguments)]
        return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)

    return run


def stop(process: subprocess.Popen) -> None:
    """Kill a command with its workers, and wait for it, so that a test that fails leaves no process behind."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.communicate()


def finish(process: subprocess.Popen, seconds: float = 240.0) -> tuple[int, str, str]:
    """Exit code, output and errors of a command; none of them may hold a traceback or a leak."""
    try:
        out, err = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        stop(process)
        raise
    assert "Traceback" not in out + err, err
    assert "leaked" not in err, err
    return process.returncode, out, err


def stdout_of(process: subprocess.Popen, seconds: float = 240.0) -> str:
    """What a command prints that must end with exit code 0."""
    code, out, err = finish(process, seconds)
    assert code == 0, err
    return out


def contents(results: Path, *, provenance: bool = False) -> dict[str, xr.Dataset]:
    """Every dataset of a results folder by its place in it, of cases as well, without attributes of provenance."""
    datasets = {}
    for path in sorted([*results.rglob("*.nc"), *results.rglob("cases/*/*.npz")]):
        data = netcdf.read(path) if path.suffix == ".nc" else store.load_case(path)
        assert data is not None, path
        attributes = {key: value for key, value in data.attrs.items() if provenance or key not in netcdf.provenance()}
        datasets[str(path.relative_to(results))] = data.drop_attrs().assign_attrs(attributes)
    return datasets


def assert_identical(results: Path, expected: Path) -> int:
    """How many datasets two results folders hold, whose datasets must be the same to the bit."""
    first, second = contents(results), contents(expected)
    assert first.keys() == second.keys()
    assert all(first[name].identical(second[name]) for name in first)
    return len(first)


def leftovers(results: Path) -> list[str]:
    """Partial files, locks and traces."""
    return [str(path.relative_to(results)) for path in results.rglob(".*") if path.is_file()]
