"""Scenes: one top, one start, one horizon, and the purpose of the scene.

The horizon and all times are in the units of the top (seconds, if its parameters are SI).
"""

import functools
import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from symtop.core.code_hash import by_name
from symtop.core.errors import SymtopError, entries, finite, label, one_of, positive, shown
from symtop.core.numbers import EPSILON, TINY
from symtop.model.body import Attitude, RigidBody
from symtop.model.charts import BODY, Array
from symtop.model.exact.samples import LONGEST_TIME
from symtop.model.top import (
    BISECTIONS,
    LOOSE_PERIOD,
    Angles,
    SymmetricTop,
    effective_force,
    effective_potential,
    effective_stiffness,
    flat,
    is_loose,
    period_between,
)

if TYPE_CHECKING:
    from symtop.model.exact.closed_form import ClosedForm

OBSERVABLES = ("nutation", "axis", "attitude")  # of a top
UNITS = ("", "SI")
TAGS = {  # by which studies choose; a scene without any is in every study
    "ordinary": "an ordinary nutation, such as spheroid and goldstein show",
    "mild": "nutates less than spheroid, so that a defect of a method shows less",
    "repeats": "another scene shows such a motion: the same top let go at another speed, or a top of the same kind",
    "family": "a member of a family over a parameter",
    "fast": "a small nutation of a fast top, where a step is limited by the spin",
    "steady": "a steady precession: there is no nutation",
    "near_pole": "passes so close to a pole that the angles chart fails",
    "unstable": "unstable or nearly so: errors grow with the motion",
}
STEADY_ENERGY = 1e4  # a nutation with less energy than this many rounding errors of the energy is a steady precession
SHORTEST = 1e-100  # the least horizon, in units of time; the largest is `LONGEST_TIME`
NEXT_TO_POLE = 1e-9  # rad; V is not evaluated nearer to a pole, where it has a limit and 0/0


def horizon_of(value: object) -> float:
    """`value` as a horizon; SymtopError for one that is not positive, below `SHORTEST` or above `LONGEST_TIME`.

    No rate is above 1e40, so that nothing moves in 1e-100. LSODA's own loop never ends below 1e-200.
    """
    horizon = positive("horizon", value)
    if not SHORTEST <= horizon <= LONGEST_TIME:
        bound = f"at least {SHORTEST:g}" if horizon < SHORTEST else f"at most {LONGEST_TIME:g}"
        raise SymtopError(f"horizon must be {bound}, not {horizon!r}", "horizon")
    return horizon


