"""`recommend`: the cheapest integrator, with its step or tolerance, that meets an accuracy on a scene.

    1. Candidates. A table from the study of cost names five methods (`symtop.measure.ranking`). A sixth is tried if the
       trials disagree with the table: three of the five fail, its fourth or fifth is the fastest, or two are almost
       equally fast. If the table has no such row, or none of its methods serves, every compiled method is a candidate.
    2. Trials. The step or tolerance of each candidate is searched for on 120 nutations of the scene at most
       (`symtop.measure.settings`), against the closed form and a target lowered by the law of growth; one run is timed.
       Errors reach the target to a factor only: times are scaled to the error asked for.
    3. Confirmation. The three fastest candidates, and others as fast, are run to the whole horizon, if a budget of
       force evaluations allows it, and their settings are corrected, to some 5 % of a step.

The confidence of the advice is one of:

    checked                    it was run to the end, and its error with the reference's bound is below the accuracy
    at the reference's limit   it was run to the end, but its error with the reference's bound exceeds the accuracy
    extrapolated               it was not run to the end
    none                       no method meets the accuracy; the integrator is None

The recommended method neither is made for the symmetric top only nor evaluates its solution (`Integrator.needs`); the
best of those methods is named in addition. With a given step there is no search: all methods run with that step.

For an accuracy below the bound of the reference the confidence is ``none``, without a run. The closed form is no
candidate: errors are measured by it, and a top with friction, drive or another body attached has no closed form. For
the pure top it is mostly the fastest way, and the advice says so with its time.
"""

import math
import re
import shlex
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from symtop.core.errors import SymtopError, boolean, entries, one_of, positive
from symtop.core.progress import kernels_to_compile, post
from symtop.judging.claims.subject import declared
from symtop.measure import settings
from symtop.measure.errors import QUANTITIES
from symtop.measure.phase import FREQUENCIES
from symtop.measure.ranking import cheapest
from symtop.methods.framework import registry
from symtop.methods.framework.registry import NEEDS, Integrator, integrator, is_built_in, split_name
from symtop.model import scenes
from symtop.model.charts import BODY
from symtop.model.exact import closed_form
from symtop.model.scenes import Scene, horizon_of
from symtop.run.guard import MOST_STEPS
from symtop.run.plugins import loaded

THIS_TOP = ("this-top", "solution")  # needs of methods that are only named in addition, unless the user asks for them
OF_ANY = tuple(need for need in NEEDS if need not in THIS_TOP)  # needs of methods that may be recommended by default
COMMA = re.compile(r",\s*(?![^(]*\))")  # a comma between words of `NEEDS`, not that in f(t, y)
KEPT = {"energy": ("energy",), "momenta": ("p_phi", "p_psi")}  # the claims for each value of `keeps`
INACCURATE = "Not accurate enough at this step, each with its error"  # the reason why a method fails at a given step
KERNELS_A_METHOD = 0.65  # expected kernels to compile per method: some methods share one
MOST_LISTED = 5  # methods of the table that are tried
ENOUGH, TIE_RATIO = 3, 1.1  # one more is tried if fewer serve, the fastest is not among the first, the next as fast
FINALISTS, FINALIST_RATIO = 3, 1.3  # least methods run to the whole horizon; ratio of costs up to which others are, too
GIVE_UP_RATIO = 40.0  # a search ends at this multiple of the evaluations of the cheapest candidate so far
LEAST_EVALUATIONS = 1e5  # evaluations below which no search ends: it may have begun with a step that is far too fine
LOWER_BUDGET = 3e7  # evaluations of a run after `ENOUGH` methods have failed and none has served: then often none does
HOPELESS_REASONS = (settings.STOPPED, settings.BUDGET, settings.TRIED)  # that count for `LOWER_BUDGET`
CONFIDENCE = {
    "checked": "measured to the end",
    "at the reference's limit": "measured to the end, as far as the reference can tell",
    "extrapolated": "extrapolated from a short run",
}
LEAST_LEAD = 1.05  # least ratio of times with which the closed form is called the fastest way
CLOSE_TO_TARGET = 0.85  # a search for a finalist ends at an error between this part of the target and the target
TIMING_ROUNDS = 15  # of timing, for finalists
SAMPLE_MARGIN = 0.8  # part of the accuracy that the errors at samples must meet; between samples errors may be larger


