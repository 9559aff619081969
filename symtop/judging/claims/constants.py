"""Claims about the constants of the motion over a million steps, and the cost of a step; the worst chart decides.

A constant is kept, bounded, a random walk, a drift or just growing by the rule of every study,
`symtop.measure.conservation.behaviour`. Foreign code may sum without compensation. So a growing change also counts as
rounding if it is at most `KEPT_CHANGE`, relative, or at most the random walk of the rounding seen in one step, n^1/2
times as much, or at most a bias of one epsilon per step, as from products of quaternions that are never normalised. A
drift below a bounded oscillation shows in the means of 24 equal stretches, and counts if its slope exceeds
`SURE_WIDTHS` half-widths of its interval; a random walk passes a plain test of the slope in one case in three, but not
this one. At the size of rounding only the size is judged. As long as a constant has changed little, its change from one
sample to the next must not exceed `SUDDEN` times the sum of as many of the largest changes in one step at the
beginning: otherwise the step works differently somewhere, and the claim is refuted.

A run blows up when its energy has risen by more than that of the nutation and all that the weight can give, 2 |mgl|,
which no friction causes. The constants are then judged over a new run until that time.

A Cayley map keeps |L|^2/2 + c e_z - (h mgl)^2 (1 - e_z^2)/8 with c = h mgl/2 tau for any tau: c is fitted, and the
residual of the fit must vanish. Source: Bobenko, Suris, Commun. Math. Phys. 204 (1999) 147.

In the space frame p_phi = L_z and p_psi = L.e are computed from the states, whatever the run reports; in angles, where
they are parameters of a state, the reported ones are compared with those that the rates imply (`measure.conservation`).
The only constant of a map of (theta, p_theta) is the energy with the p_phi and p_psi of the start.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.core.errors import SymtopError
from symtop.core.numbers import EPSILON
from symtop.judging.adapters.adapter import Stepper
from symtop.judging.claims.subject import CONSTANTS, PLANE, QUICK_SHARE, STEPS_A_NUTATION, Subject, declared
from symtop.judging.findings import UNMEASURED, Finding, Reading, agreement, inapplicable, undecided, yes_no
from symtop.measure.conservation import Change, Difference, behaviour, constant_of, from_increments, maxima, residuals
from symtop.measure.step_map import one_step
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Array, Plan, Run, sentence
from symtop.methods.framework.registry import Integrator
from symtop.model.charts import BODY, space_momenta
from symtop.model.scenes import Scene
from symtop.model.top import SymmetricTop
from symtop.run.simulation import chart_of, make_plan
from symtop.run.trajectory import Trajectory

STEPS, QUICK_STEPS = 1_000_000, 50_000  # of a long run; the second if `quick`
FINER_STEPS = (1.0, 3.17, 10.03)  # factors on the steps per nutation, tried in turn if a run does not reach its end
STEPS_A_TURN = 8.0  # least steps per turn of a body by L about the axis of its least moment
SAMPLES = 4001  # of a long run
PILOT_STEPS = 400  # steps of the run that is sampled at every step
EVALUATIONS = {"compiled": 2e8, "python": 4e4}  # most force evaluations of a long run
LEAST_SHARE = 0.25  # least part of the most steps for a run that is repeated with finer steps, if `quick`
TOLERANCE = 1e-6  # of an adaptive method without a default of its own
KEPT_CHANGE = 1e-11  # relative: a smaller change is rounding
REPORTED_GAP = 1e-9  # relative, of reported momenta from those of the states; plain sums in 1e6 steps cause 1e-11
SECOND_LENGTH = 0.77  # as a part of the run: in a second run so long a drift of such a difference must appear again
ROUNDING_OF_A_STEP = 2e-13  # largest change in one step that may be rounding, if |p| is small beside its terms
GROWTH_EXPONENT = 0.25  # growth is certain if the exponent less its interval is larger
SURE_WIDTHS = 8.0  # half-widths of its interval that the slope of a drift exceeds
VISIBLE_TREND = 1e-3  # of the largest residual: a smaller trend is ignored
SUDDEN, LITTLE_BEFORE, SUDDEN_WORDS = 100.0, 1e-2, "changes as it begins"  # factor of a change; change before
OF_A_RUN = (*CONSTANTS, "reported", "invariant", "explicit", "work")  # reported: reported momenta against the states'
OF_MOTION = (*CONSTANTS, "momentum")  # momentum, of a body: L in space, or L_z of a heavy body
KINDS = ("kept", "bounded", "random walk", "growing", "drift", "blows up")  # from best to worst
OWN_STATES = "its states'"  # the implied claim that a run reports the momenta of its states
BADNESS = ("inapplicable", "measured", "confirmed", "undecided", "refuted")  # verdicts from best to worst
CUTS, SAME_RUN, OF_RUN = 8, 1e-9, "state"  # short runs compared with longer ones; largest difference; its name
WINDOWS = 160  # of a long run in a figure, evenly spaced in the logarithm of time

Rows = dict[str, Array]  # by the names of constants


class Constant(NamedTuple):
    """The change of one constant of the motion over a long run."""

    changed: Change  # relative change, its trend and its growth
    a_step: float  # largest change in one step
    floor: float  # a smaller change is rounding
    grain: float = 1.0  # rounding error of the constant, in machine epsilons
    sudden: str = ""  # a clause on a sudden change, if there is one

    @property
    def kind(self) -> str:
        """kept, bounded, random walk, drift, or just growing; unknown without a size or an exponent to judge it by."""
        change = self.changed
        word = behaviour(change.largest, change.exponent, change.exponent_interval, self.grain, self.floor)
        if word == "kept":
            return word
        if not (math.isfinite(change.largest) and math.isfinite(change.exponent)):
            return "unknown"
        significant = 0.0 < SURE_WIDTHS * change.interval < abs(change.slope)
        return "drift" if significant and abs(change.rise) > VISIBLE_TREND * change.largest else word

    @property
    def grows(self) -> bool | None:
        """Does it grow? None if the interval of the exponent leaves that open."""
        if self.kind in ("kept", "bounded", "unknown"):
            return None if self.kind == "unknown" else False
        lower = self.changed.exponent - self.changed.exponent_interval
        return True if self.kind == "drift" or lower > GROWTH_EXPONENT else None

    def words(self, place: str) -> str:
        """A clause with its largest change, `place`, and the exponent of growth."""
        words, change = f"largest relative change {self.changed.largest:.1e} {place}", self.changed
        if self.kind in ("kept", "unknown"):
            return words
        return f"{words}, growth exponent {change.exponent:.2f} +- {change.exponent_interval:.2f}"

    def verdict(self, claimed: str) -> str:
        """The verdict on the claim that it is kept or bounded; "measured" if neither is claimed."""
        if self.kind == "unknown" or (claimed == "bounded" and self.grows is None):
            return "undecided"
        kept = self.kind == "kept" or (self.kind == "bounded" and self.changed.largest <= self.floor)
        true = {"kept": kept, "bounded": not self.grows}.get(claimed)
        return "measured" if true is None else "confirmed" if true else "refuted"

    def finding(self, claim: str, claimed: str, why: str) -> Finding:
        """The finding on the claim."""
        verdict, measured = self.verdict(claimed), Reading(self.kind, self.changed.largest)
        if self.kind == "unknown":
            why, measured = f"{why}; no law of growth to judge it by", UNMEASURED
        elif verdict == "undecided":
            why += ", which leaves open whether it grows"
        return Finding(claim, claimed, measured, verdict, why, self.changed.largest, self.floor)


class LongRun(NamedTuple):
    """One long run: its constants by name, and its cost."""

    constants: dict[str, Constant]
    outcome: str
    message: str
    chart: str
    steps: int
    nutations: float
    evaluations: float  # of the force, a step
    iterations: float  # of a solver, a step
    steady_cost: bool  # every run of the same number of steps cost the same, at two step sizes
    reported: Difference | None  # of reported momenta from those of the states; None if these are not known
    energy: Array  # times, in nutations, and the largest relative change around each, shape (2, WINDOWS)
    blown_up: float = math.nan  # the time at which it blew up; the run is that until then

    @property
    def span(self) -> str:
        """Its length in words."""
        return f"{f'{self.steps} steps' if self.steps else 'a formula'} over {self.nutations:.3g} {self.period}s"

    @property
    def period(self) -> str:
        """The name of the period in which its length is given."""
        return "natural period" if self.chart == BODY else "nutation"


def _run(
    method: Integrator, scene: Scene, chart: str, steps: float, step: float, samples: int
) -> tuple[Trajectory, Run, Plan]:
    """A run of `steps` steps: as a trajectory with the momenta of its states, as the solver returned it, its plan."""
    horizon = (round(steps) if method.fixed_step else steps) * step
    control = {"step_size": step} if method.fixed_step else {}
    if method.adaptive and method.default_tolerance is None:
        control = {"tolerance": TOLERANCE}
    plan, _ = make_plan(scene, method, **control, horizon=horizon, samples=samples)
    derived = run = solve(method, chart, scene.top, scene.start, plan, f" on {scene.name}")
    if chart in ("axis", "attitude"):
        with np.errstate(over="ignore", invalid="ignore"):  # a run may blow up
            p_phi, p_psi = space_momenta(chart, run.states)
        derived = run._replace(p_phi=p_phi, p_psi=p_psi)
    return Trajectory.of_run(scene, chart, plan, derived), run, plan


def long_run(
    method: Integrator, scene: Scene, chart: str, *, quick: bool = False, most: float | None = None, seed: int = 0
) -> LongRun:
    """A run of a million steps of a compiled method in a chart, or of `most`; fewer if that would take minutes."""
    run_chart, unit = "angles" if chart == PLANE else chart, scene.time_scale()
    for factor in FINER_STEPS:  # a motion that passes close to a pole needs shorter steps
        step = unit / (STEPS_A_NUTATION * factor)
        if scene.of_body:  # L turns a needle about its own axis many times in a natural period
            step = min(step, math.tau * min(scene.top.moments) / (STEPS_A_TURN * scene.momentum_scale))
        pilot, first, few = _run(method, scene, run_chart, PILOT_STEPS, step, PILOT_STEPS + 1)
        steps = float(PILOT_STEPS)  # for a closed form, which has no steps that accumulate errors
        if method.control is not None:
            cost = max(first.force_evaluations / PILOT_STEPS, 1.0)
            share = QUICK_SHARE if quick else 1.0
            limit = share * EVALUATIONS[method.implementation] / cost if most is None else most
            steps = max(min(QUICK_STEPS if quick else STEPS, limit) * method.speed, PILOT_STEPS)
        trajectory, run, plan = _run(method, scene, run_chart, steps, step, SAMPLES)
        if run.outcome == "ok" or not method.fixed_step:
            break
        if quick and most is not None:
            most = max(most - run.steps, LEAST_SHARE * most)
    _, second, _ = _run(method, scene, run_chart, PILOT_STEPS, 0.21 * step, PILOT_STEPS + 1)
    steady_cost = len({run.force_evaluations / max(run.steps, 1) for run in (first, second)}) == 1
    reported = None
    plain = isinstance(method.solvers[run_chart], Stepper)
    if not (plain or scene.of_body):  # else its momenta are those of its states
        reported = _reported(method, scene, chart, trajectory, (run, plan))
        if method.fixed_step:
            reported = _contradiction(method, scene, chart, (run, plan), (first, few), seed) or reported
    changes, every_step, blown_up = constants(scene, trajectory), constants(scene, pilot), math.nan
    if (indices := blows_up(scene, changes["energy"])).size:
        blown_up = float(plan.times[indices[0]])
        trajectory, run, plan = _run(method, scene, run_chart, blown_up / step, step, SAMPLES)
        changes = constants(scene, trajectory)
    count, grains = max(run.steps, 1), {"energy": scene.energy_grain}
    grains |= dict.fromkeys(("p_phi", "p_psi"), momentum_grain(scene, trajectory.momentum))
    by_name = {
        name: change_of(plan.times, changes[name], every_step[name], count, grains.get(name, 1.0), plain=plain,
                        even=not scene.of_body, period=unit)
        for name in (changes if chart != PLANE else ("energy",))
    }  # fmt: skip
    message, nutations = sentence(run.outcome, run.reached, float(plan.times[-1])), run.reached / unit
    step_count = min(run.steps, round(run.reached / step)) if method.fixed_step else run.steps  # of those made
    costs = run.force_evaluations / count, run.newton_iterations / count, steady_cost
    times = plan.times / unit
    rows = maxima(times, changes["energy"], math.log10(times[-1] / times[1]), WINDOWS)  # fewer, where no sample is
    energy = np.array([np.pad(row, (0, WINDOWS - len(row)), constant_values=math.nan) for row in rows])
    return LongRun(by_name, run.outcome, message, chart, step_count, nutations, *costs, reported, energy, blown_up)


def momentum_grain(scene: Scene, momentum: Any) -> float:
    """`Scene.momentum_grain`; of a top |L|/100 over p_phi and p_psi if these are smaller: rounding is that of |L|."""
    if scene.of_body:
        return scene.momentum_grain(momentum)
    top, p_psi = scene.top, scene.top.momenta(scene.start).p_psi
    square = 2.0 * top.I1 * (top.energy(scene.start) + abs(top.mgl)) + (1.0 - top.I1 / top.I3) * p_psi**2  # largest L^2
    return max(0.01 * math.sqrt(max(square, 0.0)) / scene.momentum_scale, 1.0)


def blows_up(scene: Scene, change: Array) -> NDArray[np.int64]:
    """The indices of samples whose energy has risen by more than that of the nutation plus 2 |mgl|."""
    return np.flatnonzero(change > 1.0 + 2.0 * abs(scene.top.mgl) / scene.energy_scale)


def blow_up_finding(finding: Finding, time: float, of_body: bool, steps: str = "") -> Finding:
    """The finding on the energy of a run that blows up at `time`, or on a momentum that is infinite then."""
    measured, when = Reading("blows up", finding.value, f"blows up at t = {time:.3g}{steps}"), f"by t = {time:.3g}"
    limit = "the kinetic one of the start and 3 |mgl|" if of_body else "that of the nutation and 2 |mgl|"
    rise = f"rises by more than {limit}" if finding.claim == "energy" else "is infinite"
    why = f"{when} it {rise}; before: {finding.why}"
    return finding._replace(measured=measured, verdict="refuted" if finding.declared else "measured", why=why)


def _contradiction(
    method: Integrator, scene: Scene, chart: str, long: tuple[Run, Plan], pilot: tuple[Run, Plan], seed: int
) -> Difference | None:
    """A difference between a run of n steps, n random, and the first n of a longer run; None if all runs agree."""
    rng = np.random.default_rng(seed)
    for k in range(CUTS):
        run, plan = long if k % 2 else pilot
        step, marks = one_step(method, chart, scene, plan.step_size), plan.marks  # an unstable motion shows one bit
        i = min(int(marks.size ** rng.uniform(0.0, 1.0)), marks.size - 1)
        state = step.scaled(run.states[i], run.p_phi[i], run.p_psi[i])
        if marks[i] > 0 and np.isfinite(state).all():
            gap = step.gap(step.shown(step.run(scene.start, step.h, int(marks[i]))), state)
            if gap > SAME_RUN:
                how = f"in a run of {marks[i]} steps from the first of one of {marks[-1]} (seed {seed})"
                return Difference(OF_RUN, gap, SAME_RUN, how)
    return None


def _reported(
    method: Integrator, scene: Scene, chart: str, trajectory: Trajectory, long: tuple[Run, Plan]
) -> Difference | None:
    run, plan = long
    if chart == "angles":
        drift = from_increments(method, scene, plan) if method.fixed_step else None
        if drift is not None and drift.size > drift.floor:  # aliasing may give a drift at one length only
            shorter = Plan.steps(plan.step_size, [0, round(SECOND_LENGTH * int(plan.marks[-1]))])
            drift = min(drift, from_increments(method, scene, shorter) or drift, key=lambda difference: difference.size)
        return drift
    gaps = {name: np.abs(getattr(run, name) - getattr(trajectory, name)) for name in ("p_phi", "p_psi")}
    size, name = max((float(np.max(gap[np.isfinite(gap)], initial=0.0)), name) for name, gap in gaps.items())
    size, floor = size / scene.momentum_scale, REPORTED_GAP * momentum_grain(scene, None)
    return Difference(name, size, floor, f"of the larger momentum in {run.steps} steps")


@np.errstate(over="ignore", invalid="ignore")  # a run may blow up
def constants(scene: Scene, run: Trajectory) -> Rows:
    """Relative change of every constant that the run's chart has, at its samples."""
    changes = residuals(scene, run)
    if scene.of_body:
        change = (run.momentum - run.momentum[0]) / scene.momentum_scale
        return changes | {"momentum": np.linalg.norm(change, axis=1) if scene.top.free else change[:, 2]}
    if run.chart != "angles":
        changes["axis_length"] = np.linalg.norm(run.axis, axis=1) - 1.0
        if math.isfinite(run.step_size):
            changes["cayley_energy"] = _cayley_residual(scene.top, run)
    return changes


