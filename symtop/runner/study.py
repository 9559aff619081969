"""The declaration of a study: a question, a grid of cases, a function that measures one case, and functions that turn
the combined dataset into facts, figures and tables. The runner does the rest; the text of its page is in a template.
"""

import json
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import xarray as xr

from symtop.core.errors import SymtopError, foreign_code, label, shown
from symtop.measure.datasets import Combined
from symtop.methods.framework.registry import split_name

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

REFERENCE = "exact"  # the integrator that is the closed form
Save = Callable[["Figure", Path], object]  # writes a figure to a file
LONGEST = 120  # characters of a value in a message


class StudyError(SymtopError):
    """A function of a study raised an exception or returned an invalid value; the message names study and function."""


def failing(study: str, function: str) -> AbstractContextManager[None]:
    """A context in which an exception of a study's function becomes a StudyError that names study and function."""
    return foreign_code(f"study {study}: {function}", StudyError)


def each(study: str, function: str, make: Callable[[], Any], kind: type, form: str) -> Iterator[Any]:
    """The entries that a function of a study returns or yields; StudyError unless each is of that `kind`."""
    with failing(study, function):
        result = make()
    if isinstance(result, (str, bytes, Mapping, kind)) or not isinstance(result, Iterable):
        raise StudyError(f"study {study}: {function} must return {form}, not {shown(result)[:LONGEST]}")
    entries, end = iter(result), object()
    while True:
        with failing(study, function):
            entry = next(entries, end)
        if entry is end:
            return
        if not isinstance(entry, kind):
            raise StudyError(f"study {study}: {function} must return {form}; an entry is a {type(entry).__name__}")
        yield entry


class Picture(NamedTuple):
    """A figure of the report and its file name; its title, caption and alternative text are in the template."""

    name: str
    figure: "Figure"


class Series(NamedTuple):
    """One line of a chart: an integrator's points, each (x, y or more numbers, text shown at the pointer)."""

    integrator: str
    points: Sequence[tuple[Any, ...]]


class Chart(NamedTuple):
    """An interactive log-log chart, which the page draws below the figure with the same data.

    `panels` holds the series of each choice (a scene, a quantity), the first one shown at first; `choices` labels the
    parts of their names, which ``" | "`` separates. `x` and `y` name the axes, or map names to indices of columns in a
    point, to choose from. `marks` has, by panel, the x of a vertical line (the exact motion) and the y below which the
    reference cannot judge errors, both for the first columns.
    """

    name: str
    title: str
    x: str | Mapping[str, int]
    y: str | Mapping[str, int]
    panels: Mapping[str, Sequence[Series]]
    choices: Sequence[str] = ("Show",)
    marks: Mapping[str, tuple[float, float]] = MappingProxyType({})


@dataclass(frozen=True)
class Case:
    """One cell of a study's grid: an integrator on a scene, with settings that JSON can hold, or SymtopError.

    A case may measure several integrators against each other: then its dataset has a dimension ``variant``,
    `integrator` names them together and ``settings["integrators"]`` lists them. Cases of several kinds have a `group`
    each: the study's dataset is then an `xarray.DataTree` with one dataset a group (`symtop.measure.datasets.combine`).
    """

    scene: str
    integrator: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    timed: bool = False  # does it measure times? then no untimed case runs at the same time
    group: str = ""

    def __post_init__(self) -> None:
        for name in ("scene", "integrator", "group"):
            if not isinstance(value := getattr(self, name), str):
                raise SymtopError(f"{name} must be a name, not {shown(value)[:LONGEST]}")
        if not isinstance(self.settings, Mapping):
            raise SymtopError(f"settings must be a mapping of names to values, not {shown(self.settings)[:LONGEST]}")
        for key, value in self.settings.items():
            if not isinstance(key, str):
                raise SymtopError(f"the name of a setting must be text, not {shown(key)[:LONGEST]}")
            try:
                json.dumps(value)
            except (TypeError, ValueError, RecursionError):
                rule = "numbers of Python, text, lists or mappings, which JSON can hold"
                raise SymtopError(f"setting {key!r} must be {rule}, not {shown(value)[:LONGEST]}") from None

    @property
    def integrators(self) -> tuple[str, ...]:
        """The integrators that it measures: its own, and those that its settings list."""
        return self.integrator, *self.settings.get("integrators", ())

    @property
    def label(self) -> str:
        """A name that is safe in a file: ``spheroid--rk4@axis`` for the variant rk4[axis]."""
        parts = "--".join(filter(None, (self.scene, self.integrator, self.group)))
        return parts.replace("/", "_").replace("[", "@").replace("]", "")


