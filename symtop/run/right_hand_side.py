"""The guard for a user's equations y' = f(t, y): forecasts the error of a method and its cause before a long run.

The method makes a piece of the run, which is compared with DOP853 at a tight tolerance, since only f is known. Its
error is extrapolated by the law of `symtop.run.guard`, linear to quadratic, or by the amplification A(t) of a small
change (`symtop.run.motion`), whichever is more; A is computed as far as `MOST_FINE_STEPS` steps of DOP853 lead. An
error that fades within the piece, as in a transient, is not extrapolated. The error of a run that departs from the
motion grows on as in the second half of the piece. Any other forecast is at most twice the extent of the motion, if all
of the motion is known or it goes back and forth. A run with an error above the extent has lost the motion and may go
anywhere: the sentence says that no size is known. Causes:

    stiffness      f has rates far above that of the motion, and they limit an explicit step
    instability    steps multiply a small change more than the motion does, or the motion itself is unstable
    rounding       the error of the piece is below that of DOP853
    step           errors of the step or of the tolerance add up

Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, sections II.4 and II.10; II, section IV.2.
"""

import math
from collections.abc import Callable, Sequence
from decimal import ROUND_DOWN, Context
from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError, finite, foreign_code, one_of, positive, row
from symtop.core.numbers import EPSILON, TINY, real_numbers
from symtop.methods.framework.plan import Array
from symtop.methods.framework.registry import integrator, integrators
from symtop.methods.runge_kutta.explicit import Tableau
from symtop.run.guard import Probe, grown
from symtop.run.motion import MOST_FOLDS, Growth

SCIPY = {"rk45": ("RK45", 6), "dop853": ("DOP853", 12), "radau": ("Radau", 0), "bdf": ("BDF", 0), "lsoda": ("LSODA", 0)}
FINE_TOLERANCE, MOST_FINE_STEPS, MOST_PROBE_STEPS = 1e-13, 4000, 5000  # of DOP853; of it, and of the method on a piece
PIECE_PERIODS, PIECE_TURNS, PIECE_SHARE, POINTS = 10.0, 4.0, 0.2, 400  # least length of a piece; compared times
TIGHTEST, LOOSEST = 2.3e-14, 0.1  # tolerances: the least of SciPy's solvers, the largest that is proposed
DISTANCES, MOST_DISTANCE = (1e-7, 1e-10), 1e-2  # of two motions, at first and at most, over their extent
UNSTABLE_GROWTH, STIFF_RATIO = 10.0, 20.0  # of A in the second half of a run; of rates of a stiff f
OWN = 10.0  # the steps of a piece multiply a change by this much more than the motion; less is a transient
SHORT_FLOATS = ("float32", "float16", "bfloat16")
COMPARED_FROM, FADED_SHARE = 1e-7, 0.1  # where comparison of a piece begins; part of the largest error that has faded


class Outlook(NamedTuple):
    """The forecast of a run; as a string, one sentence."""

    error: float  # the largest distance from the truth up to the horizon, in units of y; no size above the extent
    setting: float  # a step or tolerance that should keep the accuracy; nan if none does
    cause: str  # of an error beyond the accuracy, see above; "" if there is none
    amplification: float  # of a small change of y0, at the horizon
    sentence: str

    def __str__(self) -> str:
        return self.sentence


