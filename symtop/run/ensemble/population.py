"""Random tops: a population drawn from a distribution of dimensionless numbers, in six strata.

A top and its start are drawn in dimensionless numbers and then scaled. In units where I1 = abs(mgl) = 1, time is
counted in 1/g, g = sqrt(abs(mgl)/I1), x = theta/2, and the spin enters as the ratio to the sleeping threshold,

    sigma = I3 w3 / (2 sqrt(I1 abs(mgl))),    a = p_psi = 2 sigma,    b = p_phi.

    stratum           share   spin                          start
    slow               25 %   sigma from 1/64 to 1          theta 0.1 to 3.04; theta', phi' sin theta in any direction,
                                                            kinetic energy across the axis from 0 to 8
    fast               25 %   sigma from 2 to 64            theta 0.2 to 2.9; phi' from -2 to 4 slow precessions 1/a,
                                                            theta' from -2 to 2 of them
    grazing            15 %   up to what the energy allows  passes the upper or the lower pole, with equal probability,
                                                            at 2^-14 to 2^-5 rad, with a speed from 1/2 to 2 (more if
                                                            it has to climb from the lower pole to its start)
    near-separatrix    10 %   sigma from 0.01 to 0.9        climbs to 2^-16 to 2^-6 rad of the upper pole and hovers
                                                            there: its energy at the pole has the size of gap^2
    hanging            10 %   sigma from 1/64 to 2          mgl < 0, theta 0.05 to 1.2; the energy across the axis does
                                                            not lift the axis to the horizontal
    sleeping           15 %   sigma from 1 + 2^-5 to 5      starts 2^-12 to 2^-4 rad from upright, with rates that take
                                                            the axis to at most sqrt(3) times that

In all of them, I3/I1 is uniform in (0.02, 1.98), phi and psi in (-pi, pi), every sign is drawn; I1 lies between 2^-10
and 2^10, g between 2^-6 and 2^6. Quantities that range over octaves are drawn by octave and uniformly within one.

Member i is the same in populations of any size, with the same bits on every machine: the draws are the raw integers of
a Philox generator, a stream that NumPy promises to keep, 16 per member, and everything else, including sine and cosine
of theta, is computed by sums, products, quotients and square roots.
"""

import math
import os
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.core.errors import SymtopError, one_of, whole
from symtop.model.charts import Array
from symtop.model.top import NUMBERS

MOST_MEMBERS = 1e9  # members
BYTES = 400  # of memory per member
DRAWS = 16  # uniform numbers per member, some unused: a new quantity must not change the existing ones
BLOCK_MEMBERS = 1 << 16  # members drawn at a time

# dimensionless: theta, measured from the pole of unstable equilibrium, theta' and phi' in units of g, and a; each (n,)
Start = tuple[Array, Array, Array, Array]


def between(low: float, high: float, uniform: Array) -> Array:
    """Uniform draws moved to an interval."""
    return low + (high - low) * uniform


def octaves(low: float, high: float, uniform: Array) -> Array:
    """Draws between two powers of two (exponents), spread evenly over octaves and evenly within each."""
    exponent = between(low, high, uniform)
    octave = np.floor(exponent)
    return np.ldexp(1.0 + (exponent - octave), octave.astype(np.int64))


def signs(uniform: Array) -> Array:
    """-1 or 1."""
    return np.where(uniform < 0.5, -1.0, 1.0)


def sine_cosine(angle: Array) -> tuple[Array, Array]:
    """sin and cos of angles in [0, pi] by their series at a quarter of them, to 1e-15: the same bits on any machine."""
    x = 0.25 * angle
    y = x * x
    sine, cosine = np.zeros_like(y), np.zeros_like(y)
    for k in range(10, -1, -1):
        sine = 1.0 - y * sine / ((2 * k + 2) * (2 * k + 3))
        cosine = 1.0 - y * cosine / ((2 * k + 1) * (2 * k + 2))
    sine = x * sine
    for _ in range(2):
        sine, cosine = 2.0 * sine * cosine, 1.0 - 2.0 * sine * sine
    return sine, cosine


def direction(uniform: Array) -> tuple[Array, Array]:
    """A unit vector (two columns) of random direction, not quite uniform: a half circle by its slope, and a sign."""
    t = 4.0 * np.mod(uniform, 0.5) - 1.0
    square = 1.0 + t * t
    return signs(uniform) * (1.0 - t * t) / square, signs(uniform) * 2.0 * t / square