@dataclass(frozen=True, slots=True)
class Scene:
    """A top, its start and a horizon; `observes` says how much of the motion a run must show.

    ``nutation`` is theta alone, ``axis`` the direction of the axis, ``attitude`` the whole orientation. `units` decides
    the units in datasets. Studies leave out scenes by their `tags`, any of `TAGS`. A `RigidBody` with an `Attitude` is
    the scene of a body without symmetry: it observes ``body``, and only functions that say so accept it. `reference`
    names where the scene was published. Raises SymtopError for an invalid field.
    """

    name: str
    top: Any  # SymmetricTop, or RigidBody
    start: Any  # Angles, or Attitude
    horizon: float
    purpose: str = field(default="", metadata={"words": True})
    observes: str = "attitude"
    units: str = field(default="", metadata={"words": True})  # "SI", or empty: any consistent units
    tags: Iterable[str] = field(default=(), metadata={"words": True})
    reference: str = field(default="", metadata={"words": True})  # keys in citations.bib, or words

    def __post_init__(self) -> None:
        label("name", self.name)
        if not isinstance(self.top, SymmetricTop | RigidBody):
            raise SymtopError(f"top must be a SymmetricTop or a RigidBody, not {shown(self.top)}")
        kind = Attitude if self.of_body else Angles
        if not isinstance(self.start, kind):
            words = f"of a {type(self.top).__name__} must be {kind.__name__}"
            raise SymtopError(f"start {words}, not {shown(self.start)}")
        object.__setattr__(self, "horizon", horizon_of(self.horizon))
        if self.of_body:
            object.__setattr__(self, "observes", BODY)
        one_of("observes", self.observes, (BODY,) if self.of_body else OBSERVABLES)
        one_of("units", self.units, UNITS)
        tags = {one_of("tags", tag, TAGS) for tag in entries("tags", self.tags)}
        object.__setattr__(self, "tags", tuple(sorted(tags)))

    def _repr_html_(self) -> str:
        return Catalogue({self.name: self})._repr_html_()

    @property
    def second(self) -> str:
        """The unit after a time: " s" for a scene in SI, empty for one without units."""
        return " s" if self.units else ""

    @property
    def of_body(self) -> bool:
        """Is it of a body without symmetry?"""
        return isinstance(self.top, RigidBody)

    @property
    def nutation_period(self) -> float:
        """Time of one full nutation, infinite on a separatrix; of a body its natural period."""
        return nutation_period(self.top, self.start)

    @property
    def period_word(self) -> str:
        """The name of `nutation_period` in texts."""
        return "natural period" if self.of_body else "nutation"

    def time_scale(self, horizon: float | None = None) -> float:
        """The time on which the motion changes: a nutation, or an eighth of a horizon (the scene's) on a separatrix."""
        period = self.nutation_period
        return period if math.isfinite(period) else (self.horizon if horizon is None else horizon) / 8.0

    @property
    def energy_scale(self) -> float:
        """E0 - p_psi^2/2 I3 - min V, what energy errors are divided by: the energy of the nutation, spin excluded.

        This height of the reduced motion above its steady precession bounds how far a wrong energy moves the turning
        points. A steady precession has none. There it is I1 omega^2/2, the energy of a small nutation with an amplitude
        of one radian: a relative error is then the square of the amplitude (rad) of a nutation with that energy. Of a
        body it is the kinetic energy of the start plus |mgl|.
        """
        if self.of_body:
            return max(float(self.top.energy_scale(self.start)), TINY)
        return _energy_scale(self.top, self.start)

    @property
    def energy_grain(self) -> float:
        """(|E0| + |mgl|) / `energy_scale`, at least 1: how much larger rounding is in relative errors of the energy."""
        return max(float(abs(self.top.energy(self.start)) + abs(self.top.mgl)) / self.energy_scale, 1.0)

    @property
    def momentum_scale(self) -> float:
        """What errors of p_phi and p_psi are divided by: the larger of both in size, or of a body |L|, at the start.

        Where that is zero to rounding, it is the larger of I1 |theta'| (of a body |L|) and sqrt(|mgl| I1), of a body
        with the middle moment.
        """
        if self.of_body:
            size, inertia = math.hypot(*self.top.momentum(self.start)), sorted(self.top.moments)[1]
            turning = size
        else:
            momenta, inertia = self.top.momenta(self.start), self.top.I1
            size, turning = max(abs(momenta.p_phi), abs(momenta.p_psi)), inertia * abs(self.start.theta_dot)
        scale = max(turning, math.sqrt(abs(self.top.mgl) * inertia), TINY)
        return size if size > STEADY_ENERGY * EPSILON * scale else scale

    def momentum_grain(self, momentum: Any) -> float:
        """How much larger rounding is in relative errors of p_phi where a run has the momenta (n, 3) in space, or None.

        A heavy body gathers momentum, at most sqrt(2 I (E + |mgl|)), I the largest moment; it is 1 for all others.
        """
        if momentum is None or not self.of_body or self.top.free:
            return 1.0
        limit = math.sqrt(2.0 * max(self.top.moments) * max(self.top.energy(self.start) + abs(self.top.mgl), 0.0))
        return max(min(float(np.nanmax(np.abs(momentum))), limit) / self.momentum_scale, 1.0)

    def record(self) -> dict[str, str]:
        """What tables show of this scene, by column."""
        period = f"{self.nutation_period:.6g}" if math.isfinite(self.nutation_period) else "infinite"
        times = {"horizon": f"{self.horizon:g}", "nutation period": period, "units": self.units or "any consistent"}
        return {"name": self.name, **times, "observes": self.observes, "purpose": self.purpose}


