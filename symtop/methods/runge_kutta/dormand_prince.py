"""Dormand-Prince 5(4) with SciPy's step control, the whole loop compiled.

    k_1 = f(y) (the last stage of the step before: first same as last),   k_i = f(y + h sum_{j<i} a_ij k_j),  i = 2 .. 6
    y+ = y + h sum_i b_i k_i  (order 5),    k_7 = f(y+),    err = h sum_i e_i k_i  (order 5 minus order 4)
    |err| = rms(err_m / (atol + rtol max(|y_m|, |y+_m|)))  must be below 1
    h <- h min(10, .9 |err|^(-1/5)) after a step (min(1, ..) after a rejection),  h max(.2, .9 |err|^(-1/5)) rejected
    y(t + x h) = y + h sum_i k_i (p_i1 x + p_i2 x^2 + p_i3 x^3 + p_i4 x^4)     samples between steps, order 4

The loop serves any pair with SciPy's control (`pairs`): a `Method` says how a step is tried and how samples are taken.

`rk45-compiled` is the same method as `rk45` on the same equations (see `formulations`): it accepts and rejects the same
steps in each chart, so that their times differ only by what Python costs and their errors not at all. It exists to keep
the language out of a comparison of methods. Order 5, explicit, six evaluations a step; nothing is conserved.
Source: Dormand and Prince, J. Comput. Appl. Math. 6 (1980) 19; the interpolant: Shampine, Math. Comp. 46 (1986) 135;
the initial step: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.4.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from symtop.core.jit import compile_kernel, register_jitable, set_item
from symtop.methods.framework.adaptive import Adaptive, Loop
from symtop.methods.framework.angles import LEAST_TOLERANCE
from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.plan import OK, STEP_TOO_SMALL
from symtop.methods.framework.preparation import Body, Start, as_it_steps
from symtop.methods.framework.registry import Integrator
from symtop.methods.runge_kutta.explicit import add, later_stages, plus, store, weighted

BLOCK = 5_000_000  # evaluations between returns to Python, so that an interrupt is heard within a second
EVALUATIONS = 1_000_000_000  # a run's limit: about half a minute

SAFETY, SHRINK, GROW = 0.9, 0.2, 10.0


class Method(NamedTuple):
    """A pair in one chart, in functions that compile; `slopes` (rows, size) begins with f(y) and ends with f(y+)."""

    attempt: Callable[..., Any]  # (par, state, slopes, h, tolerance) -> new state and |err|; fills `slopes`
    refine: Callable[..., int]  # (par, state, slopes, h) -> evaluations: what samples of a step need beyond that
    sample: Callable[..., Any]  # (par, state, new, slopes, h, x) -> the state at a fraction x of the step
    rows: int
    evaluations: int  # of an attempt
    power: float  # of |err| in the step control: -1/(order of the estimate + 1)


class Embedded(NamedTuple):
    """An embedded pair: the tableau, the weights of its error estimate and those of its interpolant."""

    a: tuple[float, ...]  # strict lower triangle without the last row, which is b
    b: tuple[float, ...]
    error: tuple[float, ...]
    dense: tuple[tuple[float, ...], ...]  # one polynomial in x = (t - t_old)/h for each stage, without constant

    def method(self, field: Callable[..., Any]) -> Method:
        """The pair on the equations y' = field(par, y)."""
        a, b, error, dense = self

        @register_jitable
        def attempt(par, state, slopes, h, tolerance):  # type: ignore[no-untyped-def]
            later_stages(field, par, a, len(b), state, slopes, h)
            new = plus(state, weighted(b, state, slopes, h))
            store(slopes, len(b), field(par, new))
            return new, rms(weighted(error, state, slopes, h), state, new, tolerance)

        @register_jitable
        def sample(par, state, new, slopes, h, x):  # type: ignore[no-untyped-def]
            return interpolate(dense, state, slopes, h, x)

        return Method(attempt, nothing_more, sample, len(error), len(b), -0.2)