def _cayley_residual(top: SymmetricTop, run: Trajectory) -> Array:
    """|L|^2/2 + c u - k^2 (1-u^2)/8 with the best c, relative to its size; |L|^2 is in the energy."""
    u = run.axis[:, 2]
    spin: Array = 0.5 * run.p_psi**2 * (1.0 / top.I3 - 1.0 / top.I1)
    square: Array = top.I1 * (run.energy - top.mgl * u - spin)  # |L|^2 / 2
    kick = run.step_size * top.mgl
    partial = square - kick * kick * (1.0 - u) * (1.0 + u) / 8.0
    valid = np.isfinite(partial) & np.isfinite(u)
    if valid.sum() < 8 or np.ptp(u[valid]) == 0.0:
        return np.full(u.size, math.nan)
    du, dr = u[valid] - u[valid].mean(), partial[valid] - partial[valid].mean()
    c = -float(du @ dr) / float(du @ du)
    invariant = partial + c * u
    return np.asarray((invariant - invariant[0]) / float(np.max(np.abs(partial[valid]))))


def change_of(
    time: Array, values: Array, every_step: Array, steps: int, grain: float = 1.0, *, plain: bool = False,
    even: bool = True, period: float = 0.0,
) -> Constant:  # fmt: skip
    """Size, growth after a `period`, trend of a residual over `steps` steps; `every_step` holds it at consecutive ones.

    With `plain` sums half of the rounding error of one step may be a bias that adds up, but at most an epsilon per
    step. A motion that is not `even` may be calm at first and turn over later: sudden changes are not judged.
    """
    with np.errstate(invalid="ignore"):  # a run may blow up
        jumps = np.abs(np.diff(every_step))
    a_step = float(np.max(jumps[np.isfinite(jumps)])) if np.isfinite(jumps).any() else math.nan
    rounding = a_step * math.sqrt(steps) if a_step <= ROUNDING_OF_A_STEP * grain else 0.0
    rounding = max(rounding, min(0.5 * a_step, EPSILON * grain) * steps * plain * (rounding > 0.0))
    floor = max(KEPT_CHANGE * grain, rounding)
    with np.errstate(all="ignore"):  # a run may blow up
        ratio = np.abs(np.diff(values)) / max(a_step * steps / (time.size - 1), floor)
        small = np.abs(values[1:-1]) < LITTLE_BEFORE
        jump = np.flatnonzero((ratio[1:] > SUDDEN) & (np.fmax.accumulate(ratio)[:-1] < SUDDEN / 10.0) & small)
    words = "after t = {:.4g} it changes {:.0e} times as much as by its first steps"
    sudden = words.format(time[jump[0] + 1], ratio[jump[0] + 1]) if even and jump.size else ""
    return Constant(constant_of(time, values, period=period), a_step, floor, grain, sudden)


