"""The battery of a step that comes through a socket: stages that one process measures one after the other.

To the claims of every integrator (`claims`) it adds what only a bare step can be asked: what its calls are like and, of
a function of f, its order where f depends on time. How much it may run follows from the seconds that a step takes, so
that a method in Python is judged in a minute and a compiled one in seconds; the findings name the steps that were run.
"""

import time
from typing import Any, NamedTuple

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging import claims, claims_reduced as reduced
from symtop.judging.adapters.adapter import Stepper, integrator
from symtop.judging.adapters.choice import opened
from symtop.judging.adapters.separable import SeparableStep
from symtop.judging.claims_calls import calls
from symtop.judging.claims_long import QUICK_STEPS
from symtop.judging.claims_pole import pole
from symtop.judging.claims_time import time_order
from symtop.judging.findings import Finding, undecided
from symtop.measure.step_map import generic_start
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene

LONG, SLOPES = (16.0, 2.5), (8.0, 1.5)  # seconds of a long run and of the runs of the order; the second with --quick
STEPS = 1_000_000  # most steps of a long run
SAMPLES = 4000  # intervals of a long run: a program that writes every so many steps needs a multiple
FINEST = {"compiled": 2e5, "python": 1e4}  # most steps of a run of the order
FEWEST = 300  # steps of the longest run of the order, however slow
LADDER = 2.5  # times the steps of the longest run: what all of them take
ENOUGH = 0.03  # seconds after which the time of a step is known


class Request(NamedTuple):
    """What is to be judged: as it was given, and the claims that are made for it."""

    target: Any
    form: str | None
    chart: str
    adaptive: bool
    scene: Scene
    quick: bool
    claims: dict[str, Any]


class Opened(NamedTuple):
    """The thing itself, as the process that steps it has it."""

    stepper: Stepper
    method: Integrator
    seconds_a_step: float


STAGES: dict[str, tuple[str, ...]] = {
    "calls": ("calls",),
    "order": ("order",),
    "time": ("time",),
    "structure": ("symplectic", "symmetric"),
    "constants": ("energy", "p_phi", "p_psi", "axis_length", "invariant", "explicit", "work"),
    "pole": ("pole",),
}


def claimed(request: Request) -> Integrator:
    """The claims as a record, checked before anything is loaded; SymtopError if they make no sense, or if it is run."""

    def refuses(*_: Any) -> Any:
        raise SymtopError("these are claims alone, without a step to run")

    return Integrator("claims", "other", "", {request.chart: refuses}, **request.claims)


def declared(request: Request, claim: str) -> str:
    """What is claimed, without opening anything."""
    blank = claimed(request)
    if claim == "time":
        return claims.declared(blank, "order") if blank.order is not None else ""
    return claims.declared(blank, claim)


def open_request(request: Request) -> Opened:
    """Load what is given and time a step of it; SymtopError if it cannot be loaded or makes no step."""
    stepper = opened(request.target, request.form, request.chart, adaptive=request.adaptive)
    method = integrator(stepper, **request.claims)
    return Opened(stepper, method, _pace(stepper, request.scene) if method.fixed_step else 0.0)


def _pace(stepper: Stepper, scene: Scene) -> float:
    """Seconds a step, from runs of more and more steps; what a run costs at its start is left out."""
    par, state = stepper.form.prepare(scene.top, generic_start(scene))
    h, start = scene.time_scale() / 1000.0, np.array(state)

    def seconds(steps: int) -> float:
        began = time.perf_counter()
        stepper.march(scene.top, par, start.copy(), h, np.array([steps]))
        return time.perf_counter() - began

    first, steps = seconds(1), 1
    first = min(first, seconds(1))
    while True:
        steps *= 4
        taken = seconds(steps)
        if taken - first > max(ENOUGH, first) or steps > 1e7:  # what a start costs scatters as much as it costs
            return max(taken - first, 1e-9) / steps


def budget(thing: Opened, *, quick: bool) -> claims.Budget:
    """How many steps the runs may have."""
    if not thing.method.fixed_step:
        return claims.Budget(quick)
    long = min(LONG[quick] / thing.seconds_a_step, STEPS)
    finest = min(SLOPES[quick] / thing.seconds_a_step / LADDER, FINEST[thing.stepper.implementation])
    whole = SAMPLES * round(long / SAMPLES) if long > SAMPLES else long
    return claims.Budget(quick, whole, max(finest, FEWEST))


def measure(stage: str, thing: Opened, request: Request, traces: claims.Traces) -> list[Finding]:
    """The findings of one stage; undecided, and why, if its measurement breaks. A step that makes no call raises."""
    try:
        return _measured(stage, thing, request, traces)
    except SymtopError as error:
        if stage == "calls":
            raise
        return [undecided(claim, declared(request, claim), str(error)) for claim in STAGES[stage]]


def _measured(stage: str, thing: Opened, request: Request, traces: claims.Traces) -> list[Finding]:
    method, scene = thing.method, request.scene
    if stage == "calls":
        if not method.fixed_step:
            return [Finding("calls", "", "", "inapplicable", "it has no step of a given length")]
        return [calls(thing.stepper, scene)]
    if isinstance(thing.stepper, SeparableStep):
        most = budget(thing, quick=request.quick)
        long = min(most.long_steps or STEPS, QUICK_STEPS if request.quick else STEPS)
        return reduced.measure(stage, method, thing.stepper, scene, (most.finest or FEWEST, long), traces)
    if stage == "time":
        step: Any = thing.stepper
        if not method.fixed_step or not hasattr(step, "along"):
            return [Finding("time", "", "", "inapplicable", "it takes no right-hand side")]
        return [time_order(step, scene, method.order)]
    if stage == "pole":  # nobody claims it: a step may be judged on the axis because that is simplest
        return [pole(method)._replace(declared="", verdict="measured")]
    rows = claims.stages(method, scene, budget(thing, quick=request.quick), traces)
    chosen = next(row for row in rows if set(STAGES[stage]) <= set(row.claims))
    return [one for one in claims.measured(method, chosen) if one.claim in STAGES[stage]]
