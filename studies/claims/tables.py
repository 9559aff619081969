"""What the study reads out of its dataset: the findings of every integrator, and the defects of a step."""

from itertools import product

import numpy as np
import xarray as xr

from symtop.judging.battery import SCENE
from symtop.judging.findings import Finding, read


def findings(data: xr.Dataset) -> dict[str, list[Finding]]:
    """The findings of every integrator that was judged, by its name, with the scene where that is a user's."""
    rows = {}
    for scene, name in product(data["scene"].values, data["variant"].values):
        row = read(data.sel(scene=scene, variant=name))
        if any(finding.verdict for finding in row):
            rows[str(name) if scene == SCENE else f"{name} on {scene}"] = row
    return rows


def defects(data: xr.Dataset, names: list[str]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Differencing widths and how far one step is from preserving the bracket, of some integrators, on one scene."""
    first = data[["defect_width", "bracket_defect"]].isel(scene=0)
    cells = {name: first.sel(variant=name).dropna("width") for name in names}
    return {name: (cell["defect_width"].values, cell["bracket_defect"].values)
            for name, cell in cells.items() if cell.sizes["width"]}  # fmt: skip
