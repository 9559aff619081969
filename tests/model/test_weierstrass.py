"""The Weierstrass function and Carlson's integrals against multiprecision, and against each other."""

import math

import numpy as np
import pytest
from mpmath import elliprf, elliprj, mp, mpf, workdps

from symtop.model.exact.elliptic import differences, half_period, r_j, roots


def exact_roots(g2, g3):
    """e1 >= e2 >= e3 to 40 digits."""
    with mp.extraprec(200):
        zeros, _ = mp.eig(mp.matrix([[0, 0, mpf(g3) / 4], [1, 0, mpf(g2) / 4], [0, 1, 0]]))  # the companion matrix
    return sorted((mp.re(root) for root in zeros), reverse=True)


def exact_differences(e, h):
    """wp(h) - e_i to 40 digits."""
    w = mp.sqrt(e[0] - e[2])
    sn, cn, dn = (mp.ellipfun(name, w * h, m=(e[1] - e[2]) / w**2) for name in ("sn", "cn", "dn"))
    return [(w * value / sn) ** 2 for value in (cn, dn, 1)]


def cubics(count, gap=None):
    """g2, g3 of random tops: turning points in [-1, 1], a third root above, any strength of gravity."""
    rng = np.random.default_rng(7)
    for _ in range(count):
        low, high = np.sort(rng.uniform(-1.0, 1.0, 2))
        high = high if gap is None else low + gap
        u = np.array([low, high, 1.0 + rng.exponential()])
        e = 10.0 ** rng.uniform(-2.0, 2.0) * 0.5 * (u - u.mean())
        yield 2.0 * float(e @ e), 4.0 * float(np.prod(e)), rng


@pytest.mark.parametrize("gap", [None, 1e-3, 1e-7])
def test_wp_is_right_to_rounding_even_where_two_roots_are_not_told_apart(gap):
    with workdps(40):
        for g2, g3, rng in cubics(30, gap):
            e, exact = roots(g2, g3), exact_roots(g2, g3)
            half = mp.ellipk((exact[1] - exact[2]) / (exact[0] - exact[2])) / mp.sqrt(exact[0] - exact[2])
            assert abs(half_period(e) / half - 1) < 1e-14
            h = float(half) * rng.uniform(0.01, 0.9)
            ours, theirs = differences(e, h), exact_differences(exact, h)
            assert abs(sum(ours) / sum(theirs) - 1) < 3e-15
            assert abs(math.prod(ours) / mp.fprod(theirs) - 1) < 1e-13
            assert abs(elliprf(*theirs) / h - 1) < 1e-30


def test_the_integral_of_the_third_kind_is_carlsons_and_the_edges_of_the_range():
    with workdps(40):
        for g2, g3, rng in cubics(30):
            e = roots(g2, g3)
            h, b = half_period(e) * rng.uniform(0.01, 0.9), e.e3 - rng.exponential()
            args = differences(e, h)
            p = sum(args) / 3.0 - b
            assert abs(r_j(*args, p) / elliprj(*map(mpf, args), mpf(p)) - 1) < 2e-15
            width = 1e-4 * h
            pairs = [differences(e, h + by) for by in (-width, width)]
            before, after = (r_j(*ends, sum(ends) / 3.0 - b) / 3.0 for ends in pairs)
            rate = (after - before) / (2.0 * width)
            assert rate == pytest.approx(1.0 / p, rel=1e-6)
            assert rate != pytest.approx(1.001 / p, rel=1e-6)
    assert half_period(roots(3.0, -1.0)) == pytest.approx(math.inf)  # e1 = e2
    free = roots(0.0, 0.0)
    assert (half_period(free), differences(free, 0.5)) == (math.inf, (4.0, 4.0, 4.0))
    steady = roots(3.0, 1.0)  # e2 = e3 = -1/2: wp = -1/2 + (3/2)/sin^2
    assert differences(steady, 0.3)[2] == pytest.approx(1.5 / math.sin(math.sqrt(1.5) * 0.3) ** 2, rel=1e-14)
    assert r_j(2.0, 2.0, 2.0, 2.0) == pytest.approx(2.0**-1.5, rel=1e-15)
    assert r_j(0.0, 1.0, 2.0, 3.0) == pytest.approx(float(elliprj(0, 1, 2, 3)), rel=1e-14)
