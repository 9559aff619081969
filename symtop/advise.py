"""Which integrator, with which step: the cheapest method that meets an accuracy, found in stored data and then tried.

    1. A stored work-precision study lists the methods that were cheapest on the scene most like this one. Scenes are
       compared by dimensionless numbers that fix the motion of the axis: cos(theta) of both turning points and both
       momenta over sqrt(I1 mgl). Without stored data every compiled method is a candidate.
    2. Each candidate's setting is sought on a dozen nutations of the scene itself, against the closed form, for a
       target lowered by the law of growth (see `symtop.measure.meet`), and its run is timed.
    3. The cheapest are run to the whole horizon, as far as a budget of evaluations allows, and their settings
       corrected.

Advice that was run to the end and met the accuracy with a margin is ``checked``; if its error and the reference's own
bound together exceed the accuracy, it is ``at the reference's limit``; what was not run to the end is ``extrapolated``.
When nothing meets the accuracy there is no integrator and the confidence is ``none``. An accuracy below the reference's
own bound is refused in the same way, before anything is tried: no run could show it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from symtop.base.numbers import TINY
from symtop.base.validate import SymtopError, one_of, positive
from symtop.measure import meet, ranking
from symtop.measure.errors import QUANTITIES
from symtop.measure.phase import FREQUENCIES
from symtop.methods.registry import Integrator, integrators
from symtop.model.scenes import Scene, scenes
from symtop.model.scenes import scene as find_scene
from symtop.run.simulation import MOST_STEPS

ASKED = (*QUANTITIES, *FREQUENCIES)
STORED = Path("results") / "work_precision.nc"
CANDIDATES = 8  # of the stored study that are tried
FINALISTS = 3  # that are run to the whole horizon
TOO_DEAR = 40.0  # times the evaluations of the cheapest candidate so far: not tried
HOW = {
    "checked": "measured to the end",
    "at the reference's limit": "measured to the end, as far as the reference can tell",
    "extrapolated": "extrapolated from a short run",
}
MARGIN = 0.8  # of the accuracy that a checked run must meet at its samples; between them the error may be larger


@dataclass(frozen=True)
class Advice:
    """What to use: an integrator with its step or tolerance, and how sure that is.

    `expected_error` is the largest error of `quantity` expected over `horizon`, `seconds` the wall time of the bare
    run on this machine. `fails` says of methods that were tried why they are not the answer.
    """

    scene: str
    quantity: str
    accuracy: float
    horizon: float
    integrator: str | None
    step_size: float | None
    tolerance: float | None
    expected_error: float
    seconds: float
    confidence: str
    reason: str
    runner_up: str = ""
    fails: tuple[str, ...] = ()

    def __str__(self) -> str:
        runner = [f"Runner-up: {self.runner_up}"] if self.runner_up else []
        return "\n".join([self.reason, *runner, *self.fails])


@dataclass(frozen=True)
class _Trial:
    """A candidate with its setting, its error as expected at the horizon, and the cost of the whole run."""

    met: meet.Met
    error: float
    seconds: float
    confidence: str  # one of HOW

    @property
    def name(self) -> str:
        return self.met.integrator.name

    def words(self) -> str:
        knob = "step size" if self.met.integrator.knob == "step_size" else "tolerance"
        return f"{self.name} with {knob} {self.met.setting:.4g}"


def regime(scene: Scene) -> np.ndarray:
    """Dimensionless numbers of a scene's motion: cos(theta) of both turning points, both momenta in asinh."""
    top, start = scene.top, scene.start
    low, high = sorted(top.turning_cosines(start))
    unit = math.sqrt(top.I1 * max(abs(top.mgl), TINY))
    momenta = top.momenta(start)
    return np.array([low, high, math.asinh(momenta.p_psi / unit), math.asinh(momenta.p_phi / unit)])


