"""What is computed and stored of one integrator on one of the notebook's two scenes.

Every integrator has its residuals: how far energy and momenta are from their start. The notebook's own solver has also
its path, the two derivations integrated side by side, and (second scene) the nutation cubic; two discrete methods
have their modified energy; the midpoint rule has the frames of a film.

Why a discrete Lagrangian bounds the energy: its map is symplectic, hence the flow of a modified Hamiltonian up to terms
that are exponentially small in 1/h. To h^2, with the effective potential V(theta) and p = p_theta,

    midpoint         H - h^2/24 [V'' p^2/I1^2 + V'^2/I1]
    Stormer-Verlet   H + h^2 [V'' p^2/(12 I1^2) - V'^2/(24 I1)]           (kick, drift, kick)

so that H itself can only oscillate, by O(h^2), and these by O(h^4). Source: Hairer, Lubich, Wanner, Geometric Numerical
Integration, chapter IX.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.measure.conservation import residuals
from symtop.methods.registry import integrators
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form
from symtop.run.modified_energy import modified_energy
from symtop.run.simulation import simulate

from .derivations import easy_way, energies, hard_way, nutation_cubic, rate_of_alpha, six_variables, with_alpha

SOLVER = "lsoda"  # the default solver of the notebook's system is of this family
SOLVER_TOLERANCE = 2.6e-7  # chosen: at it LSODA keeps as many figures as the notebook reports; its own is not known
STEPS_A_NUTATION = 118.02  # of every discrete method; no whole number, so that samples and nutation do not lock
MODIFIED = ("midpoint", "stormer-verlet")  # methods whose modified energy is stored
FILMED = "midpoint"
ALPHA = 1.6  # of the second scene, as the notebook prints it
TIGHT = 1e-13  # tolerance of both derivations
SAMPLES = 301


class Column:
    """Variables of the dataset, with unit and dimension. NAME stands for energy, p_phi or p_psi."""

    OUTCOME = "outcome"
    SAMPLE_TIME = "sample_time"  # s; sample. Beside it NAME itself
    # theta, phi (rad) and theta' (rad/s) of the notebook's solver and of the closed form; path
    PATH_TIME = "path_time"  # s
    SOLVER_THETA, SOLVER_PHI, SOLVER_THETA_DOT = "hard_theta", "hard_phi", "hard_theta_dot"
    TRUE_THETA, TRUE_PHI, TRUE_PSI, TRUE_THETA_DOT = "true_theta", "true_phi", "true_psi", "true_theta_dot"
    # largest differences of any angle (rad) between derivations and closed form, and the two energies; both
    BOTH_TIME = "both_time"  # s
    DERIVATIONS_GAP, HARD_GAP, EASY_GAP = "ways_gap", "hard_gap", "easy_gap"
    E, E1, ENERGY_GAP = "E", "E1", "energy_gap"  # the gap |E1 + p_psi^2/2 I3 - E| is relative
    # the cubic u'^2 (1/s^2) against u = cos theta; cubic_point
    COSINE, CUBIC_AT_REST, CUBIC_PRINTED = "cosine", "cubic_at_rest", "cubic_printed"
    ALPHA_AT_REST, ALPHA_RATE = "alpha_at_rest", "alpha_rate"  # 1/s^2, rad/s; scalars
    # theta (rad) of a start at rest and of both starts that the printed alpha allows; alpha_sample
    ALPHA_TIME = "alpha_time"  # s
    THETA_AT_REST, THETA_FALLING, THETA_RISING = "theta_at_rest", "theta_falling", "theta_rising"
    # largest relative changes of the energy and of the modified energy; shadow_setting
    MODIFIED_STEP = "shadow_step_size"  # s
    ENERGY_CHANGE, MODIFIED_CHANGE = "energy_swing", "modified_swing"
    MODIFIED_TIME = "shadow_time"  # s; shadow_sample
    # attitudes as quaternions; frame, part
    FRAME_TIME, FRAME_ATTITUDE, TRUE_ATTITUDE = "frame_time", "frame_attitude", "true_attitude"

    @staticmethod
    def residual(name: str) -> str:
        """Relative residual of a constant over time; dimension sample."""
        return f"{name}_residual"

    @staticmethod
    def largest(name: str) -> str:
        """The largest of these; a scalar."""
        return f"{name}_largest"

    @staticmethod
    def history(name: str) -> str:
        """Relative change over time, at the first step, of one of the two energies; dimension shadow_sample."""
        return f"{name}_history"


def discrete_methods() -> list[str]:
    """Names of the discrete Lagrangians and splittings of the registry."""
    return [m.name for m in integrators().values() if m.family in ("discrete-lagrangian", "splitting")]


def residual_history(scene: Scene, integrator: str, setting: float, samples: int = SAMPLES) -> xr.Dataset:
    """Energy, momenta and their relative residuals of one integrator over the scene's horizon; dimension ``sample``.

    `setting` is a step size in seconds or a tolerance, whichever the integrator takes.
    """
    control = integrators()[integrator].setting(setting).kwargs()
    run = simulate(scene, integrator, observe="nutation", samples=samples, guard=False, **control)
    columns: dict[str, Any] = {
        Column.SAMPLE_TIME: ("sample", run["time"].values),
        Column.OUTCOME: run.attrs["outcome"],
    }
    for name, values in residuals(scene, run).items():
        columns[name] = ("sample", run[name].values)
        columns[Column.residual(name)] = ("sample", values)
        columns[Column.largest(name)] = float(np.nanmax(np.abs(values)))
    return xr.Dataset(columns)


def notebook_path(scene: Scene, samples: int = 1201) -> xr.Dataset:
    """theta, theta', phi and psi by the notebook's solver on its six variables, and the truth; dimension ``path``."""
    from scipy.integrate import solve_ivp  # 0.6 s to import

    times = np.linspace(0.0, scene.horizon, samples)
    hard = solve_ivp(
        hard_way(scene), (0.0, scene.horizon), six_variables(scene), method="LSODA", rtol=SOLVER_TOLERANCE,
        atol=SOLVER_TOLERANCE, t_eval=times,
    ).y  # fmt: skip
    truth = closed_form(scene)(times)
    columns = {
        Column.PATH_TIME: times,
        Column.SOLVER_THETA: hard[1],
        Column.SOLVER_PHI: hard[0],
        Column.SOLVER_THETA_DOT: hard[4],
        Column.TRUE_THETA: truth.theta,
        Column.TRUE_PHI: truth.phi,
        Column.TRUE_PSI: truth.psi,
        Column.TRUE_THETA_DOT: truth.theta_dot,
    }
    return xr.Dataset({name: ("path", values) for name, values in columns.items()})


def both_derivations(scene: Scene, samples: int = SAMPLES) -> xr.Dataset:
    """The two derivations integrated at 1e-13, their distance, and the two energies; dimension ``both``."""
    from scipy.integrate import solve_ivp  # 0.6 s to import

    times = np.linspace(0.0, scene.horizon, samples)
    span, six = (0.0, scene.horizon), six_variables(scene)
    options = {"method": "DOP853", "rtol": TIGHT, "atol": TIGHT, "t_eval": times}
    hard = solve_ivp(hard_way(scene), span, six, **options).y
    easy = solve_ivp(easy_way(scene), span, (*six[:3], six[4]), **options).y
    truth = closed_form(scene)(times)
    true = np.array([truth.phi, truth.theta, truth.psi])
    E, E1, spin = energies(scene, hard)
    columns = {
        Column.BOTH_TIME: times,
        Column.DERIVATIONS_GAP: np.max(np.abs(hard[:3] - easy[:3]), axis=0),
        Column.HARD_GAP: np.max(np.abs(hard[:3] - true), axis=0),
        Column.EASY_GAP: np.max(np.abs(easy[:3] - true), axis=0),
        Column.E: E,
        Column.E1: E1,
        Column.ENERGY_GAP: np.abs(E1 + spin - E) / scene.energy_scale,
    }
    return xr.Dataset({name: ("both", values) for name, values in columns.items()})


def alpha_table(scene: Scene, alpha: float, samples: int = 501) -> xr.Dataset:
    """The cubic and theta(t) for a start at rest and for the printed alpha; ``cubic_point`` and ``alpha_sample``."""
    cubic, u = nutation_cubic(scene), np.linspace(0.2, 0.95, 301)
    times = np.linspace(0.0, 20.0, samples)
    columns: dict[str, Any] = {
        Column.COSINE: ("cubic_point", u),
        Column.CUBIC_AT_REST: ("cubic_point", cubic(u)),
        Column.CUBIC_PRINTED: ("cubic_point", cubic._replace(alpha=alpha)(u)),
        Column.ALPHA_TIME: ("alpha_sample", times),
        Column.ALPHA_AT_REST: cubic.alpha,
        Column.ALPHA_RATE: rate_of_alpha(scene, alpha),
        Column.THETA_AT_REST: ("alpha_sample", closed_form(scene)(times).theta),
    }
    for name, sign in ((Column.THETA_FALLING, -1.0), (Column.THETA_RISING, 1.0)):
        columns[name] = ("alpha_sample", closed_form(with_alpha(scene, alpha, sign))(times).theta)
    return xr.Dataset(columns)


def modified_energy_table(scene: Scene, integrator: str, steps: Sequence[float]) -> xr.Dataset:
    """Largest change of the energy and of the modified energy at several steps, and both over time at the first.

    Dimensions ``shadow_setting`` and ``shadow_sample``; relative to the scale of energies.
    """
    largest: dict[str, list[float]] = {Column.MODIFIED_STEP: [], Column.ENERGY_CHANGE: [], Column.MODIFIED_CHANGE: []}
    history: dict[str, Any] = {}
    for step in steps:
        run = simulate(scene, integrator, step_size=step, observe="nutation", samples=SAMPLES, guard=False)
        h = run.attrs["step_size"]
        states = np.stack([run["theta"].values, run["p_theta"].values], axis=1)
        curves = {
            Column.ENERGY_CHANGE: run["energy"].values,
            Column.MODIFIED_CHANGE: modified_energy(scene, integrator, "angles", states, h),
        }
        largest[Column.MODIFIED_STEP].append(h)
        for name, values in curves.items():
            change = (values - values[0]) / scene.energy_scale
            largest[name].append(float(np.max(np.abs(change))))
            history.setdefault(Column.history(name), ("shadow_sample", change))
        history.setdefault(Column.MODIFIED_TIME, ("shadow_sample", run["time"].values))
    return xr.Dataset({name: ("shadow_setting", values) for name, values in largest.items()} | history)


def film_table(scene: Scene, integrator: str, step: float, horizon: float, frames: int) -> xr.Dataset:
    """The attitude of a run and the true one at every frame of an animation; dimension ``frame``."""
    run = simulate(scene, integrator, step_size=step, horizon=horizon, observe="attitude", samples=frames, guard=False)
    attitude = charts.quaternion_from_angles(run["theta"].values, run["phi"].values, run["psi"].values)
    return xr.Dataset(
        {
            Column.FRAME_TIME: ("frame", run["time"].values),
            Column.FRAME_ATTITUDE: (("frame", "part"), attitude),
            Column.TRUE_ATTITUDE: (("frame", "part"), closed_form(scene).quaternion(run["time"].values)),
        }
    )