@functools.lru_cache(maxsize=256)
def nutation_period(top: Any, start: Any) -> float:
    """`Scene.nutation_period` of a top, or of a body, and a start."""
    if isinstance(top, RigidBody):
        return float(top.nutation_period(start))
    low, high = top.turning_cosines(start)
    period = float(period_between(top, start, low, high))
    return float(exact_periods([flat(top, start)], [period])[0]) if is_loose(top, start, low, high) else period


def exact_periods(numbers: Any, periods: Any) -> Array:
    """Periods (n,) of tops and starts (n, 9), the closed form's where they differ by more than `LOOSE_PERIOD`.

    A start for which the closed form takes 40 digits, and seconds, keeps its period.
    """
    from symtop.model.exact import layout as at
    from symtop.model.exact.closed_form import short_constants
    from symtop.model.exact.constants import DONE

    constants, _ = short_constants(np.array(numbers, dtype=float))
    exact = constants[:, at.PERIOD]
    better = (constants[:, at.STATUS] == DONE) & ~np.isclose(periods, exact, rtol=LOOSE_PERIOD, atol=0.0)
    return np.where(better, exact, periods)


@functools.lru_cache(maxsize=256)
def _energy_scale(top: SymmetricTop, start: Angles) -> float:
    momenta = top.momenta(start)

    def height(theta: float) -> float:
        return float(top.potential(min(max(theta, NEXT_TO_POLE), math.pi - NEXT_TO_POLE), momenta))

    depth = 0.5 * top.I1 * start.theta_dot**2 + height(start.theta) - height(top.steady_theta(momenta))
    rounding = EPSILON * (abs(top.energy(start)) + abs(top.mgl))
    scales = (depth, 0.5 * top.I1 * top.nutation_frequency(momenta) ** 2, abs(top.mgl))
    return next((scale for scale in scales if scale > STEADY_ENERGY * rounding), max(*scales, TINY))


@functools.lru_cache(maxsize=256)
def closed_form(scene: Scene) -> "ClosedForm":
    """The exact motion of a scene; made once and kept."""
    from symtop.model.exact.closed_form import ClosedForm

    return ClosedForm(scene.top, scene.start)


def spinning(spin: float, precession: float = 0.0) -> Scene:
    """The family over spin: I1 = 2, I3 = 1, mgl = 2, let go at theta = 0.8 with w3 = `spin` and a precession."""
    theta, w3, turn = 0.8, finite("spin", spin), finite("precession", precession)
    start = Angles(theta=theta, phi_dot=turn, psi_dot=w3 - turn * math.cos(theta))
    purpose = f"let go at theta = {theta} with a spin of {w3:g}"
    return Scene(f"spinning-{w3:.12g}", SymmetricTop(2.0, 1.0, 2.0), start, 20.0, purpose, tags=["family"])


def grazing(delta: float) -> Scene:
    """The family over the gap p_phi - p_psi = `delta`: a fall towards the upper pole that misses it by 1.1 delta.

    I1 = I3 = mgl = p_psi = 1, p_phi = 1 + delta, theta = 1, theta' = -1.2; the horizon is one nutation. The passage
    lasts about delta and turns phi by half a turn.
    """
    gap, theta = finite("delta", delta), 1.0
    cosine = math.cos(theta)
    precession = (gap + 2.0 * math.sin(0.5 * theta) ** 2) / math.sin(theta) ** 2  # (p_phi - p_psi cos) / I1 sin^2
    start = Angles(theta=theta, theta_dot=-1.2, phi_dot=precession, psi_dot=1.0 - precession * cosine)
    purpose = f"passes the upper pole with p_phi - p_psi = {gap:g}"
    return Scene(f"grazing-{gap:.12g}", SymmetricTop(1.0, 1.0, 1.0), start, 4.22, purpose, tags=["family"])


