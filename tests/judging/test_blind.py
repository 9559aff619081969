"""The judge has to be right about methods that it was not written for: none that is right refuted, none wrong passed.

`blind/right.py`, `strang.c` and `midpoint.awk` hold methods that are what they claim, the others such that are not.
"""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy import integrate

import symtop
from symtop.judging import battery, judge_step
from symtop.judging.claims import calls, subject
from symtop.judging.findings import description
from symtop.judging.remote import Remote
from tests.conftest import defer
from tests.judging.blind import right, wrong

BLIND, EXAMPLES = Path(__file__).parent / "blind", Path(__file__).parents[2] / "studies" / "examples"
right.TOP = symtop.scene("spheroid").top
needs_compiler = pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler")
SPLIT = {"symplectic": True, "symmetric": True, "conserves": ["p_phi", "p_psi"], "energy": "bounded"}
SHOWN = ("order", "symplectic", "symmetric")  # claims that every right step must have confirmed
PROGRAM = {"form": "program"}


def compiled(folder, source, *options, program=False):
    """A library, or a program, of a C file."""
    target = folder / ("program" if program else "library.so")
    kind = ["-DPROGRAM"] if program else ["-shared", "-fPIC"]
    subprocess.run(["gcc", "-O2", *kind, *options, str(BLIND / source), "-o", str(target), "-lm"], check=True)
    return str(target)


def step_of(name, *modules):
    """A step of the first module that has the name, or a class of SciPy's."""
    return next((vars(module)[name] for module in modules if name in vars(module)), None) or getattr(integrate, name)


def check_claims(ledger, *claims):
    """Nothing is refuted, these claims are confirmed, and the order in time is that of the claim if it is."""
    assert ledger.refuted == [], str(ledger)
    time = [finding for finding in ledger.findings if finding.claim == "time" and finding.verdict == "confirmed"]
    assert all(str(finding.measured.number) == finding.declared for finding in time)
    assert {ledger[claim].verdict for claim in claims} <= {"confirmed"}, str(ledger)


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [0.0, 0.01])  # those that a step takes, or as if it took these: runs are short then
@pytest.mark.parametrize("name", right.CLAIMS)
def test_a_correct_method_is_not_refuted(name, seconds, monkeypatch):
    monkeypatch.setattr(judge_step, "seconds_a_step", lambda *by: seconds or subject.seconds_a_step(*by))
    claims, options = right.CLAIMS[name]
    ledger = symtop.judge(step_of(name, right), quick=True, **claims, **options)
    explicit = ["explicit"] if claims.get("explicit") else []  # that it is not, nobody sees from outside
    check_claims(ledger, *(claim for claim in claims if claim in SHOWN), *explicit)
    assert ledger["pole"].verdict in ("measured", "inapplicable")  # never claimed of a step


@pytest.mark.parametrize("name", [
    "AdamsBashforth", "separable_forest_ruth", "rotation_guarded", "own_energy", *defer("rotation_strang", mark="slow")
])  # fmt: skip
def test_what_is_claimed_of_a_correct_method_is_confirmed_in_short_runs(name, keep_claims):
    keep_claims(*(claim for stage in battery.TABLE for claim in stage.claims))
    claims, options = right.CLAIMS[name]
    ledger = symtop.judge(step_of(name, right), quick=True, **claims, **options)
    check_claims(ledger, *(claim for claim in claims if claim in SHOWN))


@pytest.mark.quick
@pytest.mark.parametrize("name", ["BDF", "LSODA", "DOP853"])
def test_classes_of_variable_order_are_judged_at_a_tolerance(name, keep_claims):
    """They claim no order; that their error falls with the tolerance is confirmed, and refuted of `WrongSum`."""
    keep_claims("calls", "order", "pole")
    ledger = symtop.judge(step_of(name, right), quick=True, adaptive=True)
    assert (ledger["calls"].verdict, ledger["pole"].verdict) == ("inapplicable", "measured")
    for each in (ledger, symtop.judge(step_of(name, right), scene="heavy-brick", quick=True, adaptive=True)):
        check_claims(each, "order")
        assert description(each.findings) in ("converges as its tolerance falls", "order 5")
    assert symtop.judge(wrong.WrongSum, scene="heavy-brick", quick=True, adaptive=True).refuted == ["order"]


def test_a_symmetric_step_is_symmetric_where_its_iteration_fails_at_long_steps(keep_claims):
    """At a start that this seed draws the iteration of the substep of -1.7 h does not converge; at h/2 it does."""
    keep_claims("symmetric")
    for name, verdict in (("triple_jump", "confirmed"), ("half_symmetric", "refuted")):
        ledger = symtop.judge(step_of(name, right, wrong), quick=True, symmetric=True, seed=754319425)
        assert ledger["symmetric"].verdict == verdict, str(ledger)


