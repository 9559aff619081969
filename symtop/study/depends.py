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
import inspect
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from symtop import datasets
from symtop.integrators.registry import Integrator, integrators
from symtop.scenes import scenes
from symtop.study import plugins

if TYPE_CHECKING:
    from symtop.study.study import Case, Study

PACKAGE = Path(__file__).resolve().parents[1]
PLUMBING = {PACKAGE / name for name in ("checks.py", "datasets.py")} | set(PACKAGE.rglob("__init__.py"))
RESOLVERS = {PACKAGE / name for name in ("simulate.py", "integrators/registry.py")}  # they look up what they are given
WORDS = ("summary", "reference")  # of an Integrator: said, not computed
SCRIPTS = ("symtop_study_", "symtop_plugin_")  # what modules of scripts and plug-ins are called
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
    package = [PACKAGE.name, *file.relative_to(PACKAGE).parent.parts]
    for node in ast.walk(_tree(file)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, []) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            yield ".".join([*base, *([node.module] if node.module else [])]), [alias.name for alias in node.names]


@functools.cache
def imports_of(file: Path) -> frozenset[Path]:
    """The files of this package that a file of it imports."""
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


_CONTAINERS: tuple[tuple[Any, Callable[[Any], Iterable[Any]]], ...] = (
    (functools.partial, lambda thing: (thing.func, thing.args, thing.keywords)),
    (MethodType, lambda thing: (thing.__func__, thing.__self__)),
    (Mapping, lambda thing: [part for key in sorted(thing, key=repr) for part in (key, thing[key])]),
    ((set, frozenset), lambda thing: sorted(thing, key=repr)),
    ((tuple, list), lambda thing: (type(thing), *thing)),
)


@dataclass
class Ingredients:
    """Files of the package and values that something was made of."""

    files: set[Path] = field(default_factory=set)
    values: list[str] = field(default_factory=list)
    constants: set[str] = field(default_factory=set)  # strings in the functions of scripts
    lists: bool = False  # such a function asks for all integrators
    _seen: dict[int, object] = field(default_factory=dict, repr=False)

    def add(self, thing: Any) -> None:
        """Walk anything that a solver or a measure may hold."""
        if isinstance(thing, (type(None), bool, int, float, complex, str, bytes, np.generic)):
            self.values.append(repr(thing))
        elif id(thing) not in self._seen:
            self._seen[id(thing)] = thing
            if not isinstance(thing, (FunctionType, type)):  # compiled by numba, or cached
                thing = getattr(thing, "py_func", getattr(thing, "__wrapped__", thing))
            parts = next((parts(thing) for kind, parts in _CONTAINERS if isinstance(thing, kind)), None)
            if parts is None:
                self._add_one(thing)
            else:
                self._add_all(parts)

    def _add_one(self, thing: Any) -> None:
        if isinstance(thing, FunctionType):
            self._add_function(thing)
        elif isinstance(thing, ModuleType):
            self._is_ours(thing)
        elif isinstance(thing, type):
            self.values.append(f"{thing.__module__}.{thing.__qualname__}")
            if not self._is_ours(sys.modules.get(thing.__module__)) and thing.__module__.startswith(SCRIPTS):
                self._add_all(part for _, part in sorted(vars(thing).items()) if isinstance(part, FunctionType))
        elif isinstance(thing, np.ndarray):
            self.values.append(f"{thing.dtype}{thing.shape}{hashlib.sha256(thing.tobytes()).hexdigest()}")
        elif is_dataclass(thing):
            spoken = WORDS if isinstance(thing, Integrator) else ()
            self._add_all((type(thing), *(getattr(thing, f.name) for f in fields(thing) if f.name not in spoken)))
        else:
            self.add(type(thing))
            if self._is_ours(sys.modules.get(type(thing).__module__)):
                self.add(getattr(thing, "__dict__", None))

    def _add_all(self, things: Iterable[Any]) -> None:
        for thing in things:
            self.add(thing)

    def _is_ours(self, module: ModuleType | None) -> bool:
        return self._add_file(getattr(module, "__file__", None))

    def _add_file(self, name: str | None) -> bool:
        path = Path(name).resolve() if name else None
        ours = path is not None and PACKAGE in path.parents
        if ours and path is not None:
            self.files.add(path)
        return ours

    def _add_function(self, function: FunctionType) -> None:
        self.values.append(function.__qualname__)
        self._add_all(function.__defaults__ or ())
        self.add(function.__kwdefaults__)
        for cell in function.__closure__ or ():
            try:
                self.add(cell.cell_contents)
            except ValueError:  # not filled yet
                continue
        if not self._add_file(function.__code__.co_filename):  # a script or a plug-in: its text, and what it names
            self.values.append(_text(function))
            self.constants |= {c for part in _codes(function.__code__) for c in part.co_consts if isinstance(c, str)}
            named = [name for name in _names(function.__code__) if name in function.__globals__]
            self.lists = self.lists or any(function.__globals__[name] is integrators for name in named)
            self._add_all(function.__globals__[name] for name in named)


def _text(function: FunctionType) -> str:
    try:
        return inspect.getsource(function)
    except (OSError, TypeError):
        return function.__code__.co_code.hex()


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _names(code: CodeType) -> list[str]:
    """Names in a function's code, sorted, so that equal sources give equal digests."""
    return sorted({name for part in _codes(code) for name in part.co_names})


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
    ours = [file for file in files if file.parent.name == "measure"]
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
        json.dumps([study.name, case.scene, case.integrator, dict(case.settings)], sort_keys=True),
        *basis(study.measure).values,
        *scene.values,
        *(value for name in names for value in (name, *_of_integrator(name, id(known[name]))[0])),
        *(f"{path.relative_to(PACKAGE)} {file_hash(path)}" for path in sorted(files(study, case))),
        *(plugins.digest_of(name) for name in (case.scene, *names)),
        datasets.provenance()["dependencies"],
        datasets.provenance()["processor"] if study.is_timed(case) else "",
    ]
    return hashlib.sha256("\n".join(content).encode()).hexdigest()[:20]


@functools.cache
def file_hash(path: Path) -> str:
    """Hash of a file as it was when it was first asked for."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
