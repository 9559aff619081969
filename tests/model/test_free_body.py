"""The motion of bodies: a free one's against 50 digits, a heavy one's against the closed forms that there are."""

import math
import sys
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

import symtop
from symtop.core.jit_functions import two_product
from symtop.core.numbers import context
from symtop.model.exact import free_body, free_body as at, heavy_body
from symtop.model.exact.digits import PreciseForm
from symtop.model.exact.free_body import FreeBody
from symtop.model.exact.heavy_body import HeavyBody
from tests.judging.blind.right import product
from tests.model.bodies import KINDS, UNIT, Body, PreciseBody, apart, bodies

PERIODS = 1e6  # of the furthest sample
LARGEST = 20.0  # units of 2^-53


def times_of(body, precise, rng):
    """0, within three periods, as M passes from one end of the middle axis to the other, and far to both sides.

    Near a separatrix the passage lasts a moment of its period; there and near a sphere a period may last for ever.
    """
    natural = 2.0 * math.pi * float(np.median(body.inertia)) / (float(precise.G) or 1.0)
    period = min(float(precise.period or natural), 1e6 * natural)
    near, far = rng.uniform(0.0, 3.0) * period, rng.uniform(-PERIODS, PERIODS) * period
    passage = near
    if precise.period:
        passage = float((2 * precise.K * int(rng.integers(1, 6)) + rng.uniform(-2.0, 2.0) - precise.u0) / precise.rate)
        passage = min(passage, PERIODS * period)  # the errors of the rates take over beyond
    return np.array([0.0, near, passage, 1e-3 * far, far])


def errors(body, rng, change=lambda free: None):
    """Of the attitude, over the bound as well, and of the momentum over its length, in units of 2^-53."""
    precise, free = PreciseBody(*body[1:]), FreeBody(*body[1:])
    change(free)
    times = times_of(body, precise, rng)
    motion, length, rows = free.samples(times), float(precise.G) or 1.0, []
    for q, m, bound, true in zip(motion.quaternion, motion.momentum, motion.bound, precise.states(times), strict=True):
        turn = apart(precise.mp, q, true[:4])
        rows.append((turn / UNIT, turn / bound, apart(precise.mp, m, true[4:]) / (2.0 * length * UNIT)))
    return np.max(rows, axis=0)


def largest(count, seed):
    """Largest errors of so many bodies by kind."""
    rng, worst = np.random.default_rng(seed + 1), {}
    for body in bodies(count, seed):
        worst[body.kind] = np.maximum(worst.get(body.kind, 0.0), errors(body, rng))
    return worst


@pytest.mark.parametrize(("count", "seeds"), [(2, [48]), pytest.param(10, range(100, 177), marks=pytest.mark.slow)])
def test_motion_is_that_of_fifty_digits(count, seeds):
    """Of each kind so many bodies with each seed."""
    with ProcessPoolExecutor() as pool:  # started by its first task
        parts = list((map if len(seeds) == 1 else pool.map)(largest, [count * len(KINDS)] * len(seeds), seeds))
    worst = {kind: np.max([part[kind] for part in parts], axis=0) for kind in KINDS}
    for kind, (turn, share, momentum) in worst.items():
        print(f"{kind:18s} {turn:6.2f} {momentum:6.2f} of 2^-53, {share:.2f} of the bound")
        assert share < 1.0, kind
        assert max(turn, momentum) < LARGEST, kind


@pytest.mark.parametrize(("places", "factor", "limit"), [
    *(([place], -1.0, 1e9) for place in (at.SIGN, at.PHASE, at.HALF, at.LEAN, at.A2)),
    ([at.PHASE + 1, at.HALF + 1], 0.0, 1e3),  # rates of one double
])  # fmt: skip
def test_a_wrong_sign_and_rates_of_one_double_break_the_bound(places, factor, limit):
    body = Body("hyperbolic", np.array([0.5, 0.9, 1.3]), np.array([0.8, 0.0, 0.6, 0.0]), np.array([0.5, 0.9, 0.81]))

    def wrong(free):
        free._constants[places] *= factor

    assert errors(body, np.random.default_rng(1))[1] < 1.0
    assert errors(body, np.random.default_rng(1), wrong)[1] > limit


