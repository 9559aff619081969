"""Free bodies of 13 kinds, and their motion in many digits by another way than that of `symtop.model.exact.free_body`.

Here the attitude is an integral of the third kind and an arctangent, by Carlson's forms, with digits for what cancels.
"""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from symtop.core.numbers import context
from tests.judging.blind.right import product

DIGITS, GUARD = 50, 50
UNIT = 2.0**-53
KINDS = (
    "generic", "near separatrix", "separatrix", "near symmetric", "symmetric", "near sphere", "sphere", "wobble",
    "near middle axis", "needle", "principal", "units", "at rest",
)  # fmt: skip


class Body(NamedTuple):
    """A free body and its start."""

    kind: str
    inertia: np.ndarray
    quaternion: np.ndarray
    momentum: np.ndarray


def bodies(count: int, seed: int, kinds: tuple[str, ...] = KINDS) -> Iterator[Body]:  # noqa: C901
    """So many bodies, of each kind in turn, their axes in any order."""
    rng = np.random.default_rng(seed)
    for i in range(count):
        kind, inertia, momentum = kinds[i % len(kinds)], np.sort(rng.uniform(0.3, 1.0, 3)), rng.normal(size=3)
        inertia[2] = min(inertia[2], 0.999 * (inertia[0] + inertia[1]))
        small, sign, place = 10.0 ** -rng.uniform(1, 16), rng.choice([-1, 1]), rng.integers(2)
        if kind == "near separatrix":
            up, down = 1 / inertia[1] - 1 / inertia[2], 1 / inertia[0] - 1 / inertia[1]
            momentum[0] = momentum[2] * math.sqrt(up / down) * (1 + sign * small)
        elif kind == "separatrix":  # exactly: (3 - 2) 6 M1^2 = (6 - 3) 2 M3^2
            inertia, momentum[2] = np.array([2.0, 3.0, 6.0]), sign * momentum[0]
        elif kind in ("near symmetric", "symmetric"):
            inertia[place + 1] = inertia[place] * (1 + (small if kind == "near symmetric" else 0.0))
        elif kind in ("near sphere", "sphere"):
            inertia = inertia[0] * (1 + (small if kind == "near sphere" else 0.0) * rng.uniform(0, 1, 3))
        elif kind == "wobble":
            momentum *= np.where(np.arange(3) == 2 * place, 1.0, small)
        elif kind == "near middle axis":
            momentum *= np.where(np.arange(3) == 1, 1.0, small)
        elif kind == "needle":
            inertia[0] *= 10.0 ** -rng.uniform(0, 4)
        elif kind == "principal":
            momentum *= np.arange(3) == rng.integers(3)
        elif kind == "units":
            inertia, momentum = inertia * 10.0 ** rng.uniform(-30, 30), momentum * 10.0 ** rng.uniform(-30, 30)
        elif kind == "at rest":
            momentum *= 0.0
        order = rng.permutation(3)
        yield Body(kind, inertia[order], rng.normal(size=4), momentum[order])


