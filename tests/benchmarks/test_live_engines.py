"""Engines against their maps: what counts as the same map, and that an engine that is absent or raises is data."""

import sys
from unittest.mock import Mock

import numpy as np
import pytest

import symtop
from benchmarks import engines
from benchmarks.engines import drivers, measure, study
from benchmarks.engines.common import body_of

SCENES = {body_of(symtop.scene(name)).velocity.tobytes(): symtop.scene(name) for name in measure.STEPS}


def engine(method, stepped, name="setting"):
    """An engine that steps by a map of the catalogue and is said to have another."""
    run = lambda body, h, steps: measure.mapped(SCENES[body.velocity.tobytes()], stepped, h, steps)
    return engines.Setting("Engine", "1", name, engines.FREE, method, run)


@pytest.mark.parametrize(("method", "stepped", "expected"), [
    ("bullet", "bullet", True), ("bullet", "mujoco-implicit", False), ("rkmk4", "mujoco3-rk4", False),
    ("jolt-float32", "jolt-float32", True), ("jolt-float32", "jolt", True), ("jolt", "jolt-float32", False),
    ("no-squish", "no-squish", True),
])  # fmt: skip
def test_a_map_is_an_engines_own_if_one_step_agrees(method, stepped, expected):
    assert measure.agrees(measure.row(engine(method, stepped))) is expected


def test_the_axis_error_is_that_of_the_catalogue_and_an_engine_that_raises_a_row_with_its_reason():
    row = measure.row(engine("mujoco-euler", "mujoco-euler"))
    assert row["goldstein_axis"] == pytest.approx(0.61079, rel=1e-4)
    assert row["goldstein_steps"] == 0.0
    raises = Mock(side_effect=RuntimeError("no such body"))
    row = measure.row(engines.Setting("Engine", "1", "bad", engines.FREE, "ode", raises))
    assert row["failed"] == "RuntimeError: no such body"
    assert not measure.agrees(row)
    unknown = {**row, "method": "", "goldstein_step": 0.0, "fast_step": 0.0}
    assert not measure.agrees(unknown)  # a map that the catalogue does not have
    assert "1 setting of Engine ran without a map" in study.findings([unknown], [], {"measured": "today"})["page"]
    findings = study.findings([row], ["Other is not installed here and was skipped: reason."], {"measured": "today"})
    assert findings["failures"] == [*findings["missing"], "Engine (bad): RuntimeError: no such body"]


ECHO = """
import sys
setting, held, *numbers = sys.argv[1:]
row = [2.0 * float(number) for number in numbers[3:7]] + [float(number) for number in numbers[7:10]]
if setting == "broken":
    sys.exit("no such body")
for step in range(int(numbers[-1]) + (setting == "default")):
    print(*row)
"""


def test_a_driver_gets_the_numbers_of_the_body_and_its_quaternions_have_length_one():
    body = body_of(symtop.scene("goldstein"))
    path = drivers.run((sys.executable, "-c", ECHO), "default", "free", body, 0.1, 3)
    np.testing.assert_allclose(path.attitude, np.tile(body.attitude, (4, 1)), atol=1e-16)
    np.testing.assert_array_equal(path.velocity, np.tile(body.velocity, (4, 1)))


@pytest.mark.parametrize(("setting", "message"), [
    ("broken", "ended with 1: no such body"), ("short", "2 rows where 3 were expected")])  # fmt: skip
def test_a_driver_that_fails_is_an_error_with_its_reason(setting, message):
    with pytest.raises(RuntimeError, match=message):
        drivers.run((sys.executable, "-c", ECHO), setting, "free", body_of(symtop.scene("goldstein")), 0.1, 2)