def recommend(
    scene: "str | Scene",
    *,
    accuracy: float,
    quantity: str = "axis",
    horizon: float | None = None,
    results: str | Path | None = None,
) -> Advice:
    """The cheapest method, with its step or tolerance, that keeps the error of `quantity` below `accuracy`.

    `scene` is a Scene or the name of one; `horizon` its own by default; `results` a folder with a stored
    ``work_precision.nc`` (default: ``results`` if it is there). Raises SymtopError for arguments that make no sense;
    when no method is good enough, the advice says so. It runs what it recommends, which takes from a tenth of a second
    to half a minute.
    """
    chosen = find_scene(scene)
    wanted = positive("accuracy", accuracy)
    if wanted >= math.pi:
        raise SymtopError(f"accuracy must be below pi, beyond which every angle is right, not {wanted!r}")
    one_of("quantity", quantity, ASKED)
    end = chosen.horizon if horizon is None else positive("horizon", horizon)
    data = _stored(results)
    limit = meet.judgeable(chosen, quantity, end)
    if wanted < limit:
        source = f"nothing was, as that is below {limit:.2g}, the least error that the reference can judge"
        return _advice(chosen, wanted, quantity, end, [], (), source)
    names, source = _candidates(chosen, wanted, quantity, end, data)
    trials: list[_Trial] = []
    fails: dict[str, list[str]] = {}
    known, patience = integrators(), math.inf
    for name in sorted(names, key=lambda name: -(known[name].order or 0)):  # the cheap ones first, to bound the others
        found = _try(chosen, known[name], wanted, quantity, end, names[name], patience)
        if isinstance(found, _Trial):
            trials.append(found)
            patience = min(patience, TOO_DEAR * found.met.evaluations)
        else:
            fails.setdefault(found, []).append(name)
    trials.sort(key=lambda trial: trial.seconds)
    ranked: list[_Trial] = []
    for number, trial in enumerate(trials):
        if number >= FINALISTS and ranked:
            break
        confirmed = _confirm(chosen, trial, wanted, quantity, end)
        if isinstance(confirmed, _Trial):
            ranked.append(confirmed)
        else:
            fails.setdefault(confirmed, []).append(trial.name)
    ranked.sort(key=lambda trial: trial.seconds)
    why = tuple(f"{reason}: {', '.join(which)}." for reason, which in fails.items())
    return _advice(chosen, wanted, quantity, end, ranked, why, source)


def _stored(results: str | Path | None) -> xr.Dataset | None:
    file = STORED if results is None else Path(results) / STORED.name
    if not file.is_file():
        if results is not None:
            raise SymtopError(
                f"results holds no {STORED.name}: {str(results)!r}; run symtop study work_precision first"
            )
        return None
    try:
        with xr.open_dataset(file) as data:
            return data.load()
    except (OSError, ValueError) as error:
        raise SymtopError(f"{file} cannot be read ({error}); run symtop study work_precision --fresh") from error


def _usable(quantity: str) -> dict[str, Integrator]:
    """Methods that can be recommended: compiled, with a knob, showing what is asked."""
    needed = meet.observed(quantity)
    return {
        name: method
        for name, method in integrators().items()
        if method.knob is not None and method.tier == "compiled" and (needed == "axis" or _shows_attitude(method))
    }


def _shows_attitude(method: Integrator) -> bool:
    return bool({"angles", "attitude"} & set(method.solvers))


def _candidates(
    scene: Scene, accuracy: float, quantity: str, horizon: float, data: xr.Dataset | None
) -> tuple[dict[str, float | None], str]:
    """Names to try, each with a setting to begin with, and where they came from."""
    usable = _usable(quantity)
    everyone: dict[str, float | None] = dict.fromkeys(usable)
    if data is None or quantity not in data:
        return everyone, f"tried all {len(everyone)} compiled methods (no stored study was found)"
    known = {name: scenes()[name] for name in map(str, data["scene"].values) if name in scenes()}
    if not known:
        return everyone, f"tried all {len(everyone)} compiled methods (the stored study holds no known scene)"
    here = regime(scene)
    nearest = min(known, key=lambda name: float(np.sum((regime(known[name]) - here) ** 2)))
    periods = horizon / scene.nutation_period
    far = int(np.argmin(np.abs(np.log(data["horizon"].values / max(periods, 1e-3)))))
    cell = data.sel(scene=nearest).isel(horizon=far)
    chosen: dict[str, float | None] = {}
    for place in ranking.cheapest(cell, accuracy, quantity):
        if place.integrator in usable and len(chosen) < CANDIDATES:
            row = cell.sel(integrator=place.integrator).isel(setting=place.setting)
            chosen[place.integrator] = _setting(row, scene, known[nearest])
    if not chosen:
        why = f"none met it on {nearest}, the nearest stored scene"
        return everyone, f"tried all {len(everyone)} compiled methods ({why})"
    return chosen, f"tried the {len(chosen)} methods that are cheapest on {nearest}, the nearest stored scene"


