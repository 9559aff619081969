"""The benchmarks measure what they say: twins are twins, peers are judged like us, and a peer that wins is named."""

import ctypes
import sys

import numpy as np
import pytest
import xarray as xr

import symtop
from benchmarks import kernels, peers, twin
from benchmarks.peers import common, measure, summary
from symtop.measure.timing import Timing, timings
from symtop.methods.space import field_axis
from symtop.runner import run, store

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


# ---- peers -----------------------------------------------------------------------------------------------------------


def test_all_right_hand_sides_of_the_peers_are_the_kernels_own():
    scene = symtop.scene("spheroid")
    y = common.start_of(scene.top, scene.start)
    par, _ = common.on_axis(scene.top, scene.start)
    expected = np.array(field_axis(par, tuple(y)))
    assert np.allclose(common.python_field(scene.top)(0.0, y), expected, rtol=1e-15, atol=0.0)
    assert np.allclose(common.compiled_field(scene.top)(0.0, y), expected, rtol=1e-15, atol=0.0)
    filled, through_c = np.empty(6), np.empty(6)
    common.filling_field(scene.top)(0.0, y, filled)
    common.c_field(scene.top).ctypes(
        None, *(row.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for row in (through_c, y)), 0.0
    )
    assert np.allclose(filled, expected, rtol=1e-15, atol=0.0)
    assert np.array_equal(through_c, filled)


def test_a_peer_that_is_not_installed_is_named_and_skipped(monkeypatch):
    for module in ("diffrax", "mujoco"):
        monkeypatch.setitem(sys.modules, module, None)  # an import of it fails
    found, missing = peers.load(("diffrax", "scipy", "mujoco"))
    assert {peer.package for peer in found} == {"scipy"}
    assert [sentence.split()[0] for sentence in missing] == ["diffrax", "mujoco"]
    assert all("skipped" in sentence for sentence in missing)


def test_nothing_is_missing_where_everything_is_there():
    found, missing = peers.load(("scipy", "odeint"))
    assert missing == []
    assert len(found) == 10


def test_odeint_takes_the_steps_of_solve_ivps_lsoda_and_names_its_distribution():
    scene, found = symtop.scene("spheroid"), peers.load(("scipy", "odeint"))[0]
    by_name = {peer.method.name: peer for peer in found}
    new, old = (measure.accuracy(scene, by_name[name].method, 1e-9)
                for name in ("scipy-lsoda-numba", "scipy-odeint-numba"))  # fmt: skip
    assert old.error == pytest.approx(new.error, rel=0.1)
    assert old.evaluations == pytest.approx(new.evaluations, rel=0.01)
    assert by_name["scipy-odeint-numba"].distribution == "scipy"


def test_an_odeint_that_gives_up_is_a_failure_and_not_a_row_of_zeros(monkeypatch):
    scene, found = symtop.scene("spheroid"), peers.load(("odeint",))[0]
    monkeypatch.setattr("benchmarks.peers.adapters.odeint.MOST_STEPS", 5)
    with pytest.warns(Warning, match="Excess work"):
        assert np.isnan(measure.accuracy(scene, found[0].method, 1e-9).error)


def test_a_peers_error_falls_with_its_tolerance():
    scene = symtop.scene("spheroid")
    method = next(peer.method for peer in peers.load(("scipy",))[0] if peer.method.name == "scipy-dop853-python")
    coarse, fine = (measure.accuracy(scene, method, tolerance) for tolerance in (1e-4, 1e-10))
    assert coarse.error > 1e-4
    assert fine.bound < fine.error < 1e-7


def test_the_search_finds_the_loosest_setting():
    scene, method = symtop.scene("goldstein"), symtop.integrator("takahashi-imada")
    points = measure.worth_timing(measure.search(scene, method, (1e-6,)), (1e-6,))
    meets = next(point for point in points if point.error <= 1e-6)
    assert measure.accuracy(scene, method, 1.15 * meets.setting).error > 1e-6
    assert points == sorted(points, key=lambda point: -point.error)


