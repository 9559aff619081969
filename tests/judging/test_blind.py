"""The judge has to be right about methods that it was not written for: none that is right refuted, none wrong passed.

`blind/correct.py`, `blind/right.py`, `blind/strang.c` and `blind/midpoint.awk` hold methods that are what they claim,
`blind/wrong.py`, `blind/tricks.py` and their files in C such that are not, among them bugs that public codes had.
`CLAIMS` says which line has to name each.
"""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import symtop
from symtop.judging.findings import description

BLIND = Path(__file__).parent / "blind"


def loaded(name):
    spec = importlib.util.spec_from_file_location(f"blind_{name}", BLIND / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


CORRECT, WRONG, RIGHT, TRICKS = loaded("correct"), loaded("wrong"), loaded("right"), loaded("tricks")
needs_awk = pytest.mark.skipif(shutil.which("awk") is None, reason="there is no awk")
needs_compiler = pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler")


def compiled(folder, source, *options, program=False):
    """A library, or a program, of a C file."""
    target = folder / ("program" if program else "library.so")
    kind = ["-DPROGRAM"] if program else ["-shared", "-fPIC"]
    subprocess.run(["gcc", "-O2", *kind, *options, str(BLIND / source), "-o", str(target), "-lm"], check=True)
    return str(target)


def form_of(name):
    return "rotation" if name.startswith("rotation") else None


FAST = ("heun", "AdamsBashforth", "rotation_strang")
SPLIT = {"symplectic": True, "symmetric": True, "conserves": ["p_phi", "p_psi"], "energy": "bounded"}


@pytest.mark.parametrize("name", [pytest.param(n, marks=[] if n in FAST else pytest.mark.slow) for n in CORRECT.CLAIMS])
def test_a_correct_method_is_not_refuted(name):
    claims = CORRECT.CLAIMS[name]
    ledger = symtop.judge(getattr(CORRECT, name), form=form_of(name), quick=True, **claims)
    assert ledger.refuted == [], str(ledger)
    assert ledger["order"].verdict == "confirmed", str(ledger)


@pytest.mark.slow
@pytest.mark.parametrize("chart", ["angles", "attitude"])
@pytest.mark.parametrize("name", ["rk4", "dormand_prince"])
def test_a_correct_method_is_not_refuted_in_another_chart(name, chart):
    ledger = symtop.judge(getattr(CORRECT, name), chart=chart, quick=True, order=CORRECT.CLAIMS[name]["order"])
    assert ledger.refuted == [], str(ledger)
    assert ledger["order"].verdict == "confirmed", str(ledger)


@needs_compiler
@pytest.mark.parametrize(("options", "order"), [((), 2), (("-DYOSHIDA",), 4), (("-DMCLACHLAN",), 4)])
def test_a_correct_library_is_not_refuted(tmp_path, options, order):
    ledger = symtop.judge(compiled(tmp_path, "strang.c", *options), quick=True, order=order, **SPLIT)
    assert ledger.refuted == [], str(ledger)
    verdicts = {ledger[claim].verdict for claim in ("order", "symplectic", "symmetric", "energy", "p_phi", "p_psi")}
    assert verdicts == {"confirmed"}, str(ledger)


@needs_compiler
def test_a_correct_program_is_not_refuted(tmp_path):
    command = compiled(tmp_path, "strang.c", program=True)
    ledger = symtop.judge(command, form="program", quick=True, order=2, **SPLIT)
    assert ledger.refuted == [], str(ledger)
    assert {ledger[claim].verdict for claim in ("order", "symplectic", "p_psi")} == {"confirmed"}, str(ledger)


@pytest.mark.slow
def test_a_correct_program_that_writes_raw_doubles_is_not_refuted():
    command = f"{sys.executable} {BLIND / 'heun_program.py'}"
    ledger = symtop.judge(command, form="program", quick=True, order=2, symplectic=False)
    assert ledger.refuted == [], str(ledger)
    assert {ledger[claim].verdict for claim in ("order", "symplectic")} == {"confirmed"}, str(ledger)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[] if n == "separable_forest_ruth" else pytest.mark.slow) for n in RIGHT.CLAIMS]
)
def test_an_odd_but_correct_method_is_not_refuted(name):
    claims, options = RIGHT.CLAIMS[name]
    ledger = symtop.judge(getattr(RIGHT, name), quick=True, **claims, **options)
    assert ledger.refuted == [], str(ledger)
    assert {ledger[claim].verdict for claim in claims if claim not in ("conserves", "energy")} == {"confirmed"}


