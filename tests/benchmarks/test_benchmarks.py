"""The benchmarks measure what they say: twins are twins, and what was measured stays in the report with its date."""

import math
import os

import numpy as np
import pytest

from benchmarks import adaptive, candidates, ensemble, guard, kernels, lanes, machines, truth, twin
from symtop.measure.timing import timings
from symtop.methods.framework import loop as loops
from symtop.methods.framework.lanes import Many
from symtop.methods.framework.loop import inside
from symtop.methods.framework.registry import methods
from symtop.model import charts
from symtop.model.exact.closed_form import ClosedForms

KEYS = kernels.keys()
STEPS = 500
FEW = [("stormer-verlet", "angles"), ("symplectic-euler", "angles"), ("takahashi-imada", "attitude"), ("rk4", "axis"),
       ("exact-discrete", "axis")]  # fmt: skip
needs_gcc = pytest.mark.skipif(twin.compiler() is None, reason="the twins are built with gcc")


def test_every_compiled_fixed_step_kernel_has_a_twin_and_every_twin_a_kernel():
    assert {inside(methods()[name].solvers[chart]).loop for name, chart in KEYS} == set(twin.FAMILIES)


@needs_gcc
@pytest.mark.parametrize("key", [key if key in FEW else pytest.param(key, marks=pytest.mark.slow) for key in KEYS])
def test_every_twin_returns_the_same_bits(key):
    assert twin.difference(kernels.kernel(key), STEPS) == 0.0


@needs_gcc
def test_a_kernel_that_leaves_its_chart_is_timed_up_to_there(monkeypatch):
    monkeypatch.setattr(kernels, "keys", lambda: [("euler", "angles"), ("euler", "axis"), *FEW])
    assert [row.difference for row in kernels.measure()] == [0.0] * (2 + len(FEW))


@needs_gcc
def test_the_comparison_sees_one_wrong_rounding_and_a_twin_that_leaves_the_chart():
    kernel = kernels.kernel(("strang", "axis"))  # with one kick, which begins the step: its force is for the next one
    assert twin.difference(kernel._replace(rule=kernel.rule._replace(kick=(kernel.h, 0.0))), STEPS) == 0.0
    kernel = kernels.kernel(("stormer-verlet", "angles"))
    nudged = np.nextafter(kernel.rule.drift[0], 1.0)
    nudged_twin = twin.Twin(kernel._replace(rule=kernel.rule._replace(drift=(nudged,))), twin.EXACT)
    assert np.any(nudged_twin.shown(STEPS)[0] != twin.ours(kernel, STEPS)[0])
    with pytest.raises(RuntimeError, match="stopped after"):
        twin.Twin(kernel._replace(state=(0.01, -9.0, 0.0, 0.0)), twin.EXACT)(STEPS)


@needs_gcc
@pytest.mark.slow
@pytest.mark.parametrize("key", [
    ("stormer-verlet", "angles"), ("strang", "axis"), ("midpoint", "angles"), ("rk4", "axis"),
    ("dop853-compiled-fixed", "axis"), ("gauss-6", "axis"), ("gauss-2", "attitude"),  # the last adds nine components
], ids="-".join)  # fmt: skip
def test_a_kernel_takes_at_most_a_quarter_more_than_its_twin(key):
    kernel, steps = kernels.kernel(key), 8000
    twins = [twin.Twin(kernel, flags) for flags in (twin.FAST, twin.EXACT)]
    calls = [lambda: twin.ours(kernel, steps), *(lambda run=run: run(steps) for run in twins)]
    ours, fused, exact = timings(calls, batches=60, batch=1e-3)
    assert ours.best < kernels.LIMIT * min(fused.best, exact.best)


def test_the_tops_that_lanes_are_timed_on_stay_in_lanes_and_reach_the_error():
    """A member that is given up would be timed alone; the closed form says how far the others are off."""
    solver, numbers, steps = lanes.solver_of(*lanes.RIVAL), lanes.members(), 45
    h, marks = np.full(lanes.MEMBERS, lanes.HORIZON / steps), np.full((lanes.MEMBERS, 1), steps)
    results, whole = Many.empty(lanes.MEMBERS, 1, 6), solver._whole
    assert whole.blocks().run(np.arange(lanes.MEMBERS), numbers, whole.rule, h, marks, results, loops.BLOCK).size == 0
    true = ClosedForms(numbers).axis(np.full((lanes.MEMBERS, 1), lanes.HORIZON))[:, 0]
    assert 1e-8 < charts.axis_distance(results.states[:, 0, :3], true).max() < 2e-6
    assert len(np.unique(true, axis=0)) == lanes.MEMBERS  # neighbours, not copies


