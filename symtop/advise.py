"""`recommend`: the cheapest integrator, with its step or tolerance, that meets an accuracy on a scene.

    1. Candidates. A stored work-precision study lists the methods that were cheapest on the stored scene nearest to
       this one. The distance of two scenes is that of four dimensionless numbers which fix the motion of the axis:
       cos(theta) at both turning points, and both momenta over sqrt(I1 mgl). Without a stored study every compiled
       method is a candidate.
    2. Trials. The step or tolerance of each candidate is searched for on a dozen nutations of the scene itself
       (`symtop.measure.settings`). The error is measured against the closed form, its target is lowered by the law of
       growth, and one run is timed.
    3. Confirmation. The three fastest candidates are run to the whole horizon, if a budget of force evaluations allows
       it, and their settings are corrected.

The confidence of the advice is one of:

    checked                    it was run to the end, and its error with the reference's bound is below the accuracy
    at the reference's limit   it was run to the end, but its error with the reference's bound exceeds the accuracy
    extrapolated               it was not run to the end
    none                       no method meets the accuracy; the integrator is None

An accuracy below the bound of the reference is answered with ``none`` before any run, because no run could show it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from symtop.base import datasets
from symtop.base.numbers import TINY
from symtop.base.validate import SymtopError, one_of, positive
from symtop.measure import ranking, settings
from symtop.measure.errors import QUANTITIES
from symtop.measure.phase import FREQUENCIES
from symtop.methods.registry import Integrator, integrator, split_name
from symtop.model import scenes
from symtop.model.scenes import Scene
from symtop.run.simulation import MOST_STEPS

KNOWN_QUANTITIES = (*QUANTITIES, *FREQUENCIES)
STORED_STUDY = "work_precision.nc"
CANDIDATES = 8  # methods of the stored study that are tried
FINALISTS = 3  # methods that are run to the whole horizon
TOO_DEAR = 40.0  # a search ends at this multiple of the evaluations of the cheapest candidate so far
CONFIDENCE = {
    "checked": "measured to the end",
    "at the reference's limit": "measured to the end, as far as the reference can tell",
    "extrapolated": "extrapolated from a short run",
}
MARGIN = 0.8  # fraction of the accuracy that a run must meet at its samples; between them its error may be larger


@dataclass(frozen=True)
class Advice:
    """A recommended integrator with its step or tolerance, and how sure that is.

    `expected_error` is the largest error of `quantity` expected over `horizon`; `seconds` is the wall time of the bare
    run on this machine. `fails` says why other methods that were tried were not recommended.
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


class _Question(NamedTuple):
    """What is asked for."""

    scene: Scene
    accuracy: float
    quantity: str
    horizon: float


class _Trial(NamedTuple):
    """A candidate with its setting, the error expected at the horizon, and the wall time of the whole run."""

    met: settings.Met
    error: float
    seconds: float
    confidence: str  # a key of CONFIDENCE

    def words(self) -> str:
        return f"{self.met.integrator.name} with {self.met.integrator.setting(self.met.setting).label}"


def regime(scene: Scene) -> np.ndarray:
    """Four dimensionless numbers of a scene: cos(theta) at both turning points, asinh of both scaled momenta."""
    top, start = scene.top, scene.start
    low, high = sorted(top.turning_cosines(start))
    unit = math.sqrt(top.I1 * max(abs(top.mgl), TINY))
    momenta = top.momenta(start)
    return np.array([low, high, math.asinh(momenta.p_psi / unit), math.asinh(momenta.p_phi / unit)])