def sleeping(spin: float, tilt: float = 1e-3) -> Scene:
    """The family of tops let go almost upright: I1 = I3 = mgl = 1, w3 = `spin`, theta = `tilt`.

    The upright top is stable for I3 w3 >= 2 sqrt(I1 mgl), here for spin >= 2; below, a tilt grows at the rate
    sqrt(4 - spin^2)/2 until the top lies at about acos(spin^2/2 - 1), rises again, and so on.
    """
    w3 = finite("spin", spin)
    purpose, start = f"let go almost upright with a spin of {w3:g}", Angles(theta=tilt, psi_dot=w3)
    return Scene(f"sleeping-{w3:.12g}", SymmetricTop(1.0, 1.0, 1.0), start, 60.0, purpose, tags=["family"])


def steady(spin: float) -> Scene:
    """The family of steady precessions: I1 = 2, I3 = 1, mgl = 2, theta = 60 degrees, w3 = `spin`, the slow branch.

    The rate is the smaller root of I1 Omega^2 cos(theta) - I3 w3 Omega + mgl = 0, which needs I3 w3 >= 2 sqrt 2 here.
    """
    top, theta, w3 = SymmetricTop(2.0, 1.0, 2.0), math.pi / 3.0, positive("spin", spin)
    momentum, weight = top.I3 * w3, top.I1 * math.cos(theta)
    discriminant = momentum * momentum - 4.0 * weight * top.mgl
    if discriminant < 0.0:
        lowest = 2.0 * math.sqrt(weight * top.mgl) / top.I3
        raise SymtopError(f"spin must be at least {lowest:.6g} to precess steadily, not {w3!r}")
    precession = 2.0 * top.mgl / (momentum + math.sqrt(discriminant))
    start = Angles(theta=theta, phi_dot=precession, psi_dot=w3 - precession * math.cos(theta))
    return Scene(f"steady-{w3:.12g}", top, start, 20.0, f"steady precession at a spin of {w3:g}", tags=["family"])


def _named(scene: Scene, name: str, purpose: str, *tags: str) -> Scene:
    return replace(scene, name=name, purpose=purpose, tags=[*scene.tags, *tags])


def _separatrix() -> Scene:
    """Woodhouse, Introduction to Analytical Dynamics, problem 5.3: u = cos theta = 1/(1 + sech g t), g^2 = mgl/I1."""
    top = SymmetricTop(2.0, 1.0, 2.0)
    g, root = math.sqrt(top.mgl / top.I1), math.sqrt(3.0)
    start = Angles(math.pi / 3.0, phi_dot=2.0 * g / root, psi_dot=(3.0 * top.I1 - top.I3) * g / (top.I3 * root))
    purpose = "rises to the upright for ever: errors grow at the rate sqrt(mgl/I1 - (p_psi/2 I1)^2), whatever the step"
    tags, reference = ["near_pole", "unstable"], "woodhouse-2009"
    return Scene("separatrix", top, start, 20.0 / g, purpose, tags=tags, reference=reference)


def _goldstein(name: str, theta_dot: float, purpose: str, *tags: str) -> Scene:
    """a = p_psi/I1 = 2.5, b = p_phi/I1 = 1.7: phi' = (b - a u)/(1 - u^2), psi' = a I1/I3 - phi' u, u = cos 43 deg."""
    start = Angles(math.radians(43.0), 0.0, 0.0, theta_dot, -0.2760228916930134, 5.201870363571313)
    source = "goldstein-poole-safko-2002"
    return Scene(name, SymmetricTop(2.0, 1.0, 2.0), start, 70.0, purpose, tags=["mild", *tags], reference=source)