@needs_compiler
@pytest.mark.slow
def test_an_explicit_library_is_not_refuted(tmp_path):
    ledger = symtop.judge(compiled(tmp_path, "tricks.c", "-DKIND=3"), quick=True, order=2, symplectic=False)
    assert ledger.refuted == [], str(ledger)
    assert {ledger[claim].verdict for claim in ("order", "symplectic")} == {"confirmed"}, str(ledger)


@needs_awk
@pytest.mark.slow
def test_a_program_in_awk_is_not_refuted_and_one_that_writes_six_digits_is():
    for digits, refuted in ((), False), (("-v OUT=%.6g",), True):
        command = " ".join(["awk", *digits, "-f", str(BLIND / "midpoint.awk")])
        ledger = symtop.judge(command, form="program", quick=True, order=2, conserves=["p_phi"])
        assert ("order" in ledger.refuted) is refuted, str(ledger)
        assert ledger["order"].verdict == ("refuted" if refuted else "confirmed")


# ---- what is wrong ---------------------------------------------------------------------------------------------------

QUICKLY = ("wrong_nodes", "stale_force", "rotation_frames", "rounded_triple", "symplectic_euler")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[] if n in QUICKLY else pytest.mark.slow) for n in WRONG.CLAIMS]
)
def test_a_wrong_method_is_caught_by_the_line_that_names_its_defect(name):
    claims, line = WRONG.CLAIMS[name]
    ledger = symtop.judge(getattr(WRONG, name), form=form_of(name), quick=True, **claims)
    assert line in ledger.refuted, str(ledger)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[] if n.startswith("separable") else pytest.mark.slow) for n in TRICKS.CLAIMS]
)
def test_a_trick_is_caught_by_the_line_that_names_its_defect(name):
    claims, line, options = TRICKS.CLAIMS[name]
    ledger = symtop.judge(getattr(TRICKS, name), quick=True, **claims, **options)
    assert line in ledger.refuted, str(ledger)


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "claims", "line"),
    [(0, {"order": 2}, "order"), (1, {"order": 2}, "calls"), (2, {"order": 1, "symplectic": True}, "symplectic")],
)
def test_a_trick_in_a_library_is_caught(tmp_path, kind, claims, line):
    ledger = symtop.judge(compiled(tmp_path, "tricks.c", f"-DKIND={kind}"), quick=True, **claims)
    assert line in ledger.refuted, str(ledger)


@needs_compiler
@pytest.mark.parametrize(
    ("kind", "claims", "line"),
    [
        (0, {"order": 3}, "order"),
        pytest.param(1, {"order": 4}, "order", marks=pytest.mark.slow),
        pytest.param(2, {"order": 4}, "order", marks=pytest.mark.slow),
        pytest.param(3, {"order": 2}, "order", marks=pytest.mark.slow),
    ],
)
def test_a_wrong_library_is_caught(tmp_path, kind, claims, line):
    ledger = symtop.judge(compiled(tmp_path, "wrong.c", f"-DKIND={kind}"), quick=True, **claims)
    assert line in ledger.refuted, str(ledger)


@needs_compiler
@pytest.mark.slow
def test_time_that_is_summed_in_single_precision_is_caught(tmp_path):
    command = compiled(tmp_path, "wrong.c", "-DKIND=9", program=True)
    ledger = symtop.judge(command, form="program", quick=True, order=2)
    assert "calls" in ledger.refuted, str(ledger)


def test_without_a_claim_it_says_the_order_that_a_step_has_and_not_the_slope():
    ledger = symtop.judge(WRONG.rounded_triple, quick=True)
    assert ledger.refuted == []
    assert str(ledger["order"].measured) == "2 by its h^3 term"
    assert description(ledger.findings).startswith("order 2, not symplectic, reversible, keeps ")
