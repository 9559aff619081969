"""The declaration of a study: a question, a grid of cases, a function that measures one case, and functions that turn
the combined dataset into facts, figures and tables. The runner does the rest; what is said of them is in a template.
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
Save = Callable[["Figure", Path], object]  # writes a picture's figure to a file
LONGEST = 120  # characters of a value that are shown


class StudyError(SymtopError):
    """A function of a study failed or returned what it must not; the names in the sentence are the study's own."""


def failing(study: str, function: str) -> AbstractContextManager[None]:
    """Within it, whatever a function of a study raises becomes a StudyError that names both."""
    return foreign_code(f"study {study}: {function}", StudyError)


def each(study: str, function: str, make: Callable[[], Any], kind: type, form: str) -> Iterator[Any]:
    """What a function of a study returns or yields, one by one, each of which must be of that kind."""
    with failing(study, function):
        answer = make()
    if isinstance(answer, (str, bytes, Mapping, kind)) or not isinstance(answer, Iterable):
        raise StudyError(f"study {study}: {function} must return {form}, not {shown(answer)[:LONGEST]}")
    entries, end = iter(answer), object()
    while True:
        with failing(study, function):
            entry = next(entries, end)
        if entry is end:
            return
        if not isinstance(entry, kind):
            raise StudyError(f"study {study}: {function} must return {form}; an entry is a {type(entry).__name__}")
        yield entry


class Picture(NamedTuple):
    """A figure of the report and its file name; its title, caption and text for the blind stand in the template."""

    name: str
    figure: "Figure"


class Series(NamedTuple):
    """One line of a chart: an integrator's points (x, y or more numbers, words shown at the pointer)."""

    integrator: str
    points: Sequence[tuple[Any, ...]]


class Chart(NamedTuple):
    """A log-log chart the reader can point at and filter; the page draws it, beside the figure it repeats.

    ``panels`` holds the series of each choice (a scene, a quantity), the first one shown at first; `choices` says what
    each part between ``" | "`` of their names chooses. `x` and `y` name the axes, or each is a choice of columns: of
    places in a point, by their names. `marks` are, by panel, the x of a vertical line, the exact motion without an
    integrator, and the y below which the truth cannot judge, both for the first columns.
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
    timed: bool = False  # untimed cases must not run beside it, nor timed ones that disturb it
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
                allowed = "numbers of Python, text, lists or mappings, which JSON can hold"
                raise SymtopError(f"setting {key!r} must be {allowed}, not {shown(value)[:LONGEST]}") from None

    @property
    def integrators(self) -> tuple[str, ...]:
        """The integrators that it measures: its own, or those that its settings list."""
        return self.integrator, *self.settings.get("integrators", ())

    @property
    def label(self) -> str:
        """A name that is safe in a file: ``spheroid--rk4@axis`` for the variant rk4[axis]."""
        parts = "--".join(filter(None, (self.scene, self.integrator, self.group)))
        return parts.replace("/", "_").replace("[", "@").replace("]", "")


@dataclass(frozen=True)
class Study:
    """A question and how it is answered.

    `facts`, `tables`, `pictures`, `charts` and `follow_up` get everything that was measured. Facts are numbers or
    names by name, None for what was not measured. Tables are stored as CSV. Each picture is saved and closed before the
    next one is drawn, if `pictures` draws them one by one. A template beside the study says what they show
    (`symtop.report.template`).
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
    timed: bool = False  # all cases are
    follow_up: Callable[[Any], list[Case]] | None = None  # a second round, made from what the first one found
    uses: Callable[[Case], Sequence[str]] | None = None  # integrators a case runs; "*": all; None: `integrators`
    limit: float = 3600.0  # seconds after which a case counts as hanging

    def __post_init__(self) -> None:
        label("name of a study", self.name)  # its files are named after it

    def grid(self, *, quick: bool = False, full: bool = False) -> list[Case]:
        """The cases of the first round: the coarse grid, the ordinary one, or the longest there is."""
        longest = self.full if full else None
        return self._listed("cases", lambda: self.cases(quick)) if longest is None else self._listed("full", longest)

    def later(self, data: Combined) -> list[Case]:
        """The cases of the second round, which a study with a `follow_up` has."""
        return self._listed("follow_up", lambda: self.follow_up and self.follow_up(data))

    def _listed(self, function: str, make: Callable[[], Any]) -> list[Case]:
        return list(each(self.name, function, make, Case, "a list of Case"))

    def is_timed(self, case: Case) -> bool:
        """Are times measured in the case, so that nothing may run beside it that disturbs them?"""
        return self.timed or case.timed

    def only(self, names: Collection[str]) -> "Study":
        """The same study with the cases of some methods, or variants, alone; SymtopError if it has none of them.

        A case that measures several integrators against each other stays whole if one of them is named, and one of
        the closed form, which others are measured by, stays in any case.
        """
        methods = {*names, REFERENCE}

        def select(cases: list[Case]) -> list[Case]:
            return [
                case
                for case in self._listed("cases", lambda: cases)
                if any({name, split_name(name)[0]} & methods for name in case.integrators)
            ]

        def first(quick: bool) -> list[Case]:
            cases = select(self.cases(quick))
            alone = all({*case.integrators} <= {REFERENCE} for case in cases)
            if not cases or (alone and REFERENCE not in names):
                raise StudyError(f"study {self.name} has no case of {', '.join(names)}")
            return cases

        def able(answer: Callable[[Any], Any] | None) -> Any:
            def answered(data: Any) -> Any:
                try:
                    return answer(data)  # type: ignore[misc]
                except StudyError:
                    raise
                except Exception as error:
                    sentence = f"study {self.name} compares methods and has no answer with {', '.join(names)} alone"
                    raise StudyError(f"{sentence}; name more of them") from error

            return answer and answered

        full, follow_up = self.full, self.follow_up
        answers = {name: able(getattr(self, name)) for name in ("facts", "pictures", "tables", "charts")}
        return replace(
            self, cases=first, full=full and (lambda: select(full())),
            follow_up=follow_up and (lambda data: select(follow_up(data))), **answers,
        )  # fmt: skip
