"""Modified energies, which symplectic methods conserve instead of the energy: they make errors of rounding visible.

The energy of a method of order 2 oscillates by C h^2, which hides a drift of 1e-15. The oscillation is removed in two
steps. The first part is known in closed form, for kick-drift-kick splittings H = T + V and for the midpoint rule:

    kick-drift-kick       H + h^2 (V_tt / 12 - |grad V|^2 / 24),  V_tt the second derivative of V along free motion
      stormer-verlet      V_tt = p^2 V''/I1^2,                       |grad V|^2 = V'^2 / I1
      strang              V_tt = mgl (L_z (L.e) - u |L|^2) / I1^2,   |grad V|^2 = mgl^2 (1 - u^2) / I1
    midpoint              H - h^2 (p^2 V''/I1^2 + V'^2 / I1) / 24
    cayley                exactly conserved: `splitting.space.cayley_energy` / I1

and leaves C h^4 (nothing for cayley); each form is the field `Integrator.modified_energy`. The second part is the rest:
the motion has one degree of freedom, a symplectic map stays on a closed curve of its (theta, p_theta), or of (u, u')
with u = cos(theta), and any function of the state is on that curve a periodic function of the angle about its middle.
A Fourier series in that angle, fitted to the first nutations of a run, removes it to 5e-17, the rounding of one sample.
Only a drift of the curve remains; the mean of 512 samples shows one of 2e-18.
Source of the first part: Hairer, Lubich, Wanner, Geometric Numerical Integration, section IX.3.
"""

from collections.abc import Callable

import numpy as np

from symtop.methods.framework.registry import Integrator, integrator
from symtop.model.charts import Array, View, axis_of
from symtop.model.scenes import Scene

HARMONICS = 40


def energy(scene: Scene, chart: str, states: Array, momenta: Array | None = None) -> Array:
    """The energy (n,) of kernel states (n, dimension), up to a constant.

    `momenta` (n, 2) are p_phi and p_psi of the run. Without them those of the start are used and its constant parts
    are subtracted: this has more digits, but is the energy only if the method conserves both momenta.
    """
    if momenta is None:
        return np.asarray(View(chart, scene.top, states).nutation_energy(scene.top.momenta(scene.start)))
    return np.asarray(View(chart, scene.top, states, momenta[:, 0], momenta[:, 1]).energy)


def modified_energy(
    scene: Scene, method: str | Integrator, chart: str, states: Array, h: float, momenta: Array | None = None
) -> Array:
    """The modified energy (n,) of kernel states (n, dimension) to O(h^4), up to a constant; H if none is known."""
    plain, correction = energy(scene, chart, states, momenta), integrator(method).modified_energy
    if correction is None:
        return plain
    return plain + correction(View(chart, scene.top, states), scene.top.momenta(scene.start), h)


def section(chart: str, states: Array) -> tuple[Array, Array]:
    """(theta, p_theta), or off the angles chart (u, I1 u'), of kernel states: one nutation is a closed curve there."""
    if chart == "angles":
        return states[:, 0], states[:, 1]
    e, L = axis_of(chart, states), states[:, -3:]
    return e[:, 2], L[:, 0] * e[:, 1] - L[:, 1] * e[:, 0]


def oscillation(x: Array, y: Array, values: Array, harmonics: int = HARMONICS) -> Callable[..., Array]:
    """A function (x, y, values) that subtracts a level and a Fourier series from values at points of a closed curve.

    Both are fitted to the arguments given here; with too few points there is no series. The level is a sum of two
    doubles: rounded to one it would be wrong by up to half a unit in its last place in every window of a run.
    """
    level = float(values[0])
    if x.size < 4 * harmonics or np.ptp(x) == 0.0 or not np.any(y):
        mean = float((values - level).mean())
        return lambda _x, _y, samples: (samples - level) - mean
    smallest, largest, height = float(x.min()), float(x.max()), float(np.abs(y).max())
    centre, width = 0.5 * (smallest + largest), 0.5 * (largest - smallest)

    def series(x: Array, y: Array) -> Array:
        angles = np.outer(np.arctan2(y / height, (x - centre) / width), np.arange(1, harmonics + 1))
        return np.concatenate([np.cos(angles), np.sin(angles)], axis=1)

    columns = np.concatenate([np.ones((x.size, 1)), series(x, y)], axis=1)
    coefficients = np.linalg.lstsq(columns, values - level, rcond=None)[0]
    return lambda x, y, samples: (samples - level) - (coefficients[0] + series(x, y) @ coefficients[1:])
