"""The registry: an integrator is a record of claims and a solver for each chart it works in.

Traits are *claims* until measured; `None` means that nobody has claimed anything. A record is made by a family
(`discrete_lagrangian`, `composition`, ...) from a table of numbers, or by hand around any function
``solve(top, start, plan) -> Run``. Nothing is decided by an integrator's name.

A method in one of its charts is a *variant*, ``rk4[axis]``. `variants` lists them; `integrator` finds them by name. The
maps of physics engines, family ``engine``, are run and judged by name as every integrator is. Users get them with an
engine and do not choose them: `methods`, and so `variants` and every comparison, leaves them out.
"""

import copyreg
import functools
import importlib
import importlib.metadata
import re
import threading
import warnings
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from types import MappingProxyType
from typing import Any

import numpy as np

from symtop.core import errors
from symtop.core.code_hash import by_name
from symtop.core.errors import SymtopError, SymtopWarning, one_of, shown, words_of
from symtop.core.signals import is_of_user
from symtop.methods.framework.plan import Array, Plan, Run
from symtop.model.charts import BODY, DIMENSIONS, View
from symtop.model.scenes import Catalogue, Scene
from symtop.model.top import Angles, Momenta, SymmetricTop

Solver = Callable[[SymmetricTop, Angles, Plan], Run]
ModifiedEnergy = Callable[[View, Momenta, float], Array]  # of states (n, dimension), momenta of the start and h: (n,)

ENGINE = "engine"  # the family of maps that physics engines ship
FAMILIES = (
    "discrete-lagrangian", "splitting", "runge-kutta", "lie-group", "taylor", "library", "exact", ENGINE, "other",
)  # fmt: skip
IMPLEMENTATIONS = ("compiled", "python")
ENERGY_ERRORS = ("kept", "bounded", None)
NEEDS = {  # the least that a method needs of a problem, even if its kernel uses more, and the words for it
    "derivative": "f(t, y)", "constants": "f(t, y) and constants", "expression": "f as a formula",
    "lagrangian": "a Lagrangian", "kicks": "torque, free motion", "group": "torque, inertia",
    "this-top": "this top's equations", "solution": "the motion itself",
}  # fmt: skip
INNER_LOOPS = ("scalar", "vector registers", "heyoka", "Python", None)
ALLOWED_VALUES: dict[str, tuple[Any, ...]] = {
    **dict.fromkeys(("explicit", "symplectic", "symmetric"), (True, False, None)), "exact_steps": (True, False),
    "control": ("step_size", "tolerance", None), "energy_error": ENERGY_ERRORS,
    "needs": (*NEEDS, None), "general": (True, False, None), "inner_loop": INNER_LOOPS,
    "precision": ("single", "double", "longdouble", "quad"),
}  # fmt: skip
KINDS: dict[str, tuple[Any, str]] = {
    **dict.fromkeys(("summary", "reference", "about"), (str, "text")), "same_steps_as": (str | None, "a name or None"),
    **dict.fromkeys(("modified_energy", "sleeps_from"), (Callable | None, "a function or None")),
}  # fmt: skip
CONSERVED = ("energy", "p_phi", "p_psi", "axis_length", "cayley_energy")  # what a method may claim to conserve
SMALLEST_FIRST = {  # what is observed: the charts that show it, in order of preference
    "nutation": ("angles", "axis", "attitude"), "axis": ("axis", "angles", "attitude"),
    "attitude": ("angles", "attitude"),
}  # fmt: skip
_VARIANT = re.compile(r"(.+)\[(\w+)\]")
_CLAIM = {True: "yes", False: "no", None: "unknown"}


def split_name(name: str) -> tuple[str, str]:
    """The method and the chart in the name of a variant, ``rk4[axis]``; the chart is empty in any other name."""
    match = _VARIANT.fullmatch(name) if isinstance(name, str) else None
    return (match[1], match[2]) if match else (name, "")


