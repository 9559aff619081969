"""All that a computed number depends on, as a mapping from labels to hashes, found without running anything.

    code symtop/methods/runge_kutta/gauss.py    the functions and classes of a file that are reached
    integrator gauss-2, scene goldstein         values: coefficients, numbers
    package numba, processor, settings          where it was computed, and with which arguments

The digest of a mapping is the hash of all of it; two mappings are compared label by label, which says *why* a stored
number is stale. Cases of studies, cached kernels and references, checkpoints and figures are all identified this way.

`Code` goes from a function to its instructions, constants, names and defaults, to what it closes over, to the globals
that it names (attributes of modules included) and to what it imports when it runs; from a class to its methods and
bases; from an instance to its class and attributes. Comments, line numbers and docstrings (but those of functions
inside functions) do not count. By name alone count functions that look something up (`by_name`), the files of
`NO_NUMBERS`, which pass on numbers but compute none, and libraries, with their version (`packages`). Lists, dicts, sets
under a module's lower-case names are state of a process and do not count (in a user's file its statements outside of
functions count instead); nor do dataclass fields with the metadata ``words``. A file whose path is a constant counts.
"""

import ast
import contextlib
import dis
import functools
import hashlib
import importlib.metadata
import importlib.util
import inspect
import platform
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any, TypeVar

import numpy as np

Reasons = dict[str, str]

DIGEST_LENGTH = 20  # hexadecimal digits of a digest
NUMERICS = ("numpy", "scipy", "numba", "heyoka", "xarray", "netCDF4", "mpmath")  # packages that may change a number
PACKAGE = Path(__file__).resolve().parent.parent
_PLUMBING = ("code_hash", "errors", "files", "netcdf", "parallel", "progress", "signals")
NO_NUMBERS = frozenset([PACKAGE / "run" / "cluster.py", *(PACKAGE / "core" / f"{name}.py" for name in _PLUMBING)])
roots: dict[str, Path] = {PACKAGE.name: PACKAGE}  # name of a known package: its folder
_path = functools.cache(lambda name: Path(name).resolve())


def hashed(*parts: str) -> str:
    """Hash of some text, 20 hexadecimal digits."""
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:DIGEST_LENGTH]


def digest(reasons: Mapping[str, str]) -> str:
    """The hash of a mapping."""
    return hashed(*(f"{label}\t{reasons[label]}" for label in sorted(reasons)))


def changes(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """The labels in which two mappings differ, and how."""
    labels = [label for label in sorted(before) if label in now and now[label] != before[label]]
    labels += [f"{label} (no longer counts)" for label in sorted(set(before) - set(now))]
    return labels + [f"{label} (did not count before)" for label in sorted(set(now) - set(before))]


def merged(mappings: Iterable[Mapping[str, str]]) -> Reasons:
    """All labels of some mappings; a label with several hashes has the hash of them all."""
    hashes: dict[str, set[str]] = {}
    for mapping in mappings:
        for label, value in mapping.items():
            hashes.setdefault(label, set()).add(value)
    return {label: values.pop() if len(values) == 1 else hashed(*sorted(values)) for label, values in hashes.items()}


@functools.cache
def file_hash(path: Path) -> str:
    """Hash of a file's content at the first call; later changes of the file are not seen."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:DIGEST_LENGTH]


@functools.cache
def version(package: str) -> str:
    """The installed version of a package, or ``absent``."""
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        return importlib.metadata.version(package)
    return "absent"


@functools.cache
def processor() -> str:
    """This machine's processor: its name, and its family and model, as different virtual machines share a name."""
    info: dict[str, str] = {}
    with contextlib.suppress(OSError), Path("/proc/cpuinfo").open(encoding="utf-8") as lines:
        info = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in lines)}
    details = (f"{key} {info[key]}" for key in ("cpu family", "model", "CPU implementer", "CPU part") if key in info)
    return ", ".join([info.get("model name", platform.processor() or platform.machine()), *details])


def packages(*names: str) -> Reasons:
    """Versions of packages; by default those of `NUMERICS` and of Python, whose bytecode differs by version."""
    python = {} if names else {"package python": ".".join(platform.python_version_tuple()[:2])}
    return {f"package {name}": version(name) for name in names or NUMERICS} | python


def add_root(name: str, folder: Path) -> None:
    """Make a package known: its code counts file by file, not by the package's version."""
    if roots.get(name) != folder.resolve():
        roots[name] = folder.resolve()
        for cached in (_path, file_label, is_library):
            cached.cache_clear()


