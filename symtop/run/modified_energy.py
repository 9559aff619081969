"""Modified energies: what a symplectic method conserves in place of the energy, so that rounding can be seen.

The energy of a method of order 2 oscillates by C h^2 as long as it runs; a drift of 1e-15 drowns in that. Two layers of
it come off. The first is known in closed form, for kick-drift-kick splittings H = T + V and for the midpoint rule:

    kick-drift-kick       H + h^2 (V_tt / 12 - |grad V|^2 / 24),  V_tt the second derivative of V along free motion
      stormer-verlet      V_tt = p^2 V''/I1^2,                       |grad V|^2 = V'^2 / I1
      strang              V_tt = mgl (L_z (L.e) - u |L|^2) / I1^2,   |grad V|^2 = mgl^2 (1 - u^2) / I1
    midpoint              H - h^2 (p^2 V''/I1^2 + V'^2 / I1) / 24
    cayley                exactly conserved: `splitting.space.cayley_energy` / I1

and leaves C h^4 (nothing for cayley); each form is the field `Integrator.modified_energy`. The second is whatever
remains: the motion has one degree of freedom, a symplectic map stays on a closed curve of its (theta, p_theta), or of
(u, u') with u = cos(theta), and any function of the state is on that curve a periodic function of the angle about its
middle. A Fourier series in that angle, fitted to the first nutations of a run, takes it off to 5e-17, which is the
rounding of one sample; only what moves the curve remains, and the mean of 512 samples shows 2e-18 of it.
Source of the first layer: Hairer, Lubich, Wanner, Geometric Numerical Integration, section IX.3.
"""

from collections.abc import Callable

import numpy as np

from symtop.methods.framework.registry import Integrator, integrator
from symtop.model.charts import Array, View, axis_of
from symtop.model.scenes import Scene

HARMONICS = 40


def energy(scene: Scene, chart: str, states: Array, momenta: Array | None = None) -> Array:
    """The energy of kernel states (n, dimension), less a constant.

    With the momenta that the run showed, (n, 2) of p_phi and p_psi; or, without them, with those of the start and less
    its constant parts, which has more digits and is the energy only where both momenta are constants of the method.
    """
    if momenta is None:
        return np.asarray(View(chart, scene.top, states).nutation_energy(scene.top.momenta(scene.start)))
    return np.asarray(View(chart, scene.top, states, momenta[:, 0], momenta[:, 1]).energy)


def modified_energy(
    scene: Scene, method: "str | Integrator", chart: str, states: Array, h: float, momenta: Array | None = None
) -> Array:
    """The modified energy of kernel states (n, dimension) up to O(h^4), less constants; H where none is known."""
    plain, correction = energy(scene, chart, states, momenta), integrator(method).modified_energy
    if correction is None:
        return plain
    return plain + correction(View(chart, scene.top, states), scene.top.momenta(scene.start), h)


def section(chart: str, states: Array) -> tuple[Array, Array]:
    """(theta, p_theta) or (u, I1 u') of kernel states: a plane in which one nutation is a closed curve.

    In the angles chart the series of stormer-verlet needs twice as many harmonics in u as in theta.
    """
    if chart == "angles":
        return states[:, 0], states[:, 1]
    e, L = axis_of(chart, states), states[:, -3:]
    return e[:, 2], L[:, 0] * e[:, 1] - L[:, 1] * e[:, 0]


def oscillation(x: Array, y: Array, values: Array, harmonics: int = HARMONICS) -> Callable[..., Array]:
    """What is left of values at points (x, y, values) of a closed curve, once a level and a Fourier series are off.

    Both are fitted to the values given here; too few points give a level and no series. The level comes in two parts, a
    large number and what is missing from it: rounded to one double it would be wrong by up to half a unit in its last
    place in every window of a run.
    """
    level = float(values[0])
    if x.size < 4 * harmonics or np.ptp(x) == 0.0 or not np.any(y):
        missing = float((values - level).mean())
        return lambda _x, _y, others: (others - level) - missing
    least, largest, height = float(x.min()), float(x.max()), float(np.abs(y).max())
    centre, width = 0.5 * (least + largest), 0.5 * (largest - least)

    def series(x: Array, y: Array) -> Array:
        turned = np.outer(np.arctan2(y / height, (x - centre) / width), np.arange(1, harmonics + 1))
        return np.concatenate([np.cos(turned), np.sin(turned)], axis=1)

    columns = np.concatenate([np.ones((x.size, 1)), series(x, y)], axis=1)
    fitted = np.linalg.lstsq(columns, values - level, rcond=None)[0]
    return lambda x, y, others: (others - level) - (fitted[0] + series(x, y) @ fitted[1:])
