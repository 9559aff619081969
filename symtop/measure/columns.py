"""Long names, units and flags of the columns of stored datasets, as CF has them; each column is declared once.

What several datasets have stands in `symtop/core/variables.tsv`, errors in `symtop.measure.errors.ERRORS`. Columns of
one study stand beside it in ``columns.tsv``, or NAME.tsv beside a study of one's own in NAME.py. A table has five cells
a line, separated by tabs (`netcdf.read_columns`):

    variable        its name, or group/name: without a group, of every group of the study that does not have its own
    units           in SI, "1" of a pure number, none of text; seconds of a machine are seconds in any scene
    without_units   of a problem without units, where they differ
    flags           of numbers that stand for words: "0 no, 1 yes"
    long_name       what it is; of an error, of what and against what
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

    `own` is the table of the study. A group with an ``axis_bound`` is an error table. What no table declares keeps the
    name that it may have been given. `units` are those of `netcdf.describe`; `of_body` says whether scenes are bodies.
    """
    for group, variables in ((path, one.variables) for path, one in netcdf.groups(data).items()):
        known = netcdf.VARIABLES | (ERROR_TABLE if "axis_bound" in variables else {})
        for name, variable in variables.items():
            column = own.get(f"{group}/{name}", own.get(str(name)))
            if column or (name in known and "long_name" not in variable.attrs):
                words, *choice = column.entry if column else known[str(name)]
                variable.attrs.update(netcdf.label((against(words, of_body), *choice), units, " in units of the scene"))
            if column and column.flags:
                values = np.array(list(column.flags), variable.dtype)
                variable.attrs.update(flag_values=values, flag_meanings=" ".join(column.flags.values()))
    return data
