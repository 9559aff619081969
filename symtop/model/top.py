"""The heavy symmetric (Lagrange) top: its parameters, starts, energy, momenta and effective potential.

Euler angles z-x-z: phi precession, theta nutation, psi spin; the axis of the top is
``e = (sin theta sin phi, -sin theta cos phi, cos theta)``. The Lagrangian is

    L = I1/2 (theta'^2 + phi'^2 sin^2 theta) + I3/2 (psi' + phi' cos theta)^2 - mgl cos theta

phi and psi are cyclic, so that ``p_psi = I3 (psi' + phi' cos theta)`` and
``p_phi = I1 phi' sin^2 theta + p_psi cos theta`` are conserved, and theta moves in the potential

    V(theta) = (p_phi - p_psi cos theta)^2 / (2 I1 sin^2 theta) + mgl cos theta.

The constant p_psi^2 / 2 I3 of the energy E is no part of V, nor of `potential`: ``E0 - p_psi^2 / 2 I3 - min V`` is the
energy of the nutation, which energy errors are divided by.

The fraction cancels near a pole. With ``x = theta/2``, ``north = p_phi - p_psi`` (zero if the axis can pass theta = 0)
and ``south = p_phi + p_psi`` (zero if it can pass theta = pi) it is a sum without subtraction, exact to rounding:

    V      = F^2 / (8 I1) + mgl cos theta,      F    = north cot x + south tan x
    V'     = F F' / (4 I1) - mgl sin theta,     F'   = (south / cos^2 x - north / sin^2 x) / 2
    V''    = (F'^2 + F F'') / (4 I1) - mgl cos theta
    phi'   = (north / sin^2 x + south / cos^2 x) / (4 I1),      psi' = p_psi/I3 - phi' cos theta

A start may also be a quaternion with an angular velocity w in the body frame, whose third axis is that of the top,

    theta' = w1 cos psi - w2 sin psi,    phi' sin theta = w1 sin psi + w2 cos psi,    psi' = w3 - phi' cos theta.

At a pole, where phi and psi are one angle, psi is chosen such that w1 sin psi + w2 cos psi vanishes: phi' is zero and
the rates hold all of w. Units are any consistent set. Source: Goldstein, Classical Mechanics, sections 4.4, 4.9 and
5.7; the half-angle form is the partial-fraction split of ``(b - a u)/(1 - u^2)`` that Klein and Sommerfeld use.
"""

import functools
import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np

from symtop.core.errors import SymtopError, finite, positive, row, shown
from symtop.core.jit_functions import inlined, shared
from symtop.core.numbers import EPSILON

Start = TypeVar("Start")

UNIT_LENGTH = 1e-6  # a quaternion or an axis may differ from unit length by this


def vector(name: str, value: object, size: int) -> list[float]:
    """A row of so many finite numbers."""
    numbers = row(name, value)
    if len(numbers) != size:
        raise SymtopError(f"{name} must be {size} numbers, not {len(numbers)}")
    return numbers


def unit(name: str, value: object, size: int) -> list[float]:
    """A row of numbers of unit length, brought to it exactly."""
    numbers = vector(name, value, size)
    length = math.sqrt(math.fsum(number * number for number in numbers))
    if abs(length - 1.0) > UNIT_LENGTH:
        raise SymtopError(f"{name} must have unit length, not {length:.9g}", name)
    return [number / length for number in numbers]


def body_frame(quaternion: Sequence[float], space: Sequence[float]) -> list[float]:
    """A vector of the space frame in the body frame: q* v q."""
    w, x, y, z = quaternion
    a, b, c = space
    # v + 2 r x (r x v - w v), r the vector part
    p, q, s = y * c - z * b - w * a, z * a - x * c - w * b, x * b - y * a - w * c
    return [a + 2.0 * (y * s - z * q), b + 2.0 * (z * p - x * s), c + 2.0 * (x * q - y * p)]


