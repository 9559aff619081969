"""The momenta that the increments of a run in angles have, beside those that the run reports.

In the angles chart p_phi and p_psi are parameters of a state. What the trajectory itself says of them are its rates,

    p_psi = I3 (psi' + phi' cos theta),    p_phi = I1 phi' sin^2 theta + p_psi cos theta,

phi' and psi' by central differences of order 8 over nine consecutive steps. They differ from the momenta of a method by
its error of a step, which oscillates with the nutation and does not grow. A run that loses its momenta and reports
those of its start shows a difference that drifts, as far as its momenta do.
"""

from typing import NamedTuple

import numpy as np

from symtop.core.numbers import GOLDEN
from symtop.measure.conservation import trend
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Plan, Run
from symtop.methods.framework.registry import Integrator
from symtop.model.charts import Array
from symtop.model.scenes import Scene
from symtop.model.top import SymmetricTop

STENCIL = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0.0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
REACH = 4  # steps to either side
PLACES = 240
FEWEST = 4000  # steps: in a shorter run places would meet
SURE = 8.0  # intervals of the trend
LEAST = 1e-8  # relative: what differences of angles of many turns leave in doubt
SHARE = 0.5  # of the drift of the increments' momentum: what the difference drifts by if the run hides it


class Difference(NamedTuple):
    """How far reported momenta are from those of the states."""

    name: str  # of the momentum that differs more
    size: float  # relative to the larger momentum
    floor: float  # a smaller one is rounding
    how: str


def from_increments(method: Integrator, scene: Scene, plan: Plan) -> Difference | None:
    """The drift of the difference over a run as long as `plan`, in the angles chart; None if the run is short."""
    steps = int(plan.marks[-1])
    if steps < FEWEST:
        return None
    places = np.arange(PLACES) + np.mod(GOLDEN * np.arange(PLACES), 1.0)
    middles = np.rint(places * (steps - 2 * REACH - 1) / PLACES).astype(np.int64) + REACH
    marks = (middles[:, None] + np.arange(-REACH, REACH + 1)).ravel()
    again = Plan.steps(plan.step_size, np.unique(marks))
    run = solve(method, "angles", scene.top, scene.start, again, f" on {scene.name}")
    return compared(scene, again, run, middles) if run.outcome == "ok" else None


def compared(scene: Scene, plan: Plan, run: Run, middles: Array) -> Difference:
    """The difference whose drift is larger, of a run that was sampled around `middles`."""
    place = np.searchsorted(plan.marks, middles)
    around = run.states[place[:, None] + np.arange(-REACH, REACH + 1)]  # (places, 9, 4)
    implied = dict(zip(("p_phi", "p_psi"), momenta_of(scene.top, around, plan.step_size), strict=True))
    times, sizes = plan.times[place], {}
    for name, values in implied.items():
        reported = getattr(run, name)[place]
        apart, own = trend(times, (values - reported) / scene.momentum_scale), trend(times, values)
        hidden = abs(apart.rise) > max(LEAST, SHARE * abs(own.rise) / scene.momentum_scale)
        sizes[name] = abs(apart.rise) if hidden and abs(apart.slope) > SURE * apart.interval else 0.0
    name = max(sizes, key=lambda one: sizes[one])
    return Difference(name, sizes[name], LEAST, f"more at the end of {int(plan.marks[-1])} steps than at their start")


def momenta_of(top: SymmetricTop, around: Array, h: float) -> tuple[Array, Array]:
    """p_phi and p_psi (places,) of nine consecutive states (places, 9, 4) in angles."""
    theta = around[:, REACH, 0]
    phi_dot, psi_dot = ((around[:, :, k] - around[:, REACH, None, k]) @ STENCIL / h for k in (2, 3))
    p_psi = top.I3 * (psi_dot + phi_dot * np.cos(theta))
    return top.I1 * phi_dot * np.sin(theta) ** 2 + p_psi * np.cos(theta), p_psi
