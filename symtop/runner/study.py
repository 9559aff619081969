"""The declaration of a study; the runner does the rest.

A study is a question, a grid of cases, a function that measures one case, and functions that turn the combined
dataset into figures, tables and sentences. It holds no numerics of its own.
"""

import json
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType, TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple

import xarray as xr

from symtop.core.errors import SymtopError, label, shown, words_of
from symtop.core.signals import is_of_user
from symtop.methods.framework.registry import split_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REFERENCE = "exact"  # the integrator that is the closed form
Combined = xr.Dataset | xr.DataTree  # what a study measured: a tree if its cases are in groups
LONGEST = 120  # characters of a value that is told


class StudyError(SymtopError):
    """A function of a study failed or returned what it must not; the names in the sentence are the study's own."""


class door:
    """Within it, whatever a function of a study raises becomes a StudyError that names both."""

    __slots__ = ("function", "study")

    def __init__(self, study: str, function: str) -> None:
        self.study, self.function = study, function

    def __enter__(self) -> None:
        return None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None and not isinstance(error, StudyError) and not is_of_user(error):
            words = error if isinstance(error, SymtopError) else words_of(error)
            raise StudyError(f"study {self.study}: {self.function} failed: {words}") from error

    def refuse(self, wanted: str, given: object) -> StudyError:
        """The sentence on what the function returned."""
        text = " ".join(shown(given).split())
        told = text if len(text) <= LONGEST else f"{text[:LONGEST]} ..."
        return StudyError(f"study {self.study}: {self.function} must return {wanted}, not {told}")

    def each(self, make: Callable[[], Any], kind: type, wanted: str) -> Iterator[Any]:
        """What the function returns or yields, one by one, each of which must be of that kind."""
        with self:
            made = make()
        if isinstance(made, (str, bytes, Mapping, kind)) or not isinstance(made, Iterable):
            raise self.refuse(wanted, made)
        entries, nothing = iter(made), object()
        while True:
            with self:
                entry = next(entries, nothing)
            if entry is nothing:
                return
            if not isinstance(entry, kind):
                raise StudyError(
                    f"study {self.study}: {self.function} must return {wanted}; an entry is a {type(entry).__name__}"
                )
            yield entry


def sentences(study: str, verdict: Callable[[], Any]) -> list[str]:
    """The findings that the verdict of a study returns. Raises StudyError if they are no list of sentences."""
    return list(door(study, "verdict").each(verdict, str, "a list of sentences"))


class Picture(NamedTuple):
    """A figure of the report: its file name, caption and text for those who cannot see it.

    One with a `lead` opens the report: it is shown small on the first screen, in the order of the studies, under these
    few words on what it answers.
    """

    name: str
    figure: "Figure"
    caption: str
    alt: str
    lead: str = ""


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
    """What the page says first: an answer in sentences, the table they come from, and the studies that explain it."""

    question: str
    sentences: Sequence[str]
    table: Table
    explained: Mapping[str, str] = MappingProxyType({})  # by studies, with what they are called here


@dataclass(frozen=True)
class Case:
    """One cell of a study's grid: an integrator on a scene, with settings that JSON can hold.

    A case may measure several integrators against each other: then its dataset has a dimension ``variant``,
    `integrator` names them together and ``settings["integrators"]`` lists them.
    A study that measures several different things puts each into a `group` of its own: the study's dataset is then an
    `xarray.DataTree` with one dataset a group (see `store.combine`), each over the scenes and integrators that it has.
    """

    scene: str
    integrator: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    timed: bool = False  # untimed cases must not run beside it, nor timed ones that disturb it
    group: str = ""

    @property
    def integrators(self) -> tuple[str, ...]:
        """The integrators that it measures: its own, or those that its settings list."""
        return self.integrator, *self.settings.get("integrators", ())

    @property
    def names(self) -> tuple[str, ...]:
        """The scene and the integrators."""
        return self.scene, *self.integrators

    def flaw(self) -> str:
        """What of it cannot be stored or compared, in words; empty if nothing is wrong."""
        for name in ("scene", "integrator", "group"):
            if not isinstance(value := getattr(self, name), str):
                return f"{name} must be a name, not {shown(value)[:LONGEST]}"
        if not isinstance(self.settings, Mapping):
            return f"settings must be a mapping of names to values, not {shown(self.settings)[:LONGEST]}"
        for key, value in self.settings.items():
            if not isinstance(key, str):
                return f"the name of a setting must be text, not {shown(key)[:LONGEST]}"
            try:
                json.dumps(value)
            except (TypeError, ValueError, RecursionError):
                held = "numbers of Python, text, lists or mappings, which JSON can hold"
                return f"setting {key!r} must be {held}, not {shown(value)[:LONGEST]}"
        return ""

    @property
    def label(self) -> str:
        """A name that is safe in a file: ``spheroid--rk4@axis`` for the variant rk4[axis]."""
        parts = "--".join(filter(None, (self.scene, self.integrator, self.group)))
        return parts.replace("/", "_").replace("[", "@").replace("]", "")


