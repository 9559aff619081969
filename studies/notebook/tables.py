"""What the notebook that this project began with computed, done again by its own means and beside ours.

The notebook integrates the second-order Euler-Lagrange equations in (phi, theta, psi) as they stand, "the hard way",
and once more with both momenta eliminated: a = p_psi/I1, b = p_phi/I1, beta = 2 mgl/I1 and

    phi' = (b - a cos theta)/sin^2 theta,     psi' = a I1/I3 - phi' cos theta
    theta'' = (a^2 + b^2) cos theta/sin^3 theta - a b (3 + cos 2 theta)/(2 sin^3 theta) + (beta/2) sin theta

Its second energy is E1 = I1 (theta'^2 + ((b - a cos theta)/sin theta)^2)/2 + mgl cos theta = E - p_psi^2/2 I3, and the
cubic of the nutation is u'^2 = (1 - u^2)(alpha - beta u) - (b - a u)^2 with u = cos theta and alpha = 2 E1/I1.

Why a discrete Lagrangian bounds the energy: its map is symplectic, hence the flow of a modified Hamiltonian up to terms
that are exponentially small in 1/h. To h^2, with the effective potential V(theta) and p = p_theta,

    midpoint         H - h^2/24 [V'' p^2/I1^2 + V'^2/I1]
    Stormer-Verlet   H + h^2 [V'' p^2/(12 I1^2) - V'^2/(24 I1)]           (kick, drift, kick)

so that H itself can only oscillate, by O(h^2), and these by O(h^4). Source: Hairer, Lubich, Wanner, Geometric Numerical
Integration, chapter IX.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from symtop.base.validate import SymtopError
from symtop.measure.conservation import CONSTANTS, residuals, trend
from symtop.measure.errors import energy_scale
from symtop.measure.modified_energy import modified_energy
from symtop.methods.registry import integrators
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form
from symtop.model.top import SymmetricTop
from symtop.run.simulation import simulate

Array = NDArray[np.float64]

SOLVER = "lsoda"  # the default solver of the notebook's system is of this family
NOTEBOOK_FIGURES = {"energy": 5, "p_phi": 6, "p_psi": 6}  # that the notebook reports as constant
SOLVER_TOLERANCE = 2.6e-7  # chosen so that LSODA keeps that many; `solver_scan` shows what others do
SCAN = tuple(SOLVER_TOLERANCE * 1.5**k for k in range(-3, 4))
TIGHT = 1e-13
SAMPLES = 301


def discrete_methods() -> list[str]:
    """Names of the discrete Lagrangians and splittings of the registry."""
    return [m.name for m in integrators().values() if m.family in ("discrete-lagrangian", "splitting")]


def figures_kept(values: Any) -> int:
    """How many significant figures of a constant stay put while it varies about its mean."""
    mean = float(np.mean(values))
    spread = float(np.max(np.abs(np.asarray(values) - mean)))
    leading = math.floor(math.log10(abs(mean)))
    return 17 if spread == 0.0 else max(0, math.ceil(leading + 1 - math.log10(spread)) - 1)


def residual_history(scene: Scene, method: str, setting: float, samples: int = SAMPLES) -> xr.Dataset:
    """Energy, momenta and their relative residuals of one method over the scene's horizon; dimension ``sample``."""
    knob = {"step_size": setting} if integrators()[method].knob == "step_size" else {"tolerance": setting}
    run = simulate(scene, method, observe="nutation", samples=samples, guard=False, **knob)
    found: dict[str, Any] = {"sample_time": ("sample", run["time"].values), "outcome": run.attrs["outcome"]}
    for name, values in residuals(scene, run).items():
        found[name] = ("sample", run[name].values)
        found[f"{name}_residual"] = ("sample", values)
        found[f"{name}_largest"] = float(np.nanmax(np.abs(values)))
    return xr.Dataset(found)


def solver_scan(scene: Scene, tolerances: Sequence[float] = SCAN) -> xr.Dataset:
    """What the notebook's solver keeps at other tolerances, in figures, and where its trends go.

    Dimension ``tolerance_setting``: ``scan_tolerance``, ``scan_NAME_figures``, and ``scan_NAME_rise`` over the run with
    its 95 % interval ``scan_NAME_doubt``.
    """
    found: dict[str, list[float]] = {"scan_tolerance": [float(value) for value in tolerances]}
    for tolerance in tolerances:
        run = residual_history(scene, SOLVER, float(tolerance))
        for name in CONSTANTS:
            line = trend(run["sample_time"], run[name])
            doubt = line.interval * float(run["sample_time"][-1])
            row = {"figures": float(figures_kept(run[name].values)), "rise": line.rise, "doubt": doubt}
            for part, value in row.items():
                found.setdefault(f"scan_{name}_{part}", []).append(value)
    return xr.Dataset({name: ("tolerance_setting", values) for name, values in found.items()})