@pytest.mark.slow
@pytest.mark.parametrize("chart", ["angles", "attitude"])
@pytest.mark.parametrize("name", ["rk4", "dormand_prince"])
def test_a_correct_method_is_not_refuted_in_another_chart(name, chart):
    order = right.CLAIMS[name][0]["order"]
    check_claims(symtop.judge(step_of(name, right), chart=chart, quick=True, order=order), "order")


@needs_compiler
@pytest.mark.parametrize(("source", "options", "claims", "refuted"), [
    ("strang.c", (), {"order": 2, **SPLIT}, ""), ("wrong.c", ("-DKIND=0",), {"order": 3}, "order"), *defer(
        (EXAMPLES / "judged.c", (), {"order": 1, "symplectic": True, "conserves": ["p_phi", "p_psi"]}, ""),
        ("strang.c", ("-DYOSHIDA",), {"order": 4, **SPLIT}, ""),
        ("strang.c", ("-DMCLACHLAN",), {"order": 4, **SPLIT}, ""),
        ("tricks.c", ("-DKIND=3",), {"order": 2, "symplectic": False}, ""),
        ("strang.c", (), {"order": 2, **SPLIT, **PROGRAM}, ""),
        ("wrong.c", ("-DKIND=1",), {"order": 4}, "order"), ("wrong.c", ("-DKIND=2",), {"order": 4}, "order"),
        ("wrong.c", ("-DKIND=3",), {"order": 2}, "order"), ("tricks.c", ("-DKIND=0",), {"order": 2}, "order"),
        ("tricks.c", ("-DKIND=1",), {"order": 2}, "calls"), ("strang.c", ("-DLOSES",), {"order": 2}, "calls"),
        ("tricks.c", ("-DKIND=2",), {"order": 1, "symplectic": True}, "symplectic"),
        ("wrong.c", ("-DKIND=9",), {"order": 2, **PROGRAM}, "calls"),  # time is summed in single precision
        mark="slow"),
])  # fmt: skip
def test_what_is_written_in_c(tmp_path, source, options, claims, refuted):
    ledger = symtop.judge(compiled(tmp_path, source, *options, program="form" in claims), quick=True, **claims)
    if refuted:
        assert refuted in ledger.refuted, str(ledger)
    else:
        constants = ("energy", "p_phi", "p_psi") if "energy" in claims else ()
        check_claims(ledger, *(claim for claim in claims if claim in SHOWN), *constants)


@needs_compiler
def test_the_order_of_a_correct_program_is_confirmed(tmp_path, keep_claims):
    keep_claims("calls", "order")
    check_claims(symtop.judge(compiled(tmp_path, "strang.c", program=True), quick=True, order=2, **PROGRAM), "order")


@pytest.mark.slow
def test_a_program_in_another_language():
    """One in awk writes all digits or six."""
    for digits, refuted in ((), False), (("-v OUT=%.6g",), True):
        if shutil.which("awk"):
            command = " ".join(["awk", *digits, "-f", str(BLIND / "midpoint.awk")])
            ledger = symtop.judge(command, quick=True, order=2, conserves=["p_phi"], **PROGRAM)
            assert ("order" in ledger.refuted, "14 digits" in ledger["calls"].why) == (refuted, refuted)
            assert ledger["order"].verdict == ("refuted" if refuted else "confirmed")


@pytest.mark.slow
def test_the_stages_of_an_implicit_class_are_solved_and_newton_is_left_as_it_was(keep_claims):
    from scipy.integrate._ivp import radau

    keep_claims("order")
    assert radau.NEWTON_MAXITER == 6
    ledger = symtop.judge(integrate.Radau, quick=True, order=5)
    assert ledger.refuted == [], str(ledger)
    assert "h^5" in ledger["order"].why
    assert symtop.judge(integrate.Radau, quick=True, order=6).refuted == ["order"]  # the control
    assert radau.NEWTON_MAXITER == 6


QUICKLY = (
    "stale_force", "symplectic_euler", "half_symmetric", "adams_from_memory", "edits_the_judge",
    "euler_in_a_spot", "WrongSum", "separable_stale", "separable_damped", "cached_by_digits", "cached_by_step",
    "cached_without_f",
)  # fmt: skip


@pytest.mark.parametrize("name", QUICKLY)
def test_the_line_that_names_a_defect_refutes_it(name, keep_claims):
    claims, line, options = wrong.CLAIMS[name]
    keep_claims(line)
    ledger = symtop.judge(step_of(name, wrong, right), quick=True, **claims, **options)
    assert ledger.refuted == [line], str(ledger)


