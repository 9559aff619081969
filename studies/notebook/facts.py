"""Facts and the table of the study of the notebook: its numbers reproduced, and the errors of energy and momenta."""

import cmath
import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from symtop.measure.conservation import CONSTANTS
from symtop.measure.order import power_law
from symtop.methods.framework.registry import integrator
from symtop.model.charts import axis_from_angles

from .derivations import notebook_top
from .long_energy import better_from, energy_until, notebook_end
from .measures import ALPHA, MODIFIED, SOLVER, SOLVER_TOLERANCE, STEPS_A_NUTATION

PARTS = {"spheroid": "first", "goldstein": "second"}  # scenes of the notebook's parts
MOMENTA = ["p_phi_largest", "p_psi_largest"]
KEPT = 1e-12  # relative, over 8 s: a momentum that changes by less is kept to rounding
DRAWN = ("midpoint[angles]", "trapezoidal[angles]", "stormer-verlet[angles]", "strang[axis]", "cayley[axis]")
OF_SOLVER = (  # facts
    "followed", "ways", "energies", "solver_momenta", "alpha_at_rest", "alpha_rate", "long", "both_turned",
)  # fmt: skip
BY_PART = ("end", "energy", "behind", "ahead", "long", "turned")


def facts(data: xr.Dataset) -> dict[str, Any]:
    """The notebook's printed numbers, how far its own solver reproduces them, and the constants each method keeps."""
    top, (polar, equatorial) = notebook_top()
    runs = present(data)
    discrete = data.sel(variant=[name for name in runs if name != SOLVER])
    lost = discrete[MOMENTA].to_dataarray().max(("variable", "scene"), skipna=False)
    shown = lost.sel(variant=[name for name in DRAWN if name in runs])
    changes = powers(data)
    return {
        "tolerance": SOLVER_TOLERANCE,  # of the solver
        "steps": STEPS_A_NUTATION,  # of the others
        "polar": polar, "equatorial": equatorial,  # radii, m
        "I1": top.I1, "I3": top.I3, "mgl": top.mgl,
        "alpha": ALPHA,  # 1/s^2, as printed
        "compared": len(order_two(runs)) or None,
        "discrete": discrete.sizes["variant"] or None,
        "momenta_kept": int((lost < KEPT).sum()) if lost.size else None,  # variants
        "momenta": float(shown.max()) if shown.size else None,  # largest relative change of one by those of the figure
        **solver_facts(data, discrete),
        "power_least": changes["energy"].min(), "power_most": changes["energy"].max(),
        "modified_least": changes["modified"].min(), "modified_most": changes["modified"].max(),
    }  # fmt: skip


def order_two(runs: Iterable[str]) -> list[str]:
    """The discrete methods that declare order two, without the unreduced forms, which are the same maps."""
    return [name for name in map(str, runs) if integrator(name).order == 2 and "-unreduced[" not in name]


def solver_facts(data: xr.Dataset, discrete: xr.Dataset) -> dict[str, Any]:
    """The facts that need the notebook's solver: derivations, paths, alpha, and its energy error against others'."""
    if SOLVER not in data["variant"].values:
        parts = (f"{part}_{name}" for part in PARTS.values() for name in BY_PART)
        return dict.fromkeys((*OF_SOLVER, *parts))
    solver, runs = data.sel(variant=SOLVER), discrete["variant"].values
    values: dict[str, Any] = {
        "followed": float(np.abs(solver["hard_theta"] - solver["true_theta"]).sel(scene="spheroid").max()),
        "ways": float(solver["ways_gap"].max()),  # rad
        "energies": float(solver["energy_gap"].max()),  # relative
        "solver_momenta": float(solver[MOMENTA].to_dataarray().max()),
        "alpha_at_rest": float(solver["alpha_at_rest"].sel(scene="goldstein")),  # 1/s^2
        "alpha_rate": float(solver["alpha_rate"].sel(scene="goldstein")),  # rad/s
        "long": float(data["long_time"].max()),  # s
    }
    names = order_two(runs)
    for scene, part in PARTS.items():
        limit, largest = float(solver["energy_largest"].sel(scene=scene)), discrete["energy_largest"].sel(scene=scene)
        times = [better_from(data, scene, name) for name in names]
        values |= {
            f"{part}_end": notebook_end(data, scene),  # s
            f"{part}_energy": limit,  # the solver's largest relative energy error to the notebook's end
            # variants with a larger error than the solver to then, of `compared`; with a smaller one in the end
            f"{part}_behind": int((largest.sel(variant=names) > limit).sum()) if names else None,
            f"{part}_ahead": sum(map(math.isfinite, times)) if names else None,
            f"{part}_long": energy_until(data, scene, SOLVER, values["long"]),  # the solver's error to then
            f"{part}_turned": turned(data, scene),  # degrees
        }
    first, second = (values[f"{part}_turned"] for part in PARTS.values())
    return values | {"both_turned": first if round(first) == round(second) else None}


def present(data: xr.Dataset) -> list[str]:
    """The variants, the solver and those of the figure first."""
    names = list(map(str, data["variant"].values))
    return sorted(names, key=lambda name: (SOLVER, *DRAWN, name).index(name))


def turned(data: xr.Dataset, scene: str) -> float:
    """The angle about the vertical, in degrees, that best turns the true path of the axis into the notebook's."""
    run = data.sel(scene=scene, variant=SOLVER)
    hard = axis_from_angles(run["hard_theta"].values, run["hard_phi"].values + 0.5 * math.pi)
    true = axis_from_angles(run["true_theta"].values, run["true_phi"].values)
    flat = [path[:, 0] + 1j * path[:, 1] for path in (hard, true)]
    return math.degrees(cmath.phase(complex(np.nansum(flat[0] * flat[1].conj()))))


def powers(data: xr.Dataset) -> pd.DataFrame:
    """Powers of the step with which energy and modified energy change, of each scene and variant that has both."""
    runs = [data.sel(scene=scene, variant=name) for scene in data["scene"].values
            for name in MODIFIED if name in data["variant"].values]  # fmt: skip
    columns = {"energy": "energy_swing", "modified": "modified_swing"}
    return pd.DataFrame({
        key: [power_law(run["shadow_step_size"].values, run[column].values).slope for run in runs]
        for key, column in columns.items()
    }, dtype=float)  # fmt: skip


def tables(data: xr.Dataset) -> dict[str, pd.DataFrame]:
    """Errors of the constants of every variant, up to the notebook's end and far beyond it."""
    rows, last = [], float(data["long_time"].max())
    for name in present(data):
        for scene in map(str, data["scene"].values):
            run = data.sel(scene=scene, variant=name)
            start = better_from(data, scene, name) if name != SOLVER and SOLVER in data["variant"].values else math.inf
            errors = [float(run[f"{constant}_largest"]) for constant in CONSTANTS]
            rows.append([name, scene, str(run["outcome"].values), notebook_end(data, scene), *errors,
                         energy_until(data, scene, name, last), start if start < math.inf else math.nan])  # fmt: skip
    header = ["variant", "scene", "outcome", "end of the notebook (s)"]
    header += [*(f"error of {constant} to then" for constant in CONSTANTS), f"error of energy to {last:g} s"]
    header.append("energy better than lsoda's from (s)")
    return {"kept": pd.DataFrame(rows, columns=header)}
