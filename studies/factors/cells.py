"""The cells of the factorial: a method, the chart of its equations, the language that runs it, the call around it.

    method        a scheme: the same coefficients in every chart and language
    chart         angles, axis, attitude          see `symtop.methods.framework.equations`
    language      compiled        the whole loop, by numba or heyoka
                  scipy-numba     SciPy's loop in Python, the right-hand side compiled
                  scipy-python    SciPy's loop, the right-hand side in Python on floats
                  numpy           a loop in Python over NumPy arrays, see `plain_numpy`
    call          kernel          the bare solver, two samples
                  simulate        `symtop.simulate` as it stands: its guard, a dataset, 501 samples or each step
                  solve_ivp       `scipy.integrate.solve_ivp` with 501 samples

A splitting has another split in angles (kinetic energy of theta and effective potential) than in the space frame (free
top and gravity), with the same coefficients. The implicit midpoint rule is `midpoint` in angles and `gauss-2` on
(e, L). Everything else solves the same equations of its chart.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from symtop.methods.framework.equations import FORMULATIONS
from symtop.methods.framework.registry import Integrator, integrators
from symtop.methods.library.scipy_ivp import RightHandSide, scipy_method
from symtop.methods.taylor import heyoka
from symtop.model.scenes import Scene
from symtop.run.simulation import make_plan, simulate

from . import plain_numpy

COMPILED, SCIPY_NUMBA, SCIPY_PYTHON, NUMPY = LANGUAGES = ("compiled", "scipy-numba", "scipy-python", "numpy")
KERNEL, SIMULATE, SOLVE_IVP = CALLS = ("kernel", "simulate", "solve_ivp")
SAMPLES = 501  # of a public call, the default of `simulate`

DORMAND_PRINCE = "Dormand-Prince 5(4)"
SCIPYS = {DORMAND_PRINCE: "RK45", "DOP853": "DOP853"}  # SciPy's names
# by scheme: its methods and the charts in which each is used, () for all that it has
COMPILED_SCHEMES: dict[str, dict[str, tuple[str, ...]]] = {
    DORMAND_PRINCE: {"rk45-compiled": ()},
    "rk4": {"rk4": ()},
    "Strang": {"stormer-verlet": (), "strang": ()},
    "Takahashi-Imada": {"takahashi-imada": ()},
    "Blanes-Moan 11-6": {"stormer-verlet-blanes-moan-6": (), "srkn-11-6": ()},
    "Blanes-Moan 14-6": {"srkn-14-6": ()},
    "implicit midpoint": {"midpoint": (), "gauss-2": ()},
    "Gauss 6": {"gauss-6": ()},
    "Taylor": {"taylor": ()},
}
FAMILIES = {
    "splitting": ("Strang", "Takahashi-Imada", "Blanes-Moan 11-6", "Blanes-Moan 14-6"),
    "Gauss": ("implicit midpoint", "Gauss 6"),
    "rk4": ("rk4",),
    "Dormand-Prince": (DORMAND_PRINCE,),
    "Taylor": ("Taylor",),
}
QUICK = (DORMAND_PRINCE, "rk4", "Takahashi-Imada", "Taylor")


@dataclass(frozen=True)
class Cell:
    """A method in one chart and one language."""

    scheme: str
    chart: str
    language: str
    method: Integrator = field(compare=False)  # a variant: it has this chart alone

    @property
    def name(self) -> str:
        """The name of the variant."""
        return self.method.name

    @property
    def key(self) -> tuple[str, str, str]:
        """The three factors."""
        return self.scheme, self.chart, self.language


def cells(schemes: Sequence[str] | None = None) -> list[Cell]:
    """The cells of some schemes, or of all; within a scheme and chart the fastest language comes first."""
    known, grid = integrators(), list[Cell]()
    for scheme, methods in COMPILED_SCHEMES.items():
        for name in methods:
            if name in known:  # taylor needs heyoka
                grid += [Cell(scheme, chart, COMPILED, known[name].variant(chart)) for chart in known[name].charts()]
    if "taylor" in known:
        grid.append(Cell("Taylor", "angles", COMPILED, taylor_in_angles()))
    for scheme, name in SCIPYS.items():
        for chart in FORMULATIONS:
            if scheme == DORMAND_PRINCE:
                grid.append(Cell(scheme, chart, SCIPY_NUMBA, scipy_method(name, compiled=True).variant(chart)))
            grid.append(Cell(scheme, chart, SCIPY_PYTHON, known[name.lower()].variant(chart)))
    for scheme, method in (("rk4", plain_numpy.RK4), ("Strang", plain_numpy.STRANG)):
        grid += [Cell(scheme, chart, NUMPY, method.variant(chart)) for chart in method.charts()]
    return [cell for cell in grid if schemes is None or cell.scheme in schemes]


def taylor_in_angles() -> Integrator:
    """The variant ``taylor[angles]``: heyoka on the Euler-Lagrange equations, from the same formulas as the others."""
    solvers = {"angles": heyoka.HeyokaSolver("angles", "double")}
    return replace(integrators()["taylor"], name="taylor[angles]", solvers=solvers)


def caller(scene: Scene, cell: Cell, call: str, setting: float, horizon: float) -> Callable[[], object] | None:
    """A function of no arguments that makes one run; None for a call that the method does not have."""
    method, control = cell.method, cell.method.given(setting)
    if call == SIMULATE:
        return lambda: simulate(scene, method, horizon=horizon, samples=SAMPLES, **control)
    if call == KERNEL:
        plan, _ = make_plan(scene, method, **control, horizon=horizon, samples=2)
        solve = method.solvers[cell.chart]
        return lambda: solve(scene.top, scene.start, plan)
    if cell.language != SCIPY_PYTHON:
        return None
    return _solve_ivp(scene, cell, setting, horizon)


def _solve_ivp(scene: Scene, cell: Cell, tolerance: float, horizon: float) -> Callable[[], object]:
    """One call of `solve_ivp` as a user of SciPy writes it; parameters and start are computed beforehand."""
    import numpy as np
    from scipy.integrate import solve_ivp

    form = FORMULATIONS[cell.chart]
    par, start = form.prepare(scene.top, scene.start)
    times = np.linspace(0.0, horizon, SAMPLES)

    def run() -> object:
        rhs = RightHandSide(form.field, par)
        return solve_ivp(rhs, (0.0, horizon), start, SCIPYS[cell.scheme], t_eval=times, rtol=tolerance, atol=tolerance)

    return run
