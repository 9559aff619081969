"""One step of every integrator: of the order that it claims, symplectic and symmetric if it says so and only then."""

from dataclasses import replace

import numpy as np
import pytest

import symtop
from symtop.measure.step_map import generic_start, one_step, restart_gap, return_miss, step_map, symplectic_defect
from symtop.methods.lie_group.runge_kutta import lie_runge_kutta
from tests.conftest import random_scenes
from tests.measure.test_order import series
from tests.slopes import assert_order

SPHEROID = symtop.scene("spheroid")
SHARED = (  # tables that share the kernel of one below; orders of all: `test_claims`, their symmetry: `test_splitting`
    "stormer-verlet-suzuki-4", "stormer-verlet-blanes-moan-6", "suzuki-4", "srkn-6-4", "srkn-11-6", "srkn-14-6",
    "kahan-li-6", "kahan-li-8", "suzuki-umeno-8", "aba-10-6-4", "aba-10-4",
)  # fmt: skip
METHODS = {name: method for name, method in symtop.integrators().items() if method.fixed_step and name not in SHARED}
# a run goes on from what its last step left, or is tuned by its start: its order shows at so many steps a nutation
RUNS = {"generalised-alpha": (1000, 8000), "jsbsim-buss2": (500, 4000), "cayley-tuned": (8000, 40000)}


@pytest.mark.parametrize("name", METHODS)
def test_the_terms_of_a_step_are_those_of_the_motion_up_to_its_order(name):
    """And of one that is exact up to all that are resolved; of engines that leave out a term, no further than to h."""
    method = METHODS[name]
    for chart in method.charts():
        terms, step = series(method, chart), one_step(method, chart, SPHEROID, 0.01)
        assert restart_gap(step, generic_start(SPHEROID)) < 1e-6 or name in RUNS
        if method.exact_steps:
            assert not terms.is_exact
        elif method.order is None:
            assert terms.is_exact
            assert terms.order <= 1
        elif name in RUNS:
            assert_order("spheroid", method.variant(chart), method.order, 0.08, RUNS[name], chart)
        elif method.order > 8 and not terms.is_exact:
            assert terms.order > 8
        else:
            assert terms.order == method.order
            assert terms.backward
            assert terms.defect[method.order + 1] > 3.0 * terms.worst(method.order)


@pytest.mark.parametrize("name", [*METHODS, "rk45-compiled"])
def test_units_that_are_powers_of_two_change_no_bit(name):
    """Of a run with a given step, which looks at no size; one that is chosen does, by an error over 1 + |y|."""
    method, top, start, fast = symtop.integrator(name), SPHEROID.top, SPHEROID.start, 2.0**17
    rates = {rate: fast * getattr(start, rate) for rate in ("theta_dot", "phi_dot", "psi_dot")}
    light = symtop.SymmetricTop(2.0**-30 * top.I1, 2.0**-30 * top.I3, 2.0**4 * top.mgl)
    scenes = {1.0: SPHEROID, fast: symtop.Scene("light", light, replace(start, **rates), 1.0)}
    for chart in method.charts():
        settings = {unit: {"step_size": 0.02 / unit} if method.fixed_step else {"tolerance": 1e-6} for unit in scenes}
        plain, other = (symtop.simulate(scene, method.variant(chart), horizon=1.0 / unit, guard=False, **settings[unit])
                        for unit, scene in scenes.items())  # fmt: skip
        units = {"axis": 1.0, "energy": 2.0**4, "p_phi": 2.0**-13}
        same = [np.array_equal(units[quantity] * plain[quantity], other[quantity]) for quantity in units]
        assert all(same) == method.fixed_step


def test_without_the_bracket_munthe_kaas_loses_two_orders():
    rows = (((0.5,),), ((0.0, 0.5),), ((0.0, 0.0, 1.0),), ((1 / 6, 1 / 3, 1 / 3, 1 / 6),))
    assert series(lie_runge_kutta("flat", rows, 4, "", ""), "axis").order == 2


@pytest.mark.parametrize("name", [name for name in METHODS if name != "cayley-tuned"])  # see `test_splitting`
def test_a_step_keeps_the_bracket_and_comes_back_if_its_method_says_so_and_only_then(name):
    """A step as long as it may be, which shows a lack of either, and short ones of two other tops."""
    method = METHODS[name]
    for chart in method.charts():
        long, *short = step_map(method, chart, SPHEROID), *(
            (one_step(method, chart, scene, 0.02), scene.start) for scene in random_scenes(2, seed=7))  # fmt: skip
        for step, start in (long, *short):
            assert symplectic_defect(step, start).size < 1e-11 or not method.symplectic
            assert return_miss(step, start) < 1e-14 or not method.symmetric
        assert symplectic_defect(*long).size > 1e-5 or method.symplectic
        assert return_miss(*long) > 1e-6 or method.symmetric