# The notebook prints alpha = 2 E1/I1 = 1.6 and a release at rest; alpha = 1.6 means this rate instead of zero.
_ALPHA_RATE = 0.31914824723237937


def _kinon_betsch() -> Scene:
    """Steady precession at 10 rad/s: I3 w3 Omega = I1 Omega^2 cos(theta) + mgl."""
    top = SymmetricTop(0.00450622196249, 0.000530143760293, 0.520071028848)
    theta, precession = math.radians(60.0), 10.0
    spin = (top.I1 * precession**2 * math.cos(theta) + top.mgl) / (top.I3 * precession)
    start = Angles(theta=theta, phi_dot=precession, psi_dot=spin - precession * math.cos(theta))
    purpose = "steady precession of a small real gyroscope, a published benchmark"
    return Scene("kinon-betsch", top, start, 2.0, purpose, units="SI", tags=["steady"], reference="kinon-betsch-2024")


@functools.lru_cache(maxsize=1)
def _catalogue() -> dict[str, Scene]:
    top, printed = SymmetricTop(2.0, 1.0, 2.0), "goldstein with more energy: not at rest, theta"
    # fmt: off
    catalogue = [
        Scene("spheroid", SymmetricTop(2.0, 1.0, 9.81 * 2.7386127875258306),
              Angles(theta=0.4, phi=0.1, psi=0.1, theta_dot=0.1, phi_dot=10.0, psi_dot=0.1), 8.0,
              "the notebook's top, inertia about its centre: violent nutation from 23 to 99 degrees", units="SI"),
        _goldstein("goldstein", 0.0, "a top of moderate spin, its axis released at 43 degrees"),
        _goldstein("goldstein-falling", -_ALPHA_RATE, f"{printed} falling at first", "repeats"),
        _goldstein("goldstein-rising", _ALPHA_RATE, f"{printed} rising at first", "repeats"),
        _named(spinning(10.0), "cusp", "released from rest: the axis comes to rest again at each cusp",
               "ordinary", "mild", "repeats"),
        _named(spinning(10.0, -0.3), "loop", "started against its precession: the axis draws loops",
               "ordinary", "mild"),
        _named(spinning(10.0, 0.1), "wave", "started along its precession: the axis draws a wave",
               "ordinary", "mild", "repeats"),
        Scene("fast", top, Angles(theta=0.5, psi_dot=100.0), 8.0,
              "a very fast spin: 64 small nutations, gravity a perturbation of the free top", tags=["fast"]),
        Scene("steady", top, Angles(theta=math.pi / 3.0, phi_dot=1.0, psi_dot=2.5), 20.0,
              "exactly steady precession: whatever nutates here is error", tags=["steady"]),
        Scene("hairer-lubich-wanner", SymmetricTop(0.5, 1.0, 1.0),
              Angles(theta=math.acos(0.6), phi=2.0 * math.atan(2.0), theta_dot=0.4, phi_dot=2.5, psi_dot=-1.1), 30.0,
              "the flat top of Geometric Numerical Integration, figure VII.5.3", tags=["ordinary", "mild"],
              reference="hairer-lubich-wanner-2006"),
        Scene("simo-wong", SymmetricTop(5.0, 1.0, 20.0), Angles(theta=0.05, psi_dot=50.0), 10.0,
              "a fast top almost upright, the benchmark of structural dynamics", tags=["fast", "repeats"],
              reference="simo-wong-1991"),
        _kinon_betsch(),
        Scene("bruls-cardona-arnold", SymmetricTop(15.234375, 0.46875, 147.15),
              Angles(theta=math.pi / 2, phi=math.pi, psi=math.pi / 2, phi_dot=-4.61538, psi_dot=150.0), 2.0,
              "a published benchmark that grazes the lower pole at 0.00004 degrees: no place for angles", units="SI",
              tags=["near_pole"], reference="bruls-cardona-arnold-2012"),
        _named(grazing(1e-3), "grazing", "passes the upper pole at 0.06 degrees: a step in angles may jump over it",
               "near_pole", "repeats"),
        _named(sleeping(2.5), "sleeping", "let go almost upright and fast enough to stay there (threshold 2)",
               "near_pole", "unstable"),
        _named(sleeping(1.9), "sleeping-unstable", "let go almost upright and too slow: it falls and rises again",
               "near_pole", "unstable"),
        _named(steady(20.0), "steady-fast", "steady precession of a fast top: a large step makes it nutate",
               "fast", "steady"),
        _separatrix(),
    ]
    # fmt: on
    return {scene.name: scene for scene in catalogue}


