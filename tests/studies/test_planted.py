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
    answers, tables = facts.facts(data), facts.tables(data)
    assert ((answers["integrators"], answers["refuted"]), (answers["planted"], answers["caught"])) == ((1, 0), (1, 1))
    assert not {LIAR, "hidden-kick"} & symtop.integrators().keys()
    row = tables["planted"].iloc[0]
    assert (row["integrator"], row["claim"], row["verdict"]) == (LIAR, "symmetric", "refuted")
    assert "1 of 1" in {text.get_text() for picture in figures.pictures(data) for text in picture.figure.axes[0].texts}
    assert (answers["free_methods"], answers["free_confirmed"]) == (1, 3)
    assert ([*tables["body"]["claim"]], {*tables["ledger"]["scene"]}) == (["order", "energy", "momentum"], {SCENE})
    mask = (data["scene"] == facts.FREE) & (data["claim"] == "momentum")
    refuted = facts.facts(data.assign(verdict=xr.where(mask & (data["verdict"] != ""), "refuted", data["verdict"])))
    assert (refuted["free_refuted"], refuted["refuted"]) == (1, answers["refuted"])


def test_a_property_that_could_not_be_decided_was_declared_and_a_part_without_them_says_nothing(data):
    answers = facts.facts(data)
    for scene, key in ((SCENE, "undecided"), (facts.FREE, "free_undecided")):
        mask = (data["scene"] == scene) & (data["variant"] == "strang") & (data["claim"] == "order")
        open_ = data.assign(verdict=xr.where(mask, "undecided", data["verdict"]))
        assert facts.facts(open_)[key] == answers[key] + 1  # the control
        unsaid = open_.assign(declared=xr.where(mask, "", data["declared"]))
        assert facts.facts(unsaid)[key] == answers[key]
        assert facts.facts(unsaid)["unsaid"] == answers["unsaid"] + (scene == SCENE)
    part = data.sel(variant=["strang"])
    answers = facts.facts(part)
    assert (answers["planted"], answers["caught"]) == (None, 0)
    assert "planted" not in facts.tables(part)
    assert answers["runs"] > 0 == (facts.facts(part.assign(steps_run=0 * part["steps_run"]))["runs"] or 0)  # a formula
    assert not any(" of " in text.get_text() for text in next(figures.pictures(part)).figure.axes[0].texts)


def test_one_that_escapes_is_named_and_a_refuted_claim_comes_first(data):
    liar = (data["variant"] == LIAR) & (data["scene"] == SCENE)
    verdict = xr.where(liar & (data["claim"] == "symmetric"), "undecided", data["verdict"])
    fooled = data.assign(verdict=xr.where(liar & (data["claim"] == "order"), "refuted", verdict))
    answers = facts.facts(fooled)
    assert (answers["planted"], answers["caught"]) == (1, 0)
    assert "0 of 1" in {text.get_text() for text in next(figures.pictures(fooled)).figure.axes[0].texts}
    mask = (data["variant"] == "strang") & (data["claim"] == "symmetric") & (data["scene"] == SCENE)
    refuted = data.assign(verdict=xr.where(mask, "refuted", data["verdict"]))
    answers, row = facts.facts(refuted), facts.tables(refuted)["ledger"].iloc[0]
    assert (answers["refuted"], answers["declared"]) == (1, answers["held"] + 1)
    assert (row["integrator"], row["claim"], row["verdict"]) == ("strang", "symmetric", "refuted")
