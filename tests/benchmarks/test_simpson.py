"""What is published of the Simpson integrator on this top holds here, and its controls lack it."""

import pytest

import symtop
from benchmarks import simpson


@pytest.fixture(scope="module", params=["spheroid", "goldstein"])
def found(request):
    return {point.name: point for point in simpson.points(symtop.scene(request.param))}


@pytest.mark.parametrize("name", ["order of theta", "order of energy"])
def test_it_converges_with_order_4_and_the_midpoint_rule_with_order_2(found, name):
    assert found[name].simpson == pytest.approx(4.0, abs=0.1)
    assert found[name].control == pytest.approx(2.0, abs=0.1)


def test_it_keeps_the_momenta_and_a_classical_method_does_not(found):
    assert found["momenta"].simpson < 1e-12
    assert found["momenta"].control > 1e-9


def test_its_energy_error_does_not_grow_and_that_of_a_classical_method_does(found):
    assert found["energy grows by"].simpson < 1.1
    assert found["energy grows by"].control > 5.0


def test_its_difference_from_a_classical_method_on_the_reduced_top_has_order_4(found):
    point = found["order of the difference from rk4[angles]"]
    assert point.simpson == pytest.approx(4.0, abs=0.15)
    assert point.control == pytest.approx(2.0, abs=0.1)
