"""The claims of a method on a body without symmetry, and those of methods that make false ones."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import symtop
from symtop.judging.battery import judge
from symtop.judging.findings import Ledger
from symtop.methods.framework.registry import Integrator
from symtop.model.scenes import body_scenes
from tests.commands import call
from tests.judging.blind import right

FREE, HEAVY = (body_scenes()[name] for name in ("check-case-2", "heavy-brick"))


def ledger_of(method: Integrator, scene: symtop.Scene) -> Ledger:
    """What the battery finds, quickly."""
    return judge(method, scene, quick=True)


@pytest.mark.parametrize(("name", "energy", "momentum"), [
    ("strang", "bounded", "kept"), ("commutator-free-4", "drift", "kept"), ("gauss-4", "kept", "bounded"),
    ("lammps-rigid", "drift", "kept"),
])  # fmt: skip
def test_what_methods_claim_on_a_body_holds(name: str, energy: str, momentum: str) -> None:
    for scene in (FREE, HEAVY):
        ledger = ledger_of(symtop.integrator(name), scene)
        assert ledger.refuted == []
        assert ledger["order"].verdict == "confirmed"
        assert (ledger["energy"].measured.kind, ledger["momentum"].measured.kind) == (energy, momentum)


def test_false_claims_on_a_body_are_refuted() -> None:
    rk4 = symtop.integrator("rk4")
    lie = dataclasses.replace(rk4, name="lie", family="splitting", order=3, symplectic=True)
    assert ledger_of(lie, FREE).refuted == ["energy", "momentum"]  # order 4 where 3 is claimed is no false claim
    assert ledger_of(dataclasses.replace(rk4, name="higher", order=5), HEAVY).refuted == ["order"]
    assert ledger_of(symtop.integrator("no-gyro"), FREE)["order"].measured.kind == "wrong limit"
    assert ledger_of(symtop.integrator("stormer-verlet"), FREE)["energy"].verdict == "undecided"


def rotation_swapped(q: Any, w: Any, h: float, inertia: Any, torque: Any) -> Any:
    """The first two moments are exchanged, which are the same of a top."""
    return right.rotation_lie_midpoint(q, w, h, inertia[[1, 0, 2]], torque)


@pytest.mark.parametrize(("step", "order", "refuted"), [
    (right.rotation_lie_midpoint, 2, []), (rotation_swapped, 2, ["order"]),
    (right.rotation_strang, 2, ["order"]), (right.rk4, 4, []),
])  # fmt: skip
def test_a_step_of_ones_own_is_judged_on_a_body(step: Callable[..., Any], order: int, refuted: list[str],
                                                only: Callable[..., None]) -> None:  # fmt: skip
    """One that turns by the rates of other moments is wrong, as is an exact motion that symmetric bodies alone have."""
    only("order")
    form = "rotation" if "rotation" in step.__name__ else "ode"
    ledger = symtop.judge(step, form=form, scene=HEAVY, order=order, quick=True)
    assert ledger.refuted == refuted
    assert ledger["order"].verdict == ("refuted" if refuted else "confirmed")
    assert refuted == [] or ledger["order"].measured.kind == "wrong limit"


@pytest.mark.parametrize(("claims", "words"), [
    ({"form": "separable"}, "form must be ode, rotation, scipy, not separable"),
    ({"symplectic": True}, "claim the rest on a top"), ({"conserves": ["p_psi"]}, "claim the rest on a top"),
])  # fmt: skip
def test_what_a_step_on_a_body_cannot_show_is_refused(claims: dict[str, Any], words: str) -> None:
    with pytest.raises(symtop.SymtopError, match=words):
        symtop.judge(right.rk4, scene=FREE, quick=True, **claims)


@pytest.mark.slow
def test_a_step_is_drawn_beside_methods_on_a_body(tmp_path: Path) -> None:
    """As in `judge --figure`, and in `compare`, which both take it in the chart of a body."""
    (tmp_path / "my.py").write_text("def step(q, w, h, inertia, torque):\n    return q, w\n", encoding="utf-8")
    words = f"judge {tmp_path / 'my.py'} --form rotation --scene heavy-brick --quick --figure {tmp_path / 'a.png'}"
    assert "my[body] none" in call(*words.split()).output  # it stands still and asks for no force
    assert (tmp_path / "a.png").stat().st_size > 0
    data = symtop.compare(HEAVY, [right.rk4, "rk4"], cost="evaluations", nutations=1.0, budget=4000, quiet=True)
    assert data["variant"].values.tolist() == ["step[body]", "rk4[body]"]
    one, other = (data["error"].sel(variant=name).min() for name in data["variant"].values)
    assert one == pytest.approx(other, rel=0.5)


@pytest.mark.parametrize("scene", ["spheroid", "heavy-brick"])
def test_a_run_that_ends_in_its_first_nutation_shows_no_constant(scene: str) -> None:
    """Two steps of 1e300 times the state: what did not change in the first is not said to be kept."""
    ledger = symtop.judge(lambda f, t, y, h: 1e300 * y, scene=scene, quick=True)
    assert {ledger[claim].measured.kind for claim in ("energy", "order")} == {""}


def test_the_card_of_a_body_shows_the_errors_that_its_order_was_found_from(only: Callable[..., None]) -> None:
    only("order")
    ledger = symtop.judge(right.rk4, scene=HEAVY, order=4, quick=True)
    fitted = ledger.traces["fitted"] == 1.0
    steps, errors = (ledger.traces[name][fitted] for name in ("step_size", "error"))
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(4.0, abs=0.2)
    assert " steps a natural period for the order" in " ".join(str(ledger).split())


def test_a_right_step_is_not_refuted_where_a_body_turns_over(only: Callable[..., None]) -> None:
    """After a calm beginning."""
    only("order", "energy", "momentum")
    ledger = symtop.judge(right.midpoint, scene="tennis-racket", order=2, quick=True)
    assert ledger.refuted == []
    assert ledger["order"].verdict == "confirmed"
    assert ledger["energy"].measured.kind in ("growing", "drift")  # the length of its runs follows from its speed
