"""The atlas in words: for each integrator when to use it and when it fails, and what a page of maps says."""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure.verdicts import DRIFT
from symtop.methods.framework.registry import split_name
from symtop.report.sentences import counted, few
from symtop.runner.study import Table

from .atlas import COMMON, NOTABLE, OutcomeMap, accurate_everywhere, closed_forms, common, maps, pole_effect
from .many_verdicts import BOUNDED_BUT_WRONG
from .outcome_maps import SETTLED_STEPS, SETTLED_TOLERANCES
from .tables import CURVE_STEPS, PERIODS, Column

FAILURES = {
    "drifting": f"change their energy by more than {DRIFT:.0%} and ever more",
    "wrong_regime": "cross a turning point of the true motion",
    "left_chart": "leave their chart",
    "not_converged": "cannot solve their equation",
    "not_finite": "overflow",
    "step_too_small": "stop because their steps become too small",
    "out_of_budget": "exceed their budget of steps",
}  # what runs do
NO_LIMIT = "none"  # in the table: small nutations grow at none of the steps tried
EXCEPTIONS = 2  # methods at most that a sentence on all others names apart


class Advice(NamedTuple):
    """One line of the atlas: a variant ``method[chart]``."""

    integrator: str
    use: str
    fails: str

    @property
    def sentence(self) -> str:
        """Both halves."""
        return f"Use it {self.use}. I{self.fails[1:]}."


def advice(data: xr.Dataset, family: str) -> dict[str, Advice]:
    """When to use each integrator that has a map, and when it fails."""
    over_spin, over_gap = maps(data, family), maps(data, "grazing")
    return {name: Advice(name, _use(one), _fails(one, over_gap.get(name))) for name, one in over_spin.items()}


def _use(one: OutcomeMap) -> str:
    if one.control == "none":
        return "at any time: it evaluates the exact solution and has no step"
    unit, control = (" nutation periods", "steps") if one.control == "step_size" else ("", "tolerances")
    reach, least = one.usual_reach, f"below {one.settings[0]:.2g}"
    if max(reach.values()) <= 0.0:
        return f"with {control} {least}{unit} only"
    limit = {kind: f"up to {value:.2g}" if value > 0.0 else least for kind, value in reach.items()}
    return f"with {control} {limit['fast']}{unit} on fast tops and {limit['slow']} on slow tops"


def _fails(one: OutcomeMap, over_gap: OutcomeMap | None) -> str:
    wrong = int(np.sum(one.outcome != 0))
    if one.control == "none" and wrong:
        return f"it fails in {wrong} of {one.outcome.size} tops"
    fixed = one.control == "step_size"
    parts = [_commonly(one)] if one.failure.kinds else []
    share = one.shares[BOUNDED_BUT_WRONG]
    if share > 0.05:
        parts.append(f"is wrong with bounded energy in {share:.0%} of its map")
    effect = pole_effect(over_gap)
    if effect is not None and effect.halves:
        control = "steps less than half as long" if fixed else "tolerances less than half as large"
        beside = "" if effect.near > 0.0 else " (right next to it, smaller than any on the map)"
        parts.append(f"needs {control} within {effect.width:.1g} rad of a pole{beside}")
    if not parts:
        return "it fails nowhere on the map"
    return f"it {'. It '.join(parts)}"


def _commonly(one: OutcomeMap) -> str:
    """From which setting on a method fails, in how large a share of the starts, and how."""
    failure, starts, fixed = one.failure, one.outcome.shape[0], one.control == "step_size"
    kinds = ", ".join(f"{share:.0%} {FAILURES[word]}" for word, share in failure.kinds.items() if share >= NOTABLE)
    every = "step" if fixed else "tolerance"
    if math.isfinite(failure.setting):
        place = f"h = {failure.setting:.2g} nutation periods" if fixed else f"a tolerance of {failure.setting:.2g}"
        range_of_failure = f"at {place} and every larger {every} in at least {failure.least:.0%} of {starts} starts"
    else:
        last = f", half of them only at the largest {every}s of the map"
        between = f", but not in half of them at every larger {every}"
        rest = "" if failure.least < COMMON else last if failure.at_end else between
        range_of_failure = f"in up to {failure.least:.0%} of {starts} starts{rest}"
    return f"fails {range_of_failure} (of these runs {kinds})"


