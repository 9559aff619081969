"""`recommend`: the cheapest integrator, with its step or tolerance, that meets an accuracy on a scene.

    1. Candidates. A stored population study counts on how many of the random tops nearest to this one a method was
       the cheapest or nearly so (`symtop.measure.ranking`); a stored work-precision study lists the methods that were
       cheapest on the nearest scene. Without a stored study every compiled method is a candidate.
    2. Trials. The step or tolerance of each candidate is searched for on a dozen nutations of the scene itself
       (`symtop.measure.settings`), against the closed form and a target lowered by the law of growth; one run is timed.
    3. Confirmation. The three fastest candidates are run to the whole horizon, if a budget of force evaluations allows
       it, and their settings are corrected.

The confidence of the advice is one of:

    checked                    it was run to the end, and its error with the reference's bound is below the accuracy
    at the reference's limit   it was run to the end, but its error with the reference's bound exceeds the accuracy
    extrapolated               it was not run to the end
    none                       no method meets the accuracy; the integrator is None

An accuracy below the bound of the reference is answered with ``none`` before any run. The closed form is no candidate:
it is what errors are measured by, and a top with friction, drive or another body attached has none. For the top as it
stands it is mostly the fastest way, and the advice says so with its time.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from symtop.core import netcdf
from symtop.core.errors import SymtopError, one_of, positive
from symtop.measure import ranking, settings
from symtop.measure.errors import QUANTITIES, errors
from symtop.measure.phase import FREQUENCIES
from symtop.measure.ranking import STORED, Near, distances, nearest, regime
from symtop.measure.timing import bare_run, timings
from symtop.methods.framework.registry import NEEDS, Integrator, integrator, integrators, is_built_in, split_name
from symtop.model import scenes
from symtop.model.scenes import Scene, horizon_of
from symtop.run.guard import MOST_STEPS
from symtop.run.simulation import simulate

KNOWN_QUANTITIES = (*QUANTITIES, *FREQUENCIES)
STORED_STUDY = "work_precision.nc"
CANDIDATES = 8  # methods of the stored studies that are tried
FINALISTS = 3  # methods that are run to the whole horizon
TOO_DEAR = 40.0  # a search ends at this multiple of the evaluations of the cheapest candidate so far
CONFIDENCE = {
    "checked": "measured to the end",
    "at the reference's limit": "measured to the end, as far as the reference can tell",
    "extrapolated": "extrapolated from a short run",
}
SETTINGS = {  # the maps of an engine by its settings, the default first
    "mujoco": {
        "Euler": "mujoco-euler", "implicit": "mujoco-implicit", "implicitfast on a free body": "mujoco-implicit",
        "RK4 of 4.0": "rkmk4", "RK4 up to 3.17": "mujoco3-rk4",
    },
    "bullet": {"rigid body": "bullet-float32", "multibody": "mujoco-euler", "rigid body, flags 0": "no-gyro-float32"},
    "pybullet": {"multibody": "mujoco-euler"},
    "dart": {"default": "mujoco-euler"},
    "jolt": {"default": "no-gyro-float32", "gyroscopic force on": "jolt-float32"},
    "physx": {"default": "no-gyro-float32", "gyroscopic forces on": "physx-float32"},
    "havok": {"default": "no-gyro-float32"},
    "rapier": {"default": "rapier-float32"},
    "cannon-es": {"default": "no-gyro-linear"},
    "ode": {"default": "ode", "gyroscopic mode off": "no-gyro-linear"},
    "lammps": {"fix rigid": "lammps-rigid", "fix rigid/nve": "no-squish"},
    "yade": {"exactAsphericalRot": "yade"},
    "jsbsim": {"default": "jsbsim-default", "Buss2 and AB2": "jsbsim-buss2"},
    "exudyn": {"RK44": "rkmk4"},
}  # fmt: skip
STEP = 1.0 / 240.0  # s
WORST = 0.5  # rad: an axis that is further off needs no method to match it
MARGIN = 0.8  # fraction of the accuracy that a run must meet at its samples; between them its error may be larger


@dataclass(frozen=True)
class Advice:
    """A recommended integrator with its step or tolerance, and how sure that is.

    `expected_error` is the largest error of `quantity` expected over `horizon`; `seconds` is the wall time of the bare
    run on this machine. `closed_form` compares it with the evaluation of the closed form. `fails` says why other
    methods were not recommended. `command` and `python` are lines that make the recommended run.
    """

    scene: str
    quantity: str
    accuracy: float
    horizon: float
    integrator: str | None = None
    step_size: float | None = None
    tolerance: float | None = None
    expected_error: float = math.nan
    seconds: float = math.nan
    confidence: str = "none"
    reason: str = ""
    runner_up: str = ""
    closed_form: str = ""
    nearest: str = ""
    fails: tuple[str, ...] = ()
    command: str = ""
    python: str = ""

    def __str__(self) -> str:
        lines = [
            self.reason, self.runner_up and f"Runner-up: {self.runner_up}", self.nearest, self.closed_form, *self.fails,
            self.command and f"Run it: {self.command}", self.python and f"In Python: {self.python}",
        ]  # fmt: skip
        return "\n".join(filter(None, lines))


class _Question(NamedTuple):
    """What is asked for."""

    scene: Scene
    accuracy: float
    quantity: str
    horizon: float
    needs: tuple[str, ...]  # of the methods that may be recommended; empty: of any


class _Trial(NamedTuple):
    """A candidate with its setting, the error expected at the horizon, and the wall time of the whole run."""

    met: settings.Met
    error: float
    seconds: float
    confidence: str  # a key of CONFIDENCE

    def words(self) -> str:
        return f"{self.met.integrator.name} with {self.met.integrator.setting(self.met.setting).label}"


def recommend(
    scene: "str | Scene", *, accuracy: float, quantity: str = "axis", horizon: float | None = None,
    results: str | Path | None = None, needs: Collection[str] = (),
) -> Advice:  # fmt: skip
    """The cheapest integrator, with its step or tolerance, that keeps the error of `quantity` below `accuracy`.

    `accuracy` is the largest error of `quantity` over the run: radians for ``axis``, ``attitude`` and ``theta``, and
    relative for others, energy and momenta by the scales of `symtop.errors`. `horizon` is the scene's own by default.
    `results` is a folder with a stored ``work_precision.nc``, and ``population.nc`` if it is there; without it every
    compiled method is tried. `needs` leaves out methods that need something else (`Integrator.needs`), for example
    ``("derivative", "kicks")`` where there is no formula. Raises SymtopError for arguments that are out of range. It
    runs what it recommends, which takes from 0.1 s to half a minute.
    """
    scene = scenes.scene(scene)
    allowed = tuple(one_of("needs", need, NEEDS) for need in ([needs] if isinstance(needs, str) else needs))
    accuracy = positive("accuracy", accuracy)
    one_of("quantity", quantity, KNOWN_QUANTITIES)
    if quantity in settings.ANGLES and accuracy >= math.pi:
        raise SymtopError(f"accuracy must be below pi, beyond which every angle is right, not {accuracy!r}", "accuracy")
    horizon = scene.horizon if horizon is None else horizon_of(horizon)
    data = None if results is None else _stored(Path(results) / STORED_STUDY)
    limit = settings.judgeable(scene, quantity, horizon)
    question = _Question(scene, accuracy, quantity, horizon, allowed)
    if accuracy < limit:
        source = f"nothing was, as that is below {limit:.2g}, the least error that the reference can judge"
        return _advice(question, [], (), source)
    near = None if results is None else nearest(Path(results) / STORED, scene, quantity, accuracy, horizon)
    guesses, source = _candidates(question, data, near)
    source += f" ({Path(results) / STORED_STUDY})" if results is not None else ""
    trials: list[_Trial] = []
    ranked: list[_Trial] = []
    fails: dict[str, list[str]] = {}
    # those of high order first: they are the cheapest at most accuracies, and their cost ends the other searches
    for method in sorted(map(integrator, guesses), key=lambda method: -(method.order or 0)):
        patience = TOO_DEAR * min((one.met.evaluations for one in trials), default=math.inf)
        trial = _try(question, method, guesses[method.name], patience)
        _sort_in(trial, trials, fails, method.name)
    for number, tried in enumerate(sorted(trials, key=lambda trial: trial.seconds)):
        if number < FINALISTS or not ranked:
            _sort_in(_confirm(question, tried), ranked, fails, tried.met.integrator.name)
    ranked.sort(key=lambda trial: trial.seconds)
    # Times of the user's own methods in plain Python say nothing beside those of compiled ones.
    own = [one.name for one in integrators().values() if one.implementation == "python" and not is_built_in(one.name)]
    if own:
        fails["Not tried, as only compiled methods are timed"] = own
    sentences = tuple(f"{reason}: {', '.join(names)}." for reason, names in fails.items())
    return _advice(question, ranked, sentences, source, near)


def _sort_in(trial: "_Trial | str", trials: list[_Trial], fails: dict[str, list[str]], name: str) -> None:
    """To the trials, or its name to those that fail for the same reason."""
    if isinstance(trial, _Trial):
        trials.append(trial)
    else:
        fails.setdefault(trial, []).append(name)


def _stored(file: Path) -> xr.Dataset:
    """The dataset of the work-precision study; refused with a sentence if it is not there or cannot be read."""
    if not file.is_file():
        raise SymtopError(f"results holds no {file.name}: {str(file.parent)!r}; run symtop study work_precision first")
    remedy = "run symtop study work_precision --fresh"
    try:
        data = netcdf.read(file)
    except SymtopError as error:
        raise SymtopError(f"{file} cannot be read ({error.__cause__}); {remedy}") from error
    if missing := [name for name in ("variant", *ranking.NEEDS) if name not in data]:
        raise SymtopError(f"{file} is of an older version, without {', '.join(missing)}; {remedy}")
    return data


def _usable(quantity: str, needs: tuple[str, ...] = ()) -> list[str]:
    """Compiled methods with a step or a tolerance, each in the charts that show the quantity, which it then names."""
    return [
        variant.name if len(integrator(variant.method).charts()) > 1 else variant.method
        for variant in settings.compared(settings.observed(quantity))
        if variant.control is not None and variant.implementation == "compiled"
        if not needs or variant.needs in needs
    ]


def _same(variant: str, usable: Sequence[str]) -> str | None:
    """The usable name of a stored variant, of the same method in another chart if need be; None if there is none."""
    method = split_name(variant)[0]
    return next((name for name in (variant, *usable) if name in usable and split_name(name)[0] == method), None)


def _candidates(
    question: _Question, data: xr.Dataset | None, near: Near | None = None
) -> tuple[dict[str, float | None], str]:
    """Names of methods to try, each with a first guess of its setting, and a phrase on their origin."""
    scene, accuracy, quantity, horizon, _ = question
    usable = _usable(quantity, question.needs)
    everyone: dict[str, float | None] = dict.fromkeys(usable)
    if data is None or quantity not in data:
        return everyone, f"tried all {len(everyone)} compiled methods (without a stored study)"
    catalogue = scenes.scenes()
    stored = {name: catalogue[name] for name in map(str, data["scene"].values) if name in catalogue}
    if not stored:
        return everyone, f"tried all {len(everyone)} compiled methods (the stored study holds no known scene)"
    numbers = regime(scene)
    closest = min(stored, key=lambda name: float(distances(regime(stored[name])[np.newaxis], numbers)[0]))
    column = int(np.argmin(np.abs(np.log(data["horizon"].values / max(horizon / scene.nutation_period, 1e-3)))))
    cell = data.sel(scene=closest).isel(horizon=column)
    served = [_same(name, usable) for name, count in near.served.items() if count] if near is not None else []
    often = dict.fromkeys(filter(None, served))  # the methods that served most of the nearest tops first
    scale = scene.nutation_period / stored[closest].nutation_period
    cheapest: dict[str, float | None] = {}
    stored_as = "axis" if quantity == "attitude" else quantity  # the study runs what shows the axis
    for place in ranking.cheapest(cell, accuracy, stored_as):
        name = _same(place.integrator, usable)
        if name is not None and name not in cheapest:
            run = cell.sel(variant=place.integrator).isel(setting=place.setting)
            step, fixed = float(run["step_size"]), bool(np.isfinite(run["step_size"]))
            scaled = step * scale if math.isfinite(scale) and scale > 0.0 else step
            cheapest[name] = scaled if fixed else float(run["tolerance"])
    chosen = {name: cheapest.get(name) for name in [*often, *cheapest][:CANDIDATES]}
    if not chosen:
        return everyone, f"tried all {len(everyone)} compiled methods (none met it on {closest}, the nearest scene)"
    count = sum(name in often for name in chosen)
    words = [f"{count} methods that served the {near.tops} nearest random tops most often"] if near and count else []
    if len(chosen) > count:
        words.append(f"{len(chosen) - count} methods that are cheapest on {closest}, the nearest stored scene")
    return chosen, f"tried the {' and '.join(words)}"


def _try(question: _Question, method: Integrator, guess: float | None, patience: float) -> "_Trial | str":
    """A candidate's setting and cost from short runs, or the reason why it has none."""
    scene, accuracy, quantity, horizon, _ = question
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
    """The trial run to the whole horizon, if not too much, with its setting corrected; or the reason why it fails."""
    scene, accuracy, quantity, horizon, _ = question
    short = trial.met
    if short.evaluations * horizon / short.horizon > settings.MOST_EVALUATIONS[short.integrator.implementation]:
        met = settings.rounded(scene, short, accuracy * short.error / (trial.error or 1.0), quantity)
        return trial._replace(met=met, error=trial.error * met.error / (short.error or 1.0))
    best = settings.search(scene, short.integrator, MARGIN * accuracy, quantity, horizon, short.setting)
    if isinstance(best, str):
        return f"Good enough over a short run but not to the end ({best[0].lower()}{best[1:]})"
    met = settings.rounded(scene, best, MARGIN * accuracy, quantity)
    confidence = "checked" if met.error + met.bound <= accuracy else "at the reference's limit"
    return _Trial(met, met.error, settings.seconds(scene, met, quantity, horizon), confidence)