@functools.cache
def file_label(path: Path) -> str:
    """The path of a file in its package, such as symtop/core/jit.py, if that is known; otherwise its name alone."""
    root = next((name for name, folder in roots.items() if folder in path.parents), "")
    return f"{root}/{path.relative_to(roots[root]).as_posix()}" if root else path.name


@functools.cache
def is_library(package: str) -> bool:
    """Does a top-level package count by name and version (Python's own and installed ones), and not by its code?"""
    if package in roots:
        return False
    with contextlib.suppress(ImportError, ValueError):
        module = sys.modules.get(package) or importlib.util.find_spec(package)
        paths = [getattr(module, name, None) for name in ("__file__", "origin")]
        paths += [*(getattr(module, "__path__", None) or getattr(module, "submodule_search_locations", None) or ())]
        if any({"site-packages", "dist-packages"} & {*Path(path).parts} for path in paths if path):
            return True
    return package in sys.stdlib_module_names or package in sys.builtin_module_names


def _of_library(module: str | None) -> bool:
    return is_library((module or "").partition(".")[0])


Parts = Callable[[Any], Iterable[Any]]
Function = TypeVar("Function", bound=Callable[..., Any])

STATE_TYPES = (list, dict, set)  # types of globals that do not count under a module's lower-case name
SHIPPED = ("symtop.", "symtop_studies.")
DEFINITIONS = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.Import | ast.ImportFrom
PLAIN_TYPES = (type(None), bool, int, float, complex, str, bytes, range, slice, np.generic)
_IMPORT = dis.opmap["IMPORT_NAME"]
_by_name: set[Callable[..., Any]] = set()
_CONTAINERS: tuple[tuple[Any, Parts], ...] = (
    (functools.partial, lambda thing: (thing.func, thing.args, thing.keywords)),
    (MethodType, lambda thing: (thing.__func__, thing.__self__)),
    (property, lambda thing: (thing.fget, thing.fset)),
    (functools.cached_property, lambda thing: (thing.func,)),
    (Mapping, lambda thing: [part for key in sorted(thing, key=_order) for part in (key, thing[key])]),
    ((set, frozenset), lambda thing: sorted(thing, key=_order)),
    ((tuple, list), lambda thing: (type(thing), *thing)),
)


@functools.cache
def _is_plumbing(file: str) -> bool:
    """Is a file one of `NO_NUMBERS` or of Python's own library, which compute no numbers of the project?"""
    return _path(file) in NO_NUMBERS or _path(contextlib.__file__).parent in _path(file).parents


def by_name(function: Function) -> Function:
    """Decorator: count a function by its name alone. For functions that look something up, which counts by itself."""
    _by_name.add(function)
    return function


def _order(key: object) -> str:
    """Sort key for the keys of a dict: the same in every process, unlike the address in a function's `repr`."""
    return f"{key.__module__}.{key.__qualname__}" if isinstance(key, (FunctionType, type)) else repr(key)


@dataclass(eq=False)
class Part:
    """A function, class or constant: its label, what it holds itself, and the parts that it leads to."""

    label: str
    file: str  # label of its file; empty for values that no file holds
    thing: object = field(repr=False)  # held, so that its id stays its own
    values: list[str] = field(default_factory=list, repr=False)
    parts: "list[Part]" = field(default_factory=list, repr=False)


