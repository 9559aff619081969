"""The battery: one table of every claim, whom it is asked of and what measures it, through nothing but the solvers.

It judges registered integrators, ours and a plug-in's, and bare steps from an adapter. A claim is refuted only far
beyond what the measurement itself leaves in doubt; both numbers are in the ledger (`symtop.judging.findings`).
"""

from collections.abc import Callable
from itertools import groupby
from typing import NamedTuple

from symtop.core.errors import SymtopError
from symtop.judging.claims import bodies, calls, constants, order, structure
from symtop.judging.claims.subject import Subject, declared
from symtop.judging.findings import AS, Finding, Ledger, claim_name, inapplicable, undecided
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene

SCENE = "spheroid"


class Claim(NamedTuple):
    """A claim; those beside one another with the same measurement are measured together."""

    name: str
    applies: tuple[str, ...]  # to a registered "integrator", a bare "step", such a map of the "plane" (theta, p_theta)
    measure: Callable[[Subject], list[Finding]]


Stage = tuple[Claim, ...]  # that are measured together
EVERY = ("integrator", "step", "plane")
TABLE = (
    Claim("calls", ("step", "plane"), calls.measure),  # is a step a function of its arguments?
    Claim("order", EVERY, order.measure),
    Claim("time", ("step",), order.time_order),  # the order where f depends on time
    Claim("symplectic", EVERY, structure.measure),
    Claim("symmetric", EVERY, structure.measure),
    Claim("energy", EVERY, constants.measure),
    Claim("p_phi", EVERY, constants.measure),
    Claim("p_psi", EVERY, constants.measure),
    Claim("axis_length", EVERY, constants.measure),
    Claim("reported", ("integrator",), constants.measure),  # momenta beside those of the states
    Claim("invariant", EVERY, constants.measure),
    Claim("explicit", EVERY, constants.measure),
    Claim("work", EVERY, constants.measure),
    Claim("pole", ("integrator", "step"), structure.pole),
)
CLAIMS = tuple(claim.name for claim in TABLE if "integrator" in claim.applies)


def stages(kind: str) -> list[Stage]:
    """The claims that apply to an "integrator" or a "step", those together that are measured together."""
    chosen = (claim for claim in TABLE if kind in claim.applies)
    return [tuple(group) for _, group in groupby(chosen, key=lambda claim: claim.measure)]


def measure(stage: Stage, subject: Subject) -> list[Finding]:
    """The findings of a stage; undecided, and why, if its measurement breaks. A step that makes no call raises."""
    first = stage[0]
    if subject.in_plane and "plane" not in first.applies:
        return [inapplicable(claim.name, "a map of (theta, p_theta) does not show it") for claim in stage]
    try:
        findings = {one.claim: one for one in first.measure(subject)}
    except SymtopError as error:
        if first.name == "calls":
            raise
        return unmeasured(stage, subject.method, str(error))
    return [findings[claim.name] for claim in stage]


def unmeasured(stage: Stage, method: Integrator, why: str) -> list[Finding]:
    """The findings of a stage that could not be measured: why not is said once."""
    reasons = [why, *(AS + claim_name(stage[0].name) for _ in stage[1:])]
    return [undecided(one.name, declared(method, one.name), words) for one, words in zip(stage, reasons, strict=True)]


def judge(method: Integrator, scene: Scene, *, quick: bool = False) -> Ledger:
    """Measure every claim of a registered method on a scene; `quick` shortens the runs. On a body there are three."""
    if scene.of_body:
        return bodies.judge(method, scene, quick=quick)
    subject = Subject(method, scene, quick)
    findings = [finding for stage in stages("integrator") for finding in measure(stage, subject)]
    return Ledger(method.name, scene.name, tuple(findings), subject.traces)