def _advice(
    question: _Question, ranked: Sequence[_Trial], fails: tuple[str, ...], source: str, near: Near | None = None
) -> Advice:
    scene, accuracy, quantity, horizon, _ = question
    goal = f"{quantity} error {accuracy:g} on {scene.name} to t = {horizon:g}"
    if not ranked:
        reason = f"Nothing that was tried meets {goal}; {source}."
        without = _without_steps(question, math.nan)
        return Advice(scene.name, quantity, accuracy, horizon, reason=reason, closed_form=without, fails=fails)
    best = ranked[0]
    name, fixed = best.met.integrator.name, best.met.integrator.fixed_step
    worth = f"error {best.error:.2g} ({CONFIDENCE[best.confidence]}) in {best.seconds:.2g} s"
    if need := best.met.integrator.needs:
        worth += f"; it needs {NEEDS[need]} ({need})"
    runners = [f"{trial.words()}, {trial.seconds / best.seconds:.2g} times the time." for trial in ranked[1:2]]
    served = _same(name, list(near.served)) if near is not None else None  # None: the study has no chart of it
    return Advice(
        scene.name, quantity, accuracy, horizon, name, best.met.setting if fixed else None,
        None if fixed else best.met.setting, best.error, best.seconds, best.confidence,
        f"{best.words()} meets {goal}: {worth}; {source}.", runner_up="".join(runners),
        closed_form=_without_steps(question, best.seconds), nearest=near.words(served) if near and served else "",
        fails=fails, **_lines(question, best.met),
    )  # fmt: skip