class PreciseBody:
    """The motion of a free body, its numbers read exactly: `states` are (q, M) in mpf, `period` may be None."""

    def __init__(self, inertia: Any, quaternion: Any, momentum: Any, digits: int = DIGITS) -> None:
        self.mp = mp = context(digits + GUARD)
        moments, momentum, start = ([mp.convert(value) for value in row] for row in (inertia, momentum, quaternion))
        self.start, self.given = np.array([value / mp.norm(start) for value in start]), momentum
        self.G, rates = mp.norm(momentum), [1 / value for value in moments]
        low, middle, high = sorted(range(3), key=lambda i: moments[i])
        outer = (moments[high] - moments[middle]) * moments[low] * momentum[high] ** 2
        gap = outer - (moments[middle] - moments[low]) * moments[high] * momentum[low] ** 2  # without a rounding
        self.axes = axes = (low, middle, high) if gap >= 0 else (high, middle, low)
        last_sign = -1 if momentum[axes[2]] < 0 else 1
        self.signs = (1, last_sign if (axes[1] - axes[0]) % 3 == 1 else -last_sign, last_sign)
        self.m = m1, m2, m3 = [sign * momentum[axis] for sign, axis in zip(self.signs, axes, strict=True)]
        a1, a2, self.a3 = (rates[axis] for axis in axes)
        self.s, alpha, beta, gamma = 1 if gap >= 0 else -1, abs(a1 - a2), abs(a2 - self.a3), abs(a1 - self.a3)
        self.period = None
        self.steady = not any((beta * m2 * m3, gamma * m1 * m3, alpha * m1 * m2))
        if self.steady:
            moving = [rate for rate, value in zip(rates, momentum, strict=True) if value]
            self.rate = self.G * moving[0] if moving else mp.zero
            return
        a, self.b, self.gamma = alpha / gamma, beta / gamma, gamma
        self.A1, self.A3 = mp.sqrt(m1**2 + self.b * m2**2), mp.sqrt(m3**2 + a * m2**2)
        self.A2, self.nu = self.s * self.A1 / mp.sqrt(self.b), a / self.b
        self.k2 = self.nu * (self.A1 / self.A3) ** 2
        k1 = self.s * gap * rates[0] * rates[1] * rates[2] / (beta * self.A3**2)
        self.kc = mp.sqrt(k1)
        self.rate = mp.sqrt(beta * gamma) * self.A3
        self.K = mp.pi / (2 * mp.agm(1, self.kc)) if k1 else None
        self.period = 4 * self.K / self.rate if k1 else None
        self.back = -1 if m1 < 0 and not k1 else 1  # M1 and M2 change their signs together
        sn, cn, dn = self.back * m2 / self.A2, self.back * m1 / self.A1, m3 / self.A3
        self.u0 = sn * mp.elliprf(cn**2, dn**2, 1)
        if cn < 0:
            self.u0 = (2 if sn >= 0 else -2) * self.K - self.u0
        self.whole = self._third(mp.one, mp.zero, self.kc) if k1 else None
        self.psi0 = self._swing(self.u0)[1]
        self.constant = product(self.start, self._body(self._frame(self.m, mp.zero), -1))

    def states(self, times: Any) -> list[tuple[Any, ...]]:
        """Quaternion and momentum in body axes at each time."""
        return [self._state(self.mp.convert(t)) for t in times]

    def _state(self, t: Any) -> tuple[Any, ...]:
        mp = self.mp
        if self.steady:
            half, axis = self.rate * t / 2, [value / self.G if self.G else 0 for value in self.given]
            turn = np.array([mp.cos(half), *(value * mp.sin(half) for value in axis)])
            return *product(self.start, turn), *self.given
        m, psi = self._swing(self.u0 + self.rate * t)
        turned = self._body(self._frame(m, self.a3 * self.G * t + psi - self.psi0))
        return *product(self.constant, turned), *self._body((0, *m))[1:]

    def _swing(self, u: Any) -> tuple[tuple[Any, Any, Any], Any]:
        """Momentum and psi less its linear part, at u."""
        mp, turns = self.mp, 0
        if self.K is None:
            sn, cn, dn = mp.tanh(u), mp.sech(u), mp.sech(u)
        else:
            turns = mp.nint(u / (2 * self.K))
            sn, cn, dn = self._jacobi(u - 2 * turns * self.K)
        side = -1 if turns % 2 else 1
        third, root = self._third(sn, cn, dn) + (2 * turns * self.whole if turns else 0), mp.sqrt(self.b)
        angle = mp.atan2(sn, root * cn) + turns * mp.pi  # tan(phi)/sqrt(b)
        psi = self.s * self.gamma / self.rate * (self.G * third - self.A3 * root * angle)
        return (self.back * side * self.A1 * cn, self.back * side * self.A2 * sn, self.A3 * dn), psi

    def _third(self, sn: Any, cn: Any, dn: Any) -> Any:
        """The integral of du/(1 + nu sn^2) for abs(u) <= K."""
        mp = self.mp
        first = sn * mp.elliprf(cn**2, dn**2, 1)
        return first - self.nu / 3 * sn**3 * mp.elliprj(cn**2, dn**2, 1, 1 + self.nu * sn**2)

    def _jacobi(self, u: Any) -> tuple[Any, Any, Any]:
        """sn, cn, dn for abs(u) <= K by descending means; what cancels in dn is covered by `GUARD`."""
        mp = self.mp
        mean, geometric, gap, ratios = mp.one, self.kc, mp.sqrt(self.k2), []
        while gap > mean * mp.eps:
            mean, geometric, gap = (mean + geometric) / 2, mp.sqrt(mean * geometric), (mean - geometric) / 2
            ratios.append(gap / mean)
        angle = 2 ** len(ratios) * mean * u
        for ratio in reversed(ratios):
            angle = (angle + mp.asin(ratio * mp.sin(angle))) / 2
        sn, cn = mp.sin(angle), mp.cos(angle)
        return sn, cn, mp.sqrt(self.kc**2 + self.k2 * cn**2)

    def _frame(self, m: Any, psi: Any) -> tuple[Any, ...]:
        """exp(k psi/2) and the shortest turn of m to axis 3, in canonical axes."""
        mp, n = self.mp, [value / self.G for value in m]
        half = mp.sqrt(2 * (1 + n[2]))
        turn, shortest = (mp.cos(psi / 2), 0, 0, mp.sin(psi / 2)), (half / 2, n[1] / half, -n[0] / half, 0)
        return product(np.array(turn), np.array(shortest))

    def _body(self, canonical: tuple[Any, ...], way: int = 1) -> tuple[Any, ...]:
        """A quaternion, or its inverse, in body axes."""
        vector = [self.mp.zero] * 3
        for sign, axis, value in zip(self.signs, self.axes, canonical[1:], strict=True):
            vector[axis] = way * sign * value
        return np.array([canonical[0], *vector])


def apart(mp: Any, quaternion: Any, true: Any) -> float:
    """Angle between two attitudes, rad: 2 |q - q'|, which holds for small angles."""
    return float(2 * mp.norm([mp.convert(float(a)) - b for a, b in zip(quaternion, true, strict=True)]))
