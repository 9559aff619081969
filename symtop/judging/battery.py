"""The battery: every claim, whom it is asked of, and what measures it.

One table judges registered integrators, ours and a plug-in's, and bare steps from an adapter, through nothing but their
solvers:

    calls          a step is a function of its arguments (bare steps)                                 (`claims.calls`)
    order          the power series of a step, slopes of the errors, the limit of small steps         (`claims.order`)
    time           the order where f depends on time (bare steps that take f)                        (`claims.series`)
    symplectic     the bracket after one step, in every chart                                     (`claims.structure`)
    symmetric      one step forth and back, in every chart                                        (`claims.structure`)
    energy, p_phi, p_psi, axis_length, invariant      a million steps, in every chart             (`claims.constants`)
    reported       the momenta that a run reports beside those of its states                      (`claims.constants`)
    explicit, work                                    what a step costs, as its solver reports it (`claims.constants`)
    pole           the axis passes a pole exactly                                                      (`claims.pole`)

A map of (theta, p_theta) is judged in its plane (`claims.reduced`). A claim is refuted only far beyond what the
measurement itself leaves in doubt; both numbers are in the ledger (`symtop.judging.findings`).
"""

from collections.abc import Callable
from itertools import groupby
from typing import NamedTuple

from symtop.core.errors import SymtopError
from symtop.judging.claims import calls, constants, order, pole, reduced, series, structure
from symtop.judging.claims.subject import Subject, declared
from symtop.judging.findings import Finding, Ledger, undecided
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene

SCENE = "spheroid"
Measure = Callable[[Subject], list[Finding]]


class Claim(NamedTuple):
    """A claim; those beside one another with the same measurement are measured together."""

    name: str
    applies: tuple[str, ...]  # to a registered "integrator", a bare "step"
    measure: Measure
    in_plane: Measure = reduced.not_shown  # the measurement of a map of (theta, p_theta)


Stage = tuple[Claim, ...]  # that are measured together
EVERY, STEP, INTEGRATOR = ("integrator", "step"), ("step",), ("integrator",)
TABLE = (
    Claim("calls", STEP, calls.measure, calls.measure),
    Claim("order", EVERY, order.measure, reduced.order),
    Claim("time", STEP, series.time_order),
    Claim("symplectic", EVERY, structure.measure, reduced.structure),
    Claim("symmetric", EVERY, structure.measure, reduced.structure),
    Claim("energy", EVERY, constants.measure, reduced.constants),
    Claim("p_phi", EVERY, constants.measure, reduced.constants),
    Claim("p_psi", EVERY, constants.measure, reduced.constants),
    Claim("axis_length", EVERY, constants.measure, reduced.constants),
    Claim("reported", INTEGRATOR, constants.measure),
    Claim("invariant", EVERY, constants.measure, reduced.constants),
    Claim("explicit", EVERY, constants.measure, reduced.constants),
    Claim("work", EVERY, constants.measure, reduced.constants),
    Claim("pole", EVERY, pole.measure),
)
CLAIMS = tuple(claim.name for claim in TABLE if "integrator" in claim.applies)


def stages(kind: str) -> list[Stage]:
    """The claims that apply to an "integrator" or a "step", those together that are measured together."""
    chosen = [claim for claim in TABLE if kind in claim.applies]
    return [tuple(group) for _, group in groupby(chosen, key=lambda claim: claim.measure)]


def measure(stage: Stage, subject: Subject) -> list[Finding]:
    """The findings of a stage; undecided, and why, if its measurement breaks. A step that makes no call raises."""
    first = stage[0]
    try:
        findings = {one.claim: one for one in (first.in_plane if subject.in_plane else first.measure)(subject)}
    except SymtopError as error:
        if first.name == "calls":
            raise
        return unmeasured(stage, subject.method, str(error))
    return [findings[claim.name] for claim in stage]


def unmeasured(stage: Stage, method: Integrator, why: str) -> list[Finding]:
    """The findings of a stage that could not be measured."""
    return [undecided(claim.name, declared(method, claim.name), why) for claim in stage]


def judge(method: Integrator, scene: Scene, *, quick: bool = False) -> Ledger:
    """Measure every claim of a registered method on a scene; `quick` shortens the runs."""
    subject = Subject(method, scene, quick)
    findings = [finding for stage in stages("integrator") for finding in measure(stage, subject)]
    return Ledger(method.name, scene.name, tuple(findings), subject.traces)
