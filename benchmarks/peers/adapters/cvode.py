"""CVODE of SUNDIALS with its right-hand side in C: the library in scikit-sundae's wheel, called through ctypes.

Six equations on (e, L), compiled by numba to a C function that CVODE calls itself; rtol = atol = the tolerance. Adams
with fixed-point iteration, as SUNDIALS advises for problems that are not stiff, and BDF with Newton's, a dense matrix
and difference quotients. A sample costs one call of CVode from Python (about 1 us), which interpolates.
"""

import ctypes
from typing import Any

from benchmarks.peers import callbacks, common
from benchmarks.peers.common import Inner, Library, Motion
from benchmarks.peers.sundials import NORMAL, Sundials, Vector, c_double, c_int, c_long, c_void_p, function
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.registry import Integrator
from symtop.model.top import Angles, SymmetricTop

PACKAGE, DISTRIBUTION = "cvode", "scikit-sundae"
MOST_STEPS = 10_000_000
FAMILIES = {"Adams": 1, "BDF": 2}


class Solver:
    """CVODE's memory for one top, start and tolerance."""

    def __init__(self, library: Sundials, family: int, top: SymmetricTop, start: Angles, tolerance: float) -> None:
        cvode, dense, matrix = library.others
        self.begin = library.vector(common.start_of(top, start))
        self.state: Vector = library.vector(self.begin.numbers)
        self.field, self.time = callbacks.vector_field(top, library.core), c_double(0.0)
        self.memory = c_void_p(
            function(cvode, "CVodeCreate", c_int, c_void_p, returns=c_void_p)(family, library.context)
        )
        address, begin = c_void_p(self.field.address), self.begin.handle
        function(cvode, "CVodeInit", c_void_p, c_void_p, c_double, c_void_p)(self.memory, address, 0.0, begin)
        function(cvode, "CVodeSStolerances", c_void_p, c_double, c_double)(self.memory, tolerance, tolerance)
        function(cvode, "CVodeSetMaxNumSteps", c_void_p, c_long)(self.memory, MOST_STEPS)
        self.owned: list[tuple[Any, c_void_p]] = []
        if family == FAMILIES["Adams"]:
            make = function(cvode, "SUNNonlinSol_FixedPoint", c_void_p, c_int, c_void_p, returns=c_void_p)
            iteration = c_void_p(make(begin, 0, library.context))
            function(cvode, "CVodeSetNonlinearSolver", c_void_p, c_void_p)(self.memory, iteration)
            self.owned.append((function(library.core, "SUNNonlinSolFree", c_void_p), iteration))
        else:
            make = function(matrix, "SUNDenseMatrix", ctypes.c_int64, ctypes.c_int64, c_void_p, returns=c_void_p)
            jacobian = c_void_p(make(6, 6, library.context))
            make = function(dense, "SUNLinSol_Dense", c_void_p, c_void_p, c_void_p, returns=c_void_p)
            linear = c_void_p(make(begin, jacobian, library.context))
            function(cvode, "CVodeSetLinearSolver", c_void_p, c_void_p, c_void_p)(self.memory, linear, jacobian)
            self.owned.append((function(library.core, "SUNLinSolFree", c_void_p), linear))
            self.owned.append((function(library.core, "SUNMatDestroy", c_void_p, returns=None), jacobian))
        self.restart = function(cvode, "CVodeReInit", c_void_p, c_double, c_void_p)
        self.go = function(cvode, "CVode", c_void_p, c_double, c_void_p, c_void_p, c_int)
        self._counts = [function(cvode, f"CVodeGetNum{name}", c_void_p, c_void_p) for name in ("Steps", "RhsEvals")]
        self._free = function(cvode, "CVodeFree", c_void_p, returns=None)

    def advance(self, time: float) -> None:
        """Go on to a time; the state is in `state.numbers`."""
        self.go(self.memory, time, self.state.handle, ctypes.addressof(self.time), NORMAL)

    def counts(self) -> list[int]:
        """Steps and evaluations so far."""
        numbers = [c_long(0), c_long(0)]
        for count, number in zip(self._counts, numbers, strict=True):
            count(self.memory, ctypes.addressof(number))
        return [number.value for number in numbers]

    def __del__(self) -> None:
        self._free(ctypes.byref(self.memory))
        for free, handle in self.owned:
            free(handle)


class Cvode(Library):
    """One family of multistep methods."""

    def __init__(self, library: Sundials, family: str) -> None:
        self.library, self.family = library, FAMILIES[family]

    def public(self, top: SymmetricTop, start: Angles, plan: Plan) -> Motion:
        """Build the solver and call it for each sample."""
        solver, rows = Solver(self.library, self.family, top, start, plan.tolerance), []
        for time in plan.times.tolist():
            if time > 0.0:
                solver.advance(time)
            rows.append(solver.state.numbers.copy())
        return Motion(rows, *solver.counts())

    def inner(self, top: SymmetricTop, start: Angles, plan: Plan) -> Inner:
        """Start a solver again and go to the horizon in one call."""
        solver, horizon = Solver(self.library, self.family, top, start, plan.tolerance), plan.horizon

        def call() -> Any:
            solver.restart(solver.memory, 0.0, solver.begin.handle)
            solver.advance(horizon)
            return solver.state.numbers

        return Inner(call, lambda numbers: numbers)


def peers() -> list[tuple[Integrator, str]]:
    """Both families of multistep methods."""
    library = Sundials("sksundae.cvode", "../scikit_sundae.libs", "cvode", "sunlinsoldense", "sunmatrixdense")
    return [
        (
            common.record(f"cvode-{family.lower()}", Cvode(library, family), f"CVODE through ctypes; {common.SAME}"),
            common.NUMBA_IN_C,
        )
        for family in FAMILIES
    ]
