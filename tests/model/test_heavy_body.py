"""The integrated motion of a heavy body against the closed forms that there are, and where it is given up."""

import math
import sys

import numpy as np
import pytest

import symtop
from symtop.core.jit_functions import two_product
from symtop.core.numbers import context
from symtop.model.exact import heavy_body
from symtop.model.exact.digits import PreciseForm
from symtop.model.exact.heavy_body import HeavyBody
from tests.model.bodies import PreciseBody, apart, bodies

BRICK, WEIGHT, START, MOMENTUM = (0.5, 0.9, 1.3), (0.2, 0.1, 1.0), (1.0, 0.0, 0.0, 0.0), (0.5, 0.9, 0.81)
KINDS = ("generic", "near separatrix", "near middle axis", "wobble", "needle")


def worst_share(mp, motion, true):
    """The largest distance from given quaternions over the bound."""
    shares = []
    for high, low, bound, exact in zip(motion.quaternion, motion.quaternion_lo, motion.bound, true, strict=True):
        whole = [mp.mpf(float(a)) + mp.mpf(float(b)) for a, b in zip(high, low, strict=True)]
        shares.append(float(2 * mp.norm([a - b for a, b in zip(whole, exact, strict=True)])) / bound)
    return max(shares)


@pytest.mark.parametrize(("precise", "count"), [(False, len(KINDS)), (True, 2)])
def test_without_weight_it_is_the_exact_free_motion(precise, count):
    for body in bodies(count, 7, KINDS):
        exact = PreciseBody(*body[1:])
        natural = 2.0 * math.pi * float(np.median(body.inertia)) / float(exact.G)
        times = np.array([0.0, -1.7, 10.0]) * natural
        motion = HeavyBody(body.inertia, (0.0, 0.0, 0.0), body.quaternion, body.momentum).samples(
            times, precise=precise
        )
        states = exact.states(times)
        share = worst_share(exact.mp, motion, [state[:4] for state in states])
        assert share < 1.0, body
        assert apart(exact.mp, motion.momentum[2], states[2][4:]) < 1e-12 * float(exact.G)
        assert motion.bound.max() < (1e-24 if precise else 1e-9)
        backwards = HeavyBody(body.inertia, (0.0, 0.0, 0.0), body.quaternion, -body.momentum).samples(times)
        assert worst_share(exact.mp, backwards, [state[:4] for state in states]) > 1e6


@pytest.mark.parametrize("precise", [False, True])
@pytest.mark.parametrize(("moments", "mgl"), [((1.0, 0.4), 1.3), ((0.8, 1.5), -0.7)])
def test_symmetric_body_moves_as_the_symmetric_top(moments, mgl, precise):
    (I1, I3), times = moments, np.linspace(0.0, 40.0, 9)
    start = symtop.Angles(1.1, theta_dot=0.3, psi_dot=2.0)
    rates = (start.theta_dot, 0.0, start.psi_dot)
    momentum = np.transpose([two_product(moment, rate) for moment, rate in zip((I1, I1, I3), rates, strict=True)])
    quaternion = (1.0, math.tan(0.5 * start.theta), 0.0, 0.0)
    ctx = context(60)
    theta = 2 * ctx.atan(ctx.mpf(quaternion[1]))  # of the very double
    form = PreciseForm((I1, I3, mgl), (theta, 0, 0, start.theta_dot, 0, start.psi_dot), 40)
    true = [form.quaternion(t) for t in times]
    motion = HeavyBody((I1, I1, I3), (0.0, 0.0, mgl), quaternion, *momentum).samples(times, precise=precise)
    assert worst_share(form.ctx, motion, true) < 1.0
    assert motion.bound.max() < (1e-25 if precise else 1e-10)
    wrong = HeavyBody((I1, I1, I3), (0.0, 0.0, -mgl), quaternion, *momentum).samples(times, precise=precise)
    assert worst_share(form.ctx, wrong, true) > 1e6