class Code:
    """Finds the functions, classes and constants that things lead to; `also(f)` gives more of them for a function f."""

    def __init__(self, also: Parts = lambda _: ()) -> None:
        self._also = also
        self._parts: dict[tuple[str, int], Part] = {}
        self._open: list[Part] = []
        self._at = Part("", "", None)
        self._held: dict[int, tuple[object, str]] = {}  # values of the present part by id, each with its hash

    def reached(self, label: str, *things: object) -> list[Part]:
        """All parts that things lead to; the first one, labelled `label`, stands for the things themselves."""
        reached: dict[int, Part] = {}
        queue = [Part(label, "", things)]
        self._open += queue
        while self._open:
            self._at, self._held = self._open.pop(), {}
            self._look_into(self._at.thing)
        while queue:
            part = queue.pop()
            reached[id(part)] = part
            queue += [child for child in part.parts if id(child) not in reached]
        return list(reached.values())

    def reasons(self, label: str, *things: object) -> Reasons:
        """Hashes of things and of all that they lead to, by file; values that no file holds stand under `label`."""
        parts = self.reached(label, *things)
        own = [part.label for part in parts if not part.file.startswith(("symtop/", "symtop_studies/", "<"))]
        return {key: value for key, value in by_file(parts).items() if key != "order" or len({*own}) < len(own)}

    def _look_into(self, thing: Any) -> None:
        if not self._at.file:
            self._add_all(thing)
        elif isinstance(thing, FunctionType):
            self._add_code(thing)
        elif isinstance(thing, type):
            members = ((name, getattr(member, "__func__", member)) for name, member in sorted(vars(thing).items()))
            kinds = FunctionType, property
            self._add_all(member for name, member in members if isinstance(member, kinds) or not name.startswith("__"))
            self._add_all(thing.__bases__)
        else:
            self._add(thing)

    def _note(self, *values: str) -> None:
        self._at.values.extend(values)

    def _lead_to(self, kind: str, name: str, file: str, thing: object) -> None:
        label = f"{kind} {file}:{name}"
        part = self._parts.get((label, id(thing)))
        if part is None:
            part = self._parts[label, id(thing)] = Part(label, file, thing)
            self._open.append(part)
        self._note(label)
        self._at.parts.append(part)

    def _add_all(self, things: Iterable[object]) -> None:
        for thing in things:
            self._add(thing)

    def _add(self, thing: Any) -> None:
        if isinstance(thing, PLAIN_TYPES):
            self._note(repr(thing))
            return
        if not isinstance(thing, (FunctionType, type, ModuleType)):  # compiled by numba, or cached
            if hasattr(thing, "targetoptions"):
                self._note(repr(sorted(thing.targetoptions.items())))
            thing = getattr(thing, "py_func", getattr(thing, "__wrapped__", thing))
        if isinstance(thing, FunctionType):
            self._add_function(thing)
        elif isinstance(thing, type):
            self._add_class(thing)
        elif isinstance(thing, ModuleType):
            self._note(thing.__name__)
        else:
            values, begin = self._at.values, len(self._at.values)
            if id(thing) not in self._held:
                self._held[id(thing)] = thing, "itself"  # noted where a cycle of references leads back to it
                self._add_value(thing)
                self._held[id(thing)] = thing, hashed(*values[begin:])
                del values[begin:]
            values.append(self._held[id(thing)][1])

    def _add_function(self, function: FunctionType) -> None:
        file, library = function.__code__.co_filename, _of_library(function.__module__)
        if library or function in _by_name or _is_plumbing(file):
            self._note(f"{function.__module__}.{function.__qualname__}")
            if not library and function not in _by_name:
                self._add_all(references(function))  # a wrapper: what it calls
        else:
            self._lead_to("function", function.__qualname__, file_label(_path(file)), function)

    def _add_class(self, kind: type) -> None:
        file = getattr(sys.modules.get(kind.__module__), "__file__", None)
        if _of_library(kind.__module__) or (file and _is_plumbing(file)):
            self._note(f"{kind.__module__}.{kind.__qualname__}")
        else:
            self._lead_to("class", kind.__qualname__, file_label(_path(file)) if file else kind.__module__, kind)

    def _add_value(self, thing: Any) -> None:
        parts = next((parts(thing) for kind, parts in _CONTAINERS if isinstance(thing, kind)), None)
        if parts is not None:
            self._add_all(parts)
        elif isinstance(thing, np.ndarray):
            self._note(f"{thing.dtype}{thing.shape}{hashlib.sha256(thing.tobytes()).hexdigest()}")
        elif isinstance(thing, Path):
            path = thing.resolve()
            if any(folder in path.parents for folder in roots.values()) and path.is_file():
                self._lead_to("file", "", file_label(path), file_hash(path))
        elif is_dataclass(thing):
            field_names = [part.name for part in fields(thing) if not part.metadata.get("words")]
            self._add_all((type(thing), *(getattr(thing, name) for name in field_names)))
        else:
            self._add_class(type(thing))
            self._note(str(getattr(thing, "__name__", "")))  # of a function written in C
            if not _of_library(type(thing).__module__):
                self._add(getattr(thing, "__dict__", None))
                names = (name for kind in type(thing).__mro__ for name in kind.__dict__.get("__slots__", ()))
                self._add_all(getattr(thing, name, None) for name in names)

    def _add_code(self, function: FunctionType) -> None:
        for code in codes(function.__code__):
            constants = [value for value in code.co_consts if not isinstance(value, CodeType)]
            if code is function.__code__ and constants[:1] == [function.__doc__]:
                del constants[0]
            # a frozenset prints in another order in every process
            texts = (f"frozenset({sorted(map(repr, x))})" if isinstance(x, frozenset) else repr(x) for x in constants)
            self._note(code.co_code.hex(), code.co_exceptiontable.hex(), *texts)
            # every function has `CO_OPTIMIZED`, but numba clears it where a profiler watches
            flags = code.co_flags | (inspect.CO_OPTIMIZED if code.co_flags & inspect.CO_NEWLOCALS else 0)
            self._note(repr((code.co_names, code.co_freevars, code.co_argcount, code.co_kwonlyargcount, flags)))
        self._add_all(references(function))
        self._add_all(self._also(function))
        file = file_label(_path(function.__code__.co_filename))
        for name, value in named_globals(function):
            if callable(value) or isinstance(value, ModuleType):
                self._add(value)
            elif isinstance(value, PLAIN_TYPES):
                self._note(f"{name} = {value!r}")
            elif not (isinstance(value, STATE_TYPES) and name == name.lower()):
                self._lead_to("constant", name, file, value)
            elif not (function.__module__ or "").startswith(SHIPPED):
                self._note(f"{name} of {_statements(_path(function.__code__.co_filename))}")