def _euler_angles(theta: float, total: float, difference: float, rates: Sequence[float]) -> tuple[float, ...]:
    """Angles and rates from theta, phi + psi, phi - psi and the body's angular velocity."""
    w1, w2, w3 = rates
    sine, phi, psi = math.sin(theta), 0.5 * (total + difference), 0.5 * (total - difference)
    c, s = math.cos(psi), math.sin(psi)
    swing = w1 * s + w2 * c
    # so near a pole that the rounding of phi' and psi', which nearly cancel, changes w3 by more than the tilt: drop it
    if sine * sine * math.hypot(w1, w2, w3) < EPSILON * abs(swing) or theta in (0.0, math.pi):
        theta, psi = 0.0 if theta < 1.0 else math.pi, -math.atan2(w2, w1)
        phi = total - psi if theta == 0.0 else difference + psi
        return theta, phi, psi, math.hypot(w1, w2), 0.0, w3
    phi_dot = swing / sine
    return theta, phi, psi, w1 * c - w2 * s, phi_dot, w3 - phi_dot * math.cos(theta)


@inlined
def effective_force(theta: Any, north: Any, south: Any, I1: Any, mgl: Any) -> Any:
    """Return ``V'(theta)``, ``phi'`` and ``cos theta``, on floats, on arrays or compiled: all that one kick needs."""
    return half_angle_force(np.sin(0.5 * theta), np.cos(0.5 * theta), north, south, I1, mgl)


@inlined
def half_angle_force(sin_x: Any, cos_x: Any, north: Any, south: Any, I1: Any, mgl: Any) -> Any:
    """`effective_force` from the sine and cosine of theta/2, for kernels that already have them."""
    up = north / (sin_x * sin_x)
    down = south / (cos_x * cos_x)
    tilt = sin_x * cos_x  # sin(theta)/2, and F = tilt (up + down)
    slope = tilt * ((up + down) * (down - up) / (8.0 * I1) - 2.0 * mgl)
    return slope, (up + down) / (4.0 * I1), cos_x * cos_x - sin_x * sin_x


@inlined
def effective_stiffness(theta: Any, north: Any, south: Any, I1: Any, mgl: Any) -> Any:
    """Return ``V''(theta)``; at a steady precession ``sqrt(V''/I1)`` is the nutation frequency."""
    sin_x, cos_x = np.sin(0.5 * theta), np.cos(0.5 * theta)
    up, down = north / (sin_x * sin_x), south / (cos_x * cos_x)
    tilt, slope = sin_x * cos_x, 0.5 * (down - up)
    bend = 0.5 * (down * sin_x / cos_x + up * cos_x / sin_x)
    return (slope * slope + tilt * (up + down) * bend) / (4.0 * I1) - mgl * (cos_x * cos_x - sin_x * sin_x)


@inlined
def effective_potential(theta: Any, north: Any, south: Any, I1: Any, mgl: Any) -> Any:
    """Return ``V(theta)``, without the constant ``p_psi^2 / 2 I3``."""
    sin_x, cos_x = np.sin(0.5 * theta), np.cos(0.5 * theta)
    lever = north * cos_x / sin_x + south * sin_x / cos_x
    return lever * lever / (8.0 * I1) + mgl * (cos_x * cos_x - sin_x * sin_x)


NUMBERS = ("I1", "I3", "mgl", "theta", "phi", "psi", "theta_dot", "phi_dot", "psi_dot")  # of a top and a start
MOMENT_SLACK = 1e-12  # relative tolerance of the inequalities between moments, which are given rounded
LARGEST = 1e40  # of any parameter or rate, and one over the smallest inertia: squares of squares stay finite
HEAVY_MOMENTUM = 128.0  # a larger momentum is counted in another unit by a series
LOOSE_PERIOD = 1e-6  # relative: a period whose rounding error may be larger is compared with the exact one
BISECTIONS = 60  # of an interval of cosines at most 2 wide: to the last place


def bounded(name: str, value: object, least: float = 0.0) -> float:
    """Return `value` as a float of at most `LARGEST` in size."""
    number = finite(name, value)
    if not least <= abs(number) <= LARGEST:
        raise SymtopError(f"{name} must be between {least:g} and {LARGEST:g} in size, not {number!r}", name)
    return number


class Momenta(NamedTuple):
    """The two conserved momenta, with the two combinations that are small near a pole."""

    p_phi: float
    p_psi: float
    north: float  # p_phi - p_psi, computed without cancellation near theta = 0
    south: float  # p_phi + p_psi, computed without cancellation near theta = pi


