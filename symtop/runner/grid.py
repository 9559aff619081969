"""Which scenes and rows a study runs: all that suit its question, but for those that it leaves out for a reason.

A study does not list its scenes or methods, so that one that is added, to the catalogue or by a user, is in every study
whose question it suits. What a study leaves out, it names with the reason.
"""

from collections.abc import Callable, Iterable, Mapping

from symtop.core.errors import SymtopError, one_of
from symtop.methods.framework.registry import Integrator, integrator, variants
from symtop.model.scenes import Scene, scenes


def grid_scenes(left_out: Mapping[str, Iterable[str]], suits: Callable[[Scene], bool] = lambda _: True) -> list[str]:
    """Names of the scenes of a grid, in the order of the catalogue, a user's own at the end.

    `left_out` maps a reason to the names of the scenes that it keeps out of the study; `suits` says of a scene whether
    the question makes sense for it. Raises SymtopError for a name of no scene and for one that is left out twice.
    """
    known, reasons = scenes(), dict[str, str]()
    for reason, names in left_out.items():
        for name in names:
            if one_of("left_out", name, known) in reasons:
                raise SymtopError(f"scene {name!r} is left out twice: {reasons[name]!r} and {reason!r}")
            reasons[name] = reason
    return [name for name, scene in known.items() if name not in reasons and suits(scene)]


def grid_variants(observe: str, *, attitude: bool = False) -> list[Integrator]:
    """Every method in each of its charts that shows the "nutation" or the "axis": the rows ``method[chart]`` of a grid.

    Where a method has the axis chart, its attitude chart is left out unless `attitude` is true: it steps the same axis
    and angular momentum, and the rotation about the axis besides, which neither quantity depends on.
    """
    return [
        row for row in variants(observe)
        if attitude or row.charts() != ("attitude",) or "axis" not in integrator(row.method).charts()
    ]  # fmt: skip
