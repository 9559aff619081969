"""What the explorer can be asked: a run beside the truth, the same run as a dataset, and as a script.

A question is a flat mapping of numbers and names, as a page sends it. Every answer is made of the public contract,
`Scene`, `simulate` and the closed form, so that the script that is handed out gives the same bits.
"""

import base64
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from symtop import __version__
from symtop.base.validate import SymtopError, finite, positive
from symtop.measure.conservation import CONSTANTS, residuals
from symtop.methods.registry import Integrator, integrator, integrators
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form, scenes
from symtop.model.top import Angles, SymmetricTop
from symtop.run.simulation import simulate

TOP = ("I1", "I3", "mgl")
START = ("theta", "phi", "psi", "theta_dot", "phi_dot", "psi_dot")
MOST_STEPS = 2_000_000  # a quarter of a second of the common kernels
MOST_WORK = {"compiled": 2e6, "python": 2e5}  # force evaluations of an adaptive run: two seconds at most
A_NUTATION = 60  # samples, as far as they go
SAMPLES = (601, 4001)


@dataclass(frozen=True)
class Question:
    """One run: a scene with its horizon, a method, and its step or tolerance."""

    scene: Scene
    method: Integrator
    setting: float | None

    def knob(self, name: str) -> float | None:
        """The setting, if this is the method's knob."""
        return self.setting if self.method.knob == name else None

    @property
    def budget(self) -> float | None:
        """The work an adaptive run may take; more, and it ends there and says so."""
        return MOST_WORK[self.method.tier] if self.method.knob == "tolerance" else None

    @property
    def samples(self) -> int:
        """Enough to see every nutation, as far as a page can draw them."""
        period = self.scene.nutation_period
        wanted = A_NUTATION * self.scene.horizon / period if np.isfinite(period) and period > 0.0 else SAMPLES[0]
        return round(min(max(wanted, SAMPLES[0]), SAMPLES[1]))


def question(fields: Mapping[str, Any]) -> Question:
    """A question from what a page sent; SymtopError says what is missing or makes no sense."""
    if not isinstance(fields, Mapping):
        raise SymtopError(f"a question must be a mapping of names to values, not {fields!r}")
    missing = [name for name in (*TOP, *START, "horizon", "integrator") if name not in fields]
    if missing:
        raise SymtopError(f"the question lacks {', '.join(missing)}")
    top = SymmetricTop(*(finite(name, fields[name]) for name in TOP))
    start = Angles(*(finite(name, fields[name]) for name in START))
    method = integrator(str(fields["integrator"]))
    where = Scene("explored", top, start, positive("horizon", fields["horizon"]))
    if method.knob is None:
        return Question(where, method, None)
    setting = positive(method.knob, fields.get(method.knob))
    if method.knob == "step_size" and where.horizon / setting > MOST_STEPS:
        raise SymtopError(
            f"step_size must be at least {where.horizon / MOST_STEPS:.3g} here, not {setting!r}: "
            f"the explorer runs at most {MOST_STEPS} steps"
        )
    return Question(where, method, setting)


def dataset(asked: Question, tell: Callable[[str], object]) -> xr.Dataset:
    """The run as `simulate` returns it; what its guard has to say goes to `tell`."""
    return simulate(
        asked.scene, asked.method, step_size=asked.knob("step_size"), tolerance=asked.knob("tolerance"),
        observe="attitude", samples=asked.samples, guard=tell, budget=asked.budget,
    )  # fmt: skip