@dataclass(frozen=True, slots=True)
class Angles:
    """Euler angles z-x-z, rad, theta in [0, pi] from the upward vertical or SymtopError; rates in rad a unit time."""

    theta: float
    phi: float = 0.0
    psi: float = 0.0
    theta_dot: float = 0.0
    phi_dot: float = 0.0
    psi_dot: float = 0.0

    def __post_init__(self) -> None:
        for name in self.__slots__:
            object.__setattr__(self, name, bounded(name, getattr(self, name)))
        if not 0.0 <= self.theta <= math.pi:
            raise SymtopError(f"theta must lie in [0, pi], not {self.theta!r}")

    @classmethod
    def from_quaternion(
        cls, quaternion: Sequence[float], *, omega_body: Sequence[float] | None = None,
        omega_space: Sequence[float] | None = None,
    ) -> "Angles":  # fmt: skip
        """A start from a unit quaternion (w, x, y, z), body to space, the body's third axis along the top.

        The angular velocity (3,), rad per unit time, is in the body frame or in the space frame; at rest without one.
        """
        if omega_body is not None and omega_space is not None:
            raise SymtopError("give omega_body or omega_space, not both")
        q, name = unit("quaternion", quaternion, 4), "omega_body" if omega_space is None else "omega_space"
        rates = omega_body if omega_space is None else omega_space
        omega = vector(name, (0.0, 0.0, 0.0) if rates is None else rates, 3)
        w, x, y, z = q
        theta = min(2.0 * math.atan2(math.hypot(x, y), math.hypot(w, z)), math.pi)
        total, difference = 2.0 * math.atan2(z, w), 2.0 * math.atan2(y, x)  # phi + psi and phi - psi
        return cls(*_euler_angles(theta, total, difference, omega if omega_space is None else body_frame(q, omega)))

    @classmethod
    def from_axis(cls, top: "SymmetricTop", axis: Sequence[float], angular_momentum: Sequence[float]) -> "Angles":
        """A start from the unit axis and the angular momentum about the fixed point, both (3,) in the space frame.

        They leave the turn about the axis open: psi is zero, except at a pole.
        """
        if not isinstance(top, SymmetricTop):
            raise SymtopError(f"top must be a SymmetricTop, such as symtop.scene('spheroid').top, not {shown(top)}")
        e, L = unit("axis", axis, 3), vector("angular_momentum", angular_momentum, 3)
        ex, ey, ez = e
        theta, phi = math.atan2(math.hypot(ex, ey), ez), math.atan2(ex, -ey) if ex or ey else 0.0
        c, s = math.cos(phi), math.sin(phi)  # two axes of the body are e1 = (c, s, 0) and e x e1, where psi = 0
        across = L[0] * c + L[1] * s
        up = (ex * s - ey * c) * L[2] - ez * (L[0] * s - L[1] * c)  # L . (e x e1)
        along = math.fsum(axis * momentum for axis, momentum in zip(e, L, strict=True))
        return cls(*_euler_angles(theta, phi, phi, (across / top.I1, up / top.I1, along / top.I3)))

    @property
    def spin(self) -> float:
        """w3 = psi' + phi' cos theta, the angular velocity about the body's own axis."""
        return self.psi_dot + self.phi_dot * math.cos(self.theta)


def of_kind(at: object, kind: type[Start]) -> Start:
    """Return a start if it is of the kind, Angles or an Attitude; SymtopError for anything else, such as a scene."""
    if isinstance(at, kind):
        return at
    raise SymtopError(f"a start must be an instance of symtop.{kind.__name__}, not {shown(at)}")


def flat(top: "SymmetricTop", at: Angles) -> tuple[float, ...]:
    """A top and a start as nine plain numbers, in the order of `NUMBERS`; a body as the 14 of its own `flat`."""
    if not isinstance(top, SymmetricTop):
        return top.flat(at)
    return top.I1, top.I3, top.mgl, at.theta, at.phi, at.psi, at.theta_dot, at.phi_dot, at.psi_dot


