"""Random tops of 26 families, everything between a fast top and one that grazes a pole, sleeps or climbs for ever.

Each family draws the same generic top and changes it as the name of the family says. Small gaps, down to
the last digit, are chosen from a few sizes, so that exact coincidences are among the members.
"""

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from symtop.model.top import Angles, SymmetricTop


class Draw:
    """A generic top and start, with the random numbers that a regime needs to change it."""

    def __init__(self, random: np.random.Generator) -> None:
        self.uniform = lambda low, high: float(random.uniform(low, high))
        self.pick = lambda *values: float(random.choice(values))
        self.spread = lambda low, high: math.exp(self.uniform(math.log(low), math.log(high)))
        self.sign = self.pick(-1.0, 1.0)
        self.I1, self.mgl = self.spread(0.1, 10.0), self.spread(0.05, 50.0)
        self.I3 = self.I1 * self.uniform(0.02, 2.0)
        self.theta, self.phi, self.psi = self.uniform(0.02, 3.12), self.uniform(-3.0, 3.0), self.uniform(-3.0, 3.0)
        self.rates = self.uniform(-3.0, 3.0), self.uniform(-3.0, 3.0), self.uniform(-5.0, 5.0)

    def change(
        self,
        theta: float | None = None,
        rates: tuple[float, ...] | None = None,
        I3: float | None = None,
        mgl: float | None = None,
    ) -> tuple[SymmetricTop, Angles]:
        """The generic top with some of its numbers changed."""
        top = SymmetricTop(self.I1, I3 or self.I3, self.mgl if mgl is None else mgl)
        return top, Angles(self.theta if theta is None else theta, self.phi, self.psi, *(rates or self.rates))


def _grazing(d: Draw, side: float) -> tuple[SymmetricTop, Angles]:
    """b - a (side 1) or b + a (side -1) is a small gap."""
    precession, cosine, gap = d.rates[1], math.cos(d.theta), d.pick(1e-2, 1e-4, 1e-6, 1e-8, 1e-12)
    spin = side * (precession * (d.I1 + side * (d.I1 - d.I3) * cosine) - gap) / d.I3
    return d.change(rates=(2.0 * d.sign * d.uniform(1.0, 4.0) * math.sqrt(d.mgl / d.I1), precession, spin))


def _nearly_steady(d: Draw) -> tuple[SymmetricTop, Angles]:
    """I3 w3 phi' = I1 phi'^2 cos theta + mgl, up to a small gap."""
    precession, cosine = d.sign * d.spread(0.3, 30.0), math.cos(d.theta)
    spin = (d.I1 * precession**2 * cosine + d.mgl) / (d.I3 * precession) - precession * cosine
    gap = d.pick(0.0, 1e-14, 1e-10, 1e-6)
    return d.change(rates=(d.pick(0.0, 1e-14, 1e-10, 1e-6), precession, spin * (1.0 + gap)))


def _near_separatrix(d: Draw) -> tuple[SymmetricTop, Angles]:
    """At a turning point with b = a and alpha = beta, up to small gaps."""
    theta = d.uniform(0.2, 3.0)
    precession = math.sqrt(2.0 * d.mgl / d.I1 / (1.0 + math.cos(theta))) * (1.0 + d.pick(0.0, 1e-14, -1e-11, 1e-8))
    spin = precession * (d.I1 + (d.I1 - d.I3) * math.cos(theta)) / d.I3 * (1.0 + d.pick(0.0, 1e-14, -1e-11, 1e-8))
    return d.change(theta, (0.0, precession, spin))


def _pendulum_to_the_top(d: Draw) -> tuple[SymmetricTop, Angles]:
    rate = d.sign * math.sqrt(2.0 * d.mgl / d.I1 * (1.0 - math.cos(d.theta)))
    return d.change(rates=(rate * (1.0 + d.pick(0.0, 1e-15, -1e-15, 1e-10)), 0.0, 0.0))