@dataclass(frozen=True)
class Study:
    """A question and how it is answered.

    `pictures`, `verdict`, `tables`, `charts`, `opening` and `follow_up` get everything that was measured: an
    `xarray.Dataset`, or an `xarray.DataTree` if the cases are in groups. Each picture is saved and closed before the
    next one is drawn, if `pictures` draws them one by one.
    """

    name: str
    title: str
    question: str
    how_to_read: str
    cases: Callable[[bool], list[Case]]  # quick -> grid
    measure: Callable[[Case], xr.Dataset]
    pictures: Callable[[Any], Iterable[Picture]] = lambda _: []
    verdict: Callable[[Any], list[str]] = lambda _: []
    tables: Callable[[Any], list[Table]] = lambda _: []
    charts: Callable[[Any], list[Chart]] = lambda _: []
    opening: Callable[[Any], Opening] | None = None  # for the first screen of the page
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
        return self.listed("cases", lambda: self.cases(quick)) if longest is None else self.listed("full", longest)

    def later(self, data: Combined) -> list[Case]:
        """The cases of the second round."""
        follow_up = self.follow_up
        return [] if follow_up is None else self.listed("follow_up", lambda: follow_up(data))

    def listed(self, function: str, make: Callable[[], list[Case]]) -> list[Case]:
        """The cases that one of its functions returns. Raises StudyError if they are no list of cases."""
        return list(door(self.name, function).each(make, Case, "a list of Case"))

    def flawed(self, cases: Iterable[Case]) -> StudyError | None:
        """The sentence on the first case that cannot be stored, if there is one."""
        for case in cases:
            if flaw := case.flaw():
                return StudyError(f"study {self.name}: a Case of {case.integrator} on {case.scene} is wrong: {flaw}")
        return None

    def only(self, names: Collection[str]) -> "Study":
        """The same study with the cases of some methods, or variants, alone; SymtopError if it has none of them.

        A case that measures several integrators against each other stays whole if one of them is asked for, and one of
        the closed form, which others are measured by, stays in any case.
        """
        wanted = {*names, REFERENCE}

        def asked(cases: list[Case]) -> list[Case]:
            whole = [*door(self.name, "cases").each(lambda: cases, Case, "a list of Case")]
            if (error := self.flawed(whole)) is not None:
                raise error
            return [case for case in whole if any({name, split_name(name)[0]} & wanted for name in case.integrators)]

        def first(quick: bool) -> list[Case]:
            kept = asked(self.cases(quick))
            alone = all({*case.integrators} <= {REFERENCE} for case in kept)
            if not kept or (alone and REFERENCE not in names):
                raise StudyError(f"study {self.name} has no case of {', '.join(names)}")
            return kept

        def able(answer: Callable[[Any], Any]) -> Callable[[Any], Any]:
            def answered(data: Any) -> Any:
                try:
                    return answer(data)
                except Exception as error:
                    if isinstance(error, StudyError):
                        raise
                    sentence = f"study {self.name} compares methods and has no answer with {', '.join(names)} alone"
                    raise StudyError(f"{sentence}; name more of them") from error

            return answered

        full, later = self.full, self.follow_up
        return replace(
            self, cases=first, full=None if full is None else lambda: asked(full()),
            follow_up=None if later is None else lambda data: asked(later(data)),
            pictures=able(self.pictures), verdict=able(self.verdict), tables=able(self.tables),
            charts=able(self.charts), opening=None if self.opening is None else able(self.opening),
        )  # fmt: skip

    def is_timed(self, case: Case) -> bool:
        """Are times measured in the case, so that nothing may run beside it that disturbs them?"""
        return self.timed or case.timed
