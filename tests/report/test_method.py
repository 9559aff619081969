"""The pages on how it was measured say what the package does: scenes, bounds, equations."""

import re
from xml.etree import ElementTree as ET

import pytest
from latex2mathml.converter import convert

import symtop
from symtop.report import page
from symtop.report.html import slug


def lines(table):
    """Cells of a table in Markdown, line by line, below its header."""
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]


def test_the_tables_of_scenes_give_every_scene_back_to_the_last_bit():
    known = page.scene_tables()
    uses, starts = lines(known["uses"]), lines(known["starts"])
    assert [row[0] for row in uses] == [row[0] for row in starts] == list(symtop.scenes())
    for row, numbers in zip(uses, starts, strict=True):
        scene, values = symtop.scene(row[0]), [float(cell) for cell in numbers[1:]]
        assert symtop.SymmetricTop(*values[:3]) == scene.top
        assert symtop.Angles(*values[3:]) == scene.start
        assert float(row[2].replace("infinite", "inf")) == pytest.approx(scene.nutation_period, rel=1e-8)
        bound = float(symtop.reference(scene, [scene.horizon])["axis_error_bound"].max())
        assert float(row[4]) == pytest.approx(bound, rel=0.05)


def test_every_formula_is_shown_in_full_and_links_lead_to_the_page():
    text = (page.TEMPLATES / "equations.md").read_text(encoding="utf-8")
    assert text.startswith(f"## {page.EQUATIONS}\n")
    assert slug(page.EQUATIONS) == "the-equations-the-scenes-and-the-exact-motion"
    formulas = re.findall(r"^\$\$(.+)\$\$$", text, re.MULTILINE)
    assert len(formulas) == 12
    for formula in formulas:
        tree = ET.fromstring(convert(formula))
        letters = "".join(tree.itertext())
        assert "=" in letters
        assert "\\" not in letters  # of a command that is not known
        assert len(tree.findall(".//{*}mfrac")) == formula.count("\\frac")