@dataclass(frozen=True)
class Advice:
    """A recommended integrator with its step or tolerance, and the confidence of that.

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
    beside: str = ""
    closed_form: str = ""
    fails: tuple[str, ...] = ()
    command: str = ""
    python: str = ""

    def __str__(self) -> str:
        lines = [
            self.reason, self.runner_up and f"Runner-up: {self.runner_up}", self.beside, self.closed_form,
            *self.fails, self.command and f"Run it: {self.command}", self.python and f"In Python: {self.python}",
        ]  # fmt: skip
        return "\n".join(filter(None, lines))


class _Question(NamedTuple):
    scene: Scene
    accuracy: float
    quantity: str
    horizon: float
    needs: tuple[str, ...]  # of the methods that may be recommended; empty: the default
    step: float | None = None  # the step of all methods, if given
    max_step: float = math.inf
    general: bool = False
    keeps: Collection[str] = ()
    time_a_step: float = math.inf  # most seconds of a step

    @property
    def goal(self) -> str:
        """The question in words."""
        end = f"t = {self.horizon:g}{self.scene.second}"
        return f"{self.quantity} error {self.accuracy:g} on {self.scene.name} to {end}"

    def advice(self, **facts: Any) -> Advice:
        return Advice(self.scene.name, self.quantity, self.accuracy, self.horizon, **facts)

    def trial(self, run: settings.Attempt) -> "_Trial":
        """The trial of a candidate that was run to the horizon, or failed; seconds are not known yet."""
        confidence = "checked" if run.error + run.bound <= self.accuracy else "at the reference's limit"
        return _Trial(run, run.error, math.nan, confidence, self.horizon)

    def allows(self, method: Integrator) -> bool:
        """Does a method meet the user's conditions, apart from its error?"""
        claims = [claim for kept in self.keeps for claim in KEPT[kept]]
        conserving = all(declared(method, claim) in ("kept", "bounded") for claim in claims)
        fixed = self.step is None and self.max_step == self.time_a_step == math.inf
        suits = not self.general or BODY in integrator(method.method).solvers  # in any chart
        return conserving and (fixed or method.fixed_step) and suits


class _Trial(NamedTuple):
    """A candidate with its setting, the error expected at the horizon, and the wall time of the whole run."""

    run: settings.Attempt
    error: float
    seconds: float
    confidence: str  # a key of CONFIDENCE
    horizon: float

    @property
    def a_step(self) -> float:
        """Seconds of a step; infinite for a method without fixed steps."""
        return self.seconds * self.run.setting / self.horizon if self.run.integrator.fixed_step else math.inf

    def cost(self, question: _Question) -> float:
        """Seconds of a run with exactly the accuracy, and steps up to `max_step`; of the run itself at a given step."""
        ratio = 1.0 if question.step is not None else self.error / question.accuracy
        factor = max(settings.at_accuracy(self.run.integrator, ratio), self.run.setting / question.max_step)
        return self.seconds * factor

    def words(self) -> str:
        control = (self.run.integrator.control or "nothing").replace("_", " ")
        return f"{self.run.integrator.name} with {control} {self.run.setting:.4g}"


