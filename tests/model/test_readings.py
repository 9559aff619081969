"""The compiled readers of states have the bits of NumPy's, which answer until they are loaded."""

import numpy as np
import pytest

from symtop.model import charts
from symtop.model.charts import View
from symtop.model.scenes import closed_form, scene

TIMES = np.linspace(0.0, 40.0, 401)


@pytest.fixture(params=[False, True])
def failed(request):
    """States of a run, whole or broken off."""
    form = closed_form(scene("spheroid"))
    states = form.state(TIMES)
    if request.param:
        states[250:] = np.nan
    return form, states


@pytest.mark.parametrize("chart", ["axis", "attitude"])
def test_axis_energy_and_momentum_have_the_bits_of_a_view(failed, chart, monkeypatch):
    form, states = failed
    if chart == "axis":
        states = np.concatenate([charts.axis_from_quaternion(states[:, :4]), states[:, 4:]], axis=1)
    view = View(chart, scene("spheroid").top, states, np.full(401, form.p_phi), np.full(401, form.p_psi))
    charts._reader.compile()
    readings = [*charts.readings(view), charts.axes(chart, states)]
    for ours, theirs in zip(readings, (view.axis, view.energy, view.p_theta, view.axis), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    moved = View(chart, view.top, states * (1.0 + 2e-16), view.p_phi, view.p_psi)
    assert not np.array_equal(charts.readings(moved)[1], view.energy, equal_nan=True)


def test_continuous_angles_have_the_bits_of_numpy(failed):
    form, states = failed
    _, phi, psi = charts.angles_from_quaternion(states[:, :4])
    charts._unwrapper.compile()
    angles, guides = np.array([phi, psi]), form.turns(TIMES)
    angles_out = charts.continuous(angles, guides)
    np.testing.assert_array_equal(angles_out, charts.unwrapped(angles, guides))
    assert not np.array_equal(angles_out, angles, equal_nan=True)  # there is something to undo


@pytest.mark.parametrize("turn", [np.pi, -np.pi, np.nextafter(np.pi, 4.0), 7.0 * np.pi, 1e6])
def test_half_turns_go_where_numpy_sends_them(turn):
    angles = np.cumsum(np.tile([[0.0, turn, 0.1, -turn]], 20), axis=1)
    charts._unwrapper.compile()
    guides = np.zeros_like(angles)
    np.testing.assert_array_equal(charts.continuous(angles, guides), charts.unwrapped(angles, guides))
