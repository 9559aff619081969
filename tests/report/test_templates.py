"""All templates together: figures with titles and captions, links that lead somewhere, what is not measured."""

import json
import math
import re
from xml.etree import ElementTree as ET

import pytest
from latex2mathml.converter import convert

import symtop
from symtop.report import page, template
from symtop.report.page import TEMPLATES, gather, prepared
from symtop.runner import run as runner
from tests.commands import call

OTHERS = {name: TEMPLATES / f"{name}.md" for name in ("front", "measured", "equations")}
PAGES = {name: path for name in runner.names() if (path := runner.file_beside(name, "page.md")) is not None}
TEXTS = {name: path.read_text(encoding="utf-8") for name, path in {**OTHERS, **PAGES}.items()}
CALL = re.compile(r"{% call figure\((.*?)\) %}(.*?){% endcall %}", re.DOTALL)


@pytest.mark.parametrize("name", ["front", *PAGES])
def test_a_page_asks_its_question_and_its_figures_have_titles_captions_and_words_for_the_blind(name):
    text = TEXTS[name]
    assert text.startswith("# " if name == "front" else "# {{ question }}\n\n")
    figures = CALL.findall(text)
    assert len(re.findall(r"figure\(", text)) == len(figures)
    for arguments, caption in figures:
        assert re.search(r'title="[^"]{8,}"', arguments), arguments
        assert re.search(r'alt="[^"]{20,}"', arguments), arguments
        assert len(caption.split()) > 8, caption


@pytest.mark.parametrize("name", TEXTS)
def test_links_to_pages_name_studies_or_benchmarks(name):
    assert set(re.findall(r"\bpages\.(\w+)", TEXTS[name])) <= {*runner.names(), "peers", "bench", "measured"}


def test_the_front_page_renders_without_any_study_and_with_what_there_is(tmp_path):
    text = template.front(TEXTS["front"], [], tmp_path, {})
    assert not re.search("None|not measured|!\\[", text)
    assert template.GAP not in text
    facts = {"bounds": 4, "bounds_held": 3, "closed_form": 1e-16, "digits": 45}
    study = {"study": "truth", "title": "Truth", "facts": facts, "pictures": [], "tables": []}
    page = template.front(TEXTS["front"], [study], tmp_path, {"truth": "[How?](#how)"})
    assert "3 of 4 error bounds hold" in page
    assert "[Truth](#how)" in page
    (tmp_path / "tables").mkdir()
    header = 'you can supply,1e-3 rad,1e-6 rad,1e-9 rad,"keeps, at 1e-6 rad"'
    (tmp_path / "tables" / "u.csv").write_text(f"{header}\na,b,c,d,e\n")
    cost = study | {"study": "cost", "facts": {}, "tables": [{"name": "use", "file": "u.csv", "rows": 1}]}
    parts = [cost, study | {"study": "machines", "facts": {"cells": 1}}]
    page = template.front(TEXTS["front"], parts, tmp_path, {})
    assert "Use this" in page
    assert not re.search("Epsilon|How far", page)  # a legend without its table, a heading above nothing


PAGE = """# {{ question }}

It is {{ f.a }}. It is not {{ f.b }}. So it ends.

**Head.** Only {{ f.b }}.

{% raw %}Raw.{% endraw %}

- one {{ f.a }}
- two {{ f.b }}
  and more

{% call figure("drawn", title="A title", alt="For the blind") %}Found {{ f.b }}.{% endcall %}
"""


