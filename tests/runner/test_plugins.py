"""Plug-ins: what one registers counts by the code that it reaches, and is in the studies beside symtop's own."""

import pytest

from symtop.core import netcdf
from symtop.core.code_hash import changes
from symtop.methods.framework.registry import split_name
from tests.commands import call, printed_by

CODE = """\
import sys
import symtop
from symtop.run import plugins
from symtop.runner import fingerprint
(name,) = plugins.load(sys.argv[1])
for label, value in fingerprint.made_of("method", symtop.integrator(name)).items():
    print(label, value, sep="\\t")
"""
PLUGIN = """\
import importlib, pathlib, sys
import symtop
sys.path.insert(0, str(pathlib.Path(__file__).parent))
coeffs = importlib.import_module("co" + "effs")
from symtop.methods.framework.plan import Run

def solve(top, start, plan):
    from lazily import late
    return late(coeffs.twice(plan))

symtop.register(symtop.Integrator(name="a-users", family="other", summary="", solvers={"angles": solve}))
"""


def made_of(plugin):
    """What a new process says that the method of a plug-in is made of."""
    return dict(line.split("\t") for line in printed_by(CODE, plugin).splitlines())


def write(folder, **files):
    for name, text in files.items():
        (folder / f"{name}.py").write_text(text)
    return folder / "plug.py"


def test_functions_count_wherever_they_stand_and_however_they_were_imported(tmp_path):
    plugin = write(
        tmp_path, plug=PLUGIN, coeffs="def twice(x):\n    return 2 * x\n\ndef unused():\n    return 1\n",
        lazily="def late(x):\n    return x\n", other="x = 1\n",
    )  # fmt: skip
    before = made_of(plugin)
    assert {"code plug.py", "code coeffs.py", "code lazily.py"} <= before.keys()
    assert "code other.py" not in before
    write(tmp_path, coeffs="# a comment\ndef twice(x):\n    return 2 * x\n", other="x = 2\n", plug=f"# moved\n{PLUGIN}")
    assert made_of(plugin) == before
    write(tmp_path, lazily="def late(x):\n    return -x\n", coeffs="def twice(x):\n    return 3 * x\n")
    assert changes(before, made_of(plugin)) == ["code coeffs.py", "code lazily.py"]


def test_a_mistake_in_a_plugin_is_told_with_its_name_and_as_no_option_of_the_command(tmp_path):
    text = "import symtop\nsymtop.Integrator(name='m', family='other', summary='', solvers={'angles': print}, {})\n"
    plugin = write(tmp_path, plug=text.replace("{})", "symplectic='yes')"))
    done = call("integrators", "--plugin", plugin, code=2)
    assert done.output == "symtop: plugin plug.py: symplectic must be True, False or None, not 'yes'\n"


FOUR_LINES = """\
import symtop

symtop.register(symtop.discrete_lagrangian("simpson-of-a-user", (0, 0.5, 1), (1 / 6, 2 / 3, 1 / 6), order=2))
top, start = symtop.SymmetricTop(1.5, 1.0, 3.0), symtop.Angles(theta=1.0, psi_dot=4.0)
symtop.register_scene(symtop.Scene("mine", top, start, horizon=6.0))
"""


@pytest.fixture(scope="module")
def plugin(tmp_path_factory):
    """Its file, which is loaded once."""
    file = tmp_path_factory.mktemp("plugin") / "plugin.py"
    file.write_text(FOUR_LINES)
    return file


@pytest.mark.parametrize("studies", [("convergence",), pytest.param(("drift", "stability"), marks=pytest.mark.slow)])
def test_a_plugins_method_and_scene_are_in_every_study(studies, plugin, tmp_path):
    words = ["--quick", "--only", "simpson-of-a-user,strang", "--results", str(tmp_path), "--plugin", str(plugin)]
    call("study", *studies, *words)
    for study in studies:
        data = netcdf.groups(netcdf.read_any(tmp_path / "quick" / "only" / f"{study}.nc")).values()
        groups = [group for group in data if group.variables]
        methods = {split_name(str(row))[0] for group in groups for row in group["variant"].values}
        assert {"simpson-of-a-user", "strang"} <= methods, study
        assert any("mine" in group["scene"].values for group in groups), study
