"""Random bodies without symmetry, in strata, as scenes.

Free bodies have the least and the largest moment of a triangle of ratios, and a momentum at a small or larger angle
from an axis; |L| is 1 and times are counted in natural periods. Heavy ones lie at a distance epsilon from a Lagrange
top: I2 = I1 (1 + epsilon u), I3 between 0.2 and 1.8 of I1, the centre epsilon v off the third axis, u and v drawn.

    short-axis       a rotation about the axis of the largest moment, up to 0.5 rad off
    long-axis        about that of the smallest moment
    near-separatrix  2 E I2/L^2 = 1 to 2^-16 .. 2^-4 of the room there is
    near-symmetric   two moments equal to 2^-20 .. 2^-6, the momentum in any direction
    needle           the smallest moment is 2^-12 .. 2^-5 of the others, which spins fast
    heavy            epsilon from 2^-7 to 1/2, spins from 1/4 to 4 of the sleeping threshold
    regular          those of heavy whose disturbances grow less than `CHAOS` times in `PERIODS` natural periods
    chaotic          and those whose grow more
    lagrange         heavy with epsilon = 0: a symmetric top as a body

The growth is that of the largest of two disturbances of `SMALL`, by the Taylor series `series-general`; of a rotation
that is not unstable it grows with the time, and not by as much. Numbers of a scene have nine digits. The first n scenes
of more are those of fewer.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from symtop.core.errors import one_of, whole
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import integrator
from symtop.model.body import Attitude, RigidBody
from symtop.model.charts import BODY, attitude_distance
from symtop.model.scenes import Scene
from symtop.run.ensemble.population import between, octaves, signs

FREE = ("short-axis", "long-axis", "near-separatrix", "near-symmetric", "needle")
HEAVY = ("regular", "chaotic", "lagrange")
STRATA = (*FREE, *HEAVY)
KINDS = (*STRATA, "heavy", "all")
DRAWS, MOST = 16, 1_000_000
PERIODS, CHAOS, SMALL = 10.0, 1000.0, 1e-8
STEPS = 64  # of the series in a natural period


def random_bodies(n: int, *, seed: int = 0, kind: str = "all") -> list[Scene]:
    """Draw n scenes of a stratum, or with "all" of each stratum in turn; each runs over `PERIODS` natural periods.

    The stratum is the name of a scene up to its number. Raises SymtopError for arguments that make no sense.
    """
    count, chosen = whole("n", n, 1, MOST), one_of("kind", kind, KINDS)
    first = whole("seed", seed, 0)
    kinds = STRATA if chosen == "all" else (chosen,)
    streams = [_scenes(one, first, KINDS.index(one)) for one in kinds]
    return [next(streams[i % len(streams)]) for i in range(count)]


def _scenes(kind: str, seed: int, stream: int) -> Iterator[Scene]:
    """Scenes of one stratum without end."""
    generator = np.random.Philox(key=[seed % 2**64, stream])
    drawn = "heavy" if kind in HEAVY else kind
    count = 0
    while True:
        uniform = (generator.random_raw(DRAWS) >> np.uint64(11)) * 2.0**-53
        body, start = _heavy(uniform, lagrange=kind == "lagrange") if drawn == "heavy" else _free(kind, uniform)
        period = body.nutation_period(start)
        scene = Scene(f"{kind}-{count}", body, start, PERIODS * period, f"a random body, {kind}")
        if kind not in ("regular", "chaotic") or (growth(scene) > CHAOS) is (kind == "chaotic"):
            count += 1
            yield scene


def _unit(first: float, second: float) -> tuple[float, float, float]:
    """A direction, evenly over the sphere."""
    z, angle = 2.0 * first - 1.0, 2.0 * math.pi * second
    across = math.sqrt(max(1.0 - z * z, 0.0))
    return across * math.cos(angle), across * math.sin(angle), z


def _tidy(*values: float) -> Any:
    """Numbers of nine digits, so that sines of another machine change nothing."""
    return tuple(float(f"{value:.9g}") + 0.0 for value in values)


def _start(u: Any, rates: Sequence[float]) -> Attitude:
    """A quaternion, evenly over all turns, and these rates."""
    out, back = math.sqrt(u[0]), math.sqrt(1.0 - u[0])
    first, second = 2.0 * math.pi * u[1], 2.0 * math.pi * u[2]
    turn = out * math.cos(first), out * math.sin(first), back * math.cos(second), back * math.sin(second)
    return Attitude(_tidy(*turn), _tidy(*rates))


def _free(kind: str, u: Any) -> tuple[RigidBody, Attitude]:
    """A free body with |L| = 1, its axes in an order that is drawn."""
    low, high = float(between(0.3, 0.9, u[0])), float(between(1.1, 1.25, u[1]))
    moments = [low, 1.0, min(high, 0.99 * (1.0 + low))]
    tilt, turn, small = 0.5 * float(u[2]), 2.0 * math.pi * u[3], float(octaves(-16.0, -4.0, u[4]))
    side = math.sin(tilt) * math.cos(turn), math.sin(tilt) * math.sin(turn)
    momentum = [*side, math.cos(tilt)]
    if kind == "long-axis":
        momentum = [math.cos(tilt), *side]
    elif kind == "needle":
        thin = float(octaves(-12.0, -5.0, u[5]))
        moments = [thin, 1.0 - 0.5 * thin * u[6], 1.0]
        momentum = [(2.0 * u[2] - 1.0) * math.sqrt(thin), math.cos(turn), math.sin(turn)]
    elif kind == "near-symmetric":
        equal = 1.0 + float(octaves(-20.0, -6.0, u[5]))
        moments = [low, 1.0, equal] if u[6] < 0.5 else [1.0, equal, 1.3]
        momentum = list(_unit(u[2], u[3]))
    elif kind == "near-separatrix":  # I1 (I3 - I2) M3^2 = I3 (I2 - I1) M1^2 on it
        slope = math.sqrt((moments[1] - moments[0]) * moments[2] / ((moments[2] - moments[1]) * moments[0]))
        share = math.sin(0.5 + tilt)
        momentum = [share, math.cos(0.5 + tilt), share * slope * (1.0 + float(signs(u[7])) * small)]
    order = [int(place) for place in np.argsort(u[8:11])]
    size = math.hypot(*momentum)
    rates = [momentum[k] / size / moments[k] for k in order]
    return RigidBody(*_tidy(*(moments[k] for k in order))), _start(u[11:14], rates)


def _heavy(u: Any, *, lagrange: bool) -> tuple[RigidBody, Attitude]:
    """A heavy body with I1 = mgl = 1, at a distance epsilon from a Lagrange top."""
    epsilon = 0.0 if lagrange else float(octaves(-7.0, -1.0, u[0]))
    second, third = 1.0 + epsilon * float(u[1]), float(between(0.2, 1.8, u[2]))
    second, third = min(second, 0.99 * (1.0 + third)), min(third, 0.99 * (1.0 + second))
    off = [epsilon * part for part in _unit(u[3], u[4])[:2]]
    spin = float(signs(u[5]) * octaves(-2.0, 2.0, u[6])) * 2.0 / third
    rates = float(u[7]) * math.cos(2.0 * math.pi * u[8]), float(u[7]) * math.sin(2.0 * math.pi * u[8]), spin
    moments = _tidy(second, third)
    return RigidBody(1.0, moments[0], moments[1], 1.0, _tidy(*off, 1.0)), _start(u[9:12], rates)


def growth(scene: Scene) -> float:
    """How many times the attitude's disturbance of the start has grown at most over `PERIODS` natural periods."""
    solver, start = integrator("series-general").solvers[BODY], scene.start
    steps = round(PERIODS * STEPS)
    plan = Plan.steps(scene.nutation_period / STEPS, np.arange(0, steps + 1, STEPS // 4))
    w, x, y, z = start.quaternion
    a, b, c = start.omega_body
    scale = SMALL * math.hypot(a, b, c)
    others = (w - SMALL * x, x + SMALL * w, y, z), start.omega_body
    changed = [Attitude(*others), Attitude(start.quaternion, (a + scale, b - scale, c + scale))]
    runs = [solver(scene.top, at, plan).states[:, :4] for at in (start, *changed)]
    grown = max(float(np.nanmax(attitude_distance(run, runs[0]))) for run in runs[1:])
    return grown / (2.0 * SMALL)
