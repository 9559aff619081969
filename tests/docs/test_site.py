"""The site: built without a warning, whole, and read without a network."""

import ast
import importlib.util
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from urllib.parse import urlsplit

import pytest

import symtop
from tests.browser import Browser
from tests.pages import ROOT

gallery = None
if importlib.util.find_spec("sphinx"):
    sys.path.insert(0, str(ROOT / "docs"))
    from generator import docstrings, gallery

    sys.path.remove(str(ROOT / "docs"))
pytestmark = pytest.mark.skipif(gallery is None, reason="Sphinx is not installed; make docs installs it")

FETCHED = {"img": "src", "script": "src", "source": "src", "iframe": "src", "link": "href"}  # by a browser, unasked
SOURCED = [  # modules of the mathematics that name where it is from
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for room in ("model", "methods", "measure")
    for path in sorted((ROOT / "symtop" / room).rglob("*.py"))
    if "Source" in (text := path.read_text(encoding="utf-8"))  # most have no need to be parsed
    and re.search(r"\bSources?:", ast.get_docstring(ast.parse(text)) or "")
]
SMALL = """# Report

## At what rate?

**Error against step**

![Lines.](figures/convergence-a.png)

Slope is order, for `rk4[axis]`.

**How to read it.** Filled points enter the fit.
"""


class Assets(HTMLParser):
    """What a browser fetches when it opens a page, and the links that it shows."""

    def __init__(self):
        super().__init__()
        self.fetched, self.links = [], []

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        if (address := values.get(FETCHED.get(tag, ""))) and values.get("rel") != "canonical":
            self.fetched.append(address)
        if tag == "a" and values.get("href"):
            self.links.append(values["href"])


def assets(text):
    parser = Assets()
    parser.feed(text)
    return parser


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built as `make docs` builds it."""
    out = tmp_path_factory.mktemp("site")
    words = ["-W", "--keep-going", "-q", "-b", "html", "-d", out / "doctrees", ROOT / "docs", out / "html"]
    result = subprocess.run([sys.executable, "-m", "sphinx", *map(str, words)], capture_output=True, text=True,
                            timeout=500, check=False, env={**os.environ, "PYTHONPATH": str(ROOT)})  # fmt: skip
    assert result.returncode == 0, result.stderr
    return out / "html"


@pytest.mark.slow
def test_nothing_is_fetched_from_elsewhere_and_every_link_leads_somewhere(site):
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 30
    for page in pages:
        content = assets(page.read_text(encoding="utf-8"))
        for address in [*content.fetched, *(link for link in content.links if not urlsplit(link).scheme)]:
            parts = urlsplit(address)
            assert not parts.netloc, (page, address)
            assert not parts.path or (page.parent / parts.path).is_file(), (page, address)
    styles = "".join(path.read_text(encoding="utf-8") for path in site.rglob("*.css"))
    assert not re.search(r"(@import|url\()\s*[\"']?(https?:)?//", styles)


def test_what_is_fetched_is_seen():
    """Negative control of the reading above."""
    text = "<script src='https://cdn/x.js'></script><link rel='stylesheet' href='//a/b.css'><a href='no.html'></a>"
    assert (assets(text).fetched, assets(text).links) == (["https://cdn/x.js", "//a/b.css"], ["no.html"])


@pytest.mark.slow
@pytest.mark.parametrize("width", [1280, 390])
def test_pages_fit_and_ask_for_nothing(site, width):
    pages = ["index.html", "notebooks/first-run.html", "theory/splitting.html", "theory/discrete-lagrangians.html",
             "reference/api.html", "reference/gallery.html", "snapshot/report.html", "integrators.html",
             "about/faq.html", "search.html?q=separatrix"]  # fmt: skip
    with Browser(width=width, height=900) as browser:
        for page in pages:
            browser.open(f"{site.as_uri()}/{page}")
            for theme in ("light", "dark"):
                browser.evaluate(f"document.body.dataset.theme = '{theme}'")
                assert browser.too_wide <= 0, (page, theme)
        browser.wait_for("document.querySelectorAll('#search-results li').length > 3")
        assert (browser.problems, browser.outside()) == ([], [])


def test_every_public_name_and_every_derivation_is_on_a_page():
    api = (ROOT / "docs" / "reference" / "api.md").read_text(encoding="utf-8")
    documented = set(re.findall(r"^\.\. (?:auto|py:)\w+:: (\w+)$", api, re.MULTILINE))
    assert documented == set(symtop.__all__) - {"__version__"}
    theory = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "theory").glob("*.md"))
    assert len(SOURCED) > 40
    assert [module for module in SOURCED if f".. automodule:: {module}\n" not in theory] == []


@pytest.mark.slow
def test_derivations_public_names_figures_studies_and_commands_are_on_the_site(site):
    api = (site / "reference" / "api.html").read_text(encoding="utf-8")
    for name in set(symtop.__all__) - {"__version__"}:
        assert f'id="symtop.{name}"' in api, name
    theory = "".join(path.read_text(encoding="utf-8") for path in (site / "theory").glob("*.html"))
    for method in symtop.integrators().values():
        assert f'id="{method.name}"' in theory, method.name
    page = (site / "reference" / "gallery.html").read_text(encoding="utf-8")
    figures = {path.name for path in (ROOT / "docs/snapshot/figures").iterdir() if path.suffix in {".png", ".gif"}}
    assert figures
    for name in figures:
        assert f"_images/{name}" in page, name
        assert (ROOT / gallery.maker(name)[1]).is_file(), name
    spoken = " ".join(re.sub(r"<[^>]+>", " ", page).split())
    for study in {name.partition("-")[0] for name in figures} - set(gallery.OTHERS):
        assert f"Made by symtop study {study} ;" in spoken, study


@pytest.mark.parametrize(("report", "tracked"), [
    (SMALL, {"convergence-a.png", "drift-b.png"}),  # a figure that the report does not show
    (SMALL, set()),  # one that is not there
    (SMALL.replace("convergence-a", "nobody-a"), {"nobody-a.png"}),  # one that nothing makes
])  # fmt: skip
def test_a_figure_out_of_place_ends_the_build(report, tracked):
    with pytest.raises(gallery.ExtensionError, match="gallery"):
        gallery.markdown(report, tracked)


def test_a_docstring_says_the_same_in_restructured_text():
    from docutils.core import publish_doctree

    text = "Of |a x b|, u_.\n\nWith `code`, ``more``,\na* b* and *this*:\n\n    x_1 = |L| *a\n\n    y\n\nThe end <h>."
    tree = publish_doctree("\n".join(docstrings.restructured(text)), settings_overrides={"report_level": 1})
    texts = lambda kind: [node.astext() for node in tree.findall(lambda node: node.tagname == kind)]
    assert not texts("system_message")
    assert not texts("problematic")
    assert (texts("literal"), texts("emphasis")) == (["code", "more"], ["this"])
    assert texts("literal_block") == ["x_1 = |L| *a\n\ny"]
    paragraphs = [" ".join(words.split()) for words in texts("paragraph")]
    assert paragraphs == ["Of |a x b|, u_.", "With code, more, a* b* and this:", "The end <h>."]