DORMAND_PRINCE = Embedded(
    a=(
        *(1 / 5,),
        *(3 / 40, 9 / 40),
        *(44 / 45, -56 / 15, 32 / 9),
        *(19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        *(9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    ),
    b=(35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
    error=(-71 / 57600, 0.0, 71 / 16695, -71 / 1920, 17253 / 339200, -22 / 525, 1 / 40),
    dense=(
        (1.0, -8048581381 / 2820520608, 8663915743 / 2820520608, -12715105075 / 11282082432),
        (0.0, 0.0, 0.0, 0.0),
        (0.0, 131558114200 / 32700410799, -68118460800 / 10900136933, 87487479700 / 32700410799),
        (0.0, -1754552775 / 470086768, 14199869525 / 1410260304, -10690763975 / 1880347072),
        (0.0, 127303824393 / 49829197408, -318862633887 / 49829197408, 701980252875 / 199316789632),
        (0.0, -282668133 / 205662961, 2019193451 / 616988883, -1453857185 / 822651844),
        (0.0, 40617522 / 29380423, -110615467 / 29380423, 69997945 / 29380423),
    ),
)


@register_jitable
def rms(vector: Any, state: Any, other: Any, tolerance: float) -> float:
    """Root mean square of a vector in units of what is allowed, tolerance (1 + |y|)."""
    total = 0.0
    for m in range(len(vector)):
        part = vector[m] / (tolerance + max(abs(state[m]), abs(other[m])) * tolerance)
        total += part * part
    return math.sqrt(total / len(vector))


@register_jitable
def interpolate(dense: Any, state: Any, slopes: Any, h: float, x: float) -> Any:
    """The state at a fraction x of the step."""
    weights = dense[0] + dense[1][:3]  # a tuple of seven
    for i in range(len(dense)):
        row = dense[i]
        weights = set_item(weights, i, x * (row[0] + x * (row[1] + x * (row[2] + x * row[3]))))
    return plus(state, weighted(weights, state, slopes, h))


@register_jitable
def nothing_more(par: Any, state: Any, slopes: Any, h: float) -> int:
    """Samples need no further evaluations."""
    return 0


@register_jitable
def _try_steps(
    attempt: Any, cost: int, power: float, par: Any, state: Any, slopes: Any, tolerance: float, t: float, step: float,
    end: float,
) -> Any:  # fmt: skip
    """Shrink the step until its error passes: new state, new time, next step, evaluations, outcome."""
    least = 10.0 * (np.nextafter(t, np.inf) - t)
    step = max(step, least)
    grow = GROW
    evaluations = 0
    while step >= least:
        after = min(t + step, end)
        h = after - t
        new, error = attempt(par, state, slopes, h, tolerance)
        evaluations += cost
        change = GROW if error == 0.0 else SAFETY * error**power
        if error < 1.0:
            return new, after, h * min(grow, change), evaluations, OK
        step = h * (change if change > SHRINK else SHRINK)  # noqa: FURB136  (max would pass NaN on)
        grow = 1.0
    return state, t, step, evaluations, STEP_TOO_SMALL


@register_jitable
def first_step(field: Any, par: Any, state: Any, slope: Any, end: float, tolerance: float, power: float) -> float:
    """SciPy's initial step: 1 % of |y|/|f|, then from the size of the second derivative, by one evaluation of f."""
    d0, d1 = rms(state, state, state, tolerance), rms(slope, state, state, tolerance)
    trial = min(1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1, end)
    bent = field(par, add(state, slope, trial))
    for m in range(len(state)):
        bent = set_item(bent, m, bent[m] - slope[m])
    d2 = rms(bent, state, state, tolerance) / trial
    guess = max(1e-6, 1e-3 * trial) if max(d1, d2) <= 1e-15 else (0.01 / max(d1, d2)) ** -power
    return min(100.0 * trial, guess, end)


@functools.cache
def loop(chart: str, pair: Any = DORMAND_PRINCE) -> Loop:  # noqa: C901
    """The loop in one chart as `adaptive` takes it, compiled when it is first used; it counts force evaluations.

    The place is (state, its slope, time, step).
    """
    form: Any = FORMULATIONS[chart]  # whose parts compile
    field, ended, observe, prepare, size = form.field, form.ended, form.observe, form.prepare.numbers, form.prepare.size
    sample = as_it_steps if form.present is None else form.present.sample
    register_jitable(observe)
    method: Method = pair.method(field)
    attempt, refine, between, stages, cost, power = method
    clock, last = 2 * size, method.evaluations

    def march(  # type: ignore[no-untyped-def]  # noqa: C901
        numbers, tolerance, times, budget, seen, place, states, momenta
    ):
        par, state = prepare(Body(*numbers[:3]), Start(*numbers[3:]))
        slopes, nothing, end = np.empty((stages, size)), state, times[-1]
        for m in range(size):
            nothing = set_item(nothing, m, 0.0)
        steps = effort = outcome = 0
        if seen < 0:
            slope = field(par, state)
            store(slopes, 0, slope)
            seen, t, step, effort = 0, 0.0, first_step(field, par, state, slope, end, tolerance, power), 2
        else:
            t, step = place[clock], place[clock + 1]
            for m in range(size):
                state, slopes[0, m] = set_item(state, m, place[m]), place[size + m]
        while t < end and effort < budget:
            before, start = state, t
            state, t, step, work, outcome = _try_steps(
                attempt, cost, power, par, before, slopes, tolerance, start, step, end
            )
            effort += work
            if outcome != OK:
                break
            steps += 1
            h = t - start
            if seen < len(times) and times[seen] <= t:
                effort += refine(par, before, slopes, h)
            while seen < len(times) and times[seen] <= t:
                place_then = between(par, before, state, slopes, h, (times[seen] - start) / h)
                store(states, seen, sample(par, times[seen], place_then))
                momenta[seen, 0], momenta[seen, 1] = observe(par, 0.0, place_then, nothing, 0.0)
                seen += 1
            outcome = ended(state)
            for m in range(size):
                slopes[0, m] = slopes[last, m]
            if outcome != OK:
                break
        for m in range(size):
            place[m], place[size + m] = state[m], slopes[0, m]
        place[clock], place[clock + 1] = t, step
        return seen, steps, effort, outcome

    compiled: Loop = compile_kernel(march)
    return compiled


def solver(chart: str, pair: Any = DORMAND_PRINCE) -> Adaptive:
    """A solver of the registry in one chart."""
    form: Any = FORMULATIONS[chart]
    size, shown = form.prepare.size, form.prepare.size if form.present is None else form.present.size
    return Adaptive(
        lambda _: loop(chart, pair), shown, 2 * size + 2, 2 * size, EVALUATIONS, BLOCK, check=form.prepare.check
    )


def built_in() -> list[Integrator]:
    """Dormand and Prince's pair."""
    return [
        Integrator(
            name="rk45-compiled",
            family="runge-kutta",
            summary="Dormand-Prince with SciPy's step control, compiled",
            solvers={chart: solver(chart) for chart in FORMULATIONS},
            control="tolerance",
            order=5,
            explicit=True,
            symplectic=False,
            symmetric=False,
            conserves=frozenset(),
            least_tolerance=LEAST_TOLERANCE,
            reference="dormand-prince-1980",
            needs="derivative",
            general=True,
        )
    ]
