"""The reference: its bound is never below the true error, hardly above it, and its cache cannot lie."""

import functools
import math
import os
import random
import subprocess
import sys
import timeit
import warnings

import numpy as np
import pytest
import xarray as xr
from mpmath import mp, mpf, workdps

import symtop
from benchmarks.families import tops
from symtop.model import charts, scenes
from symtop.model.exact import closed_form
from symtop.model.exact.constants import RATE
from symtop.model.exact.digits import PreciseForm
from symtop.run.reference.independent_checks import check_times, integrate, integrate_with_checks
from symtop.run.reference.truth import UNCERTIFIED, Certificate, closed_bounds, closed_values


@functools.cache
def true_values(scene, times):
    """Quaternion and theta of the closed form in 50 digits, at each time."""
    precise = PreciseForm(scene.top, scene.start, digits=50)
    return [(precise.quaternion(t), precise(t).theta) for t in times]


def true_errors(scene, data):
    """Attitude, axis and theta errors of each value, hi + lo, against the closed form in 50 digits."""
    rows = []
    with workdps(60):
        for k, (q, theta) in enumerate(true_values(scene, tuple(data["time"].values.tolist()))):

            def value(name, *part, k=k):
                low = data[f"{name}_lo"].values[(k, *part)] if f"{name}_lo" in data else 0.0
                return mpf(float(data[name].values[(k, *part)])) + mpf(float(low))

            quaternion = [value("quaternion", j) for j in range(4)]
            sign = 1 if sum(a * b for a, b in zip(quaternion, q, strict=True)) > 0 else -1
            attitude = 2 * mp.norm([sign * a - b for a, b in zip(quaternion, q, strict=True)])
            w, x, y, z = q
            axis = [2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z]
            tilt = mp.norm([value("axis", j) - axis[j] for j in range(3)])
            rows.append([float(attitude), float(tilt), abs(float(value("theta") - theta))])
    return np.array(rows).T


KINDS = ("generic", "fast", "slow", "retrograde", "grazes the top", "grazes the bottom", "flat body", "nearly steady",
         "near the separatrix")  # fmt: skip


@pytest.mark.parametrize(("precision", "count", "seed"), [
    ("longdouble", 1, 11), ("double", 1, 11), ("closed-form", 1, 11),
    *(pytest.param(precision, 56, 2026, marks=pytest.mark.slow) for precision in ("longdouble", "closed-form")),
])  # fmt: skip
def test_bounds_hold_on_random_tops_and_are_tight(precision, count, seed):
    """Of so many tops of each kind; a fast one as long as it takes for as many turns."""
    draw, ratios = random.Random(seed), []
    for k, (top, start) in enumerate(tops(count, seed, KINDS)):
        scene = symtop.Scene(f"{KINDS[k // count]}-{k}".replace(" ", "-"), top, start, 1.0)
        horizon = draw.choice((1.0, 30.0, 1000.0)) * draw.uniform(0.3, 1.0) / max(1.0, abs(start.psi_dot) / 90.0)
        times = np.sort([draw.uniform(0.0, horizon) for _ in range(4)] + [horizon])
        data = symtop.reference(scene, times, precision)
        for name, error in zip(("attitude", "axis", "theta"), true_errors(scene, data), strict=True):
            bound = data[f"{name}_error_bound"].values
            worst = int(np.argmax(error / bound))
            assert np.all(error <= bound), f"{scene.name} {name} at {times[worst]}: {error[worst]} > {bound[worst]}"
            ratios += list(bound / np.maximum(error, 1e-40))
    assert np.median(ratios) < 100.0


@pytest.mark.parametrize("name", ["spheroid", "goldstein", "fast", "cusp"])
def test_the_bound_of_the_closed_form_holds_the_rounding_and_the_rates(name):
    """Twice what `benchmarks/accuracy.py` finds, and at most ten times; of a rate, times time and angular velocity."""
    scene, times = symtop.scene(name), np.array([0.0, 1e14])
    motion = scenes.closed_form(scene)(np.linspace(0.0, scene.nutation_period, 400))
    across = motion.phi_dot * np.sin(motion.theta)
    along = motion.psi_dot + motion.phi_dot * np.cos(motion.theta)
    fastest = np.sqrt(motion.theta_dot**2 + across**2 + along**2).max()
    bounds = closed_bounds(scene, times, closed_values(scene, times))
    for quantity, rounding in {"theta": 7.1e-16, "axis": 8.8e-16, "attitude": 8.8e-16}.items():
        assert bounds[quantity][0] >= 2.0 * rounding
        assert 1.0 <= np.diff(bounds[quantity]) / (RATE * times[1] * fastest) < 10.0
    assert min(bounds["phi"][0], bounds["psi"][0]) >= 2.0 * 4.8e-16


