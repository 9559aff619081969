"""Plug-ins: what one registers counts by the code that it reaches, and its mistakes are told with its name."""

import json

import pytest

from symtop.core.code_hash import changes
from tests.commands import call, printed_by

CODE = """\
import json, sys
import symtop
from symtop.methods.framework import registry
from symtop.run import plugins
from symtop.runner import fingerprint
for folder in sys.argv[1:]:
    (name,) = plugins.load(f"{folder}/plug.py")
    print(json.dumps(fingerprint.made_of("method", symtop.integrator(name))))
    del registry._registry[name], sys.path[0], sys.modules["coeffs"], sys.modules["lazily"]
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


def write(folder, **files):
    folder.mkdir(exist_ok=True)
    for name, content in files.items():
        (folder / f"{name}.py").write_text(content)
    return folder / "plug.py"


def test_functions_count_wherever_they_stand_and_however_they_were_imported(tmp_path):
    """What a new process says that the method of a plug-in is made of: as it was, moved, and edited."""
    files = {"plug": PLUGIN, "coeffs": "def twice(x):\n    return 2 * x\n\ndef unused():\n    return 1\n",
             "lazily": "def late(x):\n    return x\n", "other": "x = 1\n"}  # fmt: skip
    commented = "# a comment\ndef twice(x):\n    return 2 * x\n"
    same_code = {"plug": f"# moved\n{PLUGIN}", "coeffs": commented, "other": "x = 2\n"}
    edits = {"lazily": "def late(x):\n    return -x\n", "coeffs": "def twice(x):\n    return 3 * x\n"}
    folders = [write(tmp_path / name, **files | changed).parent
               for name, changed in (("first", {}), ("moved", same_code), ("edited", edits))]  # fmt: skip
    before, same, other = map(json.loads, printed_by(CODE, *folders).splitlines())
    assert {"code plug.py", "code coeffs.py", "code lazily.py"} <= before.keys()
    assert "code other.py" not in before
    assert same == before
    assert changes(before, other) == ["code coeffs.py", "code lazily.py"]


@pytest.mark.parametrize(("mistake", "message"), [
    ("symtop.Integrator(name='m', family='other', summary='', solvers={'angles': print}, symplectic='yes')",
     "plugin plug.py: symplectic must be True, False or None, not 'yes'"),
    ("1 / 0", "plugin plug.py failed: ZeroDivisionError"),
])  # fmt: skip
def test_a_mistake_in_a_plugin_is_told_with_its_name_and_as_no_option_of_the_command(mistake, message, tmp_path):
    result = call("integrators", "--plugin", write(tmp_path, plug=f"import symtop\n{mistake}\n"), code=2)
    assert result.output.startswith(f"symtop: {message}")
    assert result.output.count("\n") == 1
