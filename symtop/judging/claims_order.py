"""The order claim: the slope of the error, and the limit that it falls to.

The slope is extrapolated to h = 0 by `symtop.measure.order` from a ladder of steps, then again with more steps put into
the decades of error above rounding where a method of high order is asymptotic; if the scene does not show it, on
`FALLBACK` over longer runs. An adaptive method is fitted against its mean step. What a slope confirms is said by
`symtop.measure.order.order_verdict`, as in every study.

A slope says nothing about a small constant: a method whose coefficients miss their sum by 1e-9 has the right slope down
to an error of 1e-9 and stays there. So the error at the end of a short run of many steps, taken with its sign, is
extrapolated to h = 0 (Richardson's, eliminating h^p and h^(p+1)); what is left beyond rounding is a wrong limit.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.core.errors import SymtopError
from symtop.judging.findings import Finding
from symtop.measure.accuracy import error_table
from symtop.measure.order import Fit
from symtop.measure.order_table import observable, order_fit, order_table
from symtop.measure.settings import ladder
from symtop.methods.framework.outcomes import sentence
from symtop.methods.framework.registry import Integrator
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form, scene as find_scene
from symtop.run.simulation import integrate

Array = NDArray[np.float64]

NUTATIONS = 1.37  # length of the runs that the slope is fitted to
FALLBACK, LONGER = "goldstein", (8.37, 40.0)
FINEST = {"compiled": 2e5, "python": 1e4}  # steps of the longest run
QUICK_SHARE = 0.25  # of these; no verdict on a method of the package changes
LARGEST_EXACT = 2.37  # steps a nutation that a method with exact steps is tried at, beside the ladder
SHARE = 0.37  # of a nutation: length of the runs that are extrapolated to h = 0
STEPS = {1: 40_000, 2: 20_000, 3: 6_000, 4: 2_000, 5: 1_000, 6: 500}  # of the coarsest of them; 200 beyond order 6
TRUE_LIMIT = 1e-11  # a limit as close as this is the true motion


class Order(NamedTuple):
    """What the errors of a method say about its order."""

    scene: str
    step_size: Array
    error: Array  # of the attitude, or of the axis where the chart has no attitude
    bound: Array
    fits: dict[str, Fit]  # attitude (or axis), theta, energy
    observed: str
    fixed_step: bool


def measured_order(method: Integrator, scene: Scene, *, quick: bool = False, finest: float | None = None) -> Order:
    """Slopes of the errors of attitude, theta and energy, where they can be judged; `finest`: most steps of a run."""
    if method.control is None:
        raise SymtopError(f"{method.name} has neither a step nor a tolerance")
    fitted = _slopes(method, scene, NUTATIONS, quick, finest)
    if finest is not None and method.fixed_step and not math.isfinite(fitted.fits[fitted.observed].slope):
        shorter = _slopes(method, scene, SHARE, quick, finest)  # the same number of steps, and smaller errors
        fitted = shorter if math.isfinite(shorter.fits[shorter.observed].slope) else fitted
    if quick or not method.fixed_step or method.order is None or method.implementation == "python":
        return fitted
    for nutations in LONGER:
        if math.isfinite(fitted.fits[fitted.observed].slope):
            break
        again = _slopes(method, find_scene(FALLBACK), nutations, quick, finest)
        fitted = again if math.isfinite(again.fits[again.observed].slope) else fitted
    return fitted


def _slopes(method: Integrator, scene: Scene, nutations: float, quick: bool, finest: float | None = None) -> Order:
    horizon = nutations * scene.time_scale()
    count = (11 if quick else 13) if method.fixed_step else (9 if quick else 25)  # steps that are chosen scatter
    most = FINEST[method.implementation] * (QUICK_SHARE if quick else 1.0) if finest is None else finest
    settings = ladder(method, scene, horizon, count, most)
    main = observable(method)
    table = order_table(scene, method, settings, horizon, main, dense=finest is None)
    step = table["step_size"].values if method.fixed_step else horizon / table["steps"].values
    fits = {name: order_fit(scene, method, table, name, horizon) for name in (main, "theta", "energy")}
    bound = table[f"{main}_bound"].values
    return Order(scene.name, step, table[main].values, bound, fits, main, method.fixed_step)


def exactness(method: Integrator, scene: Scene, *, quick: bool = False) -> Finding:
    """The errors of a method whose every step is said to be the motion itself, at steps of all sizes."""
    horizon, main = NUTATIONS * scene.time_scale(), observable(method)
    largest_step = scene.time_scale() / LARGEST_EXACT
    settings = [largest_step, *ladder(method, scene, horizon, 7 if quick else 13, FINEST[method.implementation])]
    table = error_table(scene, method, settings, horizon, observe=main)
    largest = float(table[main].max())
    why = f"largest error {largest:.1e} at steps from {settings[-1]:.1e} s to {settings[0]:.1e} s on {scene.name}"
    right = largest <= TRUE_LIMIT
    measured, verdict = (f"exact, {largest:.0e}", "confirmed") if right else ("", "refuted")
    return Finding("order", "exact", measured, verdict, why, largest, TRUE_LIMIT)


class Limit(NamedTuple):
    """Where the end of a run goes as h -> 0."""

    miss: float  # distance from the true motion, the larger of angle and momentum over the larger one
    doubt: float  # of the extrapolation


def limit(method: Integrator, scene: Scene, power: int, finest: float | None = None) -> Limit:
    """How far from the true motion a run ends in the limit of small steps, for a method whose order is `power`.

    The finest of the three runs has at most `finest` steps.
    """
    fewest = STEPS.get(power, 200) // (1 if method.implementation == "compiled" else 20)
    if finest is not None:
        fewest = min(fewest, int(finest) // 4)
    ends = [_signed_error(method, scene, SHARE * scene.time_scale(), fewest * 2**k) for k in range(3)]
    once = [_without(power, ends[k], ends[k + 1]) for k in range(2)]
    size = [float(np.max(np.abs(value))) for value in (ends[2], once[1], _without(power + 1, once[0], once[1]))]
    return Limit(min(size[0], size[2]), abs(size[2] - size[1]))


def _without(power: int, coarse: Array, fine: Array) -> Array:
    """The combination of the errors at h and h/2 that has no term in h^power."""
    return fine + (fine - coarse) / (2.0**power - 1.0)


def _signed_error(method: Integrator, scene: Scene, horizon: float, steps: int) -> Array:
    run = integrate(scene, method, step_size=horizon / steps, horizon=horizon, samples=2, observe=observable(method))
    if run.outcome != "ok":
        ended = sentence(run.outcome, run.reached_time, horizon)
        raise SymtopError(f"a run of {steps} steps over {horizon:.3g} {ended}")
    true = closed_form(scene)(np.array([horizon]))
    axis = charts.axis_from_angles(true.theta[0], true.phi[0])
    slip = (float(run.p_theta[-1]) - scene.top.I1 * float(true.theta_dot[0])) / scene.momentum_scale
    turn = [] if run.psi is None else [float(run.psi[-1]) - float(true.psi[0])]
    return np.array([*(run.axis[-1] - axis), slip, *turn])


def settings_shown(fitted: Order, count: int) -> Sequence[Array]:
    """Steps, errors and the mask of the fit, in order of the step and padded to one length, for a dataset."""
    rank = np.argsort(fitted.step_size)[:count]
    padded = np.full((3, count), math.nan)
    used = fitted.fits[fitted.observed].used
    for row, values in zip(padded, (fitted.step_size, fitted.error, used.astype(float)), strict=True):
        row[: rank.size] = values[rank]
    return list(padded)
