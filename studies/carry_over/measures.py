"""The measurements of a case: costs and verdicts of a method on every family, growth exponents, facts about bodies.

Variables over `family`, `quantity`, `target`, `member`, `level`:

    cost, met_at       as in the study of cost: force evaluations, and the setting, with which the target is reached
    work, setting      evaluations of the median body at each level, and the setting
    status             0 not run, 1 right, 2 wrong, with a change of energy, momenta or outcome, 3 wrong without any
    order              measured between the two finest settings with an error in `ASYMPTOTE`
    error_attitude, error_energy   median over bodies, at `time` natural periods (group growth)
"""

from typing import Any

import numpy as np
import xarray as xr
from symtop_studies.cost.ladder import KEPT, WRONG, Climb, climb, costs_of, typical_work
from symtop_studies.cost.tops import CLEAR, MOMENTA

from symtop.measure.settings import TARGETS
from symtop.methods.framework.registry import Integrator
from symtop.model.charts import Array, attitude_distance
from symtop.model.exact.heavy_body import HeavyBody
from symtop.run.ensemble.bodies import body_population, growth, scenes_of
from symtop.run.reference.independent_checks import have_heyoka

from .bodies import ASKED, FREE, SYMMETRIC, Bodies, as_tops, grain, run_level, run_steps, unit

STATUS = tuple(range(2, 8))  # levels whose verdicts are kept: 4.37 to 140 steps a period
ASYMPTOTE = (1e-9, 1e-3)  # rad
CHECKED = 4  # heavy bodies of a family whose reference is compared with an integration that has an error bound
GROWN = {  # steps a natural period: an error that is neither rounding nor as large as the motion for `doublings`
    "strang": 64, "five-rotations": 64, "kahan-li-8": 16, "srkn-11-6": 16, "lie-variational": 128, "gauss-4": 32,
    "rk4": 64, "tsit5-fixed": 32, "dop853-compiled-fixed": 8, "rkmk-se3-4": 64, "series-general": 4,
}  # fmt: skip
REGULAR: dict[str, tuple[str, float | None]] = {
    SYMMETRIC: ("lagrange", None),
    "0.1": ("regular", 0.1),
    "0.3": ("regular", 0.3),
    FREE: ("short-axis", None),
}
FIRST_TIME = 5.0  # natural periods


def table(variant: Integrator, families: dict[str, Bodies], budget: float) -> xr.Dataset:
    """One method on all families."""
    parts = [_family(variant, bodies, budget) for bodies in families.values()]
    return xr.concat(parts, dim="family").assign_coords(family=list(families)).assign(_traits(variant))


def own_table(variant: Integrator, families: dict[str, Bodies], budget: float) -> xr.Dataset:
    """A method in a chart of the top, on the bodies of epsilon = 0."""
    tops = as_tops(families[SYMMETRIC])
    asked = {"axis": families[SYMMETRIC].asked(TARGETS)["axis"] & tops.known}
    record = climb(variant, tops, asked, budget)
    return _costs(variant, record, asked, tops).assign(_traits(variant))


def _traits(variant: Integrator) -> dict[str, Any]:
    numbers = {"control": variant.control or "", "needs": variant.needs or "", "method": variant.method}
    return {name: ((), value) for name, value in numbers.items()}


def _costs(variant: Integrator, record: Climb, asked: dict[str, Any], bodies: Any) -> xr.Dataset:
    work = {"work": ("level", typical_work(variant, record, bodies)[:, 0])}
    coords = {"quantity": list(asked), "target": list(TARGETS)}
    return xr.Dataset(costs_of(variant, record, asked, list(asked)) | work, coords)


def _family(variant: Integrator, bodies: Bodies, budget: float) -> xr.Dataset:
    asked = bodies.asked(TARGETS)
    record = climb(variant, bodies, asked, budget, run_level)
    status = verdicts(record)[list(STATUS)].astype(np.float32)
    order = observed_order(record.errors["attitude"]) if variant.fixed_step else np.nan
    return _costs(variant, record, asked, bodies).assign(status=(("kept", "member"), status), order=((), order))


def verdicts(record: Climb) -> Array:
    """The status of each member at each level, (LEVELS, n); one that left the ladder with an accurate run is right."""
    ran, error = np.isfinite(record.work), record.errors["axis"]
    kept = record.ended & (record.errors["energy"] <= KEPT) & (record.errors[MOMENTA] <= KEPT)
    status = np.where(error <= WRONG, 1.0, np.where(kept, 3.0, 2.0))
    return np.where(ran, status, np.where(record.settled, 1.0, 0.0))


