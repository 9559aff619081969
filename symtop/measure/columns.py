"""Long names, units and flags of the columns of stored datasets, as in the CF conventions; each is declared once.

Columns of several datasets are declared in `symtop/core/variables.tsv`, errors in `symtop.measure.errors.ERRORS`.
Columns of one study are declared in ``columns.tsv`` beside it, or in NAME.tsv beside a user's own study NAME.py. A
table has five cells a line, separated by tabs (`netcdf.read_columns`):

    variable        its name, or group/name: without a group, of every group of the study that does not have its own
    units           in SI; "1" for a pure number, empty for text; computing times are in seconds whatever the scene
    without_units   the units on a scene without physical units, where they differ
    flags           meanings of coded numbers: "0 no, 1 yes"
    long_name       what the column holds; for an error, of which quantity and against which reference
"""

from collections.abc import Collection, Mapping
from types import MappingProxyType

import numpy as np

from symtop.core import netcdf
from symtop.measure.errors import ERRORS, against

ERROR_TABLE = {
    f"{name}{end}": (words.format(what), unit)
    for name, (what, unit) in ERRORS.items()
    for end, words in (
        ("", "largest {} over the run"),
        ("_end", "{} at the horizon"),
        ("_bound", "least {} that the reference can tell from none, largest over the run"),
    )
}


def described(
    data: netcdf.Tree, units: str = "", own: Mapping[str, netcdf.Column] = MappingProxyType({}),
    of_body: Collection[bool] = (False,),
) -> netcdf.Tree:  # fmt: skip
    """Give the variables of a dataset, in groups too, their long names, units and flags.

    `own` is the table of the study. A group with an ``axis_bound`` is an error table. A variable that no table declares
    keeps its attributes. `units` is that of `netcdf.describe`; `of_body` has `Scene.of_body` of each scene.
    """
    for group, variables in ((path, table.variables) for path, table in netcdf.groups(data).items()):
        entries = netcdf.VARIABLES | (ERROR_TABLE if "axis_bound" in variables else {})
        for name, variable in variables.items():
            column = own.get(f"{group}/{name}", own.get(str(name)))
            if column or (name in entries and "long_name" not in variable.attrs):
                words, *unit = column.entry if column else entries[str(name)]
                variable.attrs.update(netcdf.label((against(words, of_body), *unit), units, " in units of the scene"))
            if column and column.flags:
                values = np.array(list(column.flags), variable.dtype)
                variable.attrs.update(flag_values=values, flag_meanings=" ".join(column.flags.values()))
    return data
