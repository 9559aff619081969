"""The benchmarks measure what they say: twins are twins, and what was measured stays in the report with its date."""

import numpy as np
import pytest

from benchmarks import bench, kernels, measured, targets, truth, twin, whole_run
from symtop.measure.timing import Timing, timings
from symtop.report import page
from symtop.runner import store

KERNELS = kernels.kernels()
STEPS = 500
needs_gcc = pytest.mark.skipif(twin.compiler() is None, reason="the twins are built with gcc")


# ---- C twins ---------------------------------------------------------------------------------------------------------


def test_every_compiled_fixed_step_kernel_has_a_twin():
    assert {kernel.march for kernel in KERNELS.values()} <= set(twin.FAMILIES)
    assert {kernel.march for kernel in KERNELS.values()} == set(twin.FAMILIES), "a twin of nothing"


@needs_gcc
@pytest.mark.parametrize("key", [("stormer-verlet", "angles"), ("takahashi-imada", "attitude"), ("rk4", "axis")])
def test_a_twin_returns_the_same_bits(key):
    assert twin.difference(KERNELS[key], STEPS) == 0.0


@needs_gcc
@pytest.mark.slow
@pytest.mark.parametrize("key", KERNELS, ids="-".join)
def test_every_twin_returns_the_same_bits(key):
    assert twin.difference(KERNELS[key], STEPS) == 0.0


@needs_gcc
def test_the_comparison_sees_one_wrong_rounding():
    kernel = KERNELS["stormer-verlet", "angles"]
    nudged = np.nextafter(kernel.rule.drift[0], 1.0)
    other = twin.Twin(kernel._replace(rule=kernel.rule._replace(drift=(nudged,))), twin.EXACT)
    assert np.any(other.shown(STEPS)[0] != twin.ours(kernel, STEPS)[0])


@needs_gcc
def test_a_twin_that_leaves_the_chart_says_so():
    kernel = KERNELS["stormer-verlet", "angles"]
    with pytest.raises(RuntimeError, match="stopped after"):
        twin.Twin(kernel._replace(state=(0.01, -9.0, 0.0, 0.0)), twin.EXACT)(STEPS)


@needs_gcc
@pytest.mark.slow
@pytest.mark.parametrize(
    "key",
    [
        ("stormer-verlet", "angles"),
        ("strang", "axis"),
        ("midpoint", "angles"),
        ("rk4", "axis"),
        ("gauss-6", "axis"),
        ("gauss-2", "attitude"),  # nine components: the widest state that the loop adds up
    ],
    ids="-".join,
)
def test_a_kernel_takes_at_most_a_quarter_more_than_its_twin(key):
    kernel, steps = KERNELS[key], 8000
    other = twin.Twin(kernel)
    ours, theirs = timings([lambda: twin.ours(kernel, steps), lambda: other(steps)], batches=60, batch=1e-3)
    assert ours.best / theirs.best < kernels.LIMIT


def test_a_ratio_carries_the_spread_of_its_fifths():
    ours, theirs = Timing((2.0, 2.2, 2.0, 2.0, 3.0), 0.0), Timing((1.0, 1.0, 1.0, 1.0, 1.0), 0.0)
    assert kernels.ratio(ours, theirs) == (2.0, 2.0, 3.0)


def test_what_the_benchmark_leaves_is_what_the_report_shows(tmp_path):
    rows = [kernels.Row("midpoint", "angles", 200.0, 0.01, 180.0, 1.11, 1.1, 1.3, 0.0, 2.2),
            kernels.Row("gauss-8", "axis", 900.0, 0.01, 600.0, 1.5, 1.4, 1.6, 1e-16, 9.9)]  # fmt: skip
    facts = measured.circumstances() | {"measured": "2001-02-03", "processor": "an abacus"}
    forms = [truth.Row("set-up and one sample, double-double", 4.9e-6, 6.4e-6)]
    names = ("simulate", "guard", "solver, every step shown")
    items = [whole_run.Item(name, 1e-6 * 10**k, 10.0**k) for k, name in enumerate(names)]
    reached, one_step = [targets.Reached("rk4", 99, 1e-5, 400.0)], {"rk4[axis]": 2.25e-6, "gauss-2[axis]": 3e-6}
    content = bench.findings(rows, {}, forms, reached, items, one_step, 1e-9, facts)
    store.write_json(tmp_path / "bench.json", content)
    text = page.write(tmp_path).read_text()
    markdown = (tmp_path / "report.md").read_text()
    for words in (
        "1 of 2 kernels are within 1.25 times their C twin",
        "set-up and one sample, double-double",
        "gauss-8[axis] 1.50",
        "3.0 us at most, with gauss-2[axis]",
        "2001-02-03",
        "an abacus",
    ):
        assert words in text
        assert words in markdown


# ---- the closed form -------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_closed_form_is_set_up_and_sampled_in_ten_microseconds():
    """Half of the calls below 10 us, 99 % below 30 us, in both arithmetics; 40 digits take milliseconds."""
    short, long, digits, *samples = truth.measure()
    for row in (short, long):
        assert row.median < 10e-6
        assert row.slow < 30e-6
    assert digits.median > 1e-3
    assert all(row.median < 1e-6 for row in samples)