def recommend(
    scene: str | Scene, *, accuracy: float, quantity: str | None = None, horizon: float | None = None,
    needs: str | Collection[str] | None = None, step_size: float | None = None,
    max_step: float | None = None, general: bool = False, keeps: str | Collection[str] | None = None,
    time_a_step: float | None = None,
) -> Advice:  # fmt: skip
    """The cheapest integrator, with its step or tolerance, that keeps the error of `quantity` below `accuracy`.

    `accuracy` is the largest error of `quantity`, by default of the axis, over the run: radians for ``axis``,
    ``attitude`` and ``theta``, and relative for others, energy and momenta by the scales of `symtop.errors`. `horizon`
    is the scene's own by default. For a body without symmetry the `quantity` is the attitude by default, the candidates
    are the methods of the chart ``body``, and `keeps` may only be "energy". `needs` excludes methods with other needs
    (`Integrator.needs`), for example ``("derivative", "kicks")``, or by what you can supply, ``"f(t, y), torque, free
    motion"``; without it, methods for the symmetric top only are not recommended but named in `Advice.beside`.

    With `step_size` every method of fixed step runs with that step, and the fastest that is accurate enough is
    recommended. `max_step` is the longest step, `time_a_step` the most seconds of one on this machine. `general`
    excludes methods that do not run on bodies without symmetry, `keeps` ("energy", "momenta" or both) those that let
    these drift.

    Raises SymtopError for arguments out of range, and for a `horizon` beyond the reference of a body. Candidates are
    run: once they are compiled, this takes 0.1 s to half a minute, and minutes if rounding stops most methods.
    """
    scene = scenes.scene(scene, bodies=True)
    quantity = ("attitude" if scene.of_body else "axis") if quantity is None else quantity
    classes = _needs(_words("needs", needs))
    accuracy = positive("accuracy", accuracy)
    one_of("quantity", quantity, settings.OF_BODY if scene.of_body else (*QUANTITIES, *FREQUENCIES))
    if quantity in settings.ANGLES and accuracy >= math.pi:
        raise SymtopError(f"accuracy must be below pi, beyond which every angle is right, not {accuracy!r}", "accuracy")
    horizon = scene.horizon if horizon is None else horizon_of(horizon)
    limit = settings.judgeable(scene, quantity, horizon)
    if math.isnan(limit):
        raise SymtopError(f"quantity must be one that the motion of {scene.name} has, not {quantity!r}", "quantity")
    step = None if step_size is None else positive("step_size", step_size)
    if step is not None and not horizon / MOST_STEPS <= step < horizon:
        words = f"below the horizon {horizon:g}, of which at most {MOST_STEPS:g} steps are run, not {step:g}"
        raise SymtopError(f"step_size must be {words}", "step_size")
    longest = math.inf if max_step is None else positive("max_step", max_step)
    if step is not None and step > longest:
        raise SymtopError(f"step_size must be at most max_step {longest:g}, not {step:g}", "step_size", "max_step")
    time_a_step = math.inf if time_a_step is None else positive("time_a_step", time_a_step)
    constants = tuple(one_of("keeps", word, [*KEPT][: 1 if scene.of_body else None]) for word in _words("keeps", keeps))
    limits = step, longest, boolean("general", general), constants, time_a_step
    question = _Question(scene, accuracy, quantity, horizon, classes, *limits)
    if accuracy < limit:
        source = f"no run was made, as that is below {limit:.2g}, the least error that the reference can judge"
        return _advice(question, [], (), source)
    if {*classes} == {"solution"} and not scene.of_body and question.allows(integrator("exact")):
        return _exact_advice(question, limit)
    names, source = _candidates(question)
    search = _Search(question, names, _menu(question))
    ranked, beside, fails = search.answers(), search.beside(), search.fails
    if search.widened:
        source = f"tried all {search.widened} compiled methods that you can use"
    elif search.of_table:
        source = f"tried the {search.of_table} methods that {source}"
    # times of the user's methods in plain Python cannot be compared with those of compiled ones
    every = registry.integrators().values()
    if own := [method.name for method in every if method.implementation == "python" and not is_built_in(method.name)]:
        fails["Not tried, as only compiled methods are timed"] = own
    errors = [f"{name} {error:.2e}" for name, error in sorted(search.errors_at_step.items(), key=lambda item: item[1])]
    fails = ({INACCURATE: errors} if errors else {}) | fails
    sentences = tuple(f"{reason}: {', '.join(names)}." for reason, names in fails.items())
    return _advice(question, ranked, sentences, source, beside)


def _words(name: str, value: object) -> list[object]:
    """The entries of a list, or of a text with commas; empty for None."""
    if isinstance(value, str):
        return [*COMMA.split(value.strip())]
    return [] if value is None else entries(name, value)


