"""The order conditions of tables in the ledger: what a slope does not show is refuted, what is right is confirmed."""

import pytest

import symtop
from symtop.judging.claims.order import measure, table_of
from symtop.judging.claims.subject import Subject
from symtop.methods.splitting import composition

SPHEROID = symtop.scene("spheroid")


def order(method):
    """The finding on the order."""
    return measure(Subject(method, SPHEROID, quick=True))[0]


B = (1 / 6, 1 / 3, 1 / 3, 1 / 6)


def test_a_table_that_is_off_by_a_billionth_is_refuted_before_any_run():
    off = symtop.runge_kutta("off", ((), (0.5,), (0.0, 0.5), (1e-9, 0.0, 1.0 - 1e-9)), B, order=4)
    found = order(off)
    assert found.verdict == "refuted"
    assert found.why.startswith(
        "its table misses a condition of order 3 by 8.3e-11 (slopes show it from steps of 2e-05"
    )


@pytest.mark.parametrize(("claimed", "verdict"), [(4, "confirmed"), (None, "measured"), (5, "refuted")])
def test_a_right_table_is_said_to_be_so(claimed, verdict):
    method = symtop.runge_kutta("classical", ((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)), B, order=claimed)
    found = order(method)
    assert found.verdict == verdict
    said = (
        "its table misses a condition of order 5 by" if claimed == 5 else "its table meets the conditions up to order 4"
    )
    assert found.why.startswith(said)


OUTER = 1 / (2 - 2 ** (1 / 3))


@pytest.mark.parametrize(("off", "verdict"), [(0.0, "confirmed"), (1e-11, "refuted")])
def test_a_splitting_that_is_off_is_refuted_before_any_run(off, verdict):
    outer = OUTER + off
    inner = 1 - 2 * outer
    half = (outer + inner) / 2
    method = symtop.composition(
        "triple", (outer, inner, outer), (outer / 2, half, half, outer / 2), chart="space", order=4
    )
    finding = order(method)
    assert finding.verdict == verdict
    said = (
        "meets the conditions up to order 4 to"
        if verdict == "confirmed"
        else "misses a condition of order 3 by 1.1e-11"
    )
    assert finding.why.startswith(f"its table {said}")


def test_every_splitting_of_the_catalogue_has_the_order_that_it_claims():
    orders = {method.name: (method.order, table_of(method)) for method in composition.built_in()}
    claimed = {name: order for name, (order, table) in orders.items() if table is not None}
    assert {name: orders[name][1].order for name in claimed} == claimed
    assert set(orders) - set(claimed) == {"cayley", "cayley-tuned"}


def test_a_method_without_a_table_has_none():
    assert table_of(symtop.integrator("gauss-4")) is None
    assert table_of(symtop.integrator("rk4")).order == 4
