"""What a type checker sees of the public names: a user's script is typed throughout, and its mistakes are reported."""

import importlib
import inspect
import pkgutil
import subprocess
import sys
import types

import pytest

import symtop
from tests.commands import ROOT

GOOD = """
import symtop

top = symtop.SymmetricTop(I1=2.0, I3=1.0, mgl=26.8658)
start = symtop.Angles(theta=0.4, phi_dot=10.0)
scene = symtop.Scene("mine", top, start, horizon=8.0)
run = symtop.simulate(scene, "midpoint", step_size=0.01)
truth = symtop.reference(scene, run["time"].values)
wrong = symtop.errors(run)
foreign = symtop.errors({"time": run["time"].values, "axis": run["axis"].values}, scene)
long = symtop.long_run("spheroid", symtop.integrator("strang"), steps=1000, step_size=0.01)
advice = symtop.recommend("spheroid", accuracy=1e-6)
mine = symtop.composition("mine", (1.0,), (0.5, 0.5), order=2)
"""
ASKED = "run", "truth", "wrong", "foreign", "long", "advice.expected_error", "mine.order", "scene.horizon"
SEEN = [*["xarray.core.dataset.Dataset"] * 5, "float", "int | None", "float"]

BAD = """
import symtop

symtop.simulate("spheroid", "midpoint", stepsize=0.01)
symtop.composition("mine", (1.0,), (0.5, 0.5), order="2")
symtop.simluate("spheroid", "midpoint", step_size=0.01)
symtop.errors(symtop.scene("spheroid"))
text: str = symtop.simulate("spheroid", "midpoint", step_size=0.01)
"""
REPORTED = {4: "stepsize", 5: '"str"', 6: "simluate", 7: "Scene", 8: "Dataset"}


@pytest.mark.quick
def test_a_script_is_typed_throughout_and_mistakes_are_reported_where_they_are(tmp_path):
    for name, text in (("good", GOOD + "".join(map("reveal_type({})\n".format, ASKED))), ("bad", BAD)):
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    # with the settings of `make lint`, whose cache serves here, too
    words = [sys.executable, "-m", "mypy", "--no-error-summary", str(tmp_path / "good.py"), str(tmp_path / "bad.py")]
    result = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert result.stdout, result.stderr
    good, bad = ([line for line in result.stdout.splitlines() if f"{name}.py:" in line] for name in ("good", "bad"))
    revealed = [line.split('"')[1] for line in good if "Revealed type" in line]
    assert not [line for line in good if ": error:" in line]
    assert [kind.replace("builtins.", "").replace("Union[int, None]", "int | None") for kind in revealed] == SEEN
    errors = {int(line.split(":")[1]): line for line in bad if ": error:" in line}
    assert sorted(errors) == sorted(REPORTED)
    for number, word in REPORTED.items():
        assert word in errors[number]


def test_every_public_name_is_there_and_none_is_that_of_a_package_beside_it():
    text = inspect.getsource(symtop)
    for name in symtop.__all__:
        assert getattr(symtop, name) is not None
        assert name == "__version__" or f"{name} as {name}" in text
    assert not {entry.name for entry in pkgutil.iter_modules(symtop.__path__)} & set(symtop.__all__)
    for package in ("core", "model", "methods", "run", "measure", "judging"):
        module = importlib.import_module(f"symtop.{package}")
        for entry in pkgutil.iter_modules(module.__path__):
            assert isinstance(importlib.import_module(f"symtop.{package}.{entry.name}"), types.ModuleType)