@functools.lru_cache(maxsize=1)
def _bodies() -> dict[str, Scene]:
    slug_foot_foot = 1.3558179483314  # kg m^2
    brick = RigidBody(0.00189422 * slug_foot_foot, 0.006211019 * slug_foot_foot, 0.007194665 * slug_foot_foot)
    rates = math.radians(10.0), math.radians(20.0), math.radians(30.0)
    swinging = Attitude((0.8, 0.6, 0.0, 0.0), (0.2, 0.3, 3.0))
    catalogue = [
        Scene("check-case-2", brick, Attitude(omega_body=rates), 30.0,
              "a free brick, check case 2 of NASA's flight simulations; space axes: north, east, down at the start",
              units="SI", reference="murri-jackson-shelton-2015"),
        Scene("tennis-racket", RigidBody(1.0, 2.0, 3.0), Attitude(omega_body=(1e-3, 1.0, 1e-3)), 100.0,
              "free, turning about its middle axis: it flips over again and again",
              reference="ashbaugh-chicone-cushman-1991"),
        Scene("free-wobble", RigidBody(1.0, 1.01, 1.6), Attitude(omega_body=(0.3, 0.0, 1.0)), 60.0,
              "free and nearly symmetric: a slow wobble"),
        Scene("heavy-brick", RigidBody(1.0, 1.2, 0.6, 1.0, (0.1, 0.0, 1.0)), swinging, 20.0,
              "a heavy body near a symmetric top: regular"),
        Scene("heavy-chaotic", RigidBody(1.0, 1.6, 0.8, 2.0, (0.5, 0.2, 1.0)),
              Attitude((0.8, 0.6, 0.0, 0.0), (0.4, 0.5, 0.9)), 20.0,
              "a heavy body far from symmetry, chaotic: errors grow a millionfold in 50"),
    ]  # fmt: skip
    return {entry.name: entry for entry in catalogue}


_added: dict[str, Scene] = {}


def register_scene(entry: Scene) -> Scene:
    """Add a scene to the catalogue, for studies and commands; SymtopError for what is none and for a known name."""
    if not isinstance(entry, Scene):
        raise SymtopError(f"register_scene needs a Scene, not {shown(entry)}")
    if entry.name in _catalogue() | _bodies() or _added.get(entry.name, entry) != entry:
        raise SymtopError(f"scene {entry.name!r} is already known; choose another name")
    _added[entry.name] = entry
    return entry


def added_scenes() -> list[str]:
    """Names of the scenes that were registered by the user."""
    return list(_added)


class Catalogue(dict[str, Any]):
    """Records by name, scenes or integrators; a notebook shows them as a table."""

    def _repr_html_(self) -> str:
        import pandas as pd  # 0.2 s

        with pd.option_context("display.max_colwidth", None):
            return str(pd.DataFrame([entry.record() for entry in self.values()]).to_html(index=False))


@by_name
def scenes() -> dict[str, Scene]:
    """All known scenes of tops, by name."""
    return Catalogue({**_catalogue(), **{name: entry for name, entry in _added.items() if not entry.of_body}})