def measure(subject: Subject) -> list[Finding]:
    """The findings from one long run in each chart; the worst chart decides, and the finding names it."""
    method, scene, runs, by_chart = subject.method, subject.scene, [], []
    charts = (chart_of(method, BODY),) if scene.of_body else (PLANE,) if subject.in_plane else method.charts()
    options: dict[str, Any] = {"quick": subject.quick, "most": subject.long_steps, "seed": subject.seed}
    for chart in charts:
        try:
            runs.append(long_run(method, scene, chart, **options))
            findings = of_run(method, runs[-1])
        except SymtopError as error:
            findings = [undecided(claim, declared(method, claim), str(error)) for claim in (*OF_A_RUN, "momentum")]
        for k, finding in enumerate(findings):  # name the chart in the reason
            if finding.verdict != "inapplicable" and not finding.why.endswith(" chart"):
                findings[k] = finding._replace(why=f"{finding.why}, in the {chart} chart")
        by_chart.append({finding.claim: finding for finding in findings})
    if runs:
        run = min(runs, key=lambda run: run.steps)
        length = {"steps_run": np.array(run.steps), "nutations_run": np.array(run.nutations)}
        subject.traces.update(length, long_nutations=run.energy[0], energy_change=run.energy[1])
    return [max((findings[claim] for findings in by_chart), key=_badness) for claim in by_chart[0]]


