"""Compilation of kernels with numba, with a disk cache that never serves stale numbers.

numba stamps a cached kernel with the file of the function itself and does not see edits in the files it calls, so that
an old kernel can silently return old numbers; and it recompiles a function that only moved by a line. Here the folder
of a kernel is named after a hash of everything it is compiled from (`symtop.core.code_hash`): instructions, constants
and values of its functions, wherever they stand, and the versions of Python and numba.

The module also compiles `fused`, a b + c with one rounding, which numba lacks. A sum of a number and a correction that
hardly changes from step to step is rounded the same way every time, a bias of up to half a unit in the last place. The
exact product has random digits below the last place; added before the rounding, they remove the bias.
"""

import contextlib
import functools
import gc
import hashlib
import json
import sys
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FunctionType
from typing import Any

import llvmlite
import numba
import numpy as np
from llvmlite.binding import ffi, parse_bitcode
from numba import njit, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import compile_result
from numba.core.compiler_lock import global_compiler_lock
from numba.core.environment import Environment
from numba.core.funcdesc import PythonFunctionDescriptor
from numba.core.typing import signature as numba_signature
from numba.core.typing.templates import builtin_registry
from numba.cpython.unsafe.tuple import tuple_setitem
from numba.extending import intrinsic, overload, register_jitable as _register
from numba.np.unsafe.ndarray import to_fixed_tuple as fixed_tuple

from symtop.core.code_hash import PACKAGE, Code, Part, by_file, by_name, digest, hashed
from symtop.core.errors import SymtopError
from symtop.core.files import cache_root, is_trusted, locked, make_private, prune, replacing, touch
from symtop.core.jit_functions import Function, fused, marked, two_product
from symtop.core.progress import on_cold
from symtop.core.sines import polynomials, sincos

set_item: Any = tuple_setitem  # in a kernel: set_item(tuple, i, value) is a new tuple
to_fixed_tuple: Any = fixed_tuple  # in a kernel: to_fixed_tuple(array, n)

MOST_BYTES = 200_000_000  # of kernels that are kept, about 2000 of them
OPTIONS = {"error_model": "numpy", "nogil": True}  # division by zero gives infinity, as in C; no Python lock
HASH_BYTES = hashlib.sha256().digest_size  # length in bytes of the hash that a code file begins with
FORMAT = "bitcode and machine code"  # of what is stored of a kernel
SHIPPED = PACKAGE / "kernels"  # bitcode that comes with a wheel, a folder for each kernel
KERNEL_NAMES = ("modname", "qualname", "unique_name", "mangled_name", "env_name", "args")  # in numba's record
KERNEL_ONLY = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}  # less to compile by 14 %
WRAPPERS = ("_ZN7cpython", "cfunc.")  # how the names of functions begin that Python and C can call
INLINED = {"forceinline": True, **KERNEL_ONLY}
LOAD_ERRORS = (OSError, ValueError, LookupError, RuntimeError, zlib.error, AttributeError, TypeError)  # files, numba
_ARRAYS = [types.Array(kind, n, "C") for kind in (types.float64, types.int64) for n in (1, 2, 3)]
RETURN_TYPES = {repr(kind): kind for kind in (types.none, types.boolean, types.int64, types.float64, *_ARRAYS)}

_stands_for: dict[int, list[object]] = {}  # id of a function: what numba compiles in its place
_registered: set[Callable[..., Any]] = set()
_known = [0]  # entries of numba's registry that `_stands_for` knows
_pruned: list[Path] = []

overload(sincos, jit_options=INLINED, strict=False)(lambda *_: polynomials)


@by_name
def register_jitable(function: Function, options: dict[str, Any] = INLINED) -> Function:
    """Let kernels call a plain function, inlined wherever they do: LLVM would keep the larger ones as calls.

    A function is registered once: numba would add another overload each time, and the hash of a kernel's code would
    depend on how many loops the process has built before.
    """
    if function not in _registered:
        _registered.add(function)
        _register(**options)(function)
    return function


@by_name
def by_length(*functions: tuple[int, Callable[..., Any]]) -> Callable[..., Any]:
    """A function (par, x, ...) that calls the one of `functions` for the length of the tuple x, also in kernels."""
    table = dict(functions)
    for function in table.values():
        register_jitable(function)

    def dispatch(par: Any, x: Any, *rest: Any) -> Any:
        return table[len(x)](par, x, *rest)

    overload(dispatch, jit_options=INLINED, strict=False)(lambda _par, x, *_rest: table[len(x)])
    return dispatch


