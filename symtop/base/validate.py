"""Bad input, said in one sentence: what was given, its value, and what is allowed."""

import difflib
import math
import re
from collections.abc import Iterable


class SymtopError(ValueError):
    """An argument that symtop cannot use.

    The message is one sentence that names the argument, the value it had and what is allowed.
    The command line prints it without a traceback and exits with code 2.
    """


class SymtopWarning(UserWarning):
    """A result that is valid but probably not what its user wants."""


def finite(name: str, value: object) -> float:
    """Return `value` as a float; refuse anything that is not one finite real number."""
    if isinstance(value, (bool, str, bytes, bytearray)):  # float() would read a number in them
        raise SymtopError(f"{name} must be a finite number, not {value!r}")
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        raise SymtopError(f"{name} must be a finite number, not {value!r}") from None
    if not math.isfinite(number):
        raise SymtopError(f"{name} must be a finite number, not {number!r}")
    return number


def positive(name: str, value: object) -> float:
    """Return `value` as a float; refuse anything that is not finite and above zero."""
    number = finite(name, value)
    if number <= 0.0:
        raise SymtopError(f"{name} must be above zero, not {number!r}")
    return number


def whole(name: str, value: object, least: int) -> int:
    """Return `value` as an int; refuse anything that is not a whole number of at least `least`."""
    number = finite(name, value)
    if number != int(number) or number < least:
        raise SymtopError(f"{name} must be a whole number of at least {least}, not {value!r}")
    return int(number)


def row(name: str, values: object) -> list[float]:
    """Return `values` as a list of finite floats; refuse anything that is not a row of them."""
    if isinstance(values, (str, bytes, dict)) or not isinstance(values, Iterable):
        raise SymtopError(f"{name} must be a row of numbers, not {values!r}")
    return [finite(f"an entry of {name}", value) for value in values]


def label(name: str, value: object) -> str:
    """Return `value` if it can name a scene or an integrator in a file, a table and a command."""
    if isinstance(value, str) and re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,63}", value):
        return value
    raise SymtopError(f"{name} must be 1 to 64 letters, digits or ._+- (a letter or digit first), not {value!r}")


def one_of(name: str, value: object, allowed: Iterable[str]) -> str:
    """Return `value` if it is one of `allowed`; otherwise name the nearest of them."""
    known = list(allowed)
    if isinstance(value, str) and value in known:
        return value
    near = difflib.get_close_matches(str(value), known, n=3, cutoff=0.5)
    hint = (
        f"did you mean {' or '.join(near)}?" if near else f"known: {', '.join(known[:12])}{' ...' * (len(known) > 12)}"
    )
    raise SymtopError(f"{name} {value!r} is unknown; {hint}")
