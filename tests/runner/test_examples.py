"""A user's file: its methods do what they claim, count by the code that they reach, and its mistakes have its name."""

import importlib.metadata
import json
import math
import shutil
from types import SimpleNamespace

import pytest

import symtop
from symtop.core.code_hash import changes
from symtop.measure.accuracy import error_table
from symtop.measure.order import order
from symtop.methods.framework import registry
from symtop.run import plugins
from tests.commands import ROOT, call, printed_by

CLAIMS = {"two-point": 2, "mclachlan-2": 2, "ralston-3": 3, "kick-then-drift": 1}


def test_its_methods_have_the_orders_they_claim_and_its_kernel_keeps_the_momenta(tmp_path, clean_registry):
    shutil.copy(ROOT / "studies" / "examples" / "my_methods.py", tmp_path / "my_own_methods.py")
    plugins.load(tmp_path / "my_own_methods.py")
    scene = symtop.scene("goldstein")
    for name, claim in CLAIMS.items():
        method = symtop.integrator(name)
        assert method.order == claim
        steps = [scene.nutation_period / (80.37 * 1.7**k) * (0.05 if claim == 1 else 1.0) for k in range(9)]
        table = error_table(scene, method, steps, 8.0, observe="axis")
        fit = order(table["step_size"], table["axis"], table["axis_bound"], 2 * math.pi / scene.nutation_period)
        assert fit.slope == pytest.approx(claim, abs=0.05), name
    run = symtop.simulate("spheroid", "kick-then-drift", step_size=1e-3)
    for name in ("p_phi", "p_psi"):
        assert float(abs(run[name] / run[name][0] - 1.0).max()) < 1e-13


def test_an_installed_package_announces_its_methods_and_one_that_fails_is_named(clean_registry, monkeypatch):
    def announce(methods):
        """An entry point of an installed package."""
        point = SimpleNamespace(value="stranger:methods", load=lambda: methods)
        monkeypatch.setattr(registry, "_announced", [])
        monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [point])

    method = symtop.discrete_lagrangian("announced", (0.5,), (1.0,))
    announce(lambda: [method])
    assert symtop.integrator("announced") is method
    announce(lambda: 1 / 0)
    with pytest.warns(symtop.SymtopWarning, match="integrators of stranger:methods are left out: ZeroDivisionError"):
        assert "midpoint" in symtop.integrators()


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
    folders = [write(tmp_path / name, **files | change).parent
               for name, change in (("first", {}), ("moved", same_code), ("edited", edits))]  # fmt: skip
    before, moved, edited = map(json.loads, printed_by(CODE, *folders).splitlines())
    assert {"code plug.py", "code coeffs.py", "code lazily.py"} <= before.keys()
    assert "code other.py" not in before
    assert moved == before
    assert changes(before, edited) == ["code coeffs.py", "code lazily.py"]


@pytest.mark.parametrize(("mistake", "message"), [
    ("symtop.Integrator(name='m', family='other', summary='', solvers={'angles': print}, symplectic='yes')",
     "plugin plug.py, line 2: symplectic must be True, False or None, not 'yes'"),
    ("1 / 0", "plugin plug.py, line 2 failed: ZeroDivisionError"),
])  # fmt: skip
def test_a_mistake_in_a_plugin_is_told_with_its_name_and_as_no_option_of_the_command(mistake, message, tmp_path):
    result = call("integrators", "--plugin", write(tmp_path, plug=f"import symtop\n{mistake}\n"), code=2)
    assert result.output.startswith(f"symtop: {message}")
    assert result.output.count("\n") == 1
