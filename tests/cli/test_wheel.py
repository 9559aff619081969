"""An installed wheel, without a checkout: it carries the studies and runs nothing of the working directory."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TRAP = "raise SystemExit('a study of the working directory was run')\n"


@pytest.mark.slow
def test_a_wheel_in_an_empty_folder(tmp_path):
    home = tmp_path / "home"
    (home / "studies" / "reduction").mkdir(parents=True)
    for name in ("__init__.py", "reduction/__init__.py", "reduction/study.py", "reduction.py"):
        (home / "studies" / name).write_text(TRAP)
    environment = {**os.environ, "SYMTOP_CACHE": str(tmp_path / "cache"), "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    environment.pop("PYTHONPATH", None)

    def run(*command):
        done = subprocess.run(
            list(map(str, command)), cwd=home, env=environment, capture_output=True, text=True, timeout=600, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    run(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", tmp_path, ROOT)
    (wheel,) = tmp_path.glob("symtop-*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())
    ours = {
        str(Path(package, path.relative_to(ROOT / folder)))
        for folder, package in (("symtop", "symtop"), ("studies", "symtop_studies"))
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }
    assert {name for name in names if ".dist-info/" not in name} == ours
    assert ours >= {"symtop/report/templates/report.html", "symtop/explore/static/page.html", "symtop/py.typed"}
    assert "symtop_studies/convergence/study.py" in ours

    run(sys.executable, "-m", "venv", tmp_path / "venv")
    python, symtop = (tmp_path / "venv" / "bin" / name for name in ("python", "symtop"))
    run(python, "-m", "pip", "install", "--quiet", "--constraint", ROOT / "constraints.txt", wheel)
    assert str(tmp_path / "venv") in run(python, "-c", "import symtop; print(symtop.__file__)")
    assert "cases computed" in run(symtop, "study", "reduction", "--quick")
    assert "report.html" in run(symtop, "report")
    assert "Reduction" in (home / "results" / "quick" / "report.html").read_text(encoding="utf-8")
    assert "midpoint" in run(symtop, "claims", "midpoint")
    assert "@article" in run(symtop, "integrators", "midpoint")
    assert "BAD" not in run(symtop, "doctor")
    assert {path.name for path in home.iterdir()} == {"studies", "results"}