def of_run(method: Integrator, run: LongRun) -> list[Finding]:
    """The findings from one long run on each claim of `OF_A_RUN`, and on the momentum of a body."""
    motion = [_constant(method, name, declared(method, name), run, run.constants.get(name)) for name in OF_MOTION]
    return [*motion, _of_states(run), _invariant(method, run), *_costs(method, run)]


def _badness(finding: Finding) -> tuple[int, int, float]:
    """The rank of a finding among the charts: by its verdict, then by the kind of growth, then by its number."""
    growth = KINDS.index(finding.measured.kind) if finding.measured.kind in KINDS else -1
    return BADNESS.index(finding.verdict), growth, finding.value if math.isfinite(finding.value) else -1.0


def _constant(method: Integrator, claim: str, claimed: str, run: LongRun, constant: Constant | None) -> Finding:
    if constant is None:
        return inapplicable(claim, f"the {run.chart} chart has no such constant", claimed)
    kind, changed, failed = constant.kind, constant.changed, run.outcome != "ok"
    why = constant.words(f"in {run.span}, {constant.a_step:.0e} in one step at most")
    why += f", drifting by {changed.rise / max(run.steps, 1):.1e} a step" if kind == "drift" else ""
    finding = constant.finding(claim, claimed, why)
    finding = finding if run.steps and not (failed and run.nutations < 1.0) else finding._replace(measured=UNMEASURED)
    # an error that is periodic with the nutation cannot exceed the largest change of a step times the steps of one
    limit = constant.a_step * run.steps / run.nutations if run.nutations > 1.0 else math.inf
    if claim == "energy" and run.blown_up > 0.0:
        steps = f", after {run.steps} steps, {run.steps / run.nutations:.0f} a {run.period}"
        return blow_up_finding(finding, run.blown_up, run.chart == BODY, steps)
    if run.outcome not in ("ok", "not_finite", "not_normalised") or (failed and kind in ("kept", "bounded")):
        return finding._replace(verdict="undecided", why=f"{why}; but the run {run.message}")
    if method.fixed_step and constant.sudden:
        return finding._replace(verdict="refuted", declared=claimed or SUDDEN_WORDS, why=f"{constant.sudden}; {why}")
    if kind == "unknown" and failed:
        return finding._replace(why=f"the run {run.message}")
    periodic = ("kept", "unknown", *["bounded"] * (run.chart == BODY))  # a body may have slower periods, too
    if claimed == "bounded" and kind not in periodic and changed.largest > max(limit, constant.floor):
        why += f", more than the steps of a {run.period} can add up to: it does not come back"
        return finding._replace(verdict="refuted", why=why)
    return finding