def notebook_path(scene: Scene, samples: int = 1201) -> xr.Dataset:
    """theta, theta', phi and psi by the notebook's solver on its six variables, and the truth; dimension ``path``."""
    from scipy.integrate import solve_ivp  # 0.6 s to import

    times = np.linspace(0.0, scene.horizon, samples)
    hard = solve_ivp(
        hard_way(scene), (0.0, scene.horizon), _six(scene), method="LSODA", rtol=SOLVER_TOLERANCE,
        atol=SOLVER_TOLERANCE, t_eval=times,
    ).y  # fmt: skip
    truth = closed_form(scene)(times)
    found = {"path_time": times, "hard_theta": hard[1], "hard_phi": hard[0], "hard_theta_dot": hard[4]}
    found |= {
        "true_theta": truth.theta,
        "true_phi": truth.phi,
        "true_psi": truth.psi,
        "true_theta_dot": truth.theta_dot,
    }
    return xr.Dataset({name: ("path", values) for name, values in found.items()})


def _six(scene: Scene) -> tuple[float, ...]:
    at = scene.start
    return at.phi, at.theta, at.psi, at.phi_dot, at.theta_dot, at.psi_dot


def hard_way(scene: Scene) -> Callable[[float, Any], Any]:
    """y' for y = (phi, theta, psi, phi', theta', psi'): the notebook's three equations, a linear system for q''."""
    I1, I3, mgl = scene.top.I1, scene.top.I3, scene.top.mgl

    def rates(_: float, y: Any) -> Any:
        theta, phi_dot, theta_dot, psi_dot = y[1], y[3], y[4], y[5]
        s, c = math.sin(theta), math.cos(theta)
        mass = np.array([[I1 * s * s + I3 * c * c, 0.0, I3 * c], [0.0, I1, 0.0], [I3 * c, 0.0, I3]])
        force = np.array([
            -s * theta_dot * (2.0 * (I1 - I3) * c * phi_dot - I3 * psi_dot),
            s * ((I1 - I3) * c * phi_dot**2 - I3 * phi_dot * psi_dot + mgl),
            I3 * s * theta_dot * phi_dot,
        ])  # fmt: skip
        return np.concatenate([y[3:], np.linalg.solve(mass, force)])

    return rates


def easy_way(scene: Scene) -> Callable[[float, Any], Any]:
    """y' for y = (phi, theta, psi, theta'): two first-order equations and one of second order, in a, b and beta."""
    top = scene.top
    momenta = top.momenta(scene.start)
    a, b, beta = momenta.p_psi / top.I1, momenta.p_phi / top.I1, 2.0 * top.mgl / top.I1

    def rates(_: float, y: Any) -> Any:
        s, c = math.sin(y[1]), math.cos(y[1])
        turn = (b - a * c) / (s * s)
        bend = (a * a + b * b) * c / s**3 - 0.5 * a * b * (3.0 + math.cos(2.0 * y[1])) / s**3 + 0.5 * beta * s
        return np.array([turn, y[3], a * top.I1 / top.I3 - turn * c, bend])

    return rates


def both_ways(scene: Scene, samples: int = SAMPLES) -> xr.Dataset:
    """The two derivations integrated at 1e-13, their distance, and the two energies; dimension ``both``."""
    from scipy.integrate import solve_ivp  # 0.6 s to import

    times = np.linspace(0.0, scene.horizon, samples)
    span, six = (0.0, scene.horizon), _six(scene)
    options = {"method": "DOP853", "rtol": TIGHT, "atol": TIGHT, "t_eval": times}
    hard = solve_ivp(hard_way(scene), span, six, **options).y
    easy = solve_ivp(easy_way(scene), span, (*six[:3], six[4]), **options).y
    truth = closed_form(scene)(times)
    true = np.array([truth.phi, truth.theta, truth.psi])
    E, E1, rest = energies(scene, hard)
    found = {
        "both_time": times,
        "ways_gap": np.max(np.abs(hard[:3] - easy[:3]), axis=0),
        "hard_gap": np.max(np.abs(hard[:3] - true), axis=0),
        "easy_gap": np.max(np.abs(easy[:3] - true), axis=0),
        "E": E,
        "E1": E1,
        "energy_gap": np.abs(E1 + rest - E) / energy_scale(scene),
    }
    return xr.Dataset({name: ("both", values) for name, values in found.items()})


def energies(scene: Scene, states: Array) -> tuple[Array, Array, Array]:
    """E, E1 and p_psi^2/2 I3 of states (phi, theta, psi, phi', theta', psi'), each from its own formula."""
    top = scene.top
    _, theta, _, phi_dot, theta_dot, psi_dot = states
    s, c = np.sin(theta), np.cos(theta)
    spin = psi_dot + phi_dot * c
    E = 0.5 * top.I1 * (theta_dot**2 + (phi_dot * s) ** 2) + 0.5 * top.I3 * spin**2 + top.mgl * c
    p_psi = top.I3 * spin
    p_phi = top.I1 * phi_dot * s * s + p_psi * c
    E1 = 0.5 * top.I1 * (theta_dot**2 + ((p_phi - p_psi * c) / (top.I1 * s)) ** 2) + top.mgl * c
    return E, E1, 0.5 * p_psi**2 / top.I3


