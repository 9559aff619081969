"""Adapters of diffrax, torch and JAX: what fits is judged where they are installed; what does not is refused.

None of the three is imported in this process: JAX has threads, which a fork would lose, and judging forks.
"""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import symtop
from symtop.judging.adapters.external import field_of
from symtop.judging.claims.subject import open_target
from symtop.methods.framework.equations import FORMULATIONS

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "studies" / "examples"
SPHEROID = symtop.scene("spheroid")


def needs(package):
    absent = importlib.util.find_spec(package) is None
    return pytest.mark.skipif(absent, reason=f"{package} is not installed")


def without(package):
    there = importlib.util.find_spec(package) is not None
    return pytest.mark.skipif(there, reason=f"{package} is installed")


def judged(*arguments):
    """The exit code, and the findings by claim, or what is said of the refusal."""
    command = [sys.executable, "-m", "symtop.cli", "judge", *map(str, arguments), "--quick", "--json"]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env=os.environ | {"PYTHONPATH": str(ROOT)}
    )
    if done.returncode == 2:
        return 2, done.stderr
    return done.returncode, {one["claim"]: one for one in json.loads(done.stdout)}


@pytest.mark.parametrize("chart", ["axis", "attitude"])
def test_the_equations_on_arrays_are_those_on_floats(chart):
    form = FORMULATIONS[chart]
    par, state = form.prepare(SPHEROID.top, SPHEROID.start)
    rows = np.array([state, np.array(state) + 0.1])
    rates = field_of(chart, par, lambda columns: np.stack(columns, axis=-1))(0.0, rows)
    np.testing.assert_array_equal(rates, [form.field(par, row) for row in rows.tolist()])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "order"),
    [
        pytest.param(("judged_diffrax.py:solver",), 5, marks=needs("diffrax")),
        pytest.param(("judged_batches.py:heun", "--form", "torch"), 2, marks=needs("torch")),
        pytest.param(("judged_batches.py:heun", "--form", "jax", "--chart", "attitude"), 2, marks=needs("jax")),
    ],
)
def test_the_example_is_what_it_says_and_no_more(arguments, order):
    file, *options = arguments
    code, findings = judged(EXAMPLES / file, *options, "--order", order, "--not-symplectic")
    assert (code, findings["order"]["verdict"], findings["symplectic"]["verdict"]) == (0, "confirmed", "confirmed")
    code, findings = judged(EXAMPLES / file, *options, "--order", order + 1)
    assert (code, findings["order"]["verdict"]) == (1, "refuted")


SOLVERS = """
import diffrax
import optimistix as optx
import symtop
midpoint = diffrax.Midpoint()
implicit = diffrax.ImplicitEuler(root_finder=optx.Newton(rtol=1e-13, atol=1e-13))
own_finder = diffrax.ImplicitEuler()
loose = diffrax.Kvaerno3(root_finder=diffrax.VeryChord(rtol=1e-2, atol=1e-2))
in_two_parts = diffrax.SemiImplicitEuler()
"""


@needs("diffrax")
@pytest.mark.slow
def test_a_solver_in_a_session_that_has_imported_jax(tmp_path):
    (tmp_path / "session.py").write_text(
        SOLVERS + "ledger = symtop.judge(midpoint, order=2, quick=True)\nprint(ledger['order'].verdict)\n"
        "import jax\nprint(jax.config.jax_enable_x64)\n"
    )
    done = subprocess.run(
        [sys.executable, str(tmp_path / "session.py")], capture_output=True, text=True, check=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.stdout.split() == ["confirmed", "False"]


@needs("diffrax")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "words"), [("in_two_parts", "SemiImplicitEuler steps a system in two parts; form diffrax has one")]
)
def test_a_solver_that_does_not_fit_is_told_so(tmp_path, name, words):
    (tmp_path / "my.py").write_text(SOLVERS)
    code, said = judged(tmp_path / f"my.py:{name}", "--order", 1)
    assert code == 2
    assert words in said


@needs("diffrax")
@pytest.mark.slow
def test_an_implicit_solver_with_its_own_tolerances_is_judged(tmp_path):
    (tmp_path / "my.py").write_text(SOLVERS)
    code, findings = judged(tmp_path / "my.py:implicit", "--order", 1)
    assert (code, findings["order"]["verdict"]) == (0, "confirmed")


BATCHES = """
def mixes(f, t, y, h):
    return y + h * f(t, y.mean(0, keepdims=True) + 0 * y)

def first_row(f, t, y, h):
    return y[0] + h * f(t, y)[0]

def raises(f, t, y, h):
    return y + h * f(t, y) @ y
"""


@pytest.mark.slow
@pytest.mark.parametrize("form", [pytest.param("torch", marks=needs("torch")), pytest.param("jax", marks=needs("jax"))])
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("mixes", "a row of a batch must be stepped by itself"),
        ("first_row", "step must return a batch of states, shape (1, 6), not shape (6,)"),
        ("raises", "raises"),
    ],
)
def test_a_step_that_is_none_of_a_batch_is_told_so(tmp_path, form, name, words):
    (tmp_path / "my.py").write_text(BATCHES)
    code, said = judged(tmp_path / f"my.py:{name}", "--form", form)
    assert code == 2
    assert words in said


def heun(f, t, y, h):
    return y + h * f(t, y)


@pytest.mark.parametrize(
    ("package", "form"),
    [pytest.param(name, form, marks=without(name)) for name, form in (("torch", "torch"), ("jax", "jax"))],
)
def test_what_is_not_installed_is_named(package, form):
    with pytest.raises(symtop.SymtopError, match=f"form {form} needs the package {package}, which is not installed"):
        open_target(heun, form, "axis")


@pytest.mark.parametrize("form", [pytest.param("torch", marks=needs("torch")), pytest.param("jax", marks=needs("jax"))])
def test_the_angles_are_refused(form):
    with pytest.raises(symtop.SymtopError, match=f"must be axis or attitude for the form {form}, not 'angles'"):
        open_target(heun, form, "angles")


@needs("diffrax")
@pytest.mark.slow
@pytest.mark.parametrize(("name", "order"), [("own_finder", 1), ("loose", 3)])
def test_the_stages_of_an_implicit_solver_are_solved_whatever_its_root_finder(tmp_path, name, order):
    (tmp_path / "my.py").write_text(SOLVERS)
    code, findings = judged(f"{tmp_path / 'my.py'}:{name}", "--form", "diffrax", "--order", order)
    assert (code, findings["order"]["verdict"]) == (0, "confirmed")
