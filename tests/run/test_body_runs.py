"""Runs of bodies without symmetry, alone and many: orders, constants, errors, the same bits, and what is refused."""

import dataclasses
import functools
import itertools
import json
import math

import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.core import netcdf
from symtop.methods.framework.registry import engines
from symtop.methods.splitting import body as splitting_body
from symtop.methods.splitting.coefficients import STRANG
from symtop.model.body import Attitude, RigidBody, from_flat, rotated
from symtop.model.charts import BODY, attitude_distance
from symtop.model.exact import heavy_body
from symtop.run.ensemble import chunks
from symtop.run.ensemble.bodies import scenes_of
from tests.commands import call
from tests.conftest import defer
from tests.run.test_ensemble import assert_alone

pytestmark = pytest.mark.usefixtures("in_lanes")
BODIES = ("check-case-2", "heavy-brick")
LARGE = symtop.Scene("large", RigidBody(1e30, 1e30, 1.5e30), Attitude((0.8, 0.6, 0, 0), (0, 0, 1)), 12.0)  # M rests
# every method that steps a body and claims an order, and the longest steps of its runs, by the order
FIXED = {name: entry.order for name, entry in (symtop.integrators() | engines()).items()
         if BODY in entry.solvers and entry.fixed_step and entry.order is not None}  # fmt: skip
FEWEST = {1: 400, 2: 40, 3: 30, 4: 20, 5: 20, 6: 10, 8: 6, 9: 5, 10: 4, 12: 3, 16: 4}  # steps a natural period
FINER, ROUNDING = 2.0 ** (np.arange(9) / 4.0), 5e-14  # times as many; rad, what ten roundings make of an attitude
# what a method keeps of a free body, and of a heavy one
CONSERVED = {"rk4": ((), ()), "strang": (("momentum",), ("p_phi",)), "chin-4a": (("momentum",), ("p_phi",)),
             "gauss-4": (("energy",), ("energy",)), "five-rotations": (("momentum",), ("p_phi",)),
             "lie-variational": (("momentum", "energy"), ("p_phi",)), "euler-poincare": (("momentum",), ("p_phi",)),
             "commutator-free-4": (("momentum",), ("p_phi",)), "rkmk-se3-4": (("momentum",), ("p_phi",))}  # fmt: skip
# the steps of the symmetric top, and another method there, of the same order
TO_ROUNDING = ("strang", "kahan-li-8", "chin-4a", "srkn-11-6", "lie-variational", "euler-poincare", "five-rotations",
               "no-squish")  # fmt: skip
TO_ORDER = {"gauss-4": 4, "rkmk-se3-4": 4, "crouch-grossman-3": 3, "commutator-free-4": 4}
ADAPTIVE = ("rk45", "dop853", "rk45-compiled", "dop853-compiled", "tsit5", "vern9", "series-general-adaptive",
            "extrapolation", "adams", "taylor", "taylor-longdouble")  # fmt: skip


def error(name: str | symtop.Scene, method: str | symtop.Integrator, **settings: float) -> float:
    """Largest error of the attitude of a run."""
    run = symtop.simulate(name, method, samples=41, guard=False, **settings)
    assert run.outcome == "ok"
    return float(symtop.errors(run)["attitude"].max())


