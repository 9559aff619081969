"""The subject of a judgement: a registered integrator or a bare step, with the scene, its claims and limits of runs.

The length of runs follows from the time of one step, so that a bare step in Python is judged in a minute and a compiled
one in seconds; the findings name the numbers of steps. For a registered integrator its implementation decides.
"""

import functools
import inspect
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from symtop.core.errors import SymtopError, foreign_code, one_of
from symtop.core.numbers import EPSILON
from symtop.judging import FORMS
from symtop.judging.adapters.adapter import Stepper
from symtop.judging.adapters.external import BatchStep, DiffraxSolver, Program, Server, SharedObject, is_solver, x64
from symtop.judging.adapters.python_step import REDUCED, PythonStep, RotationStep, ScipySolver, SeparableStep
from symtop.judging.findings import yes_no
from symtop.measure.conservation import CONSTANTS as MOTION
from symtop.measure.step_map import drawn, generic_start
from symtop.methods.framework.registry import ENGINE, Integrator, methods
from symtop.model.charts import BODY, CHARTS
from symtop.model.scenes import Scene
from symtop.run.plugins import execute, python_file

ON_BODY = ("ode", "rotation", "scipy")  # the forms of a step that are judged on a body without symmetry
ARGUMENTS = {"ode": "(f, t, y, h)", "separable": "(state, h, dT, dV)", "rotation": "(q, w, h, inertia, torque)"}
OWN_CHART = {"separable": "", "rotation": "attitude"}  # the only chart of a form
LIBRARIES = (".so", ".dylib", ".dll")
CONSTANTS = (*MOTION, "axis_length")
MOMENTUM_FAMILIES = ("splitting", "discrete-lagrangian", "lie-group")  # families that keep the momentum of a body
PLANE = "nutation"  # the chart of a map of (theta, p_theta)
LONG_SECONDS, SLOPE_SECONDS = (10.0, 2.5), (6.0, 1.5)  # of a long run, and of runs for the order; the second if `quick`
STEPS = 1_000_000  # most steps of a long run
SAMPLES = 4000  # intervals of a long run; its steps are a multiple, for a program writes every `stride` steps
FINEST_RUN = {"compiled": 2e5, "python": 1e4}  # most steps of a run for the order
FEWEST_STEPS = 300  # steps of the longest run for the order, however slow a step is
MOST_SINGLE = 1000  # most steps of it in single precision, whose rounding hides smaller errors
LADDER_RATIO = 2.5  # ratio of the steps of all runs for the order to those of the longest
ENOUGH_STEPS, REST_MISS = 50.0, 1e-9  # steps per nutation with a constant right-hand side; the largest relative miss
PUSH_SIZE, ROUNDING_EPSILONS = 0.01, 4.0  # its largest change of L, relative; rounding of a step, single or double
LEAST_MOVE = 1e-6  # relative: a number that a step changes by less does not show in what precision
QUICK_SHARE = 0.25  # of the most steps and evaluations of a registered method, if `quick`; no verdict changes
STEPS_A_NUTATION = 118.02  # of a long run, and of timed steps, because the cost of an implicit step depends on its size
TIMED_SECONDS, LEAST_SECONDS = 0.03, 1e-9  # a run so long suffices to time a step; least time assumed of a step


def constant(slope: Any, _t: float, _y: Any) -> Any:
    """The right-hand side of y' = slope."""
    return slope.copy()


