"""The snapshot holds the report and its figures, and what the studies write is not tracked."""

import importlib.util
import json
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def _taker():
    spec = importlib.util.spec_from_file_location("snapshot", ROOT / "docs" / "generator" / "snapshot.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def results(tmp_path):
    (tmp_path / "results" / "figures").mkdir(parents=True)
    for name in ("a.png", "b.gif", "left-over.png"):
        (tmp_path / "results" / "figures" / name).write_bytes(name.encode())
    (tmp_path / "results" / "report.md").write_text("![A](figures/a.png)\n\n![B](figures/b.gif)\n")
    return tmp_path / "results"


def test_what_the_report_shows_is_copied_and_what_it_shows_no_more_goes(results, tmp_path):
    snapshot = tmp_path / "snapshot"
    (snapshot / "figures").mkdir(parents=True)
    (snapshot / "figures" / "old.png").touch()
    assert _taker().take(results, snapshot) == ["a.png", "b.gif"]
    assert sorted(path.name for path in (snapshot / "figures").iterdir()) == ["a.png", "b.gif"]
    assert (snapshot / "report.md").read_text() == (results / "report.md").read_text()


def test_a_report_that_is_not_whole_is_not_taken(results, tmp_path):
    (results / "figures" / "a.png").unlink()
    with pytest.raises(SystemExit, match=r"figures of the report are missing: a\.png"):
        _taker().take(results, tmp_path / "snapshot")
    with pytest.raises(SystemExit, match="run make studies first"):
        _taker().take(tmp_path, tmp_path / "snapshot")
    assert not (tmp_path / "snapshot").exists()


def test_the_stored_snapshot_is_whole():
    folder = ROOT / "docs" / "snapshot"
    shown = set(_taker().SHOWN.findall((folder / "report.md").read_text(encoding="utf-8")))
    assert shown == {path.name for path in (folder / "figures").iterdir()}


REPORT = """# T

![A](figures/a.png)

All: [table](tables/a-b.csv), [CSV](tables/c.csv).

<!-- table a-b -->

Data: [a.nc](a.nc).
"""


def test_what_is_not_tracked_is_not_linked(results, tmp_path):
    (results / "report.md").write_text(REPORT)
    _taker().take(results, tmp_path / "snapshot")
    text = (tmp_path / "snapshot" / "report.md").read_text()
    assert "All: table, CSV.\n\nData: a.nc.\n" in text
    assert "![A](figures/a.png)" in text


def test_what_pages_quote_is_what_the_stored_report_says():
    report = (ROOT / "docs" / "snapshot" / "report.md").read_text(encoding="utf-8")
    for name, said in _taker().quoted(report).items():
        page = (ROOT / name).read_text(encoding="utf-8")
        assert _taker().quote(said, page) == page, name


@pytest.mark.parametrize("name", ["bench", "peers"])
def test_what_a_page_says_of_a_benchmark_is_what_that_has_stored(name, tmp_path):
    taker, page = _taker(), (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    said = taker.benchmark(name, ROOT / "results")
    assert taker.quote(said, page, taker.STORED_BY[name]) == page
    stored = (ROOT / "results" / f"{name}.json").read_text(encoding="utf-8")
    (tmp_path / f"{name}.json").write_text(stored.replace("0.3.0", "9.9.9").replace('"version": "0', '"version": "9'))
    assert taker.benchmark(name, tmp_path) != said


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="this is no checkout")
def test_what_a_run_of_the_studies_writes_is_not_tracked():
    written = "convergence.nc convergence.json report.md report.html figures/x.png tables/x.csv cases/x/y.npz"
    paths = [f"results/{name}" for name in written.split()]
    done = subprocess.run(["git", "check-ignore", *paths], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stdout.split() == paths
    kept = subprocess.run(["git", "ls-files", "results"], cwd=ROOT, capture_output=True, text=True, check=True)
    benchmarks = (
        "bench.json", "live-engines.json", "peers.json", "horizon.json", "repeat.json", "guard.json", "peers.nc",
        "figures/guard-curves.png", "figures/peers-fronts.png",
    )  # fmt: skip
    assert set(kept.stdout.split()) == {f"results/{name}" for name in benchmarks}
    shown = [
        f"results/figures/{picture['file']}"
        for name in benchmarks[:3]
        for picture in json.loads((ROOT / "results" / name).read_text(encoding="utf-8")).get("pictures", [])
    ]
    assert shown  # without them `make studies` on a fresh checkout would end without its report
    assert {*shown} <= set(kept.stdout.split())
