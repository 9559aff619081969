"""Modules under the paths of the last version are found, and told of."""

import importlib
import subprocess
import sys
from pathlib import Path

import symtop
from symtop.core.old_paths import table

PLUGIN = """
import symtop.base.validate
from symtop.methods import gauss
from symtop.methods.registry import Integrator
from symtop.methods.runge_kutta import gauss as new
import symtop
assert Integrator is symtop.Integrator and gauss is new and gauss.__spec__.name == "symtop.methods.runge_kutta.gauss"
assert symtop.base.validate.finite("x", 1) == 1.0
"""


def test_a_plug_in_of_the_last_version_runs_and_every_new_path_exists():
    result = subprocess.run([sys.executable, "-W", "always", "-c", PLUGIN], capture_output=True, text=True, check=True)
    for old in ("base.validate", "methods.gauss", "methods.registry"):
        assert f"DeprecationWarning: symtop.{old} is now symtop.{table()[old]}" in result.stderr
    assert result.stderr.count("DeprecationWarning") == 3
    quiet = "import symtop.core.errors; from symtop.core.old_paths import table; assert not table.cache_info().misses"
    subprocess.run([sys.executable, "-W", "error", "-c", quiet], check=True)  # the table is not read for other names
    for old, new in table().items():
        assert new == "" or importlib.util.find_spec(f"symtop.{new}").origin is not None, old
        assert not Path(symtop.__file__).parent.joinpath(*old.split(".")).with_suffix(".py").exists(), old