def _slow(draw: Array) -> Start:
    theta, a = between(0.1, 3.04, draw[0]), 2.0 * signs(draw[1]) * octaves(-6.0, 0.0, draw[2])
    speed, (along, across) = 4.0 * draw[3], direction(draw[4])  # energy speed^2/2: from 0 to 8, more often little
    return theta, speed * along, speed * across / sine_cosine(theta)[0], a


def _fast(draw: Array) -> Start:
    a = 2.0 * signs(draw[1]) * octaves(1.0, 6.0, draw[2])
    return between(0.2, 2.9, draw[0]), between(-2.0, 2.0, draw[3]) / a, between(-2.0, 4.0, draw[4]) / a, a


def _grazing(draw: Array) -> Start:
    """Starts at the tilt `away` from the pole to pass. With x = away/2, u the speed there and delta = b -+ a = u gap,

        away'^2 = u^2 +- 4 sin^2 x - a^2 tan^2 x    (upper, lower pole), up to terms of the size of delta,

    so that any a up to w/tan x, w^2 = u^2 +- 4 sin^2 x, lets the axis get from there to the start.
    """
    away, upper = between(0.5, 2.2, draw[0]), draw[5] < 0.5
    sine, cosine = sine_cosine(away)
    tangent, fall = sine / (1.0 + cosine), 2.0 * (1.0 - cosine)
    base = octaves(-1.0, 1.0, draw[3])
    square = base * base + fall  # upper: of away' without spin; lower: of u
    speed = np.where(upper, base, np.sqrt(square))
    top = np.where(upper, np.sqrt(square), base) / tangent
    a = signs(draw[1]) * between(0.05, 0.95, draw[2]) * top
    delta = signs(draw[6]) * octaves(-14.0, -5.0, draw[4]) * speed
    largest = top * tangent
    rate = signs(draw[7]) * np.sqrt(largest * largest - a * a * tangent * tangent)
    turn = (delta + a * (1.0 - cosine)) / (sine * sine)
    return np.where(upper, away, math.pi - away), rate, turn, np.where(upper, a, -a)


def _near_separatrix(draw: Array) -> Start:
    """Near the upper pole theta'^2 + (delta/theta)^2 - r^2 theta^2 = 2 eta, r^2 = 1 - sigma^2, delta = b - a.

    The axis turns at the tilt `gap` if delta^2 = r^2 gap^4 + 2 eta gap^2; eta = kappa r^2 gap^2/2 is drawn by kappa.
    """
    theta, gap, kappa = between(0.3, 2.2, draw[0]), octaves(-16.0, -6.0, draw[3]), between(-0.9, 3.0, draw[4])
    sine, cosine = sine_cosine(theta)
    half = np.sqrt(0.5 * (1.0 + cosine))  # cos x: beyond this spin the axis does not reach the start
    sigma = between(0.05, 0.9, draw[2]) * half
    growth, a = 1.0 - sigma * sigma, 2.0 * signs(draw[1]) * sigma
    delta = signs(draw[6]) * np.sqrt(growth * (1.0 + kappa)) * gap * gap
    eta = 0.5 * kappa * growth * gap * gap
    lever = (delta + a * (1.0 - cosine)) / sine
    rate = signs(draw[7]) * np.sqrt(2.0 * (1.0 - cosine) + 2.0 * eta + a * delta - lever * lever)
    return theta, rate, lever / sine, a


def _hanging(draw: Array) -> Start:
    """Here theta is measured from the stable pole; cos(theta) is the energy that lifts the axis to the horizontal."""
    theta, a = between(0.05, 1.2, draw[0]), 2.0 * signs(draw[1]) * octaves(-6.0, 1.0, draw[2])
    sine, cosine = sine_cosine(theta)
    speed, (along, across) = np.sqrt(2.0 * between(0.0, 0.95, draw[3]) * cosine), direction(draw[4])
    return theta, speed * along, speed * across / sine, a


def _sleeping(draw: Array) -> Start:
    """In the frame that turns at a/2 the axis swings as theta'' = -omega^2 theta, omega^2 = sigma^2 - 1."""
    tilt, excess = octaves(-12.0, -4.0, draw[0]), octaves(-5.0, 2.0, draw[2])
    sigma = 1.0 + excess
    omega = np.sqrt(excess * (2.0 + excess))
    rates = omega * between(-1.0, 1.0, draw[3]), sigma + omega * between(-1.0, 1.0, draw[4])
    return tilt, tilt * rates[0], signs(draw[1]) * rates[1], 2.0 * signs(draw[1]) * sigma


