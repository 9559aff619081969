"""The scenes: families whose failure is built in, and the table that notebooks show."""

import math

import numpy as np
import pytest

import symtop
from symtop.model.scenes import Catalogue, closed_form, grazing, sleeping, steady


def test_what_users_write_is_escaped_and_whole():
    purpose = "a < b & <script>, and a sentence that is longer than the fifty characters a table has by default"
    scene = symtop.Scene("mine", symtop.SymmetricTop(1.0, 1.0, 1.0), symtop.Angles(1.0), 1.0, purpose)
    html = Catalogue({"mine": scene})._repr_html_()
    assert "a &lt; b &amp; &lt;script&gt;, and a sentence that is longer than the fifty characters" in html
    assert "<script>" not in html


@pytest.mark.parametrize("scene", symtop.scenes().values(), ids=symtop.scenes())
def test_tags_say_what_the_motion_does(scene):
    low, high = closed_form(scene).theta_range
    assert ("steady" in scene.tags) == (high - low < 1e-6)
    assert ("near_pole" in scene.tags) == (low < 2e-3 or high > math.pi - 2e-3)


@pytest.mark.parametrize("tags", ["steady", ["staedy"], 5, [["steady"]]])
def test_a_tag_that_no_study_knows_is_refused(tags):
    with pytest.raises(symtop.SymtopError, match="tags"):
        symtop.Scene("mine", symtop.SymmetricTop(1.0, 1.0, 1.0), symtop.Angles(1.0), 1.0, tags=tags)


@pytest.mark.parametrize("delta", [1e-1, 1e-3, -1e-3, 1e-6])
def test_grazing_misses_the_pole_by_eleven_tenths_of_its_gap(delta):
    scene = grazing(delta)
    momenta = scene.top.momenta(scene.start)
    assert momenta.north == pytest.approx(delta, rel=1e-9)
    assert momenta.p_psi == pytest.approx(1.0, rel=1e-15)
    assert closed_form(scene).theta_range[0] == pytest.approx(1.105 * abs(delta), rel=0.05)
    assert scene.nutation_period == pytest.approx(scene.horizon, rel=0.03)


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
    scene = symtop.scene("separatrix")
    times = np.array([1.0, 5.0, 15.0])
    cosine = np.cos(closed_form(scene)(times).theta)
    assert cosine == pytest.approx(1.0 / (1.0 + 1.0 / np.cosh(times)), abs=1e-12)  # g = 1


@pytest.mark.parametrize("name", ["spheroid", "goldstein", "fast", "simo-wong", "bruls-cardona-arnold", "separatrix"])
def test_energies_are_measured_by_the_nutation_and_not_by_the_spin(name):
    """Over the true motion the kinetic energy of theta goes from 0 to E0 - min V, where V is least."""
    scene = symtop.scene(name)
    end = min(scene.nutation_period, scene.horizon)
    motion = closed_form(scene)(np.linspace(0.0, end, 20_001))
    assert np.max(0.5 * scene.top.I1 * motion.theta_dot**2) == pytest.approx(scene.energy_scale, rel=1e-5)


def test_on_a_fast_top_the_energy_of_the_spin_hides_the_nutation():
    scene = symtop.scene("fast")
    kinetic = scene.top.energy(scene.start) + scene.top.mgl
    assert scene.energy_scale == pytest.approx(9.2e-5, rel=0.01)
    assert kinetic / scene.energy_scale > 5e7
    assert scene.energy_grain == pytest.approx(kinetic / scene.energy_scale, rel=1e-3)


@pytest.mark.parametrize("spin", [4.0, 20.0])
def test_a_steady_precession_measures_energies_by_a_nutation_of_one_radian(spin):
    scene = steady(spin)
    top, amplitude = scene.top, 1e-3
    momenta = top.momenta(scene.start)
    raised = top.potential(scene.start.theta + amplitude, momenta) - top.potential(scene.start.theta, momenta)
    assert raised / scene.energy_scale == pytest.approx(amplitude**2, rel=0.01)


@pytest.mark.parametrize("start", [{"theta": 0.0, "psi_dot": 3.0}, {"theta": 0.0, "psi_dot": 1.0}, {"theta": 1.0},
                                   {"theta": math.pi, "psi_dot": 1.0}])  # fmt: skip
@pytest.mark.parametrize("mgl", [1.0, 0.0, -1.0])
def test_every_start_has_an_energy_scale(start, mgl):
    scene = symtop.Scene("any", symtop.SymmetricTop(1.0, 1.0, mgl), symtop.Angles(**start), 1.0)
    assert 0.0 < scene.energy_scale < math.inf
    assert scene.energy_grain >= 1.0
