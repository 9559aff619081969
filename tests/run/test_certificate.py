"""Bounds from arithmetic notice a wrong closed form, and certificates are made once, kept, and contradict a lie."""

import math
import sys

import numpy as np
import pytest

from benchmarks.families import tops
from symtop.model import charts
from symtop.model.exact import closed_form as forms, layout as at
from symtop.model.exact.closed_form import ClosedForm
from symtop.model.scenes import Scene, closed_form, scene, scenes
from symtop.model.top import Angles, SymmetricTop
from symtop.run.reference import truth as module
from symtop.run.reference.independent_checks import MAP_STEPS, iterate_map, iterate_map_with_error
from symtop.run.reference.truth import Certificate, certificate, closed_bounds, closed_values, disagreement

TIMES = np.array([0.3, 17.0, 1e3, 1e6])
kind = lambda record: module.KINDS[int(np.isfinite(record[-2:]).sum())]


def test_views_and_integrals_agree_in_every_regime():
    """Rounding stays three digits below what is called suspicious, next to the poles as well."""
    forms.compile_now()
    for case in [*(Scene("drawn", *pair, 1.0) for pair in tops(20, seed=41)), *scenes().values()]:
        gaps = disagreement(closed_form(case), TIMES, closed_values(case, TIMES))
        assert gaps.max() < 1e-2 * module.SUSPICIOUS_GAP, case


@pytest.mark.parametrize("place", [
    at.PHI_LINE + 2, at.PHI_TURNS + 2, at.DOWN_TURNS + 2, at.UP_TURNS, at.P_PSI, at.ENERGY, at.P_PHI, at.BEND,
    at.FLOOR + at.STEEPNESS, at.TWIST_UP, at.FLOOR + at.FAR_REAL, at.CROWN + at.NEAR_IMAG])  # fmt: skip
def test_a_wrong_constant_is_noticed_at_the_times_asked_for(monkeypatch, place):
    case = Scene("wrong", scene("spheroid").top, scene("spheroid").start, 8.0)
    form = ClosedForm(case.top, case.start)
    monkeypatch.setattr(module, "closed_form", lambda _: form)
    assert closed_bounds(case, TIMES, closed_values(case, TIMES))["axis"].max() < 3e-15
    form._constants[place] *= 1.0 + 1e-9
    bounds = closed_bounds(case, TIMES, closed_values(case, TIMES))
    assert bounds["axis"].max() == bounds["phi"].max() == math.pi


def test_a_certificate_is_made_once_and_the_better_one_is_told(cache, monkeypatch):
    case = scene("goldstein")
    assert certificate(case) is None
    digits = certificate(case, "digits")
    assert (certificate(case)[:3], kind(digits), kind(certificate(case))) == (digits[:3], "digits", "digits")
    assert digits.reach == pytest.approx(1e6 * case.nutation_period)
    assert kind(certificate(case, "discrete-map")) == kind(certificate(case)) == "discrete-map"
    integration = certificate(case, "integration")
    assert (kind(integration), (integration.share, integration.reach)) == ("integration", (digits.share, digits.reach))
    monkeypatch.setattr(module.netcdf, "write", pytest.fail)  # nothing is computed again
    module._on_disk.cache_clear()  # as in a new process
    assert certificate(case) == certificate(case, "integration") == integration
    assert certificate(scene("spheroid")) is None
    assert len(list(cache.glob("reference/*.nc"))) == 3


def test_a_certificate_without_heyoka_is_not_taken_for_one_with_it(cache, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "heyoka", None)
        assert kind(certificate(scene("goldstein"), "integration")) == "discrete-map"
    assert kind(certificate(scene("goldstein"), "integration")) == "integration"


@pytest.mark.parametrize("case", [
    scene("steady"), scene("separatrix"), scene("bruls-cardona-arnold"), scene("sleeping-unstable"),
    Scene("climbing", SymmetricTop(1.0, 0.5, -1.0), Angles(0.0, theta_dot=2.0), 5.0),
    Scene("free", SymmetricTop(1.0, 0.5, 0.0), Angles(1.0, 0.1, 0.2, 0.3, 0.4, 0.5), 5.0),
], ids=lambda case: case.name)  # fmt: skip
def test_motions_of_every_kind_can_be_certified(cache, case):
    record = certificate(case, "integration")
    assert 0.0 < record.share < 1.0
    assert record.apart < 1e-13
    assert record.map_apart < 1e-12
    assert (record.factor, record.doubt) == (1.0, 0.0)


def test_a_certificate_shows_a_form_that_is_wrong(cache, monkeypatch):
    """A rate of the phase that is wrong by 1e-15 shows against 40 digits; formulas of another top do in motion."""
    case = scene("spheroid")
    cached, form = closed_form(case), ClosedForm(case.top, case.start)
    form._constants[at.QUARTERS] *= 1.0 + 4e-16
    for holder in (module, sys.modules["symtop.run.reference.independent_checks"]):
        monkeypatch.setattr(holder, "closed_form", lambda _: form)
    record = certificate(case, "integration")
    assert record.share > 1e3
    assert record.factor > 1e3
    assert certificate(case).factor == record.factor
    assert cached is closed_form(case)
    control = ClosedForm(SymmetricTop(case.top.I1, case.top.I3, case.top.mgl * (1.0 + 1e-9)), case.start)
    monkeypatch.setattr(module, "closed_form", lambda _: control)
    assert module._against_integration(case)[1] > 1e-9
    assert module._against_map(case)[1] > 1e-9


def test_the_discrete_map_as_a_witness_knows_its_own_error_and_is_no_echo(monkeypatch):
    """It needs no other witness; a map of another top is seen, and so is one whose two steps disagree."""
    case = scene("spheroid")
    times = case.nutation_period * np.array([0.3, 7.7, 100.0])
    truth = closed_form(case).quaternion(times)
    attitudes, steps = iterate_map(case, times)
    assert charts.attitude_distance(attitudes, truth).max() < 1e-12
    assert steps == sum(math.ceil(nutations * MAP_STEPS[0]) for nutations in (0.3, 7.7, 100.0))
    control = Scene("other", SymmetricTop(case.top.I1, case.top.I3, case.top.mgl * (1.0 + 1e-9)), case.start, 8.0)
    assert module._against_map(case)[1] < module.SUSPICIOUS_GAP
    monkeypatch.setattr(module, "iterate_map_with_error", lambda _, times: iterate_map_with_error(control, times))
    assert module._against_map(case)[1] > 1e-9
    record = Certificate(1.0, 1, 0.1, 1.0, module._against_map(case)[1], 0.0)
    assert record.doubt == record.map_apart
