"""From what a user gives to the adapter that it fits."""

import inspect
import sys
from pathlib import Path
from typing import Any

from symtop.core.errors import SymtopError, foreign_code, one_of
from symtop.core.files import execute, python_file
from symtop.judging.adapters.adapter import Stepper
from symtop.judging.adapters.batch_step import BatchStep
from symtop.judging.adapters.diffrax_solver import DiffraxSolver, is_solver
from symtop.judging.adapters.program import Program
from symtop.judging.adapters.python_step import PythonStep
from symtop.judging.adapters.rotation import RotationStep
from symtop.judging.adapters.scipy_solver import ScipySolver
from symtop.judging.adapters.separable import SeparableStep
from symtop.judging.adapters.shared_object import SharedObject
from symtop.model.charts import CHARTS

FORMS = ("ode", "separable", "rotation", "scipy", "diffrax", "torch", "jax", "shared", "program")
ARGUMENTS = {"ode": "(f, t, y, h)", "separable": "(state, h, dT, dV)", "rotation": "(q, w, h, inertia, torque)"}
BATCHES = ("torch", "jax")
LIBRARIES = (".so", ".dylib", ".dll")


def form_of(target: Any) -> str:
    """The form of what is given, where it shows: a class, a function, FILE.py:NAME, a library, or else a program."""
    if isinstance(target, type):
        return "scipy"
    if is_solver(target):
        return "diffrax"
    if callable(target):
        return "ode"
    text = str(target)
    path = text.partition(":")[0]
    if " " in text.strip():
        return "program"
    if path.endswith(".py"):
        return "ode"
    return "shared" if path.endswith(LIBRARIES) else "program"


def open_target(target: Any, form: str | None, chart: str, *, adaptive: bool = False) -> Stepper:
    """The stepper of a function, a class, ``FILE.py:NAME``, ``FILE.so:NAME`` or a command.

    Raises SymtopError for anything that is none of these, or that cannot be loaded.
    """
    kind = one_of("form", form or form_of(target), FORMS)
    one_of("chart", chart, CHARTS)
    if kind == "program":
        return Program(str(target), chart)
    if kind == "shared":
        path, _, symbol = str(target).partition(":")
        return SharedObject(path, chart, symbol or "step")
    thing, name = _from_file(target) if isinstance(target, (str, Path)) else (target, "")
    if kind == "diffrax" or is_solver(thing):
        return DiffraxSolver(thing, chart, name)
    if isinstance(thing, type):
        return ScipySolver(thing, chart, adaptive=adaptive)
    if kind == "scipy" or adaptive:
        raise SymtopError(f"form scipy, and a tolerance, need a class derived from OdeSolver, not {thing!r}")
    arguments = ARGUMENTS.get(kind, ARGUMENTS["ode"])
    if not _takes(thing, arguments.count(",") + 1):
        raise SymtopError(f"a step of the form {kind} must take {arguments}, not {inspect.signature(thing)}")
    if kind in BATCHES:
        return BatchStep(thing, chart, kind, name)
    if kind == "ode":
        return PythonStep(thing, chart, name)
    return RotationStep(thing, name) if kind == "rotation" else SeparableStep(thing, name)


def _takes(thing: Any, arguments: int) -> bool:
    try:
        inspect.signature(thing).bind(*[None] * arguments)
    except TypeError:
        return False
    except ValueError:  # built in, without a signature
        return True
    return True


def _from_file(target: str | Path) -> tuple[Any, str]:
    """What FILE.py:NAME names, and its name; without a name the function ``step``."""
    path, _, name = str(target).partition(":")
    file = python_file(path, "a step", "FILE.py:NAME with a file that is there")
    with foreign_code(f"the file {file.name}"):
        sys.path.insert(0, str(file.parent))  # what stands beside it, as Python has it for a script
        module = execute(f"symtop_judged_{Path(file).stem}", file)
    thing = getattr(module, name or "step", None)
    if not (callable(thing) or is_solver(thing)):
        known = [key for key, value in vars(module).items() if callable(value) and not key.startswith("_")]
        hint = f"it has {', '.join(known[:8])}" if known else "it has no function"
        raise SymtopError(f"{file.name} must have a function {name or 'step'!r}; {hint}")
    return thing, f"{file.stem}-{name}" if name else file.stem
