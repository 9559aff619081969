"""What is judged: a registered integrator or a bare step, with the scene, its claims and how far its runs may go.

How much a bare step may run follows from the seconds that it takes, so that a method in Python is judged in a minute
and a compiled one in seconds; the findings name the steps that were run. A registered integrator runs as far as its
implementation is given by default.

A bare step is given as a function, a class, a solver, a file or a command; its adapter is chosen by what it is.
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
from symtop.judging import FORMS
from symtop.judging.adapters.adapter import Stepper
from symtop.judging.adapters.external import BatchStep, DiffraxSolver, Program, SharedObject, is_solver
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
OWN_CHART = {"separable": "", "rotation": "attitude"}  # of forms that have no other
LIBRARIES = (".so", ".dylib", ".dll")
CONSTANTS = (*MOTION, "axis_length")
KEEPING = ("splitting", "discrete-lagrangian", "lie-group")  # families that keep the momentum of a body
PLANE = "nutation"  # the chart of a map of (theta, p_theta)
LONG, SLOPES = (10.0, 2.5), (6.0, 1.5)  # seconds of a long run and of the runs of the order; the second with --quick
STEPS = 1_000_000  # most steps of a long run
SAMPLES = 4000  # intervals of a long run: a program that writes every so many steps needs a multiple
FINEST = {"compiled": 2e5, "python": 1e4}  # most steps of a run of the order
FEWEST = 300  # steps of the longest run of the order, however slow
SINGLE = 1000  # most of them in single precision, whose rounding hides what more would show
LADDER = 2.5  # times the steps of the longest run: what all of them take
ENOUGH_STEPS, AT_REST = 50.0, 1e-9  # steps a nutation with a right-hand side of zero, and how far they may go
STEPS_A_NUTATION = 118.02  # of a long run, and of the steps that are timed: an implicit one costs more if it is long
ENOUGH, LEAST = 0.03, 1e-9  # seconds after which the time of a step is known, and the least that it is


def rest(_: float, y: Any) -> Any:
    """y' = 0, as a right-hand side."""
    return np.zeros(np.shape(y))