def test_an_integration_that_differs_from_the_closed_form_has_the_distance_as_its_bound(monkeypatch):
    module = sys.modules["symtop.run.reference.truth"]
    scene, times = symtop.scene("goldstein"), np.array([1.0, 2.0, 3.0])
    perturbed = lambda *args: (values := closed_values(*args)) | {"theta": values["theta"] + 1e-9}
    for values, low, high in ((perturbed, 0.99e-9, math.inf), (closed_values, 0.0, 1e-15)):
        monkeypatch.setattr(module, "closed_values", values)
        bound = module._integration(scene, times, "longdouble")["theta_error_bound"]
        assert np.all((bound >= low) & (bound < high))


def test_a_bound_too_small_would_be_seen_and_times_at_which_it_is_read_change_no_bit():
    """The negative control: the same check with the bound of a method a thousand times better fails."""
    scene = symtop.scene("spheroid")
    data = symtop.reference(scene, [3.0, 500.0, 1000.0], "longdouble")
    assert not np.all(true_errors(scene, data)[0] <= data["attitude_error_bound"].values / 1000.0)
    scene = symtop.scene("goldstein")  # the study of the truth reads an error and its bound off one integration
    for precision in ("double", "longdouble", "quad"):
        times = np.array([3.0, 11.0, 20.0])
        result, expected = integrate_with_checks(scene, times, precision), integrate(scene, times, precision)[0]
        assert (result.states[result.chosen] == expected).all()
        assert (result.axes == charts.axis_from_quaternion(expected[:, :4])).all()


def test_a_certificate_that_contradicts_the_bounds_raises_them(monkeypatch, cache):
    """One of a witness that is 1e-6 away, one of an error three times its bound, and one that finds nothing."""
    module, times = sys.modules["symtop.run.reference.truth"], [1.0, 2.0, 3.0]
    base, quantities = symtop.reference("goldstein", times), ("axis", "attitude", "theta", "phi", "psi")
    for record, floor, factor in (
        (Certificate(1e6, 30, 0.3, 100.0, 0.0, 1e-6), 1e-6, 1.0),
        (Certificate(1e6, 30, 0.3, 100.0, 1e-6, math.nan), 1e-6, 1.0),
        (Certificate(1e6, 30, 3.0, math.nan, math.nan, math.nan), 0.0, 24.0),
        (Certificate(1e6, 30, 0.9, 100.0, 1e-15, 1e-15), 0.0, 1.0),
    ):
        monkeypatch.setattr(module, "certificate", lambda *_, record=record: record)
        data = symtop.reference("goldstein", times)
        for name in quantities:
            expected = factor * base[f"{name}_error_bound"].values + floor
            np.testing.assert_allclose(data[f"{name}_error_bound"], expected, rtol=1e-12)
        assert data.attrs["certificate"] == str(record)


@pytest.mark.parametrize("name", ["spheroid_ieee", "goldstein_at_rest_ieee"])
def test_quadruple_precision_has_24_digits_at_t_8(truth, name):
    data = symtop.reference(symtop.scene("spheroid" if name.startswith("spheroid") else "goldstein"), [8.0], "quad")
    with workdps(40):
        for quantity in ("theta", "phi", "psi"):
            value = mpf(float(data[quantity][0])) + mpf(float(data[f"{quantity}_lo"][0]))
            assert abs(value - mpf(truth[name]["state"][quantity])) < 1e-24
    assert float(data["theta_error_bound"][0]) < 1e-24


def test_a_long_reference_takes_milliseconds_and_states_what_it_rests_on(cache):
    """1001 times up to 1e5 took half a minute by integration; the certificate is made once and told afterwards."""
    closed_form.compile_now()
    times = np.linspace(0.0, 1e5, 1001)
    data = symtop.reference("spheroid", times)
    assert min(timeit.repeat(lambda: symtop.reference("spheroid", times), number=1, repeat=7)) < 0.01
    assert (data.attrs["precision"], data.attrs["certificate"]) == ("closed-form", UNCERTIFIED)
    assert data.attrs["arithmetic"] == "constants in double-double, values in double"
    assert not list(cache.glob("reference/*.nc"))
    assert float(data["theta_error_bound"].max()) < 3e-15
    certified = symtop.reference("spheroid", times, certify="integration")
    assert certified.attrs["certificate"].startswith("40 digits at 32 times up to t = 1.18e+06")
    assert "long double integration up to t = 118" in certified.attrs["certificate"]
    assert len(list(cache.glob("reference/*.nc"))) == 1
    repeat = symtop.reference("spheroid", times)
    assert repeat.identical(certified)
    assert repeat.equals(data)
    assert min(timeit.repeat(lambda: symtop.reference("spheroid", times), number=1, repeat=7)) < 0.01


