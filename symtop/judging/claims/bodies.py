"""The claims of a method on a body without symmetry: its order, the energy, and L in space, of a heavy body L_z.

The order is the slope of attitude errors against the exact motion, or the integrated one of a heavy body, by the rule
of every study (`symtop.measure.order`). Energy and momentum are judged over a long run as on a top (`constants`). L_z,
and all of L without a weight, is kept to rounding by methods that turn q and M by the same rotation and kick by the
torque: splittings, variational and Lie-group methods, and maps of engines that carry L in space. M.Gamma is a cubic of
the state, so that p_phi, which a Runge-Kutta method keeps on the axis of a top, is no claim of it here.

A method may be of higher order on one body than on others, as Fasso's is: that refutes nothing.
"""

import math

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.claims.constants import SAMPLES, Constant, change_of
from symtop.judging.claims.subject import STEPS_A_NUTATION, declared
from symtop.judging.findings import NOTHING, Finding, Ledger, Measured, undecided, yes_no
from symtop.measure.accuracy import error_table
from symtop.measure.order import CLEARLY, order, order_verdict
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Plan, Run
from symtop.methods.framework.registry import ENGINE, Integrator
from symtop.model.charts import BODY, View
from symtop.model.scenes import Scene

PERIODS = 3.0  # natural periods, of the runs of the order
LEAST, COARSEST, FINEST, FALLS = 3.0, 300.0, 1e5, 11.0  # steps a natural period, and decades that errors fall by
RUNS = {False: 40, True: 20}  # of the order; the second with --quick
STEPS = {False: 1_000_000, True: 50_000}
PILOT = 400  # steps of the run that is sampled at every step
TOLERANCE = 1e-9  # of an adaptive method in the long run
KEEPING = ("splitting", "discrete-lagrangian", "lie-group")  # families


def keeps_momentum(method: Integrator) -> bool:
    """Does L, or L_z of a heavy body, not move but by rounding?"""
    return method.family in KEEPING or (method.family == ENGINE and "p_phi" in (method.conserves or ()))


def judge(method: Integrator, scene: Scene, *, quick: bool = False) -> Ledger:
    """Measure what a method claims on a body; undecided where it has no chart for one, or a run fails."""
    findings: tuple[Finding, ...]
    try:
        if BODY not in method.solvers:
            raise SymtopError("it has no chart for bodies without symmetry")  # noqa: TRY301
        findings = _order(method, scene, quick), *_constants(method, scene, quick)
    except SymtopError as error:
        findings = tuple(undecided(name, "", str(error)) for name in ("order", "energy", "momentum"))
    return Ledger(method.name, scene.name, findings, {})


def _order(method: Integrator, scene: Scene, quick: bool) -> Finding:
    period, power = scene.nutation_period, method.order or 1
    coarsest, horizon = max(LEAST, COARSEST / power**2), PERIODS * period
    counts = np.geomspace(coarsest, min(coarsest * 10.0 ** (FALLS / power), FINEST), RUNS[quick])
    settings = [period / count for count in counts]
    if method.adaptive:
        settings = [max(10.0**-power, method.least_tolerance) for power in np.linspace(2.0, 11.0, RUNS[quick])]
    table = error_table(scene, method, settings, horizon)
    step = table["step_size"].values if method.fixed_step else horizon / table["steps"].values
    error, bound = table["attitude"].values, table["attitude_bound"].values
    fit = order(step, error, bound, 2.0 * math.pi / period, method.order, symmetric=method.symmetric)
    verdict, why = order_verdict(method.order, fit), f"attitude {fit} on {scene.name}"
    if not math.isfinite(fit.slope):
        return undecided("order", yes_no(method.order), fit.reason)
    if verdict == "refuted" and fit.slope - fit.interval > (method.order or 0) + CLEARLY:
        verdict, why = "measured", f"{why}: here the error falls with a higher power"
    elif verdict == "refuted" and method.adaptive and method.explicit is False:  # Radau: h^4
        verdict, why = "undecided", f"{why}: its equations, too, are solved no better than to the tolerance"
    measured = Measured("order", fit.slope, text=f"{fit.slope:.2f}")
    return Finding("order", yes_no(method.order), measured, verdict, why, fit.slope, fit.interval)


def _constants(method: Integrator, scene: Scene, quick: bool) -> list[Finding]:
    """The findings on energy and momentum, of a long run and of its first steps."""
    h = scene.nutation_period / STEPS_A_NUTATION

    def run(steps: int, samples: int) -> tuple[np.ndarray, Run]:
        marks = np.unique(np.rint(np.linspace(0.0, steps, samples)).astype(np.int64))
        plan = Plan.steps(h, marks)
        if method.adaptive:
            plan = Plan.until(plan.times, max(TOLERANCE, method.least_tolerance))
        return plan.times, solve(method, BODY, scene.top, scene.start, plan, f" on {scene.name}")

    steps = max(round(STEPS[quick] * method.speed), PILOT) if method.fixed_step else STEPS[True]
    (times, long), (_, first) = run(steps, SAMPLES), run(PILOT, PILOT + 1)
    changes = zip(_changes(scene, long), _changes(scene, first), strict=True)
    with np.errstate(over="ignore", invalid="ignore"):
        energy, momentum = (change_of(times, *rows, max(long.steps, 1)) for rows in changes)
    kept = "kept" if keeps_momentum(method) else ""
    return [_constant("energy", declared(method, "energy"), energy, long), _constant("momentum", kept, momentum, long)]


def _changes(scene: Scene, run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Relative change of the energy since the start, and of L in space, or of L_z under a weight."""
    with np.errstate(over="ignore", invalid="ignore"):  # a run may blow up
        seen = View(BODY, scene.top, run.states)
        moved = seen.momentum - seen.momentum[0]
        size = np.linalg.norm(moved, axis=1) if scene.top.free else moved[:, 2]
        return (seen.energy - seen.energy[0]) / scene.energy_scale, size / scene.momentum_scale


def _constant(claim: str, claimed: str, constant: Constant, run: Run) -> Finding:
    kind, changed = constant.kind, constant.changed
    why = f"largest relative change {changed.largest:.1e} in {run.steps} steps"
    if run.outcome != "ok":
        return undecided(claim, claimed, f"{why}; the run ended: {run.outcome}")
    measured = Measured(kind, changed.largest) if kind != "unknown" else NOTHING
    return Finding(claim, claimed, measured, constant.verdict(claimed), why, changed.largest, constant.floor)