def _lines(question: _Question, met: settings.Met) -> dict[str, str]:
    """The command and the Python line that make the recommended run; no command for a scene that has no name here."""
    scene, _, _, horizon, _ = question
    value, name, whole = float(met.setting), met.integrator.name, horizon == scene.horizon
    known = scenes.scenes().get(scene.name) == scene
    shown, control = f'"{name}"' if "[" in name else name, str(met.integrator.control)
    until = "" if whole else f" --horizon {horizon!r}"
    command = f"symtop run {scene.name} {shown} --{control.replace('_', '-')} {value!r}{until}"
    of, until = f'"{scene.name}"' if known else "scene", "" if whole else f", horizon={horizon!r}"
    python = f'symtop.simulate({of}, "{name}", {control}={value!r}{until})'
    return {"command": command if known else "", "python": python}


def _without_steps(question: _Question, best: float) -> str:
    """What the closed form costs beside a run of `best` seconds (nan if there is none), and why it is not advised."""
    scene, _, quantity, horizon, _ = question
    exact = integrator("exact")
    call = bare_run(scene, exact, exact.chart_for(settings.observed(quantity)), math.nan, horizon)
    taken = timings([call], batches=5, batch=0.002)[0].best
    limit = settings.judgeable(scene, quantity, horizon)
    error = f", with an error below {limit:.1g}" if math.isfinite(limit) else ""
    if not best > taken:
        more = f", {taken / best:.2g} times that" if math.isfinite(best) else ""
        return f"The closed form, integrator exact, takes {taken * 1e6:.2g} us{more}{error}, and no step."
    return (
        f"The fastest way is no integrator: the closed form (exact) takes {taken * 1e6:.2g} us, {best / taken:.2g} "
        f"times less{error}. The integrators are compared for what they do where there is no closed form."
    )


