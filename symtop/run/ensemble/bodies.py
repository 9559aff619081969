"""Random bodies without symmetry: a population in strata, and its members as scenes.

Free bodies have random ratios of moments and a momentum at a small or larger angle from an axis; |L| is 1 and times are
in natural periods. Heavy ones lie at a distance epsilon from a Lagrange top with I1 = mgl = 1: I2 = 1 + epsilon u, u
from 1/2 to 1, I3 from 0.2 to 1.8 within the triangle inequality, the centre epsilon v off the third axis, |v| up to 1,
rates across it up to 3/2. Attitudes are uniform over all rotations.

    short-axis       a rotation about the axis of the largest moment, up to 0.5 rad off
    long-axis        a rotation about the axis of the smallest moment, up to 0.5 rad off
    near-separatrix  2 E I2 = L^2, except that the momentum along the largest moment is off by 2^-16 .. 2^-4 of itself
    near-symmetric   two moments equal to 2^-20 .. 2^-6, the momentum in any direction
    needle           the smallest moment is 2^-12 .. 2^-5 of the others, and the spin about its axis is fast
    heavy            epsilon from 2^-7 to 1/2, spins from 1/16 to 4 of the sleeping threshold
    regular          those of heavy whose disturbances grow less than `CHAOTIC_GROWTH` times in `HORIZON_PERIODS`
    natural periods
    chaotic          those of heavy whose disturbances grow more: an exponent above 0.69 per natural period
    lagrange         heavy with epsilon = 0: a symmetric top as a body

The growth is the larger one of two disturbances of size `SMALL_CHANGE`, computed by `series-general-adaptive`; in a
stable motion it is linear in time and smaller. Drawn numbers are rounded to nine digits, so that sines of another
machine change nothing; directions are then scaled to length one. Member i is the same for any n, and member i of
`heavy` is drawn from the same numbers for each epsilon.
"""

import math
from typing import Any

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.core.errors import SymtopError, finite, one_of, whole
from symtop.core.parallel import cores, in_threads
from symtop.methods.framework.lanes import members_of
from symtop.methods.framework.registry import integrator
from symtop.model.body import PARTS
from symtop.model.charts import BODY, Array, attitude_distance
from symtop.model.scenes import Scene
from symtop.run.ensemble.population import between, check_memory, octaves, signs
from symtop.run.trajectory import LABELS

FREE = ("short-axis", "long-axis", "near-separatrix", "near-symmetric", "needle")
HEAVY = ("regular", "chaotic", "lagrange")
STRATA = (*FREE, *HEAVY)
KINDS = (*STRATA, "heavy", "all", "free")
DRAWS, MOST_MEMBERS, PIECE_MEMBERS = 16, 1_000_000, 64  # numbers of a member, most members, members of a piece of work
HORIZON_PERIODS, CHAOTIC_GROWTH, SMALL_CHANGE = 10.0, 1000.0, 1e-8
TOLERANCE = 1e-13  # tolerance of the series
LARGEST_EPSILON, LEAST_CHAOTIC = 0.5, 0.02  # least of the chaotic kind: no motion below it is chaotic
VECTORS = {"centre": "component", "quaternion": "part", "omega_body": "component"}
PRINCIPAL = {name: {"long_name": "principal moment of inertia", "units": "1"} for name in ("I1", "I3")}
SPLIT = np.cumsum([*PARTS.values()])[:-1]  # of the 14 numbers of a member


