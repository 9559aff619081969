"""The battery: one table of every claim, whom it is asked of and what measures it, through nothing but the solvers.

It judges registered integrators, ours and a plug-in's, and bare steps from an adapter. A claim is refuted only far
beyond what the measurement itself leaves in doubt; both numbers are in the ledger (`symtop.judging.findings`).
"""

from collections.abc import Callable
from typing import NamedTuple

from symtop.core.errors import SymtopError
from symtop.judging.claims import calls, constants, order, structure
from symtop.judging.claims.subject import Subject, declared
from symtop.judging.findings import AS, Finding, Ledger, claim_name, inapplicable, undecided
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene

SCENE = "spheroid"


class Stage(NamedTuple):
    """Claims that are measured together."""

    claims: tuple[str, ...]
    applies: tuple[str, ...]  # to a registered "integrator", on a "body" or not, a bare "step", such a map of a "plane"
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
    """What applies to a `Subject.kind`."""
    return [stage for stage in TABLE if kind in stage.applies]


def measure(stage: Stage, subject: Subject) -> list[Finding]:
    """The findings of a stage; undecided, and why, if its measurement breaks. A step that makes no call raises."""
    if subject.in_plane and "plane" not in stage.applies:
        return [inapplicable(claim, "a map of (theta, p_theta) does not show it") for claim in stage.claims]
    try:
        findings = {one.claim: one for one in stage.measure(subject)}
    except SymtopError as error:
        if "calls" in stage.claims:
            raise
        return unmeasured(stage.claims, subject.method, str(error))
    return [findings[claim] for claim in stage.claims]


def unmeasured(claims: tuple[str, ...], method: Integrator, why: str) -> list[Finding]:
    """The findings on claims that could not be measured: why not is said once."""
    reasons = [why, *[AS + claim_name(claims[0])] * (len(claims) - 1)]
    return [undecided(claim, declared(method, claim), words) for claim, words in zip(claims, reasons, strict=True)]


def judge(method: Integrator, scene: Scene, *, quick: bool = False) -> Ledger:
    """Measure every claim of a registered method on a scene; `quick` shortens the runs. On a body there are three."""
    subject = Subject(method, scene, quick)
    findings = [finding for stage in stages(subject.kind) for finding in measure(stage, subject)]
    return Ledger(method.name, scene.name, tuple(findings), subject.traces)