def ends(shown: Mapping[str, OutcomeMap]) -> tuple[str, str]:
    """Who is accurate in the largest part of its map, and in the smallest, with the shares."""
    shares = {name: f"{one.shares[0]:.0%}" for name, one in shown.items()}
    ranked = sorted(shown, key=lambda name: -shown[name].shares[0])
    best, worst = (f"{_equals([name for name in ranked if shares[name] == shares[end]])} ({shares[end]})"
                   for end in (ranked[0], ranked[-1]))  # fmt: skip
    return best, worst


def _equals(names: Sequence[str]) -> str:
    """Variants of one rank: the names of one or two, or how many they are."""
    return " and ".join(names) if len(names) < 3 else f"{len(names)} methods"


def page_message(data: xr.Dataset, scene: str, shown: Mapping[str, OutcomeMap]) -> str:
    """What a page of maps says, in one sentence: who is accurate in the largest part of its map, and in the smallest.

    Methods that are exact at any step are named apart. Past a pole the chart decides, not the method.
    """
    closed = closed_forms(data, shown)
    compared = common({name: one for name, one in shown.items() if name not in closed} or shown)
    control = "steps" if next(iter(shown.values())).control == "step_size" else "tolerances"
    if scene == "grazing" and control == "steps" and (by_chart := _charts_message(compared)):
        return by_chart
    best, worst = ends(compared)
    place = "past a pole" if scene == "grazing" else f"on tops like {scene}"
    apart = closed and len(closed) < len(shown)
    after = f" after {' and '.join(closed)}, exact at any step," if apart else ""
    return f"At equal {control} {place} most of the map{after} is accurate with {best}, least with {worst}"


def _charts_message(compared: Mapping[str, OutcomeMap]) -> str:
    """How far methods in angles are behind all others; nothing if more than `EXCEPTIONS` of them are not behind."""
    shares = {name: float(one.shares[0]) for name, one in compared.items()}
    others = {name: share for name, share in shares.items() if split_name(name)[1] != "angles"}
    angles = {name: share for name, share in shares.items() if name not in others}
    beside = {name: share for name, share in angles.items() if others and share >= min(others.values())}
    behind = [share for name, share in angles.items() if name not in beside]
    if not behind or len(beside) > EXCEPTIONS:
        return ""
    charts = {split_name(name)[1] for name in others}
    on = "on the axis" if charts == {"axis"} else "in other charts"
    apart = ", ".join(f"{split_name(name)[0]} ({share:.0%})" for name, share in beside.items())
    return (
        f"Past a pole methods {on} are accurate in {_span(others.values())} of their maps, methods in angles in "
        f"{_span(behind)}{f', but for {apart}' if apart else ''}"
    )


def _span(shares: Collection[float]) -> str:
    """The smallest and the largest of some shares."""
    low, high = f"{min(shares):.0%}", f"{max(shares):.0%}"
    return low if low == high else f"{low} to {high}"


def caption(data: xr.Dataset, scene: str, names: Sequence[str]) -> str:
    """The caption of a page of maps: what it shows, who is accurate most widely and least, and who ends early."""
    shown = {name: one for name, one in maps(data, scene).items() if name in names}
    compared = common(shown)
    best, worst = ends(compared)
    ending = max(shown, key=lambda name: shown[name].early)
    early = (
        f"Runs end early in up to {shown[ending].early:.0%} of a map ({ending})."
        if shown[ending].early > 0.0
        else "No run ends early: an inaccurate run raises no error here."
    )
    control = "step" if shown[names[0]].control == "step_size" else "tolerance"
    what = (
        f"One fall (one nutation period) of the scene grazing past a pole that the axis misses by 1.1 delta, in rad. "
        f"Upwards delta grows, to the right the {control}"
        if scene == "grazing"
        else f"The scene {scene} over {PERIODS:g} nutation periods. Upwards the spin r grows (from r = 1 on a top "
        f"sleeps: it spins upright and stays so), to the right the {control}"
    )
    together = ", one map for all without a wrong run" if accurate_everywhere(compared) else ""
    pale = "" if all(one.made.all() for one in shown.values()) else "; pale: not run, counted as accurate"
    return (
        f"Outcome of every run of {counted(len(names))}, a map each, named by method and chart, with the share that is "
        f"accurate{together}{pale}. {what}. All else is held fixed, and an equal {control} is not an equal cost. "
        f"{_counted(shown, compared)}Accurate in the largest part of its map: {best}; in the smallest: {worst}. {early}"
        f"{_without_limit(data, scene, shown) if scene != 'grazing' else ''}"
    )