@dataclass(frozen=True)
class Subject:
    """An integrator with its claims; measurements add data for figures to `traces`."""

    method: Integrator
    scene: Scene
    quick: bool = False
    stepper: Any = None  # the `Stepper` of a bare step
    seconds_a_step: float = 0.0
    seed: int = 0  # of the random starts, times and steps
    autonomous: bool = False  # was the step written for y' = f(y)?
    traces: dict[str, Any] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """The kind of subject: "body" if the scene is one; else "step" for a bare step, or "integrator"."""
        return "body" if self.scene.of_body else "step" if self.stepper else "integrator"

    @property
    def in_plane(self) -> bool:
        """Is it a map of (theta, p_theta)?"""
        return self.stepper is not None and self.stepper.form is REDUCED

    @functools.cached_property
    def knows_top(self) -> bool:
        """Does the step move a state otherwise than a constant f says? Then it uses equations of the top besides f.

        f is zero, or along the torque alone, which keeps p_phi and p_psi and is no motion of the top: a step that puts
        the energy back to that of its start, by a formula of its own, undoes the latter.
        """
        if self.stepper is None or not self.stepper.takes_field or self.method.adaptive:
            return False
        h = self.scene.time_scale() / ENOUGH_STEPS
        y, _ = self.stepper.from_start(self.scene.top, generic_start(self.scene), h)
        par, _ = self.stepper.form.prepare(self.scene.top, generic_start(self.scene))
        push, size = np.zeros(y.size), float(np.max(np.abs(y)))
        push[-3:] = self.stepper.form.field(par, y.tolist())[-3:]
        push *= PUSH_SIZE * size / h / max(float(np.max(np.abs(push))), LEAST_SECONDS)
        try:
            for slope in (0.0 * push, push):
                end = self.stepper.along(functools.partial(constant, slope), h, y.copy(), h, np.array([1]))[0]
                if not np.max(np.abs(end - y - h * slope)) <= max(REST_MISS, self.rounding(ROUNDING_EPSILONS)) * size:
                    return True
        except SymtopError:  # it divides by f
            return True
        return False

    def elsewhere(self, draws: tuple[int, int], seconds: tuple[float, float]) -> Iterator[tuple[str, Scene]]:
        """Random starts as (description, scene), up to a number and seconds (usual, quick); every other one is late."""
        began, rng, stepper = time.monotonic(), np.random.default_rng(self.seed), self.stepper or Stepper()
        scenes = drawn(self.scene, draws[self.quick], self.seed, same_top=self.knows_top)
        try:
            for k, scene in enumerate(scenes, start=1):
                if time.monotonic() - began > seconds[self.quick]:  # a program that takes long to start
                    return
                stepper.since = 0.0 if k % 2 else scene.time_scale() * 10.0 ** rng.uniform(0.0, 3.0)
                rates, (I1, I3, mgl) = scene.start, (scene.top.I1, scene.top.I3, scene.top.mgl)
                facts = f"theta {rates.theta:.3g}, rates {rates.theta_dot:.3g} {rates.phi_dot:.3g} {rates.psi_dot:.3g}"
                facts += f", I1 {I1:.3g}, I3 {I3:.3g}, mgl {mgl:.3g}" + f", t {stepper.since:.3g}" * (k % 2 == 0)
                yield f"start {k} of seed {self.seed} ({facts})", scene
        finally:
            stepper.since = 0.0

    @property
    def charts(self) -> tuple[str, ...]:
        """The charts in which one step is measured; the last only if `quick`."""
        return (PLANE,) if self.in_plane else self.method.charts()[-1 if self.quick else 0 :]

    @property
    def long_steps(self) -> float | None:
        """The most steps of a long run; None for the default of the implementation."""
        if not self.seconds_a_step:
            return None
        steps = min(LONG_SECONDS[self.quick] / self.seconds_a_step, STEPS)
        return SAMPLES * round(steps / SAMPLES) if steps > SAMPLES else steps

    @property
    def finest(self) -> float | None:
        """The most steps of a run for the order; None for the default of the implementation."""
        if not self.seconds_a_step:
            return None
        finest = FINEST_RUN[self.method.implementation]
        steps = min(SLOPE_SECONDS[self.quick] / self.seconds_a_step / LADDER_RATIO, finest)
        return max(min(steps, MOST_SINGLE) if self.single else steps, FEWEST_STEPS)

    def declared(self, claim: str) -> str:
        """The value that is declared for a claim; the chart of a bare step declares nothing about the pole."""
        return "" if claim == "pole" and self.stepper else declared(self.method, claim)

    @functools.cached_property
    def single(self) -> bool:
        """Does a bare step compute in single precision: its states, or what it adds to a state, or its slope alone?"""
        if self.stepper is None or not self.method.fixed_step:
            return False
        scene, h = self.scene, self.scene.time_scale() / STEPS_A_NUTATION
        state, run = self.stepper.from_start(scene.top, generic_start(scene), h)
        end = run(state, 1)[0]
        moves, size = end - state, np.abs(end)
        moves, size = (values[np.abs(moves) > LEAST_MOVE * size] for values in (moves, size))
        with np.errstate(over="ignore"):  # a step may blow up beyond the range of float32
            if (end == end.astype(np.float32)).all():
                return not (state == state.astype(np.float32)).all()
            gaps = [np.abs(sums - sums.astype(np.float32)) * unit for sums, unit in ((moves, 1.0), (moves / h, h))]
        return moves.size > 2 and bool((gaps <= ROUNDING_EPSILONS * EPSILON * size).all(axis=1).any())

    def rounding(self, steps: float) -> float:
        """The relative rounding error of `steps` steps in single precision, one epsilon each; 0 in double precision."""
        return steps * float(np.finfo(np.float32).eps) * self.single


