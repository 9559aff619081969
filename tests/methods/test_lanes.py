"""Members that step side by side in lanes have the bits of runs alone, whatever stands beside them."""

import dataclasses

import numpy as np
import pytest

import symtop
from symtop.methods.framework import lanes, loop as loops
from symtop.methods.framework.angles import require_chart
from symtop.methods.framework.lanes import LEAST_MEMBERS, Many, W, divided, groups, members_of, refused, turns
from symtop.methods.framework.loop import FixedStep, inside
from symtop.methods.framework.plan import LEFT_CHART, OK, OUTCOMES, Plan
from symtop.methods.framework.registry import variants
from symtop.methods.lie_group.generalised_alpha import generalised_alpha
from symtop.methods.lie_group.runge_kutta import LieTable, lie_runge_kutta
from symtop.methods.lie_group.variational import EULER_POINCARE, Variational, lie_variational
from symtop.methods.splitting.coefficients import SUZUKI_4
from symtop.methods.splitting.space import march_axis
from symtop.model.top import flat
from tests.conftest import defer

pytestmark = pytest.mark.usefixtures("in_lanes")
SOLVERS = {row.name: solver for row in variants() for solver in filter(None, map(inside, row.solvers.values()))}
IN_LANES = {name for name, solver in SOLVERS.items() if solver.in_lanes}
ENDS = {  # how members end that step too far: numbers overflow, theta passes a pole, Newton finds no root
    ("not_finite",): ("strang[axis]", "takahashi-imada[attitude]", "cayley[axis]", "srkn-14-6[attitude]",
                      "rk4[attitude]", "series[axis]", "series[attitude]", "rkmk-se3-2[axis]",
                      "crouch-grossman-3[attitude]", "vern9-fixed[axis]", "tsit5-fixed[attitude]", "kahan[axis]"),
    (): ("exact-discrete[attitude]",),  # whose steps are parts of a nutation, however long they are
    ("not_finite", "left_chart"): ("stormer-verlet[angles]", "dop853-compiled-fixed[angles]"),
    ("not_converged",): ("gauss-4[axis]", "gauss-12[axis]", "gauss-6[attitude]", "lie-variational[axis]",
                         "generalised-alpha[attitude]"),
    ("left_chart", "not_converged"): ("midpoint[angles]", "trapezoidal[angles]", "simpson-linear[angles]",
                                      "galerkin-simpson[angles]", "galerkin-gauss-6[angles]"),
}  # fmt: skip
FEW = {  # a method of each family with its mark, for the others compile for 20 s
    **dict.fromkeys(("strang[axis]", "rk4[attitude]", "series[axis]", "rkmk-se3-2[axis]", "gauss-4[axis]",
                     "stormer-verlet[angles]", "midpoint[angles]"), ()),
    **dict.fromkeys(("vern9-fixed[axis]", "exact-discrete[attitude]", "galerkin-simpson[angles]"), pytest.mark.quick),
    **dict.fromkeys(("lie-variational[axis]", "kahan[axis]"), pytest.mark.quick),
}  # fmt: skip
ALONE = ("midpoint-unreduced[angles]", "series-general[axis]", "collective-gauss-4[axis]")  # one after another
EXPLICIT = ("rkmk-se3-2", "rkmk-se3-4", "rkmk-se3-5", "rkmk-se3-8", "crouch-grossman-3", "commutator-free-4")
ITERATED = ("lie-variational", "lie-variational-suzuki-4", "euler-poincare", "simo-wong", "generalised-alpha")
FAR, LOST = slice(3, None, 17), slice(5, None, 41)  # members whose step turns too far for lanes; whose numbers overflow


def members(count=1000, samples=4, seed=0):
    """Random tops, starts, steps and marks, each of its own; some turn too far in a step, and some overflow."""
    draw = np.random.default_rng(seed)
    I1 = 10.0 ** draw.uniform(-2, 2, count)
    rate = 10.0 ** draw.uniform(-1, 1, count)  # of the motion
    turns = rate[:, None] * draw.normal(size=(count, 3))
    mgl = I1 * rate**2 * draw.choice([-1.0, 0.0, 1.0, 1.0, 1.0], count) * draw.uniform(0.1, 10.0, count)
    numbers = np.column_stack([I1, I1 * draw.uniform(0.01, 2.0, count), mgl, np.arccos(draw.uniform(-1, 1, count)),
                               draw.uniform(-9.0, 9.0, (count, 2)), turns])  # fmt: skip
    h = 10.0 ** draw.uniform(-3.0, -1.2, count) / rate
    h[FAR] *= 300.0
    h[LOST] *= 1e200
    steps = np.cumsum(draw.integers(1, 60, (count, samples)), axis=1)
    steps[::2] -= steps[::2, :1]  # every other one shows its start
    return numbers, h, steps


