"""The declaration of a study; the runner does the rest.

A study is a question, a grid of cases, a function that measures one case, and functions that turn the combined
dataset into figures, tables and sentences. It holds no numerics of its own.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import xarray as xr

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Combined = xr.Dataset | xr.DataTree  # what a study measured: a tree if its cases are in groups


class Picture(NamedTuple):
    """A figure of the report: its file name, caption and text for those who cannot see it."""

    name: str
    figure: "Figure"
    caption: str
    alt: str


class Series(NamedTuple):
    """One line of a chart: an integrator's points (x, y, words shown at the pointer)."""

    integrator: str
    points: Sequence[tuple[float, float, str]]


class Chart(NamedTuple):
    """A log-log chart the reader can point at and filter; the page draws it, beside the figure it repeats.

    ``panels`` holds the series of each choice (a scene, a quantity), the first one shown at first.
    """

    name: str
    title: str
    x: str
    y: str
    panels: Mapping[str, Sequence[Series]]


class Table(NamedTuple):
    """A table of the report; cells are shown as they are."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]


class Opening(NamedTuple):
    """What the page says first: an answer in sentences, and the table they come from."""

    question: str
    sentences: Sequence[str]
    table: Table


@dataclass(frozen=True)
class Case:
    """One cell of a study's grid: an integrator on a scene, with settings that JSON can hold.

    A case may measure several integrators against each other: then its dataset has a dimension ``integrator``,
    `integrator` names them together and ``settings["integrators"]`` lists them.
    A study that measures several different things puts each into a `group` of its own: the study's dataset is then an
    `xarray.DataTree` with one dataset a group (see `store.combine`), each over the scenes and integrators that it has.
    """

    scene: str
    integrator: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    timed: bool = False  # it runs by itself, on a machine that does nothing else
    group: str = ""

    @property
    def label(self) -> str:
        """A name that is safe in a file: ``spheroid--rk4@axis`` for the row rk4[axis]."""
        parts = "--".join(filter(None, (self.scene, self.integrator, self.group)))
        return parts.replace("/", "_").replace("[", "@").replace("]", "")


@dataclass(frozen=True)
class Study:
    """A question and how it is answered.

    `pictures`, `verdict`, `tables`, `charts`, `opening` and `follow_up` get everything that was measured: an
    `xarray.Dataset`, or an `xarray.DataTree` if the cases are in groups.
    """

    name: str
    title: str
    question: str
    how_to_read: str
    cases: Callable[[bool], list[Case]]  # quick -> grid
    measure: Callable[[Case], xr.Dataset]
    pictures: Callable[[Any], list[Picture]]
    verdict: Callable[[Any], list[str]]
    tables: Callable[[Any], list[Table]] = lambda _: []
    charts: Callable[[Any], list[Chart]] = lambda _: []
    opening: Callable[[Any], Opening] | None = None  # for the first screen of the page
    full: Callable[[], list[Case]] | None = None  # a grid that takes much longer, for `--full`
    timed: bool = False  # all cases are
    follow_up: Callable[[Any], list[Case]] | None = None  # a second round, made from what the first one found
    uses: Callable[[Case], Sequence[str]] | None = None  # integrators a case runs; "*" for all; None: found out
    limit: float = 3600.0  # seconds after which a case counts as hanging

    def grid(self, *, quick: bool = False, full: bool = False) -> list[Case]:
        """The cases of the first round: the coarse grid, the ordinary one, or the longest there is."""
        return self.full() if full and self.full is not None else self.cases(quick)

    def is_timed(self, case: Case) -> bool:
        """Must the case run alone, on a machine that does nothing else?"""
        return self.timed or case.timed