def hidden_by_single(size: float, why: str) -> str:
    """The reason of an undecided claim, with the size of errors that single precision hides."""
    return f"single precision hides errors below about {size:.0e}: {why}"


def seconds_a_step(stepper: Stepper, scene: Scene) -> float:
    """Seconds per step, from runs of growing length less the time of a start; SymtopError if no step can be made.

    If a run blows up, the longest one before it is timed, with its start.
    """
    start, run = stepper.from_start(scene.top, generic_start(scene), scene.time_scale() / STEPS_A_NUTATION)

    def seconds(steps: int) -> tuple[float, bool]:
        began = stepper.clock()
        end = run(start, steps)
        return stepper.clock() - began, bool(np.isfinite(end).all())

    first, steps = min(seconds(1)[0], seconds(1)[0]), 1
    while True:
        cost, finite = seconds(4 * steps)
        steps *= 4 if finite else 1
        if not finite or cost - first > max(TIMED_SECONDS, first) or steps > 1e7:  # a start's time scatters
            # the median, because other processes disturb, and the count of waiting time may lag behind
            cost = sorted(seconds(steps)[0] for _ in range(3))[1]
            # at least half, because the run that timed the start may have been disturbed
            return max(cost - first * finite, 0.5 * cost, LEAST_SECONDS * steps) / steps


def declared(method: Integrator, claim: str) -> str:
    """The value that a method declares for a claim, as a word; empty if it declares nothing.

    If nothing is declared about the energy, the other claims imply it: kept if it is among the conserved quantities,
    bounded if the method is symplectic and its step fixed (Benettin, Giorgilli, J. Stat. Phys. 74 (1994) 1117).

    On a body L_z, and all of L without a weight, is kept by methods that turn q and M by the same rotation and kick by
    the torque: splittings, variational and Lie-group methods, and maps of engines that carry L in space. A Runge-Kutta
    method keeps p_phi in the axis chart of a top but does not claim it on a body, where M.Gamma is cubic in the state.
    """
    conserves = method.conserves or frozenset()
    if claim == "energy" and method.energy_error is not None:
        return method.energy_error
    if claim == "energy" and "energy" not in conserves:
        return "bounded" if method.symplectic and method.fixed_step else ""
    if claim == "momentum":
        keeps = method.family in MOMENTUM_FAMILIES or (method.family == ENGINE and "p_phi" in conserves)
        return "kept" if keeps else ""
    if claim in CONSTANTS:
        return "kept" if claim in conserves else ""
    if claim == "invariant":
        return ", ".join(sorted(conserves - set(CONSTANTS)))
    if claim == "pole":
        return "no pole" if set(method.solvers) & {"axis", "attitude"} else ""
    return yes_no(getattr(method, "order" if claim == "time" else claim, None))


