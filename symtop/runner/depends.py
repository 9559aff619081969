"""What a case's numbers depend on, found without running it: source files and values.

A case is measured by a function of its study, on a scene, with one integrator or several. Each of them is walked:

    a function      its file; what it closes over; its defaults (a compiled one: the function that was compiled)
    a table         a tuple of coefficients, a dataclass, an array: its values
    a file          the files of this package that it imports, and theirs

A function of a study's script counts by its own text and by the globals it names, so that a new caption measures
nothing again. The registry finds the families of integrators by name and not by an import statement: it leads to none
of them, and a case depends on the files of the integrators it runs and on no others. Editing `integrators/gauss.py`
makes the cases of the Gauss methods stale and no other.

A file counts as a whole: two kernels in one file go stale together. `PLUMBING` moves numbers and makes none.
"""

import ast
import functools
import hashlib
import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from symtop.base import datasets
from symtop.base.ingredients import PACKAGE, Ingredients
from symtop.methods.registry import integrators
from symtop.model.scenes import scenes
from symtop.runner import plugins

if TYPE_CHECKING:
    from symtop.runner.study import Case, Study

PLUMBING = {PACKAGE / name for name in ("base/validate.py", "base/datasets.py")} | set(PACKAGE.rglob("__init__.py"))
RESOLVERS = {
    PACKAGE / name for name in ("run/simulation.py", "methods/registry.py")
}  # they look up what they are given
EVERY = "*"  # in place of an integrator's name: all of them


@functools.cache
def _tree(file: Path) -> ast.Module:
    return ast.parse(file.read_bytes())


def _module_file(name: str) -> Path | None:
    """The file of a module of this package, by its dotted name."""
    first, *rest = name.split(".")
    if first != PACKAGE.name:
        return None
    place = PACKAGE.joinpath(*rest)
    return next((path for path in (place.with_suffix(".py"), place / "__init__.py") if path.is_file()), None)


def _imported(file: Path) -> Iterator[tuple[str, list[str]]]:
    """(module, names) of every import statement of a file, wherever it stands."""
    inner = PACKAGE in file.parents  # a script outside has no package that a relative import could mean
    package = [PACKAGE.name, *file.relative_to(PACKAGE).parent.parts] if inner else []
    for node in ast.walk(_tree(file)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, []) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            yield ".".join([*base, *([node.module] if node.module else [])]), [alias.name for alias in node.names]


@functools.cache
def imports_of(file: Path) -> frozenset[Path]:
    """The files of this package that a file, of it or a script, imports."""
    found = set()
    for module, names in _imported(file):
        inner = [_module_file(f"{module}.{name}") for name in names]
        found |= {path for path in [_module_file(module), *inner] if path is not None}
    return frozenset(found - PLUMBING)


@functools.cache
def all_imports(files: frozenset[Path]) -> frozenset[Path]:
    """Those files, the files they import, and so on."""
    found: set[Path] = set()
    ahead = set(files) - PLUMBING
    while ahead:
        found |= ahead
        ahead = {path for file in ahead for path in imports_of(file)} - found
    return frozenset(found)


def _strings(tree: Iterable[ast.Module]) -> set[str]:
    return {
        node.value
        for part in tree
        for node in ast.walk(part)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }


def _asked(file: Path) -> set[str]:
    """Names that a file imports from this package."""
    return {name for module, names in _imported(file) if module.startswith(PACKAGE.name) for name in names}


def _looks_up(file: Path) -> bool:
    """Does a file ask the registry for integrators of its own choice?

    What it is given as an argument is its caller's choice, and a name that it spells out is found by that name.
    """
    if file in RESOLVERS:
        return False
    asked = _asked(file)
    return bool(asked & {"integrators", "registry"}) or ("integrator" in asked and _chooses(_tree(file)))


