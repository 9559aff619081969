"""The claims ledger: it believes the honest, catches the liars for the right reason, and says what it cannot tell."""

import dataclasses
import json
import math
import re
import tracemalloc
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from symtop_studies.claims import planted

import symtop
from symtop.judging.adapters import adapter
from symtop.judging.adapters.python_step import PythonStep
from symtop.judging.battery import CLAIMS, judge
from symtop.judging.claims import constants, constants as long, order, structure
from symtop.judging.claims.step_series import Series
from symtop.judging.claims.subject import Subject, seconds_a_step
from symtop.judging.findings import VERDICTS, About, Finding, Ledger, Reading, as_time, description
from symtop.judging.remote import Process, separated, solvers_of
from symtop.measure import step_map as maps
from symtop.measure.conservation import Change, behaviour
from symtop.measure.order import Fit
from symtop.measure.step_map import bracket, one_step, restart_gap, return_miss, step_map, symplectic_defect
from symtop.methods.framework.plan import Run
from symtop.methods.framework.registry import Integrator, integrator
from symtop.methods.splitting import composition
from symtop.model import charts
from symtop.model.scenes import body_scenes, scene
from symtop.run.ensemble.bodies import body_population, scenes_of
from symtop.run.simulation import integrate
from tests.commands import call, code_and_output, finish, symtop as command
from tests.conftest import defer, random_scenes
from tests.judging.blind import right
from tests.judging.blind.right import euler, implicit_euler

SPHEROID = symtop.scene("spheroid")


def finding_of(subject, method, claim):
    """What a module of claims finds of one of them."""
    return {finding.claim: finding for finding in subject.measure(Subject(method, SPHEROID, quick=True))}[claim]


def still(chart, change=lambda y: y):
    """A method whose step changes nothing, or just what `change` does to the state."""

    def solve(top, start, plan):
        m = top.momenta(start)
        euler, n = np.array([start.theta, top.I1 * start.theta_dot, start.phi, start.psi]), plan.times.size
        state = change(euler if chart == "angles" else charts.space_state(chart, top, start))
        return Run(np.tile(state, (n, 1)), np.full(n, m.p_phi), np.full(n, m.p_psi), 1, 1, 0, "ok", plan.horizon)

    return Integrator(name="still", family="other", summary="", solvers={chart: solve})


@pytest.mark.parametrize("chart", ["angles", "axis", "attitude"])
def test_the_brackets_of_every_chart_are_those_of_its_variables_and_see_growth_by_a_millionth_a_step(chart):
    for case in random_scenes(3, seed=41):
        step = one_step(still(chart), chart, case, 0.1)
        assert symplectic_defect(step, case.start).size < 1e-11
        tables = bracket(chart, step.at(case.start))
        np.testing.assert_array_equal(tables, -tables.T)

    def swell(state):
        state[-3 if chart != "angles" else 1] *= 1.0 + 1e-6
        return state

    defect = symplectic_defect(one_step(still(chart, swell), chart, SPHEROID, 0.1), SPHEROID.start)
    assert (1e-8 < defect.size < 1e-5, defect.noise < 1e-10) == (True, True)


@pytest.mark.quick
def test_only_a_real_defect_stays_and_a_step_is_one_map_unless_it_looks_at_the_start():
    """As the differences are refined."""
    for name, conserves in (("strang", True), ("gauss-4", False)):
        defect = symplectic_defect(*step_map(symtop.integrator(name), "axis", SPHEROID))
        assert (defect.raw[-1] < defect.raw[0] / 100.0, defect.size < 1e-11) == (conserves, conserves)
    for name, tuned in (("strang", False), ("cayley-tuned", True)):
        step, start = step_map(symtop.integrator(name), "attitude", SPHEROID)
        assert (restart_gap(step, start) > 1e-9, return_miss(step, start) > 1e-9) == (tuned, tuned)
    for case in maps.drawn(SPHEROID, 8, 18, same_top=False):  # at one start a run is only 9e-10 off two steps
        tuned = one_step(symtop.integrator("cayley-tuned"), "attitude", case, maps.RUN_NUTATIONS * case.time_scale())
        assert structure._symplectic(maps.coarsest(tuned, case.start), case.start)[0]


TIME = np.linspace(0.0, 8000.0, 4001)
WAVE = 1e-5 * np.sin(37.1 * TIME)  # not commensurate with the samples


@pytest.mark.parametrize(("residual", "kind"), [
    (1e-14 * np.sqrt(TIME), "kept"), (WAVE, "bounded"), (1e-9 * TIME, "drift"), (np.full(4001, np.nan), "unknown"),
    (1e-9 * np.exp(TIME / 12.0), "drift"), (WAVE + 1e-9 * TIME, "drift"),  # most of it below the wave
    (1e-12 * np.sqrt(TIME) * np.sin(37.1 * TIME), "random walk"),
    (1e-7 * np.sqrt(TIME) * np.sin(37.1 * TIME), "growing"),  # too large for a walk of rounding
    (np.where(TIME > 4.0, 1e-15 * 500.0 * TIME, 0.0), "drift"),  # 1e-15 a step, 2 ms each
])  # fmt: skip
def test_residuals_are_classified_by_how_they_grow(residual, kind):
    assert long.change_of(TIME, residual, residual[:100], 1_000_000).kind == kind