def recommend(
    scene: "str | Scene", *, accuracy: float, quantity: str = "axis", horizon: float | None = None,
    results: str | Path | None = None,
) -> Advice:  # fmt: skip
    """The cheapest integrator, with its step or tolerance, that keeps the error of `quantity` below `accuracy`.

    `accuracy` is the largest absolute error of `quantity` over the run: radians for ``axis``, ``attitude`` and
    ``theta``, the units of the scene for others. `horizon` is the scene's own by default. `results` is a folder with a
    stored ``work_precision.nc``; without it every compiled method is tried. Raises SymtopError for arguments that are
    out of range. It runs what it recommends, which takes from 0.1 s to half a minute.
    """
    scene = scenes.scene(scene)
    accuracy = positive("accuracy", accuracy)
    if accuracy >= math.pi:
        raise SymtopError(f"accuracy must be below pi, beyond which every angle is right, not {accuracy!r}")
    one_of("quantity", quantity, KNOWN_QUANTITIES)
    horizon = scene.horizon if horizon is None else positive("horizon", horizon)
    data = None if results is None else _stored(Path(results) / STORED_STUDY)
    limit = settings.judgeable(scene, quantity, horizon)
    question = _Question(scene, accuracy, quantity, horizon)
    if accuracy < limit:
        source = f"nothing was, as that is below {limit:.2g}, the least error that the reference can judge"
        return _advice(question, [], (), source)
    guesses, source = _candidates(question, data)
    source += f" ({Path(results) / STORED_STUDY})" if results is not None else ""
    trials: list[_Trial] = []
    fails: dict[str, list[str]] = {}
    patience = math.inf
    methods = {name: integrator(name) for name in guesses}
    # Methods of high order first: they are the cheapest at most accuracies, and their cost ends the other searches.
    for name in sorted(guesses, key=lambda name: -(methods[name].order or 0)):
        trial = _try(question, methods[name], guesses[name], patience)
        if isinstance(trial, _Trial):
            trials.append(trial)
            patience = min(patience, TOO_DEAR * trial.met.evaluations)
        else:
            fails.setdefault(trial, []).append(name)
    trials.sort(key=lambda trial: trial.seconds)
    ranked: list[_Trial] = []
    for number, trial in enumerate(trials):
        if number >= FINALISTS and ranked:
            break
        confirmed = _confirm(question, trial)
        if isinstance(confirmed, _Trial):
            ranked.append(confirmed)
        else:
            fails.setdefault(confirmed, []).append(trial.met.integrator.name)
    ranked.sort(key=lambda trial: trial.seconds)
    sentences = tuple(f"{reason}: {', '.join(names)}." for reason, names in fails.items())
    return _advice(question, ranked, sentences, source)


def _stored(file: Path) -> xr.Dataset:
    """The dataset of the work-precision study; refused with a sentence if it is not there or cannot be read."""
    if not file.is_file():
        raise SymtopError(f"results holds no {file.name}: {str(file.parent)!r}; run symtop study work_precision first")
    remedy = "run symtop study work_precision --fresh"
    try:
        data = datasets.read(file)
    except SymtopError as error:
        raise SymtopError(f"{file} cannot be read ({error.__cause__}); {remedy}") from error
    if missing := [name for name in ranking.NEEDS if name not in data]:
        raise SymtopError(f"{file} is of an older version, without {', '.join(missing)}; {remedy}")
    return data


def _usable(quantity: str) -> list[str]:
    """What can be recommended: compiled methods with a step or a tolerance, in each chart that shows the quantity.

    A method is named with its chart, ``rk4[axis]``, if it has several.
    """
    return [
        row.name if len(integrator(row.method).charts()) > 1 else row.method
        for row in settings.compared(settings.observed(quantity))
        if row.control is not None and row.implementation == "compiled"
    ]


def _same(row: str, usable: Sequence[str]) -> str | None:
    """The usable name of a stored row, of the same method in another chart if need be; None if there is none."""
    method = split_name(row)[0]
    return next((name for name in (row, *usable) if name in usable and split_name(name)[0] == method), None)


def _candidates(question: _Question, data: xr.Dataset | None) -> tuple[dict[str, float | None], str]:
    """Names of methods to try, each with a first guess of its setting, and a phrase on their origin."""
    scene, accuracy, quantity, horizon = question
    usable = _usable(quantity)
    everyone: dict[str, float | None] = dict.fromkeys(usable)
    if data is None or quantity not in data:
        return everyone, f"tried all {len(everyone)} compiled methods (without a stored study)"
    catalogue = scenes.scenes()
    stored = {name: catalogue[name] for name in map(str, data["scene"].values) if name in catalogue}
    if not stored:
        return everyone, f"tried all {len(everyone)} compiled methods (the stored study holds no known scene)"
    numbers = regime(scene)
    nearest = min(stored, key=lambda name: float(np.sum((regime(stored[name]) - numbers) ** 2)))
    nutations = horizon / scene.nutation_period
    column = int(np.argmin(np.abs(np.log(data["horizon"].values / max(nutations, 1e-3)))))
    cell = data.sel(scene=nearest).isel(horizon=column)
    chosen: dict[str, float | None] = {}
    stored_as = "axis" if quantity == "attitude" else quantity  # the study runs what shows the axis
    for place in ranking.cheapest(cell, accuracy, stored_as):
        name = _same(place.integrator, usable)
        if name is not None and name not in chosen and len(chosen) < CANDIDATES:
            row = cell.sel(integrator=place.integrator).isel(setting=place.setting)
            chosen[name] = _setting(row, scene, stored[nearest])
    if not chosen:
        cause = f"none met it on {nearest}, the nearest stored scene"
        return everyone, f"tried all {len(everyone)} compiled methods ({cause})"
    return chosen, f"tried the {len(chosen)} methods that are cheapest on {nearest}, the nearest stored scene"


