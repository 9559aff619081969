"""`Plan`, the request to a solver; `Run`, its result; and the outcomes of a run."""

import math
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symtop.core.errors import SymtopError

Array = NDArray[np.float64]


class Plan(NamedTuple):
    """The request to a solver: the sample times, and the step or the tolerance to reach them with.

    A fixed-step solver makes marks[-1] steps of `step_size` and keeps the states after marks[0], marks[1], ... of them,
    at `times`. An adaptive solver has no marks, and `times` need not be ends of its steps. The first sample may be the
    start itself (mark 0, time 0).

    Probes of reversibility ask for one step of -h; then `times` and `horizon` are negative too. A solver that cannot do
    that raises SymtopError and is judged by the motion with all rates reversed.
    """

    times: Array  # (samples,) increasing in size, the first may be 0
    horizon: float  # elapsed time of the whole run
    step_size: float  # nan for an adaptive method
    marks: NDArray[np.int64]  # (samples,) whole steps, increasing; empty for an adaptive method
    tolerance: float  # nan for a fixed-step method
    budget: float | None = None  # force evaluations, steps of a Taylor method; None for the method's own limit

    @classmethod
    def steps(cls, h: float, marks: ArrayLike, horizon: float | None = None, budget: float | None = None) -> Self:
        """Steps of h, sampled after `marks` of them; `horizon` if it is not their product to the last bit."""
        whole_steps = np.asarray(marks, dtype=np.int64)
        end = float(whole_steps[-1]) * h if horizon is None else horizon
        return cls(np.multiply(whole_steps, h, dtype=float), end, h, whole_steps, math.nan, budget)

    @classmethod
    def until(cls, times: ArrayLike, tolerance: float, budget: float | None = None) -> Self:
        """To the last of `times`, after 0, at a tolerance (nan for a method that has none), sampled at all of them."""
        samples = np.asarray(times, dtype=float)
        if not (samples.size and samples[-1] > 0.0):  # a loop of steps would never end
            raise SymtopError(f"times must end after 0, not at {samples[-1] if samples.size else 'none'}")
        return cls(samples, float(samples[-1]), math.nan, np.empty(0, dtype=np.int64), tolerance, budget)

    def last_of(self, mask: Any) -> float:
        """The time of the last sample before the first at which `mask`, (samples,), is false; 0 if there is none."""
        return float(self.times[int(np.argmin(mask)) - 1]) if mask[0] else 0.0

    def most(self, limit: float) -> float:
        """The budget, or if none was given, the method's own limit."""
        return limit if self.budget is None else self.budget


class Run(NamedTuple):
    """What a solver returns: states of its chart at the sample times, NaN after a failure.

        chart      a state
        angles     theta, p_theta, phi, psi                   radians; phi and psi count whole turns
        axis       e_x, e_y, e_z, L_x, L_y, L_z               both vectors in the space frame
        attitude   w, x, y, z of q, and L_x, L_y, L_z         q turns body vectors into space vectors
        body       w, x, y, z of q, and M_1, M_2, M_3         the same q; M = q* L q in body axes, and p_psi is M_3

    p_phi and p_psi are recomputed from the trajectory (by the discrete Legendre transform, or as L_z and L.e) and never
    copied from the start, so that a method's errors in them are visible.
    """

    states: Array  # (samples, 4, 6 or 7)
    p_phi: Array  # (samples,)
    p_psi: Array  # (samples,)
    steps: int
    force_evaluations: int
    newton_iterations: int
    outcome: str
    reached: float


OUTCOMES = ("ok", "left_chart", "not_converged", "not_finite", "step_too_small", "out_of_budget", "not_normalised")
OK, LEFT_CHART, NOT_CONVERGED, NOT_FINITE, STEP_TOO_SMALL, OUT_OF_BUDGET, NOT_NORMALISED = range(len(OUTCOMES))


def ending(outcome: int) -> str:
    """The outcome with that number; SymtopError if a kernel has returned any other."""
    if not 0 <= outcome < len(OUTCOMES):
        raise SymtopError(f"a kernel must return an outcome from 0 to {len(OUTCOMES) - 1}, not {outcome}")
    return OUTCOMES[outcome]


_CAUSES = {  # and remedies
    "left_chart": ("theta left (0, pi), where the angles chart ends",
                   "take a smaller step or an integrator without poles"),
    "not_converged": ("the implicit equation of the step was not solved", "take a smaller step"),
    "not_finite": ("the state became infinite or not a number", "take a smaller step or a tighter tolerance"),
    "step_too_small": (
        "the step size fell below the spacing of the numbers: the state grows without bound, or is at a pole",
        "tighten the tolerance or take an integrator without poles"),
    "not_normalised": ("the quaternion's length left one by more than 0.1 %",
                       "take a smaller step or a tighter tolerance"),
    "out_of_budget": ("the limit on the work of one run was reached", "shorten the horizon or loosen the tolerance"),
}  # fmt: skip


LENGTH_OFF = 1e-3  # how far from one the length of a quaternion may be
QUATERNIONS = ("attitude", "body")  # charts that begin with one


def off_length(chart: str, states: Array) -> NDArray[np.bool_]:
    """True from the first finite sample on at which | |q| - 1 | > `LENGTH_OFF`; states (..., samples, dimension)."""
    if chart not in QUATERNIONS:
        return np.zeros(states.shape[:-1], dtype=bool)
    with np.errstate(all="ignore"):  # a run may have blown up
        length = np.sqrt((states[..., :4] ** 2).sum(axis=-1))
    return np.logical_or.accumulate(np.isfinite(length) & (np.abs(length - 1.0) > LENGTH_OFF), axis=-1)


def sentence(outcome: str, reached: float, horizon: float, unit: str = "", *, remedy: bool = True) -> str:
    """One sentence on how a run ended, at what time (`unit` follows it: " s"), why, and with what `remedy`."""
    if outcome == "ok":
        return f"reached t = {reached:.6g}{unit}"
    words = "; ".join(_CAUSES[outcome][: 1 + remedy])
    return f"stopped at t = {reached:.6g} of {horizon:.6g}{unit}: {words}"