def body_population(n: int, *, seed: int = 0, kind: str = "all", epsilon: float | None = None) -> xr.Dataset:
    """Draw n bodies without symmetry and their starts: a dataset over ``member``.

    Variables ``I1``, ``I2``, ``I3``, ``mgl``, ``centre`` and ``omega_body`` (member, 3; principal axes),
    ``quaternion`` (member, 4; w, x, y, z, body to space), in any consistent units, and ``stratum``, its name. `kind` is
    a stratum (free: short-axis, long-axis, near-separatrix, near-symmetric, needle; heavy: regular, chaotic,
    lagrange), "heavy" for regular and chaotic ones as drawn, or "free" or "all" for those strata in turn. `epsilon` is
    the distance of heavy bodies from a Lagrange top, from 0 (with chaotic ones from 0.02) to 1/2; by default it is
    drawn. Member i depends on the seed, not on n. Raises SymtopError for invalid arguments.
    """
    count, kind, first = whole("n", n, 1, MOST_MEMBERS), one_of("kind", kind, KINDS), whole("seed", seed, 0)
    check_memory("n", count)
    kinds = {"all": STRATA, "free": FREE}.get(kind, (kind,))
    if epsilon is not None:
        if not {*kinds} - {*FREE, "lagrange"}:
            raise SymtopError(f"epsilon is of heavy bodies, and not of the kind {kind!r}", "epsilon")
        smallest = LEAST_CHAOTIC if "chaotic" in kinds else 0.0
        epsilon = finite("epsilon", epsilon)
        if not smallest <= epsilon <= LARGEST_EPSILON:
            raise SymtopError(f"epsilon must be from {smallest} to {LARGEST_EPSILON}, not {epsilon!r}", "epsilon")
    rows, strata = np.empty((count, 14)), np.empty(count, dtype=f"U{max(map(len, KINDS))}")
    for index, stratum in enumerate(kinds[:count]):
        rows[index :: len(kinds)] = _members(stratum, first, len(range(index, count, len(kinds))), epsilon)
        strata[index :: len(kinds)] = stratum
    columns: dict[str, Any] = {
        name: (("member", VECTORS[name]), block) if name in VECTORS else ("member", block[:, 0], PRINCIPAL.get(name))
        for name, block in zip(PARTS, np.split(rows, SPLIT, axis=1), strict=True)
    }
    data = xr.Dataset(columns | {"stratum": ("member", strata)}, {name: list(LABELS[name]) for name in LABELS})
    draw: dict[str, Any] = {"seed": first, "kind": kind} | ({} if epsilon is None else {"epsilon": float(epsilon)})
    return netcdf.describe(data, f"{count} bodies of the population {kind!r}", **draw)


def scenes_of(members: xr.Dataset) -> list[Scene]:
    """Members as scenes over `HORIZON_PERIODS` natural periods, named by stratum and number within it."""
    rows = np.column_stack([members[name].values for name in PARTS])
    counts: dict[str, int] = {}
    scenes = list[Scene]()
    for (body, start), kind in zip(members_of(rows), members["stratum"].values.tolist(), strict=True):
        counts[kind] = counts.get(kind, -1) + 1
        horizon = HORIZON_PERIODS * body.nutation_period(start)
        scenes.append(Scene(f"{kind}-{counts[kind]}", body, start, horizon, f"a random body, {kind}"))
    return scenes


def _members(kind: str, seed: int, count: int, epsilon: float | None) -> Array:
    """The first members of one stratum, (count, 14)."""
    generator = np.random.Philox(key=[seed % 2**64, KINDS.index(kind)])
    batches, missing = list[Array](), count
    while missing:
        integers = generator.random_raw(DRAWS * missing) >> np.uint64(11)
        uniform = np.ascontiguousarray((integers * 2.0**-53).reshape(-1, DRAWS).T)
        rows = _free(kind, uniform) if kind in FREE else _heavy(uniform, 0.0 if kind == "lagrange" else epsilon)
        if kind in ("regular", "chaotic"):
            pieces = np.array_split(rows, -(-len(rows) // PIECE_MEMBERS))
            chaotic = np.concatenate([*in_threads(growth, pieces, cores())]) > CHAOTIC_GROWTH
            rows = rows[chaotic == (kind == "chaotic")]
        batches.append(rows)
        missing -= len(rows)
    return np.concatenate(batches)


def _directions(first: Array, second: Array) -> Array:
    """Directions (3, n), uniform over the sphere."""
    z, angle = 2.0 * first - 1.0, 2.0 * math.pi * second
    radius = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z])


def _quaternions(u: Array) -> Array:
    """Quaternions (4, n), uniform over all rotations."""
    out, back = np.sqrt(u[0]), np.sqrt(1.0 - u[0])
    first, second = 2.0 * math.pi * u[1], 2.0 * math.pi * u[2]
    return np.stack([out * np.cos(first), out * np.sin(first), back * np.cos(second), back * np.sin(second)])


def _rows(moments: Array, mgl: float, centre: Array, quaternions: Array, rates: Array) -> Array:
    """Members (n, 14) from columns of their parts, each (components, n), rounded to nine digits."""
    n = moments.shape[1]
    rows = np.concatenate([moments, np.full((1, n), mgl), centre, quaternions, rates]).T
    rows = np.array([float(f"{value:.9g}") + 0.0 for value in rows.ravel().tolist()]).reshape(n, 14)
    for begin, end in ((4, 7), (7, 11)):
        rows[:, begin:end] /= np.sqrt((rows[:, begin:end] ** 2).sum(axis=1, keepdims=True))
    return rows