@by_name
def body_scenes() -> dict[str, Scene]:
    """All known scenes of bodies without symmetry, by name."""
    return Catalogue({**_bodies(), **{name: entry for name, entry in _added.items() if entry.of_body}})


@by_name
def all_scenes() -> dict[str, Scene]:
    """All known scenes, those of tops first, by name."""
    return Catalogue(scenes() | body_scenes())


@by_name
def scene(name: str | Scene, *, bodies: bool = False) -> Scene:
    """The scene of a name, or the Scene itself; SymtopError for an unknown one, and without `bodies` for a body's."""
    result = name
    if not isinstance(result, Scene):
        if not isinstance(name, str):
            words = f"not a {type(name).__name__}: symtop.Scene(name, top, start, horizon) makes one"
            raise SymtopError(f"scene must be a Scene or the name of one, {words}", "scene")
        catalogue = all_scenes()
        result = catalogue[one_of("scene", name, catalogue)]
    if result.of_body and not bodies:
        words = f"{result.name}, a RigidBody: symtop.scene(name, bodies=True) returns it"
        raise SymtopError(f"scene must be one of a SymmetricTop, not {words}", "scene")
    return result


# energies and scales of many tops, of rows of numbers as `symtop.model.top.flat` has them


def start_momenta(numbers: Array) -> tuple[Array, Array, Array, Array]:
    """p_phi, p_psi, p_phi - p_psi and p_phi + p_psi of the starts, each (n,)."""
    I1, I3, _, theta, _, _, _, phi_dot, psi_dot = numbers.T
    p_psi = I3 * (psi_dot + phi_dot * np.cos(theta))
    sin_x, cos_x = np.sin(0.5 * theta), np.cos(0.5 * theta)
    swing = 4.0 * I1 * phi_dot * (sin_x * cos_x) ** 2
    north, south = swing - 2.0 * p_psi * sin_x**2, swing + 2.0 * p_psi * cos_x**2
    return swing + p_psi * np.cos(theta), p_psi, north, south


def start_energies(numbers: Array) -> Array:
    """Total energy of the starts, (n,)."""
    I1, I3, mgl, theta, _, _, theta_dot, phi_dot, psi_dot = numbers.T
    across = theta_dot**2 + (phi_dot * np.sin(theta)) ** 2
    return np.asarray(0.5 * I1 * across + 0.5 * I3 * (psi_dot + phi_dot * np.cos(theta)) ** 2 + mgl * np.cos(theta))


def energy_scales(numbers: Array, theta_range: Array) -> Array:
    """`Scene.energy_scale` of all, (n,), by bisection of V' between the turning points, `theta_range` (n, 2) in rad."""
    I1, mgl = numbers[:, 0], numbers[:, 2]
    _, _, north, south = start_momenta(numbers)
    low, high = np.clip(theta_range.T, NEXT_TO_POLE, math.pi - NEXT_TO_POLE)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        falls = effective_force(middle, north, south, I1, mgl)[0] < 0.0
        low, high = np.where(falls, middle, low), np.where(falls, high, middle)
    lowest = 0.5 * (low + high)
    start = np.clip(numbers[:, 3], NEXT_TO_POLE, math.pi - NEXT_TO_POLE)
    v_start, v_lowest = (effective_potential(theta, north, south, I1, mgl) for theta in (start, lowest))
    depth = 0.5 * I1 * numbers[:, 6] ** 2 + v_start - v_lowest
    swing = 0.5 * np.maximum(effective_stiffness(lowest, north, south, I1, mgl), 0.0)
    rounding = STEADY_ENERGY * EPSILON * (np.abs(start_energies(numbers)) + np.abs(mgl))
    scales = np.array([depth, swing, np.abs(mgl)])
    return np.asarray(np.select(list(scales > rounding), list(scales), np.maximum(scales.max(axis=0), TINY)))