def lightened(numbers: Sequence[float]) -> tuple[tuple[float, ...], float]:
    """A top or a body and a start, as `flat` has them, in a unit of mass in which momenta are near 1, and that unit.

    It is a power of two, which changes no digit, and 1 for momenta up to `HEAVY_MOMENTUM`: a series weighs momenta and
    a quaternion or an axis of length one in one norm, so that momenta far above 1 would hide the errors of the others.
    """
    masses = 3 if len(numbers) == len(NUMBERS) else 4
    if masses == 4:
        moments, rates = numbers[:3], numbers[11:]
    else:
        theta, _, _, theta_dot, phi_dot, psi_dot = numbers[3:]
        moments = numbers[0], numbers[0], numbers[1]
        rates = theta_dot, phi_dot * math.sin(theta), psi_dot + phi_dot * math.cos(theta)
    size = math.hypot(*map(operator.mul, moments, rates), math.sqrt(abs(numbers[masses - 1]) * max(moments)))
    unit = 2.0 ** math.frexp(size)[1] if size > HEAVY_MOMENTUM else 1.0
    return (*(number / unit for number in numbers[:masses]), *numbers[masses:]), unit


@inlined
def conserved(top: Any, at: Any) -> Momenta:
    """The conserved momenta of a state; compiles as it stands.

    Products and no powers: Python's ``x**2`` is the power of the C library, which differs in the last place for one
    double in a thousand, and compiled code forms the product.
    """
    p_psi = top.I3 * (at.psi_dot + at.phi_dot * math.cos(at.theta))
    sin_x, cos_x = math.sin(0.5 * at.theta), math.cos(0.5 * at.theta)
    tilt = sin_x * cos_x
    swing = 4.0 * top.I1 * at.phi_dot * (tilt * tilt)  # I1 phi' sin^2 theta
    north, south = swing - 2.0 * p_psi * sin_x * sin_x, swing + 2.0 * p_psi * cos_x * cos_x
    return Momenta(swing + p_psi * math.cos(at.theta), p_psi, north, south)