def test_interpreted_functions_return_the_bits_of_compiled_ones(monkeypatch):
    times = np.array([0.0, 0.7, -1e3, 1e9])
    compiled = [FreeBody(*body[1:]) for body in bodies(len(KINDS), seed=5)]
    for kernel in (free_body._build, free_body._fill):
        kernel.compile()
    motions = [FreeBody(*body[1:]).samples(times) for body in bodies(len(KINDS), seed=5)]
    for kernel in (free_body._build, free_body._fill):
        monkeypatch.setattr(kernel, "ready", lambda _: False)
    for body, motion, first in zip(bodies(len(KINDS), seed=5), motions, compiled, strict=True):
        interpreted = FreeBody(*body[1:])
        np.testing.assert_array_equal(interpreted._constants, first._constants)
        np.testing.assert_array_equal(interpreted.samples(times).quaternion, motion.quaternion)
        np.testing.assert_array_equal(interpreted.samples(times).momentum, motion.momentum)


@pytest.mark.parametrize("rates", [(0.3, 0.0, 2.0), (-1.5, 0.0, 0.4), (1.0, 0.0, 0.0), (0.2, 0.0, -3.0)])
@pytest.mark.parametrize("moments", [(1.0, 0.4), (0.8, 1.5)])
def test_symmetric_body_moves_as_the_symmetric_top(moments, rates):
    (I1, I3), times = moments, np.linspace(0.0, 300.0, 401)
    start = symtop.Angles(1.1, theta_dot=rates[0], psi_dot=rates[2])
    scene = symtop.Scene("free", symtop.SymmetricTop(I1, I3, 0.0), start, horizon=300.0)
    momentum = [two_product(moment, rate) for moment, rate in zip((I1, I1, I3), rates, strict=True)]
    half = 0.5 * start.theta
    body = FreeBody((I1, I1, I3), (math.cos(half), math.sin(half), 0.0, 0.0), *np.transpose(momentum))
    true, motion = symtop.reference(scene, times), body.samples(times)
    gap = 2.0 * np.linalg.norm(motion.quaternion - true["quaternion"].values, axis=1)
    assert (gap <= motion.bound + true["attitude_error_bound"].values).all()
    assert motion.bound.max() < 1e-14
    control = FreeBody((1.001 * I1, I1, I3), (math.cos(half), math.sin(half), 0.0, 0.0), *np.transpose(momentum))
    assert 2.0 * np.linalg.norm(control.samples(times).quaternion - true["quaternion"].values, axis=1).max() > 1e-3


@pytest.mark.slow
def test_fifty_digits_of_nasas_brick_are_those_of_a_series_of_the_equations_of_motion():
    """Its published digits are in `tests/benchmarks/test_check_case.py`; Taylor's series is mpmath's."""
    mp = context(24)
    moments, rates = [mp.mpf(moment) for moment in ("0.00189422", "0.006211019", "0.007194665")], (10, 20, 30)
    start = [mp.one, mp.zero, mp.zero, mp.zero, *(i * mp.radians(rate) for i, rate in zip(moments, rates, strict=True))]

    def field(_, state):
        momentum = np.array(state[4:])
        omega = momentum / np.array(moments)
        return [*(product(np.array(state[:4]), np.array([0, *omega])) / 2), *np.cross(momentum, omega)]

    precise = PreciseBody(moments, start[:4], start[4:])
    assert precise.mp.nstr(precise.period, 15) == "17.3844892719394"
    gaps = [a - b for a, b in zip(precise.states([10])[0], mp.odefun(field, 0, start)(10), strict=True)]
    assert precise.mp.norm(gaps) < 1e-18


BRICK, WEIGHT, START, MOMENTUM = (0.5, 0.9, 1.3), (0.2, 0.1, 1.0), (1.0, 0.0, 0.0, 0.0), (0.5, 0.9, 0.81)
HEAVY = ("generic", "near separatrix", "near middle axis", "wobble", "needle")


def worst_share(mp, motion, true):
    """The largest distance from given quaternions over the bound."""
    shares = []
    for high, low, bound, exact in zip(motion.quaternion, motion.quaternion_lo, motion.bound, true, strict=True):
        total = [mp.mpf(float(a)) + mp.mpf(float(b)) for a, b in zip(high, low, strict=True)]
        shares.append(float(2 * mp.norm([a - b for a, b in zip(total, exact, strict=True)])) / bound)
    return max(shares)