def _threshold_of_sleep(d: Draw) -> tuple[SymmetricTop, Angles]:
    theta, near = d.spread(1e-9, 0.1), 1.0 + d.pick(0.0, 1e-12, -1e-12, 1e-6)
    w3 = near * 2.0 * math.sqrt(d.I1 * d.mgl) / d.I3
    precession = w3 * d.I3 / (2.0 * d.I1)
    return d.change(theta, (theta * d.uniform(-1.0, 1.0), precession, w3 - precession))


MAKE: dict[str, Callable[[Draw], tuple[SymmetricTop, Angles]]] = {
    "generic": lambda d: d.change(),
    "fast": lambda d: d.change(rates=(*d.rates[:2], d.sign * d.spread(30.0, 3e4))),
    "slow": lambda d: d.change(rates=tuple(1e-3 * rate for rate in d.rates)),
    "retrograde": lambda d: d.change(rates=(d.rates[0], -5.0 * abs(d.rates[1]), 5.0 * abs(d.rates[2]))),
    "turning point": lambda d: d.change(rates=(0.0, *d.rates[1:])),
    "cusp": lambda d: d.change(rates=(0.0, 0.0, d.sign * d.spread(0.1, 100.0))),
    "plane pendulum": lambda d: d.change(rates=(d.sign * d.spread(0.01, 30.0), 0.0, 0.0)),
    "spherical pendulum": lambda d: d.change(rates=(*d.rates[:2], -d.rates[1] * math.cos(d.theta))),
    "grazes the top": lambda d: _grazing(d, 1.0),
    "grazes the bottom": lambda d: _grazing(d, -1.0),
    "through the top": lambda d: d.change(I3=d.I1, rates=(3.0 * d.rates[0], d.rates[1], d.rates[1])),
    "through the bottom": lambda d: d.change(I3=d.I1, rates=(3.0 * d.rates[0], d.rates[1], -d.rates[1])),
    "flat body": lambda d: d.change(I3=2.0 * d.I1 * (1.0 - d.pick(0.0, 1e-15, 1e-8, 1e-3))),
    "thin body": lambda d: d.change(I3=d.I1 * d.spread(1e-8, 1e-2)),
    "nearly steady": _nearly_steady,
    "near the separatrix": _near_separatrix,
    "pendulum to the top": _pendulum_to_the_top,
    "nearly free": lambda d: d.change(mgl=d.sign * d.pick(1e-3, 1e-6, 1e-10, 1e-14)),
    "free": lambda d: d.change(mgl=0.0),
    "heavy": lambda d: d.change(mgl=d.sign * 1e6 * d.uniform(0.5, 2.0)),
    "hanging": lambda d: d.change(mgl=-d.mgl),
    "from the top": lambda d: d.change(d.pick(0.0, 1e-20, 1e-9, 1e-4), mgl=d.sign * d.mgl),
    "from the bottom": lambda d: d.change(math.pi - d.pick(0.0, 4.5e-16, 1e-9, 1e-4), mgl=d.sign * d.mgl),
    "asleep": lambda d: d.change(
        d.pick(0.0, 1e-12, 1e-6), (0.0, d.rates[1], 10.0 * d.rates[2]), mgl=d.pick(-1.0, 1.0) * d.mgl
    ),
    "asleep below": lambda d: d.change(
        math.pi - d.pick(0.0, 1e-12, 1e-6), (0.0, d.rates[1], 10.0 * d.rates[2]), mgl=d.pick(-1.0, 1.0) * d.mgl
    ),
    "threshold of sleep": _threshold_of_sleep,
}
REGIMES = tuple(MAKE)


def random_top(kind: str, random: np.random.Generator) -> tuple[SymmetricTop, Angles]:
    """A top and a start of one family."""
    return MAKE[kind](Draw(random))


def tops(
    count: int, seed: int, kinds: Sequence[str] = REGIMES, first: int = 0
) -> Iterator[tuple[SymmetricTop, Angles]]:
    """`count` tops of each family, from number `first` on; a seed and a number always give the same top."""
    for kind in kinds:
        random = np.random.default_rng([seed, REGIMES.index(kind)])
        for number in range(first + count):
            top = random_top(kind, random)
            if number >= first:
                yield top
