"""The atlas in words: for each integrator when to use it and when it fails, and what a page of maps says."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.measure.verdicts import BOUNDED_BUT_WRONG, JUDGED

from .atlas import (
    FAST,
    SLOW,
    OutcomeMap,
    first_failures,
    lower_quantile,
    maps,
    pole_effect,
    reach,
    shares,
    silent_share,
    stored_map,
)
from .tables import PERIODS

FAILURES = {
    "drifting": "loses energy",
    "wrong_regime": "crosses a turning point of the true motion",
    "left_chart": "leaves its chart",
    "not_converged": "cannot solve its equation",
    "not_finite": "overflows",
    "step_too_small": "stops because its steps become too small",
    "out_of_budget": "exceeds its budget of steps",
}
PAGES = {
    "discrete-lagrangian": "discrete Lagrangians",
    "splitting-angles": "splitting methods in the angles chart",
    "splitting-space": "splitting methods up to order 4 in charts without poles",
    "splitting-high-order": "splitting methods above order 4 in charts without poles",
    "runge-kutta": "explicit Runge-Kutta methods of fixed step",
    "gauss": "Gauss methods",
    "adaptive": "adaptive methods and the exact solution",
}


class Advice(NamedTuple):
    """One line of the atlas."""

    integrator: str
    use: str
    fails: str

    @property
    def sentence(self) -> str:
        """Both halves."""
        return f"Use it {self.use}; {self.fails}."


def advice(data: xr.Dataset, family: str, name: str) -> Advice | None:
    """When to use an integrator and when it fails, from its maps; None if it has none."""
    one = stored_map(data, family, name)
    if one is None:
        return None
    if one.control == "none":
        return Advice(name, "at any time: it evaluates the exact solution and has no step", _exact(one))
    return Advice(name, _use(one), _fails(data, one, name))


def all_advice(data: xr.Dataset, family: str) -> dict[str, Advice]:
    """One line of the atlas for each integrator that has a map."""
    lines = {str(name): advice(data, family, str(name)) for name in data["integrator"].values}
    return {name: line for name, line in lines.items() if line is not None}


def _exact(one: OutcomeMap) -> str:
    wrong = int(np.sum(one.outcome != 0))
    return f"it fails in {wrong} of {one.outcome.size} tops" if wrong else "it fails nowhere on the map"


def _use(one: OutcomeMap) -> str:
    limits = reach(one)
    fast, slow = (lower_quantile(limits[rows]) for rows in (one.parameter > FAST, one.parameter < SLOW))
    fixed = one.control == "step_size"
    unit, control = (" nutation periods", "steps") if fixed else ("", "tolerances")
    if max(fast, slow) <= 0.0:
        return f"with {control} below {one.settings[0]:.2g}{unit} only"
    limit = {kind: f"up to {value:.2g}" if value > 0.0 else f"below {one.settings[0]:.2g}"
             for kind, value in (("fast", fast), ("slow", slow))}  # fmt: skip
    return f"with {control} {limit['fast']}{unit} on fast tops and {limit['slow']} on slow tops"


def _fails(data: xr.Dataset, one: OutcomeMap, name: str) -> str:
    fixed = one.control == "step_size"
    parts = []
    for k, (setting, outcome) in enumerate(first_failures(one)[:2]):
        place = f"h = {setting:.2g}" if fixed else f"a tolerance of {setting:.2g}"
        unit = " nutation periods" if fixed and k == 0 else ""
        parts.append(f"first {FAILURES[outcome]} at {place}{unit}")
    share = float(np.mean(one.outcome == BOUNDED_BUT_WRONG))
    if share > 0.05:
        parts.append(f"is wrong with bounded energy in {share:.0%} of its map")
    effect = pole_effect(data, name)
    if effect is not None and effect.halves:
        control = "steps less than half as long" if fixed else "tolerances less than half as large"
        beside = "" if effect.near > 0.0 else " (right next to it, smaller than any on the map)"
        parts.append(f"needs {control} within {effect.width:.1g} rad of a pole{beside}")
    if not parts:
        return "it fails nowhere on the map"
    return "it " + (parts[0] if len(parts) == 1 else ", ".join(parts[:-1]) + " and " + parts[-1])


def page_caption(data: xr.Dataset, family: str, page: str, names: Sequence[str]) -> str:
    """The caption of a page of maps: what it shows, who is accurate most widely and least, and who ends early."""
    title = PAGES.get(page, page.replace("-", " "))
    return (
        f"Outcome of every run of {title} ({len(names)} on this page). Left: the scene "
        f"{family} over {PERIODS:g} nutation periods with another spin; r = 1 is the spin from which a top sleeps "
        "(spins upright and stays so). Right: one fall past a pole that the axis misses by 1.1 delta (rad). In both, "
        f"the step or the tolerance grows to the right. {_page_conclusion(data, family, names)}"
    )


def _page_conclusion(data: xr.Dataset, family: str, names: Sequence[str]) -> str:
    share = {name: value for name, value in shares(data, family).items() if name in names}
    if not share:
        return ""
    ranked = sorted(share, key=lambda name: -float(share[name][0]))
    best, worst = ranked[0], ranked[-1]
    text = f"Accurate in the largest part of its map: {best} ({share[best][0]:.0%})"
    text += f", in the smallest: {worst} ({share[worst][0]:.0%})." if worst != best else "."
    early = {name: float(value[len(JUDGED) :].sum()) for name, value in share.items()}
    ending = max(early, key=lambda name: early[name])
    if early[ending] > 0.0:
        return text + f" Runs end early in up to {early[ending]:.0%} of a map ({ending})."
    return text + " No run ends early: an inaccurate run raises no error here."


def summary(data: xr.Dataset, family: str) -> list[str]:
    """How far steps reach on fast and on slow tops, which methods end early, and how many wrong runs raise no error."""
    by_name = maps(data, family)
    steps = {name: one for name, one in by_name.items() if one.control == "step_size"}
    sentences = []
    for kind, pick in (("fast", lambda r: r > FAST), ("slow", lambda r: r < SLOW)):
        limit = {name: lower_quantile(reach(one)[pick(one.parameter)]) for name, one in steps.items()}
        ranked = sorted((name for name in limit if limit[name] > 0.0), key=lambda name: -limit[name])
        if ranked:
            best = ", ".join(f"{name} ({limit[name]:.2g})" for name in ranked[:4])
            worst = ", ".join(f"{name} ({limit[name]:.2g})" for name in ranked[:-4:-1])
            sentences.append(
                f"On {kind} tops of the family {family} the largest accurate steps, in nutation periods: {best}; the "
                f"smallest: {worst}."
            )
    early = {name: float(np.mean(one.outcome >= len(JUDGED))) for name, one in by_name.items()}
    never = [name for name, value in early.items() if value == 0.0]
    if never:
        sentences.append(f"{len(never)} of {len(early)} integrators never end early: {', '.join(never)}.")
    silent = [silent_share(one) for one in by_name.values()]
    if silent:
        sentences.append(
            f"For the median integrator, {np.median(silent):.0%} of inaccurate runs end without an error; only the "
            "comparison with the truth shows that they are wrong."
        )
    return sentences
