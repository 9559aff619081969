"""plot() of the errors of a run, and of a trajectory that no integrator here has made."""

import numpy as np
import pytest

import symtop
from symtop.base.validate import SymtopError


@pytest.fixture(scope="module")
def run():
    return symtop.simulate("goldstein", "midpoint", step_size=0.02, horizon=10.0, samples=51, guard=False)


def test_errors_are_drawn_as_the_run_itself_is_with_what_can_be_seen(run):
    wrong = symtop.errors(run)
    ax = symtop.plot(wrong)
    line, bound = ax.get_lines()
    assert np.array_equal(line.get_ydata(), wrong["axis"].values[1:])
    assert np.array_equal(line.get_ydata(), symtop.plot(run).get_lines()[0].get_ydata())
    assert line.get_color() == symtop.plot(run).get_lines()[0].get_color()
    assert bound.get_ydata().max() < 1e-9 < line.get_ydata().max()
    assert symtop.plot(wrong, quantity="energy").get_ylabel() == "energy error / (E0 - min V)"


def test_a_trajectory_of_no_integrator_is_drawn_too(run):
    theirs = {"time": run["time"].values, "axis": run["axis"].values}
    wrong = symtop.errors(theirs, "goldstein")
    assert np.array_equal(symtop.plot(wrong).get_lines()[0].get_ydata(), wrong["axis"].values[1:])
    with pytest.raises(SymtopError, match="does not show the attitude; it shows axis"):
        symtop.plot(wrong, quantity="attitude")


def test_what_has_no_time_is_refused():
    with pytest.raises(SymtopError, match="must have the dimension time"):
        symtop.plot(symtop.reference("goldstein", [1.0]).isel(time=0, drop=True))
