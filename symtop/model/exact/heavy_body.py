"""The motion of a heavy rigid body with a fixed point, by Taylor's series in extended precision, with a bound.

    q' = q omega/2,    omega_i = M_i/I_i,    M' = M x omega + Gamma x c,    Gamma = R(q)^T (0, 0, 1),    V = Gamma.c

in body axes, c the weight times the centre of mass. Three different moments, or a centre off the axis, have no closed
form: this is an integration and is never called exact.

heyoka integrates in long double (64 bits): one run with a tolerance of 1e-5 of the rounding unit, which is returned,
and two with 1e-2. These two have steps of at most `SHORTER_STEPS` of the mean step, because runs with equal steps share
most of their rounding, and the start and 1/I off by one unit, up and down in two patterns, because these are rounded,
too. The bound at a time is `SAFETY` times the largest distance from these two at the checks up to it and at the next
one. With `precise`, all three are compared with a run in quadruple precision (113 bits, 5 times as long), whose error
is smaller by the ratio of the units, 2^-49, as long as the distance is small (`LINEAR_RANGE`). Where the bound exceeds
`ACCURACY` the motion is lost (chaos). All runs advance together until then, as far as any call has asked for, by pieces
whose length depends on the motion alone, so that values and bounds at a time do not depend on the other times. The
state at the beginning of each piece is kept, and the Taylor polynomials of the last `PIECES` of them (0.2 MB each).
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

LONG_UNIT, QUAD_UNIT = 2.0**-63, 2.0**-112  # rounding units
TOLERANCES = (1e-2 * LONG_UNIT, 1e-2 * LONG_UNIT, 1e-5 * LONG_UNIT, 1e-2 * QUAD_UNIT)  # of the runs, the last in quad
SAFETY, LINEAR_RANGE, CHECKS, SHORTER_STEPS = 256.0, 1e-4, 8, 0.4  # `CHECKS` of them in each piece
ACCURACY, PAIR_ROUNDING = 1e-9, 2.0**-104  # rad: largest bound of a known motion; rounding error of two doubles
MOST_STEPS = 1_000_000  # of all runs, half a minute or three; a step in quadruple precision counts as `QUAD_STEP`
PIECES, QUAD_STEP = 256, 10
FIRST_TURN = 64.0  # rad: the first piece takes the time of it or of half, at the rate of the start
FEW_STEPS, MANY_STEPS = 16, 128  # steps of a piece: after fewer the next one is twice as long, after more half
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
        vector = real_numbers("weight", weight)
        if vector.shape != (3,) or not (np.abs(vector) <= 1e100).all():
            raise SymtopError(f"weight must be 3 finite numbers of at most 1e100, not {weight!r}")
        try:
            import heyoka  # noqa: F401
        except ImportError:
            words = "the motion of a heavy body needs the package heyoka, which has wheels for Linux only"
            raise SymtopError(f"{words} (elsewhere: conda-forge)") from None
        mp = context(START_DIGITS)
        start, momentum = [mp.mpf(value) for value in row[3:7]], zip(row[7:10], row[10:], strict=True)
        size = mp.norm(start)
        state = [*(value / size for value in start), *(mp.mpf(high) + mp.mpf(low) for high, low in momentum)]
        self._numbers = [*state, *(1 / mp.mpf(value) for value in row[:3]), *map(mp.mpf, vector.tolist())]
        self._digits = lambda value: mp.nstr(value, 50)
        turning, falling = np.divide(row[7:10], row[:3]), np.hypot(np.roll(vector, 1), np.roll(vector, 2)) / row[:3]
        rate = float(np.clip(np.linalg.norm(turning) + np.sqrt(falling.max()), 1e-300, 1e300))  # also of a body at rest
        self._length = 2.0 ** math.floor(math.log2(FIRST_TURN / rate))
        self._ways: dict[tuple[float, bool], _Way] = {}

    def samples(self, times: ArrayLike, *, precise: bool = False) -> BodyMotion:
        """The motion at a row of times (n,), before 0 as well, as pairs of doubles; `precise` in quadruple precision.

        Where the bound exceeds `ACCURACY`, or beyond `MOST_STEPS`, the values are NaN and the bound is infinite. Raises
        `SymtopError` for times that are not finite.
        """
        row = checked_times(times)
        high, low, bound = np.full((row.size, 7), np.nan), np.full((row.size, 7), np.nan), np.full(row.size, math.inf)
        known, too_long = math.inf, False
        for sign, mask in ((1.0, row >= 0.0), (-1.0, row < 0.0)):
            if mask.any():
                # taken out while it advances: another thread makes its own, and a run that was interrupted is dropped
                way = self._ways.pop((sign, precise), None)
                way = way or _Way([self._run(run) for run in range(4 if precise else 3)], sign * self._length)
                sizes = np.abs(row[mask])
                way.advance(sizes.max())
                high[mask], low[mask], bound[mask] = way.values(sizes)
                known, too_long = min(known, way.known()), too_long or way.short_of(sizes.max())
                self._ways[sign, precise] = way
        return BodyMotion(high[:, :4], low[:, :4], high[:, 4:], bound, known, too_long)

    def _run(self, run: int) -> Any:
        """An integrator at the start; of the first two with numbers that are off by one unit."""
        stepper = copy.copy(_stepper(run))
        kind = stepper.state.dtype.type
        errors = [LONG_UNIT * (-1) ** (i >> run) if run < 2 else 0.0 for i in range(13)]
        numbers = [kind(self._digits(value * (1 + e))) for value, e in zip(self._numbers, errors, strict=True)]
        stepper.state[:], stepper.pars[:] = numbers[:7], numbers[7:]
        return stepper


class _Way:
    """The runs in one direction of time, the last of which is returned, and what is known as far as they went."""

    def __init__(self, runs: list[Any], length: float) -> None:
        *self._others, self.main = runs
        self._length, self._unit, self._work = length, QUAD_UNIT / LONG_UNIT if len(runs) == 4 else 1.0, 0
        self.ends, self.states = [0.0], [self.main.state.copy()]  # the times between the pieces, and the states there
        self._checks, self._bounds = [0.0], [SAFETY * self._unit * LONG_UNIT + PAIR_ROUNDING]  # |t|, rad

    def known(self) -> float:
        """The last check, as |t|, before the motion is lost."""
        return self._checks[int(np.searchsorted(self._bounds, ACCURACY, "right")) - 1]

    def short_of(self, end: float) -> bool:
        """Has |t| = end not been reached, with the motion not lost?"""
        return self._checks[-1] < end and self._bounds[-1] <= ACCURACY

    def advance(self, end: float) -> None:
        """Advance all runs to |t| = end, or until the motion is lost."""
        while len(self.ends) == 1 or (self.short_of(end) and self._work < MOST_STEPS):
            self.ends.append(self.ends[-1] + self._length)
            start, stop = np.array(self.ends[-2:], np.longdouble)
            points = np.linspace(start, stop, CHECKS + 1)
            solution, steps = _piece(self, len(self.ends) - 2)
            longest = SHORTER_STEPS * abs(self._length) / steps
            self._work += steps * (QUAD_STEP if len(self._others) == 3 else 1)
            value, low = _halves(solution(_row(self.main, points)))
            gaps = []
            for run, witness in enumerate(self._others):
                options = {"max_delta_t": np.longdouble(longest)} if run < 2 else {}
                _, _, _, count, *_, states = witness.propagate_grid(points, callback=_handle_interrupt, **options)
                self._work += count
                other, other_low = _halves(states)
                gaps.append(((other - value) + (other_low - low))[1:, :4])
            distance = 2.0 * np.sqrt(np.square(gaps).sum(axis=2).max(axis=0))
            bounds = np.where(distance < LINEAR_RANGE, SAFETY * self._unit * distance + PAIR_ROUNDING, math.inf)
            self._checks += np.abs(points[1:]).astype(float).tolist()
            self._bounds += np.maximum.accumulate([self._bounds[-1], *bounds])[1:].tolist()
            self._length *= 2.0 if steps < FEW_STEPS else 0.5 if steps > MANY_STEPS else 1.0

    def values(self, sizes: Array) -> tuple[Array, Array, Array]:
        """Values, low halves and bounds at times as |t|; NaN and infinity where the motion is lost."""
        bound = np.append(self._bounds, math.inf)[np.searchsorted(self._checks, sizes)]
        bound[~(bound <= ACCURACY)] = math.inf
        high, low = np.full((sizes.size, 7), np.nan), np.full((sizes.size, 7), np.nan)
        places = np.maximum(np.searchsorted(np.abs(self.ends), sizes) - 1, 0)
        for k in np.unique(places[np.isfinite(bound)]).tolist():
            mask = np.isfinite(bound) & (places == k)
            solution, _ = _piece(self, k)
            high[mask], low[mask] = _halves(solution(_row(self.main, np.copysign(sizes[mask], self._length))))
        return high, low, bound


@functools.lru_cache(maxsize=PIECES)
def _piece(way: _Way, k: int) -> tuple[Any, int]:
    """The solution of a way in its piece k, as a function of a row of times, and its steps."""
    main = way.main
    main.time, end = _row(main, way.ends[k : k + 2])
    main.state[:] = way.states[k]
    _, _, _, steps, solution, _ = main.propagate_until(end, c_output=True, callback=_handle_interrupt)
    if len(way.states) == k + 1:
        way.states.append(main.state.copy())
    return solution, int(steps)


def _handle_interrupt(_stepper: Any) -> bool:
    """A call in each step, in which Python handles Ctrl-C."""
    return True


def _row(stepper: Any, times: ArrayLike) -> Any:
    kind = stepper.state.dtype.type
    return np.array([kind(t) for t in np.asarray(times)])


def _halves(states: Array) -> tuple[Array, Array]:
    """States as pairs of doubles, (n, 7) each."""
    high = states.astype(np.float64)
    return high, (states - high.astype(states.dtype)).astype(np.float64)