def _needs(choice: Collection[object]) -> tuple[str, ...]:
    """Names of `NEEDS`, from names or words of them: words that make up no need whole select all that contain them."""
    parts = {name: set(COMMA.split(words)) for name, words in NEEDS.items()}
    terms = dict.fromkeys([*NEEDS, *sorted(set().union(*parts.values()))])
    choices = COMMA.split(", ".join(str(term).strip() for term in choice)) if choice else []
    words = {one_of("needs", word, terms) for word in choices}
    complete = [name for name in NEEDS if name in words or parts[name] <= words]
    rest = words.difference(NEEDS, *(parts[name] for name in complete))
    return tuple(name for name in NEEDS if name in complete or parts[name] & rest)


class _Search:
    """Trials of candidates, `names`, and of all methods if those of the table, `menu`, do not serve."""

    def __init__(self, question: _Question, names: Collection[str], menu: list[str]) -> None:
        self.question, self.names, self.menu = question, names, menu
        self.trials: list[_Trial] = []  # the fastest first
        self.fails: dict[str, list[str]] = {}  # names of methods by the reason why they failed
        self.errors_at_step: dict[str, float] = {}  # errors of methods that are too inaccurate at the given step
        self.widened = 0  # the number of all methods, if all had to be tried
        self._try(names)
        costs = {name: trial.cost(question) for trial in self.trials if (name := trial.run.integrator.name) in menu}
        first, second, *_ = [*costs.values(), math.inf, math.inf]
        self.of_table = len(menu[:MOST_LISTED])  # methods of the table that were tried
        if menu and (len(costs) < ENOUGH or menu.index(next(iter(costs))) >= ENOUGH or second < TIE_RATIO * first):
            self._try(menu[MOST_LISTED : MOST_LISTED + 1])
            self.of_table = len(menu[: MOST_LISTED + 1])
        no_answer = () if question.needs else THIS_TOP
        self._of_top = [trial for trial in self.trials if trial.run.integrator.needs in no_answer][:1]
        self._general = [trial for trial in self.trials if trial.run.integrator.needs not in no_answer]

    def answers(self) -> list[_Trial]:
        """The finalists, which were run to the end, the fastest first."""
        ranked = self._confirmed(self._general, FINALISTS)
        if not ranked and self.menu:
            usable = _usable(self.question._replace(needs=self.question.needs or OF_ANY))
            self.widened, others = len(usable), {*usable} - {*self.names, *self.menu}
            self._try(others)
            ranked = self._confirmed([trial for trial in self.trials if trial.run.integrator.name in others], FINALISTS)
        return _timed(self.question, ranked, self.fails, TIMING_ROUNDS)

    def beside(self) -> list[_Trial]:
        """The fastest method made for the symmetric top only, run to the end; empty without one."""
        return _timed(self.question, self._confirmed(self._of_top, 1), self.fails)

    def _try(self, names: Collection[str]) -> None:
        """Try methods, high orders first: these are the cheapest at most accuracies, and limit the other searches."""
        kernels_to_compile[0] = math.ceil(KERNELS_A_METHOD * len(names))
        for number, method in enumerate(sorted(map(integrator, names), key=lambda method: -(method.order or 0)), 1):
            post(f"trying method {number} of {len(names)}")
            rivals = [trial.run.evaluations for trial in self.trials if trial.run.integrator.needs not in THIS_TOP]
            patience = max(GIVE_UP_RATIO * min(rivals, default=math.inf), LEAST_EVALUATIONS)
            failures = sum(len(self.fails.get(why, ())) for why in HOPELESS_REASONS)
            limit = LOWER_BUDGET if failures >= ENOUGH and not rivals else math.inf
            self._sort_in(_trial(self.question, method, patience, limit), self.trials)
        timed = _timed(self.question, self.trials, self.fails)
        self.trials = sorted(timed, key=lambda trial: trial.cost(self.question))

    def _confirmed(self, trials: Sequence[_Trial], count: int) -> list[_Trial]:
        """Confirm the first `count` trials and those as fast, or more until one is confirmed."""
        ranked: list[_Trial] = []
        costs = [trial.cost(self.question) for trial in trials]
        for number, trial in enumerate(trials):
            if number < count or not ranked or costs[number] <= FINALIST_RATIO * costs[0]:
                self._sort_in(_confirm(self.question, trial), ranked)
        return ranked

    def _sort_in(self, trial: _Trial, trials: list[_Trial]) -> None:
        """Add the result of `_trial` or `_confirm` to `trials`, or the method to `errors_at_step` or `fails`."""
        if not trial.run.why:
            trials.append(trial)
        elif trial.run.why == INACCURATE:
            self.errors_at_step[trial.run.integrator.name] = trial.error
        else:
            self.fails.setdefault(trial.run.why, []).append(trial.run.integrator.name)


