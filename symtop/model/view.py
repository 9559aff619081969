"""What the states of a chart show: the one reader of (theta, p_theta, phi, psi), (e, L) and (q, L).

    chart      axis e        theta                     p_theta            energy
    angles     of the angles theta                     p_theta            p_theta^2/2 I1 + p_psi^2/2 I3 + V(theta)
    axis       e             atan2(|e_h|, e_z)         L.n                |L|^2/2 I1 + p_psi^2 (1/I3 - 1/I1)/2 + mgl e_z
    attitude   q k q*        2 atan2(|xy|, |wz|)       L.n                the same with e = q k q*

n is the line of nodes, e_h the horizontal part of e, V the potential of `symtop.model.top`. Each quantity is computed
when it is first asked for, so that a reader pays for what it uses.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from symtop.model import charts
from symtop.model.top import Momenta, SymmetricTop


def space_energy(top: SymmetricTop, axis: Any, momentum: Any, p_psi: Any) -> Any:
    """Energy of space-frame states: |L|^2/2 I1 + p_psi^2 (1/I3 - 1/I1)/2 + mgl e_z; axis and momentum (..., 3)."""
    x, y, z = momentum[..., 0], momentum[..., 1], momentum[..., 2]  # by components: `np.sum` over three takes 7 us more
    return (
        (x * x + y * y + z * z) / (2.0 * top.I1)
        + 0.5 * p_psi**2 * (1.0 / top.I3 - 1.0 / top.I1)
        + top.mgl * axis[..., 2]
    )


def axis_of(chart: str, states: Any) -> Any:
    """Unit vectors (..., 3) along the top's axis, of states (..., dimension) in any precision."""
    if chart == "angles":
        return charts.axis_from_angles(states[..., 0], states[..., 2])
    return states[..., :3] if chart == "axis" else charts.axis_from_quaternion(states[..., :4])


def space_momenta(chart: str, states: Any) -> tuple[Any, Any]:
    """p_phi = L_z and p_psi = L.e, read off states (..., 6 or 7) of a space-frame chart in their own precision."""
    momentum = states[..., -3:]
    return momentum[..., 2].copy(), (momentum * axis_of(chart, states)).sum(axis=-1)


@dataclass(frozen=True, eq=False)
class View:
    """States of one chart, shape (..., dimension), with the momenta p_phi and p_psi that the run showed, shape (...).

    The momenta are needed for the energy alone.
    Angles are as the chart has them: unbounded in `angles`, modulo a turn elsewhere (`charts.unwrapped` makes them
    continuous). All quantities have the shape (...), or (..., 3) and (..., 4) for vectors and quaternions.
    """

    chart: str
    top: SymmetricTop
    states: Any
    p_phi: Any = None
    p_psi: Any = None

    @cached_property
    def axis(self) -> Any:
        """Unit vector along the top's axis."""
        return axis_of(self.chart, self.states)

    @cached_property
    def quaternion(self) -> Any:
        """Unit quaternion from body to space; None on the axis, which does not show the spin angle."""
        if self.chart == "angles":
            return charts.quaternion_from_angles(self.theta, self.phi, self.psi)
        return self.states[..., :4] if self.chart == "attitude" else None

    @property
    def momentum(self) -> Any:
        """Angular momentum in the space frame; only the charts `axis` and `attitude` have it."""
        return self.states[..., -3:]

    @cached_property
    def _angles(self) -> tuple[Any, Any, Any]:
        return charts.angles_from_quaternion(self.quaternion)

    @cached_property
    def theta(self) -> Any:
        """Inclination, rad."""
        if self.chart == "angles":
            return self.states[..., 0]
        return charts.theta_from_axis(self.axis) if self.chart == "axis" else self._angles[0]

    @cached_property
    def phi(self) -> Any:
        """Precession angle, rad."""
        if self.chart == "angles":
            return self.states[..., 2]
        return charts.phi_from_axis(self.axis) if self.chart == "axis" else self._angles[1]

    @property
    def psi(self) -> Any:
        """Spin angle, rad; None on the axis."""
        if self.chart == "angles":
            return self.states[..., 3]
        return None if self.chart == "axis" else self._angles[2]

    @cached_property
    def p_theta(self) -> Any:
        """Momentum of the nutation, I1 theta'."""
        if self.chart == "angles":
            return self.states[..., 1]
        return self.momentum[..., 0] * np.cos(self.phi) + self.momentum[..., 1] * np.sin(self.phi)

    @cached_property
    def energy(self) -> Any:
        """Total energy, with the momenta that the run showed."""
        if self.chart == "angles":
            return self.top.reduced_energy(self.theta, self.p_theta, self.p_phi, self.p_psi)
        return space_energy(self.top, self.axis, self.momentum, self.p_psi)

    def nutation_energy(self, momenta: Momenta) -> Any:
        """The energy less the parts that the constant momenta fix; `momenta` are those of the start.

        Next to a pole it keeps the digits that `energy` loses in p_phi - p_psi.
        """
        if self.chart == "angles":
            return self.p_theta * self.p_theta / (2.0 * self.top.I1) + self.top.potential(self.theta, momenta)
        return space_energy(self.top, self.axis, self.momentum, 0.0)
