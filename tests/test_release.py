"""What a release ships agrees with pyproject.toml: the conda recipe's requirements and version, and the citation's."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

import symtop

ROOT = Path(__file__).resolve().parents[1]
CONDA = {"matplotlib": "matplotlib-base", "heyoka": "heyoka.py", "netcdf4": "netcdf4"}  # where names differ


def _needs(lines: list[str]) -> dict[str, str]:
    """Least versions by name."""
    matches = (re.match(r"([A-Za-z0-9._-]+?)\s*>=\s*([0-9.]+|\$\{\{ \w+ \}\})", line) for line in lines)
    return {one[1].lower(): one[2] for one in matches if one}


@pytest.fixture(scope="module")
def project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def recipe():
    return yaml.safe_load((ROOT / "docs" / "conda" / "recipe.yaml").read_text(encoding="utf-8"))


def test_recipe_versions_and_commands_agree_with_the_project(project, recipe):
    ours = {CONDA.get(name, name): least for name, least in _needs(project["project"]["dependencies"]).items()}
    theirs = _needs(recipe["requirements"]["run"])
    assert theirs.pop("python") == "${{ python_min }}"
    assert theirs == ours
    assert project["build-system"]["requires"][0].partition(">")[0] in recipe["requirements"]["host"]
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert recipe["context"]["version"] == cited["version"] == symtop.__version__
    commands = [f"{name} = {target}" for name, target in project["project"]["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == commands
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(r"^## (?!Unreleased$)(\S+)", changes, re.MULTILINE)[1] == symtop.__version__
