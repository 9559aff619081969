"""Certificates: the closed form of one scene in double, held against 40 digits and against an integration, once.

    digits        its angles, axis and attitude at `CHECKS` times and at the fastest moment before each, up to
                  `REACH` nutations, against the same formulas in 40 digits: shows every error of rounding
    discrete-map  the same, and its attitude over `OVERLAP` nutations against the discrete map iterated: shows an error
                  of the formulas
    integration   both, and the same attitude against heyoka's long double integration of the equations of motion:
                  shows one that the formulas of the map would have, too

A certificate takes 0.1 to 0.5 s. It is kept on disk under a hash of the top, the start, the sources and the libraries,
and whoever asks for the motion of the scene afterwards is told of it. It lowers no bound: bounds follow from the
arithmetic, and a certificate that contradicts them raises them.
"""

import functools
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.core.files import cache_root
from symtop.model import charts
from symtop.model.scenes import Scene, closed_form
from symtop.run.disk_cache import cached, place
from symtop.run.reference.bounds import SUSPICIOUS, closed_bounds, closed_values
from symtop.run.reference.independent_checks import (
    DIGITS,
    SAFETY,
    check_times,
    have_heyoka,
    integrate,
    iterated_with_error,
    seen,
)

KINDS = ("digits", "discrete-map", "integration")  # each holds the one before it
REACH = 1e6  # nutations
OVERLAP = 100.0  # nutations


class Certificate(NamedTuple):
    """What the closed form of a scene has been held against."""

    reach: float  # time of the last comparison with 40 digits
    times: int  # how many there were
    share: float  # largest error there, as a share of its bound
    overlap: float  # time of the two comparisons below; nan without them
    map_apart: float  # rad, how far the map and the closed form are apart beyond its own error; nan without one
    apart: float  # rad, the same of the integration

    @property
    def kind(self) -> str:
        """One of `KINDS`."""
        return "digits" if math.isnan(self.map_apart) else "discrete-map" if math.isnan(self.apart) else "integration"

    @property
    def doubt(self) -> float:
        """Rad by which the formulas may be wrong: a distance from an independent check that exceeds rounding."""
        return max((gap for gap in (self.map_apart, self.apart) if gap > SUSPICIOUS), default=0.0)

    @property
    def factor(self) -> float:
        """What the bounds are raised by: 1 if they hold."""
        return SAFETY * self.share if self.share > 1.0 else 1.0

    def __str__(self) -> str:
        words = (
            f"{DIGITS} digits at {self.times} times up to t = {self.reach:.3g}, largest error {self.share:.2g} of its "
            "bound"
        )
        for check, gap in (("discrete map", self.map_apart), ("long double integration", self.apart)):
            if not math.isnan(gap):
                apart = "no further apart than its own error" if gap == 0.0 else f"{gap:.1g} rad apart"
                words += f"; {check} up to t = {self.overlap:.3g}, {apart}"
        return words


def certificate(scene: Scene, kind: str | None = None) -> Certificate | None:
    """The certificate of a scene, made if there is none of this kind; without a kind the best on disk, or None.

    Without heyoka there is no integration, and the certificate is one of the discrete map.
    """
    if kind is None:
        return _on_disk(scene, cache_root())
    wanted = kind if kind != "integration" or have_heyoka() else "discrete-map"
    data = cached(_path(scene, wanted), lambda: _compared(scene, wanted), None)
    _on_disk.cache_clear()
    return _read(data)


def _path(scene: Scene, kind: str) -> Path:
    return place(_compared, "certificate", kind, scene.top, scene.start)


def _read(data: xr.Dataset) -> Certificate:
    numbers = {name: data[name].item() for name in Certificate._fields}
    return Certificate(**numbers)


@functools.lru_cache(maxsize=1024)
def _on_disk(scene: Scene, _root: Path) -> Certificate | None:
    for kind in reversed(KINDS):
        if (path := _path(scene, kind)).is_file():
            return _read(cached(path, functools.partial(_compared, scene, kind), None))
    return None


def _compared(scene: Scene, kind: str) -> xr.Dataset:
    """The comparisons of one scene."""
    times = _times(scene, REACH)
    values = closed_values(scene, times)
    checks = seen(scene, times, values["quaternion"], values["phi"], values["psi"])
    bounds = closed_bounds(scene, times, values)
    share = max(float(np.max(getattr(checks, name) / bounds[name])) for name in ("attitude", "axis", "phi", "psi"))
    overlap, map_apart = _against_map(scene) if kind != "digits" else (math.nan, math.nan)
    apart = _against_integration(scene)[1] if kind == "integration" else math.nan
    made = Certificate(float(times[-1]), times.size, share, overlap, map_apart, apart)
    return xr.Dataset({name: ((), value) for name, value in made._asdict().items()})


def _times(scene: Scene, nutations: float) -> charts.Array:
    """Times of comparison: up to so many nutations, or to the horizon where there are none."""
    period = scene.nutation_period
    return check_times(scene, nutations * period if math.isfinite(period) else scene.horizon)


def _against_map(scene: Scene) -> tuple[float, float]:
    """The time of the last comparison with the map, and how far it and the closed form are apart beyond its error."""
    times = _times(scene, OVERLAP)
    attitudes, own = iterated_with_error(scene, times)
    gap = charts.attitude_distance(closed_form(scene).quaternion(times), attitudes)
    return float(times[-1]), float(max(np.max(gap - own), 0.0))


def _against_integration(scene: Scene) -> tuple[float, float]:
    """The time of the integration, and how far it and the closed form are apart beyond its own error."""
    times = _times(scene, OVERLAP)
    states, _ = integrate(scene, times, "longdouble")
    gap = charts.attitude_distance(closed_form(scene).quaternion(times), states[:, :4].astype(float))
    _, phi, psi = charts.angles_from_quaternion(states[:, :4])
    rounding = seen(scene, times, states[:, :4], phi, psi).attitude  # an unstable motion amplifies its rounding
    return float(times[-1]), float(max(np.max(gap - 2.0 * rounding), 0.0))