def _of_states(run: LongRun) -> Finding:
    """The finding on whether reported momenta are those of the states, and a short run is part of a longer one."""
    if (difference := run.reported) is None:
        return inapplicable("reported", f"the {run.chart} chart shows no momenta beside the reported")
    declared, verdict, clause = OWN_STATES, "refuted", f"differs by {difference.size:.1e} {difference.how}"
    if difference.size <= difference.floor:
        declared, verdict, kind = "", "measured", OWN_STATES
        why = f"the momenta that it reports differ from those of its states by {difference.size:.1e} at most"
    elif difference.name == OF_RUN:
        kind, why = "another run", f"a run contradicts itself, as if the method knew of it: the state {clause}"
    else:
        kind, why = "others", f"it reports other momenta than its states have: {difference.name} {clause}"
    return Finding("reported", declared, Reading(kind), verdict, why, difference.size, difference.floor)


def _invariant(method: Integrator, run: LongRun) -> Finding:
    """The finding on invariants that a method claims but that are not constants of the true motion."""
    if not (claimed := declared(method, "invariant")):
        return inapplicable("invariant", "it claims no invariant of its own")
    names = claimed.split(", ")
    if unknown := ", ".join(name for name in names if name not in run.constants):
        return undecided("invariant", claimed, f"the battery has no formula for {unknown}")
    worst = max(names, key=lambda name: run.constants[name].changed.largest)
    return _constant(method, "invariant", "kept", run, run.constants[worst])._replace(declared=claimed)


