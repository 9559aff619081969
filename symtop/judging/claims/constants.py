"""What a million steps do to the constants of the motion, and what a step costs; the worst chart of a method decides.

A constant is kept, bounded, a random walk, a drift or just growing by the rule of every study,
`symtop.measure.conservation.behaviour`. Somebody else's sums may be plain. So a change that grows is rounding, too,
while it is no more than `KEPT`, relative, or than the random walk that the rounding seen in one step makes, n^1/2 times
as much, or than a bias of a unit of rounding a step, as of products of quaternions that nothing brings back to length
one. A drift that hides below a bounded oscillation shows in the means of 24 equal stretches, and counts if the line
through them exceeds `SURE` of its own intervals. A random walk passes a plain test of the slope in one case in three,
and not this one; at the size of rounding only the size is judged. While it has changed little, no constant changes from
one sample to the next by `SUDDEN` times what as many of the largest steps at the beginning add up to: else the step is
another one somewhere, whatever is claimed of it.

A run blows up when its energy has risen by more than that of the nutation and all that the weight can give, 2 |mgl|: no
friction does that, and nothing after it is of the top. The constants are judged over the run until then, made again.

A Cayley map keeps |L|^2/2 + c e_z - (h mgl)^2 (1 - e_z^2)/8 with c = h mgl/2 tau, whatever its tau: c is fitted, and it
is the rest of the fit that must vanish. Source: Bobenko, Suris, Commun. Math. Phys. 204 (1999) 147.

In the space frame p_phi = L_z and p_psi = L.e are those of the states, whatever the run reports; in angles, where they
are parameters of a state, those of the increments are set beside the reported ones (`symtop.measure.conservation`). The
one constant of a map of (theta, p_theta) is the energy at the p_phi and p_psi of the start, which are parameters.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symtop.core.errors import SymtopError
from symtop.core.numbers import EPSILON
from symtop.judging.adapters.adapter import Stepper
from symtop.judging.claims.subject import CONSTANTS, PLANE, STEPS_A_NUTATION, Subject, declared
from symtop.judging.findings import NOTHING, Finding, Measured, agreement, inapplicable, undecided, yes_no
from symtop.measure.conservation import Changed, Difference, behaviour, constant_of, from_increments, residuals, tops
from symtop.measure.step_map import one_step
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Array, Plan, Run, sentence
from symtop.methods.framework.registry import Integrator
from symtop.model.charts import BODY, space_momenta
from symtop.model.scenes import Scene
from symtop.model.top import SymmetricTop
from symtop.run.simulation import chart_of, make_plan
from symtop.run.trajectory import Trajectory

STEPS, QUICK_STEPS = 1_000_000, 50_000
FINER = (1.0, 3.17, 10.03)  # times more, if a run does not reach its end
STEPS_A_TURN = 8.0  # at least, of a body by L about the axis of its least moment
SAMPLES = 4001
PILOT = 400  # steps of the run that is sampled at every step
EVALUATIONS = {"compiled": 2e8, "python": 4e4}
LEAST_SHARE = 0.25  # of the most steps with --quick: what a run gets after one that used them and failed
QUICK_SHARE = 0.25  # of these; no verdict on a method of the package changes
TOLERANCE = 1e-6  # of an adaptive method without a default of its own
KEPT = 1e-11
REPORTED = 1e-9  # relative, of a reported momentum from that of the states: plain sums leave 1e-11 in a million steps
OTHER = 0.77  # of a run: the length at which a drift of such a difference is asked for again
ROUNDING_OF_A_STEP = 2e-13  # a change in one step that may be rounding, where |p| is small beside what makes it up
BOUNDED = 0.25  # an exponent that exceeds it with its whole interval is growth
SURE = 8.0
VISIBLE = 1e-3  # of the largest residual: a smaller trend does not matter
SUDDEN, LITTLE, FROM = 100.0, 1e-2, "changes as it begins"
OF_A_RUN = (*CONSTANTS, "reported", "invariant", "explicit", "work")  # reported: momenta beside those of the states
OF_MOTION = (*CONSTANTS, "momentum")  # the last of a body: L in space, of a heavy one L_z
KINDS = ("kept", "bounded", "random walk", "growing", "drift", "blows up")  # from best to worst
OWN = "its states'"  # what every run says of the momenta that it reports
BADNESS = ("inapplicable", "measured", "confirmed", "undecided", "refuted")
CUTS, SAME_RUN, OF_RUN = 8, 1e-9, "state"  # runs that are compared with parts of longer ones, and within what
WINDOWS = 160  # of a long run, evenly spaced in the logarithm of time: what a figure shows of it

Rows = dict[str, Array]  # by the names of constants


class Constant(NamedTuple):
    """What became of one constant of the motion."""

    changed: Changed  # relative change, its trend and its growth
    a_step: float  # largest change in one step
    floor: float  # a smaller change is rounding
    grain: float = 1.0  # rounding of the constant, in units of the machine's
    sudden: str = ""  # from when on it changes so much more than by its first steps

    @property
    def kind(self) -> str:
        """kept, bounded, random walk, drift, or just growing; unknown without a size or an exponent to judge it by."""
        change = self.changed
        word = behaviour(change.largest, change.exponent, change.exponent_interval, self.grain, self.floor)
        if word == "kept":
            return word
        if not (math.isfinite(change.largest) and math.isfinite(change.exponent)):
            return "unknown"
        sure = 0.0 < SURE * change.interval < abs(change.slope)
        return "drift" if sure and abs(change.rise) > VISIBLE * change.largest else word

    @property
    def grows(self) -> bool | None:
        """Is it beyond doubt that it grows? None if the exponent leaves that open."""
        if self.kind in ("kept", "bounded", "unknown"):
            return None if self.kind == "unknown" else False
        least = self.changed.exponent - self.changed.exponent_interval
        return True if self.kind == "drift" or least > BOUNDED else None

    def words(self, place: str) -> str:
        """Its largest change, the place of it, and how it grows."""
        words, change = f"largest relative change {self.changed.largest:.1e} {place}", self.changed
        if self.kind in ("kept", "unknown"):
            return words
        return f"{words}, growth exponent {change.exponent:.2f} +- {change.exponent_interval:.2f}"

    def verdict(self, claimed: str) -> str:
        """Of the claim that it is kept or bounded; "measured" where neither is claimed."""
        if self.kind == "unknown" or (claimed == "bounded" and self.grows is None):
            return "undecided"
        within = self.kind == "kept" or (self.kind == "bounded" and self.changed.largest <= self.floor)
        true = {"kept": within, "bounded": not self.grows}.get(claimed)
        return "measured" if true is None else "confirmed" if true else "refuted"

    def finding(self, claim: str, claimed: str, why: str) -> Finding:
        """The finding on the claim."""
        verdict, measured = self.verdict(claimed), Measured(self.kind, self.changed.largest)
        if self.kind == "unknown":
            why, measured = f"{why}; no law of growth to judge it by", NOTHING
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
    reported: Difference | None  # of the momenta from those of the states; None where the states show none
    energy: Array  # times, in nutations, and the largest relative change around each, shape (2, WINDOWS)
    blown_up: float = math.nan  # the time at which it blew up; the run is that until then

    @property
    def span(self) -> str:
        """Its length in words."""
        return f"{f'{self.steps} steps' if self.steps else 'a formula'} over {self.nutations:.3g} {self.period}s"

    @property
    def period(self) -> str:
        """What its length is counted in."""
        return "natural period" if self.chart == BODY else "nutation"


def _run(
    method: Integrator, scene: Scene, chart: str, steps: float, step: float, samples: int
) -> tuple[Trajectory, Run, Plan]:
    """A run for `steps` times `step`: with the momenta of its states, as the solver returned it, and its plan."""
    horizon = (round(steps) if method.fixed_step else steps) * step
    control = {"step_size": step} if method.fixed_step else {}
    if method.adaptive and method.default_tolerance is None:
        control = {"tolerance": TOLERANCE}
    plan, _ = make_plan(scene, method, **control, horizon=horizon, samples=samples)
    own = run = solve(method, chart, scene.top, scene.start, plan, f" on {scene.name}")
    if chart in ("axis", "attitude"):
        with np.errstate(over="ignore", invalid="ignore"):  # a run may blow up
            p_phi, p_psi = space_momenta(chart, run.states)
        own = run._replace(p_phi=p_phi, p_psi=p_psi)
    return Trajectory.of_run(scene, chart, plan, own), run, plan


def long_run(
    method: Integrator, scene: Scene, chart: str, *, quick: bool = False, most: float | None = None, seed: int = 0
) -> LongRun:
    """A million steps of a compiled method in one of its charts, or `most`; fewer where that would take minutes."""
    inside, unit = "angles" if chart == PLANE else chart, scene.time_scale()
    for finer in FINER:  # a motion that passes close to a pole needs shorter steps
        step = unit / (STEPS_A_NUTATION * finer)
        if scene.of_body:  # L turns a needle about its own axis many times in a natural period
            step = min(step, math.tau * min(scene.top.moments) / (STEPS_A_TURN * scene.momentum_scale))
        pilot, first, _ = _run(method, scene, inside, PILOT, step, PILOT + 1)
        steps = float(PILOT)  # of a formula, which has no steps: nothing adds up
        if method.control is not None:
            cost = max(first.force_evaluations / PILOT, 1.0)
            share = QUICK_SHARE if quick else 1.0
            limit = share * EVALUATIONS[method.implementation] / cost if most is None else most
            steps = max(min(QUICK_STEPS if quick else STEPS, limit) * method.speed, PILOT)
        trajectory, run, plan = _run(method, scene, inside, steps, step, SAMPLES)
        if run.outcome == "ok" or not method.fixed_step:
            break
        if quick and most is not None:
            most = max(most - run.steps, LEAST_SHARE * most)
    _, other, _ = _run(method, scene, inside, PILOT, 0.21 * step, PILOT + 1)
    steady = len({one.force_evaluations / max(one.steps, 1) for one in (first, other)}) == 1
    reported = None
    plain = isinstance(method.solvers[inside], Stepper)
    if not (plain or scene.of_body):  # else its momenta are those of its states
        reported = _reported(method, scene, chart, trajectory, (run, plan))
        if method.fixed_step:
            reported = _contradiction(method, scene, chart, (run, plan), first, step, seed) or reported
    changes, every_step, blown_up = constants(scene, trajectory), constants(scene, pilot), math.nan
    if (beyond := blows_up(scene, changes["energy"])).size:
        blown_up = float(plan.times[beyond[0]])
        trajectory, run, plan = _run(method, scene, inside, blown_up / step, step, SAMPLES)
        changes = constants(scene, trajectory)
    count, grains = max(run.steps, 1), {"energy": scene.energy_grain}
    by_name = {
        name: change_of(plan.times, changes[name], every_step[name], count, grains.get(name, 1.0), plain=plain,
                        even=not scene.of_body)
        for name in (changes if chart != PLANE else ("energy",))
    }  # fmt: skip
    message, nutations = sentence(run.outcome, run.reached, float(plan.times[-1])), run.reached / unit
    shown = min(run.steps, round(run.reached / step)) if method.fixed_step else run.steps  # of those that were made
    costs = run.force_evaluations / count, run.newton_iterations / count, steady
    times = plan.times / unit
    rows = tops(times, changes["energy"], math.log10(times[-1] / times[1]), WINDOWS)  # fewer, where no sample is
    energy = np.array([np.pad(row, (0, WINDOWS - len(row)), constant_values=math.nan) for row in rows])
    return LongRun(by_name, run.outcome, message, chart, shown, nutations, *costs, reported, energy, blown_up)


def blows_up(scene: Scene, change: Array) -> NDArray[np.int64]:
    """The samples at which the energy has risen by more than that of the nutation and all that the weight can give."""
    return np.flatnonzero(change > 1.0 + 2.0 * abs(scene.top.mgl) / scene.energy_scale)


def blow_up_finding(finding: Finding, time: float, of_body: bool, steps: str = "") -> Finding:
    """The finding on such an energy."""
    measured, when = Measured("blows up", finding.value, f"blows up at t = {time:.3g}{steps}"), f"by t = {time:.3g}"
    most = "the kinetic one of the start and 3 |mgl|" if of_body else "that of the nutation and 2 |mgl|"
    why = f"{when} it rises by more than {most}; before: {finding.why}"
    return finding._replace(measured=measured, verdict="refuted" if finding.declared else "measured", why=why)


def _contradiction(
    method: Integrator, scene: Scene, chart: str, long: tuple[Run, Plan], pilot: Run, h: float, seed: int
) -> Difference | None:
    """How far a run of n steps, n drawn at random, is from the first n of a longer one: a step knows nothing of it."""
    draw, step = np.random.default_rng(seed), one_step(method, chart, scene, h)
    for k in range(CUTS):
        run, marks = (long[0], long[1].marks) if k % 2 else (pilot, np.arange(pilot.states.shape[0]))
        i = min(int(marks.size ** draw.uniform(0.0, 1.0)), marks.size - 1)
        state = step.scaled(run.states[i], run.p_phi[i], run.p_psi[i])
        if marks[i] > 0 and np.isfinite(state).all():
            gap = step.gap(step.shown(step.run(scene.start, h, int(marks[i]))), state)
            if gap > SAME_RUN:
                how = f"in a run of {marks[i]} steps from the first of one of {marks[-1]} (seed {seed})"
                return Difference(OF_RUN, gap, SAME_RUN, how)
    return None


def _reported(
    method: Integrator, scene: Scene, chart: str, trajectory: Trajectory, long: tuple[Run, Plan]
) -> Difference | None:
    run, plan = long
    if chart == "angles":
        found = from_increments(method, scene, plan) if method.fixed_step else None
        if found is not None and found.size > found.floor:  # places that beat with the nutation drift at one length
            fewer = Plan.steps(plan.step_size, [0, round(OTHER * int(plan.marks[-1]))])
            found = min(found, from_increments(method, scene, fewer) or found, key=lambda one: one.size)
        return found
    gaps = {name: np.abs(getattr(run, name) - getattr(trajectory, name)) for name in ("p_phi", "p_psi")}
    size, name = max((float(np.max(gap[np.isfinite(gap)], initial=0.0)), name) for name, gap in gaps.items())
    return Difference(name, size / scene.momentum_scale, REPORTED, f"of the larger momentum in {run.steps} steps")


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
    rest = square - kick * kick * (1.0 - u) * (1.0 + u) / 8.0
    good = np.isfinite(rest) & np.isfinite(u)
    if good.sum() < 8 or np.ptp(u[good]) == 0.0:
        return np.full(u.size, math.nan)
    du, dr = u[good] - u[good].mean(), rest[good] - rest[good].mean()
    c = -float(du @ dr) / float(du @ du)
    whole = rest + c * u
    return np.asarray((whole - whole[0]) / float(np.max(np.abs(rest[good]))))


def change_of(
    time: Array, values: Array, every_step: Array, steps: int, grain: float = 1.0, *, plain: bool = False,
    even: bool = True,
) -> Constant:  # fmt: skip
    """Size, growth and trend of a residual over so many steps; `every_step` holds it at consecutive ones.

    Of `plain` sums half of what rounding makes in one step may be a bias, and add up, but no more than a unit of
    rounding a step. A motion that is not `even` may begin calmly and turn over later, and so may its residuals.
    """
    with np.errstate(invalid="ignore"):  # of a run that blows up
        jumps = np.abs(np.diff(every_step))
    a_step = float(np.max(jumps[np.isfinite(jumps)])) if np.isfinite(jumps).any() else math.nan
    rounding = a_step * math.sqrt(steps) if a_step <= ROUNDING_OF_A_STEP * grain else 0.0
    rounding = max(rounding, min(0.5 * a_step, EPSILON * grain) * steps * plain * (rounding > 0.0))
    floor = max(KEPT * grain, rounding)
    with np.errstate(all="ignore"):  # a run may blow up
        ratio = np.abs(np.diff(values)) / max(a_step * steps / (time.size - 1), floor)
        calm = np.abs(values[1:-1]) < LITTLE
        jump = np.flatnonzero((ratio[1:] > SUDDEN) & (np.fmax.accumulate(ratio)[:-1] < SUDDEN / 10.0) & calm)
    words = "after t = {:.4g} it changes {:.0e} times as much as by its first steps"
    sudden = words.format(time[jump[0] + 1], ratio[jump[0] + 1]) if even and jump.size else ""
    return Constant(constant_of(time, values), a_step, floor, grain, sudden)


def measure(subject: Subject) -> list[Finding]:
    """Everything that one long run in each chart shows; the worst chart decides, and the finding names it."""
    method, scene, runs, by_chart = subject.method, subject.scene, [], []
    charts = (chart_of(method, BODY),) if scene.of_body else (PLANE,) if subject.in_plane else method.charts()
    options: dict[str, Any] = {"quick": subject.quick, "most": subject.long_steps, "seed": subject.seed}
    for chart in charts:
        try:
            runs.append(long_run(method, scene, chart, **options))
            findings = of_run(method, runs[-1])
        except SymtopError as error:
            findings = [undecided(claim, declared(method, claim), str(error)) for claim in (*OF_A_RUN, "momentum")]
        for k, one in enumerate(findings):  # the chart, where the reason does not speak of it already
            if one.verdict != "inapplicable" and not one.why.endswith(" chart"):
                findings[k] = one._replace(why=f"{one.why}, in the {chart} chart")
        by_chart.append(findings)
    if runs:
        run = min(runs, key=lambda run: run.steps)
        length = {"steps_run": np.array(run.steps), "nutations_run": np.array(run.nutations)}
        subject.traces.update(length, long_nutations=run.energy[0], energy_change=run.energy[1])
    return [max(findings, key=_badness) for findings in zip(*by_chart, strict=True)]


def of_run(method: Integrator, run: LongRun) -> list[Finding]:
    """What one long run shows of each claim of `OF_A_RUN`."""
    motion = [_constant(method, one, declared(method, one), run, run.constants.get(one)) for one in OF_MOTION]
    return [*motion, _of_states(run), _invariant(method, run), *_costs(method, run)]


def _badness(one: Finding) -> tuple[int, int, float]:
    """The rank of a finding among the charts: by its verdict, then by the kind of growth, then by its number."""
    growth = KINDS.index(one.measured.kind) if one.measured.kind in KINDS else -1
    return BADNESS.index(one.verdict), growth, one.value if math.isfinite(one.value) else -1.0


def _constant(method: Integrator, claim: str, claimed: str, run: LongRun, constant: Constant | None) -> Finding:
    if constant is None:
        return inapplicable(claim, f"the {run.chart} chart has no such constant", claimed)
    kind, changed, ended = constant.kind, constant.changed, run.outcome != "ok"
    why = constant.words(f"in {run.span}, {constant.a_step:.0e} in one step at most")
    why += f", drifting by {changed.rise / max(run.steps, 1):.1e} a step" if kind == "drift" else ""
    finding = constant.finding(claim, claimed, why)
    finding = finding if run.steps and not (ended and run.nutations < 1.0) else finding._replace(measured=NOTHING)
    # an error that returns with the nutation cannot exceed the largest change of a step, all one way
    most = constant.a_step * run.steps / run.nutations if run.nutations > 1.0 else math.inf
    if claim == "energy" and run.blown_up > 0.0:
        steps = f", after {run.steps} steps, {run.steps / run.nutations:.0f} a {run.period}"
        return blow_up_finding(finding, run.blown_up, run.chart == BODY, steps)
    if run.outcome not in ("ok", "not_finite", "not_normalised") or (ended and kind in ("kept", "bounded")):
        return finding._replace(verdict="undecided", why=f"{why}; but the run {run.message}")
    if method.fixed_step and constant.sudden:
        return finding._replace(verdict="refuted", declared=claimed or FROM, why=f"{constant.sudden}; {why}")
    if kind == "unknown" and ended:
        return finding._replace(why=f"the run {run.message}")
    returns = ("kept", "unknown", *["bounded"] * (run.chart == BODY))  # that of a body with slower parts, later
    if claimed == "bounded" and kind not in returns and changed.largest > max(most, constant.floor):
        why += f", more than the steps of a {run.period} can add up to: it does not come back"
        return finding._replace(verdict="refuted", why=why)
    return finding


def _of_states(run: LongRun) -> Finding:
    """Are the momenta that the run reports those that its states have, and is it a part of longer ones?"""
    other = run.reported
    if other is None:
        return inapplicable("reported", f"the {run.chart} chart shows no momenta beside the reported")
    declared, verdict, differs = OWN, "refuted", f"differs by {other.size:.1e} {other.how}"
    if other.size <= other.floor:
        declared, verdict, kind = "", "measured", OWN
        why = f"the momenta that it reports differ from those of its states by {other.size:.1e} at most"
    elif other.name == OF_RUN:
        kind, why = "another run", f"a run contradicts itself, as if the method knew of it: the state {differs}"
    else:
        kind, why = "others", f"it reports other momenta than its states have: {other.name} {differs}"
    return Finding("reported", declared, Measured(kind), verdict, why, other.size, other.floor)


def _invariant(method: Integrator, run: LongRun) -> Finding:
    """What a method claims to conserve that is not a constant of the true motion."""
    claimed = declared(method, "invariant")
    if not claimed:
        return inapplicable("invariant", "it claims no invariant of its own")
    names = claimed.split(", ")
    unknown = ", ".join(name for name in names if name not in run.constants)
    if unknown:
        return undecided("invariant", claimed, f"the battery has no formula for {unknown}")
    worst = max(names, key=lambda name: run.constants[name].changed.largest)
    return _constant(method, "invariant", "kept", run, run.constants[worst])._replace(declared=claimed)


def _costs(method: Integrator, run: LongRun) -> list[Finding]:
    claimed, iterates = declared(method, "explicit"), run.iterations > 0.0
    if method.control is None or not run.evaluations:
        why = "it makes no steps" if method.control is None else "its forces are not counted"
        return [inapplicable("explicit", why, claimed), inapplicable("work", why)]
    text = f"{run.evaluations:.1f}" + f" ({run.iterations:.1f} it.)" * iterates
    solves = f" and {run.iterations:.2f} iterations" * iterates
    why = f"{run.evaluations:.2f} force evaluations{solves} a step, in {run.span}"
    work = Finding("work", "", Measured("work", run.evaluations, text=text), "measured", why, run.evaluations, 0.0)
    if not (iterates or run.steady_cost):
        why = "it reports no iterations, but its steps do not all cost the same"
        return [undecided("explicit", claimed, why), work]
    answer = False if iterates else None if method.explicit is False else True
    why = f"it reports no iterations and {run.evaluations:.2f} forces a step, always"
    why += "; so does a method that solves linear equations" * (answer is None)
    why = f"it reports {run.iterations:.2f} iterations a step" if iterates else why
    finding = agreement("explicit", method.explicit, answer, why, run.iterations, 0.0)
    return [finding._replace(measured=Measured(yes_no(answer))), work]
