"""Changes of the constants of the motion and of its phase in a long run: histories, and laws of growth.

The root mean square over the members of an ensemble grows as n^1/2 where each is a random walk. One walk may return to
zero and its largest value says little; drawing members with replacement (bootstrap) gives the interval. Source of the
laws of rounding: Brouwer, Astron. J. 46 (1937) 149; of the interval: Efron, Ann. Statist. 7 (1979) 1.

The time at which an error reaches a tolerance is predicted by the parabola error = a + b t + c t^2 through a short run:
b is a wrong frequency and c the drift of the frequency that comes with a drift of energy. A c or an a of less than four
standard errors is left out; these are error_k^2 = rest.rest/(n - m) (A^T A)^-1_kk of the columns A (n, m).
"""

import math
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from symtop.measure.conservation import Trend, constant_of, residuals
from symtop.measure.order import Fit, power_law
from symtop.measure.phase import nutates, split_states
from symtop.methods.framework.registry import Integrator
from symtop.model.charts import Array
from symtop.model.scenes import Scene
from symtop.run.simulation import integrate

DRAWS, SEED = 2000, 1937  # of the bootstrap
BLOCKS = 50  # equal stretches of a run, over each of which an error is averaged


def nutation_phase(scene: Scene, time: Array, theta: Array, theta_dot: Array) -> Array:
    """How far states (n,) are ahead of the truth at the same times, rad of the nutation, unwrapped.

    NaN where a state is not finite, and everywhere if the motion has no nutation (see `nutates`).
    """
    phase, good = np.full(np.shape(time), math.nan), np.isfinite(theta) & np.isfinite(theta_dot)
    if nutates(scene) and good.any():
        u, du = np.cos(theta[good]), -np.sin(theta[good]) * theta_dot[good]
        early = split_states(scene, time[good], u, du, np.zeros_like(u)).lag
        phase[good] = 2.0 * math.pi / scene.nutation_period * early
    return phase


def history(scene: Scene, method: Integrator, **settings: Any) -> xr.Dataset:
    """One run, with the changes of the constants of the motion and of its phase.

    Dimension ``sample``: ``sample_time`` and, for energy, p_phi and p_psi, ``NAME_residual``. For each of them the
    ``largest``, the linear ``slope`` with its ``interval`` and ``rise``, and the ``exponent`` of growth over the last
    two decades; for the phase of the nutation (rad; NaN where there is none) ``largest`` and ``exponent``, over the
    last decade, because a wrong frequency gives way to a drifting one only late. ``exponent_interval`` goes with each,
    and ``law``, its name.
    """
    run = integrate(scene, method, observe="nutation", **settings)
    time = run.time
    columns: dict[str, Any] = {"sample_time": ("sample", time), "outcome": run.outcome, "steps": run.steps}
    for name, values in residuals(scene, run).items():
        columns[f"{name}_residual"] = ("sample", values)
        columns |= {f"{name}_{part}": value for part, value in constant_of(time, values)._asdict().items()}
    phase = constant_of(time, nutation_phase(scene, time, run.theta, run.p_theta / scene.top.I1), 1.0)._asdict()
    columns |= {f"phase_{part}": value for part, value in phase.items() if part not in Trend._fields}
    return xr.Dataset(columns)


class Ensemble(NamedTuple):
    """Root mean square of drifts over the members of an ensemble, and its growth."""

    rms: np.ndarray  # (windows,)
    fit: Fit  # interval: half-width of the bootstrap's 95 %


def ensemble_growth(steps: ArrayLike, drifts: ArrayLike, least: float) -> Ensemble:
    """The exponent of the root mean square of `drifts` (members, windows) from `least` steps on."""
    n, values = np.asarray(steps, float), np.asarray(drifts, float)
    rms = np.sqrt(np.mean(values**2, axis=0))
    used = n >= least
    fit = power_law(n, rms, used)
    if not math.isfinite(fit.slope):
        return Ensemble(rms, fit)
    members = np.random.default_rng(SEED).integers(len(values), size=(DRAWS, len(values)))
    again = 0.5 * np.log(np.mean(values[members][..., fit.used] ** 2, axis=1))
    x = np.log(n[fit.used]) - np.log(n[fit.used]).mean()
    low, high = np.quantile(again @ x / (x @ x), (0.025, 0.975))
    return Ensemble(rms, fit._replace(interval=float(max(high - fit.slope, fit.slope - low))))


class Horizon(NamedTuple):
    """The predicted time at which an error reaches a tolerance, and the coefficients of the parabola."""

    time: float  # inf if it never does
    constant: float
    rate: float
    bend: float


def horizon(time: ArrayLike, error: ArrayLike, tolerance: float) -> Horizon:
    """When |error| will reach `tolerance`, from the parabola through a short run of signed errors."""
    t, e = _means(time, error)
    reach = t[-1]
    powers = [0, 1, 2]
    while True:
        columns = np.stack([(t / reach) ** k for k in powers], axis=1)
        fitted, deviations = columns_fitted(columns, e)
        terms = zip(powers, fitted, deviations, strict=True)
        weak = [k for k, value, deviation in terms if k != 1 and abs(value) <= 4.0 * deviation]
        if not weak:
            break
        powers.remove(max(weak))
    a, b, c = (float(fitted[powers.index(k)]) / reach**k if k in powers else 0.0 for k in range(3))
    times = [
        float(root.real)
        for level in (tolerance, -tolerance)
        for root in np.roots([c, b, a - level])
        if abs(root.imag) < 1e-12 * abs(root) and root.real > 0.0
    ]
    return Horizon(min(times, default=math.inf), a, b, c)


def lost_at(time: ArrayLike, error: ArrayLike, tolerance: float) -> float:
    """When |error| first reached `tolerance`, between means over short stretches; NaN if it never did, or at once."""
    t, e = _means(time, error)
    beyond = np.abs(e) >= tolerance
    if not beyond.any() or beyond[0]:
        return math.nan
    k = int(np.argmax(beyond))
    share = (tolerance - abs(e[k - 1])) / (abs(e[k]) - abs(e[k - 1]))
    return float(t[k - 1] + share * (t[k] - t[k - 1]))


def _means(time: ArrayLike, error: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Means over `BLOCKS` equal stretches: the oscillation within a nutation averages out."""
    t, e = np.asarray(time, float), np.asarray(error, float)
    good = np.isfinite(e)
    parts = np.array_split(np.flatnonzero(good), BLOCKS)
    return tuple(np.array([values[part].mean() for part in parts]) for values in (t, e))  # type: ignore[return-value]


def columns_fitted(columns: Array, values: Array) -> tuple[Array, Array]:
    """Coefficients (m,) of columns (n, m) in values (n,), and their standard errors."""
    coefficients = np.linalg.lstsq(columns, values, rcond=None)[0]
    residual = values - columns @ coefficients
    freedom = values.size - columns.shape[1]
    variances = float(residual @ residual) / freedom * np.linalg.inv(columns.T @ columns).diagonal()
    return np.asarray(coefficients), np.asarray(np.sqrt(variances))