def _counted(shown: Mapping[str, OutcomeMap], compared: Mapping[str, OutcomeMap]) -> str:
    """Which part of the maps is drawn, if some of them are smaller than others."""
    if all(compared[name].outcome.shape == one.outcome.shape for name, one in shown.items()):
        return ""
    low, high = (next(iter(compared.values())).settings[k] for k in (0, -1))
    return f"Maps and shares are of what was tried with all: {low:.2g} to {high:.2g}. "


def _without_limit(data: xr.Dataset, family: str, shown: Mapping[str, OutcomeMap]) -> str:
    """How many methods of a page show no linear limit although their steps reach a third of a turn."""
    free = [name for name in shown if _limit(data, family, name) == NO_LIMIT]
    if not free:
        return ""
    longest = max(float(shown[name].settings[-1]) for name in free)
    return (
        f" With {few(free, most=2)} small nutations grow at no spin at any of {CURVE_STEPS} steps tried up to "
        f"{longest:.2g} nutation periods (h omega = {2.0 * math.pi * longest:.3g})."
    )


def _limit(data: xr.Dataset, family: str, name: str) -> str:
    """The least step, in nutation periods, beyond which small nutations grow at some spin; empty if not known."""
    if Column.LINEAR_LIMIT not in data:
        return ""
    cell = data.sel(scene=family, variant=name)
    limits, thirds = cell[Column.LINEAR_LIMIT].values, cell[Column.THIRD_TURN].values
    if np.isfinite(limits).any():
        return f"{np.nanmin(limits):.2g}"
    return NO_LIMIT if np.isfinite(thirds).any() else ""


def _charts(names: Iterable[str]) -> dict[str, list[str]]:
    """The variants of the methods that have several."""
    rows: dict[str, list[str]] = {}
    for name in names:
        rows.setdefault(split_name(name)[0], []).append(name)
    return {method: several for method, several in rows.items() if len(several) > 1}


def summary(data: xr.Dataset, family: str) -> list[str]:
    """How far steps reach on fast and on slow tops, which methods end early, and how many wrong runs raise no error."""
    by_name = maps(data, family)
    sentences = [said for said in (_reaches(data, family, by_name), _charts_apart(by_name, family)) if said]
    never = [name for name, one in by_name.items() if one.early == 0.0]
    if by_name:
        silent = [one.silent for one in by_name.values() if math.isfinite(one.silent)]
        ends_well = f"{len(never)} of {counted(len(by_name))} never end a run early"
        if silent:
            often = f"With the median variant {np.median(silent):.0%} of inaccurate runs end without an error"
            ends_well = f"{often}, whether or not they keep the energy, and {ends_well}"
        sentences.append(
            f"{ends_well}. That a run ends without an error says little: what energy, momenta and the guard notice is "
            "in Populations."
        )
        sentences += [said for said in (_settled(data.sel(scene=family), by_name),) if said]
    return sentences