@pytest.mark.parametrize("damage", ["truncated", "zeros", "empty", "foreign", "one value changed"])
def test_a_damaged_cache_file_is_noticed_said_and_computed_again(cache, damage):
    times = np.linspace(0.0, 5.0, 21)
    expected = symtop.reference("spheroid", times, "longdouble")
    (path,) = cache.glob("reference/*.nc")
    content = path.read_bytes()
    if damage == "one value changed":
        with xr.open_dataset(path) as data:
            changed = data.load()
        changed["theta"][3] += 1e-9
        changed.to_netcdf(path)
    else:
        half, zeros = content[: len(content) // 2], b"\0" * len(content)
        path.write_bytes({"truncated": half, "zeros": zeros, "empty": b"", "foreign": b"GIF89a"}[damage])
    with pytest.warns(symtop.SymtopWarning, match="is damaged and is computed again"):
        assert symtop.reference("spheroid", times, "longdouble").equals(expected)
    assert symtop.reference("spheroid", times, "longdouble").equals(expected)  # and mended on disk, in silence


CALL = """
import os, sys
import numpy as np
import symtop
from pathlib import Path
if len(sys.argv) > 1:
    Path.replace = lambda *_: os.kill(os.getpid(), 9)  # dies with the new file written and not yet in its place
data = symtop.reference("spheroid", np.linspace(0.0, 5.0, 21), "longdouble")
print(repr(float(data["theta"][-1])))
"""


def call(cache, *arguments):
    environment = {**os.environ, "SYMTOP_CACHE": str(cache)}
    return subprocess.Popen([sys.executable, "-W", "error", "-c", CALL, *arguments], env=environment,
                            stdout=subprocess.PIPE, text=True)  # fmt: skip


@pytest.mark.slow
def test_a_process_killed_while_it_writes_the_cache_harms_nobody_and_several_share_it(cache):
    process = call(cache, "die")
    process.communicate(timeout=120)
    assert process.returncode == -9
    parts = list(cache.glob("reference/.*.part"))
    assert not list(cache.glob("reference/*.nc"))
    processes = [call(cache) for _ in range(2)]
    values = [float(process.communicate(timeout=120)[0]) for process in processes]
    assert [process.returncode for process in processes] == [0, 0]
    assert len(list(cache.glob("reference/*.nc"))) == 1
    assert list(cache.glob("reference/.*.part")) == parts  # of the killed one alone
    assert values == [float(symtop.reference("spheroid", np.linspace(0.0, 5.0, 21), "longdouble")["theta"][-1])] * 2


def test_a_cache_that_cannot_be_written_costs_time_and_nothing_else(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    monkeypatch.setenv("SYMTOP_CACHE", str(blocked))
    with pytest.warns(symtop.SymtopWarning, match="is not kept"):
        assert np.isfinite(symtop.reference("spheroid", [0.5, 2.0], "longdouble")["theta"]).all()


@pytest.mark.parametrize("precision", ["closed-form", "longdouble"])
def test_any_order_and_repeated_times_come_back_as_asked(precision):
    data = symtop.reference("spheroid", [3.0, 0.0, 3.0, 1.0], precision)
    assert list(data["time"].values) == [3.0, 0.0, 3.0, 1.0]
    assert data["theta"].values[0] == data["theta"].values[2]
    assert data["theta"].values[1] == pytest.approx(0.4, abs=1e-16)


def test_without_heyoka_the_closed_form_stands_in_and_says_so(monkeypatch, cache):
    monkeypatch.setitem(sys.modules, "heyoka", None)
    with pytest.warns(symtop.SymtopWarning, match="heyoka is not installed: the closed form in double stands in for"):
        data = symtop.reference("spheroid", [1.0, 2.0, 7.77], "longdouble")
    assert (data.attrs["precision"], data.attrs["asked_for"]) == ("closed-form", "longdouble")
    assert np.all(data["theta_error_bound"] < 1e-13)
    with warnings.catch_warnings(action="error"):
        symtop.reference("spheroid", [1.0])
    with pytest.warns(symtop.SymtopWarning, match="is certified without an integration"):
        data = symtop.reference("spheroid", [1.0], certify="integration")
    assert "40 digits" in data.attrs["certificate"]
    assert "integration" not in data.attrs["certificate"]


def test_checks_reach_the_horizon_and_a_certificate_is_of_a_known_kind_and_of_the_closed_form():
    scene = symtop.scene("spheroid")
    checks, form = check_times(scene, 17.0), scenes.closed_form(scene)
    assert checks[-1] == 17.0
    assert np.all(np.diff(checks) > 0.0)
    assert np.abs(form(checks).theta_dot).max() > 0.98 * np.abs(form(np.linspace(0.0, 1.2, 500)).theta_dot).max()
    with pytest.raises(symtop.SymtopError, match="certify 'twice' is unknown"):
        symtop.reference("spheroid", [1.0], certify="twice")
    with pytest.raises(symtop.SymtopError, match="certify is for the closed form"):
        symtop.reference("spheroid", [1.0], "quad", certify="digits")
