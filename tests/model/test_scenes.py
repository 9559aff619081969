"""The scenes: families whose failure is built in, and the table that notebooks show."""

import math

import numpy as np
import pytest

import symtop
from symtop.model.scenes import _Scenes, closed_form, grazing, sleeping, spinning, steady


def test_the_scenes_are_a_dict_that_a_notebook_shows_as_a_table():
    scenes = symtop.scenes()
    html = scenes._repr_html_()
    assert isinstance(scenes, dict)
    assert all(f"<td>{name}</td>" in html for name in scenes)
    assert html.count("<tr") == len(scenes) + 1


def test_what_users_write_is_escaped_and_whole():
    purpose = "a < b & <script>, and a sentence that is longer than the fifty characters a table has by default"
    scene = symtop.Scene("mine", symtop.SymmetricTop(1.0, 1.0, 1.0), symtop.Angles(1.0), 1.0, purpose)
    html = _Scenes({"mine": scene})._repr_html_()
    assert "a &lt; b &amp; &lt;script&gt;, and a sentence that is longer than the fifty characters" in html
    assert "<script>" not in html


@pytest.mark.parametrize("delta", [1e-1, 1e-3, -1e-3, 1e-6])
def test_grazing_misses_the_pole_by_eleven_tenths_of_its_gap(delta):
    where = grazing(delta)
    momenta = where.top.momenta(where.start)
    assert momenta.north == pytest.approx(delta, rel=1e-9)
    assert momenta.p_psi == pytest.approx(1.0, rel=1e-15)
    assert closed_form(where).theta_range[0] == pytest.approx(1.105 * abs(delta), rel=0.05)
    assert where.nutation_period == pytest.approx(where.horizon, rel=0.03)


def test_a_top_sleeps_above_the_threshold_and_falls_below_it():
    assert closed_form(sleeping(2.05)).theta_range[1] < 0.01
    slow = sleeping(1.9, 1e-5)
    assert closed_form(slow).theta_range[1] == pytest.approx(math.acos(0.5 * 1.9**2 - 1.0), rel=1e-6)
    theta = closed_form(slow)(np.array([20.0, 22.0])).theta
    assert math.log(theta[1] / theta[0]) / 2.0 == pytest.approx(0.5 * math.sqrt(4.0 - 1.9**2), rel=1e-3)


def test_steady_precession_is_steady_and_impossible_below_its_spin():
    for spin in (3.0, 20.0, 100.0):
        low, high = closed_form(steady(spin)).theta_range
        assert high - low < 1e-7
    with pytest.raises(symtop.SymtopError, match="spin must be at least"):
        steady(2.5)


def test_the_separatrix_never_comes_back():
    where = symtop.scene("separatrix")
    times = np.array([1.0, 5.0, 15.0])
    cosine = np.cos(closed_form(where)(times).theta)
    assert cosine == pytest.approx(1.0 / (1.0 + 1.0 / np.cosh(times)), abs=1e-12)  # g = 1


def test_families_carry_their_parameter_in_their_name():
    names = [make(value).name for make in (spinning, grazing, sleeping, steady) for value in (3.0, 4.5)]
    assert len(set(names)) == len(names)
    assert spinning(10.0, name="cusp").start == symtop.scene("cusp").start
    assert {"grazing", "sleeping", "sleeping-unstable", "separatrix", "steady-fast"} <= set(symtop.scenes())