def _costs(method: Integrator, run: LongRun) -> list[Finding]:
    claimed, iterates = declared(method, "explicit"), run.iterations > 0.0
    if method.control is None or not run.evaluations:
        why = "it makes no steps" if method.control is None else "its forces are not counted"
        return [inapplicable("explicit", why, claimed), inapplicable("work", why)]
    text = f"{run.evaluations:.1f}" + f" ({run.iterations:.1f} it.)" * iterates
    clause = f" and {run.iterations:.2f} iterations" * iterates
    why = f"{run.evaluations:.2f} force evaluations{clause} a step, in {run.span}"
    work = Finding("work", "", Reading("work", run.evaluations, text=text), "measured", why, run.evaluations, 0.0)
    if not (iterates or run.steady_cost):
        why = "it reports no iterations, but its steps do not all cost the same"
        return [undecided("explicit", claimed, why), work]
    explicit = False if iterates else None if method.explicit is False else True
    why = f"it reports no iterations and {run.evaluations:.2f} forces a step, always"
    why += "; so does a method that solves linear equations" * (explicit is None)
    why = f"it reports {run.iterations:.2f} iterations a step" if iterates else why
    finding = agreement("explicit", method.explicit, explicit, why, run.iterations, 0.0)
    return [finding._replace(measured=Reading(yes_no(explicit))), work]
