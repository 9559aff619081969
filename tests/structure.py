"""Structure of a one-step map: symplectic defect, reversibility. Used on good methods and on deliberately bad ones."""

import numpy as np

from symtop import charts
from symtop.integrators.registry import Plan
from symtop.top import Angles, SymmetricTop


def one_step(method, top: SymmetricTop, at: Angles, h: float) -> np.ndarray:
    """(theta, p_theta, phi, psi) after one step of an angles-chart method; h may be negative."""
    plan = Plan(np.array([h]), h, h, np.array([1]), np.nan)
    run = method.solvers["angles"](top, at, plan)
    assert run.outcome == "ok"
    return run.states[0]


def angles_at(top: SymmetricTop, point) -> Angles:
    """The Angles of a point (theta, phi, psi, p_theta, p_phi, p_psi)."""
    theta, phi, psi, p_theta, p_phi, p_psi = point
    phi_dot = (p_phi - p_psi * np.cos(theta)) / (top.I1 * np.sin(theta) ** 2)
    return Angles(theta, phi, psi, p_theta / top.I1, phi_dot, p_psi / top.I3 - phi_dot * np.cos(theta))


def whole_step(method, top: SymmetricTop, point, h: float) -> np.ndarray:
    """A point (theta, phi, psi, p_theta, p_phi, p_psi) after one step, both cyclic momenta as the run shows them."""
    plan = Plan(np.array([h]), h, h, np.array([1]), np.nan)
    run = method.solvers["angles"](top, angles_at(top, point), plan)
    assert run.outcome == "ok"
    theta, p_theta, phi, psi = run.states[0]
    return np.array([theta, phi, psi, p_theta, run.p_phi[0], run.p_psi[0]])


def symplectic_defect(method, top: SymmetricTop, at: Angles, h: float, delta: float) -> float:
    """max |J^T Omega J - Omega| of the six-dimensional step map, J by central differences of width delta.

    Coordinates (theta, phi, psi, p_theta, p_phi, p_psi); nothing is taken as conserved.
    """
    momenta = top.momenta(at)
    centre = np.array([at.theta, at.phi, at.psi, top.I1 * at.theta_dot, momenta.p_phi, momenta.p_psi])

    def image(point):
        return whole_step(method, top, point, h)

    columns = []
    for k in range(6):
        wiggle = np.zeros(6)
        wiggle[k] = delta
        # fourth-order central difference: truncation delta^4, rounding eps/delta
        columns.append(
            (
                8 * (image(centre + wiggle) - image(centre - wiggle))
                - (image(centre + 2 * wiggle) - image(centre - 2 * wiggle))
            )
            / (12 * delta)
        )
    J = np.stack(columns, axis=1)
    omega = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])
    return float(np.max(np.abs(J.T @ omega @ J - omega)))


def return_miss(method, top: SymmetricTop, at: Angles, h: float) -> float:
    """Distance from the start after a step of h and a step of -h."""
    momenta = top.momenta(at)
    theta, p_theta, phi, psi = one_step(method, top, at, h)
    turned = angles_at(top, (theta, phi, psi, p_theta, momenta.p_phi, momenta.p_psi))
    back = one_step(method, top, turned, -h)
    moved = charts.axis_distance(charts.axis_from_angles(back[0], back[2]), charts.axis_from_angles(at.theta, at.phi))
    return float(moved + abs(back[1] - top.I1 * at.theta_dot) + abs(back[3] - at.psi))