def shares_of_the_bound(body, times):
    """Distances between both precisions over the bound of the first where it is finite, and both bounds."""
    short, long = body.samples(times), body.samples(times, precise=True)
    gap = (short.quaternion - long.quaternion) + (short.quaternion_lo - long.quaternion_lo)
    good = np.isfinite(short.bound)
    return 2.0 * np.linalg.norm(gap[good], axis=1) / short.bound[good], short.bound, long.bound


def test_both_precisions_agree_within_the_bound_of_the_first():
    share, short, long = shares_of_the_bound(HeavyBody(BRICK, WEIGHT, START, MOMENTUM), np.linspace(-60.0, 60.0, 41))
    assert share.size == 41
    assert 1e-6 < share.max() < 1.0  # and the bound is no more than it needs
    assert (long < 1e-9 * short).all() or long.max() < 1e-25


@pytest.mark.slow
def test_both_precisions_of_random_bodies_agree_within_the_bound_of_the_first():
    """Three hundred bodies, regular and chaotic, over ten natural periods."""
    rng, shares, lost = np.random.default_rng(28), [], 0
    for body in bodies(300, 28, ("generic", "near symmetric", "near middle axis")):
        size, middle = float(np.linalg.norm(body.momentum)), float(np.median(body.inertia))
        weight = rng.normal(size=3) * 10.0 ** rng.uniform(-1.0, 0.7)
        period = 2.0 * math.pi / math.sqrt((size / middle) ** 2 + float(np.linalg.norm(weight)) / middle)
        times = np.linspace(0.0, 10.0, 21) * period
        heavy = HeavyBody(body.inertia, weight, body.quaternion, body.momentum)
        share, _, _ = shares_of_the_bound(heavy, times)
        lost += share.size < times.size
        shares.append(share.max())
    print(f"largest distance over the bound {max(shares):.2f}, median {np.median(shares):.2f}; lost {lost} of 300")
    assert max(shares) < 1.0


def test_what_is_lost_in_chaos_is_not_a_number_and_a_run_that_is_too_long_ends_as_lost(monkeypatch):
    times = np.linspace(0.0, 300.0, 31)
    body = HeavyBody(BRICK, WEIGHT, START, MOMENTUM)
    motion = body.samples(times)
    lost = motion.lost(times)
    assert lost is not None
    assert 60.0 < lost < 300.0
    after = times >= lost
    assert np.isinf(motion.bound[after]).all()
    assert np.isnan(motion.quaternion[after]).all()
    assert np.isnan(motion.momentum[after]).all()
    assert np.isfinite(motion.quaternion[~after]).all()
    assert motion.bound[~after].max() <= heavy_body.ACCURACY
    strict = body.samples(times, accuracy=1e-13).lost(times)
    assert strict is not None
    assert strict < lost
    assert body.samples(times[:5]).lost(times[:5]) is None
    assert body.samples(-times).lost(-times) < 0.0
    assert np.array_equal(body.samples([0.0]).quaternion, [START])
    monkeypatch.setattr(heavy_body, "MOST_STEPS", 50)
    times = np.linspace(0.0, 60.0, 13)
    motion = HeavyBody(BRICK, WEIGHT, START, MOMENTUM).samples(times)
    assert motion.lost(times) is not None
    assert np.isfinite(motion.quaternion[0]).all()


def test_numbers_that_are_no_body_are_refused(monkeypatch):
    with pytest.raises(symtop.SymtopError, match="weight must be 3 finite numbers"):
        HeavyBody(BRICK, (0.0, math.inf, 1.0), START, MOMENTUM)
    with pytest.raises(symtop.SymtopError, match="names no attitude"):
        HeavyBody(BRICK, WEIGHT, (0.0, 0.0, 0.0, 0.0), MOMENTUM)
    with pytest.raises(symtop.SymtopError, match="times must be"):
        HeavyBody(BRICK, WEIGHT, START, MOMENTUM).samples([math.nan])
    monkeypatch.setitem(sys.modules, "heyoka", None)
    with pytest.raises(symtop.SymtopError, match="needs the package heyoka"):
        HeavyBody(BRICK, WEIGHT, START, MOMENTUM)
