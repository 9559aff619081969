"""The section on how it was measured says what the package does: scenes, bounds, equations."""

from xml.etree import ElementTree as ET

import pytest
from latex2mathml.converter import convert

import symtop
from symtop.report import method


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


def test_every_formula_is_shown_in_full():
    formulas = [one for part in method.parts() for block in part.blocks for one in block.formulas]
    assert len(formulas) == 12
    for formula in formulas:
        tree = ET.fromstring(convert(formula))
        letters = "".join(tree.itertext())
        assert "=" in letters
        assert "\\" not in letters  # of a command that is not known
        assert len(tree.findall(".//{*}mfrac")) == formula.count("\\frac")


def test_the_section_in_markdown_has_every_block():
    text = method.text()
    for part in method.parts():
        assert f"### {part.title}\n" in text
        for block in part.blocks:
            assert not block.words or block.words in text
            assert all(f"$${formula}$$" in text for formula in block.formulas)
            assert all(
                "| " + " | ".join(row).replace("<", "\\<") + " |" in text.replace("\\|", "|") for row in block.rows
            )
