"""The report in a real browser: nothing overflows, nothing leaves the page, charts answer, tables are sorted."""

import csv
import dataclasses
import html
import io
import itertools
import json
import re
import shutil

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

import symtop
from symtop.measure import sweep
from symtop.report import page, style, template
from symtop.report.html import Writer
from symtop.runner import fingerprint, pool, run as runner
from tests.browser import FAINT, Browser

FEW = (
    "exact", "midpoint[angles]", "stormer-verlet[angles]", "strang[axis]", "rk4[axis]", "rk4[attitude]", "taylor[axis]",
    "rk45-compiled[axis]",
)  # fmt: skip


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Small studies of speed, of what goes wrong and of convergence, their findings and the page."""
    folder = tmp_path_factory.mktemp("results")
    for name in ("speed", "pitfalls", "convergence"):
        study = runner.load(name)
        cases = [case for case in study.cases(True) if name == "pitfalls" or case.integrator in (*FEW, "together")]
        cases = [case for case in cases if name != "convergence" or case.scene == "spheroid"]
        if name == "speed":
            settings, timed = {"lengths": (4.0, 8.0), "settings": 4}, {"integrators": FEW}
            cases = [dataclasses.replace(case, settings=settings | timed if case.timed else settings) for case in cases]
        small = dataclasses.replace(study, cases=lambda _, cases=cases: cases)
        with pytest.MonkeyPatch.context() as patch:  # workers take longer to start than these cases
            patch.setattr(pool, "WORTH_WORKERS", len(cases) + 1)
            patch.setattr(sweep, "BATCHES", 3)
            patch.setattr(fingerprint, "_known", {})  # of code with this patch, which no later study of the process is
            patch.setattr(fingerprint, "reached", fingerprint.functools.cache(fingerprint.code))
            assert runner.run(small, folder, jobs=1, quiet=True, save=style.sketch)["failures"] == []
    page.write(folder)
    return folder


@pytest.fixture(scope="module")
def browser(request):
    with Browser(width=1280, height=900) as open_browser:  # without one, nothing has to be computed
        open_browser.open((request.getfixturevalue("results") / "report.html").as_uri())
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
    browser.evaluate("[...document.images].forEach(image => { image.loading = 'eager'; })")
    browser.wait_for("[...document.images].every(image => image.complete)")
    assert browser.evaluate("[...document.images].every(image => image.naturalWidth > 100 && image.alt)")
    assert browser.evaluate("document.images.length") == 4
    height = "Math.min(...[...document.querySelectorAll('.chart svg text')].map(t => t.getBoundingClientRect().height))"
    assert browser.evaluate(height) >= 10.0  # pixels: legible
    assert browser.problems == []


def test_every_text_has_the_contrast_of_wcag_aa_in_both_schemes(browser, scheme):
    browser.resize(1280, 900)
    assert browser.evaluate(FAINT) == []
    background = browser.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (background == "rgb(255, 255, 255)") is (scheme == "light")
    browser.evaluate("document.querySelector('p.title').style.color = '#888'")
    assert [entry.split()[0] for entry in browser.evaluate(FAINT)] == ["strong."] * (scheme == "light")
    browser.evaluate("document.querySelector('p.title').style.color = ''")


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


def test_headings_figures_and_tables_have_addresses_and_the_contents_follow_the_reader(browser):
    titles = "[...document.querySelectorAll('main h2, main h3, figcaption')]"
    assert browser.evaluate(f"{titles}.filter(box => !box.querySelector('a.anchor')).length") <= 1  # of the registry
    ids = browser.evaluate("[...document.querySelectorAll('[id]')].map(node => node.id)")
    assert len(ids) == len(set(ids))
    local = browser.evaluate("[...document.querySelectorAll('a[href^=\"#\"]')].map(link => link.hash.slice(1))")
    assert set(local) <= set(ids)
    assert len(local) > 10
    browser.resize(1280, 900)
    current = "document.querySelector('nav a[aria-current]')?.hash"
    for name in ("part-provenance", "part-equations", "part-measured", "part-convergence"):
        browser.evaluate(f"location.hash = '{name}'")
        browser.wait_for(f"{current} === '#{name}'")
    browser.evaluate("scrollTo(0, 0)")
    browser.wait_for(f"{current} === '#part-front'")


def test_a_table_in_full_is_opened_searched_sorted_and_saved(browser):
    fold = "details[data-table='integrators']"
    assert browser.evaluate(f'document.querySelectorAll("{fold} table").length') == 0
    browser.click(f"{fold} summary")
    browser.wait_for(f'document.querySelector("{fold} table") !== null')
    table = f'document.querySelector("{fold} table")'
    names = f"[...{table}.tBodies[0].rows].filter(row => !row.hidden).map(row => row.cells[0].textContent)"
    methods = browser.evaluate(names)
    assert methods == list(symtop.integrators())
    browser.set(f"{fold} input", "gauss compiled")
    rows_shown = browser.evaluate(names)
    assert {"gauss-2", "gauss-12"} <= set(rows_shown)
    assert "rk4" not in rows_shown
    browser.set(f"{fold} input", "no such method")
    assert browser.evaluate(f"{names}.length") == 0
    browser.set(f"{fold} input", "")
    browser.click(f"{fold} th button")
    assert browser.evaluate(names) == sorted(methods, key=str.lower) or set(browser.evaluate(names)) == set(methods)
    ascending = browser.evaluate(names)
    browser.click(f"{fold} th button")
    assert browser.evaluate(names) == ascending[::-1]
    assert browser.evaluate(f"{table}.tHead.rows[0].cells[0].ariaSort") == "descending"
    cells = f"[...{table}.tBodies[0].rows].map(row => row.cells[1])"
    texts = {"3": "inf", "5": "2\u00a0×\u00a010⁴", "7": "10⁻²", "9": "word", "11": ""}
    browser.evaluate(f"{cells}.forEach((cell, k) => {{ cell.textContent = {json.dumps(texts)}[k] ?? `${{k}}`; }})")
    browser.click(f"{fold} th:nth-child(2) button")
    ordered = browser.evaluate(f"{cells}.map(cell => cell.textContent)")
    numbers = [str(k) for k in range(len(methods)) if str(k) not in texts]
    assert ordered == [numbers[0], texts["7"], *numbers[1:], texts["5"], "inf", "word", ""]  # numbers before words
    text = browser.evaluate("""(async () => {
        document.querySelector("table[data-name='scenes']").rows[1].cells[1].textContent = "2\u00a0×\u00a010⁻⁴";
        let blob; const link = HTMLAnchorElement.prototype.click, make = URL.createObjectURL;
        HTMLAnchorElement.prototype.click = function () { this.dataset.saved = this.download; };
        URL.createObjectURL = (file) => { blob = file; return make(file); };
        document.querySelector(".tools:has(+ .scroll table[data-name='scenes']) button").click();
        HTMLAnchorElement.prototype.click = link; URL.createObjectURL = make;
        return blob.text();
    })()""")
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [row["scene"] for row in rows] == list(symtop.scenes())
    assert "2e-4" in rows[0].values()


def test_the_keyboard_reaches_content_tables_and_points(browser):
    browser.resize(1280, 900)
    browser.evaluate("scrollTo(0, 0); document.activeElement.blur()")
    browser.open(browser.evaluate("location.href.split('#')[0]"))
    browser.press("Tab")
    assert browser.evaluate("document.activeElement.textContent") == "Skip to the content"
    assert browser.evaluate("document.activeElement.getBoundingClientRect().left") >= 0.0
    browser.press("Enter")
    browser.wait_for("document.activeElement.id === 'content'")
    reachable = "[...document.querySelectorAll('.scroll, .chart svg')].filter(box => box.tabIndex || !box.ariaLabel)"
    assert browser.evaluate(f"{reachable}.length") == 0
    browser.evaluate("document.querySelector('.chart svg').focus()")
    tips = []
    for _ in range(2):
        browser.press("ArrowRight")
        tips.append(browser.evaluate("document.querySelector('.chart .tip').textContent"))
    assert tips[0] != tips[1]
    assert all(re.search("step|tolerance", tip) for tip in tips)
    browser.press("Escape")
    assert browser.evaluate("document.querySelector('.chart .tip').hidden")


def test_it_prints_with_every_figure_and_in_black_on_white(browser, scheme, results, tmp_path):
    pdf = browser.pdf(tmp_path / "report.pdf").read_bytes()
    assert len(re.findall(rb"/Subtype\s*/Image", pdf)) >= len(list((results / "figures").glob("*.png")))
    assert browser.evaluate("matchMedia('print').matches") is False


def test_it_paints_within_a_second_asks_for_nothing_and_can_be_sent_alone(browser, results, tmp_path):
    browser.open((results / "report.html").as_uri())
    assert browser.wait_for("performance.getEntriesByName('first-contentful-paint')[0]?.startTime") < 1000.0  # ms
    assert all(address.startswith(("file:", "data:")) for address in browser.requests)
    assert (results / "report.html").stat().st_size < 5e6
    for folder in ("figures", "tables"):
        shutil.copytree(results / folder, tmp_path / folder)
    for name in ("convergence", "speed", "pitfalls"):
        shutil.copy(results / f"{name}.json", tmp_path)
    text = page.write(tmp_path, embed=True).read_text(encoding="utf-8")
    assert text.count("data:image/png;base64,") == 4
    assert 'src="figures/' not in text


POINT = """(() => {
    const mark = document.querySelectorAll('.chart .mark')[%d], box = mark.getBoundingClientRect();
    mark.ownerSVGElement.dispatchEvent(new PointerEvent('pointermove',
        {clientX: box.x + box.width / 2 + %d, clientY: box.y + box.height / 2, bubbles: true}));
    const tip = document.querySelector('.chart .tip');
    return tip.hidden ? '' : tip.textContent;
})()"""


def test_methods_cost_error_and_run_length_are_chosen(browser, results):
    browser.resize(1280, 900)
    marks = "document.querySelectorAll('.chart .mark').length"
    lines = "document.querySelector('.chart svg').innerHTML.split('<circle')[0]"
    count, before = browser.evaluate(marks), browser.evaluate(lines)
    data = xr.load_dataset(results / "speed.nc").sel(scene="goldstein").isel(nutations=0)
    assert count == int(((data["axis"] > 0.0) & (data["seconds"] > 0.0) & (data["variant"] != "exact")).sum())
    browser.click(".chart input[value='rk4']")
    assert 0 < browser.evaluate(marks) < count
    browser.click(".chart input[value='rk4']")
    assert browser.evaluate(marks) == count
    labels = "[...document.querySelectorAll('.chart svg text')].map(text => text.textContent)"
    assert "rk4[axis]" in browser.evaluate(labels)
    key = "document.querySelector('.chart .key').checkVisibility() && document.querySelector('.chart .key').textContent"
    assert "exact motion, no integrator" in browser.evaluate(key)
    for menu, choice, label in (
        ("Error", "largest error of the attitude (rad)", "rk4[attitude]"),
        ("Cost", "force evaluations", "force evaluations"),
        ("run length", "8 nutations", "strang[axis]"),
    ):
        select = f".chart select[name='{menu}']"
        first = browser.evaluate(f'document.querySelector("{select}").value')
        browser.set(select, choice)
        assert browser.evaluate(lines) != before
        assert label in browser.evaluate(labels)
        assert bool(browser.evaluate(key)) is (menu == "run length")  # the bound is that of the axis over its time
        browser.set(select, first)
        assert browser.evaluate(lines) == before


def test_the_chart_takes_the_place_of_its_figure_and_pointing_at_a_run_shows_what_it_was(browser, results):
    browser.resize(1280, 900)
    name, step = re.fullmatch(r"(\S+) \(\S+\): step (\S+) s", browser.evaluate(POINT % (0, 0))).groups()
    cell = xr.load_dataset(results / "speed.nc").sel(scene="goldstein", variant=name).isel(nutations=0)
    assert any(f"{value:.3g}" == step for value in cell["step_size"].values)
    assert browser.evaluate(POINT % (0, 100_000)) == ""  # far from every run: nothing
    assert browser.evaluate("document.querySelector('#speed-error-against-time .scroll').checkVisibility()") is False
    assert browser.evaluate("document.querySelector('#speed-error-against-time .chart svg').checkVisibility()")
    assert browser.evaluate("document.querySelector('#pitfalls-three .scroll').checkVisibility()")


def test_a_figure_that_is_cut_off_has_a_shade_at_its_edge(browser, tmp_path):
    browser.resize(390, 900)
    region = "document.querySelector('#pitfalls-three .scroll')"
    for end in (0, 9999):
        browser.evaluate(f"{region}.scrollIntoView(), {region}.scrollLeft = {end}, {region}.firstChild.decode()")
        box = browser.evaluate(f"{region}.getBoundingClientRect().toJSON()")
        image = plt.imread(browser.screenshot(tmp_path / "edge.png"))[..., :3]
        edge = image[int(box["top"]) + 3 : int(box["bottom"]) - 3, int(box["right"]) - 3]
        assert bool(edge.max() < 0.95) is (end == 0)  # of its white


def open_with(chart, browser, results, file):
    """Show the page with another chart."""
    pattern, content = r'(?<=class="chart"><script type="application/json">).*', page.prepared(chart)
    full = re.sub(pattern, lambda _: f"{content}</script></div>", (results / "report.html").read_text("utf-8"))
    file.write_text(full, "utf-8")
    browser.open(file.as_uri())


def test_lines_to_names_do_not_cross_and_each_name_has_the_colour_of_its_line(browser, results, tmp_path):
    ends = np.random.default_rng(3).uniform((1.0, -12.0), (5.0, -11.0), (12, 2))
    series = [(f"line {k}", [(1.0, 1.0, ""), (*10.0**end, "")]) for k, end in enumerate(ends)]
    browser.resize(1280, 900)
    open_with({"title": "", "x": "x", "y": "y", "panels": {"": series}}, browser, results, tmp_path / "ends.html")
    lines = browser.evaluate("""[...document.querySelectorAll('.chart svg path[stroke-width="0.5"]')].map(path =>
        [path.getAttribute('d'), path.getAttribute('stroke'), getComputedStyle(path.nextSibling).fill])""")
    ends = [[*map(float, re.findall(r"[-\d.]+", path))] for path, *_ in lines]
    assert len(ends) == 12
    for (x, y, right, end), (x2, y2, _, end2) in itertools.combinations(ends, 2):
        heights = [np.interp(max(x, x2), path[::2], path[1::2]) for path in ((x, y, right, end), (x2, y2, right, end2))]
        assert (heights[0] - heights[1]) * (end - end2) >= 0.0
    for _, color, ink in lines:
        assert style.ink(color) == pytest.approx([int(part) / 255 for part in re.findall(r"\d+", ink)], abs=0.003)


def test_each_of_more_than_thirty_lines_has_its_name_beside_or_below_and_zeros_are_told(browser, results, tmp_path):
    study, data = runner.load("speed"), xr.load_dataset(results / "speed.nc")
    names = [name for name in dict.fromkeys(case.integrator for case in study.cases(True)) if name != "together"]
    data = data.sel(variant=["exact", *["midpoint[angles]"] * (len(names) - 1)]).assign_coords(variant=names)
    (chart,) = study.charts(data.assign(p_phi=0.0 * data["p_phi"]))
    open_with(chart._asdict(), browser, results, tmp_path / "full.html")
    for width in (1280, 390):
        browser.resize(width, 900)
        boxes = browser.evaluate("""(() => {
            const svg = document.querySelector('.chart svg'), all = svg.getBoundingClientRect();
            return [...svg.querySelectorAll('text')].filter(text => text.textContent.endsWith(']')).map(text => {
                const box = text.getBoundingClientRect();
                return [text.textContent, box.top - all.top, all.right - box.right, all.bottom - box.bottom];
            });
        })()""")
        assert sorted(box[0] for box in boxes) == sorted(set(names) - {"exact"})
        assert len(boxes) > 30
        assert min(min(box[1:]) for box in boxes) >= 0.0  # none is cut off
        assert np.diff(sorted(box[1] for box in boxes)).min() > 14.0  # pixels: none lies on another
    browser.set(".chart select[name='Error']", "largest error of p_phi / larger momentum")
    key = browser.evaluate("[...document.querySelectorAll('.chart .key')].at(-1).textContent")
    assert key == f"Exactly zero, and so without a point: {', '.join(names[1:])}."


def test_words_follow_from_the_stored_data_and_findings_that_are_not_whole_are_told(results, tmp_path):
    study, data = runner.load("convergence"), xr.load_dataset(results / "convergence.nc")
    findings = json.loads((results / "convergence.json").read_text(encoding="utf-8"))
    text = re.sub(r"<[^>]+>", "", html.unescape((results / "report.html").read_text(encoding="utf-8")))
    twin = (results / "report.md").read_text(encoding="utf-8")
    assert json.loads(json.dumps(study.facts(data))) == findings["facts"]
    for content in (text, twin.replace("`", "")):
        assert template.answer(findings, results) in content
    changed = data.assign(force_evaluations=2.0 * data["force_evaluations"])
    assert study.facts(changed) != findings["facts"]  # they read the data, they do not remember it
    for file in ("tables/convergence-costs.csv", "figures/convergence-constants.png"):
        shutil.copytree(results, tmp_path, dirs_exist_ok=True)
        (tmp_path / file).unlink() if file.endswith("csv") else (tmp_path / file).write_bytes(b"")
        words = rf"{file}.*\); run it again: symtop study convergence --results /"
        with pytest.raises(symtop.SymtopError, match=words):
            page.write(tmp_path)
    shutil.copytree(results, tmp_path, dirs_exist_ok=True)
    for file in tmp_path.glob("*.json"):  # findings may be of an earlier day
        file.write_text(re.sub(r'"symtop_version": "[^"]+"', '"symtop_version": "0.0.1"', file.read_text("utf-8")))
    last = tmp_path / f"{page.gather(tmp_path)[-1]['study']}.json"
    last.write_text(last.read_text("utf-8").replace("0.0.1", "0.0.2").replace('"quick": false', '"quick": true'))
    text = page.write(tmp_path).read_text(encoding="utf-8")
    assert (page.QUICK in text, "0.0.2" in (tmp_path / "reference.md").read_text("utf-8")) == (True, True)
    assert f"by symtop {symtop.__version__}, revision " in text


def test_markdown_becomes_figures_tables_and_formulas():
    figures = {"figures/a-b.png": {"source": "figures/a-b.png", "width": 3, "height": 4}}
    writer = Writer(figures, lambda kind, name: f"[{kind} {name}]")
    text = writer(
        "## A question?\n\n**Title**\n\n![alt <b>](figures/a-b.png)\n\nCaption, `rk4[axis]`.\n\nMore.\n\n**Rows**\n\n"
        "| a | b |\n|---|---|\n| 1 | \\<i> |\n\n<!-- table x-y -->\n\n$$a = \\frac{1}{2}$$\n\n## A question?\n\n"
        "<script>1</script>"
    )
    assert '<h2 id="a-question">A question? ' in text
    assert '<h2 id="a-question-1">' in text
    pattern = r'<figure id="a-b">.*width="3" height="4".*alt="alt &lt;b&gt;".*<figcaption>Caption, <code>rk4'
    assert re.search(pattern, text)
    assert "<p>More.</p>" in text
    assert re.search(r'aria-label="Rows"><table data-name="rows">(.|\n)*&lt;i&gt;', text)
    assert "[table x-y]" in text
    assert "<mfrac>" in text
    assert "<script>" not in text
