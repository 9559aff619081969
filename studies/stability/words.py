"""What the stability study says in words and tables, all of it from its dataset."""

import xarray as xr

from symtop.runner.study import Table

from .atlas import families
from .atlas_words import all_advice, summary
from .mechanism_words import limit_table, mechanism_sentences

HOW_TO_READ = (
    "A map has one cell a run. To the right the step or the tolerance grows; upwards the spin r, or the gap delta "
    "between path and pole. Green is accurate. Yellow has bounded energy and a wrong phase. Hatched cells lose energy, "
    "cross a turning point of the true motion, or end early. Solid lines: the linear limit, the step beyond which "
    "small nutations about a steady precession grow. Dashed lines: the step that advances such a nutation by a third "
    "of a turn. A limit for fast tops (r > 3) or slow tops (r < 1) holds for nine rows in ten; a method first fails in "
    "some way at the smallest step or tolerance at which one row in twenty does."
)


def sentences(data: xr.Dataset) -> list[str]:
    """How far the methods go, how they fail, and whether each mechanism is what theory says."""
    atlas = [sentence for family in families(data) for sentence in summary(data, family)]
    return atlas + mechanism_sentences(data)


def tables(data: xr.Dataset) -> list[Table]:
    """The atlas in words, and the limits in numbers."""
    shown = []
    for family in families(data):
        lines = [[line.integrator, line.use, line.fails] for line in all_advice(data, family).values()]
        shown.append(Table(f"The atlas in words: {family}", ["integrator", "use it", "it fails"], lines))
    limits = limit_table(data)
    return [*shown, limits] if limits else shown
