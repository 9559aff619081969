"""The README says what the code says."""

import importlib
import re
from pathlib import Path

from symtop.report.markdown import columns, table

registry = importlib.import_module("symtop.methods.registry")
scenes = importlib.import_module("symtop.model.scenes")

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_table_of_integrators_is_the_generated_one():
    shown = re.search(r"<!-- integrators -->\n(.*?)\n<!-- /integrators -->", README, re.DOTALL)
    assert shown is not None
    records = [method.record() for method in registry.integrators().values()]
    assert shown.group(1) == table(*columns(records)), "regenerate: symtop integrators --markdown"


def test_every_study_is_explained():
    for script in (ROOT / "studies").glob("*/study.py"):
        assert f"| `{script.parent.name}` |" in README


def test_its_python_examples_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(registry, "_registry", registry.integrators())  # what they add goes with the test
    monkeypatch.setattr(scenes, "_added", {})
    for block in re.findall(r"```python\n(.*?)```", README, re.DOTALL):
        exec(compile(block, "README.md", "exec"), {})


def test_its_figures_are_there():
    for path in re.findall(r"!\[[^]]*\]\(([^)]+)\)", README):
        assert (ROOT / path).is_file()