def _chooses(tree: ast.Module) -> bool:
    """Is `integrator` used otherwise than on a literal name or on an argument of the function around it?"""
    fine: set[int] = set()
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            given = {argument.arg for argument in ast.walk(function.args) if isinstance(argument, ast.arg)}
            for call in ast.walk(function):
                if isinstance(call, ast.Call) and len(call.args) == 1:
                    what = call.args[0]
                    if isinstance(what, ast.Constant) or (isinstance(what, ast.Name) and what.id in given):
                        fine.add(id(call.func))
    return any(
        isinstance(node, ast.Name) and node.id == "integrator" and id(node) not in fine for node in ast.walk(tree)
    )


class Basis(NamedTuple):
    """What measuring depends on besides the integrator: digest of values, files, and integrators it may run itself."""

    values: tuple[str, ...]
    files: frozenset[Path]
    names: frozenset[str]  # integrators that it names
    every: bool  # it asks the registry, so that it may run any


@functools.cache
def basis(measure: Callable[..., Any]) -> Basis:
    """The basis of a study's measure."""
    found = Ingredients()
    found.add(measure)
    files = all_imports(frozenset(found.files))
    ours = [
        file
        for file in files
        if file.parent.name in {"measure", "judge", *(path.name for path in (PACKAGE.parent / "studies").glob("*"))}
    ]
    said = _strings(_tree(file) for file in ours if _asked(file) & {"integrator", "simulate"}) | found.constants
    names = frozenset(said & set(integrators()))
    return Basis(tuple(found.values), files, names, found.lists or any(_looks_up(file) for file in ours))


@functools.cache
def _of_integrator(name: str, made: int) -> tuple[tuple[str, ...], frozenset[Path]]:  # noqa: ARG001
    found = Ingredients()
    found.add(integrators()[name])
    return tuple(found.values), all_imports(frozenset(found.files))


def used(study: "Study", case: "Case") -> list[str]:
    """Names of the integrators that a case runs: what the study declares, or everything that it might run."""
    known = integrators()
    if study.uses is not None:
        names = set(study.uses(case))
    else:
        base = basis(study.measure)
        names = {case.integrator, *case.settings.get("integrators", ()), *base.names, *([EVERY] if base.every else [])}
    return sorted(known) if EVERY in names else sorted(names & set(known))


def files(study: "Study", case: "Case") -> frozenset[Path]:
    """Source files of this package that a case's numbers depend on."""
    known = integrators()
    solvers = (_of_integrator(name, id(known[name]))[1] for name in used(study, case))
    return basis(study.measure).files.union(*solvers)


def digest(study: "Study", case: "Case") -> str:
    """Hash of everything that a case's numbers depend on: settings, scene, integrators, sources and versions."""
    known, where = integrators(), scenes()
    names = used(study, case)
    scene = Ingredients()
    scene.add(where.get(case.scene) if case.scene != EVERY else where)
    content = [
        json.dumps([study.name, case.scene, case.integrator, case.group, dict(case.settings)], sort_keys=True),
        *basis(study.measure).values,
        *scene.values,
        *(value for name in names for value in (name, *_of_integrator(name, id(known[name]))[0])),
        *(f"{path.relative_to(PACKAGE)} {file_hash(path)}" for path in sorted(files(study, case))),
        *(plugins.digest_of(name) for name in (case.scene, *names)),
        datasets.provenance()["dependencies"],
        datasets.provenance()["processor"] if study.is_timed(case) else "",
    ]
    return hashlib.sha256("\n".join(content).encode()).hexdigest()[:20]


def script_digest(script: Path) -> str:
    """Hash of what a study's pictures, tables and verdict are made by: its script and all that it imports from here."""
    drawn = all_imports(imports_of(script)).union((PACKAGE / "report").glob("*.py"), [PACKAGE / "runner" / "store.py"])
    lines = [script.read_text(encoding="utf-8")]
    lines += [f"{path.relative_to(PACKAGE)} {file_hash(path)}" for path in sorted(drawn)]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


@functools.cache
def file_hash(path: Path) -> str:
    """Hash of a file as it was when it was first asked for."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