def _usable(question: _Question) -> list[str]:
    """Every compiled method that the user can use, in each chart that determines the quantity."""
    if question.scene.of_body:
        names = [method.name for method in registry.methods().values() if BODY in method.solvers]
    else:
        rows = settings.compared(settings.observed(question.quantity))
        names = [row.name if len(integrator(row.method).charts()) > 1 else row.method for row in rows]
    needs, entries = question.needs, {name: integrator(name) for name in names}
    return [
        name
        for name, method in entries.items()
        if method.control is not None and method.implementation == "compiled" and (not needs or method.needs in needs)
        and question.allows(method)
    ]  # fmt: skip


def _usable_name(variant: str, usable: Sequence[str]) -> str | None:
    """The name in `usable` of a variant, or of its method in another chart; None if there is neither."""
    method = split_name(variant)[0]
    return next((name for name in (variant, *usable) if name in usable and split_name(name)[0] == method), None)


def _menu(question: _Question) -> list[str]:
    """The first six usable methods of the table, with `keeps` (of tops alone) those that keep these first; or none."""
    scene, accuracy, quantity, horizon = question[:4]
    if question.step is not None or question.max_step < math.inf or question.time_a_step < math.inf:
        return []
    if question.keeps and scene.of_body:
        return []
    key, general = (quantity, accuracy, horizon / scene.time_scale(horizon)), question.general or scene.of_body
    rows, usable = cheapest(question.needs, *key, general=general), _usable(question)
    if question.keeps and not question.needs:
        rows += cheapest(OF_ANY, *key, general=general)
    menu = list(dict.fromkeys(name for row in rows if (name := _usable_name(row, usable))))[: MOST_LISTED + 1]
    return menu if len(menu) >= ENOUGH or not question.keeps else []


def _candidates(question: _Question) -> tuple[list[str], str]:
    """The names of methods to try, and a phrase on their origin."""
    usable = _usable(question)
    if not usable:
        return usable, "no compiled method is within these limits"
    if question.step is not None:
        return usable, f"tried all {len(usable)} compiled methods of fixed step that you can use"
    of_top = [] if question.needs else _menu(question._replace(needs=THIS_TOP[:1]))[:1]  # named beside the answer
    menu = _menu(question)[:MOST_LISTED]
    if not menu:
        return usable, f"tried all {len(usable)} compiled methods"
    users = [name for name in usable if not is_built_in(name)]
    return list(dict.fromkeys([*menu, *users, *of_top])), "a study of random tops found the cheapest for such questions"


def _trial(question: _Question, method: Integrator, patience: float, limit: float) -> _Trial:
    """A trial with a setting from short runs, or with the given step; its `run.why` is the reason of a failure."""
    scene, accuracy, quantity, horizon = question[:4]
    if question.step is not None:
        try:
            run = settings.attempt(scene, method, question.step, horizon, quantity)
        except SymtopError as error:  # a start at a pole, for a method in the angles chart
            return question.trial(settings.unmet(method, horizon, f"Not run, as {error}"))
        reason = INACCURATE if math.isfinite(run.error) else "No run ends well at this step"
        return question.trial(run._replace(why="" if run.error <= accuracy else reason))
    period = scene.nutation_period
    short = min(horizon, settings.TRIAL_NUTATIONS * period) if math.isfinite(period) else horizon
    law = (short / horizon) ** settings.growth(method, quantity)
    best = settings.search(
        scene, method, accuracy * law, quantity, short, patience=min(patience, limit), longest=question.max_step
    )  # fmt: skip
    if best.why == settings.BUDGET and patience < min(settings.MOST_EVALUATIONS[method.implementation], limit):
        best = best._replace(why=f"Not within {GIVE_UP_RATIO:g} times the work of the best")
    if method.fixed_step and horizon / best.setting > MOST_STEPS:
        best = best._replace(why=f"Would need more than {MOST_STEPS:.0e} steps")
    return _Trial(best, best.error / law, math.nan, "extrapolated", horizon)


