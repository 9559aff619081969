"""The pages say what the code says, and the snapshot holds the report; what studies write is not tracked."""

import json
import re
import subprocess

import pytest

import symtop
from docs.generator import snapshot as taker
from symtop.methods.framework.registry import is_built_in
from symtop.run.ensemble.chunks import IN_LANES, IN_PYTHON, IN_TURN, Job
from tests.commands import call
from tests.pages import ROOT, pages


@pytest.fixture
def results(tmp_path):
    (tmp_path / "results" / "figures").mkdir(parents=True)
    for name in ("a.png", "b.gif", "left-over.png"):
        (tmp_path / "results" / "figures" / name).write_bytes(name.encode())
    (tmp_path / "results" / "report.md").write_text("![A](figures/a.png)\n\n![B](figures/b.gif)\n")
    return tmp_path / "results"


def test_a_report_that_is_not_whole_is_not_taken(results, tmp_path):
    (results / "figures" / "a.png").unlink()
    with pytest.raises(SystemExit, match=r"figures of the report are missing: a\.png"):
        taker.take(results, tmp_path / "snapshot")
    with pytest.raises(SystemExit, match="run make studies first"):
        taker.take(tmp_path, tmp_path / "snapshot")
    assert not (tmp_path / "snapshot").exists()


REPORT = """# T

![A](figures/a.png)

All: [table](tables/a-b.csv), [CSV](tables/c.csv).

<!-- table a-b -->

Data: [a.nc](a.nc).

**All questions:** [A few](#why) · [B](#how)

## Trust

See [how](#how).

## Why?

W [how](#how), [trust](#trust)

### Sub

## How?

H
"""


def test_each_question_becomes_a_page_and_links_lead_there(tmp_path):
    pages = taker.parted(REPORT)
    assert list(pages) == ["report.md", "a-few.md", "b.md"]
    assert pages["report.md"].endswith("[A few](a-few.md) · [B](b.md)\n\n## Trust\n\nSee [how](b.md).\n\n")
    links = "[how](b.md), [trust](report.md#trust)"
    assert pages["a-few.md"] == f"# Why?\n\nW {links}\n\n## Sub\n\n[All questions](report.md)\n"
    for file, text in pages.items():
        (tmp_path / file).write_text(text)
    report = taker.whole(tmp_path)
    assert re.findall("^##+ .+", report, re.MULTILINE) == ["## Trust", "## Why?", "### Sub", "## How?"]
    assert "W [how](#how)" in report


def test_a_whole_report_is_taken_without_links_to_what_is_not_tracked(results, tmp_path):
    snapshot = tmp_path / "snapshot"
    (snapshot / "figures").mkdir(parents=True)
    (snapshot / "figures" / "old.png").touch()
    assert taker.take(results, snapshot) == ["a.png", "b.gif"]
    assert sorted(path.name for path in (snapshot / "figures").iterdir()) == ["a.png", "b.gif"]
    assert (snapshot / "report.md").read_text() == (results / "report.md").read_text()
    (results / "report.md").write_text(REPORT)
    taker.take(results, tmp_path / "snapshot")
    text = (tmp_path / "snapshot" / "report.md").read_text()
    assert "All: table, CSV.\n\nData: a.nc.\n" in text
    assert "![A](figures/a.png)" in text


def test_the_stored_snapshot_is_whole_and_pages_quote_what_it_says():
    folder = ROOT / "docs" / "snapshot"
    report = taker.whole(folder)
    assert set(taker.SHOWN.findall(report)) == {path.name for path in (folder / "figures").iterdir()}
    for (name, begin), quote in taker.quoted(report).items():
        page = (ROOT / name).read_text(encoding="utf-8")
        assert taker.quote(quote, page, begin) == page, name


@pytest.mark.parametrize("name", ["bench", "peers"])
def test_what_a_page_says_of_a_benchmark_is_what_that_has_stored(name, tmp_path):
    page = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    quote = taker.benchmark(name, ROOT / "results")
    assert taker.quote(quote, page, taker.STORED_BY[name]) == page
    text = (ROOT / "results" / f"{name}.json").read_text(encoding="utf-8")
    (tmp_path / f"{name}.json").write_text(text.replace("0.3.0", "9.9.9").replace('"version": "0', '"version": "9'))
    assert taker.benchmark(name, tmp_path) != quote


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="this is no checkout")
def test_what_a_run_of_the_studies_writes_is_not_tracked():
    names = "convergence.nc convergence.json report.md report.html figures/x.png tables/x.csv cases/x/y.npz"
    paths = [f"results/{name}" for name in names.split()]
    result = subprocess.run(["git", "check-ignore", *paths], cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.stdout.split() == paths
    index = subprocess.run(["git", "ls-files", "results"], cwd=ROOT, capture_output=True, text=True, check=True)
    benchmarks = (
        "bench.json", "live-engines.json", "peers.json", "horizon.json", "repeat.json", "guard.json", "peers.nc",
        "machines.json", "figures/guard-curves.png", "figures/peers-fronts.png",
    )  # fmt: skip
    files = {name for name in index.stdout.split() if not name.startswith("results/machines/")}
    assert files == {f"results/{name}" for name in benchmarks}
    findings = (json.loads((ROOT / "results" / name).read_text(encoding="utf-8")) for name in benchmarks[:3])
    figures = [f"results/figures/{picture['file']}" for finding in findings for picture in finding.get("pictures", [])]
    assert set() < {*figures} <= set(index.stdout.split())  # else `make studies` on a fresh checkout has no report


PAGES = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in pages()}


def test_the_table_of_integrators_is_generated_studies_are_explained_and_links_lead_somewhere():
    (page,) = re.findall(r"<!-- integrators -->\n(.*?)\n<!-- /integrators -->", PAGES["docs/integrators.md"], re.DOTALL)
    today = call("integrators", "--markdown").output.splitlines()
    built_in = {row for row in today if is_built_in("".join(row.split(" ")[1:2]))}  # other tests register more
    assert built_in <= {*page.splitlines()} <= {*today}, "regenerate: symtop integrators --markdown"
    for script in (ROOT / "studies").glob("*/study.py"):
        assert f"| `{script.parent.name}` |" in PAGES["docs/studies.md"]
    for page, text in PAGES.items():
        for link in re.findall(r"\]\((?!https?://)([^)#]+)\)", text):
            assert (ROOT / page).parent.joinpath(link).is_file(), (page, link)
    files = {path.name for path in (ROOT / "docs").glob("*.md")} - {"index.md"}  # which begins with the README
    assert files == set(re.findall(r"\(docs/([\w-]+\.md)\)", PAGES["README.md"]))


def test_the_page_of_ensembles_says_how_the_members_of_each_method_are_run():
    rows = re.findall(r'^\| "(.+?)".*? \| (.*) \|$', PAGES["docs/ensembles.md"], re.MULTILINE)
    named = {how: {*re.findall("`(.+?)`", row)} for how, row in rows}
    assert all(map(symtop.integrator, set().union(*named.values())))
    for method in symtop.integrators().values():
        for chart in method.solvers:
            in_python, in_turn = ({f"{method.name}[{chart}]", method.name} & named[how] for how in (IN_PYTHON, IN_TURN))
            lanes = method.fixed_step and not in_turn and method.family != "engine"
            expected = IN_PYTHON if in_python else IN_LANES if lanes else IN_TURN
            assert Job(method, chart, *[None] * 7).execution == expected, (method.name, chart)
