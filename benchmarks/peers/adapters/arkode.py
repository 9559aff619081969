"""ARKODE's symplectic stepper (SPRKStep of SUNDIALS): the library in SundialsPy's wheel, called through ctypes.

It composes kicks and drifts of H = T(p) + V(q), so it gets the reduced top in angles at fixed p_phi and p_psi, as
symtop's own splittings in that chart do. Both halves are C functions by numba; the step is fixed; it stops at the
samples, which are ends of steps. SundialsPy does not wrap SPRKStep itself, but ships SUNDIALS 7.3 with it; the wrapper
of SUNDIALS' own authors, sundials4py, needs Python 3.12.
"""

import ctypes
from typing import Any

import numpy as np

from benchmarks.peers import callbacks, common
from benchmarks.peers.common import Inner, Library, Motion
from benchmarks.peers.sundials import NORMAL, Sundials, c_double, c_int, c_long, c_void_p, function
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import Integrator
from symtop.model.top import Angles, SymmetricTop

PACKAGE, DISTRIBUTION = "arkode-sprk", "SundialsPy"
MOST_STEPS = 100_000_000
METHODS = {  # name: order, stages
    "LEAPFROG_2_2": (2, 2),
    "MCLACHLAN_4_4": (4, 4),
    "YOSHIDA_6_8": (6, 8),
    "SUZUKI_UMENO_8_16": (8, 16),
    "SOFRONIOU_10_36": (10, 36),
}


class Stepper:
    """ARKODE's memory for one top, start and step."""

    def __init__(self, library: Sundials, method: str, top: SymmetricTop, start: Angles, step: float) -> None:
        (arkode,) = library.others
        self.begin = library.vector(np.array([start.theta, top.I1 * start.theta_dot, start.phi, start.psi]))
        self.state, self.time = library.vector(self.begin.numbers), c_double(0.0)
        self.fields = callbacks.split_field(top, start, library.core)
        self.halves = [c_void_p(field.address) for field in self.fields]
        make = function(arkode, "SPRKStepCreate", c_void_p, c_void_p, c_double, c_void_p, c_void_p, returns=c_void_p)
        self.memory = c_void_p(make(*self.halves, 0.0, self.begin.handle, library.context))
        function(arkode, "SPRKStepSetMethodName", c_void_p, ctypes.c_char_p)(
            self.memory, f"ARKODE_SPRK_{method}".encode()
        )
        function(arkode, "ARKodeSetFixedStep", c_void_p, c_double)(self.memory, step)
        function(arkode, "ARKodeSetMaxNumSteps", c_void_p, c_long)(self.memory, MOST_STEPS)
        self._restart = function(arkode, "ARKodeReset", c_void_p, c_double, c_void_p)
        self._stop = function(arkode, "ARKodeSetStopTime", c_void_p, c_double)
        self._go = function(arkode, "ARKodeEvolve", c_void_p, c_double, c_void_p, c_void_p, c_int)
        self._free = function(arkode, "ARKodeFree", c_void_p, returns=None)

    def restart(self) -> None:
        """Back to the start."""
        self._restart(self.memory, 0.0, self.begin.handle)

    def advance(self, time: float) -> None:
        """Go on to the end of a step at `time`; the state is in `state.numbers`."""
        self._stop(self.memory, time)
        self._go(self.memory, time, self.state.handle, ctypes.addressof(self.time), NORMAL)

    def __del__(self) -> None:
        self._free(ctypes.byref(self.memory))


class Sprk(Library):
    """One table of coefficients."""

    chart = "angles"

    def __init__(self, library: Sundials, method: str, stages: int) -> None:
        self.library, self.method, self.stages = library, method, stages

    def public(self, top: SymmetricTop, start: Angles, plan: Plan) -> Motion:
        """Build the stepper and call it for each sample."""
        stepper, rows = Stepper(self.library, self.method, top, start, plan.step_size), []
        for time in plan.times.tolist():
            if time > 0.0:
                stepper.advance(time)
            rows.append(stepper.state.numbers.copy())
        steps = int(plan.marks[-1])
        return Motion(rows, steps, steps * self.stages)

    def inner(self, top: SymmetricTop, start: Angles, plan: Plan) -> Inner:
        """Start the stepper again and go to the horizon in one call."""
        stepper, horizon = Stepper(self.library, self.method, top, start, plan.step_size), plan.horizon

        def call() -> Any:
            stepper.restart()
            stepper.advance(horizon)
            return stepper.state.numbers

        return Inner(call, lambda numbers: numbers)


def peers() -> list[tuple[Integrator, str]]:
    """One table of each even order."""
    library = Sundials("SundialsPy", "sundialspy.libs", "arkode")
    return [
        (
            common.record(
                f"sprk-{name.lower().replace('_', '-')}",
                Sprk(library, name, stages),
                "SPRKStep through ctypes; fixed step",
                control="step_size",
                order=order,
            ),
            common.NUMBA_IN_C,
        )
        for name, (order, stages) in METHODS.items()
    ]
