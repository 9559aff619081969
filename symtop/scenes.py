"""Scenes: one top, one start, one horizon, and what the scene is there to show.

The horizon and all times are in the units of the top (seconds, if its parameters are SI). Where a start
follows from a formula, the formula stands beside it.
"""

import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from symtop.checks import SymtopError, label, one_of, positive
from symtop.shown import Catalogue, record_table
from symtop.top import Angles, SymmetricTop

if TYPE_CHECKING:
    from symtop.exact import ClosedForm

OBSERVABLES = ("nutation", "axis", "attitude")


@dataclass(frozen=True, slots=True)
class Scene:
    """A top, its start and a horizon; `observes` names the smallest thing the scene is watched for.

    ``nutation`` is theta alone, ``axis`` the direction of the axis, ``attitude`` the whole orientation.
    """

    name: str
    top: SymmetricTop
    start: Angles
    horizon: float
    purpose: str = ""
    observes: str = "attitude"

    def __post_init__(self) -> None:
        label("name", self.name)
        if not isinstance(self.top, SymmetricTop):
            msg = f"top must be a SymmetricTop, not {self.top!r}"
            raise SymtopError(msg)
        if not isinstance(self.start, Angles):
            msg = f"start must be Angles, not {self.start!r}"
            raise SymtopError(msg)
        object.__setattr__(self, "horizon", positive("horizon", self.horizon))
        one_of("observes", self.observes, OBSERVABLES)

    @property
    def nutation_period(self) -> float:
        """Time of one full nutation; infinite on a separatrix."""
        return self.top.nutation_period(self.start)

    def _repr_html_(self) -> str:
        return record_table(self, ("name", "purpose", "top", "start", "horizon", "nutation_period", "observes"))


@functools.lru_cache(maxsize=256)
def _closed_form(top: SymmetricTop, start: Angles) -> "ClosedForm":
    from symtop.exact import ClosedForm  # noqa: PLC0415

    return ClosedForm(top, start)


def closed_form(scene: Scene) -> "ClosedForm":
    """The exact motion of a scene; made once (20 ms) and kept."""
    return _closed_form(scene.top, scene.start)


def _fast_nutation(name: str, precession: float, purpose: str) -> Scene:
    """One fast top (I3 w3 = 10) released at theta = 0.8 with three different precessions."""
    theta, spin = 0.8, 10.0
    start = Angles(theta=theta, phi_dot=precession, psi_dot=spin - precession * math.cos(theta))
    return Scene(name, SymmetricTop(2.0, 1.0, 2.0), start, 20.0, purpose)


def _goldstein(name: str, theta_dot: float, purpose: str) -> Scene:
    """a = p_psi/I1 = 2.5, b = p_phi/I1 = 1.7: phi' = (b - a u)/(1 - u^2), psi' = a I1/I3 - phi' u, u = cos 43 deg."""
    start = Angles(
        theta=math.radians(43.0),
        theta_dot=theta_dot,
        phi_dot=-0.2760228916930134,
        psi_dot=5.201870363571313,
    )
    return Scene(name, SymmetricTop(2.0, 1.0, 2.0), start, 70.0, purpose)


# The notebook prints alpha = 2 E1/I1 = 1.6 and a release at rest; alpha = 1.6 means this rate instead of zero.
_ALPHA_RATE = 0.31914824723237937


def _kinon_betsch() -> Scene:
    """Steady precession at 10 rad/s: I3 w3 Omega = I1 Omega^2 cos(theta) + mgl."""
    top = SymmetricTop(0.00450622196249, 0.000530143760293, 0.520071028848)
    theta, precession = math.radians(60.0), 10.0
    spin = (top.I1 * precession**2 * math.cos(theta) + top.mgl) / (top.I3 * precession)
    start = Angles(theta=theta, phi_dot=precession, psi_dot=spin - precession * math.cos(theta))
    return Scene("kinon-betsch", top, start, 2.0, "steady precession of a small real gyroscope, a published benchmark")


