"""A plug-in of four lines, which adds a method and a scene, takes part in the studies beside a method of symtop's."""

import pytest
from click.testing import CliRunner

from symtop.cli.main import main
from symtop.core import netcdf
from symtop.methods.framework.registry import split_name

PLUGIN = """\
import symtop

symtop.register(symtop.discrete_lagrangian("simpson-of-a-user", (0, 0.5, 1), (1 / 6, 2 / 3, 1 / 6), order=2))
top, start = symtop.SymmetricTop(1.5, 1.0, 3.0), symtop.Angles(theta=1.0, psi_dot=4.0)
symtop.register_scene(symtop.Scene("mine", top, start, horizon=6.0))
"""


@pytest.fixture(scope="module")
def plugin(tmp_path_factory):
    """Its file, which is loaded once."""
    file = tmp_path_factory.mktemp("plugin") / "plugin.py"
    file.write_text(PLUGIN)
    return file


@pytest.mark.parametrize("studies", [("convergence",), pytest.param(("drift", "stability"), marks=pytest.mark.slow)])
def test_a_plugins_method_and_scene_are_in_every_study(studies, plugin, tmp_path):
    words = ["--quick", "--only", "simpson-of-a-user,strang", "--results", str(tmp_path), "--plugin", str(plugin)]
    done = CliRunner().invoke(main, ["study", *studies, *words])
    assert done.exit_code == 0, done.output
    for study in studies:
        data = netcdf.groups(netcdf.read_any(tmp_path / "quick" / "only" / f"{study}.nc")).values()
        groups = [group for group in data if group.variables]
        methods = {split_name(str(row))[0] for group in groups for row in group["variant"].values}
        assert {"simpson-of-a-user", "strang"} <= methods, study
        assert any("mine" in group["scene"].values for group in groups), study
