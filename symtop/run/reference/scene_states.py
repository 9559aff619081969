"""States of scenes to 30 digits: a test set for integrators of other people.

Ten times a scene, from a tenth of its horizon to all of it, written with six digits. The states are those of the closed
form in 40 digits (`symtop.model.exact.digits`), from the top, the start and the times as they are stored in
doubles, so that a program that reads the printed numbers as doubles has the same problem. Angles are z-x-z, phi and
psi unwrapped; quaternions are (w, x, y, z) from body to space, and their sign is continued from the start.
"""

import csv
import functools
import io
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.model.exact.digits import PreciseForm
from symtop.model.scenes import Scene

DIGITS, WORKING = 30, 40  # printed, and computed
TIMES = 10  # a scene
ANGLES = ("theta", "phi", "psi", "theta_dot", "phi_dot", "psi_dot")
COLUMNS = (*ANGLES, "axis_x", "axis_y", "axis_z", "quaternion_w", "quaternion_x", "quaternion_y", "quaternion_z")
TITLE = f"States of the scenes at {TIMES} times, from the closed form in {WORKING} digits"


def times_of(scene: Scene, count: int = TIMES) -> list[float]:
    """The times of a scene in the test set, in its units."""
    return [float(f"{scene.horizon * k / count:.6g}") for k in range(1, count + 1)]


def precise(scene: Scene, times: Sequence[float]) -> list[list[Any]]:
    """The columns of `COLUMNS` at each time, as `mpmath.mpf` of 40 digits."""
    return _precise(scene, tuple(times))


@functools.lru_cache(maxsize=256)  # 0.2 s a scene, and a bundle asks three times
def _precise(scene: Scene, times: tuple[float, ...]) -> list[list[Any]]:
    form = PreciseForm(scene.top, scene.start, WORKING)
    return [[*form(time), *form.axis(time), *form.quaternion(time)] for time in times]


def printed(number: Any) -> str:
    """A number with `DIGITS` significant digits."""
    from mpmath import nstr

    return str(nstr(number, DIGITS, min_fixed=0, max_fixed=0, strip_zeros=False))


def states_csv(chosen: Iterable[Scene]) -> str:
    """The states as CSV: scene, time, and `COLUMNS` with 30 digits each."""
    lines = [
        [scene.name, repr(time), *map(printed, state)]
        for scene in chosen
        for time, state in zip(times_of(scene), precise(scene, times_of(scene)), strict=True)
    ]
    return _csv([["scene", "time", *COLUMNS], *lines])


def scenes_csv(chosen: Iterable[Scene]) -> str:
    """Tops and starts as CSV, every number with the 17 digits that name its double; angles in radians."""
    header = ["scene", "I1", "I3", "mgl", *ANGLES, "horizon", "nutation_period", "units", "purpose"]
    lines = [
        [scene.name, *map(repr, _problem(scene)), repr(scene.horizon), repr(scene.nutation_period),
         scene.units or "any consistent", scene.purpose]
        for scene in chosen
    ]  # fmt: skip
    return _csv([header, *lines])


def states(chosen: Sequence[Scene]) -> xr.Dataset:
    """The states as pairs of doubles: dimensions scene, sample, component and part.

    A value is ``NAME + NAME_lo``, which is good to 31 digits; I1, I3, mgl and the start ``NAME_0`` depend on scene.
    """
    values = np.empty((len(chosen), TIMES, len(COLUMNS)))
    low = np.empty_like(values)
    for place, scene in enumerate(chosen):
        for sample, state in enumerate(precise(scene, times_of(scene))):
            values[place, sample] = [float(number) for number in state]
            low[place, sample] = [float(number - float(number)) for number in state]
    both = ("scene", "sample")
    variables: dict[str, Any] = {"time": (both, [times_of(scene) for scene in chosen])}
    for ending, table in (("", values), ("_lo", low)):
        variables |= {f"{name}{ending}": (both, table[..., k]) for k, name in enumerate(ANGLES)}
        variables[f"axis{ending}"] = ((*both, "component"), table[..., 6:9])
        variables[f"quaternion{ending}"] = ((*both, "part"), table[..., 9:])
    problem = np.array([_problem(scene) for scene in chosen])
    variables |= {name: ("scene", problem[:, k]) for k, name in enumerate(("I1", "I3", "mgl"))}
    variables |= {f"{name}_0": ("scene", problem[:, 3 + k]) for k, name in enumerate(ANGLES)}
    coordinates = {
        "scene": [scene.name for scene in chosen],
        "component": ["x", "y", "z"],
        "part": ["w", "x", "y", "z"],
    }
    data = netcdf.describe(xr.Dataset(variables, coordinates), TITLE)
    for name in (*ANGLES, "axis", "quaternion"):
        data[f"{name}_lo"].attrs.update(long_name=f"what {name} lacks, to be added", units=data[name].attrs["units"])
    for name in ANGLES:
        data[f"{name}_0"].attrs.update(long_name=f"{name} at the start", units=data[name].attrs["units"])
    return data


def _problem(scene: Scene) -> list[float]:
    top, start = scene.top, scene.start
    return [top.I1, top.I3, top.mgl, *(getattr(start, name) for name in ANGLES)]


def _csv(rows: Iterable[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()