@dataclass(frozen=True)
class Study:
    """The declaration of a study.

    `facts`, `tables`, `pictures`, `charts` and `follow_up` are called with the combined dataset. Facts are numbers or
    text by name, None if not measured. Tables are stored as CSV. If `pictures` is a generator, each picture is saved
    and closed before the next one is drawn. A template beside the study has the text (`symtop.report.template`).
    """

    name: str
    title: str
    question: str
    cases: Callable[[bool], list[Case]]  # quick -> grid
    measure: Callable[[Case], xr.Dataset]
    facts: Callable[[Any], Mapping[str, Any]] | None = None
    pictures: Callable[[Any], Iterable[Picture]] = lambda _: []
    tables: Callable[[Any], Mapping[str, "pd.DataFrame"]] = lambda _: {}
    charts: Callable[[Any], list[Chart]] = lambda _: []
    full: Callable[[], list[Case]] | None = None  # a grid that takes much longer, for `--full`
    timed: bool = False  # are all cases timed?
    follow_up: Callable[[Any], list[Case]] | None = None  # cases of a second round, from the dataset of the first
    uses: Callable[[Case], Sequence[str]] | None = None  # integrators a case runs; "*": all; None: `integrators`
    limit: float = 3600.0  # seconds after which a case is ended

    def __post_init__(self) -> None:
        label("name of a study", self.name)  # its files are named after it

    def grid(self, *, quick: bool = False, full: bool = False) -> list[Case]:
        """The cases of the first round: of the coarse grid, of the usual one, or of the `full` one if there is one."""
        longest = self.full if full else None
        return self._listed("cases", lambda: self.cases(quick)) if longest is None else self._listed("full", longest)

    def later(self, data: Combined) -> list[Case]:
        """The cases of the second round; a study has one if it has a `follow_up`."""
        return self._listed("follow_up", lambda: self.follow_up and self.follow_up(data))

    def _listed(self, function: str, make: Callable[[], Any]) -> list[Case]:
        return list(each(self.name, function, make, Case, "a list of Case"))

    def is_timed(self, case: Case) -> bool:
        """Does the case measure times, so that nothing may run beside it that disturbs them?"""
        return self.timed or case.timed

    def only(self, names: Collection[str]) -> "Study":
        """The study with only the cases of some methods or variants; StudyError if it has none of them.

        A case that measures several integrators against each other stays if one of them is named; cases of the closed
        form, the reference of others, always stay.
        """
        methods = {*names, REFERENCE}

        def select(cases: list[Case]) -> list[Case]:
            return [
                case
                for case in self._listed("cases", lambda: cases)
                if any({name, split_name(name)[0]} & methods for name in case.integrators)
            ]

        def selected(quick: bool) -> list[Case]:
            cases = select(self.cases(quick))
            only_reference = all({*case.integrators} <= {REFERENCE} for case in cases)
            if not cases or (only_reference and REFERENCE not in names):
                raise StudyError(f"study {self.name} has no case of {', '.join(names)}")
            return cases

        def guarded(function: Callable[[Any], Any] | None) -> Any:
            def wrapper(data: Any) -> Any:
                try:
                    return function(data)  # type: ignore[misc]
                except StudyError:
                    raise
                except Exception as error:
                    sentence = f"study {self.name} compares methods and has no answer with {', '.join(names)} alone"
                    raise StudyError(f"{sentence}; name more of them") from error

            return function and wrapper

        full, follow_up = self.full, self.follow_up
        answers = {name: guarded(getattr(self, name)) for name in ("facts", "pictures", "tables", "charts")}
        return replace(
            self, cases=selected, full=full and (lambda: select(full())),
            follow_up=follow_up and (lambda data: select(follow_up(data))), **answers,
        )  # fmt: skip
