"""Table and sentences of the study."""

import numpy as np
import xarray as xr

from symtop.runner.study import Table

from .tables import declared_order, fits

JUDGED = ("attitude", "theta", "energy")
QUOTED = ("midpoint", "trapezoidal", "stormer-verlet")  # whose error constants the verdict quotes
QUOTED_ON = "spheroid"
OFF, OFF_SHARE = 0.05, 0.03  # an order differs from the declared one beyond the larger of OFF and this share of it


def tables(data: xr.Dataset) -> list[Table]:
    """Fitted orders beside the declared ones, and the error constants."""
    by_quantity = [fits(data, quantity) for quantity in JUDGED]
    rows = []
    for pair, end in fits(data, "attitude", at_end=True).items():
        constant = f"{end.constant:.4g}" if np.isfinite(end.constant) else ""
        orders = (str(fitted[pair]) for fitted in by_quantity)
        rows.append([*pair, str(declared_order(pair[1]) or "unknown"), *orders, constant])
    header = ["scene", "integrator", "declared", *(f"order in {name}" for name in JUDGED),
              "C in attitude error C h^p at the end"]  # fmt: skip
    return [Table("Fitted orders with 95 % intervals", header, rows)]


def verdict(data: xr.Dataset) -> list[str]:
    """Whether every declared order was measured; a method that declares none is not judged."""
    fitted, right, wrong, unjudged = fits(data, "attitude"), 0, [], dict[str, list[str]]()
    for (scene, method), fit in fitted.items():
        claim = declared_order(method)
        if fit.reason:
            unjudged.setdefault(fit.reason, []).append(f"{method} on {scene}")
        elif claim is not None and abs(fit.slope - claim) <= max(OFF, OFF_SHARE * claim):
            right += 1
        elif claim is not None:
            wrong.append(f"{method} on {scene} shows order {fit} where {claim} is declared")
    sentences = [f"{right} of {len(fitted)} pairs of method and scene show the order that the method declares."]
    if wrong:
        sentences.append(f"Refuted: {'; '.join(wrong)}.")
    sentences += [f"Not judged, because {reason}: {', '.join(pairs)}." for reason, pairs in unjudged.items()]
    ends = fits(data, "attitude", at_end=True)
    for method in QUOTED:
        end = ends.get((QUOTED_ON, method))
        if end is not None and np.isfinite(end.slope):
            law = f"{end.constant:.4g} h^{end.slope:.2f}"
            sentences.append(f"On {QUOTED_ON} at t = 8 the attitude error of {method} is {law}.")
    return sentences
