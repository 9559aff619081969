"""All templates together: short, few figures, no sentence twice, links that lead somewhere, titles of figures."""

import re
from collections import Counter

import pytest

from symtop.report import template
from symtop.report.page import TEMPLATES
from symtop.runner import run as runner

FRONT = TEMPLATES / "front.md"
PAGES = {name: page for name in runner.names() if (page := runner.file_beside(name, "page.md")) is not None}
TEXTS = {name: page.read_text(encoding="utf-8") for name, page in {"front": FRONT, **PAGES}.items()}
CALL = re.compile(r"{% call figure\((.*?)\) %}(.*?){% endcall %}", re.DOTALL)
MOST_LINES, MOST_FIGURES, MOST_WORDS = 120, 3, 1400  # of a template


def sentences(text: str) -> list[str]:
    """The sentences of a template in words, numbers and names left out."""
    prose = re.sub(r"{%.*?%}|{{.*?}}", " ", re.sub(r"^#.*$", " ", text, flags=re.MULTILINE), flags=re.DOTALL)
    parts = (" ".join(part.split()) for part in re.split(r"(?<=[.:])\s", prose))
    return [part for part in parts if len(part.split()) >= 6]


def test_a_sentence_that_stands_twice_is_found():
    assert sentences("# Q\n\nOne two three four five {{ f.x }} six. Short one.") == ["One two three four five six."]


def test_no_sentence_stands_twice():
    counts = Counter(part for text in TEXTS.values() for part in sentences(text))
    assert [part for part, count in counts.items() if count > 1] == []
    assert sum(counts.values()) > 50


@pytest.mark.parametrize("name", TEXTS)
def test_a_page_is_short_and_its_figures_have_titles_captions_and_words_for_the_blind(name):
    text = TEXTS[name]
    assert text.startswith("# " if name == "front" else "# {{ question }}\n\n")
    assert text.count("\n") <= MOST_LINES
    assert len(text.split()) <= MOST_WORDS
    figures = CALL.findall(text)
    assert len(re.findall(r"figure\(", text)) == len(figures) <= MOST_FIGURES
    for given, caption in figures:
        assert re.search(r'title="[^"]{8,}"', given), given
        assert re.search(r'alt="[^"]{20,}"', given), given
        assert len(caption.split()) > 8, caption


@pytest.mark.parametrize("name", TEXTS)
def test_links_to_pages_name_studies_or_benchmarks(name):
    linked = set(re.findall(r"\bpages\.(\w+)", TEXTS[name]))
    assert linked <= {*runner.names(), "peers", "bench", "measured"}


def test_the_front_page_renders_without_any_study_and_with_what_there_is(tmp_path):
    text = template.front(TEXTS["front"], [], tmp_path, {})
    assert "None" not in text
    assert "not measured" not in text
    assert "![" not in text
    facts = {"bounds": 4, "bounds_held": 3, "closed_form": 1e-16, "digits": 45}
    study = {"study": "truth", "facts": facts, "pictures": [], "tables": []}
    assert "3 of 4 bounds hold" in " ".join(template.front(TEXTS["front"], [study], tmp_path, {}).split())