STRATA: dict[str, tuple[float, Callable[[Array], Start]]] = {
    "slow": (0.25, _slow), "fast": (0.25, _fast), "grazing": (0.15, _grazing),
    "near-separatrix": (0.10, _near_separatrix), "hanging": (0.10, _hanging), "sleeping": (0.15, _sleeping),
}  # fmt: skip
KINDS = (*STRATA, "all")


def _scaled(start: Start, draw: Array, mgl: float) -> tuple[Array, ...]:
    """The `NUMBERS` of members, from starts without units; `mgl` is the sign of gravity."""
    theta, theta_dot, phi_dot, a = start
    I1, g = octaves(-10.0, 10.0, draw[0]), octaves(-6.0, 6.0, draw[1])
    ratio = between(0.02, 1.98, draw[2])
    phi, psi = between(-math.pi, math.pi, draw[3]), between(-math.pi, math.pi, draw[4])
    psi_dot = g * (a / ratio - phi_dot * sine_cosine(theta)[1])
    return I1, ratio * I1, mgl * I1 * g * g, theta, phi, psi, g * theta_dot, g * phi_dot, psi_dot


def _fill(columns: dict[str, Any], draw: Array, kind: str) -> None:
    names, ends = list(STRATA), np.cumsum([share for share, _ in STRATA.values()])[:-1]
    strata = np.searchsorted(ends, draw[0], side="right")
    strata = strata if kind == "all" else np.full_like(strata, names.index(kind))
    for index, name in enumerate(names):
        members = strata == index
        if members.any():
            start = STRATA[name][1](draw[1:9, members])
            numbers = _scaled(start, draw[9:14, members], -1.0 if name == "hanging" else 1.0)
            for variable, values in zip(NUMBERS, numbers, strict=True):
                columns[variable][members] = values
    columns["stratum"][:] = np.array(names)[strata]


def memory() -> float:
    """Bytes of memory of this machine; infinite if the system does not report it."""
    supported = hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names
    return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")) if supported else math.inf


def check_memory(name: str, members: int) -> None:
    """SymtopError for more members than the memory holds; `name` is the argument with their number."""
    if members * BYTES > memory():
        limit = f"{memory() / BYTES:.2g} in the {memory() / 2**30:.3g} GiB of this machine ({BYTES} bytes a member)"
        raise SymtopError(f"{name} must be at most {limit}, not {members}", name)


def population(n: int, *, seed: int = 0, kind: str = "all") -> xr.Dataset:
    """Draw n tops and starts: a dataset over ``member``, ready for `symtop.ensemble`.

    Variables ``I1``, ``I3``, ``mgl``, ``theta``, ``phi``, ``psi``, ``theta_dot``, ``phi_dot``, ``psi_dot`` (rad and
    any consistent units) and ``stratum``, its name. `kind` is a stratum (slow, fast, grazing, near-separatrix, hanging,
    sleeping), or "all" for their mixture. Member i depends only on the seed, not on n or the machine.

    Raises SymtopError for invalid arguments.
    """
    count = whole("n", n, 1, MOST_MEMBERS)
    check_memory("n", count)
    kind, start = one_of("kind", kind, KINDS), whole("seed", seed, 0)
    generator = np.random.Philox(start)
    columns: dict[str, Any] = {name: np.empty(count) for name in NUMBERS}
    columns["stratum"] = np.empty(count, dtype=f"U{max(map(len, STRATA))}")
    for begin in range(0, count, BLOCK_MEMBERS):
        block = {name: values[begin : begin + BLOCK_MEMBERS] for name, values in columns.items()}
        integers = generator.random_raw(len(block["I1"]) * DRAWS) >> np.uint64(11)
        uniform = (integers * 2.0**-53).reshape(-1, DRAWS)  # in [0, 1), of 53 bits
        _fill(block, np.ascontiguousarray(uniform.T), kind)
    data = xr.Dataset({name: ("member", values) for name, values in columns.items()})
    return netcdf.describe(data, f"{count} tops of the population {kind!r}", seed=start, kind=kind)
