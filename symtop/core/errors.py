"""Errors of the user and errors of other people's code, each as one sentence."""

import contextlib
import difflib
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from symtop.core.signals import is_of_user

LONGEST_PART = 255  # bytes of a name in a folder
SHOWN_CHARACTERS = 80  # characters of a name that are shown
ENTRY = "an entry of "  # stands before the name of a row in messages about one of its entries
NETCDF_MAGIC = (b"\x89HDF", b"CDF")  # the first bytes of netCDF files
LONGEST_MESSAGE = 300  # characters that are shown of the message of an error or a process
_COMPILING = "(step: nopython frontend)"  # numba's text before each cause, from the loop inwards; the last is the cause
_TRACE = r",? (?:defined at |raised from |File \"|During: |There are \d+ candidate)"  # what follows a cause


class SymtopError(ValueError):
    """An argument that symtop cannot use.

    The message is one sentence that names the argument, the value it had and what is allowed. `parameters` are the
    names of arguments in the sentence, in whose places the command line writes its options.
    """

    def __init__(self, sentence: object = "", *parameters: str) -> None:
        super().__init__(" ".join(str(sentence).split()))  # some values print in many lines
        self.parameters = parameters

    def renamed(self, names: Mapping[str, str]) -> str:
        """The sentence with other names for its parameters, those that `names` has."""
        sentence = str(self)
        for name in self.parameters:
            sentence = sentence.replace(name, names.get(name, name), 1)
        return sentence


class UnknownNameError(SymtopError):
    """A name that is not among the known ones; `value` is that name."""

    value: object = None


class SymtopWarning(UserWarning):
    """A result that is valid but probably not what its user wants."""


def shown(value: object) -> str:
    """The `repr` of a value, at most 300 characters of it, or if that raises anything, its type."""
    try:
        text = repr(value)
    except Exception:  # noqa: BLE001
        return f"a {type(value).__name__} that cannot be printed"
    return text if len(text) <= LONGEST_MESSAGE else f"{text[:LONGEST_MESSAGE]} ..."


def finite(name: str, value: object, least: float = -math.inf) -> float:
    """Return `value` as a float; refuse anything that is not one finite real number, or is below the least."""
    number = math.nan
    # float() accepts all of these: text, booleans and, below NumPy 2.4, arrays of one entry
    is_array = getattr(value, "ndim", 0) or getattr(getattr(value, "dtype", None), "kind", "") in ("b", "U", "S", "c")
    if not (is_array or isinstance(value, (bool, str, bytes, bytearray)) or type(value).__name__ == "MaskedConstant"):
        with contextlib.suppress(TypeError, ValueError, OverflowError):
            number = value = float(value)  # type: ignore[arg-type]
    if not math.isfinite(number):
        raise SymtopError(f"{name} must be a finite number, not {shown(value)}", name.removeprefix(ENTRY))
    if number < least:
        raise SymtopError(f"{name} must be at least {least:g}, not {number!r}", name)
    return number


def positive(name: str, value: object) -> float:
    """Return `value` as a float; refuse anything that is not finite and above zero."""
    if (number := finite(name, value)) <= 0.0:
        raise SymtopError(f"{name} must be above zero, not {number!r}", name)
    return number


def whole(name: str, value: object, least: int, most: float = math.inf) -> int:
    """Return `value` as an int; refuse anything that is not a whole number from `least` to `most`."""
    number = finite(name, value)
    if number != int(number) or number < least:
        raise SymtopError(f"{name} must be a whole number of at least {least}, not {shown(value)}", name)
    if number > most:
        raise SymtopError(f"{name} must be at most {most:g}, not {shown(value)}", name)
    return int(value)  # type: ignore[call-overload,no-any-return]  # beyond 2^53 a float is another number


def boolean(name: str, value: object) -> bool:
    """Return `value` if it is True or False, also NumPy's."""
    if type(value).__name__ in ("bool", "bool_"):
        return bool(value)
    raise SymtopError(f"{name} must be True or False, not {shown(value)}", name)


def function(name: str, value: Any) -> Any:
    """A callable; SymtopError otherwise."""
    if not callable(value):
        raise SymtopError(f"{name} must be a function, not {shown(value)}", name)
    return value


def file_path(name: str, value: object) -> Path:
    """Return an output's name as a path, ``~`` the user's folder; refuse what can name none, or is in no folder."""
    if isinstance(value, (str, os.PathLike)):
        path = at_home(value)
        with contextlib.suppress(UnicodeEncodeError):  # half a letter, or a byte that is none: netCDF takes neither
            longest = max(len(part.encode()) for part in (f".{path.name}.01234567.part{path.suffix}", *path.parts))
            if path.name and "\0" not in str(path) and longest <= LONGEST_PART:
                if Path(os.path.realpath(path)).parent.is_dir():
                    return path
                raise SymtopError(f"{name} must be in a folder that is there, not {str(value)!r}", name)
    raise SymtopError(f"{name} must be the name of a file, not {shown(value)[:SHOWN_CHARACTERS]}", name)