@dataclass(frozen=True, slots=True)
class SymmetricTop:
    """A rigid body with a fixed point on its axis of symmetry, in any consistent units.

    `I1` is the moment of inertia across the axis, `I3` along it, about the fixed point; `mgl` is mass x gravity x
    distance of the centre of gravity from it: 0 if free, below if hanging. SymtopError for what no body has: I3 > 2 I1.
    """

    I1: float
    I3: float
    mgl: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "I1", bounded("I1", positive("I1", self.I1), 1.0 / LARGEST))
        object.__setattr__(self, "I3", bounded("I3", positive("I3", self.I3), 1.0 / LARGEST))
        object.__setattr__(self, "mgl", bounded("mgl", self.mgl))
        if self.I3 > 2.0 * self.I1 * (1.0 + MOMENT_SLACK):
            words = f"not {self.I3!r} with I1 = {self.I1!r}"
            raise SymtopError(f"I3 must be at most 2 I1 (no rigid body exceeds it), {words}")

    @classmethod
    def from_spheroid(
        cls, mass: float, polar_radius: float, equatorial_radius: float, gravity: float = 9.81,
        pivot_distance: float | None = None,
    ) -> "SymmetricTop":  # fmt: skip
        """A solid spheroid by its radii along and across its axis. Raises SymtopError for numbers out of range.

        The fixed point lies on the axis at `pivot_distance` from the centre: ``I1`` gains ``mass * pivot_distance^2``.
        Without it this is the top of the study `notebook` and no spheroid on its tip: the lever arm is the polar
        radius, but the inertia that about the *centre of gravity*.
        """
        mass = positive("mass", mass)
        polar = positive("polar_radius", polar_radius)
        equatorial = positive("equatorial_radius", equatorial_radius)
        gravity = finite("gravity", gravity, 0.0)
        across = mass * (polar * polar + equatorial * equatorial) / 5.0
        along = 2.0 * mass * equatorial * equatorial / 5.0
        if pivot_distance is None:
            return cls(across, along, mass * gravity * polar)
        arm = finite("pivot_distance", pivot_distance)
        return cls(across + mass * arm * arm, along, mass * gravity * arm)

    @classmethod
    def from_inertia(
        cls, mass: float, at_centre: float, axial: float, distance: float, gravity: float = 9.81
    ) -> "SymmetricTop":
        """Any symmetric body, by its moments of inertia about the centre of gravity, as they are measured.

        `at_centre` is across the axis, `axial` along it; the fixed point is on the axis at a `distance` below the
        centre (negative: above, a hanging top). ``I1 = at_centre + mass distance^2`` (Huygens-Steiner). Raises
        SymtopError for numbers that no body has.
        """
        mass, arm = positive("mass", mass), finite("distance", distance)
        across, axial = positive("at_centre", at_centre), positive("axial", axial)
        if axial > 2.0 * across * (1.0 + MOMENT_SLACK):
            raise SymtopError(f"axial must be at most 2 at_centre (no rigid body exceeds it), not {axial!r}")
        return cls(across + mass * arm * arm, axial, mass * finite("gravity", gravity, 0.0) * arm)

    def spheroid_radii(self, mass: float) -> tuple[float, float]:
        """Polar and equatorial radius, as in `from_spheroid` without a pivot distance; SymtopError for no such body."""
        mass = positive("mass", mass)
        square = 5.0 * self.I3 / (2.0 * mass)
        polar_square = 5.0 * self.I1 / mass - square
        if polar_square <= 0.0:
            raise SymtopError(f"no spheroid has I1 = {self.I1!r} and I3 = {self.I3!r}: I3 must be below 2 I1")
        return math.sqrt(polar_square), math.sqrt(square)

    def momenta(self, at: Angles) -> Momenta:
        """The conserved momenta of a state, and their pole-safe combinations."""
        return conserved(self, of_kind(at, Angles))

    def energy(self, at: Angles) -> float:
        """Total energy, kinetic plus potential."""
        across = of_kind(at, Angles).theta_dot ** 2 + (at.phi_dot * math.sin(at.theta)) ** 2
        return 0.5 * self.I1 * across + 0.5 * self.I3 * at.spin**2 + self.mgl * math.cos(at.theta)

    def reduced_energy(self, theta: Any, p_theta: Any, p_phi: Any, p_psi: Any) -> Any:
        """Energy of reduced states ``(theta, p_theta; p_phi, p_psi)``, floats or arrays."""
        potential = effective_potential(theta, p_phi - p_psi, p_phi + p_psi, self.I1, self.mgl)
        return p_theta**2 / (2.0 * self.I1) + p_psi**2 / (2.0 * self.I3) + potential

    def potential(self, theta: Any, momenta: Momenta) -> Any:
        """Effective potential ``V(theta)`` at the given momenta."""
        return effective_potential(theta, momenta.north, momenta.south, self.I1, self.mgl)

    def potential_slope(self, theta: Any, momenta: Momenta) -> Any:
        """``dV/dtheta``."""
        return effective_force(theta, momenta.north, momenta.south, self.I1, self.mgl)[0]

    def potential_curvature(self, theta: Any, momenta: Momenta) -> Any:
        """``d2V/dtheta2``."""
        return effective_stiffness(theta, momenta.north, momenta.south, self.I1, self.mgl)

    def steady_theta(self, momenta: Momenta) -> float:
        """The inclination at which these momenta precess steadily: the minimum of V."""
        return _steady_theta(self, momenta)

    def nutation_frequency(self, momenta: Momenta) -> float:
        """Angular frequency of small nutations about the steady precession with these momenta.

        Of a sleeping top, whose axis passes the pole, that of the signed angle: half of 2 pi/`nutation_period`.
        """
        theta = self.steady_theta(momenta)
        if theta in (0.0, math.pi):
            # x cot(x)-like limit of V'': one momentum combination vanishes, the other is 2 I3 w3
            momentum = momenta.south if theta == 0.0 else momenta.north
            mgl = self.mgl if theta == 0.0 else -self.mgl
            return math.sqrt(max(momentum**2 / 16.0 - self.I1 * mgl, 0.0)) / self.I1
        return math.sqrt(max(self.potential_curvature(theta, momenta), 0.0) / self.I1)

    def turning_cosines(self, at: Angles) -> tuple[float, float]:
        """The two values of cos(theta) between which this motion nutates, lower one first.

        The roots in [-1, 1] of ``(1-u^2)(alpha - beta u) - (b - a u)^2`` to 1e-14, or 1e-8 where the two coincide.
        """
        return turning_cosines(self, of_kind(at, Angles))

    def nutation_period(self, at: Angles) -> float:
        """Time of one nutation, ``2 pi / AGM(sqrt(beta (u3-u1)), sqrt(beta (u3-u2)))``; inf on a separatrix.

        Where both turning points meet it has half the digits, beside the upright or hanging axis fewer or none:
        `ClosedForm.nutation_period` has all, and `Scene.nutation_period` takes it there.
        """
        return nutation_period(self, of_kind(at, Angles))