def _timed(question: _Question, trials: list[_Trial], fails: dict[str, list[str]], rounds: int = 5) -> list[_Trial]:
    """The trials with times, measured against each other, the fastest first; slow steps are noted in `fails`."""
    runs = [trial.run for trial in trials]
    times = settings.seconds(question.scene, runs, question.quantity, question.horizon, rounds)
    pairs = zip(trials, times, strict=True)
    timed = sorted((trial._replace(seconds=time) for trial, time in pairs), key=lambda trial: trial.seconds)
    slow = [trial.run.integrator.name for trial in timed if trial.a_step > question.time_a_step]
    if slow:
        fails.setdefault(f"A step takes over {question.time_a_step:g} s", []).extend(slow)
    return [trial for trial in timed if trial.a_step <= question.time_a_step]


def _confirm(question: _Question, trial: _Trial) -> _Trial:
    """The trial run to the whole horizon, if affordable, with its setting corrected; its `run.why` as in `_trial`."""
    scene, accuracy, quantity, horizon = question[:4]
    if question.step is not None:
        return trial
    short = trial.run
    if short.evaluations * horizon / short.horizon > settings.MOST_EVALUATIONS[short.integrator.implementation]:
        run = settings.rounded(scene, short, accuracy * short.error / (trial.error or 1.0), quantity)
        return trial._replace(run=run, error=trial.error * run.error / (short.error or 1.0))
    best = settings.search(
        scene, short.integrator, SAMPLE_MARGIN * accuracy, quantity, horizon, short.setting, least=CLOSE_TO_TARGET,
        longest=question.max_step,
    )  # fmt: skip
    if best.why:
        why = f"Good enough over a short run but not to the end ({best.why[0].lower()}{best.why[1:]})"
        return question.trial(best._replace(why=why))
    return question.trial(settings.rounded(scene, best, SAMPLE_MARGIN * accuracy, quantity))


def _advice(
    question: _Question, ranked: Sequence[_Trial], fails: tuple[str, ...], source: str,
    beside: Sequence[_Trial] = (),
) -> Advice:  # fmt: skip
    scene, goal = question.scene, question.goal
    if not ranked:
        reason = f"Nothing that was tried meets {goal}; {source}."
        words = _exact_words(question, math.nan)
        return question.advice(reason=reason, beside=_special_methods(beside), closed_form=words, fails=fails)
    best = ranked[0]
    name, fixed = best.run.integrator.name, best.run.integrator.fixed_step
    result = f"Error {best.error:.2g} ({CONFIDENCE[best.confidence]}) in {best.seconds:.2g} s"
    if fixed:
        count = scene.time_scale(question.horizon) / best.run.setting
        result += f"; steps are {count:.3g} a {scene.period_word}, {1e6 * best.a_step:.2g} us each"
    need = best.run.integrator.needs
    requirement = f"It needs {NEEDS[need]} ({need})." if need else ""
    use = f"{requirement}{_carry_over(question, best.run.integrator)}".strip()
    sentences = f"{best.words()} meets {goal}.", f"{result}.", use, f"{source[0].upper()}{source[1:]}."
    runners = [f"{trial.words()}, {_relative_time(trial.seconds / best.seconds)}." for trial in ranked[1:2]]
    setting = {str(best.run.integrator.control): best.run.setting}
    return question.advice(
        integrator=name, expected_error=best.error, seconds=best.seconds, confidence=best.confidence, fails=fails,
        reason="\n".join(filter(None, sentences)),
        runner_up="".join(runners), beside=_special_methods(beside, best.seconds),
        closed_form=_exact_words(question, best.seconds), **setting,
        **_lines(question, best.run.integrator, **setting),
    )  # fmt: skip


def _factor_words(ratio: float) -> str:
    """A factor: "1.1 times", "210 times"."""
    return f"{float(f'{ratio:.2g}'):g} times"


def _relative_time(ratio: float) -> str:
    return "in the same time" if _factor_words(ratio) == "1 times" else f"{_factor_words(ratio)} the time"