@dataclass(frozen=True)
class EngineAdvice:
    """Axis errors (rad) of an engine's settings at a step, and a method that does as well as the best of them.

    `errors` has the settings in the order of the engine, the default first; pi is a run that ended early. `advice` is
    None if even the best setting is no accuracy to match. `gain` is how many times fewer force evaluations it takes.
    """

    scene: str
    engine: str
    step_size: float
    horizon: float
    errors: dict[str, float]
    best: str
    gain: float
    advice: Advice | None

    def __str__(self) -> str:
        default, maps = next(iter(self.errors)), SETTINGS[self.engine]
        lines = [
            f"{self.engine} on {self.scene}, step {self.step_size:g}, to t = {self.horizon:g}: the axis is off by",
            *(f"    {value:.2e} rad  {name} ({maps[name]})" for name, value in self.errors.items()),
        ]
        if self.best != default:
            times = self.errors[default] / self.errors[self.best]
            lines.append(f"Its best setting is {self.best}, {times:.3g} times nearer than {default}.")
        if self.advice is None:
            return "\n".join([*lines, f"No setting is within {WORST:g} rad, so that there is nothing to match."])
        much = f"{self.gain:.3g} times fewer" if self.gain >= 1.0 else f"{1.0 / self.gain:.3g} times more"
        lines.append(f"As near as {self.best} with {much} force evaluations: {self.advice.reason}")
        return "\n".join(lines)


