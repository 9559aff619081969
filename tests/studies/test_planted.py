"""Planted false claims: a fresh process judges them, the caught are counted, and one that escapes is named."""

import pytest
import xarray as xr
from symtop_studies.claims import facts, figures, planted, study

import symtop
from symtop.judging.battery import SCENE
from symtop.measure.datasets import combine

LIAR = "planted-hidden-kick"


@pytest.fixture(scope="module")
def data():
    """An honest method and a liar, as the study stores them."""
    (liar,) = (case for case in planted.cases(quick=True) if case.integrator == LIAR)
    cases = [symtop.Case(name, "strang", {"quick": True}) for name in (facts.FREE, SCENE)] + [liar]
    return combine([(case, study.measure(case)) for case in cases])


def test_a_liar_is_judged_beside_the_honest_and_claims_on_a_free_body_by_themselves(data):
    said, tables = facts.facts(data), facts.tables(data)
    assert (said["integrators"], said["refuted"]) == (1, 0)
    assert (said["planted"], said["caught"]) == (1, 1)
    assert not {LIAR, "hidden-kick"} & symtop.integrators().keys()
    row = tables["planted"].iloc[0]
    assert (row["integrator"], row["claim"], row["verdict"]) == (LIAR, "symmetric", "refuted")
    assert "1 of 1" in {text.get_text() for one in figures.pictures(data) for text in one.figure.axes[0].texts}
    assert (said["free_methods"], said["free_confirmed"]) == (1, 3)
    assert [*tables["body"]["claim"]] == ["order", "energy", "momentum"]
    assert {*tables["ledger"]["scene"]} == {SCENE}
    wrong = (data["scene"] == facts.FREE) & (data["claim"] == "momentum")
    refuted = facts.facts(data.assign(verdict=xr.where(wrong & (data["verdict"] != ""), "refuted", data["verdict"])))
    assert (refuted["free_refuted"], refuted["refuted"]) == (1, said["refuted"])


def test_a_property_that_could_not_be_decided_was_declared_and_a_part_without_them_says_nothing(data):
    said = facts.facts(data)
    for on, counted in ((SCENE, "undecided"), (facts.FREE, "free_undecided")):
        one = (data["scene"] == on) & (data["variant"] == "strang") & (data["claim"] == "order")
        open_ = data.assign(verdict=xr.where(one, "undecided", data["verdict"]))
        assert facts.facts(open_)[counted] == said[counted] + 1  # the control
        unsaid = open_.assign(declared=xr.where(one, "", data["declared"]))
        assert facts.facts(unsaid)[counted] == said[counted]
        assert facts.facts(unsaid)["unsaid"] == said["unsaid"] + (on == SCENE)
    part = data.sel(variant=["strang"])
    said = facts.facts(part)
    assert (said["planted"], said["caught"]) == (None, 0)
    assert "planted" not in facts.tables(part)
    assert said["runs"] > 0 == (facts.facts(part.assign(steps_run=0 * part["steps_run"]))["runs"] or 0)  # a formula
    assert not any(" of " in text.get_text() for text in next(figures.pictures(part)).figure.axes[0].texts)


def test_one_that_escapes_is_named_and_a_refuted_claim_comes_first(data):
    liar = (data["variant"] == LIAR) & (data["scene"] == SCENE)
    verdict = xr.where(liar & (data["claim"] == "symmetric"), "undecided", data["verdict"])
    fooled = data.assign(verdict=xr.where(liar & (data["claim"] == "order"), "refuted", verdict))
    said = facts.facts(fooled)
    assert (said["planted"], said["caught"]) == (1, 0)
    assert "0 of 1" in {text.get_text() for text in next(figures.pictures(fooled)).figure.axes[0].texts}
    wrong = (data["variant"] == "strang") & (data["claim"] == "symmetric") & (data["scene"] == SCENE)
    refuted = data.assign(verdict=xr.where(wrong, "refuted", data["verdict"]))
    said, row = facts.facts(refuted), facts.tables(refuted)["ledger"].iloc[0]
    assert (said["refuted"], said["declared"]) == (1, said["held"] + 1)
    assert (row["integrator"], row["claim"], row["verdict"]) == ("strang", "symmetric", "refuted")