def assert_runs_alone(solver, numbers, h, marks, results):
    """Every member has the bits of a run alone, and its counts."""
    for i, (top, start) in enumerate(members_of(numbers)):
        run = solver(top, start, Plan.steps(float(h[i]), marks[i]))
        assert results.states[i].tobytes() == run.states.tobytes()  # a zero has a sign
        assert results.momenta[i].T.tobytes() == np.array((run.p_phi, run.p_psi)).tobytes()
        evaluations, iterations = solver.counts(results.steps[i], results.work[i])
        assert (results.steps[i], evaluations, iterations, OUTCOMES[results.outcome[i]]) == run[3:7]


def left_alone(solver, numbers, h, marks):
    """The members that the lanes give back."""
    whole = solver._whole
    results = Many.empty(len(h), marks.shape[1], whole.alone[3])
    return whole.blocks().run(np.arange(len(h)), numbers, whole.rule, h, marks, results, loops.BLOCK)


@pytest.mark.parametrize(("name", "ends"), [
    pytest.param(name, ends, marks=FEW.get(name, pytest.mark.slow))
    for ends, names in ENDS.items() for name in names
])  # fmt: skip
def test_members_have_the_bits_of_runs_alone(name, ends):
    """Those that fail, too; what is not left to a run alone has ended well, or has left its chart."""
    solver, arguments = SOLVERS[name], members(seed=7)
    results = solver.many(*arguments)
    assert_runs_alone(solver, *arguments, results)
    assert {OUTCOMES[k] for k in results.outcome} == {"ok", *ends}
    leftovers = left_alone(solver, *arguments)
    assert set(np.flatnonzero((results.outcome != OK) & (results.outcome != LEFT_CHART))) <= set(leftovers.tolist())
    assert len(leftovers) < 200


@pytest.mark.parametrize(("name", "count", "seed"), [
    *((name, 60, 7) for name in ALONE),
    *(("strang[axis]", count, 3) for count in (1, W - 1, W, W + 1)),
    *(("strang[axis]", LEAST_MEMBERS + more, 3) for more in (-1, 0, 2 * W)),
])  # fmt: skip
def test_members_one_after_another_and_in_blocks_that_are_not_full_have_the_bits_of_runs_alone(name, count, seed):
    arguments = members(count, seed=seed)
    assert_runs_alone(SOLVERS[name], *arguments, SOLVERS[name].many(*arguments))


@pytest.mark.slow
@pytest.mark.parametrize("name", SOLVERS)
def test_members_of_every_method_have_the_bits_of_runs_alone(name):
    for seed in (1, 2) if name in IN_LANES else (1,):
        arguments = members(1000 if name in IN_LANES else 60, samples=9, seed=seed)
        assert_runs_alone(SOLVERS[name], *arguments, SOLVERS[name].many(*arguments))


def test_methods_that_have_lanes():
    assert {row.name for row in variants() if row.family == "splitting"} - IN_LANES == {
        "stormer-verlet-reversible[angles]",  # of steps that differ between members
        "five-rotations[attitude]",  # the kernel is that of a body
    }
    assert {"rk4[angles]", "tsit5-fixed[angles]", "vern9-fixed[angles]"} <= IN_LANES
    for name in ("exact-discrete", "series", "rk4", "vern9-fixed", "gauss-12", "kahan", *EXPLICIT, *ITERATED):
        assert {f"{name}[axis]", f"{name}[attitude]"} <= IN_LANES
    prefixes = ("exact[", "rk45", "taylor", "series-adaptive", "series-general", "collective-gauss")
    assert not any(name.startswith(prefixes) or "unreduced" in name for name in IN_LANES)


@pytest.mark.parametrize("name", ["strang[axis]", ALONE[-1]])  # in lanes, and one after another
def test_arrays_that_cannot_be_written_to_compile_nothing_again(name):
    """numba gives such an array another type, and the last member of a ladder came as a broadcast one."""
    solver, arguments = SOLVERS[name], members(1)
    whole = solver._whole
    solver.many(*arguments)
    run = whole.alone[0]
    kernels = run if whole.blocks is None else whole.blocks().march
    before = len(kernels.signatures), len(run.signatures)
    for array in arguments:
        array.setflags(write=False)
    solver.many(*arguments)
    assert (len(kernels.signatures), len(run.signatures)) == before


