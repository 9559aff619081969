"""The registry: an integrator is a record of claims and a solver for each chart it works in.

Traits are data. They are *claims* until measured; `None` means that nobody has claimed anything. A record is
made by a family (`discrete_lagrangian`, `composition`, ...) from a table of numbers, or by hand around any
function ``solve(top, start, plan) -> Run``.
"""

import importlib
import importlib.metadata
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.base.shown import Catalogue, record_table
from symtop.base.validate import SymtopError, SymtopWarning, finite, label, one_of, positive, whole
from symtop.model.top import Angles, SymmetricTop

Array = NDArray[np.float64]


class Plan(NamedTuple):
    """What a solver is asked for: the sample times, and the step or the tolerance to reach them with."""

    times: Array  # increasing, the first may be 0
    horizon: float
    step_size: float  # horizon / steps exactly; nan for an adaptive method
    marks: NDArray[np.int64]  # times / step_size; empty for an adaptive method
    tolerance: float  # nan for a fixed-step method
    budget: float | None = None  # of an adaptive method: force evaluations or Taylor steps; None for its own limit

    def most(self, limit: float) -> float:
        """The budget, or a method's own limit where nobody gave one."""
        return limit if self.budget is None else self.budget


class Run(NamedTuple):
    """What a solver returns: states of its chart at the sample times, NaN after a failure."""

    states: Array  # (samples, dimension of the chart)
    p_phi: Array  # (samples,) recomputed from the trajectory
    p_psi: Array
    steps: int
    force_evaluations: int
    newton_iterations: int
    outcome: str
    reached: float


Solver = Callable[[SymmetricTop, Angles, Plan], Run]

FAMILIES = ("discrete-lagrangian", "splitting", "runge-kutta", "taylor", "library", "exact", "other")
TIERS = ("compiled", "python")
KNOBS = ("step_size", "tolerance", None)
ENERGY_ERRORS = ("kept", "bounded", None)


@dataclass(frozen=True)
class Integrator:
    """One integrator: its name, its claims, and how to run it.

    `solvers` maps a chart (angles, axis, attitude) to a function. `knob` is what a user turns: ``step_size``,
    ``tolerance`` or nothing. `tier` says what executes the inner loop, so that languages are never ranked
    against each other unsaid. `force_evaluations` is the cost of one step where it is constant.
    """

    name: str
    family: str
    summary: str
    solvers: Mapping[str, Solver] = field(repr=False)
    knob: str | None = "step_size"
    tier: str = "compiled"
    order: int | None = None
    explicit: bool | None = None
    symplectic: bool | None = None
    symmetric: bool | None = None
    conserves: frozenset[str] | None = None
    least_tolerance: float = 0.0
    default_tolerance: float | None = None
    reference: str = ""
    energy_error: str | None = None  # "kept" or "bounded"; None says what follows from the other claims

    def __post_init__(self) -> None:
        label("name", self.name)
        if self.order is not None:
            whole("order", self.order, 1)
        one_of("family", self.family, FAMILIES)
        one_of("tier", self.tier, TIERS)
        if self.knob not in KNOBS:
            raise SymtopError(f"knob must be 'step_size', 'tolerance' or None, not {self.knob!r}")
        if self.energy_error not in ENERGY_ERRORS:
            raise SymtopError(f"energy_error must be 'kept', 'bounded' or None, not {self.energy_error!r}")
        given = self.solvers if isinstance(self.solvers, Mapping) else {}
        if not given or not set(given) <= {"angles", "axis", "attitude"} or not all(map(callable, given.values())):
            raise SymtopError(f"solvers must map one of angles, axis, attitude to a function, not {self.solvers!r}")
        object.__setattr__(self, "solvers", MappingProxyType(dict(self.solvers)))

    def _repr_html_(self) -> str:
        return record_table(self, (*_Integrators.columns, "charts", "reference"))

    def check_tolerance(self, tolerance: object) -> float:
        """The tolerance to use, refused where the arithmetic cannot reach it."""
        value = self.default_tolerance if tolerance is None else positive("tolerance", tolerance)
        if value is None:
            raise SymtopError(f"{self.name} is adaptive and needs a tolerance")
        if value < self.least_tolerance or value >= 1.0:
            raise SymtopError(
                f"tolerance of {self.name} must be at least {self.least_tolerance:.3g} and below 1, not {value!r}"
            )
        return finite("tolerance", value)

    def charts(self) -> tuple[str, ...]:
        """The charts this integrator works in."""
        return tuple(self.solvers)


_BUILT_IN = (
    "discrete_lagrangian",
    "unreduced",
    "galerkin",
    "splitting",
    "runge_kutta",
    "dormand_prince",
    "gauss",
    "scipy_ivp",
    "taylor",
    "exact",
)
ENTRY_POINTS = "symtop.integrators"  # an Integrator, or a function that returns several

_registry: dict[str, Integrator] = {}
_loaded: list[str] = []
_announced: list[str] = []
_shipped: set[str] = set()  # by symtop or an installed package: every process has them


def _load() -> None:
    while len(_loaded) < len(_BUILT_IN):
        module = importlib.import_module(f"symtop.methods.{_BUILT_IN[len(_loaded)]}")
        _loaded.append(module.__name__)
        for entry in module.built_in():
            _registry.setdefault(entry.name, entry)
            _shipped.add(entry.name)
    if not _announced:
        _announced.append(ENTRY_POINTS)
        _load_packages()


def _load_packages() -> None:
    """Integrators that installed packages announce; one that fails is named and left out."""
    for point in importlib.metadata.entry_points(group=ENTRY_POINTS):
        try:
            found = point.load()
            for entry in [found] if isinstance(found, Integrator) else found():
                _shipped.add(register(entry).name)
        except Exception as error:  # noqa: BLE001  (a stranger's package must not take the registry down)
            said = f"the integrators of {point.value} are left out: {type(error).__name__}: {error}"
            warnings.warn(said, SymtopWarning, stacklevel=4)


def register(entry: Integrator, *, replace: bool = False) -> Integrator:
    """Add an integrator to the registry; a name that is taken is refused unless `replace` is true."""
    if not isinstance(entry, Integrator):
        raise SymtopError(f"register needs an Integrator, not {entry!r}")
    _load()
    if entry.name in _registry and not replace:
        raise SymtopError(f"integrator {entry.name!r} is already registered; choose another name or pass replace=True")
    _registry[entry.name] = entry
    return entry


def is_built_in(name: str) -> bool:
    """Does every process know this integrator without being told?"""
    _load()
    return name in _shipped


class _Integrators(Catalogue[Integrator]):
    columns = ("name", "family", "order", "explicit", "symplectic", "symmetric", "conserves", "knob", "tier", "summary")


def integrators() -> dict[str, Integrator]:
    """All registered integrators, by name, in order of registration."""
    _load()
    return _Integrators(_registry)


def integrator(name: "str | Integrator") -> Integrator:
    """The integrator of that name; an Integrator is returned as it is."""
    if isinstance(name, Integrator):
        return name
    _load()
    return _registry[one_of("integrator", name, _registry)]
