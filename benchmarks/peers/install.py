"""Install the peers one by one into the environment that runs this; one that does not install is named and left out."""

import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PINS = [ROOT / "constraints.txt", Path(__file__).resolve().parent / "constraints.txt"]


def requirements() -> list[str]:
    """The requirements of the extra `peers`."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return list(project["optional-dependencies"]["peers"])


def main() -> None:
    """pip, once for each."""
    pins = [word for path in PINS for word in ("--constraint", str(path))]
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *pins]
    subprocess.run([*pip, "--editable", str(ROOT)], check=True)
    for requirement in requirements():
        if subprocess.run([*pip, requirement], check=False).returncode:
            print(f"symtop: {requirement} does not install here and is left out")


if __name__ == "__main__":
    main()
