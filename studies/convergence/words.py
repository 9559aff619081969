"""Tables and sentences of the study."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr
from symtop_studies.convergence.tables import TARGET, least_work, named_variants

from symtop.measure.order import BESIDE
from symtop.methods.framework.registry import split_name
from symtop.report.sentences import abridged, joined
from symtop.runner.study import Table

from .tables import MAIN, OTHERS, Judged, Pairs, adaptive, declared_order, fits, judged, tolerance_fits

QUOTED = ("midpoint[angles]", "trapezoidal[angles]", "stormer-verlet[angles]")  # whose error constants are quoted
QUOTED_ON = "spheroid"


def tables(data: xr.Dataset) -> list[Table]:
    """Orders left open, errors of adaptive methods, the cheapest runs; then every order, and error by tolerance."""
    ends, rows = fits(data, MAIN, at_end=True), []
    results = judged(data)
    for pair, (word, slopes) in results.items():
        end = ends[pair]
        constant = f"{end.constant:.4g}" if np.isfinite(end.constant) else ""
        orders = (str(slopes[name]) if name in slopes else "not shown" for name in (MAIN, *OTHERS))
        rows.append([*pair, str(declared_order(pair[1]) or "unknown"), word, *orders, constant])
    header = ["scene", "method[chart]", "declared", "verdict", *(f"order in {name}" for name in (MAIN, *OTHERS)),
              "C in axis error C h^p at the end"]  # fmt: skip
    made = [Table("Orders extrapolated to h = 0, with 95 % intervals", header, rows)]
    short = [_open(results), _by_method(data), _cheapest(data)]
    if adaptive(data).sizes["variant"]:
        header = ["scene", "method[chart]", "x in axis error ~ tolerance^x", "axis error / tolerance", "least error"]
        made.append(
            Table("Errors of adaptive methods against their tolerance", header, list(_tolerance_variants(data)))
        )
    return [*(table for table in short if table.rows), *made]


def _tolerance_variants(data: xr.Dataset) -> Iterable[list[str]]:
    for (scene, name), fit in tolerance_fits(data).items():
        cell = data.sel(scene=scene, variant=name)
        ratio = (cell[MAIN] / cell["tolerance"]).values[fit.used]
        span = f"{ratio.min():.2g} to {ratio.max():.2g}" if ratio.size else ""
        least = float(cell[MAIN].min())
        yield [scene, name, str(fit), span, f"{least:.1e}" if np.isfinite(least) else ""]


def _by_method(data: xr.Dataset) -> Table:
    """A line a method, a column a chart: the power of the tolerance, and the error in units of it, over the scenes."""
    known = by_tolerance(data)
    charts = list(dict.fromkeys(split_name(name)[1] for name in known))
    methods = dict.fromkeys(split_name(name)[0] for name in known)
    rows = [[method, *(_followed(known.get(f"{method}[{chart}]")) for chart in charts)] for method in methods]
    title = "Axis errors of adaptive methods by chart: x in error ~ tolerance^x, and error / tolerance, over the scenes"
    return Table(title, ["method", *charts], rows)


def _followed(one: "Followed | None") -> str:
    if one is None:
        return ""
    return (
        f"x = {min(one.slopes):.2f} to {max(one.slopes):.2f}; {min(one.ratios):.1g} to {max(one.ratios):.1g} times "
        "the tolerance"
    )


def _open(results: Mapping[tuple[str, str], Judged]) -> Table:
    """The variants whose order is not confirmed, with the scenes and what was measured there."""
    scenes: dict[tuple[str, str], list[str]] = {}
    for (scene, name), (word, slopes) in results.items():
        if word in ("refuted", "undecided"):
            main = slopes[MAIN]
            scenes.setdefault((name, word), []).append(f"{scene} ({main})" if np.isfinite(main.slope) else scene)
    rows = [[name, word, str(declared_order(name) or "unknown"), ", ".join(on)] for (name, word), on in scenes.items()]
    title = "Orders that were refuted or left undecided; in brackets the order that was measured, if one could be"
    return Table(title, ["method[chart]", "verdict", "declared", "on"], rows)


def _cheapest(data: xr.Dataset) -> Table:
    """What the five named methods pay for an error."""
    part, labels = named_variants(data)
    rows = [[name, f"{work:.3g}"] for name, work in least_work(part, labels)]
    title = f"The cheapest run of each named method with an axis error below {TARGET:g} rad on {part['scene'].item()}"
    return Table(title, ["method[chart]", "force evaluations a nutation"], rows)


def spans(fitted: Pairs) -> str:
    """From where to where the orders of some variants lie, with the widest of their intervals."""
    slopes = [fit for fit in fitted.values() if np.isfinite(fit.slope)]
    if not slopes:
        return "No order could be measured."
    least, most = min(fit.slope for fit in slopes), max(fit.slope for fit in slopes)
    widest = max(fit.interval for fit in slopes)
    return (
        f"The orders, extrapolated to h = 0, lie between {least:.3f} and {most:.3f}. The widest of their 95 % "
        f"intervals is +- {widest:.3f}."
    )


def verdict(data: xr.Dataset) -> list[str]:
    """Whether every declared order was measured; a method that declares none is not judged."""
    by_word: dict[str, list[str]] = {}
    results = judged(data)
    for (_, name), (word, _) in results.items():
        by_word.setdefault(word, []).append(name)
    share = (
        f"{len(by_word.get('confirmed', []))} of {len(results)} pairs of a variant and a scene show the order that the "
        "method declares: the 95 % interval of the slope at h = 0, widened by "
        f"{BESIDE:g} on either side, contains it."
    )
    sentences = [share]
    for word, said in (("refuted", "is refuted"), ("undecided", "is left undecided")):
        if names := by_word.get(word):
            variants = abridged(list(dict.fromkeys(names)))
            sentences.append(
                f"The declared order {said} in {len(names)} pairs, with {variants}; a table has their scenes."
            )
    return [
        *sentences, spans(fits(data, MAIN)), *cheapest_sentence(data), *constants_sentence(data),
        *tolerance_sentence(data),
    ]  # fmt: skip


def cheapest_sentence(data: xr.Dataset) -> list[str]:
    """What the best and the worst of the named methods pay for an error."""
    part, labels = named_variants(data)
    paid = least_work(part, labels)
    if len(paid) < 2:
        return []
    (best, least), (worst, most) = paid[0], paid[-1]
    said = (
        f"{best} needs the fewest force evaluations of the well-known methods for an axis error below {TARGET:g} rad "
        f"on {part['scene'].item()}: {least:.3g} a nutation. {worst} needs the most, {most:.3g}."
    )
    return [said]


def constants_sentence(data: xr.Dataset) -> list[str]:
    """The error constants of the quoted variants."""
    ends = fits(data, MAIN, at_end=True)
    known = [(name, end) for name in QUOTED if (end := ends.get((QUOTED_ON, name))) and np.isfinite(end.slope)]
    laws = [f"{end.constant:.4g} h^{end.slope:.2f} with {name}" for name, end in known]
    return [f"On {QUOTED_ON} at t = 8 the axis error is {joined(laws)}."] if laws else []


class Followed(NamedTuple):
    """How the errors of an adaptive variant follow its tolerance, over the scenes."""

    slopes: list[float]
    ratios: list[float]  # errors over tolerances


def by_tolerance(data: xr.Dataset) -> dict[str, Followed]:
    """The adaptive variants whose errors follow a power of the tolerance somewhere."""
    known: dict[str, Followed] = {}
    for (scene, name), fit in tolerance_fits(data).items():
        if np.isfinite(fit.slope):
            cell, one = data.sel(scene=scene, variant=name), known.setdefault(name, Followed([], []))
            one.slopes.append(fit.slope)
            one.ratios.extend(map(float, (cell[MAIN] / cell["tolerance"]).values[fit.used]))
    return known


def tolerance_sentence(data: xr.Dataset) -> list[str]:
    """By what power of the tolerance the errors of adaptive variants fall, and how far they are from it."""
    known = by_tolerance(data)
    if not known:
        return []
    slopes = [slope for one in known.values() for slope in one.slopes]
    least, most = (
        min(known, key=lambda name: min(known[name].ratios)),
        max(known, key=lambda name: max(known[name].ratios)),
    )
    said = (
        f"The axis errors of adaptive methods fall as tolerance^{min(slopes):.2f} to tolerance^{max(slopes):.2f}, by "
        f"variant and scene. They are {min(known[least].ratios):.1g} ({least}) to {max(known[most].ratios):.1g} "
        f"({most}) times the tolerance that was asked for."
    )
    return [said]