def test_lanes_finish_what_needs_no_branch_and_a_member_does_not_see_its_neighbours():
    numbers, h, marks = members()
    far, lost = (set(range(1000)[part]) for part in (FAR, LOST))
    leftovers = left_alone(SOLVERS["strang[axis]"], numbers, h, marks).tolist()
    assert len(leftovers) == len(set(leftovers)) < 200
    assert lost < set(leftovers)
    assert len(far & set(leftovers)) > 0.8 * len(far)
    cayley = left_alone(SOLVERS["cayley[axis]"], numbers, h, marks).tolist()
    assert lost - set(cayley) <= set(np.flatnonzero(numbers[:, 2] == 0.0))
    assert len(cayley) < 60  # a Cayley drift may turn as far as it likes
    # Bits of the members that were not touched; the one that was differs (the negative control).
    numbers, h, marks = members(200)
    solver = SOLVERS["srkn-14-6[attitude]"]
    before = solver.many(numbers, h, marks)
    numbers[100, 5], h[101], numbers[102, 8] = numbers[100, 5] + 1.0, 1e200, np.nan
    after = solver.many(numbers, h, marks)
    assert OUTCOMES[after.outcome[102]] == "not_finite"
    indices = [i for i in range(200) if not np.array_equal(before.states[i], after.states[i], equal_nan=True)]
    assert indices == [100, 101, 102]


@pytest.mark.parametrize(("name", "longer"), [
    ("midpoint[angles]", 40.0), *defer(*((f"{name}[attitude]", 20.0) for name in ITERATED))])  # fmt: skip
def test_a_lane_that_takes_more_iterations_changes_no_other(name, longer):
    """A step so large that one lane takes more passes; the others keep bits and counts, and that one does not."""
    draw, scene, solver = np.random.default_rng(0), symtop.scene("spheroid"), SOLVERS[name]
    numbers = np.tile(flat(scene.top, scene.start), (W, 1))  # starts and tops around a scene
    numbers[:, 3:] *= draw.uniform(0.8, 1.2, (W, 6))
    numbers[:, 1] *= draw.uniform(0.8, 1.2, W)
    h, marks = np.full(W, scene.nutation_period / 300), np.tile([0, 40], (W, 1))
    before = solver.many(numbers, h, marks)
    h[5] *= longer
    after, mask = solver.many(numbers, h, marks), np.arange(W) != 5
    assert ((before.outcome == 0).all(), after.work[5] > before.work[5]) == (True, True)
    assert not np.array_equal(before.states[5], after.states[5])
    for first, second in zip(before, after, strict=True):
        np.testing.assert_array_equal(first[mask], second[mask])
    assert_runs_alone(solver, numbers, h, marks, after)


@pytest.mark.parametrize(("name", "steps"), [("takahashi-imada[attitude]", 250), (ALONE[-1], 15)])
def test_runs_of_a_few_steps_at_a_time_are_the_same(monkeypatch, name, steps):
    arguments, solver = members(300), SOLVERS[name]
    expected = solver.many(*arguments)
    monkeypatch.setattr(loops, "BLOCK", steps)  # back to Python eight steps of a block at a time
    monkeypatch.setattr(lanes, "BATCH_MEMBERS", 2 * W)
    for first, second in zip(expected, solver.many(*arguments), strict=True):
        np.testing.assert_array_equal(first, second)


