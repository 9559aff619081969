"""What surrounds a kernel compiles to the bits of its Python, and a run at once is a run in stretches."""

import dataclasses
import random

import numpy as np
import pytest

import symtop
from symtop.core.jit import compile_kernel
from symtop.methods.framework import loop, loop as loops
from symtop.methods.framework.angles import on_angles, with_rates
from symtop.methods.framework.loop import FixedStep, inside
from symtop.methods.framework.plan import Plan
from symtop.methods.framework.preparation import Body, Start
from symtop.methods.framework.space import on_attitude, on_axis, on_frame
from symtop.methods.lagrangian.unreduced import with_momenta
from symtop.methods.splitting.coefficients import METHODS
from symtop.methods.splitting.loop import exact_sum
from symtop.model.top import Angles, SymmetricTop, flat

PREPARATIONS = [on_angles, with_rates, with_momenta, on_axis, on_attitude, on_frame]


def tops(count, seed=3):
    """Random tops and starts, of all sizes."""
    draw = random.Random(seed)
    for _ in range(count):
        I1 = 10.0 ** draw.uniform(-4, 4)
        top = SymmetricTop(
            I1, I1 * draw.uniform(1e-3, 2.0), draw.choice((0.0, 1.0, -1.0)) * 10.0 ** draw.uniform(-4, 4)
        )
        rates = [draw.gauss(0.0, 1.0) * 10.0 ** draw.uniform(-3, 3) for _ in range(3)]
        theta = draw.choice((draw.uniform(1e-6, 3.14), 10.0 ** draw.uniform(-9, 0)))
        yield top, Angles(theta, draw.uniform(-9, 9), draw.uniform(-9, 9), *rates)


@pytest.mark.parametrize("prepare", PREPARATIONS, ids=lambda one: one.numbers.__name__)
def test_a_preparation_compiles_to_its_own_bits(prepare):
    numbers = prepare.numbers

    def prepared(plain):
        return numbers(Body(*plain[:3]), Start(*plain[3:]))

    compiled = compile_kernel(prepared)
    for top, at in tops(3000):
        par, state = compiled(flat(top, at))
        assert (tuple(par), state) == tuple(map(tuple, prepare(top, at)))
        assert len(state) == prepare.size


@pytest.mark.parametrize("name", ["strang", "chin-4a", "srkn-14-6", "sofroniou-spaletta-10", "stormer-verlet-suzuki-4"])
def test_the_tables_of_a_kernel_are_closed_as_python_closes_them(name):
    """Against `math.fsum`, for any step and top: no sum of drifts or kicks is off by a rounding."""
    chart, solver = next(iter(symtop.integrator(name).solvers.items()))
    rule, draw = solver.rule.rule, random.Random(5)
    for top, at in tops(1000, seed=5):
        h = 10.0 ** draw.uniform(-6, 1)
        made = solver.rule(top, at, h)
        drift, kick = (h / top.I1, h) if chart == "angles" else (0.5 * h / top.I1, h * top.mgl)
        assert tuple(made.drift) == exact_sum([a * drift for a in rule.drift], drift)
        assert tuple(made.kick) == exact_sum([b * kick for b in rule.kick], kick)
        if chart != "angles":
            bend = 2.0 * h * kick * kick / top.I1
            assert tuple(made.bend) == tuple(c * bend for c in rule.gradient)


def in_python(solver):
    """The same solver with a preparation that does not compile: a run in stretches."""
    return dataclasses.replace(solver, prepare=solver.prepare.__call__)


def assert_the_same_run(solver, top, start, plan):
    at_once, stretched = solver(top, start, plan), in_python(solver)(top, start, plan)
    for one, other in zip(at_once, stretched, strict=True):
        np.testing.assert_array_equal(one, other)
    assert type(at_once.steps) is int
    assert type(at_once.force_evaluations) is int