def test_compiling_is_not_taken_for_a_slow_solver(monkeypatch):
    """The first call of a jitted solver takes seconds; the ladder goes on all the same, until a run is slow itself."""
    scene, method = symtop.scene("spheroid"), symtop.integrator("rk4")
    calls = []

    def run(_scene, _method, setting):
        calls.append(setting)
        slow = len(calls) == 1 or len(calls) == 6
        return measure.Point(setting, 1.0, 0.0, 1, 1, 9.0 if slow else 0.0)

    monkeypatch.setattr(measure, "accuracy", run)
    assert len(measure.search(scene, method)) == 5
    assert calls[0] == calls[1]


def _stored(times: dict[str, float], spread: float = 0.01) -> xr.Dataset:
    """A dataset as `measure` leaves it: one scene, one solver a package, three targets met by one setting."""
    names, batches = list(times), 10
    wobble = 1.0 + spread * np.arange(batches) / batches
    samples = np.array([[[time * wobble] for time in times.values()]])
    flat = samples.min(axis=-1)
    return xr.Dataset(
        {
            "axis": (("scene", "integrator", "setting"), np.where(np.isfinite(flat), 1e-10, np.nan)),
            "seconds": (("scene", "integrator", "setting"), flat),
            "first_call": (("scene", "integrator", "setting"), flat),
            "seconds_samples": (("scene", "integrator", "setting", "batch"), samples),
            "package": ("integrator", names),
            "version": ("integrator", ["1"] * len(names)),
            "formulation": ("integrator", ["as it is"] * len(names)),
            "implementation": ("integrator", ["compiled"] * len(names)),
        },
        coords={"scene": ["spheroid"], "integrator": [f"{name}-one" for name in names]},
    )


def test_the_verdict_names_winners_losers_and_ties():
    said = summary.verdict(
        _stored({"symtop": 1e-4, "scipy": 2e-2, "rebound": 5e-5, "diffrax": 1.05e-4, "drake": np.nan, "mujoco": 1e-1})
    )
    assert "is at least 200 (200 to 200) and up to 200 times faster than the best of SciPy's solve_ivp." in said[0]
    assert said[1] == "Times faster than SciPy: symtop's own kernels alone 200 to 200."
    assert "level with diffrax-one on spheroid" in said[2]
    assert "behind rebound-one on spheroid" in said[2]
    assert "ahead in 2 of 6" in said[2]
    assert "no peer is ahead" not in said[2]
    assert "rebound-one 50 us, it is 2 times faster than symtop" in said[3]
    assert "drake does not get there" in said[3]
    assert "mujoco-one 100 ms, symtop is 1e+03 times faster" in said[3]


def test_heyoka_counts_as_offered_but_not_as_our_own_kernel_and_odeint_is_not_solve_ivp():
    said = summary.verdict(_stored({"symtop": 2e-4, "heyoka": 1e-4, "scipy": 2e-2, "scipy-odeint": 6e-3}))
    assert "is at least 200 (" in said[0]
    assert "own kernels alone 100 to 100; against SciPy's older odeint, all methods 60 to 60." in said[1]
    assert "behind heyoka-one" in said[2]
    assert "odeint" not in said[2]


def test_a_small_gain_on_scipy_is_called_small():
    assert summary.verdict(_stored({"symtop": 1e-4, "scipy": 5e-3}))[0].count("less than the wanted 100") == 1


def test_noise_is_not_called_a_win():
    data = _stored({"symtop": 1e-4, "rebound": 1.4e-4})
    data["seconds_samples"].values[0, 0, 0, 0::5] *= 2.0  # one fifth of our batches was slow
    said = summary.verdict(data)
    assert "not told apart from rebound-one" in said[0]
    assert "by so noisy a run" in said[1]


def test_the_report_shows_the_peers(tmp_path):
    from symtop.report import page, style

    data = _stored({"symtop": 1e-4, "scipy": 2e-2})
    findings = run.findings_of(summary.STUDY, data, tmp_path, style.save, failures=["drake was skipped."], cases=2)
    store.write_json(tmp_path / "peers.json", findings)
    text = page.write(tmp_path).read_text()
    assert summary.STUDY.title in text
    assert "times faster than the best of SciPy" in text.replace("&#39;", "'")
    assert "drake was skipped." in text
    (tmp_path / "figures" / "peers-fronts.png").unlink()
    with pytest.raises(symtop.SymtopError, match="make peers"):
        page.write(tmp_path)
