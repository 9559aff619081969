"""The claims ledger: what an integrator says about itself, what a battery of measurements says, and a verdict.

One battery judges every integrator alike, ours, a plug-in's and one from a socket, through nothing but its solvers:

    order          the power series of a step, slopes of the errors, the limit of small steps         (`claims_series`)
    symplectic     the bracket after one step, in every chart                                     (`claims_structure`)
    symmetric      one step forth and back, in every chart                                        (`claims_structure`)
    energy, p_phi, p_psi, axis_length, invariant      a million steps, in every chart             (`claims_constants`)
    reported       the momenta that a run reports beside those of its states                      (`claims_constants`)
    explicit, work                                    what a step costs                           (`claims_constants`)
    pole           the axis passes a pole exactly                                                      (`claims_pole`)

A claim is refuted only far beyond what the measurement itself leaves in doubt; both numbers are in the ledger
(`symtop.judging.findings`). Nothing claimed of the energy means what the other claims imply: kept if it is among the
conserved quantities, bounded if the method is symplectic and its step fixed (Benettin, Giorgilli, J. Stat. Phys. 74
(1994) 1117). Work and iterations are what the solver reports.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from symtop.core.errors import SymtopError
from symtop.judging.claims_constants import declared_claims, over_steps
from symtop.judging.claims_pole import pole, pole_claim
from symtop.judging.claims_series import order
from symtop.judging.claims_structure import structure
from symtop.judging.findings import CLAIMS, Finding, Ledger, undecided, yes_no
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import Scene

SCENE = "spheroid"


class Budget(NamedTuple):
    """How much a battery may run; None is what an integrator's implementation is given by default."""

    quick: bool = False
    long_steps: float | None = None  # of a long run
    finest: float | None = None  # steps of the longest run of the order


class Stage(NamedTuple):
    """Claims that are measured together."""

    claims: tuple[str, ...]
    measure: Callable[[], dict[str, Finding]]


Traces = dict[str, np.ndarray]


def stages(method: Integrator, scene: Scene, budget: Budget, traces: Traces) -> list[Stage]:
    """The battery, claim by claim; what a figure shows goes into `traces`."""
    quick = budget.quick
    kept = declared_claims(method)
    return [
        Stage(("order",), lambda: {"order": order(method, scene, traces, quick=quick, finest=budget.finest)}),
        Stage(("symplectic", "symmetric"), lambda: structure(method, scene, traces, quick=quick)),
        Stage(tuple(kept), lambda: over_steps(method, scene, traces, quick=quick, steps=budget.long_steps)),
        Stage(("pole",), lambda: {"pole": pole(method)}),
    ]


def declared(method: Integrator, claim: str) -> str:
    """What a method says of a claim, in a word; empty if nothing."""
    kept = declared_claims(method)
    if claim in kept:
        return kept[claim]
    if claim == "pole":
        return pole_claim(method)
    return yes_no(getattr(method, claim, None))


def measured(method: Integrator, stage: Stage) -> list[Finding]:
    """The findings of a stage; undecided, and why, if its measurement breaks."""
    try:
        findings = stage.measure()
    except SymtopError as error:
        return [undecided(claim, declared(method, claim), str(error)) for claim in stage.claims]
    return [findings[claim] for claim in stage.claims]


def judge(method: Integrator, scene: Scene, *, quick: bool = False) -> Ledger:
    """Measure every claim of a method on a scene; `quick` shortens the runs."""
    traces: Traces = {}
    rows = [one for stage in stages(method, scene, Budget(quick), traces) for one in measured(method, stage)]
    findings = {one.claim: one for one in rows}
    return Ledger(method.name, scene.name, tuple(findings[claim] for claim in CLAIMS), traces)
