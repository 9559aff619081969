"""The rooms of the package: which may import which, read from every import statement.

`ORDER` is the rule. A module imports modules of its own row's room and of the rows below; two rooms in one row do not
import each other. Statements inside functions count as well as those at the top, and so do those under TYPE_CHECKING,
except in circles: what only a type checker reads cannot go round in one.
"""

import ast
import functools
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import resolve_name
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

ROOT = Path(__file__).resolve().parents[1]
ORDER = (  # from the ground up
    ("core",), ("model",), ("methods",), ("run",), ("measure",), ("judging", "runner"), ("report",),
    ("advise",), ("engine_settings",),  # modules in the root, as they are part of the public face
    ("explore",),
    ("cli",),
    ("__main__",),  # python -m symtop
    ("face",),  # symtop/__init__.py: imports every public name, and no other file imports it
    ("studies",),
)  # fmt: skip
FLOOR = {room: floor for floor, row in enumerate(ORDER) for room in row}
STATEMENTS = (ast.stmt, ast.excepthandler, ast.match_case)  # which hold others: an expression imports nothing
STRANGERS = {"methods": {"xarray", "matplotlib"}}  # packages that a room does not import


class Arrow(NamedTuple):
    """One imported module."""

    target: str
    line: int
    typing: bool  # under TYPE_CHECKING


@dataclass(frozen=True)
class Module:
    """One file: its dotted name, its room and what it imports."""

    name: str
    arrows: tuple[Arrow, ...]

    @property
    def room(self) -> str:
        package, *parts = self.name.split(".")
        return "studies" if package == "symtop_studies" else parts[0] if parts else "face"


def read(root: Path) -> dict[str, Module]:
    """Every module below `root`/symtop and `root`/studies, by its dotted name."""
    files: dict[str, Path] = {}
    for folder, package in (("symtop", "symtop"), ("studies", "symtop_studies")):
        for path in sorted((root / folder).rglob("*.py")):
            parts = path.relative_to(root / folder).with_suffix("").parts
            files[".".join([package, *(parts[:-1] if parts[-1] == "__init__" else parts)])] = path
    modules = {}
    for name, path in files.items():
        package = name if path.name == "__init__.py" else name.rpartition(".")[0]
        modules[name] = Module(name, tuple(_arrows(ast.parse(path.read_bytes()), package, known=set(files))))
    return modules


def _arrows(node: ast.AST, package: str, known: set[str], *, typing: bool = False) -> Iterator[Arrow]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import):
            yield from (Arrow(alias.name, child.lineno, typing) for alias in child.names)
        elif isinstance(child, ast.ImportFrom):
            source = resolve_name("." * child.level + (child.module or ""), package)
            for alias in child.names:
                inner = f"{source}.{alias.name}"
                yield Arrow(inner if inner in known else source, child.lineno, typing)
        elif isinstance(child, STATEMENTS):
            typing_only = isinstance(child, ast.If) and ast.unparse(child.test).rpartition(".")[2] == "TYPE_CHECKING"
            yield from _arrows(child, package, known, typing=typing or typing_only)


def upward_imports(modules: dict[str, Module]) -> list[str]:
    """Imports of a room that is not the importer's own and not below it."""
    complaints = []
    for module in modules.values():
        if module.room not in FLOOR:
            complaints.append(f"{module.name} lies in no room of ORDER")
            continue
        for arrow in module.arrows:
            target = modules.get(arrow.target)
            if target is None or target.room == module.room:
                continue
            if FLOOR.get(target.room, len(ORDER)) >= FLOOR[module.room]:
                complaints.append(f"{module.name}:{arrow.line} imports {target.name}")
    return sorted(set(complaints))


def import_cycles(modules: dict[str, Module]) -> list[str]:
    """Sets of files that import each other, directly or through others; TYPE_CHECKING imports aside."""
    names = sorted(modules)
    graph = np.zeros((len(names), len(names)), dtype=bool)
    for row, name in enumerate(names):
        targets = {arrow.target for arrow in modules[name].arrows if not arrow.typing}
        graph[row] = [target in targets for target in names]
    count, group = connected_components(graph, connection="strong")
    sets = ([name for name, label in zip(names, group, strict=True) if label == k] for k in range(count))
    return sorted(" <-> ".join(members) for members in sets if len(members) > 1)


def strange_imports(modules: dict[str, Module]) -> list[str]:
    """Imports of packages that a room does without."""
    arrows = [(module, arrow) for module in modules.values() for arrow in module.arrows]
    return [f"{module.name}:{arrow.line} imports {arrow.target}" for module, arrow in arrows
            if arrow.target.split(".")[0] in STRANGERS.get(module.room, ())]  # fmt: skip


@functools.cache
def house() -> dict[str, Module]:
    """The package and the studies; parsing them takes two seconds, of the process alone that asks."""
    return read(ROOT)


@pytest.mark.parametrize("rule", [upward_imports, import_cycles, strange_imports])
def test_the_package_holds_the_rule(rule):
    assert rule(house()) == []


def test_every_file_is_read():
    assert house().keys() >= {"symtop", "symtop.advise", "symtop.model.top", "symtop_studies.convergence.study"}
    assert {module.room for module in house().values()} == set(FLOOR)
    assert "symtop.run.simulation" in {arrow.target for arrow in house()["symtop"].arrows if arrow.typing}


def test_imports_upward_circles_and_strangers_are_reported(tmp_path):
    """A made-up package with one fault against each rule, and statements that are allowed beside them."""
    files = {
        "symtop/__init__.py": '"""symtop.report.page"""\nimport typing\nif typing.TYPE_CHECKING:\n'
        "    from symtop.model.good import value\n", "symtop/extra.py": "", "symtop/core/__init__.py": "",
        "symtop/core/plain.py": "from symtop.core import __version__\n",
        "symtop/core/up.py": "from symtop.model import good\n",
        "symtop/core/progress.py": "def look():\n    import symtop.model.good\n",
        "symtop/core/typed.py": "from typing import TYPE_CHECKING\n"
        "if TYPE_CHECKING:\n    from ..model.good import value\n", "symtop/model/__init__.py": "",
        "symtop/model/good.py": "from symtop.core.plain import __version__\nvalue = 1\n",
        "symtop/model/left.py": "from symtop.model import right\n",
        "symtop/model/right.py": "def turn():\n    from . import left\n",
        "symtop/model/hint.py": "import typing\nif typing.TYPE_CHECKING:\n    from symtop.model.hinted import x\n",
        "symtop/model/hinted.py": "import symtop.model.hint\n", "symtop/judging/__init__.py": "",
        "symtop/methods/kernel.py": "def show():\n    import matplotlib.pyplot\n",
        "symtop/runner/beside.py": "import symtop.judging\n",
        "symtop/report/page.py": "from symtop_studies.drift import study\n",
        "studies/drift/study.py": "import symtop\nfrom symtop.report import page\n",
    }  # fmt: skip
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    small = read(tmp_path)
    assert upward_imports(small) == [
        *(f"symtop.core.{line} imports symtop.model.good" for line in ("progress:2", "typed:3", "up:1")),
        "symtop.extra lies in no room of ORDER", "symtop.report.page:1 imports symtop_studies.drift.study",
        "symtop.runner.beside:1 imports symtop.judging",
    ]  # fmt: skip
    neighbours, study = "symtop.model.left <-> symtop.model.right", "symtop.report.page <-> symtop_studies.drift.study"
    assert import_cycles(small) == [neighbours, study]
    assert strange_imports(small) == ["symtop.methods.kernel:2 imports matplotlib.pyplot"]