def _overloads(function: FunctionType) -> Iterator[object]:
    """What numba compiles where a function is called: the functions that overload it, and their options."""
    entries = builtin_registry.globals
    for value, kind in entries[_known[0] :]:
        if isinstance(value, FunctionType) and isinstance(kind, types.Function):
            _stands_for.setdefault(id(value), []).extend(kind.templates)
    _known[0] = len(entries)
    for template in _stands_for.get(id(function), ()):
        yield getattr(template, "_overload_func", None)
        yield getattr(template, "_jit_options", None)


def code_of(thing: object) -> list[Part]:
    """The parts that a kernel, or an object with kernels, is compiled from, whatever the process has run before."""
    for function, is_inlined in marked:  # by the modules loaded so far that do not import numba
        register_jitable(function, INLINED if is_inlined else OPTIONS | KERNEL_ONLY)
    return Code(_overloads).reached("kernel", thing, OPTIONS, sys.version_info[:2], numba.__version__)


def code() -> Code:
    """A `Code` that follows numba's overloads; a function's hash is the same before and after it is registered."""
    return Code(lambda function: () if function in _registered else _overloads(function))


class _Library(JITCodeLibrary):  # type: ignore[misc]
    """The code of a kernel, or of a function that kernels call.

    numba simplifies each function that a kernel calls and links it into the kernel. It also optimises each as a whole,
    which takes 15 % of a compilation and is done again with the kernel: that is left out here. Such a function gets no
    machine code of its own either, as Python and C could call it only through a wrapper, which it lacks. Its name is
    internal to the kernel: numba numbers names by process, and one kernel from disk could call a function of another.
    """

    bitcode = b""  # of a kernel with all that it calls, before it is optimised for a processor

    def _defined(self) -> list[Any]:
        return [function for function in self._final_module.functions if not function.is_declaration]

    def _entry_names(self) -> set[str]:
        """The names under which Python and C call a kernel; none for a function that only kernels call."""
        wrappers = {function.name for function in self._defined() if function.name.startswith(WRAPPERS)}
        return wrappers | {name.removeprefix(WRAPPERS[1]) for name in wrappers}

    def _optimize_final_module(self) -> None:
        if self._entry_names():
            self.bitcode = self._final_module.as_bitcode()
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        exported, defined = self._entry_names(), self._defined()
        if not exported and any(function.name.startswith("_ZN") for function in defined):
            self._finalize_dynamic_globals()
            self._verify_declare_only_symbols()
            self._finalized = True
            return
        for function in defined:
            if exported and function.name not in exported:
                function.linkage = "internal"
        super()._finalize_final_module()