# the nutation of a state; all of it compiles as it stands


@shared
def nutation_cubic(top: Any, at: Any) -> tuple[float, float, float, float]:
    """alpha - beta cos(theta), beta, a and b of Goldstein's nutation cubic."""
    momenta, swing = conserved(top, at), at.phi_dot * math.sin(at.theta)
    excess = at.theta_dot * at.theta_dot + swing * swing
    return excess, 2.0 * top.mgl / top.I1, momenta.p_psi / top.I1, momenta.p_phi / top.I1


def newton_between(
    value: Callable[[float], float], slope: Callable[[float], float], below: float, above: float
) -> float:
    """The root of a function that is negative at `below` and positive at `above`.

    Newton's method from the middle, until a step is at most two units in the last place of the root; bisection where a
    step leaves the interval that holds the root. With a slope k times too large the final error is k times larger.
    """
    x, before = 0.5 * (below + above), math.inf
    while x != before:
        y, rise = value(x), slope(x)
        below, above = (x, above) if y < 0.0 else (below, x)
        newton = x - y / rise if rise > 0.0 else math.nan
        inside = newton if below < newton < above else 0.5 * (below + above)
        x, before = (x if abs(newton - x) <= 2.0 * math.ulp(x) else inside), x
    return x


@functools.lru_cache(maxsize=1024)
def _steady_theta(top: SymmetricTop, momenta: Momenta) -> float:
    """The minimum of V; cached, as the guard, the energy scale and the landmarks of a start all use it."""
    # a pole that these momenta allow is a minimum of V if (2 I3 w3)^2 >= 16 I1 mgl there
    if momenta.north == 0.0 and momenta.south * momenta.south >= 16.0 * top.I1 * top.mgl:
        return 0.0
    if momenta.south == 0.0 and momenta.north * momenta.north >= 16.0 * top.I1 * -top.mgl:
        return math.pi
    below, above = 1e-9, math.pi - 1e-9
    if top.potential_slope(below, momenta) >= 0.0:  # the minimum is within 1e-9 of the pole
        return 0.0
    if top.potential_slope(above, momenta) <= 0.0:
        return math.pi
    return newton_between(
        lambda theta: float(top.potential_slope(theta, momenta)),
        lambda theta: float(top.potential_curvature(theta, momenta)), below, above,
    )  # fmt: skip


@shared
def turning_cosines(top: Any, at: Any) -> tuple[float, float]:
    """`SymmetricTop.turning_cosines` of any records with these fields: bisections of both at a time."""
    cubic, start = nutation_cubic(top, at), math.cos(at.theta)
    rests = top.mgl == 0.0 and at.theta_dot == 0.0 and at.phi_dot * math.sin(at.theta) == 0.0
    if rests and cubic[2] * cubic[2] == 0.0:  # nothing turns the axis, and the cubic vanishes at every cosine
        return start, start
    low, high, below, above = -1.0, 1.0, start, start
    for _ in range(BISECTIONS):
        low, below, high, above = bisected(cubic, start, low, below, high, above)
    return 0.5 * (low + below), 0.5 * (high + above)


@inlined
def bisected(
    cubic: tuple[float, float, float, float], start: float, low: float, below: float, high: float, above: float
) -> tuple[float, float, float, float]:
    """Half of the two intervals that hold the turning cosines, `low` to `below` and `above` to `high`."""
    u, v = 0.5 * (low + below), 0.5 * (high + above)
    beyond, past = _cubic_value(cubic, start, u) < 0.0, _cubic_value(cubic, start, v) < 0.0
    return (u if beyond else low), (below if beyond else u), (v if past else high), (above if past else v)


