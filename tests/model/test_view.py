"""The reader of a chart's states: three charts of one motion show one thing."""

import numpy as np
import pytest

import symtop
from symtop.methods.framework.calling import solve
from symtop.methods.framework.plan import Plan
from symtop.model import charts
from symtop.model.charts import CHARTS, DIMENSIONS, View, axis_of, space_momenta
from symtop.model.scenes import closed_form, scene
from symtop.run.reference.truth import reference

TOP, START = symtop.scene("spheroid").top, symtop.scene("spheroid").start


def shown(chart, steps=800, h=0.005):
    method = symtop.integrator("stormer-verlet-blanes-moan-6" if chart == "angles" else "srkn-14-6")
    run = solve(method, chart, TOP, START, Plan.steps(h, np.arange(0, steps + 1, 40)))
    return View(chart, TOP, run.states, run.p_phi, run.p_psi)


@pytest.mark.parametrize("chart", CHARTS)
def test_every_quantity_is_that_of_the_true_motion(chart):
    view = shown(chart)
    truth = reference("spheroid", 0.2 * np.arange(21), "closed-form")
    assert view.states.shape == (21, DIMENSIONS[chart])
    assert view.axis == pytest.approx(truth["axis"].values, abs=1e-7)
    assert view.theta == pytest.approx(truth["theta"].values, abs=1e-7)
    assert view.energy == pytest.approx(truth["energy"].values, rel=1e-8)
    assert np.cos(view.phi - truth["phi"].values) == pytest.approx(1.0, abs=1e-12)
    if chart == "axis":
        assert view.psi is None
        assert view.quaternion is None
    else:
        assert np.cos(view.psi - truth["psi"].values) == pytest.approx(1.0, abs=1e-12)
        assert np.abs(np.sum(view.quaternion * truth["quaternion"].values, axis=1)) == pytest.approx(1.0, abs=1e-12)


def test_the_charts_agree_on_the_momentum_of_the_nutation_and_on_the_energy_without_constants():
    momenta = TOP.momenta(START)
    angles, *space = (shown(chart) for chart in CHARTS)
    for view in space:
        assert view.p_theta == pytest.approx(angles.p_theta, abs=1e-6)
        constant = view.nutation_energy(momenta) - angles.nutation_energy(momenta)  # p_psi^2/2 I1 is in one alone
        assert np.ptp(constant) < 1e-7


def test_momenta_are_read_in_the_precision_of_the_states():
    states = shown("attitude").states.astype(np.longdouble)
    p_phi, p_psi = space_momenta("attitude", states)
    assert p_phi.dtype == p_psi.dtype == axis_of("attitude", states).dtype == np.longdouble
    assert float(p_psi[0]) == pytest.approx(TOP.momenta(START).p_psi, rel=1e-15)


@pytest.mark.parametrize("chart", ["axis", "attitude"])
@pytest.mark.parametrize("known", [401, 250], ids=["whole", "broken off"])
def test_axis_energy_and_momentum_have_the_bits_of_a_view(chart, known):
    form = closed_form(scene("spheroid"))
    states = form.state(np.linspace(0.0, 40.0, 401))
    states[known:] = np.nan
    if chart == "axis":
        states = np.concatenate([charts.axis_from_quaternion(states[:, :4]), states[:, 4:]], axis=1)
    view = View(chart, scene("spheroid").top, states, np.full(401, form.p_phi), np.full(401, form.p_psi))
    charts._reader.compile()
    readings = [*charts.readings(view), charts.axes(chart, states)]
    for ours, theirs in zip(readings, (view.axis, view.energy, view.p_theta, view.axis), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    moved = View(chart, view.top, states * (1.0 + 2e-16), view.p_phi, view.p_psi)
    assert not np.array_equal(charts.readings(moved)[1], view.energy, equal_nan=True)
