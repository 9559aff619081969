"""Captions, table and sentences of the study."""

import numpy as np
import xarray as xr

from symtop.measure.order import Fit
from symtop.runner.study import Table

from .tables import Pair, agreement, declared_order, fits, pairs

JUDGED = ("attitude", "theta", "energy")
QUOTED = ("midpoint", "trapezoidal", "stormer-verlet")  # whose error constants the verdict quotes
QUOTED_ON = "spheroid"


def _number(value: float) -> str:
    return f"{value:.4g}" if np.isfinite(value) else ""


def caption(quantity: str, title: str, fitted: dict[Pair, Fit]) -> str:
    """Caption of the error curves of some methods."""
    slopes = [fit.slope for fit in fitted.values() if np.isfinite(fit.slope)]
    span = f"Fitted orders lie between {min(slopes):.3f} and {max(slopes):.3f}." if slopes else "None could be fitted."
    return (
        f"Largest {quantity} error over the run against the step, {title}. Filled points enter the fit; hollow ones "
        "are too large, not yet on a straight line, or within ten times the error bound of the reference (grey band). "
        f"{span}"
    )


def tables(data: xr.Dataset) -> list[Table]:
    """Fitted orders beside the declared ones, and the error constants."""
    by_quantity = [fits(data, quantity) for quantity in JUDGED]
    ends = fits(data, "attitude", at_end=True)
    header = ["scene", "integrator", "declared", *(f"order in {name}" for name in JUDGED),
              "C in attitude error C h^p at the end"]  # fmt: skip
    rows = [
        [*pair, str(declared_order(pair[1]) or "unknown"), *(str(fitted[pair]) for fitted in by_quantity),
         _number(ends[pair].constant)]
        for pair in pairs(data)
    ]  # fmt: skip
    return [Table("Fitted orders with 95 % intervals", header, rows)]


def verdict(data: xr.Dataset) -> list[str]:
    """Whether every declared order was measured."""
    fitted = fits(data, "attitude")
    seen = agreement(fitted)
    sentences = [
        f"{len(seen.right)} of {len(fitted)} pairs of method and scene show the order that the method declares."
    ]
    wrong = [
        f"{method} on {name} shows order {fitted[name, method]} where {declared_order(method)} is declared"
        for name, method in seen.wrong
    ]
    if wrong:
        sentences.append(f"Refuted: {'; '.join(wrong)}.")
    for reason, those in seen.unjudged.items():
        listed = ", ".join(f"{method} on {name}" for name, method in those)
        sentences.append(f"Not judged, because {reason}: {listed}.")
    ends = fits(data, "attitude", at_end=True)
    for method in QUOTED:
        fit = ends.get((QUOTED_ON, method))
        if fit is not None and np.isfinite(fit.slope):
            sentences.append(
                f"On {QUOTED_ON} at t = 8 the attitude error of {method} is {fit.constant:.4g} h^{fit.slope:.2f}."
            )
    return sentences
