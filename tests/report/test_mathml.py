"""Formulas in plain text become MathML that means the same, and what cannot be read is refused."""

from xml.etree import ElementTree as ET

import pytest

from symtop.core.errors import SymtopError
from symtop.report import method
from symtop.report.mathml import mathml


def shown(formula):
    """The tree of a formula, and its characters one after the other."""
    tree = ET.fromstring(mathml(formula).replace("&#x2061;", ""))
    return tree, "".join(tree.itertext())


def test_a_fraction_takes_the_atoms_beside_it_and_no_more():
    tree, _ = shown("L = I1/2 (x1 + y) - b")
    (fraction,) = tree.iter("mfrac")
    assert ["".join(part.itertext()) for part in fraction] == ["I1", "2"]
    tree, text = shown("V = (p - q)^2/(2 I1)")
    (fraction,) = tree.iter("mfrac")
    assert ["".join(part.itertext()) for part in fraction] == ["(p−q)2", "2I1"]  # brackets of a power stay
    assert text == "V=(p−q)22I1"
    assert not list(shown("a / b")[0].iter("mfrac"))


def test_names_have_letters_dots_and_indices():
    tree, text = shown("theta'' = p_psi mgl sin^2 theta")
    assert text == "θ¨=pψmglsin2θ"
    assert [one.text for one in tree.iter("mi")] == ["θ", "p", "ψ", "m", "g", "l", "sin", "θ"]
    assert len(list(tree.iter("msub"))) == len(list(tree.iter("msup"))) == len(list(tree.iter("mover"))) == 1
    assert shown("e x k")[1] == "e×k"


@pytest.mark.parametrize("formula", ["a = (b + c", "a = ", "a = b ; c", "a^"])
def test_what_is_no_formula_is_refused(formula):
    if formula == "a = ":
        assert shown(formula)[1] == "a="  # an empty side is still a row
        return
    with pytest.raises(SymtopError, match="formula"):
        mathml(formula)


def test_every_formula_of_the_report_can_be_read():
    formulas = [one for part in method.parts() for block in part.blocks for one in block.formula.split(",   ") if one]
    assert len(formulas) >= 10
    assert all("=" in shown(one)[1] for one in formulas)
