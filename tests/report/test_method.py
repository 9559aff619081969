"""The section on how it was measured says what the package does: scenes, bounds, equations, glosses."""

import math
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from latex2mathml.converter import convert

import symtop
from symtop.model.charts import space_state
from symtop.model.scenes import closed_form
from symtop.report import markdown, method
from symtop.report.method import glossary

STEP = 1e-5  # of differences, s


def blocks(name):
    """The blocks of a part."""
    (part,) = (part for part in method.parts() if part.name == name)
    return part.blocks


def test_the_tables_of_scenes_give_every_scene_back_to_the_last_bit():
    uses, starts = (block.rows for block in blocks("scenes") if block.rows)
    assert [row[0] for row in uses] == [row[0] for row in starts] == list(symtop.scenes())
    for row, numbers in zip(uses, starts, strict=True):
        scene, values = symtop.scene(row[0]), [float(cell) for cell in numbers[1:]]
        assert symtop.SymmetricTop(*values[:3]) == scene.top
        assert symtop.Angles(*values[3:]) == scene.start
        assert float(row[2].replace("infinite", "inf")) == pytest.approx(scene.nutation_period, rel=1e-8)
        bound = float(symtop.reference(scene, [scene.horizon])["axis_error_bound"].max())
        assert float(row[4]) == pytest.approx(bound, rel=0.05)


def test_the_errors_are_those_of_the_package():
    assert {name for names in method.ERRORS for name in names.split(", ")} == {
        "axis", "attitude", "theta", "energy", "p_phi", "p_psi"
    }  # fmt: skip


@pytest.fixture(scope="module")
def moving():
    """A top, and three of its true states as Euler angles and rates, a short time apart."""
    scene = symtop.scene("spheroid")
    motion = closed_form(scene)(1.0 + STEP * np.array([-1.0, 0.0, 1.0]))
    return scene.top, [symtop.Angles(*map(float, state)) for state in zip(*motion, strict=True)]


def slope(values):
    """The derivative at the middle of three values, by their difference."""
    return (np.asarray(values[2]) - np.asarray(values[0])) / (2.0 * STEP)


def test_the_equations_in_angles_hold_along_the_true_motion(moving):
    top, states = moving
    at = states[1]
    p_psi = top.I3 * (at.psi_dot + at.phi_dot * math.cos(at.theta))
    p_phi = top.I1 * at.phi_dot * math.sin(at.theta) ** 2 + p_psi * math.cos(at.theta)
    assert (p_phi, p_psi) == pytest.approx(top.momenta(at)[:2], rel=1e-12)

    def potential(theta):
        return (p_phi - p_psi * math.cos(theta)) ** 2 / (2.0 * top.I1 * math.sin(theta) ** 2) + top.mgl * math.cos(
            theta
        )

    force = -slope([potential(at.theta + k * STEP) for k in (-1, 0, 1)])
    assert top.I1 * slope([state.theta_dot for state in states]) == pytest.approx(force, rel=1e-5)


def test_the_equations_in_space_hold_along_the_true_motion(moving):
    top, states = moving
    axes, momenta = zip(*(np.split(space_state("axis", top, state), [3]) for state in states), strict=True)
    e, J, p_psi = axes[1], momenta[1], top.momenta(states[1]).p_psi
    assert slope(axes) == pytest.approx(np.cross(J, e) / top.I1, abs=1e-5)
    assert slope(momenta) == pytest.approx(top.mgl * np.cross([0.0, 0.0, 1.0], e), abs=1e-5)
    assert np.abs(slope(momenta) - top.mgl * np.cross(e, [0.0, 0.0, 1.0])).max() > 1.0  # the other sign
    quaternions = [space_state("attitude", top, state)[:4] for state in states]
    omega = J / top.I1 + (1.0 / top.I3 - 1.0 / top.I1) * p_psi * e
    w, v = quaternions[1][0], quaternions[1][1:]
    turned = 0.5 * np.array([-omega @ v, *(w * omega + np.cross(omega, v))])
    assert slope(quaternions) == pytest.approx(turned, abs=1e-5)


def test_every_formula_is_shown_in_full():
    formulas = [one for part in method.parts() for block in part.blocks for one in block.formulas]
    assert len(formulas) == 12
    for formula in formulas:
        tree = ET.fromstring(convert(formula))
        letters = "".join(tree.itertext())
        assert "=" in letters
        assert "\\" not in letters  # of a command that is not known
        assert len(tree.findall(".//{*}mfrac")) == formula.count("\\frac")


def test_a_gloss_is_given_to_every_name_in_a_text_and_to_no_part_of_one():
    named = dict(glossary("Begin with rk45-compiled[axis], then gauss-12[axis]."))
    assert named.keys() == {"rk45-compiled", "gauss-12", "[axis]"}
    assert glossary("the axis")[0][0] == "axis"
    assert named["gauss-12"] == symtop.integrator("gauss-12").summary
    assert glossary("Nothing is named here.") == []


def test_an_answer_is_given_with_its_glosses():
    first = {
        "question": "Which?",
        "sentences": ["Take strang[axis]."],
        "table": {"header": ["a"], "rows": [["rk4[axis]"]]},
    }
    said = markdown.opening({"opening": first}, {})
    assert f"- strang: {symtop.integrator('strang').summary}" in said
    assert f"- rk4: {symtop.integrator('rk4').summary}" in said
