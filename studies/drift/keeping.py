"""What it costs to keep the phase for N nutations, by the law of a variant that was measured at one N.

The phase error of a variant with step h after N nutations is LOST (N / N0)^q (h / h0)^p: q is the exponent of its
growth that was measured, p the declared order, N0 when a run with step h0 reached LOST. A variant that is to last N
nutations needs h = h0 (N / N0)^(-q / p), and as many force evaluations a nutation more.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from symtop.methods.framework.registry import integrator, integrators, split_name

LENGTHS = np.geomspace(10.0, 1e6, 41)  # nutations
FAMILIAR = ("midpoint[angles]", "stormer-verlet[angles]", "rk4[axis]")
MOST = 8  # names


class Keeping(NamedTuple):
    """The law of one variant: what it paid, for how long, and how its cost grows."""

    order: int
    length: float  # nutations after which the phase was lost
    paid: float  # force evaluations a nutation
    power: float  # of the length, with which the cost grows

    def work(self, lengths: Any) -> Any:
        """Force evaluations per nutation that keep the phase for so many nutations."""
        return self.paid * (np.asarray(lengths) / self.length) ** self.power


def keeping(name: str, loss: xr.Dataset) -> Keeping | None:
    """The law of a variant; None without a declared order, or if its phase was not seen to be lost."""
    row = integrator(name) if split_name(name)[0] in integrators() else None
    if row is None or row.order is None or "evaluations" not in loss:
        return None
    length, paid, exponent = (float(loss[key]) for key in ("measured", "evaluations", "exponent"))
    if not (math.isfinite(length) and math.isfinite(paid) and math.isfinite(exponent)):
        return None
    return Keeping(row.order, length, paid, exponent / row.order)


def chosen(laws: Mapping[str, Keeping]) -> list[str]:
    """The variants that are named: the familiar ones, and the cheapest of each order for a thousand nutations."""
    best: dict[int, str] = {}
    for name in sorted(laws, key=lambda name: float(laws[name].work(1000.0))):
        best.setdefault(laws[name].order, name)
    firsts = [best[order] for order in sorted(best)]
    familiar = [name for name in FAMILIAR if name in laws and name not in firsts]
    return [*familiar, *firsts][:MOST]
