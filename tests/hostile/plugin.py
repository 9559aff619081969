"""A plug-in of integrators that misbehave, each in one way. All are the midpoint rule otherwise."""

import os
import signal
import warnings

import numpy as np

import symtop
from symtop.methods.framework.plan import Run

midpoint = symtop.integrator("midpoint").solvers["angles"]


class UnprintableError(Exception):
    """Cannot say what is wrong."""

    def __str__(self):
        raise ValueError("no words")

    __repr__ = __str__


class OwnBaseError(BaseException):
    """Passes every ``except Exception``."""


class Unprintable:
    """Nothing that a sentence could name."""

    def __repr__(self):
        raise ValueError("no words")


class UnprintableOutcome(str):
    """An outcome that nobody knows, and that cannot be compared."""

    __slots__ = ()

    def __eq__(self, other):
        raise ValueError("no words")

    __hash__ = str.__hash__


def raising(error):
    """Raise it in place of a run."""

    def solve(top, start, plan):
        raise error

    return solve


def returning(value):
    """Return it in place of a run."""
    return lambda top, start, plan: value


def changed(**fields):
    """A good run but for these fields, each a function of the good one."""

    def solve(top, start, plan):
        run = midpoint(top, start, plan)
        return run._replace(**{name: change(getattr(run, name)) for name, change in fields.items()})

    return solve


def changes_arguments(top, start, plan):
    """Writes into the times and marks that it was given, and into the top."""
    run = midpoint(top, start, plan)
    plan.times[:] = -7.0
    plan.marks[:] = 0
    object.__setattr__(top, "I1", 1e9)
    object.__setattr__(start, "theta", 3.0)
    return run


def changes_and_raises(top, start, plan):
    """Writes into the top, and does not return."""
    object.__setattr__(top, "I1", 1e9)
    raise ValueError("no")


def recurses(top, start, plan):
    """Never comes to an end of its own calls."""
    return recurses(top, start, plan)


def warns(top, start, plan):
    """Runs well, and makes every warning an error from then on."""
    run = midpoint(top, start, plan)
    warnings.simplefilter("error")
    return run


def keeps_its_array(top, start, plan, runs=[]):  # noqa: B006
    """Returns states that it changes in the next call."""
    run = midpoint(top, start, plan)
    for states in runs:
        states[:] = np.nan
    runs[:] = [run.states]
    return run


def drops_errstate(top, start, plan):
    """Runs well, and makes NumPy raise from then on."""
    np.seterr(all="raise")
    return midpoint(top, start, plan)


def signals_itself(top, start, plan):
    """Sends its own process what Ctrl-C sends."""
    os.kill(os.getpid(), signal.SIGINT)
    return midpoint(top, start, plan)


def forwards_only(top, start, plan):
    """Adds up the size of its step until the horizon, which a step backwards never reaches."""
    t = 0.0
    while t != plan.horizon and (t < plan.horizon or plan.step_size < 0.0):
        t += abs(plan.step_size)
    return midpoint(top, start, plan)


def each(field, **changes):
    """Good runs but for one field, by its name and that of the change."""
    return {f"{field}-{name}".replace("_", "-"): changed(**{field: change}) for name, change in changes.items()}


REFUSED = {
    **each("states", text=lambda states: [["x"] * 4] * len(states), turned=lambda states: states.T,
           ragged=lambda states: [[1.0]] * (len(states) - 1) + [[1.0, 2.0]], complex=lambda states: states + 0j,
           objects=lambda states: np.full(states.shape, None), short=lambda states: states[:-1],
           dates=lambda states: np.zeros(states.shape, "datetime64[s]"), unprintable=lambda _: Unprintable()),
    **each("p_phi", text=lambda values: ["x"] * len(values), complex=lambda values: values + 1j,
           scalar=lambda values: float(values[0])),
    **each("outcome", unknown=lambda _: "splendid", number=lambda _: 0, list=lambda _: ["ok"],
           unprintable=lambda _: UnprintableOutcome("ok")),
    **each("p_psi", dict=lambda _: {"p_psi": 1.0}), **each("reached", text=lambda _: "the end"),
    **each("steps", text=lambda _: "many"), **each("force_evaluations", complex=lambda _: 1j),
    **each("newton_iterations", object=lambda _: object()),
    "returns-none": returning(None), "returns-unprintable": returning(Unprintable()), "returns-class": returning(Run),
    "returns-plain-tuple": lambda top, start, plan: tuple(midpoint(top, start, plan)),
    "raises-value-error": raising(ValueError("one\ntwo")), "raises-memory-error": raising(MemoryError()),
    "raises-generator-exit": raising(GeneratorExit()), "raises-unprintable": raising(UnprintableError()),
    "raises-base": raising(OwnBaseError("of its own")), "raises-system-exit": raising(SystemExit(0)),
    "raises-interrupt": raising(KeyboardInterrupt()), "recurses": recurses, "takes-two": lambda top, start: None,
    "changes-arguments": changes_arguments, "changes-and-raises": changes_and_raises,
}  # fmt: skip  # each must end in one sentence and code 2
TOLERATED = {
    **each("states", float32=lambda states: states.astype(np.float32), nested_list=lambda states: states.tolist(),
           long_double=lambda states: states.astype(np.longdouble), fortran=np.asfortranarray,
           read_only=lambda states: np.broadcast_to(states, states.shape), masked=np.ma.masked_invalid),
    **each("p_phi", list=lambda values: values.tolist()), **each("steps", float=float),
    "keeps-its-array": keeps_its_array, "drops-errstate": drops_errstate, "warns": warns,
}  # fmt: skip  # each is a run like another
BROKEN = {
    **each("states", nan=lambda states: states * np.nan, infinite=lambda states: states + np.inf),
    "reached-nan": changed(outcome=lambda _: "not_finite", reached=lambda _: np.nan),
}  # each is a run that failed, exit code 3

OTHERS = {"signals-itself": signals_itself, "forwards-only": forwards_only}
for name, solve in (REFUSED | TOLERATED | BROKEN | OTHERS).items():
    symtop.register(symtop.Integrator(name, "other", "misbehaves", {"angles": solve}, implementation="python"))