def slope(scene: symtop.Scene, method: str, order: int, true: symtop.Scene | None = None) -> float:
    """The power of the step by which the error falls, of the shortest steps whose error is no rounding."""

    @functools.cache
    def largest(k: int) -> float:
        step = scene.nutation_period / (FEWEST[order] * FINER[k])
        run = symtop.simulate(scene, method, step_size=step, samples=41, guard=False)
        truth = symtop.reference(true or scene, run.time.values)["quaternion"].values
        return float(attitude_distance(run["quaternion"].values, truth).max()) if run.outcome == "ok" else math.inf

    last = len(FINER) - 1
    if largest(last) < 20.0 * ROUNDING:
        last = next((k for k in range(last + 1) if largest(k) < ROUNDING), last + 1) - 1
    return math.log2(largest(last - 4) / largest(last))


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize(("method", "order"), [
    *((name, FIXED[name]) for name in CONSERVED), *defer(*(row for row in FIXED.items() if row[0] not in CONSERVED)),
])  # fmt: skip
def test_the_error_falls_by_the_order(name: str, method: str, order: int) -> None:
    steep = 6.0 if order in (9, 16) else 1.6  # there the long steps fall as powers of h over a radius
    assert order - 0.6 < slope(symtop.body_scenes()[name], method, order) < order + steep


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("method", ["chin-4a", "srkn-11-6"])
def test_a_table_for_an_exact_drift_falls_to_order_two_with_one_of_order_two(name: str, method: str) -> None:
    entry = symtop.integrator(method)
    solver = dataclasses.replace(entry.solvers[BODY], loop=splitting_body.march(STRANG))  # type: ignore[type-var]
    variant = dataclasses.replace(entry, name="plain", order=2, solvers={BODY: solver})
    coarse, fine = (error(name, variant, step_size=symtop.body_scenes()[name].nutation_period / n) for n in (40, 80))
    assert abs(math.log2(coarse / fine) - 2.0) < 0.1


@pytest.mark.quick
@pytest.mark.parametrize("name", [*BODIES, LARGE])
@pytest.mark.parametrize("method", [name for name in ADAPTIVE if name in symtop.integrators()])
def test_a_tight_tolerance_comes_to_the_true_motion(name: str, method: str) -> None:
    assert error(name, method, tolerance=1e-11) < 1e-7


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize(("order", "method"), [
    (2, "strang"), (4, "gauss-4"), *defer(*{order: method for method, order in FIXED.items()}.items())])  # fmt: skip
def test_a_wrong_sign_in_the_inertia_is_caught(name: str, method: str, order: int) -> None:
    """The same momentum of the mirrored body: I1 and I3 exchanged turn the gyroscopic torque around."""
    scene = symtop.body_scenes()[name]
    body, M = scene.top, scene.top.momentum(scene.start)
    mirrored = RigidBody(body.I3, body.I2, body.I1, body.mgl, body.centre)
    rates = tuple(part / moment for part, moment in zip(M, mirrored.moments, strict=True))
    control = symtop.Scene("other", mirrored, Attitude(scene.start.quaternion, rates), scene.horizon)
    assert abs(slope(control, method, order, scene)) < order - 0.6


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("method", CONSERVED)
def test_a_method_keeps_what_it_must_and_nothing_else(name: str, method: str) -> None:
    scene, (free, heavy) = symtop.body_scenes()[name], CONSERVED[method]
    run = symtop.simulate(name, method, step_size=scene.nutation_period / 40, samples=101, guard=False)
    for quantity in ("energy", "p_phi") + ("momentum",) * scene.top.free:
        conserved = quantity in (free if scene.top.free else heavy) or (quantity == "p_phi" and "momentum" in free)
        assert (float(symtop.errors(run)[quantity].max()) < 2e-14) is conserved, quantity


@pytest.mark.parametrize("mgl", [0.0, 2.0])
def test_a_symmetric_body_has_the_energy_and_the_momenta_of_the_top(mgl: float) -> None:
    quaternion, rates = (0.8, 0.6, 0.0, 0.0), (0.2, 0.3, 3.0)
    attitude, start = Attitude(quaternion, rates), symtop.Angles.from_quaternion(quaternion, omega_body=rates)
    body, top = RigidBody(2.0, 2.0, 1.0, mgl), symtop.SymmetricTop(2.0, 1.0, mgl)
    assert body.energy(attitude) == pytest.approx(top.energy(start), rel=1e-14)
    assert body.momenta(attitude) == pytest.approx(top.momenta(start)[:2], rel=1e-14)