def open_target(
    target: Any, form: str | None, chart: str, *, on: Scene | None = None, adaptive: bool = False
) -> Stepper:  # fmt: skip
    """The stepper of a function, a class, ``FILE.py:NAME``, ``FILE.so:NAME`` or a command; SymtopError for all else."""
    chart = BODY if on is not None and on.of_body else one_of("chart", chart, CHARTS)  # a body has one chart
    path, _, symbol = str(target).partition(":")
    shared = isinstance(target, (str, Path)) and path.endswith(LIBRARIES)
    kind = one_of("form", ("shared" if shared else "ode") if form is None else form, FORMS)
    if chart == BODY and (kind not in ON_BODY or is_solver(target)):
        raise SymtopError(f"on a body without symmetry form must be {', '.join(ON_BODY)}, not {kind}", "form")
    if chart not in ("axis", BODY, OWN_CHART.get(kind, chart)):  # and not the default
        raise SymtopError(f"chart must be left out with form {kind}, whose states are its own, not {chart!r}", "chart")
    if kind in ("program", "server"):
        return (Program if kind == "program" else Server)(str(target), chart)
    if kind == "shared":
        return SharedObject(path, chart, symbol or "step")
    return _python_step(*_load(target, free=form is None), chart, kind, adaptive=adaptive, free=form is None)


def _python_step(target: Any, name: str, chart: str, kind: str, *, adaptive: bool, free: bool) -> Stepper:
    if kind == "diffrax" or is_solver(target):
        return DiffraxSolver(target, chart, name)
    if isinstance(target, type):
        return ScipySolver(target, chart, adaptive=adaptive)
    if kind == "scipy" or adaptive:
        raise SymtopError(f"form scipy, and a tolerance, need a class derived from OdeSolver, not {target!r}")
    arguments = ARGUMENTS.get(kind, ARGUMENTS["ode"])
    try:
        inspect.signature(target).bind(*arguments.split(","))
    except TypeError:
        hint = "; a rotation, q = (w, x, y, z), takes (q, w, h, inertia, torque): form rotation" * free
        signature = f"{inspect.signature(target)}{hint}"
        raise SymtopError(f"a step of the form {kind} must take {arguments}, not {signature}") from None
    except ValueError:  # built in, without a signature
        pass
    if kind in ("torch", "jax"):
        return BatchStep(target, chart, kind, name)
    if kind == "ode":
        return PythonStep(target, chart, name)
    if kind == "rotation":
        return RotationStep(target, name, BODY if chart == BODY else "attitude")
    return SeparableStep(target, name)


def _load(target: Any, *, free: bool) -> tuple[Any, str]:
    """The object `target`, or that of FILE.py:NAME (by default ``step``), and its name; `free`: no form was given."""
    if callable(target) or is_solver(target):
        return target, ""
    path, _, name = str(target).partition(":")
    if not path.endswith(".py"):
        forms = ", FILE.so, a trajectory such as FILE.csv, or a command with form program" if free else " or FILE.so"
        words = f"a step must be FILE.py:NAME{forms}"
        known = (method := path.partition("[")[0]) in methods()
        note = f", an integrator, whose claims `symtop claims {method}` measures" * known
        raise SymtopError(f"{words}, not {str(target)!r}{note}")
    hint = " (a command needs form program)" * free
    file = python_file(path, "a step", f"FILE.py:NAME{hint}")
    with foreign_code(f"the file {file.name}"), x64():
        module: Any = execute(f"symtop_judged_{Path(file).stem}", file)
    step = functools.reduce(lambda owner, part: getattr(owner, part, None), (name or "step").split("."), module)
    if not (callable(step) or is_solver(step)):
        functions = [key for key, value in vars(module).items() if callable(value) and not key.startswith("_")]
        hint = f"it has {', '.join(functions[:8])}" if functions else "it has no function"
        raise SymtopError(f"{file.name} must have a function {name or 'step'!r}; {hint}")
    return step, f"{file.stem}-{name}" if name else file.stem
