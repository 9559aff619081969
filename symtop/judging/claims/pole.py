"""The pole claim: the axis passes theta = 0 exactly, and comes out right on the other side.

A method in the space frame claims to pass, one in angles claims nothing; both are run, with a step and with half of it.
"""

import math
from typing import NamedTuple

import numpy as np

from symtop.judging.claims.subject import Subject, declared
from symtop.judging.findings import Finding, Measured
from symtop.measure.errors import errors
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene
from symtop.model.top import Angles, SymmetricTop
from symtop.run.simulation import simulate

# the axis passes theta = 0 exactly: I1 = I3 = mgl = 1, w3 = 1, p_phi = p_psi, theta' = -1.2 at theta = 1
_POLE_RATE = 0.5 / math.cos(0.5) ** 2
POLE = Scene(
    "pole",
    SymmetricTop(1.0, 1.0, 1.0),
    Angles(theta=1.0, theta_dot=-1.2, phi_dot=_POLE_RATE, psi_dot=1.0 - _POLE_RATE * math.cos(1.0)),
    4.0,
)
POLE_STEPS = 400
POLE_RIGHT = 1e-7  # rad: right, whatever the step


class Passage(NamedTuple):
    """What a method did in one chart when the axis passed a pole."""

    chart: str
    outcome: str
    error: float  # of the axis, rad
    finer: float  # with half the step or a tenth of the tolerance

    @property
    def passes(self) -> bool:
        """Did it come out on the other side, with an error that falls with the step?"""
        return self.outcome == "ok" and (self.finer < 0.7 * self.error or self.finer < POLE_RIGHT)


def passages(method: Integrator) -> list[Passage]:
    """What happens at a pole, in every chart of the method."""
    rows = []
    for chart in method.charts():
        only = method.variant(chart)
        ends, errors_there = [], []
        for finer in (1.0, 2.0):
            step, tolerance = POLE.horizon / (POLE_STEPS * finer), max(10.0 ** (-5.0 - finer), method.least_tolerance)
            control = method.setting(step if method.fixed_step else tolerance).kwargs()
            observe = "axis" if chart != "attitude" else "attitude"
            run = simulate(POLE, only, samples=201, observe=observe, guard=False, **control)
            ends.append(str(run.attrs["outcome"]))
            miss = errors(run)["axis"].values
            errors_there.append(float(np.nanmax(miss)) if np.isfinite(miss).any() else math.nan)
        rows.append(Passage(chart, next((end for end in ends if end != "ok"), "ok"), *errors_there))
    return rows


def measure(subject: Subject) -> list[Finding]:
    """The finding on the pole; of a bare step it is measured alone, for its chart may be the simplest and no claim."""
    claim, passed = "" if subject.stepper else declared(subject.method, "pole"), passages(subject.method)
    sentence = "; ".join(
        f"{one.chart}: passes, off by {one.error:.0e} and {one.finer:.0e} with finer steps" if one.passes
        else f"{one.chart}: ends there ({one.outcome})" if one.outcome != "ok"
        else f"{one.chart}: comes out wrong by {one.error:.0e}, {one.finer:.0e} with finer steps"
        for one in passed
    )  # fmt: skip
    judged = [one for one in passed if one.chart != "angles"] or passed
    words = ["passes" if one.passes else "wrong" if one.outcome == "ok" else "ends there" for one in judged]
    if not claim:
        verdict = "measured"
    elif any(one.outcome not in ("ok", "left_chart", "not_finite") for one in judged):
        verdict = "undecided"
    else:
        verdict = "confirmed" if all(one.passes for one in judged) else "refuted"
    measured = Measured(", ".join(dict.fromkeys(words)))
    return [Finding("pole", claim, measured, verdict, sentence, max(one.finer for one in judged), POLE_RIGHT)]
