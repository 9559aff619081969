"""Long names, units and flags of the columns of stored datasets, as CF has them; each column is declared once.

What several datasets have is declared here, errors in `symtop.measure.errors.ERRORS`, variables of a trajectory in
`symtop.core.netcdf.VARIABLES`. Columns of one study stand beside it in ``columns.tsv``, or NAME.tsv beside a study of
one's own in NAME.py, five cells a line, separated by tabs:

    variable        its name, or group/name: without a group, of every group of the study that does not have its own
    units           in SI, "1" of a pure number, none of text; seconds of a machine are seconds in any scene
    without_units   of a problem without units, where they differ
    flags           of numbers that stand for words: "0 no, 1 yes"
    long_name       what it is; of an error, of what and against what
"""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from symtop.core import netcdf
from symtop.core.errors import SymtopError
from symtop.measure.errors import ERRORS

CELLS = 4  # behind the name
ANY: dict[str, tuple[str, ...]] = {
    "scene": ("name of the scene",),
    "variant": ("name of the variant: a method in one chart, method[chart]",),
    "integrator": ("name of the integrator",),
    "chart": ("chart that the variant steps in",),
    "implementation": ("is the method compiled, or in plain Python?",),
    "control": ("what sets the accuracy of the variant: step_size, tolerance, or nothing",),
    "quantity": ("quantity whose error is judged",),
    "seconds": ("time of a run, the smallest of its samples", "s"),
    "seconds_samples": ("time of a run, every sample", "s"),
    "spread": ("spread of the samples of a time: (median - minimum) / minimum", "1"),
    "first_call": ("time of the first call, with compilation", "s"),
    "sample_time": ("time of a sample since the start", "s", "1"),
    "seconds_spread": ("spread of the samples of a time: (median - smallest) / smallest", "1"),
    "exact_seconds": ("time of the exact motion, the smallest of its samples", "s"),
    "steps_per_nutation": ("steps in a nutation", "1"),
    "reached": ("was the target met? or why not",),
    "message": ("why a run could not be made",),
    "made_of": ("digest of all that the numbers of a cell depend on",),
}
ERROR_TABLE = {
    f"{name}{end}": (words.format(what), unit)
    for name, (what, unit) in ERRORS.items()
    for end, words in (
        ("", "largest {} over the run"),
        ("_end", "{} at the horizon"),
        ("_bound", "least {} that the reference can tell from none, largest over the run"),
    )
}


class Column(NamedTuple):
    """A line of the table of a study."""

    entry: tuple[str, ...]  # as in `netcdf.VARIABLES`
    flags: dict[int, str]


def read(file: Path | None) -> dict[str, Column]:
    """The table in a file, empty without one; SymtopError for a line that declares no column, or one again."""
    table: dict[str, Column] = {}
    lines = [] if file is None else file.read_text(encoding="utf-8").splitlines()
    for place, line in enumerate(lines[1:], 2):
        name, *cells = line.split("\t")
        column = _column(cells)
        if column is None or not name or name in table:
            wanted = "a variable that no other line has, its units, those without units, flags, and its long name"
            raise SymtopError(f"{file}: line {place} must be {wanted}, between tabs, not {line!r}")
        table[name] = column
    return table


def _column(cells: list[str]) -> Column | None:
    if len(cells) != CELLS or not cells[-1]:
        return None
    units, without, flags, long_name = cells
    pairs = [flag.split() for flag in flags.split(",") if flag]
    if any(len(pair) != 2 or not pair[0].isdigit() for pair in pairs):
        return None
    return Column((long_name, *filter(None, (units, without))), {int(number): word for number, word in pairs})


def described(data: netcdf.Tree, units: str = "", own: Mapping[str, Column] = MappingProxyType({})) -> netcdf.Tree:
    """Give the variables of a dataset, in groups too, their long names, units and flags.

    `own` is the table of the study. A group with an ``axis_bound`` is an error table. What no table declares keeps the
    name that it may have been given. `units` are those of `netcdf.describe`.
    """
    for group, variables in ((path, one.variables) for path, one in netcdf.groups(data).items()):
        known = netcdf.VARIABLES | ANY | (ERROR_TABLE if "axis_bound" in variables else {})
        for name, variable in variables.items():
            column = own.get(f"{group}/{name}", own.get(str(name)))
            if column or (name in known and "long_name" not in variable.attrs):
                entry = column.entry if column else known[str(name)]
                variable.attrs.update(netcdf.label(entry, units, " in units of the scene"))
            if column and column.flags:
                values = np.array(list(column.flags), variable.dtype)
                variable.attrs.update(flag_values=values, flag_meanings=" ".join(column.flags.values()))
    return data
