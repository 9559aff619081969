"""Tables and sentences of the study."""

from collections.abc import Iterable

import numpy as np
import xarray as xr

from symtop.measure.order import BESIDE
from symtop.runner.study import Table

from .tables import MAIN, OTHERS, Pairs, adaptive, declared_order, fits, judged, tolerance_fits

QUOTED = ("midpoint[angles]", "trapezoidal[angles]", "stormer-verlet[angles]")  # whose error constants are quoted
QUOTED_ON = "spheroid"


def tables(data: xr.Dataset) -> list[Table]:
    """Orders beside the declared ones, and the error constants; errors of adaptive rows against their tolerance."""
    ends, rows = fits(data, MAIN, at_end=True), []
    for pair, (word, slopes) in judged(data).items():
        end = ends[pair]
        constant = f"{end.constant:.4g}" if np.isfinite(end.constant) else ""
        orders = (str(slopes[name]) if name in slopes else "not shown" for name in (MAIN, *OTHERS))
        rows.append([*pair, str(declared_order(pair[1]) or "unknown"), word, *orders, constant])
    header = ["scene", "method[chart]", "declared", "verdict", *(f"order in {name}" for name in (MAIN, *OTHERS)),
              "C in axis error C h^p at the end"]  # fmt: skip
    made = [Table("Orders extrapolated to h = 0, with 95 % intervals", header, rows)]
    if adaptive(data).sizes["integrator"]:
        header = ["scene", "method[chart]", "x in axis error ~ tolerance^x", "axis error / tolerance", "least error"]
        made.append(Table("Errors of adaptive methods against their tolerance", header, list(_tolerance_rows(data))))
    return made


def _tolerance_rows(data: xr.Dataset) -> Iterable[list[str]]:
    for (scene, name), fit in tolerance_fits(data).items():
        cell = data.sel(scene=scene, integrator=name)
        ratio = (cell[MAIN] / cell["tolerance"]).values[fit.used]
        span = f"{ratio.min():.2g} to {ratio.max():.2g}" if ratio.size else ""
        least = float(cell[MAIN].min())
        yield [scene, name, str(fit), span, f"{least:.1e}" if np.isfinite(least) else ""]


def spans(fitted: Pairs) -> str:
    """From where to where the orders of some rows lie, with the widest of their intervals."""
    slopes = [fit for fit in fitted.values() if np.isfinite(fit.slope)]
    if not slopes:
        return "No order could be measured."
    least, most = min(fit.slope for fit in slopes), max(fit.slope for fit in slopes)
    widest = max(fit.interval for fit in slopes)
    return (
        f"Orders, extrapolated to h = 0, lie between {least:.3f} and {most:.3f}; the widest 95 % interval is "
        f"+- {widest:.3f}."
    )


def verdict(data: xr.Dataset) -> list[str]:
    """Whether every declared order was measured; a method that declares none is not judged."""
    by_word: dict[str, list[str]] = {}
    results = judged(data)
    for (scene, name), (word, slopes) in results.items():
        main = slopes[MAIN]
        why = f" ({main} where {declared_order(name)} is declared)" if np.isfinite(main.slope) else ""
        by_word.setdefault(word, []).append(f"{name} on {scene}{why}")
    confirmed = len(by_word.get("confirmed", []))
    share = (
        f"{confirmed} of {len(results)} pairs of method[chart] and scene show the order that the method declares: the "
        f"95 % interval of the slope at h = 0, widened by {BESIDE:g} on either side, contains it."
    )
    sentences = [share]
    if "refuted" in by_word:
        sentences.append(f"Refuted: {'; '.join(by_word['refuted'])}.")
    if "undecided" in by_word:
        sentences.append(f"Left undecided: {'; '.join(by_word['undecided'])}.")
    ends = fits(data, MAIN, at_end=True)
    for name in QUOTED:
        end = ends.get((QUOTED_ON, name))
        if end is not None and np.isfinite(end.slope):
            law = f"{end.constant:.4g} h^{end.slope:.2f}"
            sentences.append(f"On {QUOTED_ON} at t = 8 the axis error of {name} is {law}.")
    return [*sentences, *tolerance_sentence(data)]


def tolerance_sentence(data: xr.Dataset) -> list[str]:
    """By what power of the tolerance the errors of adaptive rows fall, and how far they are from it."""
    fitted = tolerance_fits(data)
    by_row: dict[str, list[float]] = {}
    ratios: dict[str, list[float]] = {}
    for (scene, name), fit in fitted.items():
        if np.isfinite(fit.slope):
            cell = data.sel(scene=scene, integrator=name)
            by_row.setdefault(name, []).append(fit.slope)
            ratios.setdefault(name, []).extend((cell[MAIN] / cell["tolerance"]).values[fit.used])
    if not by_row:
        return []
    parts = (
        f"{name}: tolerance^{min(slopes):.2f} to {max(slopes):.2f}, {min(ratios[name]):.1g} to {max(ratios[name]):.1g} "
        "times the tolerance"
        for name, slopes in by_row.items()
    )
    return [f"Axis errors of adaptive methods, over the scenes: {'; '.join(parts)}."]