@dataclass(frozen=True)
class Integrator:
    """One integrator: its name, its claims, and how to run it.

    `solvers` maps a chart (angles, axis, attitude, body) to a function. `control` is what a user sets: ``step_size``,
    ``tolerance`` or nothing. `implementation` says what executes the inner loop, so that a ranking across languages is
    always labelled, and `inner_loop` how. `needs` is one of `NEEDS`; `general` says whether the method exists for a
    body without symmetry; both are None if unknown. `summary` is a line about it, `about` a paragraph, which the
    built-in ones have from `about.md`. Raises SymtopError for an invalid field.
    """

    name: str
    family: str
    summary: str = field(metadata={"words": True})
    solvers: Mapping[str, Solver] = field(repr=False)
    control: str | None = "step_size"
    implementation: str = "compiled"
    order: int | None = None
    explicit: bool | None = None
    symplectic: bool | None = None
    symmetric: bool | None = None
    conserves: frozenset[str] | None = None
    least_tolerance: float = 0.0
    default_tolerance: float | None = None
    reference: str = field(default="", metadata={"words": True})
    energy_error: str | None = None  # "kept" or "bounded"; with None it follows from the other claims
    modified_energy: ModifiedEnergy | None = None  # what it conserves to O(h^4) minus the energy, in closed form
    sleeps_from: Callable[[float], float] | None = None  # (h): least spin of a sleeping top (I1 = I3 = mgl = 1)
    exact_steps: bool = False  # a step of any size is the motion itself but for rounding: there is no order
    same_steps_as: str | None = None  # a compiled integrator that takes the same steps
    precision: str = "double"  # of its arithmetic: "single", "double", "longdouble" (80 bits) or "quad" (128)
    speed: float = 1.0  # of a step, relative to others of its implementation: 0.002 for arithmetic in software
    needs: str | None = field(default=None, metadata={"words": True})
    general: bool | None = field(default=None, metadata={"words": True})
    inner_loop: str | None = field(default=None, metadata={"words": True})
    about: str = field(default="", repr=False, compare=False, metadata={"words": True})  # a paragraph: what it is, when

    def __post_init__(self) -> None:
        name, chart = split_name(self.name)
        errors.label("name", name)
        if chart and tuple(self.solvers) != (chart,):
            raise SymtopError(f"name {self.name!r} needs one solver, of {chart}, not of {', '.join(self.solvers)}")
        if self.order is not None:
            errors.whole("order", self.order, 1)
        one_of("family", self.family, FAMILIES)
        one_of("implementation", self.implementation, IMPLEMENTATIONS)
        self._check_kinds()
        solvers = dict(self.solvers) if isinstance(self.solvers, Mapping) else {}
        if not solvers or not set(solvers) <= {*DIMENSIONS} or not all(map(callable, solvers.values())):
            charts = ", ".join(DIMENSIONS)
            raise SymtopError(f"solvers must map one of {charts} to a function, not {shown(self.solvers)}")
        object.__setattr__(self, "solvers", MappingProxyType(solvers))
        errors.positive("speed", self.speed)
        if self.exact_steps and (self.order is not None or not self.fixed_step):
            raise SymtopError("exact_steps must be False for a method that has an order or no step_size")
        if self.conserves is not None:
            claims = errors.entries("conserves", self.conserves)
            names = frozenset(one_of("an entry of conserves", name, CONSERVED) for name in claims)
            object.__setattr__(self, "conserves", names)

    def _check_kinds(self) -> None:
        for name, allowed in ALLOWED_VALUES.items():
            value = getattr(self, name)
            if not isinstance(value, str | bool | np.bool_ | None) or value not in allowed:
                *first, last = map(repr, allowed)
                raise SymtopError(f"{name} must be {', '.join(first)} or {last}, not {shown(value)}")
        for name, (kind, words) in KINDS.items():
            if not isinstance(getattr(self, name), kind):
                raise SymtopError(f"{name} must be {words}, not {shown(getattr(self, name))}")
        lowest, default = errors.finite("least_tolerance", self.least_tolerance, 0.0), self.default_tolerance
        if default is not None and not max(lowest, 5e-324) <= errors.finite("default_tolerance", default) < 1.0:
            raise SymtopError(f"default_tolerance must be above zero, at least {lowest:g} and below 1, not {default!r}")

    def _repr_html_(self) -> str:
        return Catalogue({self.name: self})._repr_html_()

    def check_tolerance(self, tolerance: object) -> float:
        """The tolerance to use, the default for None; SymtopError if the arithmetic cannot reach it."""
        value = self.default_tolerance if tolerance is None else errors.positive("tolerance", tolerance)
        if value is None:
            raise SymtopError(f"{self.name} is adaptive and needs a tolerance, for example 1e-6")
        if value < self.least_tolerance or value >= 1.0:
            raise SymtopError(
                f"tolerance of {self.name} must be at least {self.least_tolerance:.3g} and below 1, not {value!r}",
                "tolerance",
            )
        return errors.finite("tolerance", value)

    @property
    def fixed_step(self) -> bool:
        """Does a user set a step size?"""
        return self.control == "step_size"

    @property
    def adaptive(self) -> bool:
        """Does a user set a tolerance?"""
        return self.control == "tolerance"

    @property
    def keeps_frequencies(self) -> bool:
        """Do errors of a top's angles grow as t: is the map symplectic or symmetric, or does it keep every constant?"""
        return bool(self.symplectic or self.symmetric or {"energy", "p_phi", "p_psi"} <= set(self.conserves or ()))

    def given(self, value: float) -> dict[str, float]:
        """The argument of `simulate` that sets the step or tolerance to `value`; none if there is nothing to set."""
        return {} if self.control is None else {self.control: value}

    def charts(self) -> tuple[str, ...]:
        """The charts of the top that this integrator works in; a solver of `body` is for bodies without symmetry."""
        return tuple(chart for chart in self.solvers if chart != BODY)

    def chart_for(self, observe: str, among: Collection[str] | None = None) -> str:
        """The smallest chart that shows the "nutation", the "axis" or the "attitude", one without poles if two tie.

        `among` leaves out all other charts. Raises SymtopError if no chart is left.
        """
        for chart in SMALLEST_FIRST[observe]:
            if chart in self.solvers and (among is None or chart in among):
                return chart
        raise SymtopError(f"{self.name} works in {', '.join(self.solvers)} and cannot show the {observe}: observe axis")

    @property
    def method(self) -> str:
        """The name without a chart."""
        return split_name(self.name)[0]

    def variant(self, chart: str) -> "Integrator":
        """The same integrator with nothing but its solver of one chart, named ``method[chart]``."""
        name = f"{self.method}[{one_of(f'chart of {self.method}', chart, self.solvers)}]"
        return self if name == self.name else replace(self, name=name, solvers={chart: self.solvers[chart]})

    def record(self) -> dict[str, str]:
        """What tables show of this integrator: its claims in words, by column."""
        return {
            "name": self.name,
            "family": self.family,
            "order": "unknown" if self.order is None else str(self.order),
            **{trait: _CLAIM[getattr(self, trait)] for trait in ("explicit", "symplectic", "symmetric")},
            "conserves": "unknown" if self.conserves is None else ", ".join(sorted(self.conserves)) or "nothing",
            "needs": self.needs or "unknown",
            "general": _CLAIM[self.general],
            "charts": ", ".join(self.solvers),
            "control": self.control or "none",
            "implementation": self.implementation,
            "inner loop": self.inner_loop or "unknown",
            "summary": self.summary,
        }