@dataclass(frozen=True)
class Subject:
    """An integrator with its claims; what a figure shows of its measurements goes into `traces`."""

    method: Integrator
    scene: Scene
    quick: bool = False
    stepper: Any = None  # a `Stepper`, of a bare step
    seconds_a_step: float = 0.0
    seed: int = 0  # of the starts, times and steps that are drawn
    autonomous: bool = False  # was a step written for f(y)?
    traces: dict[str, Any] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """Whatever steps a "body" without symmetry; on a top a bare "step" or a registered "integrator"."""
        return "body" if self.scene.of_body else "step" if self.stepper else "integrator"

    @property
    def in_plane(self) -> bool:
        """Is it a map of (theta, p_theta)?"""
        return self.stepper is not None and self.stepper.form is REDUCED

    @functools.cached_property
    def knows_top(self) -> bool:
        """Does it move a state where f is zero? A method for y' = f(t, y) alone does not: this one knows the top."""
        if self.stepper is None or not self.stepper.takes_field or self.method.adaptive:
            return False
        h = self.scene.time_scale() / ENOUGH_STEPS
        y, _ = self.stepper.from_start(self.scene.top, self.scene.start, h)
        try:
            end = self.stepper.along(rest, h, y.copy(), h, np.array([1]))[0]
        except SymtopError:  # it divides by f
            return True
        return not np.max(np.abs(end - y)) <= AT_REST * np.max(np.abs(y))

    def elsewhere(self, draws: tuple[int, int], seconds: tuple[float, float]) -> Iterator[tuple[str, Scene]]:
        """Starts that are drawn, named, every other one late, while draws and seconds last; the second with --quick."""
        began, draw, stepper = time.monotonic(), np.random.default_rng(self.seed), self.stepper or Stepper()
        scenes = drawn(self.scene, draws[self.quick], self.seed, same_top=self.knows_top)
        try:
            for k, scene in enumerate(scenes, start=1):
                if time.monotonic() - began > seconds[self.quick]:  # a program that takes long to start
                    return
                stepper.since = 0.0 if k % 2 else scene.time_scale() * 10.0 ** draw.uniform(0.0, 3.0)
                yield f"start {k} of seed {self.seed}" + f", t = {stepper.since:.3g}" * (k % 2 == 0), scene
        finally:
            stepper.since = 0.0

    @property
    def charts(self) -> tuple[str, ...]:
        """The charts in which a step is looked at."""
        return (PLANE,) if self.in_plane else self.method.charts()[-1 if self.quick else 0 :]

    @property
    def long_steps(self) -> float | None:
        """The most steps of a long run; None for what an implementation is given."""
        if not self.seconds_a_step:
            return None
        steps = min(LONG[self.quick] / self.seconds_a_step, STEPS)
        return SAMPLES * round(steps / SAMPLES) if steps > SAMPLES else steps

    @property
    def finest(self) -> float | None:
        """The most steps of a run of the order; None for what an implementation is given."""
        if not self.seconds_a_step:
            return None
        steps = min(SLOPES[self.quick] / self.seconds_a_step / LADDER, FINEST[self.method.implementation])
        return max(min(steps, SINGLE) if self.single else steps, FEWEST)

    @functools.cached_property
    def single(self) -> bool:
        """Are the numbers of a bare step those of single precision?"""
        if self.stepper is None or not self.method.fixed_step:
            return False
        scene = self.scene
        state, run = self.stepper.from_start(scene.top, generic_start(scene), scene.time_scale() / STEPS_A_NUTATION)
        end = run(state, 1)[0]
        with np.errstate(over="ignore"):  # of a step that blows up, whose numbers single precision does not hold
            return bool((end == end.astype(np.float32)).all() and not (state == state.astype(np.float32)).all())

    def rounding(self, steps: float) -> float:
        """What rounding to single precision, if it is that, may leave of so many steps, relative: a unit each."""
        return steps * float(np.finfo(np.float32).eps) * self.single


def hidden_by_single(size: float, why: str) -> str:
    """Why a claim is undecided, with the size below which single precision hides an error."""
    return f"single precision hides errors below about {size:.0e}: {why}"


