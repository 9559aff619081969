"""The figures of the stability study: pages of small maps, one map enlarged, and a figure a mechanism of failure."""

from collections.abc import Iterator

import xarray as xr

from symtop.report.sentences import counted
from symtop.report.style import headline
from symtop.runner.study import Picture

from . import mechanism_figures
from .atlas import common, families, maps
from .atlas_figures import by_area, enlarged, small_maps
from .atlas_words import advice, caption, page_message
from .tables import PERIODS

FAMILIAR = "stormer-verlet[angles]"  # the map that is enlarged, if it is there
CONTROLLED = {"step_size": "steps", "tolerance": "tolerances"}  # the pages of maps, by what grows to the right


def pictures(data: xr.Dataset) -> Iterator[Picture]:
    """All figures that the dataset has something for, one after the other: with a plug-in they are more than twenty."""
    for family in families(data):
        yield _enlarged(data, family)
        yield from _pages(data, family, "spin", f"atlas-{family}")
    yield from _pages(data, "grazing", "gap", "atlas-pole")
    yield from mechanism_figures.pictures(data)


def _pages(data: xr.Dataset, scene: str, over: str, name: str) -> Iterator[Picture]:
    """The small maps of a scene, a page for methods with a step and one for those with a tolerance."""
    for control, title in CONTROLLED.items():
        shown = {row: one for row, one in maps(data, scene).items() if one.control == control}
        if not shown:
            continue
        names = by_area(common(shown))
        figure = small_maps(data, scene, names, over)
        headline(figure, page_message(data, scene, shown))
        count = counted(len(names), "small map")
        alt = f"{count} of outcomes, from {names[0]}, accurate in the largest part of its map, to {names[-1]}."
        yield Picture(f"{name}-{title}", figure, caption(data, scene, names), alt)


def _enlarged(data: xr.Dataset, family: str) -> Picture:
    shown = maps(data, family)
    name = FAMILIAR if FAMILIAR in shown else by_area(shown)[0]
    right, past = shown[name].shares[0], maps(data, "grazing").get(name)
    beside = "" if past is None else f" with its spin changed and in {past.shares[0]:.0%} past a pole"
    message = f"{name} is accurate in {right:.0%} of the map of {family}{beside}"
    figure = enlarged(data, family, name, message)
    what = "" if past is None else ", and right a fall of the scene grazing past a pole"
    text = (
        f"How to read a map of the atlas: one variant, method[chart], enlarged. Left the scene {family} over "
        f"{PERIODS:g} nutation periods with another spin{what}; all else is held fixed. "
        f"{advice(data, family)[name].sentence}"
    )
    return Picture(f"atlas-{family}-enlarged", figure, text, f"Two maps of the outcomes of {name}, enlarged.")
