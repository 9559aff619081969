"""The battery: the table of all claims, with the integrators that each applies to and the function that measures it.

It judges registered integrators and bare steps from an adapter, only through their solvers. A claim is refuted only if
its defect is far above the uncertainty of the measurement; both numbers are in the claims table (`findings.Ledger`).
"""

from collections.abc import Callable
from typing import NamedTuple

from symtop.core.errors import SymtopError
from symtop.judging.claims import calls, constants, order, structure
from symtop.judging.claims.subject import Subject
from symtop.judging.findings import AS_WITH, Finding, Ledger, claim_name, inapplicable, undecided
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene

SCENE = "spheroid"


class Stage(NamedTuple):
    """Claims that are measured together."""

    claims: tuple[str, ...]
    applies: tuple[str, ...]  # a registered "integrator", any method on a "body", a bare "step", a map of the "plane"
    measure: Callable[[Subject], list[Finding]]


EVERY = ("integrator", "step", "plane")
TABLE = (
    Stage(("calls",), ("step", "plane"), calls.measure),  # is a step a function of its arguments?
    Stage(("order",), EVERY, order.measure),
    Stage(("time",), ("step",), order.time_order),  # the order where f depends on time
    Stage(("symplectic", "symmetric"), EVERY, structure.measure),
    Stage(constants.OF_A_RUN, EVERY, constants.measure),
    Stage(("pole",), ("integrator", "step"), structure.pole),
    Stage(("order",), ("body",), order.on_body),
    Stage(("energy", "momentum"), ("body",), constants.measure),
)
CLAIMS = tuple(claim for stage in TABLE if "integrator" in stage.applies for claim in stage.claims)


def stages(kind: str) -> list[Stage]:
    """The stages that apply to a `Subject.kind`."""
    return [stage for stage in TABLE if kind in stage.applies]


def measure(stage: Stage, subject: Subject) -> list[Finding]:
    """The findings of a stage; undecided, with the reason, if its measurement fails. SymtopError if "calls" fails."""
    if subject.in_plane and "plane" not in stage.applies:
        return [inapplicable(claim, "a map of (theta, p_theta) does not show it") for claim in stage.claims]
    try:
        findings = {finding.claim: finding for finding in stage.measure(subject)}
    except SymtopError as error:
        if "calls" in stage.claims:
            raise
        return unmeasured(stage.claims, subject, str(error))
    return [findings[claim] for claim in stage.claims]


def unmeasured(claims: tuple[str, ...], subject: Subject, why: str) -> list[Finding]:
    """Undecided findings on claims that could not be measured; only the first states the reason in full."""
    reasons = [why, *[AS_WITH + claim_name(claims[0])] * (len(claims) - 1)]
    return [undecided(claim, subject.declared(claim), words) for claim, words in zip(claims, reasons, strict=True)]


def judge(method: Integrator, scene: Scene, *, quick: bool = False) -> Ledger:
    """Measure every claim of a registered method on a scene; `quick` shortens the runs. On a body: three claims."""
    subject = Subject(method, scene, quick)
    findings = [finding for stage in stages(subject.kind) for finding in measure(stage, subject)]
    return Ledger(method.name, scene.name, tuple(findings), subject.traces)