@pytest.mark.parametrize("mgl", [0.0, 1.0])
@pytest.mark.parametrize("moments", list(itertools.permutations((0.25, 0.75, 1.0))))
def test_five_rotations_are_of_order_four_on_one_free_body_in_one_order(moments: tuple[float, ...], mgl: float) -> None:
    start = Attitude((0.8, 0.6, 0.0, 0.0), (0.5, 0.7, 1.1))
    scene = symtop.Scene("of-fasso", RigidBody(*moments, mgl, (0.3, 0.2, 1.0)), start, 10.0)
    coarse, fine = (error(scene, "five-rotations", step_size=h) for h in (0.025, 0.0125))
    assert abs(math.log2(coarse / fine) - (4 if mgl == 0.0 and moments == (0.25, 0.75, 1.0) else 2)) < 0.1


def gap(method: str, second: float, step: float) -> float:
    """The largest angle between a symmetric top and a body whose second moment is `second`."""
    quaternion, rates = (0.8, 0.6, 0.0, 0.0), (0.2, 0.3, 3.0)
    start = symtop.Angles.from_quaternion(quaternion, omega_body=rates)
    top = symtop.Scene("top", symtop.SymmetricTop(2.0, 1.0, 2.0), start, 10.0)
    body = symtop.Scene("body", RigidBody(2.0, second, 1.0, 2.0), Attitude(quaternion, rates), 10.0)
    runs = (symtop.simulate(scene, f"{method}[{chart}]", step_size=step, guard=False)["quaternion"].values
            for scene, chart in ((top, "attitude"), (body, "body")))  # fmt: skip
    return float(attitude_distance(*runs).max())


@pytest.mark.parametrize("method", TO_ROUNDING)
def test_a_method_makes_the_steps_of_the_symmetric_top(method: str) -> None:
    """Two moments that are equal make the drift exact; two that are not make another method."""
    assert gap(method, 2.0, 0.1) < 2e-14
    assert gap(method, 2.0 + 1e-6, 0.1) > 1e-7


@pytest.mark.parametrize(("method", "order"), TO_ORDER.items())
def test_another_method_comes_to_the_symmetric_top_by_its_order(method: str, order: int) -> None:
    coarse, fine = gap(method, 2.0, 0.02), gap(method, 2.0, 0.01)
    assert fine > 1e-9
    assert abs(math.log2(coarse / fine) - order) < 0.3


def test_energy_and_momentum_of_a_run_are_those_of_its_states():
    run = symtop.simulate("heavy-brick", "rk4", step_size=0.2, samples=11, guard=False)
    truth, errors = symtop.reference("heavy-brick", run.time.values), symtop.errors(run)
    assert {*errors.data_vars} >= {"attitude", "axis", "theta", "momentum", "energy", "p_phi", "attitude_bound"}
    assert "p_psi" not in run
    np.testing.assert_allclose(run["p_phi"], run["momentum"][:, 2], rtol=1e-13)
    assert abs(run["energy"][0] - truth["energy"][0]) < 1e-15
    truth["quaternion"].values[:] = truth["attitude_error_bound"].values[:, None]  # a user's, and not of the cache
    xr.testing.assert_identical(symtop.errors(run), errors)
    assert 1e-6 < abs(run["energy"] - run["energy"][0]).max() < 1e-1
    slow = symtop.Scene("slow", RigidBody(1.0, 1.3, 0.7, 1.0, (1.0, 0.0, 1.0)), Attitude(omega_body=(0, 0, 1e-8)), 20.0)
    errors = symtop.errors(symtop.reference(slow, run.time.values).assign(p_psi=run.time), slow, precision="quad")
    assert 1e-10 < errors.momentum.max() < errors.momentum_bound.max()  # |L| becomes 1e8 times that of the start
    thin = symtop.Scene("thin", RigidBody(1e-13, 1.0, 1.0, 1.0, (1.0, 0.0, 0.0)), Attitude(), 500.0)
    assert thin.momentum_scale == 1.0  # whatever the order of the axes
    assert symtop.ensemble([thin], "vern9", tolerance=1e-9).outcome == "ok"
    assert error(thin, "vern9", tolerance=1e-9) < 1e-4