class _Cache:
    """The code of one kernel in its folder, by signature: bitcode, which serves any processor, and machine code.

    A file is named after all that its code depends on. It begins with a hash of its content and of its name (bitcode)
    or of the bitcode that it was made from (machine code). A file that another user may have written is not read, as
    its code would be executed. Bitcode may also be in `SHIPPED`, which is trusted as the package is. After an error of
    the disk or with a damaged file the kernel is compiled, and the run goes on.
    """

    def __init__(self, folder: Path) -> None:
        self.cache_path = folder

    def files(self, signature: Any, codegen: Any) -> tuple[Path, Path, Path]:
        """Paths of the machine code, of the bitcode, and of the bitcode that may have come with a wheel."""
        system, *processor = codegen.magic_tuple()
        stem = hashed(json.dumps([*map(_json, signature)]), system, llvmlite.__version__)
        code = self.cache_path / f"{stem}.{hashed(*processor)}.code"
        return code, self.cache_path / f"{stem}.bitcode", SHIPPED / self.cache_path.name / f"{stem}.bitcode"

    def load_overload(self, signature: Any, context: Any) -> Any:
        """The kernel from disk, for numba; if it has to be compiled, None, after a call of the functions `on_cold`."""
        context.refresh()
        for index in (1, 2):
            with contextlib.suppress(*LOAD_ERRORS):
                files = self.files(signature, context.codegen())
                return _loaded(signature, context, _read(files[index], _name(files[index])), files[0])
        for callback in on_cold:
            callback()
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Store a compiled kernel, for numba, unless the file would lack something that another process needs."""
        with contextlib.suppress(*LOAD_ERRORS):
            library, kernel, constants = result.library, result.fndesc, result.environment.consts
            header = {name: getattr(kernel, name) for name in KERNEL_NAMES} | {"library": library.name}
            header |= {"returned": _json(result.signature.return_type), "constants": [str(kind) for kind in constants]}
            inner = [env for env in result._find_referenced_environments() if env is not result.environment]
            storable = _type(header["returned"]) == result.signature.return_type
            storable &= [np.dtype(kind) for kind in header["constants"]] == constants
            storable &= not any(env.consts for env in inner)
            if storable and not library.has_dynamic_globals and not result.reload_init:
                code, bitcode, _ = self.files(signature, library.codegen)
                entry = json.dumps(header).encode() + b"\n" + zlib.compress(library.bitcode, 1)
                _write(bitcode, entry, _name(bitcode))
                _write(code, library._get_compiled_object(), entry)


def _loaded(arguments: tuple[Any, ...], context: Any, entry: bytes, code: Path) -> Any:
    """A kernel from its bitcode and its machine code in the file `code`; missing machine code is made and stored."""
    head, _, bitcode = entry.partition(b"\n")
    facts = json.loads(head)
    returned = _type(facts["returned"])
    library = _Library(context.codegen(), facts["library"])
    library._final_module = parse_bitcode(zlib.decompress(bitcode))
    library._final_module.name = library.name
    library.enable_object_caching()
    with contextlib.suppress(OSError, ValueError):
        library._set_compiled_object(_read(code, entry))
    if library._compiled_object is None:
        library._optimize_final_module()
    library._finalize_final_module()
    if library._compiled:  # in this call
        with contextlib.suppress(OSError, SymtopError):
            _write(code, library._get_compiled_object(), entry)
    kernel = PythonFunctionDescriptor(
        True, facts["modname"], facts["qualname"], facts["unique_name"], "", {}, returned, {}, tuple(facts["args"]), (),
        argtypes=arguments, env_name=facts["env_name"],
    )  # fmt: skip
    kernel.mangled_name = facts["mangled_name"]
    environment = Environment.from_fndesc(kernel)
    environment.consts[:] = [np.dtype(kind) for kind in facts["constants"]]
    return compile_result(
        typing_context=context.typing_context, target_context=context, library=library, fndesc=kernel,
        entry_point=context.get_executable(library, kernel, environment), environment=environment, objectmode=False,
        signature=numba_signature(returned, *arguments), lifted=(), reload_init=[], type_annotation="",
    )  # fmt: skip


def _json(kind: Any) -> Any:
    """A type as JSON; that of a named tuple by its class and fields, which its `repr` lacks."""
    if not isinstance(kind, types.BaseTuple):
        return repr(kind)
    cls = getattr(kind, "instance_class", tuple)
    return [cls.__module__, cls.__qualname__, *getattr(kind, "fields", ()), [*map(_json, kind)]]


def _type(words: Any) -> Any:
    if isinstance(words, str):
        return RETURN_TYPES[words]
    return types.BaseTuple.from_types(tuple(map(_type, words[-1])), getattr(sys.modules[words[0]], words[1]))


def _name(file: Path) -> bytes:
    return f"{file.parent.name}/{file.name}".encode()


def _read(file: Path, key: bytes) -> bytes:
    """The content of a file written with `key`; ValueError if it was not, or another user may have written it."""
    if SHIPPED not in file.parents and not is_trusted(file):
        raise ValueError("the code on disk may be somebody else's")
    data = file.read_bytes()
    if hashlib.sha256(key + data[HASH_BYTES:]).digest() != data[:HASH_BYTES]:
        raise ValueError("the code on disk is damaged")
    return data[HASH_BYTES:]


def _write(file: Path, content: bytes, key: bytes) -> None:
    """Replace a file in one move; a process's first call removes old kernels before. `key` enters the file's hash."""
    if not _pruned:
        _pruned.append(file)
        prune(file.parent.parent, MOST_BYTES)
    make_private(file.parent)
    with replacing(file, mode=0o600) as partial:
        partial.write_bytes(hashlib.sha256(key + content).digest() + content)


def _compile_lean(kernel: Any, compiling: Callable[..., Any], signature: Any) -> Any:
    """Compile a kernel as a `_Library`; environments are set once its code has addresses. Call with numba's lock."""
    codegen = kernel.targetctx.codegen()
    attributes = vars(codegen)
    if "set_env" in attributes:
        return compiling(signature)

    def set_where_defined(name: str, environment: Any) -> None:
        if codegen._engine.is_symbol_defined(name):
            type(codegen).set_env(codegen, name, environment)

    try:
        codegen._library_class, codegen.set_env = _Library, set_where_defined
        entry = compiling(signature)
    finally:
        attributes.pop("_library_class"), attributes.pop("set_env")
    for result in kernel.overloads.values():
        for environment in result._find_referenced_environments():
            codegen.set_env(environment.env_name, environment)
    return entry


@functools.cache
def lean_probe() -> Any:
    """A test kernel, if numba has the private parts that `_Library` needs; else None, for numba's own way. 0.06 s."""
    inner = register_jitable(lambda x: x + 1.0, OPTIONS | KERNEL_ONLY)
    kernel = njit(**OPTIONS)(lambda x: 2.0 * inner(x))
    with contextlib.suppress(Exception):
        _compile_lean(kernel, kernel.compile, (types.float64,))
        return kernel if kernel(1.0) == 4.0 else None
    return None


