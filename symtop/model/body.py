"""A heavy rigid body with a fixed point and three moments of inertia: its parameters, starts, energy and momenta.

Principal axes of the body; q turns body vectors into space vectors, M is the angular momentum and omega the angular
velocity in body axes, chi the unit vector from the fixed point to the centre of mass, c = mgl chi, and Gamma the
upward vertical in body axes:

    M = (I1 w1, I2 w2, I3 w3),     M' = M x omega + Gamma x c,     q' = q omega/2,     Gamma = q* k q
    E = M.omega/2 + c.Gamma,       p_phi = L_z = M.Gamma,          L = q M q*

Energy and p_phi are conserved, and all of L without a weight. With I1 = I2 and the centre on the third axis it is the
top of `symtop.model.top`, and M3 = p_psi is conserved, too. A start of a body is an `Attitude`; the natural period is

    T = 2 pi / sqrt((|L|/I2)^2 + |mgl|/I2),     I2 the middle moment.

Units are any consistent set. Source: Goldstein, Classical Mechanics, chapter 5.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError, entries, finite, positive, row
from symtop.core.jit_functions import inlined, two_product
from symtop.core.numbers import EPSILON
from symtop.model.top import LARGEST, MOMENT_SLACK, bounded, of_kind, unit, vector

SYMMETRIC_WITHIN = 1e-9  # largest difference of a matrix from its transpose, relative to its largest entry


class BodyMomenta(NamedTuple):
    """p_phi, which every body conserves, and M3 = p_psi, which a symmetric body conserves, too."""

    p_phi: float
    p_psi: float


@inlined
def vertical(w: Any, x: Any, y: Any, z: Any) -> tuple[Any, Any, Any]:
    """Gamma, the upward vertical in body axes."""
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z


def _as_stored(values: Sequence[float], scaled: Sequence[float]) -> tuple[float, ...]:
    """`scaled`, numbers of length one; `values` if that agrees to rounding, so that a stored body is read unchanged."""
    near = all(abs(float(old) - new) <= 2.0 * EPSILON for old, new in zip(values, scaled, strict=True))
    return tuple(float(number) for number in (values if near else scaled))


@dataclass(frozen=True, slots=True)
class Attitude:
    """An attitude and the angular velocity at one instant: the start of a `RigidBody`.

    `quaternion` (w, x, y, z), of length one or SymtopError, turns body vectors into space vectors; `omega_body` (3,)
    is in rad per unit time, along the principal axes of the body.
    """

    quaternion: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    omega_body: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "quaternion", _as_stored(self.quaternion, unit("quaternion", self.quaternion, 4)))
        rates = (bounded("omega_body", rate) for rate in vector("omega_body", self.omega_body, 3))
        object.__setattr__(self, "omega_body", tuple(rates))


@dataclass(frozen=True, slots=True)
class RigidBody:
    """A rigid body with a fixed point, by its principal moments of inertia about that point, in any order.

    `mgl` is mass x gravity x distance of the centre of mass, 0 for a free body; `centre` its direction in principal
    axes, of any length but zero. `axes` is the turn from principal axes to those that the matrix of `from_inertia`
    was given in, a quaternion; states and starts are in principal axes. Raises SymtopError for what no body has.
    """

    I1: float
    I2: float
    I3: float
    mgl: float = 0.0
    centre: tuple[float, float, float] = (0.0, 0.0, 1.0)
    axes: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("I1", "I2", "I3"):
            object.__setattr__(self, name, bounded(name, positive(name, getattr(self, name)), 1.0 / LARGEST))
        low, middle, high = sorted(self.moments)
        if high > (low + middle) * (1.0 + MOMENT_SLACK):
            name = ("I1", "I2", "I3")[self.moments.index(high)]
            words = f"{low + middle!r}: no rigid body exceeds it, not {high!r}"
            raise SymtopError(f"{name} must be at most the sum of the other moments, {words}", name)
        object.__setattr__(self, "mgl", bounded("mgl", self.mgl))
        centre = vector("centre", self.centre, 3)
        length = math.hypot(*centre)
        if not 1.0 / LARGEST <= length <= LARGEST:
            raise SymtopError(f"centre must be a direction and of a length above zero, not {self.centre!r}", "centre")
        object.__setattr__(self, "centre", _as_stored(centre, [part / length for part in centre]))
        object.__setattr__(self, "axes", _as_stored(self.axes, unit("axes", self.axes, 4)))

    @classmethod
    def from_inertia(
        cls, matrix: Sequence[Sequence[float]], mgl: float = 0.0, centre: Sequence[float] = (0.0, 0.0, 1.0),
        **others: float,
    ) -> "RigidBody":  # fmt: skip
        """A body by its inertia matrix (3, 3) about the fixed point and the direction of its centre, in any axes.

        A heavy one needs `mgl`, its mass times gravity times the distance of the centre from the fixed point.
        The matrix is diagonalised and the rotation kept in `axes`. The third principal axis is the one nearest to the
        centre; of a free body, the one for which the ratio of the other two moments is nearest to 1. It points to the
        side of `centre`. I1 <= I2 unless the third moment is the middle one. `in_principal` converts an attitude in
        the axes of the matrix to one of this body.
        """
        from scipy.spatial.transform import Rotation  # 0.1 s

        if unknown := sorted(others.keys() - {"mass", "gravity", "distance"}):
            raise TypeError(f"from_inertia() got an unexpected keyword argument '{unknown[0]}'")
        if others:
            words = "mgl, which is mass times gravity times the distance of the centre from the fixed point"
            raise SymtopError(f"a heavy body by its inertia needs {words}, not {', '.join(others)}", "mgl")
        rows = [vector("a row of matrix", row, 3) for row in entries("matrix", matrix, "rows of 3 numbers")]
        if len(rows) != 3:
            raise SymtopError(f"matrix must have 3 rows, not {len(rows)}", "matrix")
        inertia = np.array(rows)
        if np.abs(inertia - inertia.T).max() > SYMMETRIC_WITHIN * np.abs(inertia).max():
            raise SymtopError("matrix must be symmetric", "matrix")
        moments, turn = np.linalg.eigh(inertia)
        direction = np.array(vector("centre", centre, 3))
        index = 0 if moments[1] ** 2 > moments[0] * moments[2] else 2
        third = int(np.argmax(np.abs(turn.T @ direction))) if mgl else index
        moments, turn = np.roll(moments, 2 - third), np.roll(turn, 2 - third, axis=1)
        turn[:, 2] *= math.copysign(1.0, turn[:, 2] @ direction)
        turn[:, 0] *= math.copysign(1.0, np.linalg.det(turn))
        components = turn.T @ direction
        axes = np.roll(Rotation.from_matrix(turn).as_quat(), 1)  # scalar first
        I1, I2, I3 = moments.tolist()
        return cls(I1, I2, I3, mgl, tuple(components.tolist()), tuple(axes.tolist()))

    @classmethod
    def from_brick(cls, mass: float, sides: Sequence[float]) -> "RigidBody":
        """A free homogeneous brick by its sides (3,) along the principal axes, turning about its centre."""
        mass = positive("mass", mass)
        a, b, c = (bounded("sides", positive("sides", side)) ** 2 for side in vector("sides", sides, 3))
        return cls(mass * (b + c) / 12.0, mass * (c + a) / 12.0, mass * (a + b) / 12.0)

    @classmethod
    def from_points(
        cls, masses: Sequence[float], places: Sequence[Sequence[float]], gravity: float = 0.0
    ) -> "RigidBody":
        """Points of `masses` (n,) at `places` (n, 3) from the fixed point, in any body axes; free without `gravity`."""
        weights = np.array([positive("masses", mass) for mass in row("masses", masses)])
        rows = [vector("a place of places", place, 3) for place in entries("places", places, "rows of 3 numbers")]
        points = np.array(rows).reshape(-1, 3)
        if len(weights) != len(points):
            raise SymtopError(f"places must be as many as masses, {len(weights)}, not {len(points)}", "places")
        squares = (points * points).sum(axis=1)
        inertia = np.diag([(weights * squares).sum()] * 3) - (weights[:, None] * points).T @ points
        moment = weights @ points
        arm = float(np.linalg.norm(moment))
        pull = finite("gravity", gravity) * arm
        return cls.from_inertia(inertia.tolist(), pull, (moment if arm > 0.0 else np.array([0.0, 0.0, 1.0])).tolist())

    @property
    def moments(self) -> tuple[float, float, float]:
        """I1, I2 and I3."""
        return self.I1, self.I2, self.I3

    @property
    def torque(self) -> tuple[float, float, float]:
        """c = mgl chi, in principal axes."""
        x, y, z = self.centre
        return self.mgl * x, self.mgl * y, self.mgl * z

    @property
    def free(self) -> bool:
        """Is mgl zero?"""
        return self.mgl == 0.0

    def in_principal(self, at: Attitude) -> Attitude:
        """An attitude, with its angular velocity, in the axes of the matrix as one in principal axes."""
        w, x, y, z = self.axes
        return Attitude(product(of_kind(at, Attitude).quaternion, self.axes), rotated((w, -x, -y, -z), at.omega_body))

    def momentum(self, at: Attitude) -> tuple[float, float, float]:
        """M of a start, in body axes."""
        w1, w2, w3 = of_kind(at, Attitude).omega_body
        return self.I1 * w1, self.I2 * w2, self.I3 * w3

    def momentum_lo(self, at: Attitude) -> tuple[float, ...]:
        """The rounding errors of the products in `momentum`."""
        return tuple(two_product(moment, rate)[1] for moment, rate in zip(self.moments, at.omega_body, strict=True))

    def kinetic(self, at: Attitude) -> float:
        """Kinetic energy of a start."""
        return 0.5 * math.fsum(m * w for m, w in zip(self.momentum(at), at.omega_body, strict=True))

    def energy(self, at: Attitude) -> float:
        """Total energy of a start."""
        return self.kinetic(at) + math.fsum(c * g for c, g in zip(self.torque, vertical(*at.quaternion), strict=True))

    def momenta(self, at: Attitude) -> BodyMomenta:
        """p_phi, conserved, and M3, which is p_psi of a symmetric body."""
        M = self.momentum(at)
        return BodyMomenta(math.fsum(m * g for m, g in zip(M, vertical(*at.quaternion), strict=True)), M[2])

    def nutation_period(self, at: Attitude) -> float:
        """The natural period, see the head of `symtop.model.body`; infinite for a free body at rest."""
        middle = sorted(self.moments)[1]
        rate = math.hypot(math.hypot(*self.momentum(at)) / middle, math.sqrt(abs(self.mgl) / middle))
        return 2.0 * math.pi / rate if rate > 0.0 else math.inf

    def energy_scale(self, at: Attitude) -> float:
        """What energy errors are divided by: the kinetic energy of the start, and |mgl|."""
        return self.kinetic(at) + abs(self.mgl)

    def flat(self, at: Attitude) -> tuple[float, ...]:
        """The body and a start as 14 plain numbers: moments, mgl, centre, quaternion, omega."""
        return (*self.moments, self.mgl, *self.centre, *at.quaternion, *at.omega_body)


PARTS = {"I1": 1, "I2": 1, "I3": 1, "mgl": 1, "centre": 3, "quaternion": 4, "omega_body": 3}  # of `RigidBody.flat`


def from_flat(row: Sequence[float]) -> tuple[RigidBody, Attitude]:
    """The body and the start of the numbers that `RigidBody.flat` has made, to the bit: nothing is normalised again."""
    body, start = object.__new__(RigidBody), object.__new__(Attitude)
    values = *row[:4], tuple(row[4:7]), tuple(row[7:11]), tuple(row[11:])
    for name, value in zip((*PARTS, "axes"), (*values, (1.0, 0.0, 0.0, 0.0)), strict=True):
        object.__setattr__(start if name in Attitude.__slots__ else body, name, value)
    return body, start


@inlined
def product(a: Any, b: Any) -> tuple[float, float, float, float]:
    """The product a b of two quaternions: b first, then a, where both are rotations in space."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


def rotated(quaternion: Any, vectors: Any) -> Any:
    """q v q*, of a vector (3,) or of rows (n, 4) and (n, 3); q that is not of length one stretches by |q|^2."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion), -1, 0)
    a, b, c = np.moveaxis(np.asarray(vectors), -1, 0)
    along, size = 2.0 * (x * a + y * b + z * c), w * w - x * x - y * y - z * z
    turn, twice = (y * c - z * b, z * a - x * c, x * b - y * a), 2.0 * w
    parts = zip((a, b, c), (x, y, z), turn, strict=True)
    result = np.stack([size * v + along * r + twice * u for v, r, u in parts], axis=-1)
    return result if result.ndim > 1 else tuple(result.tolist())