class Cubic(NamedTuple):
    """The nutation cubic of a start: u'^2 = (1 - u^2)(alpha - beta u) - (b - a u)^2."""

    alpha: float
    beta: float
    a: float
    b: float

    def __call__(self, u: Any) -> Any:
        """u'^2 at the given cosines."""
        return (1.0 - u * u) * (self.alpha - self.beta * u) - (self.b - self.a * u) ** 2


def nutation_cubic(scene: Scene) -> Cubic:
    """alpha, beta, a, b of a scene's own start."""
    top, at = scene.top, scene.start
    momenta = top.momenta(at)
    beta = 2.0 * top.mgl / top.I1
    alpha = at.theta_dot**2 + (at.phi_dot * math.sin(at.theta)) ** 2 + beta * math.cos(at.theta)
    return Cubic(alpha, beta, momenta.p_psi / top.I1, momenta.p_phi / top.I1)


def rate_of_alpha(scene: Scene, alpha: float) -> float:
    """|theta'| that a scene would need at its start for the given alpha; SymtopError if there is none."""
    cubic = nutation_cubic(scene)._replace(alpha=alpha)
    u = math.cos(scene.start.theta)
    square = float(cubic(u)) / (1.0 - u * u)
    if square < 0.0:
        raise SymtopError(f"alpha = {alpha!r} is less energy than {scene.name} has at rest")
    return math.sqrt(square)


def with_alpha(scene: Scene, alpha: float, sign: float) -> Scene:
    """The scene started with the rate theta' of that sign that the given alpha means."""
    rate = math.copysign(rate_of_alpha(scene, alpha), sign)
    return dataclasses.replace(scene, start=dataclasses.replace(scene.start, theta_dot=rate))


def alpha_table(scene: Scene, alpha: float, samples: int = 501) -> xr.Dataset:
    """The cubic and theta(t) for a start at rest and for the printed alpha; ``cubic_point`` and ``alpha_sample``."""
    cubic, u = nutation_cubic(scene), np.linspace(0.2, 0.95, 301)
    times = np.linspace(0.0, 20.0, samples)
    found: dict[str, Any] = {
        "cosine": ("cubic_point", u),
        "cubic_at_rest": ("cubic_point", cubic(u)),
        "cubic_printed": ("cubic_point", cubic._replace(alpha=alpha)(u)),
        "alpha_time": ("alpha_sample", times),
        "alpha_at_rest": cubic.alpha,
        "alpha_rate": rate_of_alpha(scene, alpha),
        "theta_at_rest": ("alpha_sample", closed_form(scene)(times).theta),
    }
    for name, sign in (("falling", -1.0), ("rising", 1.0)):
        found[f"theta_{name}"] = ("alpha_sample", closed_form(with_alpha(scene, alpha, sign))(times).theta)
    return xr.Dataset(found)


def shadow_table(scene: Scene, method: str, steps: Sequence[float]) -> xr.Dataset:
    """Largest change of the energy and of the modified energy at several steps, and both over time at the first.

    Dimensions ``shadow_setting`` and ``shadow_sample``; relative to the scale of energies.
    """
    found: dict[str, list[float]] = {"shadow_step_size": [], "energy_swing": [], "modified_swing": []}
    history: dict[str, Any] = {}
    for step in steps:
        run = simulate(scene, method, step_size=step, observe="nutation", samples=SAMPLES, guard=False)
        h = run.attrs["step_size"]
        states = np.stack([run["theta"].values, run["p_theta"].values], axis=1)
        shadow = modified_energy(scene, method, "angles", states, h)
        curves = {"energy_swing": run["energy"].values, "modified_swing": shadow}
        found["shadow_step_size"].append(h)
        for name, values in curves.items():
            change = (values - values[0]) / energy_scale(scene)
            found[name].append(float(np.max(np.abs(change))))
            history.setdefault(f"{name}_history", ("shadow_sample", change))
        history.setdefault("shadow_time", ("shadow_sample", run["time"].values))
    return xr.Dataset({name: ("shadow_setting", values) for name, values in found.items()} | history)


def film_table(scene: Scene, method: str, step: float, horizon: float, frames: int) -> xr.Dataset:
    """The attitude of a run and the true one at every frame of an animation; dimension ``frame``."""
    run = simulate(scene, method, step_size=step, horizon=horizon, observe="attitude", samples=frames, guard=False)
    q = charts.quaternion_from_angles(run["theta"].values, run["phi"].values, run["psi"].values)
    truth = closed_form(scene).quaternion(run["time"].values)
    return xr.Dataset(
        {
            "frame_time": ("frame", run["time"].values),
            "frame_attitude": (("frame", "part"), q),
            "true_attitude": (("frame", "part"), truth),
        }
    )


def notebook_top() -> tuple[SymmetricTop, tuple[float, float]]:
    """The first top from the notebook's spheroid, and the radii that its inertia gives back."""
    polar, equatorial = SymmetricTop(2.0, 1.0, 0.0).spheroid_radii(1.0)
    top = SymmetricTop.from_spheroid(1.0, polar, equatorial, 9.81)
    return top, top.spheroid_radii(1.0)