@inlined
def _cubic_value(cubic: tuple[float, float, float, float], start: float, u: float) -> float:
    """u'^2 at the cosine u: the nutation cubic, negative where the axis does not go."""
    excess, beta, a, b = cubic
    lever = b - a * u
    return (1.0 - u * u) * (excess + beta * (start - u)) - lever * lever


@shared
def nutation_period(top: Any, at: Any) -> float:
    """`SymmetricTop.nutation_period` of any records with these fields."""
    return period_between(top, at, *turning_cosines(top, at))


@shared
def period_between(top: Any, at: Any, low: float, high: float) -> float:
    """The period of a nutation between two turning cosines that are known."""
    frequency, _ = mean_nutation(top, at, low, high)
    return 2.0 * math.pi / frequency if frequency > 0.0 else math.inf


@shared
def is_loose(top: Any, at: Any, low: float, high: float) -> bool:
    """May the relative rounding error of `period_between` be larger than `LOOSE_PERIOD`?

    That of an AGM is at most the larger one of its arguments x and y. Both are differences of turning cosines, which
    cancel as the top nears its separatrix.
    """
    cubic, start = nutation_cubic(top, at), math.cos(at.theta)
    excess, beta, a, _ = cubic
    (x2, y2), width, heavy = _root_gaps(cubic, start, low, high), high - low, abs(beta)
    if not (x2 > 0.0 and y2 > 0.0):
        return True
    down, up = _cosine_error(cubic, start, low, width, x2), _cosine_error(cubic, start, high, width, y2)
    rounding = 4.0 * EPSILON * (excess + a * a + 4.0 * heavy)
    error = max((rounding + heavy * (2.0 * down + up)) / x2, (rounding + heavy * (down + 2.0 * up)) / y2)
    return not 0.5 * error <= LOOSE_PERIOD


@shared
def _cosine_error(cubic: tuple[float, float, float, float], start: float, u: float, width: float, rise: float) -> float:
    """Rounding error d of the turning cosine u, ``d (d + width) rise`` being that of the cubic beside it."""
    excess, beta, a, b = cubic
    square, size = 1.0 - u * u, abs(a) + abs(b)
    terms = abs(excess + beta * (start - u)) + 2.0 * abs(b - a * u) * size + 2.0 * square * (excess + abs(beta))
    error = (EPSILON * terms + (EPSILON * size) ** 2) / rise
    return EPSILON + 2.0 * error / (EPSILON + width + math.sqrt(width * width + 4.0 * error))


@inlined
def _root_gaps(cubic: tuple[float, float, float, float], start: float, low: float, high: float) -> tuple[float, float]:
    """beta (u3 - u1) and beta (u3 - u2), for u1 `low` and u2 `high`.

    Vieta: beta (u1 + u2 + u3) = alpha + a^2, so that beta -> 0 (the free top) is not a special case.
    """
    excess, beta, a, _ = cubic
    total = excess + beta * start + a * a
    return total - beta * (2.0 * low + high), total - beta * (low + 2.0 * high)


@shared
def mean_nutation(top: Any, at: Any, low: float, high: float) -> tuple[float, float]:
    """The AGM of sqrt(beta (u3-u1)) and sqrt(beta (u3-u2)), and the mean of beta (u - u1), u the cosine.

    The mean is ``sum 2^(n-1) c_n^2``, c_0^2 = x^2 - y^2 and c_(n+1) = (x - y)/2 along the AGM (DLMF 19.8.6).
    """
    cubic = nutation_cubic(top, at)
    beta, (x, y) = cubic[1], _root_gaps(cubic, math.cos(at.theta), low, high)
    x, y = math.sqrt(max(x, 0.0)), math.sqrt(max(y, 0.0))
    mean, weight = 0.5 * beta * (high - low), 1.0
    while abs(x - y) > 4e-16 * x and x > 0.0 and y > 0.0:
        gap = 0.5 * (x - y)
        mean += weight * gap * gap
        weight *= 2.0
        x, y = 0.5 * (x + y), math.sqrt(x * y)
    return (y if x > 0.0 else 0.0), mean  # x = 0: a hanging top on its separatrix
