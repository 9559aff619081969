"""The report in a real browser: nothing overflows, nothing leaves the page, charts answer, words follow from data."""

import csv
import dataclasses
import html
import io
import json
import re
import shutil

import pytest
import xarray as xr

import symtop
from symtop.core import netcdf
from symtop.methods.framework.registry import split_name
from symtop.report import page, style
from symtop.runner import run as runner
from symtop.runner.study import Table
from tests.browser import FAINT, Browser

FEW = (
    "midpoint[angles]", "stormer-verlet[angles]", "takahashi-imada[axis]", "rk4[axis]", "rk45-compiled[axis]",
    "taylor[axis]", "series[axis]",
)  # fmt: skip


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A small study of cost, its findings and the page."""
    folder = tmp_path_factory.mktemp("results")
    study = runner.load("cost")

    def cases(_):
        few = [one for one in study.cases(True) if one.group in {"tops", "prices"} or one.integrator in FEW]
        timed = {"integrators": [*FEW]}
        return [dataclasses.replace(one, settings={**one.settings, **timed}) if one.timed else one for one in few]

    def pictures(data):  # two of them open the report
        for place, picture in enumerate(study.pictures(data)):
            yield picture._replace(lead=f"Lead {place}" if place in (1, 3) else "")

    def tables(data):  # one of them is long
        return [*study.tables(data), Table("Many rows", ["number"], [[str(k)] for k in range(40)])]

    small = dataclasses.replace(study, cases=cases, pictures=pictures, tables=tables)
    findings = runner.run(small, folder, jobs=1, quiet=True, save=style.save)
    assert findings["failures"] == []
    page.write(folder)
    return folder


@pytest.fixture(scope="module")
def browser(results):
    with Browser(width=1280, height=900) as open_browser:
        open_browser.open((results / "report.html").as_uri())
        yield open_browser


@pytest.fixture(params=["light", "dark"])
def scheme(browser, request):
    """The page as a system in light or dark colours shows it."""
    browser.prefer(request.param)
    yield request.param
    browser.prefer("")


@pytest.mark.parametrize("width", [1280, 390])
def test_nothing_overflows_and_every_figure_is_there(browser, scheme, width):
    browser.resize(width, 900)
    assert browser.too_wide == 0
    browser.evaluate("[...document.images].forEach(one => { one.loading = 'eager'; })")
    browser.wait_for("[...document.images].every(one => one.complete)")
    assert browser.evaluate("[...document.images].every(one => one.naturalWidth > 100 && one.alt)")
    assert browser.evaluate("document.images.length") >= 5
    least = "Math.min(...[...document.querySelectorAll('.chart svg text')].map(t => t.getBoundingClientRect().height))"
    assert browser.evaluate(least) >= 10.0  # pixels: legible
    assert browser.problems == []


def test_every_text_has_the_contrast_of_wcag_aa(browser, scheme):
    browser.resize(1280, 900)
    assert browser.evaluate(FAINT) == []
    shown = browser.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (shown == "rgb(255, 255, 255)") is (scheme == "light")
    browser.evaluate("document.querySelector('.question').style.color = '#888'")
    assert [one.split()[0] for one in browser.evaluate(FAINT)] == ["p.question"] * (scheme == "light")
    browser.evaluate("document.querySelector('.question').style.color = ''")


def test_the_reader_chooses_the_colours(browser):
    browser.resize(1280, 900)
    browser.prefer("light")
    paper = "getComputedStyle(document.body).backgroundColor"
    before = browser.evaluate(paper)
    browser.click("#scheme")
    assert browser.evaluate(paper) != before
    assert browser.evaluate(FAINT) == []
    browser.click("#scheme")
    assert browser.evaluate(paper) == before
    browser.prefer("")


def test_headings_figures_and_tables_have_addresses_of_their_own(browser):
    addressed = (
        "[...document.querySelectorAll('h2, #measured h3, figcaption')].filter(one => !one.querySelector('a.anchor'))"
    )
    assert browser.evaluate(f"{addressed}.length") == 0
    ids = browser.evaluate("[...document.querySelectorAll('[id]')].map(one => one.id)")
    assert len(ids) == len(set(ids))
    local = browser.evaluate("[...document.querySelectorAll('a[href^=\"#\"]')].map(one => one.hash.slice(1))")
    assert set(local) <= set(ids)
    assert len(local) > 20


def test_a_link_into_a_fold_opens_it(browser):
    folded = "document.querySelector('main details[id]')"
    assert browser.evaluate(f"{folded}.open") is False
    browser.evaluate(f"location.hash = {folded}.id")
    browser.wait_for(f"{folded}.open")


def test_the_contents_follow_the_reader(browser):
    browser.resize(1280, 900)
    here = "document.querySelector('nav a[aria-current]')?.hash"
    for name in ("provenance", "measured", "cost"):
        browser.evaluate(f"location.hash = '{name}'")
        browser.wait_for(f"{here} === '#{name}'")
    browser.evaluate("scrollTo(0, 0)")
    browser.wait_for(f"{here} === '#answer'")


def test_a_table_is_searched_and_saved(browser):
    table = "document.querySelector('table[data-name=\"symtop-integrators\"]')"
    search = ".tools:has(+ .scroll table[data-name='symtop-integrators']) input"
    shown = f"[...{table}.tBodies[0].rows].filter(row => !row.hidden).map(row => row.cells[0].textContent)"
    every = browser.evaluate(f"{shown}.length")
    browser.set(search, "gauss compiled")
    found = browser.evaluate(shown)
    assert {"gauss-2", "gauss-12"} <= set(found)
    assert "rk4" not in found
    assert len(found) < every
    browser.set(search, "no such method")
    assert browser.evaluate(f"{shown}.length") == 0
    browser.set(search, "")
    assert browser.evaluate(f"{shown}.length") == every
    saved = browser.evaluate("""(async () => {
        let blob; const link = HTMLAnchorElement.prototype.click, make = URL.createObjectURL;
        HTMLAnchorElement.prototype.click = function () { this.dataset.saved = this.download; };
        URL.createObjectURL = (one) => { blob = one; return make(one); };
        document.querySelector(".tools:has(+ .scroll table[data-name='symtop-scenes']) button").click();
        HTMLAnchorElement.prototype.click = link; URL.createObjectURL = make;
        return blob.text();
    })()""")
    rows = list(csv.DictReader(io.StringIO(saved)))
    assert [row["scene"] for row in rows] == list(symtop.scenes())
    assert all(row["what it is for"] == symtop.scene(row["scene"]).purpose for row in rows)


def test_the_keyboard_reaches_content_tables_and_points(browser):
    browser.resize(1280, 900)
    browser.evaluate("scrollTo(0, 0); document.activeElement.blur()")
    browser.open(browser.evaluate("location.href.split('#')[0]"))
    browser.press("Tab")
    assert browser.evaluate("document.activeElement.textContent") == "Skip to the content"
    assert browser.evaluate("document.activeElement.getBoundingClientRect().left") >= 0.0
    browser.press("Enter")
    browser.wait_for("document.activeElement.id === 'content'")
    reachable = "[...document.querySelectorAll('.scroll, .chart svg')].filter(one => one.tabIndex || !one.ariaLabel)"
    assert browser.evaluate(f"{reachable}.length") == 0
    browser.evaluate("document.querySelector('.chart svg').focus()")
    said = []
    for _ in range(2):
        browser.press("ArrowRight")
        said.append(browser.evaluate("document.querySelector('.chart .tip').textContent"))
    assert said[0] != said[1]
    assert all("error" in one for one in said)
    browser.press("Escape")
    assert browser.evaluate("document.querySelector('.chart .tip').hidden")


@pytest.mark.parametrize("scheme", ["light", "dark"], indirect=True)
def test_it_prints_with_every_figure_and_in_black_on_white(browser, scheme, results, tmp_path):
    printed = browser.pdf(tmp_path / "report.pdf").read_bytes()
    shown = len(list((results / "figures").glob("*.png")))
    assert len(re.findall(rb"/Subtype\s*/Image", printed)) >= shown
    assert browser.evaluate("matchMedia('print').matches") is False


def test_it_paints_within_a_second_and_is_small(browser, results):
    browser.open((results / "report.html").as_uri())
    first = browser.wait_for("performance.getEntriesByName('first-contentful-paint')[0]?.startTime")
    assert first < 1000.0  # ms
    assert (results / "report.html").stat().st_size < 5e6


def test_figures_that_declare_it_open_the_page_in_their_order(browser, results):
    leads = browser.evaluate("[...document.querySelectorAll('.leads span')].map(one => one.textContent)")
    assert leads == ["Lead 1", "Lead 3"]
    findings = json.loads((results / "cost.json").read_text(encoding="utf-8"))
    shown = [picture["file"] for picture in findings["pictures"] if picture["lead"]]
    assert (
        browser.evaluate("[...document.querySelectorAll('.leads img')].map(one => one.src.split('/').pop())") == shown
    )


def test_the_page_can_be_sent_alone_and_can_do_without_leads(results, tmp_path):
    shutil.copytree(results / "figures", tmp_path / "figures")
    findings = json.loads((results / "cost.json").read_text(encoding="utf-8"))
    for picture in findings["pictures"]:
        picture.pop("lead")  # as findings of an older version
    (tmp_path / "cost.json").write_text(json.dumps(findings), encoding="utf-8")
    text = page.write(tmp_path, embed=True).read_text(encoding="utf-8")
    assert text.count("data:image/png;base64,") == len(findings["pictures"])
    assert 'src="figures/' not in text
    assert 'class="leads"' not in text
    assert 'id="answer"' in text


def test_every_method_and_term_of_the_answer_is_glossed(browser):
    glossed = browser.evaluate("[...document.querySelectorAll('.glossary dt')].map(one => one.textContent)")
    answer = browser.evaluate("document.querySelector('#answer').innerText")
    named = {split_name(word)[0] for word in re.findall(r"[a-z0-9-]+\[(?:axis|angles|attitude)\]", answer)}
    assert named
    assert named <= set(glossed)
    assert {"variant", "[axis]"} <= set(glossed)


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
    runs = netcdf.read_any(results / "cost.nc")["short"].to_dataset().sel(variant=name)["scene_error"].values
    assert any(f"{value:.1e}" == error for value in runs.ravel())
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
    browser.set(".chart select", "spheroid, 100 nutations")
    assert browser.evaluate("document.querySelector('.chart svg').innerHTML") != before
    browser.set(".chart select", "spheroid, 10 nutations")
    assert browser.evaluate("document.querySelector('.chart svg').innerHTML") == before


def test_words_follow_from_the_stored_data_and_from_nothing_else(results):
    study, stored = runner.load("cost"), netcdf.read_any(results / "cost.nc")
    findings = json.loads((results / "cost.json").read_text(encoding="utf-8"))
    text = html.unescape((results / "report.html").read_text(encoding="utf-8"))
    twin = (results / "report.md").read_text(encoding="utf-8")
    assert findings["verdict"] == study.verdict(stored)
    assert findings["opening"]["sentences"] == list(study.opening(stored).sentences)
    for sentence in [*findings["verdict"], *findings["opening"]["sentences"]]:
        assert sentence in text
        assert sentence in twin
    slower = stored.copy()
    slower["prices"] = xr.DataTree(stored["prices"].to_dataset().assign(price=2.0 * stored["prices"]["price"]))
    assert study.verdict(slower) != findings["verdict"]  # the sentences read the data, they do not remember it


def test_the_twin_names_every_figure(results):
    twin = (results / "report.md").read_text(encoding="utf-8")
    shown = re.findall(r"!\[[^]]+\]\((figures/[^)]+)\)", twin)
    assert len(shown) == len(list((results / "figures").iterdir()))
    assert all((results / file).is_file() for file in shown)