def test_a_sweep_and_a_comparison_take_a_body(tmp_path) -> None:  # type: ignore[no-untyped-def]
    setting = {"per_nutation": [32, 64], "quiet": True, "path": tmp_path / "s.nc"}
    data = symtop.sweep("heavy-brick", ["rk4", "tsit5-fixed"], **setting)
    error = data["attitude"].values[0]
    assert ((error[:, 1] < error[:, 0] / 10.0) & (error[:, 1] > 1e-12) & (data["chart"].values == "body")).all()
    comparison = symtop.compare("check-case-2", ["rk4", "series-general"], quantity="attitude", quiet=True)
    assert [*comparison["variant"].values] == ["rk4[body]", "series-general[body]"]
    assert ((comparison["seconds"].max("setting") > 0.0) & comparison["exact_seconds"].isnull()).all()
    for dataset in (data, comparison, symtop.simulate("heavy-brick", "rk4", step_size=0.2, samples=11, guard=False)):
        assert symtop.plot(dataset, quantity="energy").get_ylabel().endswith("energy error / (T0 + |mgl|)")


OWN = ["--body", "1,2,3", "--rates", "0.01,1,0"]


@pytest.mark.parametrize(("words", "sentence"), [
    (["run", "body", "rk4", "--step-size", "0.1", "--mgl", "3"], "--mgl must come with --body I1,I2,I3\n"),
    (["run", "spheroid", "rk4", *OWN], "--body, --rates must come with the scene body, not spheroid\n"),
    (["scenes", "body", "--body", "1,2"], "--body must be 3 numbers with commas between, not '1,2'"),
    (["scenes", *OWN], "the scene body\n"), (["scenes", "body", *OWN[:2]], "--body without a weight needs --rates"),
    (["scenes", "body", *OWN[:2], "--rates", "nan,1,0"], "an entry of --rates must be a finite number, not nan"),
    (["scenes", "body", *OWN, "--attitude", "2,0,0,0"], "--attitude must have unit length, not 2"),
    (["scenes", "body", "--body", "1,2,4", "--mgl", "1"], "I3 must be at most the sum of the other moments"),
])  # fmt: skip
def test_a_body_of_ones_own_that_is_none(words: list[str], sentence: str) -> None:
    assert sentence in call(*words, code=2).stderr


def test_a_body_of_ones_own_on_the_command_line() -> None:
    body, state = RigidBody(1.0, 1.2, 0.6, 1.0, (0.1, 0.0, 1.0)), Attitude((0.8, 0.6, 0.0, 0.0), (0.2, 0.3, 3.0))
    options = ["--body=1,1.2,0.6", "--mgl=1", "--centre=0.1,0,1", "--attitude=0.8,0.6,0,0", "--rates=0.2,0.3,3"]
    entry = json.loads(call("scenes", "body", "--json", *options).stdout)[0]
    assert entry["top"]["centre"] == list(body.centre)
    assert float(entry["nutation period"]) == pytest.approx(body.nutation_period(state), rel=1e-5)
    run = ["rk4", "--step-size", "0.05", "--horizon", "20", "--json"]
    mine, named = (json.loads(call("run", *args).stdout) for args in (["body", *run, *options], ["heavy-brick", *run]))
    assert mine["errors"] == named["errors"]
    result = call("run", "heavy-chaotic", "rk4", "--step-size", "0.05", "--horizon", "60", "--json")
    assert (json.loads(result.stdout)["errors"], json.loads(result.stdout)["judgement"]) == ({}, None)
    assert "not compared with the true motion: horizon must be at most" in result.stderr
    # with two equal moments and the centre on the third axis it is a top, and has all that a top has
    run = ["run", "body", "stormer-verlet", "--step-size", "1e-3", "--json", "--mgl", "3", "--centre", "0,0,-2"]
    report = json.loads(call(*run, *options[-2:], "--body", "2,2,1").stdout)
    start = symtop.Angles.from_quaternion(state.quaternion, omega_body=state.omega_body)
    top = symtop.Scene("body", symtop.SymmetricTop(2.0, 1.0, -3.0), start, report["reached_time"])
    errors = symtop.errors(symtop.simulate(top, "stormer-verlet", step_size=1e-3))
    assert report["errors"]["axis"]["largest"] == float(errors["axis"].max()) < 1e-4
    assert "chart body" in call(*run, *options[-2:], "--body", "2,2.001,1", code=2).stderr


