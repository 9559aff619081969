"""Format numbers, lists and tables for the report and the command line; the filters of templates."""

import math
import re
from collections.abc import Mapping, Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from typing import Any

NO_BREAK = "\N{NO-BREAK SPACE}"
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
LARGEST_PLAIN = 1e4  # larger numbers are written with a power of ten
MOST_COUNTED = 1e9  # larger whole numbers are not written as counts
MOST_NAMES = 4  # most names in a sentence; the others are counted
PRINTED = re.compile(  # matches code, links and comments (kept), numbers such as 1e-06, and "us" after a number
    r"(?P<same>`[^`]*`|\]\([^)]*\)|<!--.*?-->)|(?<![\w.])(?P<mantissa>\d(?:\.\d+)?)e(?P<power>[-+]?\d{1,3})(?!\w)"
    r"|(?:(?<=\d[ \N{NO-BREAK SPACE}])|(?<=\| )|(?<=\())us\b"
)
UNITS = ((1e-9, "ns"), (1e-6, "µs"), (1e-3, "ms"), (1.0, "s"), (60.0, "min"), (3600.0, "h"))  # of times, in seconds


def number(value: float, digits: int = 2, unit: str = "") -> str:
    """A number with `digits` significant digits, and its unit: ``10⁻⁶ rad``, ``1.4 × 10⁻¹³``, ``0.012``, ``340``."""
    rounded = float(f"{value:.{digits}g}")
    text = f"{value:.{digits}g}" if not 10.0**digits <= abs(rounded) < LARGEST_PLAIN else f"{value:.0f}"
    printed = typeset(text)
    return f"{printed}{NO_BREAK}{unit}" if unit else printed


def typeset(text: str) -> str:
    """A text with numbers in the form of `number`, ``10⁻⁶`` for 1e-06, and ``µs`` for us; not in code and links."""

    def printed(match: re.Match[str]) -> str:
        if match["same"] or not match["power"]:
            return match["same"] or "µs"
        ten = f"10{str(int(match['power'])).translate(SUPERSCRIPTS)}"
        return ten if match["mantissa"] == "1" else f"{match['mantissa']}{NO_BREAK}×{NO_BREAK}{ten}"

    return PRINTED.sub(printed, text)


def at_most(value: float, digits: int = 2, unit: str = "") -> str:
    """`number` of an upper bound, rounded up: ``1.3`` for 1.249."""
    upward = Context(prec=digits, rounding=ROUND_CEILING).create_decimal(repr(float(value)))
    return number(float(upward), digits, unit)


def at_least(value: float, digits: int = 2, unit: str = "") -> str:
    """`number` of a lower bound, rounded down: ``0.95`` for 0.958."""
    downward = Context(prec=digits, rounding=ROUND_FLOOR).create_decimal(repr(float(value)))
    return number(float(downward), digits, unit)


def count(value: float) -> str:
    """A whole number with separated thousands: ``12,345``."""
    return f"{value:,.0f}"


def percent(value: float, digits: int = 0) -> str:
    """A share as a percentage: ``31 %``."""
    return f"{100.0 * value:.{digits}f}{NO_BREAK}%"


def power(value: float) -> str:
    """The power of ten nearest to a positive number: ``10⁻⁶``."""
    return f"10{str(round(math.log10(value))).translate(SUPERSCRIPTS)}"


def fixed(value: float, digits: int = 2, unit: str = "") -> str:
    """A number with `digits` digits after the point: ``1.90``."""
    return f"{value:.{digits}f}{NO_BREAK}{unit}" if unit else f"{value:.{digits}f}"


def duration(seconds: float, digits: int = 2) -> str:
    """A time, given in seconds, in a suitable unit: ``5.4 µs``, ``176 µs``, ``4.8 ms``, ``2 h``."""
    size, unit = next((pair for pair in reversed(UNITS) if abs(seconds) >= pair[0]), UNITS[0])
    return number(seconds / size, digits, unit)


def code(name: str) -> str:
    """A name as code in Markdown."""
    return f"`{name}`"


def by_name(pairs: Sequence[tuple[str | None, str]], link: str = "to") -> str | None:
    """Group pairs (name, value) by name: ```a` to 10⁻³, and `b` to 10⁻⁶ and 10⁻⁹``; None if one name is None."""
    groups: dict[str | None, list[str]] = {}
    for name, value in pairs:
        groups.setdefault(name, []).append(value)
    if None in groups:
        return None
    parts = [f"{code(str(name))} {link} {listed(what)}" for name, what in groups.items()]
    return ", and ".join(filter(None, [", ".join(parts[:-1]), parts[-1]]))


def cell(value: Any, digits: int = 3) -> str:
    """The text of a cell of a table: a number with `digits` significant digits; empty for None and NaN."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        is_count = math.isfinite(value) and float(value).is_integer() and abs(value) < MOST_COUNTED
        return count(value) if is_count else number(value, digits)
    return str(value)


FILTERS = (number, at_most, at_least, count, percent, power, fixed, duration, code, by_name, cell)


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table as GitHub-flavoured Markdown."""
    escaped = [[cell.replace("|", "\\|").replace("<", "\\<") for cell in row] for row in [header, *rows]]
    lines = [f"| {' | '.join(row)} |" for row in escaped]
    return "\n".join([lines[0], "|" + "---|" * len(header), *lines[1:]])


def columns(records: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[list[Any]]]:
    """Header and rows of a table of records, which all have the same keys."""
    return list(records[0]), [list(record.values()) for record in records]


def listed(names: Sequence[str]) -> str:
    """A list for a sentence: ``a, b and c``."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def abridged(names: Sequence[str], most: int = MOST_NAMES) -> str:
    """The first `most` names of a list for a sentence, and the number of the others."""
    return listed([*names[:most], f"{len(names) - most} more"] if len(names) > most else names or ["none"])


def counted(count: int, noun: str = "variant") -> str:
    """A count with its noun: ``1 variant``, ``12 variants``."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