_BUILT_IN = (
    "lagrangian.discrete_lagrangian", "lagrangian.unreduced", "lagrangian.galerkin", "lagrangian.exact_discrete",
    "lie_group.variational", "splitting.composition", "splitting.body", "splitting.reversible", "runge_kutta.explicit",
    "runge_kutta.pairs", "runge_kutta.projected", "runge_kutta.extrapolation", "runge_kutta.nystrom",
    "runge_kutta.adams", "runge_kutta.gauss", "runge_kutta.kahan", "lie_group.runge_kutta",
    "lie_group.energy_momentum", "lie_group.generalised_alpha", "runge_kutta.collective_gauss", "library.scipy_ivp",
    "taylor.heyoka", "taylor.series", "taylor.series_general", "library.exact", "engines.engines",
    "lagrangian.galerkin_gauss",
)  # fmt: skip
ENTRY_POINTS = "symtop.integrators"  # an Integrator, or a function that returns several

_registry: dict[str, Integrator] = {}
_loaded: list[str] = []
_announced: list[str] = []
_missing: dict[str, str] = {}  # names that cannot be had on this machine, with the reason
_variants: dict[str, tuple[Integrator, Integrator]] = {}  # by name: the integrator, and its variant
_shipped: set[str] = set()  # names from symtop and installed packages: every process has them
_loading = threading.RLock()  # the first call of one thread loads; a package that is being loaded may register