@pytest.mark.parametrize(("size", "slope", "interval", "kind"), [
    (1e-12, 1.0, 0.01, "kept"), (1e-5, 0.02, 0.1, "bounded"), (2e-11, 0.5, 0.2, "random walk"),
    (1e-5, 1.0, 0.1, "drift"), (1e-5, 2.0, 0.1, "drift"), (1e-5, math.nan, math.nan, "growing"),
    (1e-5, 0.1, 0.5, "growing"), (2e-11, 0.4, 0.45, "growing"),  # 0 or 1/2
    (2e-11, 0.74, 0.28, "growing"), (1e-5, 0.9, 0.45, "growing"),  # 1/2 or 1
    (2e-5, 0.5, 0.2, "growing"),  # not by rounding
])  # fmt: skip
def test_a_law_is_named_only_if_the_interval_excludes_its_neighbours(size, slope, interval, kind):
    assert behaviour(size, slope, interval, rounding=1e-11) == kind


@pytest.mark.parametrize(("a_step", "plain", "kind"), [
    (1e-16, False, "drift"), (1e-16, True, "kept"), (1e-15, True, "drift")])  # fmt: skip
def test_a_bias_of_a_unit_of_rounding_a_step_is_rounding_where_sums_are_plain(a_step, plain, kind):
    """As of products of quaternions: 144,000 steps make 1.6e-11."""
    steps, rounding = 144_000, 6e-16 * np.sin(np.arange(400.0))
    assert long.change_of(TIME, a_step * steps * 1.1 * TIME / TIME[-1], rounding, steps, plain=plain).kind == kind


def test_jumps_short_runs_and_noise_are_told_from_growth():
    jump = np.where(TIME > 4000.0, 1e-6, 0.0) + 1e-12 * np.sin(TIME)
    assert long.change_of(TIME, jump, WAVE[:9] * 1e-10, 1000).sudden.startswith("after t = 4000 it changes ")
    swell = 1e-13 * np.exp(TIME / 400.0) * np.sin(TIME / 3.0)  # which stands still at each turn
    assert {long.change_of(TIME, values, WAVE[:9] * 1e-10, 1000).sudden for values in (WAVE, swell)} == {""}
    change = long.change_of(TIME, np.where(TIME < 4.0, WAVE + 1e-6, np.nan), WAVE[:2], 2000)  # ends before two decades
    assert (math.isnan(change.changed.exponent), change.kind, change.grows) == (True, "unknown", None)
    wave = 1e-3 * (1.0 - np.cos(TIME / 374.5))  # 3.4 periods; the first begins with growth
    assert [long.change_of(TIME, wave, wave[:9], 400, period=period).grows for period in (0.0, 2353.0)] == [True, None]
    draw = np.random.default_rng(5)
    kinds = [long.change_of(TIME, WAVE + 1e-6 * draw.standard_normal(TIME.size), WAVE, 1).kind for _ in range(200)]
    assert set(kinds) == {"bounded"}


@pytest.mark.quick
def test_an_energy_that_leaves_its_scale_is_said_to_blow_up_and_the_rest_judged_until_then(keep_claims, monkeypatch):
    """Euler's method gains energy, and keeps p_phi; the implicit one loses all that it can, which is no blow-up."""
    keep_claims("energy", "p_phi")
    monkeypatch.setattr("symtop.judging.claims.subject.LONG_SECONDS", (10.0, 60.0))  # 39,288 steps on any machine
    ledger = symtop.judge(euler, quick=True, energy="bounded")
    assert [ledger[claim].measured.kind for claim in (*ledger.refuted, "p_phi")] == ["blows up", "kept"]
    assert 1.0 < ledger["energy"].value / (1.0 + 2.0 * SPHEROID.top.mgl / SPHEROID.energy_scale) < 2.0
    monkeypatch.setattr("symtop.judging.claims.subject.LONG_SECONDS", (10.0, 2.5))
    assert symtop.judge(implicit_euler, quick=True)["energy"].measured.kind in ("drift", "growing", "bounded")
    ledger = symtop.judge(lambda q, w, h, inertia, torque: (q, w + h * w), form="rotation", scene=HEAVY, quick=True)
    assert ledger["energy"].measured.kind == "blows up"
    traces = symtop.judge(euler, scene=HEAVY, quick=True).traces  # its quaternion leaves the chart
    assert traces["steps_run"] == pytest.approx(118 * 10.03 * traces["nutations_run"], rel=0.02)


@pytest.mark.parametrize(("largest", "verdict"), [(0.9, "confirmed"), (3.2, "refuted")])
def test_an_energy_that_sinks_to_its_least_and_stays_there_is_not_bounded(largest, verdict):
    """As the implicit Euler method has it: no longer growth, and more than 0.008 a step come to in a nutation."""
    run = long.long_run(symtop.integrator("rk4"), SPHEROID, "axis", quick=True, most=1000)
    sunk = long.Constant(Change(largest, 0.0, 1.0, 0.0, 0.2, 0.01, ""), 0.008, 1e-11)
    run = run._replace(outcome="ok", steps=32_000, nutations=271.0, constants={"energy": sunk})
    claiming = dataclasses.replace(symtop.integrator("rk4"), energy_error="bounded", conserves=None)
    assert constants.of_run(claiming, run)[0].verdict == verdict


def test_a_claim_about_several_charts_is_judged_in_the_worst_of_them():
    """rk4 keeps p_phi in the space frame, where it is linear in the state, and loses it to truncation in the angles."""
    rk4 = symtop.integrator("rk4")
    runs = {chart: long.long_run(rk4, SPHEROID, chart, quick=True) for chart in rk4.charts()}
    kinds = {chart: run.constants["p_phi"].kind for chart, run in runs.items()}
    assert kinds == {"angles": "drift", "axis": "kept", "attitude": "kept"}
    finding = finding_of(constants, rk4, "p_phi")
    assert finding.measured.kind == "drift"
    assert finding.why.endswith("in the angles chart")


