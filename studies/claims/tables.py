"""What the study reads out of its dataset: the findings of every integrator, their counts, and defects of a step."""

from collections import Counter
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.judge.ledger import VERDICTS, Finding, read

REFINED = 100.0  # a defect that falls by more than this over the differencing widths is an error of the differencing

Findings = dict[tuple[str, str], list[Finding]]  # by scene and integrator


class Defect(NamedTuple):
    """How far one step of an integrator is from preserving the bracket; arrays (width,)."""

    width: np.ndarray  # of the central differences that measure it
    size: np.ndarray

    @property
    def falls(self) -> bool:
        """Does it vanish as the width is refined, so that it is an error of the differencing alone?"""
        return bool(self.size[-1] < self.size[0] / REFINED)


def findings(data: xr.Dataset) -> Findings:
    """The findings of every integrator on every scene where it was judged."""
    cells = [(str(scene), str(name)) for scene in data["scene"].values for name in data["integrator"].values]
    rows = {cell: read(data.sel(scene=cell[0], integrator=cell[1])) for cell in cells}
    return {cell: row for cell, row in rows.items() if any(finding.verdict for finding in row)}


def with_verdict(judged: Findings, *verdicts: str) -> list[tuple[str, str, Finding]]:
    """(scene, integrator, finding) of all findings with one of those verdicts."""
    return [(*cell, finding) for cell, row in judged.items() for finding in row if finding.verdict in verdicts]


def counts(judged: Findings) -> dict[str, int]:
    """How many findings have each verdict, in the order of `VERDICTS`."""
    counted = Counter(finding.verdict for row in judged.values() for finding in row)
    return {verdict: counted[verdict] for verdict in VERDICTS}


def defects(data: xr.Dataset, names: list[str]) -> dict[str, Defect]:
    """The defects of some integrators on the first scene, where they were measured."""
    measured = {}
    for name in names:
        cell = data.isel(scene=0).sel(integrator=name)
        width, size = cell["defect_width"].values, cell["bracket_defect"].values
        good = np.isfinite(width) & np.isfinite(size)
        if good.any():
            measured[name] = Defect(width[good], size[good])
    return measured


def shorter_runs(data: xr.Dataset) -> tuple[int, dict[str, int]]:
    """Steps of the longest run on the first scene, and those of the integrators that made fewer."""
    steps = data["steps_run"].isel(scene=0)
    most = float(data["steps_run"].max())
    runs = {str(name): float(made) for name, made in zip(data["integrator"].values, steps.values, strict=True)}
    return int(most), {name: int(made) for name, made in runs.items() if np.isfinite(made) and 0 < made < most}
