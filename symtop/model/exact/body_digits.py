"""The motion of any rigid body with a fixed point in many digits, by Taylor's series in integer arithmetic.

    q' = q omega/2,    M' = M x omega + Gamma x c,    Gamma' = Gamma x omega,    omega = M/I,    c = mgl chi

in body axes (`symtop.model.body`); Gamma, the upward vertical, is a state of its own, so that all products are of two.
A number is a whole multiple of 2^-bits and a step a power of two, so that the bits are the same on every machine. The
last terms of the series choose the step. Moments, weight, start and times are the doubles that are given, exactly, and
the quaternion is scaled to length one.

The bound is the distance to a second run with fewer bits, a lower order and a looser tolerance: it is the error of the
second run, and larger than that of the first by `BITS_APART` bits as long as both errors grow alike. Slow (ms a step),
for references that are made once. Source: Jorba and Zou, Experimental Mathematics 14 (2005) 99, for the steps.
"""

from collections.abc import Sequence
from fractions import Fraction
from math import floor
from operator import mul
from typing import Any, NamedTuple

from symtop.core.errors import SymtopError
from symtop.core.numbers import context
from symtop.model.body import Attitude, RigidBody

BITS, ORDER, GOAL = 190, 56, 120  # bits of a number, order of the series, bits of accuracy of the series
BITS_APART = 8  # bits, and orders, by which the second run is less accurate
MOST_STEPS = 20_000  # limit on the steps: a minute


class Digits(NamedTuple):
    """A motion at times: rows of quaternion and momentum in space, `mpmath.mpf`, and a bound for all of them."""

    quaternion: list[list[Any]]
    momentum: list[list[Any]]
    bound: float  # rad, and of the momentum relative to the largest one


def body_digits(body: RigidBody, start: Attitude, times: Sequence[float]) -> Digits:
    """The motion at increasing times of at least 0; SymtopError for one that takes more than `MOST_STEPS` steps."""
    mp = context(BITS * 3 // 10)
    fine = _spatial(mp, _run(body, start, times, BITS, ORDER, GOAL))
    check = _spatial(mp, _run(body, start, times, BITS - BITS_APART, ORDER - BITS_APART, GOAL - BITS_APART))
    size = max([mp.mpf(2) ** -GOAL, *(mp.norm(L) for _, L in fine)])
    gap = max(
        max(2 * mp.norm(_difference(q, p)), mp.norm(_difference(L, K)) / size)
        for (q, L), (p, K) in zip(fine, check, strict=True)
    )  # fmt: skip
    return Digits([q for q, _ in fine], [L for _, L in fine], float(gap))


def _difference(first: Sequence[Any], second: Sequence[Any]) -> list[Any]:
    return [a - b for a, b in zip(first, second, strict=True)]


def _spatial(mp: Any, rows: list[list[Fraction]]) -> list[tuple[list[Any], list[Any]]]:
    """Quaternion and L = q M q* of states (q, M)."""
    states = []
    for row in rows:
        w, x, y, z, a, b, c = (mp.mpf(value.numerator) / value.denominator for value in row)
        u, v, s = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)  # t = 2 r x M, L = M + w t + r x t
        L = [a + w * u + y * s - z * v, b + w * v + z * u - x * s, c + w * s + x * v - y * u]
        states.append(([w, x, y, z], L))
    return states


def _run(
    body: RigidBody, start: Attitude, times: Sequence[float], bits: int, order: int, goal: int
) -> list[list[Fraction]]:
    """States (q, M) at the times."""
    one, mp = 1 << bits, context(bits * 3 // 10 + 20)
    length = mp.norm([mp.mpf(part) for part in start.quaternion])
    attitude = [Fraction(int(mp.floor(mp.mpf(part) / length * one)), one) for part in start.quaternion]
    moments = [Fraction(moment) for moment in body.moments]
    momentum = [moment * Fraction(rate) for moment, rate in zip(moments, start.omega_body, strict=True)]
    w, x, y, z = attitude
    up = [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z]
    state = [_fixed_point(value, one) for value in (*attitude, *momentum, *up)]
    rates = [_fixed_point(1 / moment, one) for moment in moments]
    torque = [_fixed_point(Fraction(part), one) for part in body.torque]
    rows, at, k = list[list[Fraction]](), Fraction(0), 0
    for _ in range(MOST_STEPS):
        series = _series(state, rates, torque, bits, order)
        sizes = [max(abs(part[n]).bit_length() - bits for part in series) / n for n in (order - 1, order)]
        step = Fraction(2) ** floor(-goal / order - max(sizes))
        while k < len(times) and Fraction(times[k]) <= at + step:
            elapsed = _fixed_point(Fraction(times[k]) - at, one)
            rows.append([Fraction(_horner(part, elapsed, bits), one) for part in series[:7]])
            k += 1
        if k == len(times):
            return rows
        state, at = [_horner(part, _fixed_point(step, one), bits) for part in series], at + step
    raise SymtopError(f"times must be within {MOST_STEPS} steps of the series, not reach {times[-1]:g}")


def _fixed_point(value: Fraction, one: int) -> int:
    return value.numerator * one // value.denominator


def _horner(series: list[int], at: int, bits: int) -> int:
    total = 0
    for term in reversed(series):
        total = (total * at >> bits) + term
    return total


def _series(state: list[int], rates: list[int], torque: list[int], bits: int, order: int) -> list[list[int]]:
    """Taylor coefficients of q, M and Gamma, up to the power `order` of the time."""
    series = [[value] for value in state]
    w, x, y, z, m1, m2, m3, g1, g2, g3 = series
    (a1, a2, a3), (c1, c2, c3) = rates, torque
    spins: list[list[int]] = [[], [], []]
    for n in range(order):
        for spin, rate, part in zip(spins, rates, (m1, m2, m3), strict=True):
            spin.append(rate * part[n] >> bits)
        o1, o2, o3 = (spin[::-1] for spin in spins)
        r2, r3 = m2[::-1], m3[::-1]

        def dot(first: list[int], second: list[int]) -> int:
            return sum(map(mul, first, second))

        turning = (
            -dot(x, o1) - dot(y, o2) - dot(z, o3), dot(w, o1) + dot(y, o3) - dot(z, o2),
            dot(w, o2) - dot(x, o3) + dot(z, o1), dot(w, o3) + dot(x, o2) - dot(y, o1),
        )  # fmt: skip
        next_state = [value >> (bits + 1) for value in turning]
        for lever, product, pull in (
            (a3 - a2, dot(m2, r3), g2[n] * c3 - g3[n] * c2), (a1 - a3, dot(m1, r3), g3[n] * c1 - g1[n] * c3),
            (a2 - a1, dot(m1, r2), g1[n] * c2 - g2[n] * c1),
        ):  # fmt: skip
            next_state.append((lever * (product >> bits) + pull) >> bits)
        up_rates = dot(g2, o3) - dot(g3, o2), dot(g3, o1) - dot(g1, o3), dot(g1, o2) - dot(g2, o1)
        next_state += [value >> bits for value in up_rates]
        for part, value in zip(series, next_state, strict=True):
            part.append(value // (n + 1))
    return series
