"""The motion of a heavy rigid body with a fixed point, by Taylor's series in extended precision, with a bound.

    q' = q omega/2,    omega_i = M_i/I_i,    M' = M x omega + Gamma x c,    Gamma = R(q)^T (0, 0, 1),    V = Gamma.c

in body axes, c the weight times the centre of mass. Three different moments, or a centre off the axis, have no closed
form: this is an integration and is never called exact.

heyoka integrates in long double (64 bits): one run with a tolerance of 1e-5 of the rounding unit, which is returned,
and two with 1e-2. These two have steps of at most `SHORTER` of the mean step, because runs with equal steps share most
of their rounding, and the start and 1/I off by one unit, up and down in two patterns, because these are rounded, too.
The bound is `SAFETY` times the largest distance from these two up to that time, at the samples and at `CHECKS` others.
With `precise`, all three are compared with a run in quadruple precision (113 bits, 5 times as long), whose error is
smaller by the ratio of the units, 2^-49, as long as the distance is small (`LINEAR`). Where the bound exceeds the given
accuracy the motion is lost (chaos). All runs advance together, by `STRETCH` steps of the returned one, until then.
Source: Jorba and Zou, Experimental Mathematics 14 (2005) 99; Biscani and Izzo, MNRAS 504 (2021) 2614.
"""

import copy
import functools
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symtop.core.errors import SymtopError
from symtop.core.numbers import context, real_numbers
from symtop.model.charts import Array
from symtop.model.exact.free_body import BodyMotion, checked_body, checked_times

LONG, QUAD = 2.0**-63, 2.0**-112  # rounding units
TOLERANCES = (1e-2 * LONG, 1e-2 * LONG, 1e-5 * LONG, 1e-2 * QUAD)  # of the runs, the last one in quadruple precision
SAFETY, LINEAR, CHECKS, SHORTER = 256.0, 1e-4, 32, 0.4
ACCURACY, PAIR = 1e-9, 2.0**-104  # rad: the default accuracy, the rounding error of a pair of doubles
MOST_STEPS = 1_000_000  # of all runs, half a minute or three; a step in quadruple precision counts as `QUAD_STEP`
STRETCH, QUAD_STEP = 10_000, 10
START_DIGITS = 60


def equations() -> list[Any]:
    """heyoka's system of (q, M) of a body; par[0], .. par[2] = 1/I1, .., par[3], .. par[5] = c."""
    import heyoka as hy  # Linux only

    w, x, y, z, m1, m2, m3 = hy.make_vars("w", "x", "y", "z", "m1", "m2", "m3")
    a1, a2, a3, c1, c2, c3 = (hy.par[i] for i in range(6))
    o1, o2, o3 = a1 * m1, a2 * m2, a3 * m3
    g1, g2, g3 = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z
    return [
        (w, -0.5 * (x * o1 + y * o2 + z * o3)),
        (x, 0.5 * (w * o1 + y * o3 - z * o2)),
        (y, 0.5 * (w * o2 - x * o3 + z * o1)),
        (z, 0.5 * (w * o3 + x * o2 - y * o1)),
        (m1, m2 * o3 - m3 * o2 + g2 * c3 - g3 * c2),
        (m2, m3 * o1 - m1 * o3 + g3 * c1 - g1 * c3),
        (m3, m1 * o2 - m2 * o1 + g1 * c2 - g2 * c1),
    ]


@functools.lru_cache(maxsize=4)
def _stepper(run: int) -> Any:
    """heyoka's integrator of a body, to be copied: the state belongs to a run."""
    import heyoka as hy

    kind = np.longdouble if run < 3 else hy.real128
    zero, tolerance = [kind("0")] * 7, kind(repr(TOLERANCES[run]))
    # compact, as it takes 5 s to compile what is unrolled
    return hy.taylor_adaptive(equations(), zero, tol=tolerance, fp_type=kind, compact_mode=True)