def _statements(file: Path) -> str:
    """Hash of the statements of a user's file outside of functions, classes and imports, which fill its lists."""
    with contextlib.suppress(OSError, SyntaxError, ValueError):  # no file, as at a prompt
        return hashed(*(ast.dump(x) for x in ast.parse(file.read_bytes()).body if not isinstance(x, DEFINITIONS)))
    return ""


def by_file(parts: Sequence[Part]) -> Reasons:
    """Hashes of parts by label, a file's together; ``order``, where functions share a label: which leads to which."""
    texts: dict[str, set[str]] = {}
    for part in parts:
        label = f"code {part.file}" if part.file else part.label
        texts.setdefault(label, set()).add("\n".join((part.label, *part.values)))
    places = {id(part): str(place) for place, part in enumerate(parts)}
    order = [text for part in parts for text in (*part.values, *(places[id(child)] for child in part.parts))]
    hashes = {label: hashed(*sorted(group)) for label, group in texts.items()}
    return hashes | ({"order": hashed(*order)} if len({part.label for part in parts}) < len(parts) else {})


def codes(code: CodeType) -> Iterator[CodeType]:
    """A code object and those within it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from codes(constant)


def references(function: FunctionType) -> Iterator[object]:
    """What a function holds besides its code: defaults and what it closes over."""
    yield from function.__defaults__ or ()
    yield function.__kwdefaults__
    for cell in function.__closure__ or ():
        with contextlib.suppress(ValueError):  # not filled yet
            yield cell.cell_contents


def named_globals(function: FunctionType) -> Iterator[tuple[str, object]]:
    """Name and value of each global that a function names or imports when it runs, attributes of modules included."""
    code_objects = list(codes(function.__code__))
    names = sorted({name for code in code_objects for name in code.co_names})
    package = function.__globals__.get("__package__") or ""
    pending = [(name, function.__globals__[name]) for name in names if name in function.__globals__]
    pending += [pair for code in code_objects for pair in _imports(code, package)]
    expanded = set[str]()
    while pending:
        name, value = pending.pop()
        yield name, value
        if isinstance(value, ModuleType) and value.__name__ not in expanded and not _of_library(value.__name__):
            expanded.add(value.__name__)
            pending += [(f"{name}.{part}", getattr(value, part)) for part in names if hasattr(value, part)]


def _imports(code: CodeType, package: str) -> Iterator[tuple[str, object]]:
    """Name and value of what import statements in a function's code bind, but for libraries, which count by name."""
    if _IMPORT not in code.co_code[::2]:
        return
    steps = [step for step in dis.get_instructions(code) if step.opname != "EXTENDED_ARG"]
    for level, names, step in zip(steps, steps[1:], steps[2:], strict=False):
        if step.opname != "IMPORT_NAME":
            continue
        name = importlib.util.resolve_name("." * level.argval + step.argval, package)
        if _of_library(name):
            continue
        try:
            module = importlib.import_module(name)
            for part in names.argval or ():
                if not hasattr(module, part):
                    importlib.import_module(f"{name}.{part}")
            yield from [(f"{name}.{part}", getattr(module, part)) for part in names.argval or ()] or [(name, module)]
        except ImportError:  # an optional package is not installed
            yield name, "absent"