def _free(kind: str, u: Array) -> Array:
    """Free bodies with |L| = 1, their principal axes in random order."""
    low, ones, high = between(0.3, 0.9, u[0]), np.ones(u.shape[1]), between(1.1, 1.25, u[1])
    moments = np.stack([low, ones, np.minimum(high, 0.99 * (1.0 + low))])
    tilt, turn, small = 0.5 * u[2], 2.0 * math.pi * u[3], octaves(-16.0, -4.0, u[4])
    side = np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn)
    momentum = np.stack([*side, np.cos(tilt)])
    if kind == "long-axis":
        momentum = np.stack([np.cos(tilt), *side])
    elif kind == "needle":
        thin = octaves(-12.0, -5.0, u[5])
        moments = np.stack([thin, 1.0 - 0.5 * thin * u[6], ones])
        momentum = np.stack([(2.0 * u[2] - 1.0) * np.sqrt(thin), np.cos(turn), np.sin(turn)])
    elif kind == "near-symmetric":
        equal = 1.0 + octaves(-20.0, -6.0, u[5])
        moments = np.where(u[6] < 0.5, np.stack([low, ones, equal]), np.stack([ones, equal, 1.3 * ones]))
        momentum = _directions(u[2], u[3])
    elif kind == "near-separatrix":  # I1 (I3 - I2) M3^2 = I3 (I2 - I1) M1^2 on it
        slope = np.sqrt((moments[1] - moments[0]) * moments[2] / ((moments[2] - moments[1]) * moments[0]))
        share = np.sin(0.5 + tilt)
        momentum = np.stack([share, np.cos(0.5 + tilt), share * slope * (1.0 + signs(u[7]) * small)])
    rates = momentum / np.sqrt((momentum**2).sum(axis=0)) / moments
    order = np.argsort(u[8:11], axis=0)
    moments, rates = (np.take_along_axis(values, order, axis=0) for values in (moments, rates))
    return _rows(moments, 0.0, np.stack([0.0 * ones, 0.0 * ones, ones]), _quaternions(u[11:14]), rates)


def _heavy(u: Array, epsilon: float | None) -> Array:
    """Heavy bodies with I1 = mgl = 1, at the distance `epsilon` from a Lagrange top, or at a random one for None."""
    distance, ones = octaves(-7.0, -1.0, u[0]) if epsilon is None else np.full(u.shape[1], epsilon), np.ones(u.shape[1])
    third = between(0.2, 1.8, u[2])
    second = np.minimum(1.0 + distance * between(0.5, 1.0, u[1]), 0.99 * (1.0 + third))
    third = np.minimum(third, 0.99 * (1.0 + second))
    centre = np.stack([*(distance * _directions(u[3], u[4])[:2]), ones])
    spin = signs(u[5]) * octaves(-4.0, 2.0, u[6]) * 2.0 / third
    turn = 2.0 * math.pi * u[8]
    rates = np.stack([1.5 * u[7] * np.cos(turn), 1.5 * u[7] * np.sin(turn), spin])
    return _rows(np.stack([ones, second, third]), 1.0, centre, _quaternions(u[9:12]), rates)


def growth(rows: Array) -> Array:
    """The larger factors (n,) by which two disturbances of members (n, 14) grow in attitude over `HORIZON_PERIODS`."""
    solver, n = integrator("series-general-adaptive").solvers[BODY], len(rows)
    periods = np.array([body.nutation_period(start) for body, start in members_of(rows)])
    times = periods[:, None] * np.linspace(0.0, HORIZON_PERIODS, 4 * round(HORIZON_PERIODS) + 1)[1:]
    rotated_rows, kicked_rows, (w, x) = rows.copy(), rows.copy(), rows[:, 7:9].T
    rotated_rows[:, 7], rotated_rows[:, 8] = w - SMALL_CHANGE * x, x + SMALL_CHANGE * w
    scale = SMALL_CHANGE * np.array([math.hypot(*rates) for rates in rows[:, 11:].tolist()])
    kicked_rows[:, 11:] += np.stack([scale, -scale, scale], axis=1)

    def attitudes(numbers: Array) -> Array:
        runs, _ = solver.many(numbers, np.full(n, TOLERANCE), times, np.full(n, times.shape[1]))  # type: ignore[attr-defined]
        return np.asarray(runs.states[:, :, :4])

    run = attitudes(rows)
    distances = [attitude_distance(attitudes(numbers), run) for numbers in (rotated_rows, kicked_rows)]
    return np.asarray(np.nanmax(distances, axis=(0, 2)) / (2.0 * SMALL_CHANGE))
