"""The bodies of the study, by family: their reference motion at the times of the samples, and the errors of many runs.

A family has the members of one `symtop.body_population`. Heavy families named by epsilon have the same draws at every
epsilon. Samples fall where those of the study of cost do, in natural periods. The reference of a free body is exact;
that of a heavy one is a Taylor series at rounding, whose bound is four times its distance from a series of another
order, plus `FLOOR`. A target is asked of a body if the bound is at most `CLEAR` times the target.

    axis      angle between the directions of the centre of mass (of a free body, of its third axis), rad
    attitude  angle of the turn between, rad
    energy    |E - E0| over the kinetic energy of the start and |mgl|
    momenta   |L - L0|/|L0| of a free body, of a heavy one |L_z - L_z0|/|L0|
"""

import functools
import math
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from symtop_studies.cost.ladder import Level, one_by_one, setting_of, stepped
from symtop_studies.cost.tops import CLEAR, FIRST, MOMENTA, Tops, sample_marks

from symtop.core.numbers import EPSILON
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import Integrator
from symtop.model.body import Attitude, RigidBody, rotated, vertical
from symtop.model.charts import Array, attitude_distance, axis_distance
from symtop.model.scenes import Scene
from symtop.model.top import Angles, SymmetricTop, flat
from symtop.run.ensemble.bodies import body_population, scenes_of
from symtop.run.motion import CHECK_TOLERANCE, FINE_TOLERANCE, IntegratedMotion
from symtop.run.reference.truth import reference

SYMMETRIC, FREE, CHAOTIC = "0", "free", "chaotic"
FAMILIES: dict[str, tuple[str, float | None]] = {  # kind of body and epsilon
    SYMMETRIC: ("heavy", 0.0), "0.01": ("heavy", 0.01), "0.03": ("heavy", 0.03), "0.1": ("heavy", 0.1),
    "0.3": ("heavy", 0.3), CHAOTIC: (CHAOTIC, 0.3), FREE: (FREE, None),
}  # fmt: skip
QUANTITIES = ("axis", "attitude")  # that have targets
ASKED = (1e-3, 1e-6, 1e-9)  # the targets that are asked: the reference of a heavy body cannot judge finer ones
FLOOR = 2e-14  # rad, of the bound, as part of the rounding is the same in both series