def test_a_page_without_what_was_not_measured_says_so_once_and_points_without_a_number_are_null(tmp_path):
    findings = {"study": "mine", "question": "Q?", "page": PAGE, "facts": {"a": 1, "b": None}, "tables": [],
                "pictures": [{"name": "drawn", "file": "a.png"}], "failures": [], "cases": 1}  # fmt: skip
    text = template.filled(findings, tmp_path)
    assert text.split("\n\n") == ["# Q?", template.PARTIAL, "It is 1. So it ends.", "Raw.", "- one 1", "**A title**",
                                  "![For the blind](figures/a.png)", "A title.\n"]  # fmt: skip
    assert template.answer(findings, tmp_path) == "It is 1. So it ends."
    text = template.filled(findings | {"facts": {"a": 1, "b": 2}}, tmp_path)
    assert template.PARTIAL not in text
    assert "**Head.** Only 2." in text
    assert "- two 2 and more" in text
    with pytest.raises(symtop.SymtopError, match="page of mine"):
        template.filled(findings | {"facts": {"a": 1}}, tmp_path)
    chart = {"title": "c", "panels": {"one": [("rk4", [(1.0, math.nan, 1e-3, "w"), (2.0, math.inf, 1e-4, "v")])]}}
    assert json.loads(prepared(chart))["panels"]["one"][0]["points"] == [[1.0, None, 1e-3, "w"], [2.0, None, 1e-4, "v"]]
    for content, words in (("[]", "no study has left findings"), ("{}", "the findings of drift in .* are incomplete")):
        (tmp_path / "drift.json").write_text(content, encoding="utf-8")
        with pytest.raises(symtop.SymtopError, match=words):
            gather(tmp_path)


@pytest.mark.parametrize(("name", "remedy"), [("drift", "run it again: symtop study drift, or "), ("peers", "")])
def test_a_damaged_file_is_named_and_one_of_another_kind_is_left_out(name, remedy, tmp_path):
    findings = {"study": "mine", "question": "Q?", "page": PAGE, "facts": {}, "tables": [], "pictures": []}
    (tmp_path / "mine.json").write_text(json.dumps(findings), encoding="utf-8")
    for content in ("null", "[]"):
        (tmp_path / f"{name}.json").write_text(content, encoding="utf-8")
        assert [finding["study"] for finding in gather(tmp_path)] == ["mine"]
    (tmp_path / f"{name}.json").write_text("{", encoding="utf-8")
    with pytest.raises(symtop.SymtopError, match=rf"{name}\.json is damaged \(.*\); {remedy}remove the file"):
        gather(tmp_path)
    (tmp_path / "quick").mkdir()
    (tmp_path / "mine.json").rename(tmp_path / "quick" / "mine.json")
    extra = {"measured": "Then.", "command": "python -m benchmarks.guard", "pictures": [{"file": "none.png"}]}
    (tmp_path / f"{name}.json").write_text(json.dumps(findings | extra), encoding="utf-8")
    with pytest.raises(symtop.SymtopError, match=r"run it again: python -m benchmarks\.guard$"):
        gather(tmp_path)
    assert "the report is made of those in" in call("report", "--results", tmp_path, code=None).output


def lines(table):
    """Cells of a table in Markdown, line by line, below its header."""
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]


def test_the_tables_of_scenes_give_every_scene_back_to_the_last_bit():
    tables = page.scene_tables()
    uses, starts = lines(tables["uses"]), lines(tables["starts"])
    assert [row[0] for row in uses] == [row[0] for row in starts] == list(symtop.scenes())
    for row, numbers in zip(uses, starts, strict=True):
        scene, values = symtop.scene(row[0]), [float(cell) for cell in numbers[1:]]
        assert (symtop.SymmetricTop(*values[:3]), symtop.Angles(*values[3:])) == (scene.top, scene.start)
        assert float(row[2].replace("infinite", "inf")) == pytest.approx(scene.nutation_period, rel=1e-8)
        bound = float(symtop.reference(scene, [scene.horizon])["axis_error_bound"].max())
        assert float(row[4]) == pytest.approx(bound, rel=0.05)


def test_every_formula_is_shown_in_full():
    text = (TEMPLATES / "equations.md").read_text(encoding="utf-8")
    assert text.startswith(f"## {page.EQUATIONS}\n")
    formulas = re.findall(r"^\$\$(.+)\$\$$", text, re.MULTILINE)
    assert len(formulas) == 12
    for formula in formulas:
        tree = ET.fromstring(convert(formula))
        letters = "".join(tree.itertext())
        assert "=" in letters
        assert "\\" not in letters  # of a command that is not known
        assert len(tree.findall(".//{*}mfrac")) == formula.count("\\frac")