def _setting(row: xr.Dataset, scene: Scene, stored: Scene) -> float:
    """A stored setting in the time scale of this scene."""
    step = float(row["step_size"])
    if not math.isfinite(step):
        return float(row["tolerance"])
    scale = scene.nutation_period / stored.nutation_period
    return step * scale if math.isfinite(scale) and scale > 0.0 else step


def _try(
    scene: Scene,
    method: Integrator,
    accuracy: float,
    quantity: str,
    horizon: float,
    guess: float | None,
    patience: float,
) -> "_Trial | str":
    """A candidate's setting and cost from a short run, or a sentence on why it has none."""
    period = scene.nutation_period
    short = min(horizon, meet.SHORT * period) if math.isfinite(period) else horizon
    law = (short / horizon) ** meet.growth(method, quantity)
    found = meet.search(scene, method, accuracy * law, quantity, short, guess, patience)
    if isinstance(found, meet.Missed):
        dear = found.why == meet.BUDGET and patience < meet.MOST_EVALUATIONS[method.tier]
        return f"Not within {TOO_DEAR:g} times the work of the best" if dear else found.why
    if method.knob == "step_size" and horizon / found.setting > MOST_STEPS:
        return f"Would need more than {MOST_STEPS:.0e} steps"
    return _Trial(found, found.error / law, meet.seconds(scene, found, quantity, horizon), "extrapolated")


def _confirm(scene: Scene, trial: _Trial, accuracy: float, quantity: str, horizon: float) -> "_Trial | str":
    """The trial run to the whole horizon, its setting corrected; as it was if that is too long, or why it fails."""
    met = trial.met
    if met.evaluations * horizon / met.horizon > meet.MOST_EVALUATIONS[met.integrator.tier]:
        return trial
    found = meet.search(scene, met.integrator, MARGIN * accuracy, quantity, horizon, met.setting)
    if isinstance(found, meet.Missed):
        return f"Good enough over a short run but not to the end ({found.why[0].lower()}{found.why[1:]})"
    confidence = "checked" if found.error + found.bound <= accuracy else "at the reference's limit"
    return _Trial(found, found.error, meet.seconds(scene, found, quantity, horizon), confidence)


def _advice(
    scene: Scene,
    accuracy: float,
    quantity: str,
    horizon: float,
    ranked: Sequence[_Trial],
    fails: tuple[str, ...],
    source: str,
) -> Advice:
    asked: dict[str, Any] = {"scene": scene.name, "quantity": quantity, "accuracy": accuracy, "horizon": horizon}
    goal = f"{quantity} error {accuracy:g} on {scene.name} to t = {horizon:g}"
    if not ranked:
        reason = f"Nothing that was tried meets {goal}; {source}. The closed form, integrator exact, takes no steps."
        nothing: dict[str, Any] = {"integrator": None, "step_size": None, "tolerance": None, "confidence": "none"}
        return Advice(**asked, **nothing, expected_error=math.nan, seconds=math.nan, reason=reason, fails=fails)
    best = ranked[0]
    reason = f"{best.words()} meets {goal}: error {best.error:.2g} ({HOW[best.confidence]}) in {best.seconds:.2g} s"
    reason += f"; {source}."
    runner = ""
    if len(ranked) > 1:
        runner = f"{ranked[1].words()}, {ranked[1].seconds / best.seconds:.2g} times the time."
    step = best.met.integrator.knob == "step_size"
    return Advice(
        **asked,
        integrator=best.name,
        step_size=best.met.setting if step else None,
        tolerance=None if step else best.met.setting,
        expected_error=best.error,
        seconds=best.seconds,
        confidence=best.confidence,
        reason=reason,
        runner_up=runner,
        fails=fails,
    )
