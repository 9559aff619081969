"""Taylor series by recurrence: coefficients against finite sums, heyoka's steps, and the order of fixed steps."""

import math

import numpy as np
import pytest

import symtop
from symtop.core.jit import compile_kernel
from symtop.methods.framework.equations import FORMS
from symtop.methods.framework.registry import integrator
from symtop.methods.taylor import series_general
from tests.slopes import assert_order

SERIES = series_general.CHARTS
CHARTS = [chart for chart in SERIES if chart != "body"]  # of the top


def coefficients(chart, order, shift=0.0):
    """c_0 .. c_order of a start, with the number of the top that the chart needs changed: p_psi, or one over I1."""
    chosen = symtop.scene("heavy-brick" if chart == "body" else "goldstein", bodies=True)
    par, state = FORMS[chart].prepare(chosen.top, chosen.start)
    name = "a1" if chart == "body" else "twist"
    par = par._replace(**{name: getattr(par, name) + shift})
    fill = SERIES[chart].series()

    def kernel(par, state, c):
        fill(par, state, c, order)

    c = np.zeros((order + 2, len(state)))
    compile_kernel(kernel)(par, state, c)
    return par, state, c[1:]


@pytest.mark.parametrize("chart", SERIES)
def test_coefficients_solve_the_equations_that_every_other_method_takes(chart):
    """y'(t) of the polynomial is f(y(t)) to the order of the first neglected term, and not with another twist."""
    field = FORMS[chart].field
    par, _, c = coefficients(chart, 12)
    residuals = []
    for t in (0.2, 0.1):
        state = tuple(np.polyval(c[::-1, m], t) for m in range(c.shape[1]))
        slope = [np.polyval(np.polyder(c[::-1, m]), t) for m in range(c.shape[1])]
        residuals.append(np.abs(np.subtract(slope, field(par, state))).max())
    assert math.log2(residuals[0] / residuals[1]) == pytest.approx(12.0, abs=1.0)
    if chart != "axis":
        _, _, other = coefficients(chart, 12, shift=0.01)
        assert np.abs(other[1] - c[1]).max() > 1e-3


@pytest.mark.parametrize("chart", CHARTS)
@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-12, 1e-17])
@pytest.mark.parametrize("scene", ["spheroid", "goldstein"])
def test_it_takes_the_steps_of_heyoka(scene, tolerance, chart):
    pytest.importorskip("heyoka")
    mine, theirs = (
        symtop.simulate(scene, f"{name}[{chart}]", tolerance=tolerance, samples=33, guard=False)
        for name in ("series-general-adaptive", "taylor")
    )
    assert mine.attrs["steps"] == theirs.attrs["steps"]
    assert mine.attrs["force_evaluations"] == theirs.attrs["force_evaluations"] + 2  # f of the start, twice
    np.testing.assert_allclose(mine["axis"], theirs["axis"], rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("chart", CHARTS)
def test_fixed_steps_have_order_sixteen(chart):
    """With more than 18 steps a nutation errors are rounding, with fewer than 12 higher terms count."""
    quantity = "axis" if chart == "axis" else "attitude"
    assert_order("spheroid", integrator(f"series-general[{chart}]"), 16, 1.0, (12, 18), quantity)


def test_a_motion_without_end_of_steps_is_one_step():
    """At rest on its axis every coefficient but the first is zero."""
    rest = symtop.Scene("rest", symtop.SymmetricTop(1.0, 1.0, 0.0), symtop.Angles(1.0), 5.0, observes="axis")
    run = symtop.simulate(rest, "series-general-adaptive[axis]", tolerance=1e-9, guard=False)
    assert (run.attrs["outcome"], run.attrs["steps"]) == ("ok", 1)
