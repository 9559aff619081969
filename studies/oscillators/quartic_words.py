"""Sentences and a table of the planar quartic oscillators.

Apart from `quartic_tables`, which cases are made with: what is only said of them makes no case stale.
"""

import xarray as xr

from symtop.runner.study import Table

from .quartic_tables import ERROR, GAPS, MAPS, PERIODS, QUARTICS, STEPS, oscillator_of, quartic_order


def sentences(data: xr.Dataset) -> list[str]:
    """What the four maps do, and what becomes of the exact one for small steps."""
    worst = float(data[ERROR].sel(scene=list(QUARTICS), variant="exact-discrete").max())
    slopes = [quartic_order(data, name, method).slope for name in QUARTICS for method in MAPS[1:]]
    limits = [quartic_order(data, name, MAPS[0], gap).slope for name in QUARTICS[1:] for gap in GAPS]
    line = (
        "The map Z+ + Z- = 2 A Z/(1 + B |Z|^2) leads from the oscillator to the top. With sigma = 0 it is the harmonic "
        "oscillator with its known exact discrete Lagrangian (B = 0, A = cos w h), with sigma the planar quartic "
        "oscillator. Two of these, with sigma = kappa and -kappa, are the top."
    )
    error = (
        f"This exact map has a largest relative error of {worst:.0e} on these oscillators, which is rounding, over "
        f"{PERIODS:g} periods and at steps of T/{max(STEPS):g} to T/{min(STEPS):g}."
    )
    limit = (
        "stormer-verlet, the midpoint rule and McMillan's map with constants to order h^2 have orders "
        f"{min(slopes):.2f} to {max(slopes):.2f} on the same oscillators. For small steps A and B of the exact map "
        f"differ from theirs by h^4, and delta vanishes as h^3 (slopes {min(limits):.2f} to {max(limits):.2f})."
    )
    return [line, error, limit]


def tables(data: xr.Dataset) -> list[Table]:
    """Orders and the largest errors of every map."""
    rows = []
    for name in QUARTICS:
        oscillator = oscillator_of(name)
        for method in MAPS:
            errors = data[ERROR].sel(scene=name, variant=method).values
            order = "exact" if method == MAPS[0] else f"{quartic_order(data, name, method).slope:.2f}"
            sizes = [f"{errors[STEPS.index(steps)]:.0e}" for steps in (160.3, 20.3, 4.37, 2.1)]
            rows.append([name, f"{oscillator.sigma:.3g}", f"{oscillator.b:.3g}", method, order, *sizes])
    header = ["oscillator", "sigma", "b", "map", "order", "error at T/160", "T/20", "T/4.4", "T/2.1"]
    return [Table(f"Planar quartic oscillators: largest relative error over {PERIODS:g} periods", header, rows)]
