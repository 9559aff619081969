"""The first five minutes of somebody new: install, run, add a scene and a method, and find both in a report."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MINE = """
import symtop

symtop.register(symtop.runge_kutta("my-heun", ((), (1.0,)), (0.5, 0.5), order=2))
top, start = symtop.SymmetricTop(1.5, 1.0, 3.0), symtop.Angles(theta=1.0, psi_dot=4.0)
symtop.register_scene(symtop.Scene("my-top", top, start, horizon=6.0))
"""


@pytest.mark.slow
def test_five_minutes(tmp_path):
    began = time.monotonic()
    home = tmp_path / "symtop"
    kept = shutil.ignore_patterns(".*", "results", "__pycache__", "build")
    shutil.copytree(ROOT, home, ignore=kept)
    environment = {**os.environ, "SYMTOP_CACHE": str(tmp_path / "cache")}
    environment.pop("PYTHONPATH", None)

    def run(*command):
        done = subprocess.run(
            command, cwd=home, env=environment, capture_output=True, text=True, timeout=300, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    run(sys.executable, "-m", "venv", ".venv")
    python, symtop = (str(home / ".venv" / "bin" / name) for name in ("python", "symtop"))
    run(python, "-m", "pip", "install", "--quiet", "--constraint", "constraints.txt", "--editable", ".")
    assert "reached t = 8" in run(symtop, "run", "spheroid", "midpoint", "--step-size", "0.01")
    (home / "mine.py").write_text(MINE, encoding="utf-8")
    assert "reached t = 6" in run(symtop, "run", "my-top", "my-heun", "--step-size", "0.01", "--plugin", "mine.py")
    run(symtop, "study", "convergence", "--quick", "--only", "my-heun,midpoint", "--plugin", "mine.py")
    run(symtop, "report", "--results", "results/quick/only", "--plugin", "mine.py")
    page = (home / "results" / "quick" / "only" / "report.html").read_text(encoding="utf-8")
    assert "my-heun" in page
    assert "my-top" in page
    assert time.monotonic() - began < 300.0