def _load() -> None:
    with _loading:
        while len(_loaded) < len(_BUILT_IN):
            module = importlib.import_module(f"symtop.methods.{_BUILT_IN[len(_loaded)]}")
            _loaded.append(module.__name__)
            for entry in module.built_in():
                about, inner = entry.about or paragraphs().get(entry.name, ""), entry.inner_loop or "scalar"
                _registry.setdefault(entry.name, replace(entry, about=about, inner_loop=inner))
                _shipped.add(entry.name)
            if hasattr(module, "missing"):
                _missing.update(module.missing())
        if not _announced:
            _announced.append(ENTRY_POINTS)
            _load_packages()


def _load_packages() -> None:
    """Integrators that installed packages announce; one that fails is named and left out."""
    for point in importlib.metadata.entry_points(group=ENTRY_POINTS):
        try:
            content = point.load()
            for entry in [content] if isinstance(content, Integrator) else content():
                _shipped.add(register(entry).name)
        except BaseException as error:  # (an error of a package must not disable the registry)
            if is_of_user(error):
                raise
            sentence = f"the integrators of {point.value} are left out: {words_of(error)}"
            warnings.warn(sentence, SymtopWarning, stacklevel=4)


def register(entry: Integrator, *, replace: bool = False) -> Integrator:
    """Add an integrator to the registry; SymtopError for a variant, and unless `replace` for a name that is taken."""
    if not isinstance(entry, Integrator):
        raise SymtopError(f"register needs an Integrator, not {shown(entry)}")
    if entry.method != entry.name:
        raise SymtopError(f"register needs an integrator and not one of its variants, {entry.name!r}")
    _load()
    if not errors.boolean("replace", replace) and entry.name in _registry:
        raise SymtopError(f"integrator {entry.name!r} is already registered; choose another name or pass replace=True")
    _registry[entry.name] = entry
    return entry


def is_built_in(name: str) -> bool:
    """Does every process have this integrator, from symtop or an installed package?"""
    _load()
    return split_name(name)[0] in _shipped


class _Integrators(Catalogue):
    """The registry as a dict; a notebook shows it as a table. A variant is found by its name, too, but not listed."""

    def __missing__(self, name: str) -> Integrator:
        method, chart = _method_and_chart(name, self)
        if not chart or method not in self:
            raise KeyError(name)
        variant: Integrator = self[method].variant(chart)
        return variant


def _method_and_chart(name: str, registered: Collection[str]) -> tuple[str, str]:
    """`split_name`, also of ``series-axis``, which stands for ``series[axis]`` in shells that expand brackets."""
    method, chart = split_name(name)
    head, _, tail = name.rpartition("-") if isinstance(name, str) else ("", "", "")
    if head in registered and not chart and name not in registered and tail in DIMENSIONS:
        return head, tail
    return method, chart


