"""An installed wheel, without a checkout: it carries the studies and runs nothing of the working directory."""

import functools
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
TRAP = "raise SystemExit('a study of the working directory was run')\n"


def run(*command, **settings):
    """What a command prints."""
    result = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=1200, check=False,
                            **settings)  # fmt: skip
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


@pytest.mark.slow
def test_a_wheel_in_an_empty_folder(tmp_path):
    home = tmp_path / "home"
    (home / "studies" / "reduction").mkdir(parents=True)
    for name in ("__init__.py", "reduction/__init__.py", "reduction/study.py", "reduction.py"):
        (home / "studies" / name).write_text(TRAP)
    environment = {**os.environ, "SYMTOP_CACHE": str(tmp_path / "cache"), "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    environment.pop("PYTHONPATH", None)
    run_here = functools.partial(run, cwd=home, env=environment)
    run_here(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", tmp_path, ROOT)
    (wheel,) = tmp_path.glob("symtop-*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())
    folders = {"symtop": "symtop", "studies": "symtop_studies"}.items()
    ours = {str(Path(package, path.relative_to(ROOT / folder))) for folder, package in folders
            for path in (ROOT / folder).rglob("*") if path.is_file() and path.suffix != ".pyc"}  # fmt: skip
    assert {name for name in names if ".dist-info/" not in name} == ours
    assert ours >= {"symtop/report/templates/report.html", "symtop/explore/static/page.html", "symtop/py.typed"}
    assert "symtop_studies/convergence/study.py" in ours
    run_here(sys.executable, "-m", "venv", tmp_path / "venv")
    python, symtop = (tmp_path / "venv" / "bin" / name for name in ("python", "symtop"))
    run_here(python, "-m", "pip", "install", "--quiet", "--constraint", ROOT / "constraints.txt", wheel)
    assert str(tmp_path / "venv") in run_here(python, "-c", "import symtop; print(symtop.__file__)")
    assert "cases computed" in run_here(symtop, "study", "reduction", "--quick")
    assert "report.html" in run_here(symtop, "report")
    assert "Reduction" in (home / "results" / "quick" / "report.html").read_text(encoding="utf-8")
    assert "midpoint" in run_here(symtop, "claims", "midpoint")
    assert "@article" in run_here(symtop, "integrators", "midpoint")
    assert "BAD" not in run_here(symtop, "doctor")
    assert {path.name for path in home.iterdir()} == {"studies", "results"}


RUN = """
import hashlib, sys, symtop
name, setting = sys.argv[1:]
data = symtop.simulate("spheroid", name, step_size=float(setting), samples=20, guard=False)
print(hashlib.sha256(data["theta"].values.tobytes() + data["energy"].values.tobytes()).hexdigest())
"""


@pytest.mark.slow
def test_a_wheel_brings_the_kernels_of_first_runs(tmp_path):
    """The commands of the README compile nothing with an empty cache; bits are those of kernels compiled here."""
    wheels, site = tmp_path / "made", tmp_path / "site"
    environment = {**os.environ, "SYMTOP_COMPILE_WITH": sys.executable, "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    run_here = lambda *command, **variables: run(*command, cwd=tmp_path, env={**environment, **variables})
    run_here(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", wheels, ROOT)
    (wheel,) = wheels.glob("symtop-*.whl")
    zipfile.ZipFile(wheel).extractall(site)
    kernels = list((site / "symtop" / "kernels").rglob("*.bitcode"))
    assert len(kernels) >= 25
    assert sum(path.stat().st_size for path in kernels) < 2e6
    environment["PYTHONPATH"] = str(site)
    assert str(site) in run_here(sys.executable, "-c", "import symtop; print(symtop.__file__)")
    lines = re.findall(r"(?m)^(?:\$ )?symtop ((?:run|compare|recommend|ensemble|long) .*?)(?: +#.*)?$", README)
    assert len(lines) == 5
    cache = tmp_path / "cache"
    for line in lines:
        words = line.replace("--steps 1e9", "--steps 1e6").replace('"', "").split()
        run_here(sys.executable, "-m", "symtop", *words, SYMTOP_CACHE=str(cache))
    assert list(cache.rglob("*.code"))
    assert not list(cache.rglob("*.bitcode"))  # nothing was compiled
    baseline = {"SYMTOP_CACHE": str(tmp_path / "x86-64"), "NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": ""}
    for name in ("strang[axis]", "series[axis]", "rk4[angles]", "vern9-fixed[axis]"):  # fused products, and vectors
        words = (sys.executable, "-c", RUN, name, "0.01")
        compiled = run_here(*words, PYTHONPATH=str(ROOT), SYMTOP_CACHE=str(tmp_path / "own"))
        assert run_here(*words, SYMTOP_CACHE=str(cache)) == compiled
        assert run_here(*words, **baseline) == compiled  # for a processor without the instructions of this one
    assert not list((tmp_path / "x86-64").rglob("*.bitcode"))
    run_here(sys.executable, "-c", RUN, "yoshida-4[attitude]", "0.01", SYMTOP_CACHE=str(cache))
    assert list(cache.rglob("*.bitcode"))  # the control: a kernel that the wheel has not