def _setting(row: xr.Dataset, scene: Scene, stored: Scene) -> float:
    """A stored step, scaled by the ratio of the nutation periods, or a stored tolerance."""
    step = float(row["step_size"])
    if not math.isfinite(step):
        return float(row["tolerance"])
    scale = scene.nutation_period / stored.nutation_period
    return step * scale if math.isfinite(scale) and scale > 0.0 else step


def _try(question: _Question, method: Integrator, guess: float | None, patience: float) -> "_Trial | str":
    """A candidate's setting and cost from short runs, or the reason why it has none."""
    scene, accuracy, quantity, horizon = question
    period = scene.nutation_period
    short = min(horizon, settings.SHORT * period) if math.isfinite(period) else horizon
    law = (short / horizon) ** settings.growth(method, quantity)
    met = settings.search(scene, method, accuracy * law, quantity, short, guess, patience)
    if isinstance(met, str):
        dear = met == settings.BUDGET and patience < settings.MOST_EVALUATIONS[method.implementation]
        return f"Not within {TOO_DEAR:g} times the work of the best" if dear else met
    if method.fixed_step and horizon / met.setting > MOST_STEPS:
        return f"Would need more than {MOST_STEPS:.0e} steps"
    return _Trial(met, met.error / law, settings.seconds(scene, met, quantity, horizon), "extrapolated")


def _confirm(question: _Question, trial: _Trial) -> "_Trial | str":
    """The trial run to the whole horizon with its setting corrected, or the reason why it fails there.

    A trial that would need too many evaluations is returned as it is.
    """
    scene, accuracy, quantity, horizon = question
    short = trial.met
    if short.evaluations * horizon / short.horizon > settings.MOST_EVALUATIONS[short.integrator.implementation]:
        return trial
    met = settings.search(scene, short.integrator, MARGIN * accuracy, quantity, horizon, short.setting)
    if isinstance(met, str):
        return f"Good enough over a short run but not to the end ({met[0].lower()}{met[1:]})"
    confidence = "checked" if met.error + met.bound <= accuracy else "at the reference's limit"
    return _Trial(met, met.error, settings.seconds(scene, met, quantity, horizon), confidence)


def _advice(question: _Question, ranked: Sequence[_Trial], fails: tuple[str, ...], source: str) -> Advice:
    scene, accuracy, quantity, horizon = question
    goal = f"{quantity} error {accuracy:g} on {scene.name} to t = {horizon:g}"
    if not ranked:
        reason = f"Nothing that was tried meets {goal}; {source}. The closed form, integrator exact, takes no steps."
        return Advice(
            scene.name, quantity, accuracy, horizon, integrator=None, step_size=None, tolerance=None,
            expected_error=math.nan, seconds=math.nan, confidence="none", reason=reason, fails=fails,
        )  # fmt: skip
    best = ranked[0]
    worth = f"error {best.error:.2g} ({CONFIDENCE[best.confidence]}) in {best.seconds:.2g} s"
    runners = [f"{trial.words()}, {trial.seconds / best.seconds:.2g} times the time." for trial in ranked[1:2]]
    step = best.met.integrator.fixed_step
    return Advice(
        scene.name, quantity, accuracy, horizon, best.met.integrator.name, best.met.setting if step else None,
        None if step else best.met.setting, best.error, best.seconds, best.confidence,
        reason=f"{best.words()} meets {goal}: {worth}; {source}.", runner_up="".join(runners), fails=fails,
    )  # fmt: skip