def _compile_once(kernel: Any, compiling: Callable[..., Any]) -> Callable[..., Any]:
    """`compiling`, run by one process at a time for a kernel that is not on disk: the others wait and load it.

    The garbage collector is off meanwhile: 9 % less time, and 100 MB more memory for the largest kernel. numba's lock
    is taken before that of the file, as its own nested compilations take it first.
    """

    @functools.wraps(compiling)
    def compile_now(signature: Any) -> Any:
        with global_compiler_lock, contextlib.ExitStack() as stack:
            if gc.isenabled():
                stack.callback(gc.enable)
                gc.disable()
            with contextlib.suppress(AttributeError):  # numba's callbacks at every call of LLVM take 4 % of the time
                noting = ffi.lib._lock._cblist
                stack.callback(noting.extend, noting[:])
                noting.clear()
            if isinstance(kernel._cache, _Cache) and not is_cached(kernel, signature):
                with contextlib.suppress(SymtopError, OSError):  # a cache that cannot be written costs time and no run
                    make_private(kernel._cache.cache_path)
                    stack.enter_context(locked(kernel._cache.cache_path / "code", wait=True))
            lean = is_cached(kernel, signature, bitcode=True) or lean_probe()
            return _compile_lean(kernel, compiling, signature) if lean else compiling(signature)

    return compile_now


def is_stored(kernel: Any) -> bool:
    """Has a kernel been compiled, for arguments of some types, in this process, on disk or in a wheel?"""
    folder = kernel._cache.cache_path
    folders = (folder, SHIPPED / folder.name) if folder else ()
    return bool(kernel.overloads) or any(file.is_file() for folder in folders for file in folder.glob("*.*code"))


@by_name
def compile_kernel(function: Callable[..., Any]) -> Any:
    """``njit`` with the disk cache; division by zero gives infinity, as in C.

    A kernel with functions typed at a prompt, which have no source file, compiles without the cache. The constructor of
    a NamedTuple has none either, but follows from the fields, which are part of what the kernel is made of.
    """
    parts = code_of(function)
    made_of = digest(by_file(parts) | {"format": FORMAT})
    if numba.config.DISABLE_JIT:
        raise SymtopError("NUMBA_DISABLE_JIT must be 0 or unset, not 1: some functions of kernels exist compiled only")
    kernel = njit(**OPTIONS)(_renamed(function, made_of))
    kernel.compile = _compile_once(kernel, kernel.compile)
    functions = (part.thing for part in parts if isinstance(part.thing, FunctionType))
    sources = [part for part in functions if not part.__module__.startswith("namedtuple_")]
    folder = cache_root() / "kernels" / made_of
    in_files = all(Path(part.__code__.co_filename).is_file() for part in sources)
    if in_files and all(map(is_trusted, (cache_root(), folder.parent, folder))):
        touch(folder)
        kernel._cache = _Cache(folder)
    return kernel


def _renamed(function: Any, made_of: str) -> FunctionType:
    """The function under a unique name: LLVM finds machine code by name, and numba numbers names by process."""
    copy = FunctionType(function.__code__, function.__globals__, function.__name__, function.__defaults__,
                        function.__closure__)  # fmt: skip
    copy.__qualname__, copy.__module__ = f"{function.__qualname__}_{made_of[:16]}", function.__module__
    return copy


def is_cached(kernel: Any, signature: Any, *, bitcode: bool = False) -> bool:
    """Is a kernel's machine code in memory or on disk? With `bitcode`, its bitcode on disk is enough."""
    if signature in kernel.overloads:
        return True
    with contextlib.suppress(AttributeError, TypeError, OSError):  # numba's own cache, another numba, or unreadable
        files = kernel._cache.files(signature, kernel.targetctx.codegen())
        return any(file.is_file() for file in files[: 3 if bitcode else 1])
    return False


@intrinsic
def _fma(typing, a, b, c):  # type: ignore[no-untyped-def]
    """LLVM's fma: one instruction where the processor has it, exact software where it has not."""

    def emit(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), emit


@overload(fused, jit_options=INLINED)
def _fused(a, b, c):  # type: ignore[no-untyped-def]
    if not all(isinstance(value, types.Float) for value in (a, b, c)):
        return None

    def once(a, b, c):  # type: ignore[no-untyped-def]
        return _fma(a, b, c)

    return once


@overload(two_product, jit_options=INLINED)
def _two_product(a, b):  # type: ignore[no-untyped-def]
    def exactly(a, b):  # type: ignore[no-untyped-def]
        product = a * b
        return product, _fma(a, b, -product)

    return exactly