def test_chaos_ends_the_reference_and_a_body_at_rest_stays(monkeypatch):
    assert symtop.simulate("check-case-2", "lie-variational", step_size=6.0, guard=False).outcome == "not_converged"
    data = symtop.simulate("check-case-2", "euler-poincare", step_size=6.0, guard=False)
    assert symtop.errors(data)["momentum"].max() < 2e-14
    scene = symtop.Scene("still", RigidBody(1.0, 2.0, 2.5), Attitude(), 1.0)
    data = symtop.long_run(scene, "rk4", step_size=0.1, steps=20, quiet=True)
    assert not data[["momentum_least", "momentum_largest"]].to_array().values.any()
    for times in ([400.0], [0.0, 20.0, 100.0, 200.0, 400.0], [4e9]):
        with pytest.raises(symtop.SymtopError, match=r"times must be at most \d+.* on heavy-chaotic, not 4") as info:
            symtop.reference("heavy-chaotic", times)
        bound = symtop.reference("heavy-chaotic", [20.0, float(str(info.value).split()[5])])["attitude_error_bound"]
        assert float(bound[0]) < 1e-12 < float(bound[1]) < 1e-9
    monkeypatch.setattr(heavy_body, "MOST_STEPS", 3000)
    ends, words = [], "on heavy-brick, not .*: to integrate its motion for longer takes more than 1,000,000 Taylor"
    for times in ([1e4], [3.0, 90.0, 1e5]):
        with pytest.raises(symtop.SymtopError, match=words) as info:
            symtop.reference("heavy-brick", times)
        ends.append(float(str(info.value).split()[5]))
    assert 80.0 < ends[0] == ends[1]  # and what is named is known
    assert symtop.reference("heavy-brick", ends[:1])["attitude_error_bound"] < 1e-12


def test_the_inertia_matrix_is_diagonalised_and_its_axes_kept() -> None:
    turn = np.array([0.5, -0.5, 0.1, 0.7]) / math.hypot(0.5, -0.5, 0.1, 0.7)
    columns = np.array([rotated(turn, axis) for axis in np.eye(3)]).T
    matrix = columns @ np.diag([1.0, 1.4, 2.1]) @ columns.T
    body = RigidBody.from_inertia(matrix.tolist(), 2.0, (columns @ [0.0, 0.6, 0.8]).tolist())
    assert body.moments == pytest.approx((1.0, 1.4, 2.1), rel=1e-14)
    start = Attitude((0.6, 0.0, 0.8, 0.0), (0.3, 0.2, 0.1))
    principal, spin = body.in_principal(start), np.array(start.omega_body)
    kinetic = 0.5 * np.dot(body.momentum(principal), principal.omega_body)
    assert 0.5 * spin @ matrix @ spin == pytest.approx(kinetic, rel=1e-13)
    height = rotated(principal.quaternion, body.centre)[2]  # the height of the centre, in either axes
    assert height == pytest.approx(rotated(start.quaternion, columns @ [0.0, 0.6, 0.8])[2], rel=1e-13)
    for k, moments in enumerate([(1.4, 2.1, 1.0), (2.1, 1.0, 1.4), (1.0, 1.4, 2.1)]):  # third: that of the centre
        body = RigidBody.from_inertia(matrix.tolist(), 2.0, (columns @ -np.eye(3)[k]).tolist())
        assert (*body.moments, *body.centre) == pytest.approx((*moments, 0.0, 0.0, 1.0), abs=1e-14)
        assert rotated(body.axes, (0.0, 0.0, 1.0)) == pytest.approx((columns @ -np.eye(3)[k]).tolist())
    assert RigidBody.from_inertia(np.diag([3.0, 1.0, 2.9])).moments == (2.9, 3.0, 1.0)
    assert RigidBody.from_brick(12.0, (1.0, 2.0, 3.0)).moments == (13.0, 10.0, 5.0)
    corners = [(x, y, z) for x in (-0.5, 0.5) for y in (-1.0, 1.0) for z in (-1.5, 1.5)]
    assert sorted(RigidBody.from_points([1.5] * 8, corners).moments) == pytest.approx([15.0, 30.0, 39.0])