class HeavyBody:
    """Motion of a body with principal moments (3,) under the weight `weight` (3,), mgl times the centre's direction.

    Attitude (4,) and momentum in body axes (3,) are those at time 0, all numbers read as exact doubles, `momentum_lo`
    added to the momentum. Raises `SymtopError` for what is no body, and where heyoka is not installed.
    """

    def __init__(
        self, inertia: ArrayLike, weight: ArrayLike, quaternion: ArrayLike, momentum_body: ArrayLike,
        momentum_lo: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:  # fmt: skip
        row = checked_body(inertia, quaternion, momentum_body, momentum_lo).tolist()
        heavy = real_numbers("weight", weight)
        if heavy.shape != (3,) or not np.isfinite(heavy).all():
            raise SymtopError(f"weight must be 3 finite numbers, not {weight!r}")
        try:
            import heyoka  # noqa: F401
        except ImportError:
            words = "the motion of a heavy body needs the package heyoka, which has wheels for Linux only"
            raise SymtopError(f"{words} (elsewhere: conda-forge)") from None
        mp = context(START_DIGITS)
        start, momentum = [mp.mpf(value) for value in row[3:7]], zip(row[7:10], row[10:], strict=True)
        size = mp.norm(start)
        state = [*(value / size for value in start), *(mp.mpf(high) + mp.mpf(low) for high, low in momentum)]
        self._numbers = [*state, *(1 / mp.mpf(value) for value in row[:3]), *map(mp.mpf, heavy.tolist())]
        self._digits = lambda value: mp.nstr(value, 50)

    def samples(self, times: ArrayLike, accuracy: float = ACCURACY, *, precise: bool = False) -> BodyMotion:
        """The motion at a row of times (n,), before 0 as well, as pairs of doubles; `precise` in quadruple precision.

        Where the bound exceeds `accuracy`, rad, or beyond `MOST_STEPS`, the values are NaN and the bound is infinite;
        `BodyMotion.lost` names the first such time. Raises `SymtopError` for times that are not finite.
        """
        row = checked_times(times)
        high, low, bound = np.full((row.size, 7), np.nan), np.full((row.size, 7), np.nan), np.full(row.size, math.inf)
        known, too_long = math.inf, False
        for way in (row >= 0.0, row < 0.0):
            if way.any():
                high[way], low[way], bound[way], end, tired = self._one_way(row[way], accuracy, precise)
                known, too_long = min(known, end), too_long or tired
        lost = ~(bound <= accuracy)
        high[lost] = low[lost] = np.nan
        bound[lost] = math.inf
        return BodyMotion(high[:, :4], low[:, :4], high[:, 4:], bound, known, too_long)

    def _one_way(self, times: Array, accuracy: float, precise: bool) -> tuple[Array, Array, Array, float, bool]:
        """Values, low halves and bounds at times of one sign; until when they are known; were there too many steps?"""
        last = times[np.argmax(np.abs(times))]
        sizes = np.unique(np.abs(np.concatenate([[0.0], times, last * (np.arange(1, CHECKS + 1) / CHECKS)])))
        grid = [np.longdouble(t) for t in np.copysign(sizes, last).tolist()]
        high, bound = np.full((len(grid), 7), np.nan), np.full(len(grid), math.inf)
        low = high.copy()
        rough, other, fine = (self._run(run) for run in range(3))
        exact = [self._run(3)] if precise else []
        unit = QUAD / LONG if precise else 1.0
        done, work, known, reached = 0, 0, 0.0, LONG
        while done < len(grid) and work < MOST_STEPS:
            began, old = fine.time, min(done, 1)  # a stretch begins with the end of the one before
            states, steps = _to(fine, [began, *grid[done + 1 - old :]], STRETCH)
            new = len(states) - old
            points = [began, *grid[done + 1 - old : done + new]]
            if fine.time != points[-1]:  # the end of a stretch is compared, too
                points, states = [*points, fine.time], np.vstack([states, fine.state])
            longest = SHORTER * abs(float(fine.time - began)) / max(steps, 1) or math.inf
            runs = [_to(one, points, MOST_STEPS, longest) for one in (rough, other)]
            runs += [(states, steps), *(_to(one, points, MOST_STEPS) for one in exact)]
            work += sum(count for _, count in runs[:3]) + QUAD_STEP * sum(count for _, count in runs[3:])
            *others, (value, rest) = [_halves(states, len(points)) for states, _ in runs]
            gaps = [((first - value) + (second - rest))[:, :4] for first, second in others]
            apart = 2.0 * np.sqrt((np.square(gaps)).sum(axis=2).max(axis=0))
            apart = np.maximum.accumulate(np.where(np.isnan(apart), math.inf, np.maximum(apart, reached)))
            error = np.where(apart < LINEAR, SAFETY * unit * apart + PAIR, math.inf)
            here, there = slice(done, done + new), slice(old, old + new)
            high[here], low[here], bound[here] = value[there], rest[there], error[there]
            done, reached = done + new, apart[-1]
            if not error[-1] <= accuracy or steps < STRETCH:
                break
            known = abs(float(fine.time)) if error[-1] <= 0.5 * accuracy else known
        place = np.searchsorted(sizes, np.abs(times))
        too_long = bool(error[-1] <= accuracy) and done < len(grid) and work >= MOST_STEPS
        return high[place], low[place], bound[place], abs(float(fine.time)) if too_long else known, too_long

    def _run(self, run: int) -> Any:
        """An integrator at the start; of the first two with numbers that are off by one unit."""
        stepper = copy.copy(_stepper(run))
        kind = stepper.state.dtype.type
        off = [LONG * (-1) ** (i >> run) if run < 2 else 0.0 for i in range(13)]
        numbers = [kind(self._digits(value * (1 + e))) for value, e in zip(self._numbers, off, strict=True)]
        stepper.state[:], stepper.pars[:] = numbers[:7], numbers[7:]
        return stepper


def _to(stepper: Any, points: list[Any], most: int, longest: float = math.inf) -> tuple[Array, int]:
    """States (n, 7) of an integrator at points from its time on, fewer if it takes more than `most` steps."""
    kind = stepper.state.dtype.type
    row = np.array([kind(point) for point in points])
    heard = {"callback": lambda _: True}  # in which Python handles Ctrl-C
    _, _, _, steps, *_, states = stepper.propagate_grid(row, max_steps=most, max_delta_t=kind(longest), **heard)
    return states, int(steps)


def _halves(states: Array, n: int) -> tuple[Array, Array]:
    """States as pairs of doubles, (n, 7) each, NaN where there are fewer."""
    high, low = np.full((n, 7), np.nan), np.full((n, 7), np.nan)
    high[: len(states)] = states.astype(np.float64)
    low[: len(states)] = (states - states.astype(np.float64).astype(states.dtype)).astype(np.float64)
    return high, low