def guard(
    f: Callable[[float, Array], Any], t0: float, y0: Sequence[float], horizon: float, method: str = "rk4", *,
    step_size: float | None = None, tolerance: float | None = None, accuracy: float = 1e-3,
) -> Outlook:  # fmt: skip
    """Forecast the error of a run of y' = f(t, y) from y0 (n,) at t0 over the time `horizon`.

    `method` is an explicit Runge-Kutta method of symtop with a `step_size`, or rk45, dop853, radau, bdf or lsoda of
    SciPy with a `tolerance`, relative and absolute. `accuracy` is the error that the run may have, in units of y.
    Raises SymtopError for invalid arguments, for an f that fails and for a motion that diverges before the horizon.
    """
    rules = {name: getattr(next(iter(method.solvers.values())), "rule", None) for name, method in integrators().items()}
    tables = {name: rule for name, rule in rules.items() if isinstance(rule, Tableau)}
    rule = tables.get(one_of("method", method, [*SCIPY, *tables]))
    required, excluded = names = ("tolerance", "step_size") if rule is None else ("step_size", "tolerance")
    argument, extra = (tolerance, step_size) if rule is None else (step_size, tolerance)
    if argument is None or extra is not None:
        raise SymtopError(f"{method} needs {required}, and no {excluded}", *names)
    start, setting = np.array(row("y0", y0)), positive(required, argument)
    begin, end, accuracy = finite("t0", t0), positive("horizon", horizon), positive("accuracy", accuracy)
    if start.size == 0:
        raise SymtopError("y0 must be at least one number, not none", "y0")
    if begin + end / MOST_PROBE_STEPS == begin:
        raise SymtopError(f"horizon must be longer than what t0 = {begin!r} is rounded by, not {end!r}", "horizon")
    if rule is None and not TIGHTEST <= setting < 1.0:
        raise SymtopError(f"tolerance must be at least {TIGHTEST:g} and below 1, not {setting!r}", "tolerance")
    if rule is not None and setting > end:
        raise SymtopError(f"step_size must be at most the horizon {end!r}, not {setting!r}", "step_size")

    def rate(t: float, y: Array) -> Array:  # t counts from t0: near 1e9 doubles are 1e-7 apart
        slope = f(begin + t, y.copy())  # f may change y or reuse its result
        if str(getattr(slope, "dtype", "")).removeprefix("torch.") in SHORT_FLOATS:
            raise SymtopError(f"f must return doubles, not {slope.dtype}: the run is compared at {FINE_TOLERANCE:g}")
        value = real_numbers("what f returns", slope).copy()
        if value.shape != start.shape:
            raise SymtopError(f"f must return {start.size} numbers, not an array of shape {value.shape}")
        return value

    with foreign_code("f"), np.errstate(all="ignore"):
        return _outlook(rate, begin, start, end, method, rule, setting, accuracy)


