"""Plug-ins: what one registers counts by the code that it reaches; mistakes in one are told with its name."""

import subprocess
import sys

from click.testing import CliRunner

from symtop.cli.main import main
from symtop.core.code_hash import changes

CODE = """\
import sys
import symtop
from symtop.runner import fingerprint, plugins
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
    done = subprocess.run([sys.executable, "-c", CODE, plugin], capture_output=True, text=True, timeout=100, check=True)
    return dict(line.split("\t") for line in done.stdout.splitlines())


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
    write(tmp_path, lazily="def late(x):\n    return -x\n")
    assert changes(before, made_of(plugin)) == ["code lazily.py"]
    write(tmp_path, coeffs="def twice(x):\n    return 3 * x\n")
    assert changes(before, made_of(plugin)) == ["code coeffs.py", "code lazily.py"]


def test_a_mistake_in_a_plugin_is_told_with_its_name_and_as_no_option_of_the_command(tmp_path):
    text = "import symtop\nsymtop.Integrator(name='m', family='other', summary='', solvers={'angles': print}, {})\n"
    plugin = write(tmp_path, plug=text.replace("{})", "symplectic='yes')"))
    done = CliRunner().invoke(main, ["integrators", "--plugin", str(plugin)])
    assert (done.exit_code, done.output) == (
        2, "symtop: plugin plug.py: symplectic must be True, False or None, not 'yes'\n"
    )  # fmt: skip