@functools.cache
def bodies():
    return symtop.body_population(40, seed=4)


@functools.cache
def scenes():
    return scenes_of(bodies())


def together(members):
    return symtop.ensemble(members, "rk4", step_size=0.1, horizon=1.0)


@pytest.mark.parametrize(("make", "words"), [
    (lambda: RigidBody(1.0, 1.0, 2.1), "I3 must be at most the sum of the other moments"),
    (lambda: RigidBody(1.0, 1.0, 1.0, 1.0, (0.0, 0.0, 0.0)), "centre must be a direction and of a length"),
    (lambda: RigidBody.from_inertia([[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]), "matrix must be symmetric"),
    (lambda: RigidBody.from_brick(1.0, (1.0, 1.0, 1e200)), "sides must be between 0 and 1e+40 in size, not 1e+200"),
    (lambda: Attitude((0.0, 0.0, 0.0, 0.0)), "quaternion must have unit length, not 0"),
    (lambda: symtop.Scene("x", RigidBody(1.0, 1.0, 1.0), symtop.Angles(0.3), 1.0), "must be Attitude, not Angles"),
    (lambda: symtop.simulate("heavy-brick", "stormer-verlet", step_size=1), "integrator must have the chart body"),
    (lambda: symtop.simulate("heavy-brick", "rk4[axis]", step_size=1), "not rk4[axis]: take rk4 without brackets"),
    (lambda: symtop.simulate("heavy-brick", "rk4", step_size=1, observe="nutation"), "known: axis, attitude"),
    (lambda: symtop.long_run("heavy-brick", "vern9", step_size=0.1, steps=9), "no compiled loop of fixed steps"),
    (lambda: symtop.reference("heavy-brick", [1.0], certify="digits"), "certify must be None on heavy-brick"),
    (lambda: together(bodies().assign(I3=bodies().I3 + 9.0)), "member 0: I3 must be at most the sum of the other"),
    (lambda: together(bodies().drop_vars("omega_body")), "must have the variables I1, I2, I3, omega_body, not lack"),
    (lambda: together(bodies().assign(centre=bodies().I1)), "centre of members must be rows of 3 numbers over member"),
    (lambda: together(bodies().assign(quaternion=2.0 * bodies().quaternion)), "0: quaternion must have unit length"),
    (lambda: together(bodies().rename(mgl="MGL")), "members have no variable 'MGL'; did you mean mgl?"),
    (lambda: together([*scenes()[:2], "spheroid"]), "members must be all tops or all bodies without symmetry"),
])  # fmt: skip
def test_what_is_no_body_or_takes_none_is_refused(make, words: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(symtop.SymtopError) as info:
        make()
    assert words in str(info.value)


def test_a_body_stored_or_of_plain_numbers_is_read_back_to_the_bit(tmp_path):  # type: ignore[no-untyped-def]
    """Numbers of length one but for their rounding are not scaled again; others are."""
    scene = symtop.scene("heavy-chaotic", bodies=True)
    assert from_flat(list(scene.top.flat(scene.start))) == (scene.top, scene.start)
    run = symtop.simulate("heavy-brick", "rk4", step_size=0.01, guard=False)
    for rows in (symtop.errors(netcdf.read(netcdf.write(run, tmp_path / "run.nc"))), symtop.errors(run, "heavy-brick")):
        np.testing.assert_array_equal(rows["attitude"], symtop.errors(run)["attitude"])
    with pytest.raises(symtop.SymtopError, match="scene must be that of the data"):
        symtop.errors(run, scene)
    for w, x, y, z in np.random.default_rng(0).normal(size=(500, 4)):
        body = symtop.RigidBody(1.0, 1.2, 0.9, 1.0, (x, y, z))
        start = symtop.Attitude(np.array([w, x, y, z]) / np.linalg.norm([w, x, y, z]))
        assert (dataclasses.replace(body), dataclasses.replace(start)) == (body, start)
    assert symtop.RigidBody(1.0, 1.2, 0.9, 1.0, (0.0, 0.0, 1.0 + 1e-15)).centre == (0.0, 0.0, 1.0)


@pytest.mark.quick
@pytest.mark.parametrize(("name", "execution"), [
    *((name, chunks.IN_LANES) for name in (
        "rk4", "strang", "chin-4a", "five-rotations", "vern9-fixed", "gauss-6", "rkmk-se3-4", "lie-variational")),
    *defer(*((name, chunks.IN_LANES) for name in ("gauss-12", "srkn-19-8", "crouch-grossman-3")), mark="slow"),
    ("series-general", chunks.IN_TURN),
])  # fmt: skip
@pytest.mark.parametrize("per_nutation", [4, 30])  # a turn of more than a radian leaves its lane
def test_a_member_is_the_run_of_simulate_to_the_last_bit(name, execution, per_nutation):
    data = symtop.ensemble(bodies(), name, per_nutation=per_nutation, nutations=12, samples=6, quiet=True)
    assert data.attrs["execution"] == execution
    assert_alone(scenes(), name, data, 6)


@pytest.mark.quick
def test_scenes_and_a_population_are_the_same_members_and_threads_change_nothing(monkeypatch, tmp_path):
    settings = {"step_size": 0.05, "horizon": 3.0, "samples": 5, "quiet": True}
    data = symtop.ensemble(bodies(), "strang", **settings)
    expected = symtop.ensemble(scenes(), "strang", **settings)
    xr.testing.assert_identical(data.drop_vars("stratum").drop_attrs(), expected.drop_vars("scene").drop_attrs())
    monkeypatch.setattr(chunks, "LEAST_STEPS", 100)
    xr.testing.assert_identical(symtop.ensemble(bodies().sel(part=[*"xyzw"]), "strang", threads=3, **settings), data)
    with symtop.ensemble(bodies().sel(component=[*"zxy"]), "strang", path=tmp_path / "runs.nc", **settings) as written:
        xr.testing.assert_equal(written.load(), data)


def test_errors_are_those_of_each_member_against_its_own_truth():
    members = [scenes()[i] for i in (0, 2, 4, 12)]  # free
    settings = {"nutations": 3, "samples": 5, "quiet": True}
    data = symtop.ensemble(members, "strang", per_nutation=[100, 100, 100, 20], **settings)
    errors = symtop.errors(data, members)
    for i, scene in enumerate(members):
        run = symtop.simulate(scene, "strang", step_size=float(data.step_size[i]), horizon=float(data.horizon[i]),
                              samples=5, guard=False)  # fmt: skip
        np.testing.assert_array_equal(errors.attitude[i], symtop.errors(run).attitude)
    fine = symtop.errors(symtop.ensemble(members, "strang", per_nutation=100, **settings), members).attitude.max("time")
    ratio = errors.attitude.max("time") / fine
    assert ratio[:3].values.tolist() == [1.0] * 3
    assert 20.0 < ratio[3] < 30.0  # five times the step: order 2
    with pytest.warns(symtop.SymtopWarning, match="is this the start of the scene"):  # of other members: the control
        assert symtop.errors(data.drop_vars("scene"), members[::-1]).attitude.max() > 1.0


@pytest.mark.quick
def test_methods_that_choose_their_steps_run_as_well_and_one_without_the_chart_is_refused():
    data = symtop.ensemble(scenes()[:8], "vern9", tolerance=1e-8, samples=6, quiet=True)
    assert_alone(scenes()[:8], "vern9", data, 6, tolerance=1e-8)
    with pytest.raises(symtop.SymtopError, match=r"of a RigidBody, not stormer-verlet: take one of .*, such as strang"):
        symtop.ensemble(scenes(), "stormer-verlet", step_size=0.1)