@needs_gcc
@pytest.mark.slow
def test_an_ensemble_costs_little_around_its_steps_and_a_closed_form_ten_microseconds():
    """Ratios within one run: what is around the steps is 5 us on the machine that makes 1000 of them in 4.4."""
    seconds = {item.name: item.seconds for item in ensemble.measure()}
    assert seconds["`ensemble`, axis and energy"] - seconds["of it: the steps"] < 1.1 * seconds["of it: the steps"]
    assert seconds["`simulate`"] > 50.0 * seconds["`ensemble`, axis and energy"]
    # Where Verlet in C takes 30 ns a step: half of the calls below 10 us, 99 % below 30, in both arithmetics; 40 digits
    # take a thousand times as long. Tests beside this one slow both down, alike: then that ratio alone counts.
    verlet = twin.Twin(kernels.kernel(("stormer-verlet", "angles")))
    slower = timings([lambda: verlet(8000)], batches=60, batch=1e-3)[0].best / 8000 / 30e-9
    short, long, digits, *rows = truth.measure()
    for row in (short, long):
        assert row.median < 1e-3 * digits.median
        if "PYTEST_XDIST_WORKER" not in os.environ:
            assert row.median < 10e-6 * slower
            assert row.slow < 30e-6 * slower
    assert digits.median > 1e-3
    samples = [row for row in rows if row.name.startswith("one sample")]
    assert len(samples) == 6
    assert all(row.median < 1e-6 for row in samples)
    constants, repeat, of_body = (row for row in rows if row not in samples)
    assert max(constants.median, of_body.median) < 10e-6 * slower  # of one among many
    assert repeat.median < 10e-3  # a reference at 1001 times, asked for again


@needs_gcc
@pytest.mark.parametrize("chart", ["axis", pytest.param("attitude", marks=pytest.mark.quick)])
def test_the_adaptive_loop_in_c_takes_the_same_steps(chart):
    row = adaptive.measure(chart, 1e-8, nutations=10.0, batches=2)
    assert row.steps[0] == row.steps[1]
    assert row.evaluations[0] == row.evaluations[1] + 3  # for the sample at the end
    assert row.difference < 1e-9


@needs_gcc
@pytest.mark.slow
@pytest.mark.parametrize("chart", ["angles", "axis", "attitude"])
def test_an_adaptive_evaluation_takes_at_most_six_tenths_more_than_in_c(chart):
    assert adaptive.measure(chart, 1e-6).ratio < 1.6


@pytest.mark.parametrize(("arguments", "words"), [
    ("check 0", "scenes must be at least 1, not 0"), ("check few", "invalid int value: 'few'"),
    ("make missing.nc", "cannot read missing.nc"), ("", "required: action"),
])  # fmt: skip
def test_a_wrong_call_of_the_table_of_candidates_is_one_sentence(arguments, words, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["candidates", *arguments.split()])
    with pytest.raises(SystemExit, match="2"):
        candidates.main()
    assert words in capsys.readouterr().err


def test_what_one_processor_chooses_is_priced_on_another():
    def row(called=True, target=1e-3, **seconds):
        return [{"needs": "derivative", "keeping": False, "target": target, "called": called, "seconds": seconds}]

    reference = row(b=1.0, a=1.5, called=False)
    pairs = [machines.compare(row(**seconds), reference) for seconds in ({"a": 2.0, "b": 3.2}, {"b": 2.0}, {"c": 1.0})]
    nan = pytest.approx(math.nan, nan_ok=True)
    assert [tuple(pair[:5]) for pair in pairs[:2]] == [(1, 0, 1, 0, 1.6), (1, 1, 1, 1, nan)]
    assert pairs[0].differing == [["f(t, y), to 10\N{SUPERSCRIPT MINUS}³ rad", "a", "b", "1.5", "1.6"]]
    assert pairs[2].differing[0][3:] == ["over 10", "not kept"]
    more = {name: [*row(a=1.0), *row(target=1e-6, **{name: 1.0}), *row(target=1e-12, **{name: 1.0})] for name in "ab"}
    kept = [{"choices": rows} for rows in (row(a=1.0), *more.values(), [])]  # as many are the same, of one or of two
    assert machines.least_alike(kept)[2][:2] == (2, 1)
    assert machines.least_alike(kept[2:]) is None


def test_the_ablation_of_the_guard_misses_a_run_whose_error_adds_up_beyond_its_probe(monkeypatch):
    scene, method = guard.tops(1)[0], methods()["midpoint"]
    plan, _ = guard.make_plan(scene, method, (period := scene.nutation_period) / 60, horizon=300 * period, samples=101)
    monkeypatch.setattr(guard, "drawn", lambda *_: (scene, method, "angles", plan))
    missed = [row[0] for row in guard.ablation("tops", 1).rows if row[1] == "1 of 1"]
    assert missed == ["less: errors grow beyond the probe"]
