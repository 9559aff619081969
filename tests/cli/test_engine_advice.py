"""`recommend --i-use`: errors of an engine's settings, its best one, and a method that does as well for less."""

import pytest

import symtop
from symtop.advise import SETTINGS, i_use
from symtop.methods.framework.registry import engines
from tests.commands import call


def test_every_setting_has_a_map_and_every_map_of_the_engines_a_setting():
    maps = {method for settings in SETTINGS.values() for method in settings.values()}
    assert maps <= set(engines())
    rest = {name.removesuffix("-float32") for name in set(engines()) - maps}
    assert rest <= {name.removesuffix("-float32") for name in maps} | {"fincham"}  # as published, in no engine


@pytest.mark.slow
def test_mujoco_is_told_its_best_setting_and_the_gain_of_another_method():
    advice = i_use("mujoco", "goldstein", step_size=0.025, horizon=10.0)
    assert advice.errors["Euler"] == pytest.approx(0.61, abs=0.01)
    assert advice.best == "RK4 of 4.0"
    assert advice.advice is not None
    assert advice.advice.expected_error <= advice.errors[advice.best]
    assert advice.gain > 1.0
    assert "Its best setting is RK4 of 4.0" in str(advice)


@pytest.mark.parametrize("engine", ["bullet", "yade", "mujoco-euler"])
def test_an_engine_is_told_of_by_its_settings_and_a_map_by_itself(engine):
    """Bullet and yade are names of maps, too."""
    advice = i_use(engine, "goldstein", step_size=0.025, horizon=5.0, accuracy=1e-16)
    assert "Settings within 1e-16 rad at this step: none." in str(advice)
    assert [*advice.errors] == [*SETTINGS.get(engine, {engine: engine})]
    assert all(f"{name} (" in str(advice) for name in advice.errors)


def test_an_engine_without_a_gyroscopic_term_has_nothing_to_match():
    advice = i_use("havok", "goldstein", horizon=10.0)
    assert advice.advice is None
    assert "nothing to match" in str(advice)


def test_an_engine_without_an_error_has_nothing_to_match_either():
    upright = symtop.Scene("upright", symtop.SymmetricTop(1.0, 1.0, 1.0), symtop.Angles(theta=0.0, psi_dot=5.0), 10.0)
    advice = i_use("mujoco", upright)
    assert (set(advice.errors.values()), advice.advice) == ({0.0}, None)
    assert "the axis is off by\n    0.00e+00 rad  Euler" in str(advice)
    assert i_use("mujoco", upright, accuracy=1e-3).advice is not None


def test_an_accuracy_beside_an_engine_is_advised_at_its_step_below_its_errors():
    words = ["recommend", "spheroid", "--i-use", "mujoco-euler", "--accuracy", "1e-3", "--per-nutation", "500"]
    result = call(*words)
    engine, advice = result.output.split(" rad  mujoco-euler (mujoco-euler)\n")
    step = symtop.scene("spheroid").nutation_period / 500.0
    assert f"step {step:g}" in engine
    assert f"step_size={step!r}" in advice
    assert "meets axis error 0.001" in advice
    call(*words, "--step-size", "0.01", code=2)
    call("recommend", "spheroid", "--per-nutation", "0", code=2)
