"""Error bounds of the closed form in double, from its arithmetic, and the check of every value that they stand beside.

Three errors add up at a time t:

    rounding     of the evaluation, which does not grow: `ROUNDING`. 10,010 tops of 26 families showed 7.1e-16 of theta
                 and 8.8e-16 of a component of the axis against 50 digits at times up to 1e6 nutations
                 (`benchmarks/accuracy.py`), and of phi and psi 4.8e-16 beyond their last digit
    rates        of two doubles: their relative bound (`ClosedForm.provenance`, below 1e-28) times t moves the motion
                 along its path, an angle of that times the angular velocity
    formulas     whatever else may be wrong: none is known

The third is looked for at every time asked for. The angles, the axis and the quaternion are evaluated apart and must
name one attitude; theta' and phi' must give back the energy and p_phi. Where they do not, to `SUSPICIOUS`, nothing is
claimed: the bound is pi.
"""

import math
from typing import Any

import numpy as np

from symtop.core.numbers import EPSILON, TINY
from symtop.model import charts
from symtop.model.exact.closed_form import ClosedForm
from symtop.model.exact.constants import RATE
from symtop.model.scenes import Scene, closed_form

ROUNDING = {"theta": 2e-15, "axis": 2e-15, "attitude": 4e-15, "phi": 2e-15, "psi": 2e-15}  # rad
SUSPICIOUS = 1e-12  # a disagreement beyond this is an error, not rounding


def closed_values(scene: Scene, times: charts.Array) -> dict[str, Any]:
    """Angles, axis and quaternion of the closed form, by name."""
    form = closed_form(scene)
    motion = form(times)
    return {
        "theta": motion.theta,
        "phi": motion.phi,
        "psi": motion.psi,
        "axis": form.axis(times),
        "quaternion": form.quaternion(times),
    }


def closed_bounds(scene: Scene, times: charts.Array, values: dict[str, Any]) -> dict[str, charts.Array]:
    """Bounds at `times` of the `values` there: radians for theta, axis, attitude, phi and psi."""
    form = closed_form(scene)
    drift = (form.provenance.rate_error + RATE) * np.abs(times) * _fastest(form)
    sine = np.maximum(np.sin(values["theta"]), TINY)
    bounds = {name: ROUNDING[name] + drift for name in ("theta", "axis", "attitude")}
    for name in ("phi", "psi"):
        bounds[name] = ROUNDING[name] + 2.0 * EPSILON * np.abs(values[name]) + 2.0 * drift / sine
    wrong = ~(disagreement(form, times, values) <= SUSPICIOUS)
    return {name: np.where(wrong, math.pi, bound) for name, bound in bounds.items()} if wrong.any() else bounds


def _fastest(form: ClosedForm) -> float:
    """A bound of the angular velocity, from the energy."""
    top, spin = form.top, form.p_psi / form.top.I3
    kinetic = form.energy - 0.5 * form.p_psi * spin + abs(top.mgl)
    return math.sqrt(max(2.0 * kinetic / top.I1, 0.0)) + abs(spin)


def disagreement(form: ClosedForm, times: charts.Array, values: dict[str, Any]) -> charts.Array:
    """How far the views are apart at each time, rad, or the integrals from the start's, relative to their terms."""
    axis, (x, y, z) = charts.axis_from_quaternion(values["quaternion"]), values["axis"].T
    apart = np.sqrt(((axis - values["axis"]) ** 2).sum(axis=1))
    named = charts.quaternion_from_angles(values["theta"], values["phi"], values["psi"])
    rounded = 2.0 * EPSILON * (np.abs(values["phi"]) + np.abs(values["psi"]))
    apart = np.maximum(apart, charts.attitude_distance(named, values["quaternion"]) - rounded)
    motion, top = form(times), form.top
    level = x * x + y * y  # sin^2 theta with all digits, next to a pole as well
    turning = top.I1 * motion.phi_dot * level
    moving = 0.5 * (top.I1 * motion.theta_dot**2 + turning * motion.phi_dot)
    spinning, lifting = 0.5 * form.p_psi**2 / top.I3, top.mgl * z
    energy = np.abs(moving + spinning + lifting - form.energy) / (moving + spinning + abs(top.mgl) + TINY)
    p_phi = np.abs(turning + form.p_psi * z - form.p_phi) / (np.abs(turning) + abs(form.p_psi) + TINY)
    largest: charts.Array = np.maximum(apart, np.maximum(energy, p_phi))
    return largest