def test_members_stand_in_the_order_of_their_steps_and_of_their_turns_and_uneven_blocks_are_left():
    steps = np.concatenate([np.full(40, 100), [1000, 10_000], np.arange(1, 30)])
    in_order, leftovers = divided(np.arange(len(steps)), steps)
    assert sorted((*in_order, *leftovers)) == list(range(len(steps)))
    assert (np.diff(steps[in_order]) >= 0).all()
    assert {40, 41} <= set(leftovers)  # beside the others they would keep a block waiting
    assert [part.size for part in divided(np.arange(0), steps)] == [0, 0]
    assert [divided(np.arange(LEAST_MEMBERS - k), np.full(9, 7))[1 - k].size for k in (0, 1)] == [0, 0]
    # Without turns they stand as they came (the negative control); with them, unlike steps still stand apart.
    count, draw = 8 * W, np.random.default_rng(0)
    turn, indices = draw.uniform(size=count), np.arange(count)
    turn[7] = np.nan  # a member whose step overflows: beside the largest
    in_order, leftovers = divided(indices, np.full(count, 100), turn)
    assert leftovers.size == 0
    np.testing.assert_array_equal(in_order, np.argsort(turn))
    np.testing.assert_array_equal(divided(indices, np.full(count, 100))[0], indices)
    steps = draw.choice([100, 103, 1000], count)
    in_order, leftovers = divided(indices, steps, turn)
    assert sorted((*in_order, *leftovers)) == list(indices)
    short = in_order[steps[in_order] < 1000]
    np.testing.assert_array_equal(short, in_order[: len(short)])
    assert (np.diff(turn[short[turn[short] >= 0]]) > 0).all()
    assert max(100, 103) / 100 < lanes.ALIKE_RATIO < 1000 / 103
    assert divided(np.arange(LEAST_MEMBERS), np.zeros(9, dtype=int), turn)[0].size == LEAST_MEMBERS  # no step at all


def test_groups_hold_every_member_once_and_turns_are_those_of_the_motion():
    steps = np.random.default_rng(1).integers(1, 50, 200)
    indices = np.flatnonzero(steps != 7)
    parts = groups(indices, steps, 300)
    np.testing.assert_array_equal(np.concatenate(parts), indices)
    assert (max(int(steps[part].sum()) for part in parts) < 350, len(parts) > 10) == (True, True)
    assert groups(indices[:0], steps, 300) == []
    still, spinning, far = np.zeros((3, 9))
    still[:3], spinning[:3], far[:3] = (2.0, 1.0, 18.0), (2.0, 1.0, 0.0), (2.0, 1.0, 1.0)
    spinning[8], far[6] = 4.0, 1e200
    angle = turns(np.array([still, spinning, far]), np.array([-0.1, 0.5, 1e200]))
    np.testing.assert_allclose(angle, [0.1 * 3.0, 0.5 * 2.0, np.inf])


def test_a_start_that_a_kernel_refuses_is_refused_of_a_member_too():
    numbers = members(9)[0]
    numbers[:3, 3] = 0.0, np.pi, 1.0
    half = lambda start: require_chart(symtop.Angles(start.theta / 2))  # a check of one's own, which lets pi pass
    assert [int(refused(check, numbers).sum()) for check in (require_chart, half, None)] == [2, 1, 0]


def test_lanes_given_up_between_samples_and_exact_steps_of_several_parts_are_run_alone():
    """The marks lie further apart than the steps after which a block looks for lanes that were given up."""
    numbers, h, _ = members(W, seed=4)
    marks = np.tile([0, 2 * lanes.STRETCH_STEPS + 7], (W, 1)) + np.arange(W)[:, None]
    assert_runs_alone(SOLVERS["strang[axis]"], numbers, h, marks, SOLVERS["strang[axis]"].many(numbers, h, marks))
    # Next to a separatrix a long step is divided; its neighbours in the block are not.
    scene, solver = symtop.scene("separatrix"), SOLVERS["exact-discrete[axis]"]
    numbers, h, marks = members(2 * W, seed=8)
    numbers[7], h[7] = flat(scene.top, scene.start), scene.horizon / 4.0
    marks[:] = marks[0]
    assert left_alone(solver, numbers, h, marks).tolist().count(7) == 1
    results = solver.many(numbers, h, marks)
    assert results.work[7] > results.steps[7]
    assert_runs_alone(solver, numbers, h, marks, results)


def test_tables_of_stages_run_in_lanes_and_kicks_left_out_change_no_bit():
    """Lanes carry out a kick by 0, alone it is skipped: inside a table, at its ends, and all of them for a free top."""
    method = symtop.composition("gaps", (0.25, 0.25, 0.5), (0.0, 0.5, 0.0, 0.5), chart="space")
    numbers, h, marks = members(200)
    numbers[::3, 2], numbers[::7, 5:] = 0.0, -0.0  # and some that stand still
    for chart in ("axis", "attitude"):
        solver = method.solvers[chart]
        assert_runs_alone(solver, numbers, h, marks, solver.many(numbers, h, marks))
    # Stages that are multiplied out by hand, as a script has them.
    scene, strang = symtop.scene("spheroid"), SOLVERS["strang[axis]"]
    h = scene.nutation_period / 100
    solver = FixedStep(march_axis, strang.rule(scene.top, scene.start, h), symtop.on_axis, 1, implicit=False)
    numbers, steps = np.tile(flat(scene.top, scene.start), (40, 1)), np.full(40, h)
    numbers[:, 4] = np.linspace(0.0, 1.0, 40)
    marks = np.tile([0, 10, 50], (40, 1))
    for first, second in zip(solver.many(numbers, steps, marks), strang.many(numbers, steps, marks), strict=True):
        np.testing.assert_array_equal(first, second)


