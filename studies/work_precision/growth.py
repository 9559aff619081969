"""How the parts of the axis error grow from the first horizon to the last, at equal steps or tolerances."""

import numpy as np
import xarray as xr

from symtop.runner.study import Table

from . import energy

ROWS = ("midpoint[angles]", "stormer-verlet[angles]", "takahashi-imada[axis]", "rk4[axis]",
        "rk45-compiled[angles]", "gauss-8[axis]")  # fmt: skip
PARTS = {
    "shape": "shape error (axis lengths)",
    "nutation_lag": "nutation lag (rad)",
    "precession_lag": "precession lag (rad)",
}


def rows_of(data: xr.Dataset) -> list[str]:
    """Those of the variants that a dataset has."""
    return [row for row in ROWS if row in data["variant"].values]


def table(data: xr.Dataset) -> Table:
    """The median growth of each part of the error with each variant, on the first scene."""
    scene, spans = data[[*PARTS, "setting_value"]].isel(scene=0), data["horizon"].values
    lines = []
    for row in rows_of(data):
        grown = [energy.growth_at_equal_settings(scene.sel(variant=row), part) for part in PARTS]
        lines.append([row, *(f"{value:.3g}" if np.isfinite(value) else "not judged" for value in grown)])
    title = (
        f"Growth of the parts of the axis error on {scene['scene'].item()} from {spans[0]:g} to {spans[-1]:g} nutation "
        "periods at equal steps or tolerances, medians; not judged: at rounding or over budget"
    )
    return Table(title, ["variant", *(said.partition(" (")[0] for said in PARTS.values())], lines)
