"""The claims of a method on a body without symmetry, and those of methods that make false ones."""

import dataclasses
import json

import pytest

import symtop
from symtop.judging.battery import judge
from symtop.judging.findings import Ledger
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import body_scenes
from tests.commands import call

FREE, HEAVY = (body_scenes()[name] for name in ("check-case-2", "heavy-brick"))


def said(method: Integrator, scene: symtop.Scene) -> Ledger:
    """What the battery finds, quickly."""
    return judge(method, scene, quick=True)


@pytest.mark.parametrize(("name", "energy", "momentum"), [
    ("strang", "bounded", "kept"), ("commutator-free-4", "drift", "kept"), ("gauss-4", "kept", "bounded"),
    ("lammps-rigid", "drift", "kept"),
])  # fmt: skip
def test_what_methods_claim_on_a_body_holds(name: str, energy: str, momentum: str) -> None:
    for scene in (FREE, HEAVY):
        ledger = said(symtop.integrator(name), scene)
        assert ledger.refuted == []
        assert ledger["order"].verdict == "confirmed"
        assert (ledger["energy"].measured.kind, ledger["momentum"].measured.kind) == (energy, momentum)


def test_false_claims_on_a_body_are_refuted() -> None:
    rk4 = symtop.integrator("rk4")
    lie = dataclasses.replace(rk4, name="lie", family="splitting", order=3, symplectic=True)
    assert said(lie, FREE).refuted == ["energy", "momentum"]  # order 4 where 3 is claimed is no false claim
    assert said(dataclasses.replace(rk4, name="higher", order=5), HEAVY).refuted == ["order"]
    ledger = said(symtop.integrator("no-gyro"), FREE)
    assert ledger["order"].verdict == "undecided"
    assert said(symtop.integrator("stormer-verlet"), FREE)["energy"].verdict == "undecided"


def test_the_command_judges_on_a_body() -> None:
    done = call("claims", "strang", "--scene", "check-case-2", "--quick", "--json")
    findings = {one["claim"]: one["verdict"] for one in json.loads(done.stdout)}
    assert findings == {"order": "confirmed", "energy": "confirmed", "momentum": "confirmed"}