def test_kernels_are_shared_by_charts_compositions_and_numbers():
    """Axis and attitude differ in what is shown, compositions in the table; other equations are other kernels."""
    kernels = {(name, chart): SOLVERS[f"{name}[{chart}]"]._whole.blocks().march
               for name in (*EXPLICIT, *ITERATED) for chart in ("axis", "attitude")}  # fmt: skip
    assert all(kernels[name, "axis"] is kernels[name, "attitude"] for name in (*EXPLICIT, *ITERATED))
    assert kernels["lie-variational", "axis"] is kernels["lie-variational-suzuki-4", "axis"]
    assert len(set(map(id, kernels.values()))) == 10
    solver = generalised_alpha("other", 0.3).solvers["axis"]
    assert solver._whole.blocks().march is kernels["generalised-alpha", "axis"]


def with_shares(name, shares):
    """A method as a composition of itself."""
    return dataclasses.replace(SOLVERS[name], rule=SOLVERS[name].rule._replace(shares=shares))


def of_table(*rows, brackets=0):
    return lie_runge_kutta("any", rows, 1, "", "", brackets=brackets).solvers["attitude"]


@pytest.mark.quick
@pytest.mark.parametrize("solver", [
    of_table(((1.0,),)),
    of_table(((1.0,),), ((0.5, 0.5), (0.0, 0.0)), brackets=2),
    lie_variational("any", Variational(EULER_POINCARE, SUZUKI_4.drift), 4, "", "").solvers["axis"],
    generalised_alpha("any", 0.0).solvers["axis"],
    dataclasses.replace(SOLVERS["rkmk-se3-2[attitude]"], rule=LieTable((0.0,), (1.0,))),
    with_shares("rkmk-se3-2[attitude]", (0.25, 0.75)),
    with_shares("generalised-alpha[axis]", (0.25, 0.5, 0.25)),
    symtop.runge_kutta("any", ((),), (1.0,)).solvers["axis"],
    symtop.runge_kutta("any", ((), (1 / 3,), (0.0, 2 / 3)), (0.25, 0.0, 0.75)).solvers["axis"],
    symtop.discrete_lagrangian("mixed", (0.0, 0.0, 0.3, 1.0), (0.1, 0.2, 0.3, 0.4)).solvers["angles"],
], ids=["euler", "heun", "euler-poincare-4", "alpha-0", "zeros", "rkmk-twice", "alpha-thrice", "rk-1", "rk-3",
        "weights"])  # fmt: skip
def test_tables_and_compositions_of_ones_own_have_the_bits_of_runs_alone(solver):
    """A weight of 0 is carried out like any other, and each share of generalised-alpha goes on from the last one."""
    arguments = members(200, seed=12)
    assert solver.in_lanes
    assert_runs_alone(solver, *arguments, solver.many(*arguments))


@pytest.mark.parametrize("name", ["commutator-free-4", *defer(*(name for name in ITERATED if "suzuki" not in name))])
def test_lanes_whose_exponential_turns_too_far_for_its_series_run_alone_and_cayleys_turns_as_far_as_it_likes(name):
    """Of Cayley's only members whose equation cannot be solved, or takes half of the passes or more, are left."""
    solver, arguments, far = SOLVERS[f"{name}[axis]"], members(400, seed=11), set(range(400)[FAR])
    leftovers, results = set(left_alone(solver, *arguments).tolist()), solver.many(*arguments)
    failed = set(np.flatnonzero(results.outcome != 0).tolist())
    assert failed <= leftovers
    if name in ("commutator-free-4", "generalised-alpha"):
        assert failed < leftovers  # some of those that are left end well, with sine and cosine
        assert len(far & leftovers) > 0.6 * len(far)
        assert len(leftovers) < 80
    else:
        assert len(leftovers) <= len(failed) + 5
        assert len(far - leftovers) > (0 if name == "lie-variational" else 5)
