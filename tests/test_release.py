"""What a release ships agrees with pyproject.toml: pins, requirements of the conda recipe, and versions."""

import re
import tomllib

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import symtop
from tests.commands import ROOT

CONDA = {"matplotlib": "matplotlib-base", "heyoka": "heyoka.py", "netcdf4": "netcdf4"}  # where names differ


def _needs(lines: list[str]) -> dict[str, str]:
    """Least versions by name."""
    matches = (re.match(r"([A-Za-z0-9._-]+?)\s*>=\s*([0-9.]+|\$\{\{ \w+ \}\})", line) for line in lines)
    return {match[1].lower(): match[2] for match in matches if match}


@pytest.fixture(scope="module")
def project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_recipe_versions_and_commands_agree_with_the_project(project):
    recipe = yaml.safe_load((ROOT / "docs" / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
    ours = {CONDA.get(name, name): version for name, version in _needs(project["project"]["dependencies"]).items()}
    theirs = _needs(recipe["requirements"]["run"])
    assert (theirs.pop("python"), theirs) == ("${{ python_min }}", ours)
    assert project["build-system"]["requires"][0].partition(">")[0] in recipe["requirements"]["host"]
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert recipe["context"]["version"] == cited["version"] == symtop.__version__
    commands = [f"{name} = {target}" for name, target in project["project"]["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == commands
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(r"^## (?!Unreleased$)(\S+)", changes, re.MULTILINE)[1] == symtop.__version__


def _unfulfilled(lines: list[str], *files: str) -> list[str]:
    """Requirements that are not pinned in files of constraints, or pinned to a version that they exclude."""
    rows = [row for file in files for row in (ROOT / file).read_text(encoding="utf-8").splitlines() if "==" in row]
    pins = {canonicalize_name(name): version for name, _, version in (row.partition("==") for row in rows)}
    needs = [Requirement(line) for line in lines]
    return [str(need) for need in needs if not need.specifier.contains(pins.get(canonicalize_name(need.name), "0"))]


def test_pins_fulfil_every_requirement(project):
    """Negative controls: a bound above its pin, and a package that is not pinned."""
    extras, groups = project["project"]["optional-dependencies"], project["dependency-groups"]
    required = [*project["build-system"]["requires"], *project["project"]["dependencies"], *extras["distributed"]]
    assert _unfulfilled([*required, *groups["test"], *groups["lint"]], "constraints.txt") == []
    assert _unfulfilled(groups["docs"], "constraints.txt", "docs/constraints.txt") == []
    assert _unfulfilled(extras["peers"], "constraints.txt", "benchmarks/peers/constraints.txt") == []
    assert _unfulfilled(["numpy>=2.0", "numpy>=90", "no-such>=1"], "constraints.txt") == ["numpy>=90", "no-such>=1"]