class Bodies:
    """Bodies and starts followed for a number of natural periods, with the properties that a climb of `cost` needs."""

    def __init__(self, scenes: list[Scene], strata: list[str], periods: float) -> None:
        self.scenes, self.strata, self.periods = scenes, strata, periods
        self.period = np.array([scene.top.nutation_period(scene.start) for scene in scenes])
        self.marks = sample_marks(math.ceil(periods * FIRST))
        self.times = self.marks * (self.period / FIRST)[:, np.newaxis]
        self.kinds = np.zeros(len(scenes), dtype=np.int64)  # one kind

    @property
    def known(self) -> NDArray[np.bool_]:
        """The members whose reference is accurate enough for some target."""
        return np.asarray(self.truth[1] <= CLEAR * ASKED[0])

    @cached_property
    def truth(self) -> tuple[Array, Array]:
        """Quaternions (n, samples, 4), and their largest bounds (n,)."""
        pairs = [self._motion(scene, times) for scene, times in zip(self.scenes, self.times, strict=True)]
        return np.stack([quaternion for quaternion, _ in pairs]), np.array([bound for _, bound in pairs])

    @staticmethod
    def _motion(scene: Scene, times: Array) -> tuple[Array, float]:
        if scene.top.free:
            exact = reference(scene, times)
            return exact["quaternion"].values, float(exact["attitude_error_bound"].max())
        motion = IntegratedMotion(scene)
        true, check = (unit(motion.states(times, tolerance)[:, :4]) for tolerance in (FINE_TOLERANCE, CHECK_TOLERANCE))
        gap = attitude_distance(check, true).max()
        return true, 4.0 * float(gap) + FLOOR if np.isfinite(gap) else math.inf

    @cached_property
    def numbers(self) -> tuple[Array, ...]:
        """Moments, centre, weight's vector, M at the start (n, 3); energy, its scale (n,); L at the start (n, 3)."""
        bodies = [(scene.top, scene.start) for scene in self.scenes]
        parts = [[getattr(body, name) for body, _ in bodies] for name in ("moments", "centre", "torque")]
        momentum = np.array([body.momentum(start) for body, start in bodies])
        energy, scale = ([getattr(body, name)(start) for body, start in bodies] for name in ("energy", "energy_scale"))
        lifted = rotated(np.array([start.quaternion for _, start in bodies]), momentum)
        return *map(np.array, parts), momentum, np.array(energy), np.array(scale), lifted

    @cached_property
    def rows(self) -> Array:
        """Bodies and starts as rows of 14 numbers, (n, 14)."""
        return np.array([scene.top.flat(scene.start) for scene in self.scenes])

    def asked(self, targets: Any) -> dict[str, NDArray[np.bool_]]:
        """Which targets are asked of which members, (targets, n)."""
        levels = np.asarray(targets)[:, np.newaxis]
        judged = (self.truth[1] <= CLEAR * levels) & (levels >= 0.999 * min(ASKED))
        return dict.fromkeys(QUANTITIES, judged)

    def members(self, chosen: NDArray[np.int64]) -> Iterator[tuple[RigidBody, Attitude]]:
        """The body and the start of each chosen member."""
        return ((self.scenes[k].top, self.scenes[k].start) for k in chosen.tolist())

    def errors(self, _: str, samples: Any, chosen: NDArray[np.int64]) -> dict[str, Array]:
        """Largest error of each quantity of the chosen members' runs, (chosen,); inf after a failure."""
        return {name: values.max(axis=1) for name, values in self.errors_at(samples.states, chosen).items()}

    def errors_at(self, states: Array, chosen: NDArray[np.int64]) -> dict[str, Array]:
        """The error of each quantity at each sample, (chosen, samples); inf after a failure."""
        moments, centre, weight, _, energy, scale, start = (part[chosen, np.newaxis] for part in self.numbers)
        true = self.truth[0][chosen]
        with np.errstate(all="ignore"):  # a run may have blown up
            q, M = states[..., :4], states[..., 4:]  # an error of |q| counts in energy and momenta
            up, lifted = np.stack(vertical(*np.moveaxis(q, -1, 0)), axis=-1), rotated(q, M)
            q = unit(q)
            axes = (rotated(quaternion, np.broadcast_to(centre, M.shape)) for quaternion in (q, true))
            free = (weight == 0.0).all(axis=-1)
            drift = lifted - start
            moved = np.where(free, np.linalg.norm(drift, axis=-1), np.abs(drift[..., 2]))
            errors = {
                "axis": axis_distance(*axes), "attitude": attitude_distance(q, true),
                "energy": np.abs(0.5 * (M * M / moments).sum(axis=-1) + (weight * up).sum(axis=-1) - energy) / scale,
                MOMENTA: moved / np.linalg.norm(start, axis=-1),
            }  # fmt: skip
        return {name: np.where(np.isfinite(values), values, np.inf) for name, values in errors.items()}


def unit(quaternions: Array) -> Array:
    """Quaternions (..., 4) of length one."""
    return np.asarray(quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True))


def run_level(variant: Integrator, bodies: Bodies, chosen: NDArray[np.int64], level: int, budget: float) -> Level:
    """Run the chosen members with one setting of the ladder."""
    if variant.fixed_step:
        return run_steps(variant, bodies, chosen, FIRST * 2.0**level, bodies.marks << level)
    plans = [Plan.until(times, setting_of(variant, level), budget) for times in bodies.times[chosen]]
    return one_by_one(variant, bodies.members(chosen), plans)


def run_steps(
    variant: Integrator, bodies: Bodies, chosen: NDArray[np.int64], steps: float, marks: NDArray[np.int64]
) -> Level:
    """Run the chosen members with so many steps a natural period, sampled after `marks` of them."""
    h = bodies.period[chosen] / steps
    return stepped(variant, bodies.rows[chosen], h, np.broadcast_to(marks, (h.size, marks.size)))


@functools.lru_cache(maxsize=2 * len(FAMILIES))
def bodies_of(family: str, count: int, seed: int, periods: float) -> Bodies:
    """The bodies of a family, cached, as every method runs the same."""
    kind, epsilon = FAMILIES[family]
    members = body_population(count, seed=seed, kind=kind, epsilon=epsilon)
    return Bodies(scenes_of(members), members["stratum"].values.tolist(), periods)


def as_tops(bodies: Bodies) -> Tops:
    """Bodies of epsilon = 0 as symmetric tops, with the same times."""
    starts = [Angles.from_quaternion(body.start.quaternion, omega_body=body.start.omega_body) for body in bodies.scenes]
    tops = [SymmetricTop(body.top.I1, body.top.I3, body.top.mgl) for body in bodies.scenes]
    result = Tops(np.array([flat(*pair) for pair in zip(tops, starts, strict=True)]), bodies.periods)
    result.period, result.marks, result.times = bodies.period, bodies.marks, bodies.times
    return result


def grain(values: Array) -> Array:
    """Errors, raised to `EPSILON` where they are below it."""
    return np.maximum(values, EPSILON)