@pytest.mark.parametrize(("name", "chart"), [
    ("midpoint", "angles"), ("midpoint-unreduced", "angles"), ("takahashi-imada", "attitude"), ("rk4", "angles"),
    ("cayley-tuned", "axis"), ("gauss-4", "attitude"), ("stormer-verlet", "angles"), ("kahan-li-8", "attitude"),
    ("sofroniou-spaletta-10", "axis"), ("stormer-verlet-blanes-moan-6", "angles"), ("collective-gauss-6", "axis"),
])  # fmt: skip
def test_a_run_at_once_is_a_run_in_stretches(name, chart):
    scene = symtop.scene("spheroid")
    solver = inside(symtop.integrator(name).solvers[chart])
    assert solver._whole is not None
    for marks in ([0, 1], [1], [0, 3, 10, 400], [7, 300]):
        assert_the_same_run(solver, scene.top, scene.start, Plan.steps(0.02, marks))
        assert_the_same_run(solver, scene.top, scene.start, Plan.steps(-0.02, marks))


@pytest.mark.slow
def test_every_run_at_once_is_a_run_in_stretches():
    for scene in (symtop.scene(name, bodies=True) for name in ("goldstein", "grazing", "fast", "tennis-racket")):
        for method in symtop.integrators().values():
            mine = [solver for chart, solver in method.solvers.items() if (chart == "body") is scene.of_body]
            for solver in filter(None, map(inside, mine)):
                for h in (scene.horizon / 400, scene.horizon / 5):
                    assert_the_same_run(solver, scene.top, scene.start, Plan.steps(h, np.arange(0, 400, 3)))


def test_long_runs_return_to_python(monkeypatch):
    """Beyond `BLOCK` steps a run is made in stretches, to the same bits, so that an interrupt is heard."""
    scene, solver = symtop.scene("spheroid"), symtop.integrator("gauss-4").solvers["attitude"]
    plan = Plan.steps(0.01, [0, 50, 100])
    whole = solver(scene.top, scene.start, plan)
    monkeypatch.setattr(loops, "BLOCK", 7)
    monkeypatch.setattr(loop, "flat", None)  # what a run in one call begins with
    np.testing.assert_array_equal(solver(scene.top, scene.start, plan).states, whole.states)


@pytest.mark.parametrize("rule", [(0.0,), np.array([0.5, 0.25])])
def test_a_rule_may_be_whatever_a_kernel_takes(rule):
    def begin(par, rule, state, h):
        return (0.0,)

    def increment(par, rule, state, carry, h):
        return (h * state[1], 0.0, 0.0, 0.0), carry, 1, 0

    def observe(par, rule, before, dstate, h):
        return 0.0, 0.0

    solver = FixedStep(loops.kernel_loop(begin, increment, observe), rule, on_angles, 1, implicit=False)
    run = solver(SymmetricTop(1.0, 1.0, 1.0), Angles(1.0, theta_dot=0.5), Plan.steps(0.25, [0, 1, 4]))
    assert run.states[:, 0].tolist() == [1.0, 1.125, 1.5]
    assert (solver._whole is not None) == isinstance(rule, tuple)


def test_tables_and_compositions_travel_as_arrays_and_arrive_whole():
    """The negative control: scaled without closing, one table in two is off by a rounding somewhere."""
    rule = METHODS["srkn-14-6"].table
    steps = np.random.default_rng(0).uniform(0.01, 0.1, 100)
    off = sum(exact_sum([a * h for a in rule.drift], h) != tuple(a * h for a in rule.drift) for h in steps)
    assert off > 20
    # Numbers of every kind, a rule that hangs on the start included, to the bits of the rule that Python makes.
    scene = symtop.scene("spheroid")
    drift, kick = [0.1, 0.2, 0.4, 0.2, 0.1], [0.05, 0.15, 0.3, 0.3, 0.15, 0.05]
    for more in ({"rotation": "cayley-tuned"}, {"gradient": [0.0, 1e-3, 0.0, 0.0, 1e-3, 0.0], "processor": 0.01}):
        for solver in symtop.composition("long", drift, kick, chart="space", **more).solvers.values():
            assert solver._whole.rule.tolist()[:11] == [*solver.rule.rule.drift, *solver.rule.rule.kick]
            assert_the_same_run(solver, scene.top, scene.start, Plan.steps(0.02, [0, 1, 300]))