@pytest.mark.quick
def test_the_limit_of_an_honest_method_is_the_true_motion_and_of_one_whose_step_is_wrong_by_a_billionth_it_is_not():
    for name in ("midpoint", "strang", "gauss-4", "rk4"):
        method = symtop.integrator(name)
        assert max(order.limit(method, SPHEROID, method.order)) < 1e-12
    strang = symtop.integrator("strang")

    def slow(top, start, plan):
        return strang.solvers["attitude"](top, start, plan._replace(step_size=plan.step_size * (1.0 - 1e-9)))

    variant = dataclasses.replace(strang, name="slow", solvers={"attitude": slow})
    assert 1e-10 < order.limit(variant, SPHEROID, 2)[0] < 1e-7


CLASSICAL = ((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6)
OUTER = 1 / (2 - 2 ** (1 / 3))


def triple(shift):
    outer, half = OUTER + shift, (1 - OUTER - shift) / 2
    kicks, drifts = (outer, 1 - 2 * outer, outer), (outer / 2, half, half, outer / 2)
    return symtop.composition("triple", kicks, drifts, chart="space", order=4)


@pytest.mark.parametrize(("method", "verdict", "why"), [
    (symtop.runge_kutta("classical", *CLASSICAL, order=4), "confirmed", "meets the conditions up to order 4"),
    (symtop.runge_kutta("classical", *CLASSICAL), "measured", "meets the conditions up to order 4"),
    (symtop.runge_kutta("classical", *CLASSICAL, order=5), "refuted", "misses a condition of order 5 by"),
    (
        symtop.runge_kutta("off", (*CLASSICAL[0][:3], (1e-9, 0.0, 1.0 - 1e-9)), CLASSICAL[1], order=4), "refuted",
        "misses a condition of order 3 by 8.3e-11",
    ),
    (triple(0.0), "confirmed", "meets the conditions up to order 4 to"),
    (triple(1e-11), "refuted", "misses a condition of order 3 by 1.1e-11"),
])  # fmt: skip
def test_a_table_that_is_off_is_refuted_before_any_run(method, verdict, why):
    finding = finding_of(order, method, "order")
    assert (finding.verdict, finding.why.startswith(f"its table {why}")) == (verdict, True), finding.why


def test_every_splitting_of_the_catalogue_has_the_order_that_it_claims():
    orders = {method.name: (method.order, order.table_of(method)) for method in composition.built_in()}
    assert {name for name, (_, table) in orders.items() if table is None} == {"cayley", "cayley-tuned"}
    assert [name for name, (claimed, table) in orders.items() if table and table.order != claimed] == []
    assert order.table_of(symtop.integrator("gauss-4")) is None


@pytest.mark.parametrize(("name", "declared", "verdict"), [
    ("dop853", True, "undecided"),  # rejected steps cost forces too
    ("rk4", False, "undecided"),  # a Rosenbrock method costs as evenly
    ("radau", True, "undecided"), ("rk4", True, "confirmed"), ("rk4", None, "measured"), ("midpoint", True, "refuted"),
])  # fmt: skip
def test_a_method_is_not_explicit_because_it_says_so(name, declared, verdict):
    method = dataclasses.replace(symtop.integrator(name), explicit=declared)
    run = long.long_run(method, SPHEROID, "angles", quick=True)
    assert {finding.claim: finding for finding in constants.of_run(method, run)}["explicit"].verdict == verdict


def test_the_angles_end_at_a_pole_and_the_space_frame_does_not():
    ends = [(entry.chart, entry.outcome, entry.passes) for entry in structure.passages(symtop.integrator("rk4"))]
    assert ends == [("angles", "left_chart", False), ("axis", "ok", True), ("attitude", "ok", True)]


@pytest.mark.parametrize("name", ["midpoint", "galerkin-gauss-6", "strang", "rk4"])
def test_honest_claims_are_confirmed(name):
    ledger = judge(symtop.integrator(name), SPHEROID, quick=True)
    assert [finding.claim for finding in ledger.findings] == list(CLAIMS)
    assert {finding.verdict for finding in ledger.findings} <= set(VERDICTS) - {"refuted", "undecided"}
    assert {ledger[claim].verdict for claim in ("order", "symplectic", "symmetric", "explicit")} == {"confirmed"}


@pytest.mark.quick
def test_an_order_that_is_claimed_too_low_is_refuted_and_a_right_one_of_which_little_is_known_is_not():
    method = dataclasses.replace(symtop.integrator("dop853-compiled-fixed"), order=7)
    for name in ("goldstein", "wave"):
        assert judge(method, symtop.scene(name), quick=True)["order"].verdict == "refuted"
    right = judge(symtop.integrator("rkmk-se3-8"), symtop.scene("simo-wong"), quick=True)["order"]
    assert (right.verdict, right.value > 8.9) == ("undecided", True)
    assert "the h^9 term of a step is known only to 1e+00 of itself" in right.why


@pytest.mark.parametrize(("main", "second", "doubt", "verdicts"), [
    (5.5, 4.0, 0.01, "confirmed" + 3 * " undecided"), (5.0, 4.0, 0.01, "confirmed refuted undecided refuted"),
    (5.5, 3.0, 0.01, "refuted " * 4), (3.0, 4.0, 0.01, "refuted " * 4), (4.0, 3.0, 0.01, "refuted " * 4),
    (5.5, 3.55, 0.01, "refuted " * 4), (3.55, 5.5, 0.01, "refuted " * 4),
    *[(*slopes, 0.01, "confirmed" + 3 * " undecided") for slopes in ((5.5, 3.9), (3.9, 4.0))]])  # fmt: skip
def test_a_slope_yields_to_the_terms_of_a_step_but_for_one_that_is_clearly_lower(main, second, doubt, verdicts):
    terms = Series(1.0, np.array([0.0] * 5 + [1e-3]), np.full(6, 1e-14), True, "axis")  # of order 4
    noisy, five = (terms._replace(defect=np.zeros(7), noise=np.full(7, noise)) for noise in (1e-5, 1e-14))
    fits = [Fit(slope, doubt, 1.0, np.ones(1, dtype=bool)) for slope in (main, second)]
    data = order.Order("", *[np.ones(1)] * 4, fits[0], {})
    assert [order._declared(4, data, fits, term, "").verdict for term in (terms, None, noisy, five)] == verdicts.split()


@pytest.mark.parametrize(("lengths", "verdict"), [((8.37, 40.0), "confirmed"), ((8.37,), "undecided")])
def test_a_slope_that_decides_nothing_is_measured_over_a_longer_run(lengths, verdict, monkeypatch):
    monkeypatch.setattr(order, "LONGER_RUNS", lengths)  # 7.75 +- 0.17 over eight nutations: errors meet rounding
    fit = order.measured_order(integrator("dop853-compiled-fixed"), *random_scenes(1, seed=7)).main
    assert order.order_verdict(8, fit) == verdict


@pytest.mark.parametrize(("first", "orders", "lower"), [
    (1e-4, [4, 4, 4, 4], (math.inf, math.nan)), (1e-4, [4, 4, 2, 2.5], (2.5, 0.25)), (1e-4, [2, 8, 4, 4], (2.0, 1.0)),
    (0.1, [-1] * 8, (-1.0, 0.5**6)), (0.1, [-1] * 4, (math.inf, math.nan))])  # fmt: skip
def test_an_order_that_is_lower_at_the_finest_steps_or_jumps_below_one_that_is_lower_is_seen(first, orders, lower):
    misses = np.cumprod([first, *(0.5 ** (power + 1.0) for power in orders)])
    np.testing.assert_allclose(order._lower(0.5 ** np.arange(misses.size), misses, 4, 0.3, 1e-13), lower, rtol=1e-12)


def test_what_nobody_claimed_is_measured_and_a_claim_that_denies_what_the_method_has_is_refuted():
    claims = dict.fromkeys(("order", "explicit", "symplectic", "symmetric", "conserves"))
    verlet = dataclasses.replace(symtop.integrator("stormer-verlet"), **claims)
    ledger = judge(verlet, SPHEROID, quick=True)
    kinds = {(finding.verdict, bool(finding.declared)) for finding in ledger.findings}
    assert kinds == {("measured", False), ("inapplicable", False)}
    assert [ledger[claim].measured.kind for claim in ("symplectic", "symmetric", "energy")] == ["yes", "yes", "bounded"]
    assert abs(ledger["order"].value - 2.0) < 0.05
    variant = dataclasses.replace(verlet, symmetric=False, symplectic=False)
    assert [finding_of(structure, variant, name).verdict for name in ("symmetric", "symplectic")] == ["refuted"] * 2
    subject = Subject(integrator("series"), random_scenes(2, seed=5)[1], quick=True)  # 2^16 times better at half a step
    assert structure.measure(subject)[1].verdict == "confirmed"


def test_what_cannot_be_judged_says_why():
    broken = Mock(side_effect=RuntimeError("no luck " * 100))
    claims = {"order": 2, "explicit": True, "symmetric": False, "conserves": {"energy", "p_phi", "cayley_energy"}}
    ledger = judge(Integrator("broken", "other", "", {"axis": broken}, **claims), SPHEROID)
    relevant = [finding for finding in ledger.findings if finding.verdict != "inapplicable"]
    assert {finding.verdict for finding in relevant} == {"undecided"}
    assert all("no luck" in finding.why and len(finding.why) < 260 for finding in relevant)
    declared = {"order", "symmetric", "energy", "p_phi", "invariant", "explicit", "pole"}
    assert {finding.claim for finding in relevant if finding.declared} == declared
    odd = dataclasses.replace(symtop.integrator("stormer-verlet"), conserves=frozenset({"cayley_energy"}))
    assert "no formula for cayley_energy" in judge(odd, SPHEROID, quick=True)["invariant"].why


@pytest.mark.quick
def test_a_method_whose_every_step_is_exact_is_judged_by_its_errors():
    finding = finding_of(order, symtop.integrator("exact-discrete"), "order")
    assert (finding.declared, finding.verdict, finding.value < 1e-12) == ("exact", "confirmed", True)
    finding = finding_of(order, dataclasses.replace(integrator("srkn-14-6"), order=None, exact_steps=True), "order")
    assert (finding.verdict, finding.value > 1e-5) == ("refuted", True)
    with pytest.raises(symtop.SymtopError, match="exact_steps"):
        dataclasses.replace(symtop.integrator("rk4"), exact_steps=True)


# file: what is refuted first of all, and in which words; `FOLLOWS` has what follows from the lie, and what a liar that
# looks at its start leaves open
CAUGHT = {
    "wrong_start": ("order", r"another power of the step: slopes attitude 1\.0"),
    "symplectic_rk4": ("symplectic", r"defect of the bracket \d\.\de-0[23] \(it goes from (.e-0[23]) to \1"),
    "coefficients_swapped": ("order", r"another power of the step: slopes attitude (0\.9|1\.0)"),
    "hidden_kick": ("symmetric", r"a step forth and back misses the start by \d\.\de-0"),
    "one_newton": ("energy", r"drifting by -?[23]\.\de-09 a step"),  # of the nutation's; of the whole, 3e-10
    "coefficient_off": ("order", r"goes to zero it goes to a motion that is wrong by \d\.\de-09"),
    "verlet_swapped": ("order", r"goes to zero it goes to a motion that is wrong by \d\.\de-01"),
    "leaking_momentum": ("p_phi", r"growth exponent 1\.00 .* drifting by 8\.\de-12 a step"),
    "leaking_chart": ("p_phi", r"growth exponent 1\.00 .* a step, in the attitude chart"),
    "reported_leak": ("reported", r"other momenta than its states have: p_phi differs by \d\.\de-03"),
    "copied_momenta": ("p_psi", r"growth exponent \d\.\d\d .* drifting by -?\d\.\de-\d+ a step"),
    "copied_in_angles": ("reported", r"than its states have: p_(phi|psi) differs by \d\.\de-0\d more at the end"),
    "rounded_triple": ("order", r"^its table misses a condition of order 3 by 3\.2e-08; the h\^3 term .*noise \de-1\d"),
    "adaptive_implicit": ("explicit", r"reports \d\.\d\d iterations a step, in the angles chart"),
}
FOLLOWS = {
    "symplectic_rk4": {"energy"}, "one_newton": {"symplectic", "symmetric"}, "coefficient_off": {"symmetric"},
    "verlet_swapped": {"symplectic", "symmetric", "energy"}, "copied_momenta": {"reported"},
    "leaking_chart": {"order", "energy", "p_psi", "reported"},  # a step misses by 1e-4 h, seen where a draw shows
    "leaking_momentum": {"order", "energy", "p_psi", "pole", "symmetric"},
}  # fmt: skip
OWN_KERNEL = {"one_newton", "coefficient_off", "verlet_swapped", "leaking_momentum"}  # seconds to compile


def test_every_file_of_false_claims_is_tested():
    assert {path.stem for path in planted.LIARS.glob("*.py")} == set(CAUGHT)
    lies = {planted.file_of(name).stem: lie for name, lie in planted.LIES.items()}
    assert lies == {liar: claim for liar, (claim, _) in CAUGHT.items()}


@pytest.mark.parametrize("liar", [pytest.param(n, marks=pytest.mark.slow if n in OWN_KERNEL else []) for n in CAUGHT])
def test_a_liar_is_caught_for_the_right_reason(liar, clean_registry):
    quick = [] if liar in OWN_KERNEL else ["--quick"]
    code, output = code_and_output("claims", "--plugin", str(planted.LIARS / f"{liar}.py"), "--json", *quick)
    claim, why = CAUGHT[liar]
    findings = {row.pop("claim"): row for row in json.loads(output)}
    assert (code, findings[claim]["verdict"]) == (1, "refuted")
    assert re.search(why, findings[claim]["why"]), findings[claim]["why"]
    assert {name for name, row in findings.items() if row["verdict"] == "refuted"} <= {claim} | FOLLOWS.get(liar, set())


def test_a_chart_in_which_a_method_raises_hides_no_finding_of_another():
    axis = symtop.integrator("rk4").solvers["axis"]
    false = Mock(side_effect=lambda *run: axis(*run)._replace(p_phi=np.arange(len(run[2].times))))
    method = dataclasses.replace(integrator("rk4"), solvers={"axis": false, "attitude": Mock(side_effect=ValueError)})
    assert judge(method, SPHEROID, quick=True)["reported"].verdict == "refuted"


HONEST = ["midpoint", "stormer-verlet", "strang", "cayley", "rk4", "gauss-4", "takahashi-imada", "yoshida-4", "gauss-2",
          "galerkin-simpson", "trapezoidal", "chin-4a", "srkn-6-4", "suzuki-4", "rk45-compiled", "gauss-6", "srkn-11-6",
          "midpoint-unreduced", "cayley-tuned", "aba-8-6-4", "dop853-compiled-fixed", "tsit5-fixed"]  # fmt: skip


@pytest.mark.slow  # `test_honest_claims_are_confirmed` has three of them on the spheroid
@pytest.mark.parametrize(("name", "scene"), list(zip(HONEST, random_scenes(len(HONEST), seed=2024), strict=True)))
def test_no_false_alarm_on_random_tops(name, scene):
    ledger = judge(symtop.integrator(name), scene, quick=name in HONEST[:3])
    assert [finding.sentence(name) for finding in ledger.findings if finding.verdict == "refuted"] == []


@pytest.mark.slow
def test_no_registered_integrator_is_refuted_and_few_claims_stay_open():
    ledgers = [judge(method, SPHEROID) for method in symtop.integrators().values()]
    findings = [(ledger.integrator, finding) for ledger in ledgers for finding in ledger.findings]
    relevant = [(name, finding) for name, finding in findings if finding.verdict != "inapplicable"]
    assert [finding.sentence(name) for name, finding in relevant if finding.verdict == "refuted"] == []
    assert sum(finding.verdict == "undecided" for _, finding in relevant) <= len(relevant) / 10
    assert all(entry.why and (entry.verdict != "confirmed" or math.isfinite(entry.resolution)) for _, entry in relevant)


def test_the_series_of_a_step_beside_a_pole_is_taken_on_another_top():
    """There angles know a state badly: without the rule this step of order 2 has a series of order 12."""
    start = symtop.Angles(0.001389, 0.966212, 0.842727, 0.000981, -26.156396, -1323.792023)
    upright = symtop.Scene("upright", symtop.SymmetricTop(0.1146, 0.0043, 65.3957), start, 20.0)
    subjects = (Subject(integrator("strang"), place, quick=True) for place in (upright, scene("spheroid")))
    assert [series and series.order for series in map(order.series_of, subjects)] == [2, 2]


@pytest.mark.quick
def test_no_right_method_is_refuted_beside_a_pole():
    """Slopes in angles are 5e5 there, and cancel to 3e-9 of their square; errors of some fall with a higher power."""
    names = ("trapezoidal-unreduced", "tsit5-fixed", "yade", "stormer-verlet")
    subjects = [Subject(integrator(name), scene("sleeping"), quick=True) for name in names]
    assert {order.measure(subject)[0].verdict for subject in subjects} == {"confirmed"}
    assert structure.measure(subjects[-1])[0].verdict == "undecided"
    for name, place in (("stormer-verlet", "goldstein-rising"), ("strang", "sleeping-unstable")):
        findings = long.measure(Subject(integrator(name), scene(place), quick=True))  # 50,000 steps beat with the first
        assert {finding.claim: finding.verdict for finding in findings}["reported"] == "measured"  # one bit of h shows
    still = symtop.Scene("still", symtop.SymmetricTop(1.0, 1.0, 1.0), symtop.Angles(0.0, psi_dot=5.0), 20.0)
    unstable = ("exact-discrete", scene("separatrix"), "undecided"), ("yade", scene("sleeping-unstable"), "undecided")
    for name, place, verdict in (("strang", still, "confirmed"), *unstable):
        assert order.measure(Subject(integrator(name), place, quick=True))[0].verdict == verdict


def test_a_time_has_the_unit_that_suits_what_is_printed_and_a_least_order_is_said_to_be_one():
    assert [*map(as_time, (5.4321e-6, 999.4e-6, 999.7e-6, 0.0))] == ["5.43 us", "999 us", "1 ms", "0 ns"]
    for text, words in (("2 or more", "order 2 or more"), ("2: the h^3 term is off", "order 2"), ("", "order 2.4")):
        assert description([Finding("order", "", Reading("", 2 if text else 2.4, text), "measured", "")]) == words
    walks = Finding("p_psi", "", Reading("random walk", 1e-11), "measured", "", math.inf)
    runs = {"step_size": np.array([1.0, 0.5, 0.25]), "error": np.array([np.nan, np.nan, 1e-3])}
    stopped = walks._replace(claim="energy", measured=Reading("kept", 1e-11), verdict="undecided")  # its run
    screen = str(Ledger("mine", "any", (walks, stopped), runs, About(nutation=8.0)))
    assert re.search(r" 8 to 32 steps .* order \(16 and fewer fail\)(.|\n)*It is: does not keep p_psi\.", screen)
    assert walks.plain()["value"] is None


FREE, HEAVY = (body_scenes()[name] for name in ("check-case-2", "heavy-brick"))


@pytest.mark.parametrize(("name", "energy", "momentum"), [
    ("strang", "bounded", "kept"), ("commutator-free-4", "drift", "kept"), ("gauss-4", "kept", "bounded"),
    *defer(("lammps-rigid", "drift", "kept")),
])  # fmt: skip
def test_what_methods_claim_on_a_body_holds(name, energy, momentum):
    for free_or_heavy in (FREE, HEAVY):
        ledger = judge(symtop.integrator(name), free_or_heavy, quick=True)
        assert (ledger.refuted, ledger["order"].verdict) == ([], "confirmed")
        assert (ledger["energy"].measured.kind, ledger["momentum"].measured.kind) == (energy, momentum)


def test_a_needle_is_stepped_by_its_turns_and_a_slow_part_of_a_motion_is_no_growth():
    drawn = {scene.name: scene for scene in scenes_of(body_population(8, seed=3))}
    for name, body in (("strang", "needle-0"), ("euler-poincare", "near-symmetric-0")):
        assert judge(integrator(name), drawn[body], quick=True)["energy"].verdict == "confirmed"
    slow = symtop.Scene("slow", symtop.SymmetricTop(1.0, 1.0, 1.0), symtop.Angles(1.0, 0.7, 0.0, 1.0, 0.0, 1e-8), 20.0)
    liar = dataclasses.replace(integrator("rk4"), name="liar", conserves=["p_psi"])  # |L| is 1e8 times p_psi
    assert [judge(method, slow, quick=True).refuted for method in (integrator("gauss-4"), liar)] == [[], ["p_psi"]]


def test_false_claims_on_a_body_are_refuted():
    rk4 = symtop.integrator("rk4")
    lie = dataclasses.replace(rk4, name="lie", family="splitting", order=3, symplectic=True)
    assert judge(lie, FREE, quick=True).refuted == ["energy", "momentum"]  # order 4 where 3 is claimed is no false one
    assert judge(dataclasses.replace(rk4, name="higher", order=5), HEAVY, quick=True).refuted == ["order"]
    assert judge(symtop.integrator("no-gyro"), FREE, quick=True)["order"].measured.kind == "wrong limit"
    unable = judge(symtop.integrator("stormer-verlet"), FREE, quick=True)["energy"]
    assert (unable.verdict, "take one of 51, such as strang" in unable.why) == ("undecided", True)


def rotation_swapped(q, w, h, inertia, torque):
    """The first two moments are exchanged, which are the same of a top."""
    return right.rotation_lie_midpoint(q, w, h, inertia[[1, 0, 2]], torque)


@pytest.mark.parametrize(("step", "order", "refuted"), [
    (right.rotation_lie_midpoint, 2, []), (rotation_swapped, 2, ["order"]),
    (right.rotation_strang, 2, ["order"]), (right.rk4, 4, []),
])  # fmt: skip
def test_a_step_of_ones_own_is_judged_on_a_body(step, order, refuted, keep_claims):
    """One that turns by the rates of other moments is wrong, as is an exact motion that symmetric bodies alone have."""
    keep_claims("order")
    form = "rotation" if "rotation" in step.__name__ else "ode"
    ledger = symtop.judge(step, form=form, scene=HEAVY, order=order, quick=True)
    assert (ledger.refuted, ledger["order"].verdict) == (refuted, "refuted" if refuted else "confirmed")
    assert refuted == [] or ledger["order"].measured.kind == "wrong limit"


@pytest.mark.parametrize(("claims", "words"), [
    ({"form": "separable"}, "form must be ode, rotation, scipy, not separable"),
    ({"symplectic": True}, "claim the rest on a top"), ({"conserves": ["p_psi"]}, "order and its energy alone"),
])  # fmt: skip
def test_what_a_step_on_a_body_cannot_show_is_refused(claims, words):
    with pytest.raises(symtop.SymtopError, match=words):
        symtop.judge(right.rk4, scene=FREE, quick=True, **claims)


@pytest.mark.slow
def test_a_step_is_drawn_beside_methods_on_a_body(tmp_path):
    """As in `judge --figure`, and in `compare`, which both take it in the chart of a body."""
    (tmp_path / "my.py").write_text("def step(q, w, h, inertia, torque):\n    return q, w\n", encoding="utf-8")
    words = f"judge {tmp_path / 'my.py'} --form rotation --scene heavy-brick --quick --figure {tmp_path / 'a.png'}"
    assert "my[body] none" in call(*words.split()).output  # it stands still and asks for no force
    assert (tmp_path / "a.png").stat().st_size > 0
    data = symtop.compare(HEAVY, [right.rk4, "rk4"], cost="evaluations", nutations=1.0, budget=4000, quiet=True)
    assert data["variant"].values.tolist() == ["step[body]", "rk4[body]"]
    ours, theirs = (data["error"].sel(variant=name).min() for name in data["variant"].values)
    assert ours == pytest.approx(theirs, rel=0.5)


@pytest.mark.parametrize("scene", ["spheroid", "heavy-brick"])
def test_a_run_that_ends_in_its_first_nutation_shows_no_constant(scene):
    """Two steps of 1e300 times the state: what did not change in the first is not said to be kept."""
    ledger = symtop.judge(lambda f, t, y, h: 1e300 * y, scene=scene, quick=True)
    assert {ledger[claim].measured.kind for claim in ("energy", "order")} == {""}


def test_the_card_of_a_body_shows_the_errors_that_its_order_was_found_from(keep_claims):
    keep_claims("order")
    ledger = symtop.judge(right.rk4, scene=HEAVY, order=4, quick=True)
    steps, errors = (ledger.traces[name][ledger.traces["fitted"] == 1.0] for name in ("step_size", "error"))
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(4.0, abs=0.2)
    assert " steps a natural period for the order" in " ".join(str(ledger).split())


def test_a_right_step_is_not_refuted_where_a_body_turns_over(keep_claims):
    """After a calm beginning."""
    keep_claims("order", "energy", "momentum")
    ledger = symtop.judge(right.midpoint, scene="tennis-racket", order=2, quick=True)
    assert (ledger.refuted, ledger["order"].verdict) == ([], "confirmed")
    assert ledger["energy"].measured.kind in ("growing", "drift")  # the length of its runs follows from its speed


def test_a_solver_that_sees_its_plan_contradicts_itself():
    rk4, gauss = (symtop.integrator(name).solvers["axis"] for name in ("rk4", "gauss-4"))
    for limit in (300, 5000, 20_000):
        seeing = lambda top, start, plan, limit=limit: (rk4 if plan.marks[-1] < limit else gauss)(top, start, plan)
        ledger = judge(symtop.Integrator("sees", "other", "its plan", {"axis": seeing}, order=4), SPHEROID, quick=True)
        assert ledger.refuted == ["reported"]
        assert "a run contradicts itself" in ledger["reported"].why


PLUGIN = """
import ctypes, os
import symtop
def nothing(top, start, plan): return None
def leaves(top, start, plan): os._exit(0)
def crashes(top, start, plan): ctypes.string_at(0)
for solver in (nothing, leaves, crashes):
    symtop.register(symtop.Integrator(f"{solver.__name__}-at-once", "other", "x", {"axis": solver}, order=4))
"""


@pytest.mark.slow
def test_a_plug_in_that_fails_is_told_of(tmp_path):
    (tmp_path / "plugin.py").write_text(PLUGIN)
    expected = {"nothing": "must return a Run", "leaves": "ended with code 0", "crashes": "was ended by SIGSEGV"}
    names = [f"{name}-at-once" for name in expected]
    # in another process, which this one would end with if it called the plug-in
    code, out, _ = finish(command("claims", *names, "--plugin", tmp_path / "plugin.py", "--quick"))
    assert code == 1
    for name, words in zip(names, expected.values(), strict=True):
        lines = [line for line in out.splitlines() if line.startswith(f"{name}, ")]
        assert any(words in line for line in lines), lines


def test_a_plug_in_that_ends_its_process_when_it_is_loaded_is_told_of(tmp_path):
    (tmp_path / "plugin.py").write_text("import os\nos._exit(0)\n")
    code, _, err = finish(command("claims", "--plugin", tmp_path / "plugin.py", "--quick"))
    assert (code, "plugin plugin.py cannot be loaded: its process ended with code 0" in err) == (2, True)


def test_a_run_that_is_returned_is_one_of_numbers():
    """What a process sends back is read as numbers and words, never as a pickle."""

    def solver(top, start, plan):
        shape = (plan.times.size, 6)
        return Run(np.full(shape, np.nan), np.zeros(shape[0]), np.zeros(shape[0]), 1, 0, 0, "not_finite", 0.0)

    method = symtop.Integrator("nan", "other", "x", {"axis": solver})
    with Process(lambda: solvers_of(method)) as process:
        process.allow(30.0)
        run = symtop.simulate("spheroid", separated(method, process), step_size=0.1, guard=False)
    assert (run.attrs["outcome"], np.isnan(run["energy"].values).all()) == ("not_finite", True)


def test_a_name_that_is_unknown_is_told_before_anything_is_measured_and_all_are_those_that_step_the_scene(monkeypatch):
    methods, empty = [], SimpleNamespace(findings=())
    monkeypatch.setattr("symtop.judging.judge_step.judge_separately", lambda row, _, **__: methods.append(row) or empty)
    result = call("claims", "midpoint", "midpont", code=2)
    assert ("integrator 'midpont' is unknown" in result.output, methods) == (True, [])
    call("claims", "--scene", "tennis-racket", code=1)
    assert methods == [method for method in symtop.integrators().values() if "body" in method.solvers]


STEP = SPHEROID.nutation_period / 118.02


def bytes_a_step(method: Integrator) -> float:
    """Bytes that a run keeps for each further step, by Python's own count of what NumPy and Python allocate."""
    base = 4000 if method.implementation == "compiled" else 200
    control = {"step_size": STEP, "tolerance": method.default_tolerance or 1e-6}[method.control]
    plan = {"samples": 11, "observe": "axis", "guard": False, method.control: control}
    symtop.simulate(SPHEROID, method, horizon=STEP, **plan)  # numba takes five times as long where memory is traced
    peaks, steps = [], []
    for count in (base, 6 * base, base, 6 * base):  # what is made once, or by another thread, is not in both
        tracemalloc.start()
        try:
            run = symtop.simulate(SPHEROID, method, horizon=count * STEP, **plan)
            peaks.append(tracemalloc.get_traced_memory()[1])
            steps.append(int(run.attrs["steps"]))
        finally:
            tracemalloc.stop()
    return (min(peaks[1::2]) - peaks[2]) / max(steps[3] - steps[2], 1)


# one of each loop: reduced chart, Newton, space frame, stages, two adaptive ones, SciPy's
@pytest.mark.parametrize("name", ["stormer-verlet", "midpoint", "strang", "gauss-4", "rk45-compiled", "taylor", "rk45"])
def test_the_memory_of_a_run_does_not_grow_with_its_steps(name):
    assert bytes_a_step(symtop.integrator(name)) < 8.0  # less than one number a step


def test_memory_that_grows_with_the_steps_is_seen():
    verlet, store = symtop.integrator("stormer-verlet"), []

    def hoard(top, start, plan):
        store[:] = [np.zeros(4 * round(plan.horizon / plan.step_size))]
        return verlet.solvers["angles"](top, start, plan)

    assert 16.0 < bytes_a_step(dataclasses.replace(verlet, solvers={"angles": hoard})) < 48.0


def test_a_step_that_blows_up_has_the_time_of_its_finite_steps():
    """A run that stops at infinity is over at once, however many steps it was asked for."""
    grows = lambda f, t, y, h: 2.0 * y + h * f(t, y)
    seconds = [seconds_a_step(PythonStep(step, "axis"), SPHEROID) for step in (grows, euler)]
    assert 0.1 < seconds[0] / seconds[1] < 10.0


@pytest.mark.parametrize("quick", [True, False])
def test_finer_runs_after_one_that_fails_late_share_its_steps(quick):
    steps = []

    def fails(f, t, y, h):
        steps.append(h)
        return y * (math.nan if t > 20.0 * SPHEROID.nutation_period and h > 0.005 * SPHEROID.nutation_period else 1.0)

    method = adapter.integrator(PythonStep(fails, "axis"))
    assert (long.long_run(method, SPHEROID, "axis", quick=quick, most=4000).outcome, len(steps) < 6000) == ("ok", quick)


def test_limits_are_extrapolated_falls_are_seen_and_a_cayley_map_keeps_its_own_energy(monkeypatch):
    for offset, power in ((1e-3, 3), (0.0, 4)):  # to a wrong motion, or to the true one with even powers
        run = lambda _, h, __, offset=offset, power=power: np.array([offset + h**2 + h**power])
        step = SimpleNamespace(h=0.1, chart="axis", motion=lambda _: lambda _: np.zeros(1), run=run, shown=np.array)
        monkeypatch.setattr(order, "one_step", lambda *_, step=step: step)
        distance, doubt = order.limit(integrator("strang"), scene("spheroid"), 2)
        assert (distance == pytest.approx(offset, rel=1e-6), distance < doubt) == (offset > 0.0, offset == 0.0)
    errors = np.array([1e-6, 5e-6, 1.0, 1.0])  # no better than at a tolerance ten thousand times as large
    fit = Fit(2.0, 0.1, 1.0, errors > 0.0)
    data = order.Order("", 10.0 ** -np.array([10.0, 6.0, 4.0, 2.0]), errors, errors, errors, fit, {})
    assert order._converges(data, "").verdict == "refuted"
    assert not structure.Passage("axis", "ok", 1e-3, 9e-4).passes
    assert Series(1.0, np.full(5, 1e-12), np.array([1e-15] * 3 + [1.0] * 2), True, "axis").order == 2  # noise hides two
    half = lambda step, _: (True, 5e-10, 1e-9, "") if step.h < 0.1 else (False, 1e-6, 1e-9, "")
    step = one_step(integrator("strang"), "axis", scene("spheroid"), 0.1)  # smaller, but by no power of the step
    assert structure._answer_at(half, step, scene("spheroid").start)[0] is False
    for name, bounded in (("cayley", True), ("strang", False)):
        path = integrate(scene("spheroid"), name, step_size=0.05, samples=161, observe="axis")
        assert (np.abs(constants.constants(scene("spheroid"), path)["cayley_energy"]).max() < 1e-12) == bounded
