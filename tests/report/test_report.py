"""The report in a real browser: nothing overflows, nothing leaves the page, charts answer, words follow from data."""

import dataclasses
import html
import json
import re

import pytest
import xarray as xr

from symtop.report import markdown, page, style
from symtop.runner import run as runner
from symtop.runner.study import Case
from tests.browser import Browser

FEW = (
    "midpoint[angles]", "trapezoidal[angles]", "galerkin-simpson[angles]", "stormer-verlet[angles]",
    "takahashi-imada[axis]", "rk4[axis]", "rk45-compiled[angles]", "gauss-8[axis]", "taylor[axis]", "rk45[angles]",
)  # fmt: skip


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A small work-precision study, its findings and the page."""
    folder = tmp_path_factory.mktemp("results")
    study = runner.load("work_precision")

    def cases(_):
        return [Case("spheroid", name, {"periods": [10.0, 40.0], "budget": 3e4}) for name in FEW]

    findings = runner.run(dataclasses.replace(study, cases=cases), folder, jobs=1, quiet=True, save=style.save)
    assert findings["failures"] == []
    page.write(folder)
    return folder


@pytest.fixture(scope="module")
def browser(results):
    with Browser(width=1280, height=900) as open_browser:
        open_browser.open((results / "report.html").as_uri())
        yield open_browser


@pytest.mark.parametrize("width", [1280, 390])
def test_nothing_overflows_and_every_figure_is_there(browser, width):
    browser.resize(width, 900)
    assert browser.too_wide == 0
    assert browser.evaluate("[...document.images].every(one => one.complete && one.naturalWidth > 100 && one.alt)")
    assert browser.evaluate("document.images.length") >= 5
    least = "Math.min(...[...document.querySelectorAll('.chart svg text')].map(t => t.getBoundingClientRect().height))"
    assert browser.evaluate(least) >= 10.0  # pixels: legible
    assert browser.problems == []


def test_no_request_leaves_the_page(browser):
    assert browser.outside() == []
    assert all(address.startswith(("file:", "data:")) for address in browser.requests)


POINT = """(() => {
    const mark = document.querySelectorAll('.chart .mark')[%d], box = mark.getBoundingClientRect();
    mark.ownerSVGElement.dispatchEvent(new PointerEvent('pointermove',
        {clientX: box.x + box.width / 2 + %d, clientY: box.y + box.height / 2, bubbles: true}));
    const tip = document.querySelector('.chart .tip');
    return tip.hidden ? '' : tip.textContent;
})()"""


def test_pointing_at_a_run_shows_what_it_was(browser, results):
    browser.resize(1280, 900)
    tip = browser.evaluate(POINT % (0, 0))
    name, error = re.fullmatch(r"(\S+) \(\S+\): .*error (\S+)", tip).groups()
    cell = xr.load_dataset(results / "work_precision.nc").sel(scene="spheroid", integrator=name).isel(horizon=0)
    assert any(f"{value:.1e}" == error for value in cell["axis"].values)
    assert browser.evaluate(POINT % (0, 100_000)) == ""  # far from every run: nothing


def test_the_filter_and_the_choice_change_what_is_drawn(browser):
    browser.resize(1280, 900)
    count = "document.querySelectorAll('.chart .mark').length"
    everything = browser.evaluate(count)
    browser.click(".chart input[value='runge-kutta']")
    without = browser.evaluate(count)
    assert 0 < without < everything
    browser.click(".chart input[value='runge-kutta']")
    assert browser.evaluate(count) == everything
    before = browser.evaluate("document.querySelector('.chart svg').innerHTML")
    browser.set(".chart select", "spheroid, over 40 nutation periods")
    assert browser.evaluate("document.querySelector('.chart svg').innerHTML") != before
    browser.set(".chart select", "spheroid, over 10 nutation periods")
    assert browser.evaluate("document.querySelector('.chart svg').innerHTML") == before


def test_the_first_screen_answers_the_question(browser):
    browser.resize(1280, 900)
    assert browser.evaluate("document.querySelector('h2').textContent") == "Which integrator should I use?"
    assert browser.evaluate("document.querySelector('#answer table').getBoundingClientRect().top") < 900.0


def test_words_follow_from_the_stored_data_and_from_nothing_else(results):
    study, stored = runner.load("work_precision"), xr.load_dataset(results / "work_precision.nc")
    findings = json.loads((results / "work_precision.json").read_text(encoding="utf-8"))
    text = html.unescape((results / "report.html").read_text(encoding="utf-8"))
    twin = (results / "report.md").read_text(encoding="utf-8")
    assert findings["verdict"] == study.verdict(stored)
    assert findings["opening"]["sentences"] == list(study.opening(stored).sentences)
    for sentence in [*findings["verdict"], *findings["opening"]["sentences"]]:
        assert sentence in text
        assert sentence in twin
    slower = stored.assign(seconds=2.0 * stored["seconds"])
    assert study.verdict(slower) != findings["verdict"]  # the sentences read the data, they do not remember it


def test_the_twin_names_every_figure(results):
    twin = (results / "report.md").read_text(encoding="utf-8")
    shown = re.findall(r"!\[[^]]+\]\((figures/[^)]+)\)", twin)
    assert len(shown) == len(list((results / "figures").iterdir()))
    assert all((results / file).is_file() for file in shown)


def test_an_answer_links_to_the_studies_on_the_page_that_explain_it():
    first = {"question": "Which?", "sentences": ["This one."], "table": {"header": ["a"], "rows": [["b"]]}}
    study = {"opening": first | {"explained": {"drift": "where it drifts", "nowhere": "not shown"}}}
    linked = markdown.opening(study, {"drift": "Drift and phase"})
    assert linked.endswith("More: [where it drifts](#drift-and-phase).")
    assert "More" not in markdown.opening(study, {}) + markdown.opening({"opening": first}, {"drift": "Drift"})