def observed_order(errors: Array) -> float:
    """The median over members of the slope between the two finest levels with an error in `ASYMPTOTE`, or NaN."""
    low, high = ASYMPTOTE
    with np.errstate(all="ignore"):
        inside = (errors > low) & (errors < high)
        steep = np.log2(errors[:-1] / errors[1:])
    both = inside[:-1] & inside[1:]
    last = both.shape[0] - 1 - np.argmax(both[::-1], axis=0)
    known = both.any(axis=0)
    return float(np.median(steep[last, np.arange(errors.shape[1])][known])) if known.any() else float("nan")


def growth_table(variant: Integrator, count: int, doublings: int, seed: int) -> xr.Dataset:
    """Median errors of regular bodies at times that double, from which growth exponents are computed.

    Only bodies whose reference can judge the finest target up to the last time count: for others, many of which turn
    chaotic, the difference may be the error of the reference.
    """
    times = FIRST_TIME * 2.0 ** np.arange(doublings)
    steps = GROWN[variant.method]
    medians, judged = np.full((2, len(REGULAR), doublings), np.nan), np.zeros(len(REGULAR))
    for row, (kind, epsilon) in enumerate(REGULAR.values()):
        scenes = scenes_of(body_population(count, seed=seed, kind=kind, epsilon=epsilon))
        bodies = Bodies(scenes, [kind] * count, float(times[-1]))
        fine = times[:, np.newaxis] * np.linspace(0.55, 1.0, 10)  # the largest error of the last half of each time
        marks = np.unique(np.rint(fine.ravel() * steps).astype(np.int64))
        bodies.marks, bodies.times = marks, marks * (bodies.period / steps)[:, np.newaxis]
        known = np.flatnonzero(bodies.truth[1] <= CLEAR * min(ASKED))
        judged[row] = known.size / count
        if not known.size:
            continue
        errors = bodies.errors_at(run_steps(variant, bodies, known, float(steps), marks).states, known)
        for k, time in enumerate(times):
            near = (marks <= np.rint(time * steps)) & (marks > 0.5 * time * steps)
            for place, name in enumerate(("attitude", "energy")):
                medians[place, row, k] = np.median(grain(errors[name][:, near].max(axis=1)))
    data: dict[str, Any] = {
        f"error_{name}": (("family", "time"), medians[k]) for k, name in enumerate(("attitude", "energy"))
    }
    data["judged"] = "family", judged
    return xr.Dataset(data, {"family": list(REGULAR), "time": times}).assign(_traits(variant))


def about(families: dict[str, Bodies], *, long: bool) -> xr.Dataset:
    """Of each family: growth of a disturbance over ten periods, error bounds of the references, a check of these."""
    n = len(next(iter(families.values())).period)
    grown, bounds = np.full((len(families), n), np.nan), np.full((len(families), n), np.nan)
    strata, gap, known = np.full((len(families), n), "", dtype="U16"), np.full(len(families), np.nan), []
    for row, bodies in enumerate(families.values()):
        strata[row], bounds[row] = bodies.strata, bodies.truth[1]
        if not long and not bodies.scenes[0].top.free:
            grown[row] = growth(np.array([scene.top.flat(scene.start) for scene in bodies.scenes]))
        chosen = [k for k in range(min(CHECKED, n)) if not bodies.scenes[k].top.free and bodies.known[k]]
        ratios = [_checked(bodies, k) for k in chosen] if have_heyoka() else []
        gap[row] = max(ratios, default=np.nan)
        known.append(float(bodies.asked(TARGETS)["axis"][2].mean()))
    dims = ("family", "member")
    data: dict[str, Any] = {
        "growth": (dims, grown), "truth_bound": (dims, bounds), "stratum": (dims, strata),
        "off_bound": ("family", gap), "judged": ("family", known),
    }  # fmt: skip
    return xr.Dataset(data, {"family": list(families)})


def _checked(bodies: Bodies, k: int) -> float:
    """Distance of a body's reference from an integration with a bound, over the sum of both bounds: above 1 refutes."""
    body, start = bodies.scenes[k].top, bodies.scenes[k].start
    motion = HeavyBody(body.moments, body.torque, start.quaternion, body.momentum(start), body.momentum_lo(start))
    exact = motion.samples(bodies.times[k])  # NaN from where it is not known
    known = np.isfinite(exact.bound)
    gap = attitude_distance(bodies.truth[0][k][known], unit(exact.quaternion[known]))
    return float((gap / (bodies.truth[1][k] + exact.bound[known])).max(initial=0.0))