def _states(f: Any, rule: Tableau, y: Array, h: float, marks: Any) -> Array:
    """States (marks, n) of an explicit Runge-Kutta method after the numbers of steps `marks`."""
    b = np.array(rule.b)
    a, slopes, states, first = np.zeros((b.size, b.size)), np.zeros((b.size, y.size)), [], 0
    a[np.tril_indices(b.size, -1)] = np.array(rule.a)[: b.size * (b.size - 1) // 2]
    for mark in marks:
        for k in range(first, int(mark)):
            for i in range(b.size):
                slopes[i] = f((k + a[i].sum()) * h, y + h * (a[i, :i] @ slopes[:i]))
            y = y + h * (b @ slopes)
        first = int(mark)
        states.append(y)
    return np.array(states)


def _finite(f: Any, begin: float) -> Any:
    """f, with SymtopError where it is not finite: SciPy's solvers would reduce their steps without end."""

    def rate(t: float, y: Array) -> Array:
        value: Array = f(t, y)
        if not np.isfinite(value).all():
            raise SymtopError(f"f must be finite, not {value.tolist()} at t = {begin + float(t)!r}")
        return value

    return rate


def _motion(f: Any, y: Array, end: float) -> tuple[Any, float]:
    """The solution by DOP853 as a function of time, or None if its first step fails, and the time that it covers."""
    from scipy.integrate import DOP853, OdeSolution  # 0.2 s

    # a start at zero gives no scale for the tolerance; take a negligible part of the expected size of y
    size = float(np.abs(y).max()) or EPSILON * (end * float(np.abs(f(0.0, y)).max()) or 1.0)
    solver = DOP853(f, 0.0, y, end, rtol=FINE_TOLERANCE, atol=FINE_TOLERANCE * size)
    times, interpolants = [0.0], list[Any]()
    while solver.status == "running" and len(interpolants) < MOST_FINE_STEPS and solver.step() is None:
        times.append(solver.t)
        interpolants.append(solver.dense_output())
    return OdeSolution(times, interpolants) if interpolants else None, times[-1]


def _growth(f: Any, near: Any, y: Array, elapsed: Array, extent: float) -> Growth:
    """The amplification A of a small change of the start; with a smaller change if the two motions separate too far."""
    for distance in DISTANCES:
        far, reached = _motion(f, y + distance * extent / math.sqrt(y.size), float(elapsed[-1]))
        times, limit = elapsed[elapsed <= reached * (1.0 + EPSILON)], MOST_DISTANCE / distance
        if times.size == 0:
            return Growth(elapsed[:1], np.array([math.inf]))
        ratio = np.linalg.norm(far(times) - near(times), axis=0) / (distance * extent)
        if ratio.max() < limit:
            break
    return Growth.of(times, ratio, limit)


def _largest_error(times: Array, error: Array, end: float, amplified: float, extent: float) -> float:
    """The largest error of a run to `end`, from that of a piece; `extent` of the motion is inf if it is not known."""
    largest, middle = float(error.max()), int(np.searchsorted(times, 0.5 * times[-1]))
    if largest > 2.0 * extent and 0 < middle < times.size - 1:  # the run departs from the motion
        folds = math.log(max(float(error[-1] / error[middle]), 1.0)) / (times[-1] - times[middle])
        return largest * math.exp(min(folds * (end - times[-1]), MOST_FOLDS))
    second_half = float(error[middle:].max())
    lasting = np.minimum(error, second_half) if second_half < FADED_SHARE * largest else error
    later = max(grown(Probe(times, lasting, "ok", end, 0), end, straight=False), float(lasting.max()) * amplified)
    return max(largest, min(later, 2.0 * extent))


def _outlook(
    f: Any, t: float, y: Array, end: float, method: str, rule: Tableau | None, setting: float, accuracy: float
) -> Outlook:
    from scipy.integrate import solve_ivp

    safe = _finite(f, t)
    near, duration = _motion(safe, y, end)
    if near is None or (near.t_max < end and len(near.interpolants) < MOST_FINE_STEPS):
        words = f"below {duration:.6g}, not {end!r}: the motion goes beyond all bounds there, as far as DOP853 can tell"
        raise SymtopError(f"horizon must be {words}", "horizon")
    elapsed = duration * np.arange(1.0, POINTS + 1.0) / POINTS
    true = near(elapsed)
    path = np.column_stack([y, true])  # with the start, which a transient may leave before the first of these times
    spread, extent = np.std(true, axis=1), float(np.linalg.norm(np.ptp(path, axis=1))) or 1.0
    turns = 0.5 * float(np.linalg.norm(np.diff(path, axis=1), axis=0).sum()) / extent  # oscillations, from path length
    rates = np.std([f(time, state) for time, state in zip(elapsed, true.T, strict=True)], axis=0)
    frequency = float(np.linalg.norm(rates)) / max(float(np.linalg.norm(spread)), TINY)
    complete = duration >= end or turns >= 1.0  # the extent of the motion is known
    slow = min(frequency, 2.0 * math.pi * turns / duration)
    y_far, kind = y + DISTANCES[0] * extent / math.sqrt(y.size), "step" if rule else "tolerance"
    growth = _growth(safe, near, y, elapsed, extent)
    turn = 2.0 * math.pi / max(slow, TINY)  # longer than a period at `frequency` where a motion is fast now and then
    period = 2.0 * math.pi / max(frequency, TINY)
    piece = min(end, duration, max(PIECE_SHARE * end, PIECE_PERIODS * period, PIECE_TURNS * turn))
    positions = np.union1d(np.geomspace(COMPARED_FROM, 1.0, POINTS // 4), elapsed / duration)  # compared, in pieces

    def run_piece(start: Array) -> tuple[Array, Array, float]:
        """Times and states of the piece, and the mean step (0 for an implicit method)."""
        if rule:
            marks = np.unique(np.rint(min(int(piece / setting * (1.0 + 1e-9)), MOST_PROBE_STEPS) * positions).clip(1.0))
            return marks * setting, _states(f, rule, start, setting, marks), setting
        (name, cost), t_eval = SCIPY[method], np.unique(np.minimum(piece * positions, piece))
        run = solve_ivp(safe, (0.0, piece), start, name, t_eval, rtol=setting, atol=setting)
        return run.t, run.y.T, piece * cost / run.nfev

    times, states, mean = run_piece(y)
    error = np.linalg.norm(states - near(times).T, axis=1)
    short = setting > duration if rule else times[-1] < 0.99 * piece  # the piece has no step, or SciPy ended early
    fails = bool(short) or not np.isfinite(error).all()
    total, part = growth.at(end), growth.at(float(times[-1]))
    expected = math.inf if fails else _largest_error(times, error, end, total / part, extent if complete else math.inf)
    proposal = setting * (accuracy / max(expected, TINY)) ** (1.0 / ((rule and integrator(method).order) or 1))
    proposal = 0.3 * setting if fails else min(proposal, end if rule else LOOSEST)
    change = math.sqrt(EPSILON) * extent
    rate = f(0.0, y)
    slopes = [(f(0.0, y + change * unit) - rate) / change for unit in np.eye(y.size)]
    modes, cause = np.linalg.eigvals(np.array(slopes)), "step"
    fastest = float(np.abs(modes).max())
    if rule and fastest > STIFF_RATIO * slow:  # limit the step by stability
        proposal = min(proposal, max(setting, 1.0 / fastest))
    proposal = float(Context(prec=2, rounding=ROUND_DOWN).create_decimal(proposal))
    why = f"errors add up over about {end * slow / (2.0 * math.pi):.2g} periods; take a {kind} of about {proposal:.2g}"
    if not expected > accuracy:
        cause, why = "", f"a {kind} of {proposal:.2g} would do for {accuracy:.1g}"
    elif mean * fastest > 1.0 and fastest > max(STIFF_RATIO * slow, 2.0 * float(modes.real.max())):  # none grows
        cause, proposal = "stiffness", math.nan
        why = f"f has rates of {fastest:.1g}, the motion of {slow:.1g}; take an implicit method, such as radau"
    elif fails or np.linalg.norm(run_piece(y_far)[1] - states, axis=1).max() > OWN * part**2 * DISTANCES[0] * extent:
        proposal = min(proposal, 0.3 * setting)
        cause = "instability"
        why = f"it multiplies a small change more than the motion does; try a {kind} of {proposal:.2g}"
    elif total > UNSTABLE_GROWTH * growth.at(0.5 * end):
        lost = total * EPSILON * extent > accuracy
        cause, proposal = "instability", math.nan if lost else proposal
        why = f"the motion multiplies a small change {total:.1g} times; " + (
            "rounding alone decides, shorten the horizon" if lost else f"try a {kind} of {proposal:.2g}"
        )
    elif float(error.max()) < 10.0 * FINE_TOLERANCE * float(np.abs(true).max()):
        cause, proposal, why = "rounding", math.nan, f"rounding adds up, and no {kind} helps"
    words = ", with the motion lost and no size known" if complete and extent < expected < math.inf else ""
    sentence = f"{method}: expect an error of {expected:.1g} by t = {t + end:.4g}{words}: {why}"
    sentence += "" if complete else f"; the motion was watched to t = {t + duration:.4g} alone"
    return Outlook(expected, proposal, cause, total, sentence)