def i_use(engine: str, scene: "str | Scene", *, step_size: float = STEP, horizon: float | None = None) -> EngineAdvice:
    """What the settings of an engine make of a scene at a step, and which method does as well for how much less.

    `step_size` is in the units of the scene, `horizon` its own by default. Raises SymtopError for an engine that is
    not known and for numbers that are out of range. It takes some seconds.
    """
    one_of("engine", engine, SETTINGS)
    start, h = scenes.scene(scene), positive("step_size", step_size)
    end = start.horizon if horizon is None else horizon_of(horizon)
    if h >= end:
        raise SymtopError(f"step_size must be below the horizon {end:g}, not {h:g}", "step_size")
    measured = {name: _error_and_forces(start, method, h, end) for name, method in SETTINGS[engine].items()}
    best = min(measured, key=lambda name: measured[name][0])
    (error, forces), off = measured[best], {name: value for name, (value, _) in measured.items()}
    advice = recommend(start, accuracy=error, horizon=end) if error <= WORST else None
    if advice is None or advice.integrator is None:
        return EngineAdvice(start.name, engine, h, end, off, best, math.nan, None)
    setting: dict[str, Any] = {"step_size": advice.step_size, "tolerance": advice.tolerance}
    needed = simulate(start, advice.integrator, **setting, horizon=end, guard=False, observe="axis")
    gain = forces / float(needed.attrs["force_evaluations"])
    return EngineAdvice(start.name, engine, h, end, off, best, gain, advice)


def _error_and_forces(start: Scene, method: str, h: float, horizon: float) -> tuple[float, float]:
    """The axis error of a map, and its force evaluations."""
    observe = "axis" if "axis" in integrator(method).charts() else "attitude"
    run = simulate(start, method, step_size=h, horizon=horizon, guard=False, observe=observe)
    if run.attrs["outcome"] != "ok":
        return math.pi, float(run.attrs["force_evaluations"])
    return float(errors(run)["axis"].max()), float(run.attrs["force_evaluations"])