def _settled(part: xr.Dataset, by_name: Mapping[str, OutcomeMap]) -> str:
    """How many cells were not run, and what the runs say that check them; empty if all were run."""
    cells = sum(one.made.size for one in by_name.values())
    left = cells - sum(int(one.made.sum()) for one in by_name.values())
    if not left:
        return ""
    checks, refuted = (int(part[name].sum()) for name in (Column.CHECKS, Column.REFUTED))
    none = ", and none is inaccurate"
    failed = f"; {counted(refuted, 'top')} failed and ran at every setting"
    return (
        f"Of the {cells:,} cells of these maps {left / cells:.0%} were not run, because their tops were accurate at "
        f"every longer step over a factor of {SETTLED_STEPS:g}, or at every looser tolerance over a factor of "
        f"{SETTLED_TOLERANCES:g}. {checks:,} runs of such tops check this{failed if refuted else none}."
    )


def _reaches(data: xr.Dataset, family: str, by_name: Mapping[str, OutcomeMap]) -> str:
    """The longest accurate steps on fast and on slow tops, from the least variant to the best; closed forms apart."""
    apart, parts = closed_forms(data, by_name), []
    for kind in ("fast", "slow"):
        reach = {
            name: one.usual_reach[kind] for name, one in by_name.items()
            if one.control == "step_size" and name not in apart and math.isfinite(one.usual_reach[kind])
        }  # fmt: skip
        if reach:
            short = [name for name, value in reach.items() if value <= 0.0]
            below = max((float(by_name[name].settings[0]) for name in short), default=0.0)
            ends_of = [f"below {below:.2g} ({few(short, most=1)})"] if short else []
            for pick in (max,) if short else (min, max):
                name = pick(reach, key=lambda one: reach[one])
                ends_of += [f"{reach[name]:.2g} ({name})"] if reach[name] > 0.0 else []
            parts.append(f"from {' to '.join(ends_of)} on {kind} tops")
    if not parts:
        return ""
    left = [f"{few(apart)} (exact at any step)"] if apart else []
    if others := sum(one.control != "step_size" and name not in apart for name, one in by_name.items()):
        left.append(f"{counted(others)} without a fixed step")
    apart_from = f" Not counted: {' and '.join(left)}." if left else ""
    return (
        f"The longest accurate step on the family {family}, over {PERIODS:g} nutations and for nine spins in ten, is "
        f"{', '.join(parts)}, in nutation periods.{apart_from}"
    )


def _charts_apart(by_name: Mapping[str, OutcomeMap], family: str) -> str:
    """How much of a map the chart alone decides, with the method for which that is most; empty without two charts."""
    several = _charts(by_name)
    if not several:
        return ""
    shares = {method: {name: float(by_name[name].shares[0]) for name in rows} for method, rows in several.items()}
    most = max(shares, key=lambda method: max(shares[method].values()) - min(shares[method].values()))
    listed = " and ".join(f"{share:.0%} with {name}" for name, share in shares[most].items())
    return (
        f"The chart alone, same steps or tolerances, matters most for {most}: accurate in {listed} of the map of "
        f"{family}. {counted(len(shares), 'method')} ran in two charts."
    )


def atlas_tables(data: xr.Dataset, family: str) -> list[Table]:
    """When to use each variant and when it fails, its shares of the map, and what the chart alone changes."""
    by_name, lines = maps(data, family), []
    for name, line in advice(data, family).items():
        one = by_name[name]
        shares = ("" if math.isnan(share) else f"{share:.0%}" for share in (one.shares[0], one.early, one.silent))
        lines.append([line.integrator, line.use, line.fails, *shares, _limit(data, family, name)])
    title = f"The atlas in words: {family} with its spin changed, {PERIODS:g} nutations"
    header = ["variant", "use it", "it fails", "accurate", "ended early", "inaccurate runs without an error",
              f"small nutations first grow at a step of (nutation periods, {CURVE_STEPS} tried)"]  # fmt: skip
    made = [Table(title, header, lines)]
    if several := _charts(by_name):
        charts = list(dict.fromkeys(split_name(name)[1] for rows in several.values() for name in rows))
        shown = [
            [method, *(f"{by_name[row].shares[0]:.0%}" if (row := f"{method}[{chart}]") in by_name else ""
                       for chart in charts)]
            for method in several
        ]  # fmt: skip
        made.append(Table(f"The chart alone: accurate share of the map of {family}", ["method", *charts], shown))
    return made