@functools.lru_cache(maxsize=1)
def _catalogue() -> dict[str, Scene]:
    spheroid = SymmetricTop(2.0, 1.0, 9.81 * 2.7386127875258306)
    third = math.pi / 3.0
    catalogue = [
        Scene(
            "spheroid",
            spheroid,
            Angles(theta=0.4, phi=0.1, psi=0.1, theta_dot=0.1, phi_dot=10.0, psi_dot=0.1),
            8.0,
            "the notebook's first top: violent nutation from 23 to 99 degrees",
        ),
        _goldstein("goldstein", 0.0, "the notebook's second top, released at rest (alpha = 1.4981)"),
        _goldstein(
            "goldstein-falling", -_ALPHA_RATE, "the second top with the printed alpha = 1.6, theta falling at first"
        ),
        _goldstein(
            "goldstein-rising", _ALPHA_RATE, "the second top with the printed alpha = 1.6, theta rising at first"
        ),
        _fast_nutation("cusp", 0.0, "released from rest: the axis comes to rest again at each cusp"),
        _fast_nutation("loop", -0.3, "started against its precession: the axis draws loops"),
        _fast_nutation("wave", 0.1, "started along its precession: the axis draws a wave"),
        Scene(
            "fast",
            SymmetricTop(2.0, 1.0, 2.0),
            Angles(theta=0.5, psi_dot=100.0),
            8.0,
            "a very fast spin: 64 small nutations, gravity a perturbation of the free top",
        ),
        Scene(
            "steady",
            SymmetricTop(2.0, 1.0, 2.0),
            Angles(theta=third, phi_dot=1.0, psi_dot=2.5),
            20.0,
            "exactly steady precession: whatever nutates here is error",
        ),
        Scene(
            "hairer-lubich-wanner",
            SymmetricTop(0.5, 1.0, 1.0),
            Angles(theta=math.acos(0.6), phi=2.0 * math.atan(2.0), theta_dot=0.4, phi_dot=2.5, psi_dot=-1.1),
            30.0,
            "the flat top of Geometric Numerical Integration, figure VII.5.3",
        ),
        Scene(
            "simo-wong",
            SymmetricTop(5.0, 1.0, 20.0),
            Angles(theta=0.05, psi_dot=50.0),
            10.0,
            "a fast top almost upright, the benchmark of structural dynamics",
        ),
        _kinon_betsch(),
        Scene(
            "bruls-cardona-arnold",
            SymmetricTop(15.234375, 0.46875, 147.15),
            Angles(theta=math.pi / 2, phi=math.pi, psi=math.pi / 2, phi_dot=-4.61538, psi_dot=150.0),
            2.0,
            "a published benchmark that grazes the lower pole at 0.00004 degrees: no place for angles",
        ),
    ]
    return {scene.name: scene for scene in catalogue}


_added: dict[str, Scene] = {}


def register_scene(entry: Scene) -> Scene:
    """Add a scene to the catalogue, so that studies and commands know it by name."""
    if not isinstance(entry, Scene):
        msg = f"register_scene needs a Scene, not {entry!r}"
        raise SymtopError(msg)
    if entry.name in _catalogue() or _added.get(entry.name, entry) != entry:
        msg = f"scene {entry.name!r} is already known; choose another name"
        raise SymtopError(msg)
    _added[entry.name] = entry
    return entry


def added_scenes() -> list[str]:
    """Names of the scenes that were registered by the user."""
    return list(_added)


class _Scenes(Catalogue[Scene]):
    columns = ("name", "horizon", "nutation_period", "observes", "purpose")


def scenes() -> dict[str, Scene]:
    """All known scenes, by name."""
    return _Scenes({**_catalogue(), **_added})


def scene(name: "str | Scene") -> Scene:
    """The scene of that name; a Scene is returned as it is."""
    if isinstance(name, Scene):
        return name
    known = scenes()
    return known[one_of("scene", name, known)]