@contextlib.contextmanager
def writing(path: str | Path) -> Iterator[None]:
    """Turn an OSError of the block into a SymtopError that `path` cannot be written, with the system's reason."""
    try:
        yield
    except OSError as error:
        raise SymtopError(f"cannot write {path}: {error.strerror or error}") from error


def check_replaceable(path: Path) -> None:
    """Raise SymtopError if `path` exists and is no netCDF file, but a script, a device or a folder."""
    if path.is_dir():
        raise SymtopError(f"cannot write {path}: it is a folder")
    head = b""
    if path.is_file():
        with writing(path), path.open("rb") as file:
            head = file.read(4)
    if path.exists() and not head.startswith(NETCDF_MAGIC):
        raise SymtopError(f"cannot write {path}: it is there, and no netCDF file; remove it or name another path")


def at_home(path: str | os.PathLike[str]) -> Path:
    """A path in which a first ``~`` is the user's folder, as a shell reads it; as it stands if nobody has that name."""
    with contextlib.suppress(RuntimeError):
        return Path(path).expanduser()
    return Path(path)


def row(name: str, values: object) -> list[float]:
    """Return `values` as a list of finite floats; refuse anything that is not a row of them."""
    return [finite(f"{ENTRY}{name}", value) for value in entries(name, values, "a row of numbers", set)]


def entries(name: str, values: Any, what: str = "a list of names", *refused: type) -> list[Any]:
    """Return the entries of `values` as a list; refuse text, mappings and what has none, and the types `refused`."""
    with contextlib.suppress(TypeError):  # not iterable, such as an array without dimensions
        if not isinstance(values, (str, bytes, Mapping, *refused)):
            return list(values)
    raise SymtopError(f"{name} must be {what}, not {shown(values)}", name)


def label(name: str, value: object) -> str:
    """Return `value` if it can name a scene or an integrator in a file, a table and a command."""
    if isinstance(value, str) and re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,63}", value):
        return value
    rule = "1 to 64 letters, digits or ._+- (a letter or digit first)"
    raise SymtopError(f"{name} must be {rule}, not {shown(value)}", name)


def one_of(name: str, value: object, allowed: Iterable[str]) -> str:
    """Return `value` if it is one of `allowed`; otherwise raise UnknownNameError, which names the nearest of them."""
    options, word = list(allowed), value.lower() if isinstance(value, str) else ""
    if isinstance(value, str) and value in options:
        return value
    matches = difflib.get_close_matches(word.partition("[")[0], options, n=3, cutoff=0.5)  # of a variant, the method
    names = ", ".join(option or repr(option) for option in options[:12]) + " ..." * (len(options) > 12)
    hint = f"did you mean {' or '.join(matches)}?" if matches else f"known: {names}"
    error = UnknownNameError(f"{name} {shown(value)} is unknown; {hint}", name)
    error.value = value
    raise error


def words_of(error: BaseException) -> str:
    """The type and the message of an error, in one line."""
    try:
        message = " ".join(str(error).split())
    except Exception:  # noqa: BLE001  (its own __str__ may raise anything)
        return f"{type(error).__name__}, which cannot be printed"
    if _COMPILING in message:
        message = re.split(_TRACE, message.rpartition(_COMPILING)[2], maxsplit=1)[0].strip()
        if message.startswith("Untyped global name") and "class 'function'" in message:
            message += "; a function that a kernel calls is decorated with numba.extending.register_jitable"
    cut = message if len(message) <= LONGEST_MESSAGE else f"{message[:LONGEST_MESSAGE]} ..."
    return f"{type(error).__name__}: {cut}" if cut else type(error).__name__


def last_words(output: bytes) -> str:
    """The end of what a process printed, in one line of whole words."""
    words = " ".join(output[-4 * LONGEST_MESSAGE :].decode(errors="replace").split())
    return words if len(words) <= LONGEST_MESSAGE else f"... {words[-LONGEST_MESSAGE:].partition(' ')[2]}"


@contextlib.contextmanager
def foreign_code(what: str, kind: type[SymtopError] = SymtopError) -> Iterator[None]:
    """Turn whatever the block raises into an error of that kind, "`what` failed: ..."; one of that kind passes.

    Also what is no `Exception`, but for those of Ctrl-C and SIGTERM, which pass.
    """
    try:
        yield
    except BaseException as error:
        if isinstance(error, SystemError) and is_of_user(error.__cause__):  # a signal, as compiled code returned
            raise error.__cause__ from None
        if isinstance(error, kind) or is_of_user(error):
            raise
        raise kind(f"{what} failed: {error if isinstance(error, SymtopError) else words_of(error)}") from error