@pytest.mark.slow
@pytest.mark.parametrize("name", wrong.CLAIMS)
def test_a_wrong_method_is_caught_by_the_line_that_names_its_defect(name):
    claims, line, options = wrong.CLAIMS[name]
    ledger = symtop.judge(step_of(name, wrong, right), quick=True, **claims, **options)
    assert line in ledger.refuted, str(ledger)


@pytest.mark.parametrize(("change", "line"), [({"late": 1.0}, "time"), ({"off": 1e-6}, "order"), ({}, "")])
def test_a_method_of_several_steps_is_not_judged_by_the_steps_that_start_it(change, line, keep_claims):
    """Of order 4 and symmetric, which three-step Adams is not."""
    keep_claims("order", "time", "symmetric")
    kind = type("Three", (wrong.AdamsBashforth3,), {"start": staticmethod(right.gauss_4)} | change)
    ledger = symtop.judge(kind, quick=True, order=3, symmetric=True, scene="simo-wong")
    assert (ledger.refuted, ledger["symmetric"].verdict) == ([line] * bool(line), "undecided"), str(ledger)


def test_a_small_defect_of_the_bracket_that_stands_out_of_its_noise_is_not_confirmed(keep_claims):
    keep_claims("symplectic")
    for loss, verdict in ((0.0, "confirmed"), (1e-9, "undecided"), (1e-7, "refuted")):
        damped = lambda *args, loss=loss: right.own_drift(*args) * np.repeat([1.0, 1.0 - loss], 3)
        assert symtop.judge(damped, quick=True, symplectic=True)["symplectic"].verdict == verdict


@pytest.mark.slow
def test_a_step_that_tires_after_a_hundred_thousand_is_found_in_full(monkeypatch):
    """It is of order 4 as long as the order is measured; a run of as many steps, and the first call again, show it."""
    monkeypatch.setitem(calls.LATE_RUNS, False, (calls.LATE_RUNS[False][0], 60.0))  # enough on a slow machine
    wrong._steps[0] = -80_000
    assert "calls" in symtop.judge(wrong.tires, order=4).refuted


@pytest.mark.parametrize("name", ["noisy", "sometimes_noisy"])
def test_random_noise_is_no_memory(name, keep_claims):
    keep_claims("calls")
    assert symtop.judge(step_of(name, wrong, right), quick=True)["calls"].measured.kind == "not repeatable"


def test_what_knows_every_state_again_is_caught_by_its_last_bit(keep_claims, monkeypatch):
    """Two-step Adams, where the process that remembers is not made anew."""
    slopes = {}

    def remembers(f, t, y, h):
        slope, after = wrong.adams(f, t, y, h, slopes.get(y.tobytes()))
        slopes[after.tobytes()] = slope
        return after

    keep_claims("calls")
    monkeypatch.setattr(Remote, "renew", lambda _: None)
    assert symtop.judge(remembers, quick=True, order=2).refuted == ["calls"]


@pytest.mark.quick
def test_a_seed_draws_the_same_and_without_a_claim_the_order_is_said_and_not_the_slope(keep_claims):
    keep_claims("order")
    ledger = symtop.judge(wrong.rounded_triple, quick=True)
    assert ledger.refuted == []
    text, _, doubt = str(ledger["order"].measured).partition(" +- ")
    assert text == "2: in one step the term in h^3 is the first that is wrong, by 1e-07"
    assert 0.0 < float(doubt.removesuffix(" of it")) < 1e-9
    assert description(ledger.findings) == "order 2"
    first, second = (symtop.judge(wrong.late_euler, quick=True, order=4, seed=7) for _ in range(2))
    assert (first["order"].why, "of seed 7" in first["order"].why) == (second["order"].why, True)
    assert (first.refuted, first.about.seed) == (["order"], 7)


@pytest.mark.quick
def test_no_order_is_below_zero(keep_claims):
    keep_claims("order")
    for claim in ({}, {"order": 4}):
        ledger = symtop.judge(lambda f, t, y, h: right.rk4(f, t, y, h) + 1e-6, quick=True, seed=1, **claim)
        assert str(ledger["order"].measured).startswith("0: in one step the term in h^0 is the first that is wrong")
        assert "It is: order 0" in str(ledger)


def test_a_step_written_for_f_of_y_may_say_so(keep_claims):
    wrong_times = lambda f, t, y, h: y + h * f(t, y + h / 2 * f(t + 0.3 * h, y))
    keep_claims("time")
    assert symtop.judge(wrong_times, quick=True, order=2).refuted == ["time"]
    assert symtop.judge(wrong_times, quick=True, order=2, autonomous=True)["time"].verdict == "inapplicable"
