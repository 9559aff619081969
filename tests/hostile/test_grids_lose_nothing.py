"""A study in its ordinary grid and in its full one: neither deletes what the other computed."""

import pytest

from symtop.runner import run as runner
from symtop.runner.run import run

SCRIPT = """
import xarray as xr
from symtop.runner.study import Case, Study
GRID = {"quick": ["midpoint"], "usual": ["midpoint", "strang"], "full": ["rk4", "gauss-4"]}
def cases(quick):
    return [Case("spheroid", name, {}) for name in GRID["quick" if quick else "usual"]]
def full():
    return [Case("spheroid", name, {}) for name in GRID["full"]]
def measure(case):
    return xr.Dataset({"one": 1.0})
STUDY = Study("grids", "t", "q", "h", cases, measure, lambda data: [], lambda data: ["It ran."], full=full)
"""


@pytest.fixture
def study(tmp_path):
    script = tmp_path / "grids.py"
    script.write_text(SCRIPT)
    return runner.load(str(script))


def cases_in(results):
    return {path.name: (path.stat().st_ino, path.stat().st_mtime_ns) for path in results.rglob("cases/*/*.npz")}


@pytest.mark.parametrize("order", [(False, True), (True, False)])
def test_four_are_computed_and_four_are_left(study, tmp_path, order):
    """The ordinary grid and the full one had two cases each, and two of four were left."""
    results, computed, kept = tmp_path / "r", 0, {}
    for full in (*order, *order):
        computed += run(study, results, full=full)["computed"]
        assert kept.items() <= cases_in(results).items()
        kept = cases_in(results)
    assert (computed, len(kept)) == (4, 4)