@by_name
def integrators() -> dict[str, Integrator]:
    """All registered integrators, by name, in order of registration."""
    _load()
    return _Integrators(_registry)


@by_name
def methods() -> dict[str, Integrator]:
    """The integrators that comparisons and recommendations choose from: all but the maps of physics engines."""
    return {name: entry for name, entry in integrators().items() if entry.family != ENGINE}


@by_name
def engines() -> dict[str, Integrator]:
    """The maps of physics engines."""
    return {name: entry for name, entry in integrators().items() if entry.family == ENGINE}


@by_name
def integrator(name: str | Integrator) -> Integrator:
    """The integrator or variant of that name: ``rk4[axis]``, or ``rk4-axis``, works in no other chart.

    An Integrator is returned as is. Raises SymtopError for an unknown name and for a chart that the method does not
    have.
    """
    if isinstance(name, Integrator):
        return name
    _load()
    method, chart = _method_and_chart(name, _registry)
    if isinstance(method, str) and method in _missing:
        raise SymtopError(_missing[method])
    entry = _registry[one_of("integrator", method, _registry)]
    if not chart:
        return entry
    if _variants.get(name, (None,))[0] is not entry:  # none yet, or of an integrator that was replaced
        _variants[name] = entry, entry.variant(chart)
    return _variants[name][1]


def _reduce(method: Integrator) -> Any:
    """Pickles a registered integrator by its name, as solvers exist in one process only; others field by field."""
    registered = split_name(method.name)[0] in integrators() and integrator(method.name) == method
    return (integrator, (method.name,)) if registered else object.__reduce_ex__(method, 2)


copyreg.pickle(Integrator, _reduce)


@by_name
def variants(observe: str | None = None) -> list[Integrator]:
    """Each of `methods` in each of its charts, or in those that show the "nutation", the "axis" or the "attitude"."""
    charts = None if observe is None else SMALLEST_FIRST[one_of("observe", observe, SMALLEST_FIRST)]
    pairs = ((entry, chart) for entry in methods().values() for chart in entry.charts())
    return [entry.variant(chart) for entry, chart in pairs if charts is None or chart in charts]


@functools.cache
def bibliography() -> dict[str, str]:
    """The BibTeX of every entry, by its key. An entry begins with @ in the first column and ends with } there."""
    text = resources.files("symtop.methods").joinpath("citations.bib").read_text(encoding="utf-8")
    return {
        match["key"]: match[0]
        for match in re.finditer(r"^@\w+\{(?P<key>[^,\s]+),$.*?^\}", text, re.MULTILINE | re.DOTALL)
    }


def citation_keys(entry: Integrator | Scene) -> list[str]:
    """The entries that a `reference` names, if any; ``CHART:KEY`` names what an integrator takes in one chart only."""
    parts = (word.rpartition(":") for word in str(entry.reference).replace(",", " ").split())
    charts = {"", *getattr(entry, "solvers", ())}
    return [key for chart, _, key in parts if chart in charts and key in bibliography()]


def citation(name: str | Integrator) -> str:
    """BibTeX of the source of an integrator. SymtopError for an unknown name and where no source is known."""
    method = integrator(name)
    keys = citation_keys(method)
    if not keys:
        raise SymtopError(
            f"integrator {method.name!r} names no source that is known here (its reference is {method.reference!r})"
        )
    return "\n\n".join(bibliography()[key] for key in keys)


@functools.cache
def paragraphs() -> dict[str, str]:
    """The text under each heading ``## NAME`` of about.md, on one line."""
    text = resources.files("symtop.methods").joinpath("about.md").read_text(encoding="utf-8")
    _, *sections = re.split(r"^## (.+)$", text, flags=re.MULTILINE)
    return {name: " ".join(body.split()) for name, body in zip(sections[::2], sections[1::2], strict=True)}
