"""Ensembles of bodies without symmetry: the bits of `simulate`, errors by member, and members that are refused."""

import functools

import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.model.body import from_flat
from symtop.run.ensemble import chunks
from symtop.run.ensemble.bodies import scenes_of
from tests.run.test_ensemble import assert_alone


@functools.cache
def bodies():
    return symtop.body_population(40, seed=4)


@functools.cache
def scenes():
    return scenes_of(bodies())


@pytest.mark.parametrize(("name", "execution"), [
    ("rk4", chunks.IN_LANES), ("strang", chunks.IN_LANES), ("suzuki-4", chunks.IN_LANES),
    ("chin-4a", chunks.IN_LANES), ("five-rotations", chunks.IN_LANES), ("gauss-4", chunks.IN_TURN),
])  # fmt: skip
@pytest.mark.parametrize("per_nutation", [4, 30])  # a turn of more than a radian leaves its lane
def test_a_member_is_the_run_of_simulate_to_the_last_bit(name, execution, per_nutation):
    data = symtop.ensemble(bodies(), name, per_nutation=per_nutation, nutations=12, samples=6, quiet=True)
    assert data.attrs["execution"] == execution
    assert_alone(scenes(), name, data, 6)


def test_methods_that_choose_their_steps_run_as_well():
    data = symtop.ensemble(scenes()[:8], "vern9", tolerance=1e-8, samples=6, quiet=True)
    assert_alone(scenes()[:8], "vern9", data, 6, tolerance=1e-8)


def test_scenes_and_a_population_are_the_same_members_and_threads_change_nothing(monkeypatch, tmp_path):
    settings = {"step_size": 0.05, "horizon": 3.0, "samples": 5, "quiet": True}
    data = symtop.ensemble(bodies(), "strang", **settings)
    others = symtop.ensemble(scenes(), "strang", **settings)
    xr.testing.assert_identical(data.drop_vars("stratum").drop_attrs(), others.drop_vars("scene").drop_attrs())
    monkeypatch.setattr(chunks, "LEAST_STEPS", 100)
    xr.testing.assert_identical(symtop.ensemble(bodies(), "strang", threads=3, **settings), data)
    with symtop.ensemble(bodies(), "strang", path=tmp_path / "runs.nc", **settings) as written:
        xr.testing.assert_equal(written.load(), data)


def test_errors_are_those_of_each_member_against_its_own_truth():
    some = [scenes()[i] for i in (0, 2, 4, 12)]  # free
    settings = {"nutations": 3, "samples": 5, "quiet": True}
    data = symtop.ensemble(some, "strang", per_nutation=[100, 100, 100, 20], **settings)
    errors = symtop.errors(data, some)
    for i, scene in enumerate(some):
        run = symtop.simulate(scene, "strang", step_size=float(data.step_size[i]), horizon=float(data.horizon[i]),
                              samples=5, guard=False)  # fmt: skip
        np.testing.assert_array_equal(errors.attitude[i], symtop.errors(run).attitude)
    fine = symtop.errors(symtop.ensemble(some, "strang", per_nutation=100, **settings), some).attitude.max("time")
    ratio = errors.attitude.max("time") / fine
    assert ratio[:3].values.tolist() == [1.0] * 3
    assert 20.0 < ratio[3] < 30.0  # five times the step: order 2
    with pytest.warns(symtop.SymtopWarning, match="is this the start of the scene"):  # of other members: the control
        assert symtop.errors(data.drop_vars("scene"), some[::-1]).attitude.max() > 1.0


def test_plain_numbers_are_a_body_to_the_bit():
    scene = symtop.scene("heavy-chaotic", bodies=True)
    assert from_flat(list(scene.top.flat(scene.start))) == (scene.top, scene.start)


@pytest.mark.parametrize(("change", "words"), [
    (lambda data: data.assign(I3=data.I3 + 9.0), "member 0: I3 must be at most the sum of the other moments"),
    (lambda data: data.drop_vars("omega_body"), "members must have the variables I1, I2, I3, omega_body, not lack"),
    (lambda data: data.assign(centre=data.I1), "centre of members must be rows of 3 numbers over member"),
    (lambda data: data.assign(quaternion=2.0 * data.quaternion), "member 0: quaternion must have unit length"),
    (lambda data: data.rename(mgl="MGL"), "members have no variable 'MGL'; did you mean mgl?"),
    (lambda data: [*scenes()[:2], "spheroid"], "members must be all tops or all bodies without symmetry"),
])  # fmt: skip
def test_bad_bodies_are_refused_in_one_sentence(change, words):
    with pytest.raises(symtop.SymtopError) as refused:
        symtop.ensemble(change(bodies()), "rk4", step_size=0.1, horizon=1.0)
    assert words in str(refused.value)


def test_a_method_without_the_chart_is_refused():
    with pytest.raises(symtop.SymtopError, match="must have the chart body, of a RigidBody, not stormer-verlet"):
        symtop.ensemble(scenes(), "stormer-verlet", step_size=0.1)