@pytest.mark.parametrize(("precise", "count"), [(False, len(HEAVY)), (True, 2)])
def test_without_weight_it_is_the_exact_free_motion(precise, count):
    for k, body in enumerate(bodies(count, 7, HEAVY)):
        exact = PreciseBody(*body[1:])
        times = np.array([0.0, -1.7, 10.0]) * 2.0 * math.pi * float(np.median(body.inertia)) / float(exact.G)
        free, states = HeavyBody(body.inertia, (0.0, 0.0, 0.0), body.quaternion, body.momentum), exact.states(times)
        motion = free.samples(times, precise=precise)
        assert worst_share(exact.mp, motion, [state[:4] for state in states]) < 1.0, body
        assert apart(exact.mp, motion.momentum[2], states[2][4:]) < 1e-12 * float(exact.G)
        assert motion.bound.max() < (1e-24 if precise else 1e-9)
        if k == 0:  # the control
            backwards = HeavyBody(body.inertia, (0.0, 0.0, 0.0), body.quaternion, -body.momentum).samples(times)
            assert worst_share(exact.mp, backwards, [state[:4] for state in states]) > 1e6


@pytest.mark.parametrize("precise", [False, True])
@pytest.mark.parametrize(("moments", "mgl"), [((1.0, 0.4), 1.3), ((0.8, 1.5), -0.7)])
def test_symmetric_heavy_body_moves_as_the_symmetric_top(moments, mgl, precise):
    (I1, I3), times = moments, np.linspace(0.0, 40.0, 9)
    start = symtop.Angles(1.1, theta_dot=0.3, psi_dot=2.0)
    rates = (start.theta_dot, 0.0, start.psi_dot)
    momentum = np.transpose([two_product(moment, rate) for moment, rate in zip((I1, I1, I3), rates, strict=True)])
    quaternion, ctx = (1.0, math.tan(0.5 * start.theta), 0.0, 0.0), context(60)
    theta = 2 * ctx.atan(ctx.mpf(quaternion[1]))  # of the very double
    form = PreciseForm((I1, I3, mgl), (theta, 0, 0, start.theta_dot, 0, start.psi_dot), 40)
    true = [form.quaternion(t) for t in times]
    motion = HeavyBody((I1, I1, I3), (0.0, 0.0, mgl), quaternion, *momentum).samples(times, precise=precise)
    assert worst_share(form.ctx, motion, true) < 1.0
    assert motion.bound.max() < (1e-25 if precise else 1e-10)
    control = HeavyBody((I1, I1, I3), (0.0, 0.0, -mgl), quaternion, *momentum).samples(times, precise=precise)
    assert worst_share(form.ctx, control, true) > 1e6


def shares_of_the_bound(body, times):
    """Distances between both precisions over the bound of the first where it is finite, and both bounds."""
    short, long = body.samples(times), body.samples(times, precise=True)
    gap = (short.quaternion - long.quaternion) + (short.quaternion_lo - long.quaternion_lo)
    mask = np.isfinite(short.bound)
    return 2.0 * np.linalg.norm(gap[mask], axis=1) / short.bound[mask], short.bound, long.bound


def test_both_precisions_agree_within_the_bound_of_the_first():
    share, short, long = shares_of_the_bound(HeavyBody(BRICK, WEIGHT, START, MOMENTUM), np.linspace(-60.0, 60.0, 41))
    assert share.size == 41
    assert 1e-6 < share.max() < 1.0  # and the bound is no more than it needs
    assert (long < 1e-9 * short).all() or long.max() < 1e-25


@pytest.mark.slow
def test_both_precisions_of_random_bodies_agree_within_the_bound_of_the_first():
    """Three hundred bodies, regular and chaotic, over ten natural periods."""
    rng, shares, losses = np.random.default_rng(28), [], 0
    for body in bodies(300, 28, ("generic", "near symmetric", "near middle axis")):
        size, middle = float(np.linalg.norm(body.momentum)), float(np.median(body.inertia))
        weight = rng.normal(size=3) * 10.0 ** rng.uniform(-1.0, 0.7)
        period = 2.0 * math.pi / math.sqrt((size / middle) ** 2 + float(np.linalg.norm(weight)) / middle)
        times = np.linspace(0.0, 10.0, 21) * period
        share, _, _ = shares_of_the_bound(HeavyBody(body.inertia, weight, body.quaternion, body.momentum), times)
        losses += share.size < times.size
        shares.append(share.max())
    print(f"largest distance over the bound {max(shares):.2f}, median {np.median(shares):.2f}; lost {losses} of 300")
    assert max(shares) < 1.0