def seconds_a_step(stepper: Stepper, scene: Scene) -> float:
    """Seconds a step, from runs of more and more steps without what a run costs at its start; SymtopError without one.

    A run that blows up is no longer than its last finite state: then the longest run before it is timed, start and all.
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
        if not finite or cost - first > max(ENOUGH, first) or steps > 1e7:  # a start's cost scatters as much as it is
            # others may have been at work, and a clock that leaves waiting out may hear of what is past
            cost = sorted(seconds(steps)[0] for _ in range(3))[1]
            # the start alone may have been disturbed
            return max(cost - first * finite, 0.5 * cost, LEAST * steps) / steps


def declared(method: Integrator, claim: str) -> str:
    """What a method says of a claim, in a word; empty if nothing.

    Nothing claimed of the energy means what the other claims imply: kept if it is among the conserved quantities,
    bounded if the method is symplectic and its step fixed (Benettin, Giorgilli, J. Stat. Phys. 74 (1994) 1117).

    On a body L_z, and all of L without a weight, is kept by methods that turn q and M by the same rotation and kick by
    the torque: splittings, variational and Lie-group methods, and maps of engines that carry L in space. M.Gamma is a
    cubic of the state, so that p_phi, which a Runge-Kutta method keeps on the axis of a top, is no claim of it there.
    """
    conserves = method.conserves or frozenset()
    if claim == "energy" and method.energy_error is not None:
        return method.energy_error
    if claim == "energy" and "energy" not in conserves:
        return "bounded" if method.symplectic and method.fixed_step else ""
    if claim == "momentum":
        return "kept" if method.family in KEEPING or (method.family == ENGINE and "p_phi" in conserves) else ""
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
    chart = BODY if on is not None and on.of_body else one_of("chart", chart, CHARTS)  # a body has no other
    path, _, symbol = str(target).partition(":")
    shared = isinstance(target, (str, Path)) and path.endswith(LIBRARIES)
    kind = one_of("form", ("shared" if shared else "ode") if form is None else form, FORMS)
    if chart == BODY and (kind not in ON_BODY or is_solver(target)):
        raise SymtopError(f"on a body without symmetry form must be {', '.join(ON_BODY)}, not {kind}", "form")
    if chart not in ("axis", BODY, OWN_CHART.get(kind, chart)):  # and not the default
        raise SymtopError(f"chart must be left out with form {kind}, whose states are its own, not {chart!r}", "chart")
    if kind == "program":
        return Program(str(target), chart)
    if kind == "shared":
        return SharedObject(path, chart, symbol or "step")
    return _python_step(*_thing(target, free=form is None), chart, kind, adaptive=adaptive, free=form is None)


def _python_step(thing: Any, name: str, chart: str, kind: str, *, adaptive: bool, free: bool) -> Stepper:
    if kind == "diffrax" or is_solver(thing):
        return DiffraxSolver(thing, chart, name)
    if isinstance(thing, type):
        return ScipySolver(thing, chart, adaptive=adaptive)
    if kind == "scipy" or adaptive:
        raise SymtopError(f"form scipy, and a tolerance, need a class derived from OdeSolver, not {thing!r}")
    arguments = ARGUMENTS.get(kind, ARGUMENTS["ode"])
    try:
        inspect.signature(thing).bind(*arguments.split(","))
    except TypeError:
        hint = "; a rotation, q = (w, x, y, z), takes (q, w, h, inertia, torque): form rotation" * free
        signature = f"{inspect.signature(thing)}{hint}"
        raise SymtopError(f"a step of the form {kind} must take {arguments}, not {signature}") from None
    except ValueError:  # built in, without a signature
        pass
    if kind in ("torch", "jax"):
        return BatchStep(thing, chart, kind, name)
    if kind == "ode":
        return PythonStep(thing, chart, name)
    if kind == "rotation":
        return RotationStep(thing, name, BODY if chart == BODY else "attitude")
    return SeparableStep(thing, name)


def _thing(target: Any, *, free: bool) -> tuple[Any, str]:
    """What is given, or FILE.py:NAME names, and its name; without a name the function ``step``. Is its form `free`?"""
    if callable(target) or is_solver(target):
        return target, ""
    path, _, name = str(target).partition(":")
    if not path.endswith(".py"):
        more = ", FILE.so, a trajectory such as FILE.csv, or a command with form program" if free else " or FILE.so"
        words = f"a step must be FILE.py:NAME{more}"
        known = (method := path.partition("[")[0]) in methods()
        own = f", an integrator, whose claims `symtop claims {method}` measures" * known
        raise SymtopError(f"{words}, not {str(target)!r}{own}")
    hint = " (a command needs form program)" * free
    file = python_file(path, "a step", f"FILE.py:NAME with a file that is there{hint}")
    with foreign_code(f"the file {file.name}"):
        module: Any = execute(f"symtop_judged_{Path(file).stem}", file)
    thing = functools.reduce(lambda one, part: getattr(one, part, None), (name or "step").split("."), module)
    if not (callable(thing) or is_solver(thing)):
        functions = [key for key, value in vars(module).items() if callable(value) and not key.startswith("_")]
        hint = f"it has {', '.join(functions[:8])}" if functions else "it has no function"
        raise SymtopError(f"{file.name} must have a function {name or 'step'!r}; {hint}")
    return thing, f"{file.stem}-{name}" if name else file.stem