def answer(asked: Question) -> dict[str, Any]:
    """A run beside the truth: attitudes, residuals, errors, the outcome's sentence and the guard's.

    Arrays are base64 of float32, over `time`: ``attitude`` and ``truth`` (w, x, y, z in turn), ``theta``, ``energy``,
    ``p_phi`` and ``p_psi`` (relative residuals), ``axis_error`` and ``attitude_error`` in radians. NaN after a failure.
    """
    began = time.perf_counter()
    said: list[str] = []
    run = dataset(asked, said.append)
    ran = time.perf_counter()
    times = run["time"].values
    truth = closed_form(asked.scene).quaternion(times)
    attitude = _attitude(run)
    with np.errstate(over="ignore", invalid="ignore"):  # a run may have blown up
        arrays = {
            "time": times,
            "attitude": attitude,
            "truth": truth,
            "theta": run["theta"].values,
            **residuals(asked.scene, run),
            "axis_error": charts.axis_distance(run["axis"].values, charts.axis_from_quaternion(truth)),
            "attitude_error": charts.attitude_distance(attitude, truth),
        }
        packed = {name: _packed(values) for name, values in arrays.items()}
    return {
        "outcome": run.attrs["outcome"],
        "message": run.attrs["outcome_message"],
        "warnings": said,
        "steps": int(run.attrs["steps"]),
        "force_evaluations": int(run.attrs["force_evaluations"]),
        "period": float(np.nan_to_num(asked.scene.nutation_period, posinf=0.0)),
        "run_ms": 1e3 * (ran - began),
        "all_ms": 1e3 * (time.perf_counter() - began),
        "largest": {name: _largest(arrays[name]) for name in (*CONSTANTS, "axis_error")},
        "arrays": packed,
    }


def _attitude(run: xr.Dataset) -> charts.Array:
    if "quaternion" in run:
        found: charts.Array = run["quaternion"].values
        return found
    return charts.quaternion_from_angles(run["theta"].values, run["phi"].values, run["psi"].values)


def _packed(values: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode()


def _largest(values: Any) -> float | None:
    good = np.abs(values[np.isfinite(values)])
    return float(good.max()) if good.size else None


def script(asked: Question) -> str:
    """A Python script that makes the same dataset, to the bit."""
    top, start, where = asked.scene.top, asked.scene.start, asked.scene
    shown_top = ", ".join(f"{name}={getattr(top, name)!r}" for name in TOP)
    shown_start = ", ".join(f"{name}={getattr(start, name)!r}" for name in START)
    knob = "" if asked.method.knob is None else f", {asked.method.knob}={asked.setting!r}"
    knob += "" if asked.budget is None else f", budget={asked.budget!r}"
    return "\n".join(
        [
            f'"""A run that was found with symtop explore, symtop {__version__}."""',
            "",
            "import symtop",
            "",
            f"top = symtop.SymmetricTop({shown_top})",
            f"start = symtop.Angles({shown_start})",
            f'scene = symtop.Scene("{where.name}", top, start, horizon={where.horizon!r})',
            f'run = symtop.simulate(scene, "{asked.method.name}"{knob}, observe="attitude", samples={asked.samples})',
            'run.to_netcdf("explored.nc")',
            'print(run.attrs["title"] + ": " + run.attrs["outcome_message"])',
            "",
        ]
    )


def catalogue() -> dict[str, Any]:
    """The scenes and the integrators that can be chosen, with all that the page's controls need."""
    from symtop.report import style  # matplotlib: half a second

    known = [
        {
            "name": entry.name,
            "purpose": entry.purpose,
            "horizon": entry.horizon,
            "period": float(np.nan_to_num(entry.nutation_period, posinf=0.0)),
            **{name: getattr(entry.top, name) for name in TOP},
            **{name: getattr(entry.start, name) for name in START},
        }
        for entry in scenes().values()
    ]
    methods = [
        {
            "name": entry.name,
            "family": entry.family,
            "summary": entry.summary,
            "knob": entry.knob,
            "tier": entry.tier,
            "tolerance": max(entry.default_tolerance or 1e-6, entry.least_tolerance),
            "color": style.look(entry.name).color,
        }
        for entry in integrators().values()
        if {"angles", "attitude"} & set(entry.charts())
    ]
    return {"version": __version__, "scenes": known, "integrators": methods}