def test_what_is_lost_in_chaos_is_not_a_number(monkeypatch):
    times, body = np.linspace(0.0, 300.0, 31), HeavyBody(BRICK, WEIGHT, START, MOMENTUM)
    motion = body.samples(times)
    end = times[np.isinf(motion.bound)].min()
    assert 60.0 < end < 300.0
    after = times >= end
    assert np.isinf(motion.bound[after]).all()
    assert np.isnan(np.hstack([motion.quaternion, motion.momentum])[after]).all()
    assert np.isfinite(motion.quaternion[~after]).all()
    assert motion.bound[~after].max() <= heavy_body.ACCURACY
    assert np.isfinite(body.samples(times[:5]).bound).all()
    assert np.isinf(body.samples(-times).bound[[0, -1]]).tolist() == [False, True]
    assert np.array_equal(HeavyBody(BRICK, WEIGHT, START, MOMENTUM).samples([0.0]).quaternion, [START])
    assert HeavyBody(BRICK, (0.0, 0.0, -1e9), (1, 0, 0, 0), (0, 0, 0)).samples([1e9]).bound < 1e-15  # in long pieces
    monkeypatch.setattr(heavy_body, "ACCURACY", 1e-13)
    assert times[np.isinf(body.samples(times).bound)].min() < end


@pytest.mark.parametrize("precise", [False, True])
def test_a_value_and_its_bound_do_not_depend_on_the_times_beside_it_or_asked_for_before(precise):
    queries, times = np.array([-3.7, 0.0, 8.0, 8.1, 33.3, 69.0]), np.linspace(-12.0, 20.0, 12)
    new, used = (HeavyBody(BRICK, WEIGHT, START, MOMENTUM) for _ in range(2))
    at_once, before = new.samples(queries, precise=precise), used.samples(times, precise=precise)
    heavy_body._piece.cache_clear()  # the pieces are made again from the states that are kept
    single = [used.samples([time], precise=precise) for time in queries]
    for name in ("quaternion", "quaternion_lo", "momentum", "bound"):
        assert np.array_equal(np.concatenate([getattr(row, name) for row in single]), getattr(at_once, name)), name
    assert before.known >= 12.0
    assert (np.diff(used.samples(np.linspace(0.0, 50.0, 301), precise=precise).bound) >= 0.0).all()


def test_a_run_that_was_interrupted_is_begun_again(monkeypatch):
    steps, body = iter([True] * 100), HeavyBody(BRICK, WEIGHT, START, MOMENTUM)
    body.samples([1.0])
    monkeypatch.setattr(heavy_body, "_handle_interrupt", lambda _: next(steps))  # as Ctrl-C ends a step
    with pytest.raises(StopIteration):
        body.samples([30.0])
    monkeypatch.undo()
    repeat, fresh = (each.samples([2.0, 30.0]) for each in (body, HeavyBody(BRICK, WEIGHT, START, MOMENTUM)))
    assert np.array_equal(np.c_[repeat.bound, repeat.quaternion_lo], np.c_[fresh.bound, fresh.quaternion_lo])


NOWHERE = (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(("make", "words"), [
    (lambda: FreeBody((1.0, 2.0), START, MOMENTUM), "inertia must be 3"),
    (lambda: FreeBody((1.0, -2.0, 2.0), START, MOMENTUM), "positive moments"),
    (lambda: FreeBody((1.0, 2.0, math.nan), START, MOMENTUM), "inertia must be 3 finite"),
    (lambda: FreeBody(BRICK, NOWHERE, MOMENTUM), "names no attitude"),
    (lambda: FreeBody(BRICK, START, (1e-101, 2, 3)), "1e-100"),
    (lambda: FreeBody((1e-31, 2.0, 2.5), START, MOMENTUM), "1e-30"),
    (lambda: HeavyBody(BRICK, (0.0, math.inf, 1.0), START, MOMENTUM), "weight must be 3 finite numbers"),
    (lambda: HeavyBody(BRICK, (0.0, 1e101, 1.0), START, MOMENTUM), "of at most 1e100"),
    (lambda: HeavyBody(BRICK, WEIGHT, NOWHERE, MOMENTUM), "which names no attitude"),
])  # fmt: skip
def test_numbers_that_are_no_body_are_refused(make, words):
    with pytest.raises(symtop.SymtopError, match=words):
        make()


def test_times_are_a_row_of_finite_numbers_and_a_heavy_body_needs_heyoka(monkeypatch):
    free, heavy = FreeBody((1.0, 2.0, 2.5), (1, 0, 0, 0), (1, 2, 3)), HeavyBody(BRICK, WEIGHT, START, MOMENTUM)
    for body, times in ((free, [0.0, math.nan]), (free, [[0.0]]), (free, [2e100]), (heavy, [math.nan])):
        with pytest.raises(symtop.SymtopError, match="times must be"):
            body.samples(times)
    assert free.samples([1e100]).bound == math.pi
    monkeypatch.setitem(sys.modules, "heyoka", None)
    with pytest.raises(symtop.SymtopError, match="needs the package heyoka"):
        HeavyBody(BRICK, WEIGHT, START, MOMENTUM)