def _exact_advice(question: _Question, limit: float) -> Advice:
    closed_form.compile_now()  # its time is the answer
    exact, seconds = integrator("exact"), _exact_seconds(question)
    reason = (
        f"exact, the closed form, meets {question.goal}.\n"
        f"Error below {limit:.2g} in {seconds:.2g} s, without steps.\n"
        f"It needs {NEEDS['solution']} (solution).{_carry_over(question, exact)}"
    )
    return question.advice(
        integrator=exact.name, expected_error=limit, seconds=seconds, confidence="at the reference's limit",
        reason=reason, **_lines(question, exact),
    )  # fmt: skip


def _carry_over(question: _Question, method: Integrator) -> str:
    """A sentence on whether a method of a top carries over to a body without symmetry."""
    if question.scene.of_body:
        return ""
    if method.general is not True:
        return " It does not carry over to a body without symmetry."
    if BODY not in integrator(method.method).solvers:
        return " It carries over to a body without symmetry, which symtop does not run it on."
    return " It carries over to a body without symmetry, in chart body; its step does not: ask again with that body."


def _special_methods(trials: Sequence[_Trial], best: float = math.nan) -> str:
    times = [f", {_relative_time(trial.seconds / best)}" if math.isfinite(best) else "" for trial in trials]
    return "".join(f"Made for this top: {trial.words()}{time}." for trial, time in zip(trials, times, strict=True))


def _lines(question: _Question, method: Integrator, **setting: float) -> dict[str, str]:
    """The command and the Python line of the recommended run; no command for a scene that is not registered."""
    scene, _, _, horizon = question[:4]
    in_catalogue = scenes.all_scenes().get(scene.name) == scene
    label, end = f'"{scene.name}"' if in_catalogue else "scene", f", horizon={horizon!r}" * (horizon != scene.horizon)
    option = "".join(f", {name}={float(value)!r}" for name, value in setting.items())
    python = f'symtop.simulate({label}, "{method.name}"{option}{end})'
    return {"command": command_of(scene, method.name, horizon, **setting) if in_catalogue else "", "python": python}


def command_of(scene: Scene, method: str, horizon: float, **setting: float | None) -> str:
    """The command that runs a method on a scene."""
    label = f'"{method}"' if "[" in method else method
    values = ((name.replace("_", "-"), value) for name, value in setting.items() if value is not None)
    option = "".join(f" --{name} {float(value)!r}" for name, value in values)
    end = "" if horizon == scene.horizon else f" --horizon {horizon!r}"
    files = "".join(f" --plugin {shlex.quote(file)}" for file in loaded())
    return f"symtop run {scene.name} {label}{option}{end}{files}"


def _exact_seconds(question: _Question) -> float:
    scene, _, quantity, horizon = question[:4]
    exact = settings.Attempt(integrator("exact"), math.nan, 0.0, 0.0, horizon, 0.0)
    return settings.seconds(scene, [exact], quantity, horizon)[0]


def _exact_words(question: _Question, best: float) -> str:
    """Sentences on the time of the closed form, compared with a run of `best` seconds (nan: none)."""
    scene, _, quantity, horizon = question[:4]
    if scene.of_body:
        return "A free body needs no integrator: symtop.reference evaluates its exact motion." if scene.top.free else ""
    limit = settings.judgeable(scene, quantity, horizon)
    error = f", with an error below {limit:.1g}" if math.isfinite(limit) else ""
    if not closed_form.load():  # compiling takes 10 s, and its time without compiling is of no use
        return f"The closed form, integrator exact, takes no step{error}."
    seconds = _exact_seconds(question)
    if not best > LEAST_LEAD * seconds:
        ratio = f", {_factor_words(seconds / best)} that" if math.isfinite(best) else ""
        return f"The closed form, integrator exact, takes {seconds * 1e6:.2g} us{ratio}{error}, and no step."
    fastest = f"The fastest way is no integrator: the closed form (exact) takes {seconds * 1e6:.2g} us"
    why = "Integrators are compared for what they do where it does not exist."
    return f"{fastest}, {_factor_words(best / seconds)} less{error}. {why}"
