"""Adapters of diffrax, torch and JAX: what fits is judged where they are installed; what does not is refused.

None of the three is imported in this process: JAX has threads, which a fork would lose, and judging forks.
"""

import importlib.util
import json

import numpy as np
import pytest

import symtop
from symtop.judging.adapters.external import field_of
from symtop.judging.claims.subject import open_target
from symtop.methods.framework.equations import FORMULATIONS
from tests.commands import ROOT, finish, printed_by, symtop as command
from tests.judging.blind.right import midpoint

SPHEROID = symtop.scene("spheroid")


def needs(package):
    return pytest.mark.skipif(importlib.util.find_spec(package) is None, reason=f"{package} is not installed")


def judge(*arguments):
    """The exit code, and the findings by claim, or what is said of the refusal."""
    code, out, err = finish(command("judge", *arguments, "--quick", "--json", PYTHONPATH=ROOT))
    return code, err if code == 2 else {finding["claim"]: finding for finding in json.loads(out)}


@pytest.mark.parametrize("chart", ["axis", "attitude"])
def test_the_equations_on_arrays_are_those_on_floats(chart):
    form = FORMULATIONS[chart]
    par, state = form.prepare(SPHEROID.top, SPHEROID.start)
    rows = np.array([state, np.array(state) + 0.1])
    rates = field_of(chart, par, lambda columns: np.stack(columns, axis=-1))(0.0, rows)
    np.testing.assert_array_equal(rates, [form.field(par, row) for row in rows.tolist()])


SOLVERS = """
import diffrax
import jax.numpy as jnp
import optimistix as optx
import symtop
node = jnp.array(2 / 3)
midpoint = diffrax.Midpoint()
implicit = diffrax.ImplicitEuler(root_finder=optx.Newton(rtol=1e-13, atol=1e-13))
own_finder = diffrax.ImplicitEuler()
loose = diffrax.Kvaerno3(root_finder=diffrax.VeryChord(rtol=1e-2, atol=1e-2))
in_two_parts = diffrax.SemiImplicitEuler()
def ralston(f, t, y, h):
    return y + h / 4 * (f(t, y) + 3 * f(t + node * h, y + node * h * f(t, y)))
"""


@needs("diffrax")
@pytest.mark.slow
def test_a_solver_in_a_session_that_has_imported_jax(tmp_path):
    (tmp_path / "my.py").write_text(SOLVERS.replace("def", "assert node.dtype == 'float64'\ndef"))
    first = "import symtop\nsymtop.compare('spheroid', 'my.py:ralston', cost='evaluations', budget=99, quiet=True)\n"
    code = "ledger = symtop.judge(midpoint, order=2, quick=True)\nprint(ledger['order'].verdict)\n"
    mode = "import jax\nprint(jax.config.jax_enable_x64)\n"
    output = printed_by(first + mode + SOLVERS + code + mode, cwd=tmp_path, PYTHONPATH=ROOT)
    assert output.split() == ["False", "confirmed", "False"]


BATCHES = """
def mixes(f, t, y, h):
    return y + h * f(t, y.mean(0, keepdims=True) + 0 * y)

def first_row(f, t, y, h):
    return y[0] + h * f(t, y)[0]

def raises(f, t, y, h):
    return y + h * f(t, y) @ y
"""
FORMS = [pytest.param(name, marks=needs(name)) for name in ("torch", "jax")]


@pytest.mark.slow
@pytest.mark.parametrize(("file", "options", "order"), [
    pytest.param("judged_diffrax.py:solver", (), 5, marks=needs("diffrax")),
    pytest.param("judged_batches.py:heun", ("--form", "torch"), 2, marks=needs("torch")),
    pytest.param("judged_batches.py:heun", ("--form", "jax", "--chart", "attitude"), 2, marks=needs("jax")),
    pytest.param("ralston", ("--form", "jax"), 2, marks=needs("diffrax")),  # its constant is made as it is loaded
    pytest.param("implicit", (), 1, marks=needs("diffrax")),  # with its own tolerances
    pytest.param("own_finder", (), 1, marks=needs("diffrax")),  # its stages are solved whatever its root finder
    pytest.param("loose", (), 3, marks=needs("diffrax")),
])  # fmt: skip
def test_a_method_has_its_order_and_no_more(tmp_path, file, options, order):
    (tmp_path / "my.py").write_text(SOLVERS)
    target = ROOT / "studies" / "examples" / file if ":" in file else f"{tmp_path / 'my.py'}:{file}"
    code, findings = judge(target, *options, "--order", order, "--not-symplectic")
    assert (code, findings["order"]["verdict"], findings["symplectic"]["verdict"]) == (0, "confirmed", "confirmed")
    if ":" in file:
        code, findings = judge(target, *options, "--order", order + 1)
        assert (code, findings["order"]["verdict"]) == (1, "refuted")


REFUSED = {
    "in_two_parts": "steps a system in two parts", "mixes": "a row of a batch must be stepped by itself",
    "first_row": "step must return a batch of states, shape (1, 6), not shape (6,)", "raises": "raises",
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("form", [*FORMS, pytest.param("diffrax", marks=needs("diffrax"))])
def test_what_does_not_fit_is_told_so(tmp_path, form):
    (tmp_path / "my.py").write_text(SOLVERS if form == "diffrax" else BATCHES)
    for name in ("in_two_parts",) if form == "diffrax" else ("mixes", "first_row", "raises"):
        code, output = judge(f"{tmp_path / 'my.py'}:{name}", "--form", form)
        assert (code, REFUSED[name] in output) == (2, True)


@pytest.mark.parametrize("form", ["torch", "jax"])
def test_what_is_not_installed_is_named_and_the_angles_are_refused(form):
    words = f"form {form} needs the package {form}, which", f"be axis or attitude for the form {form}, not 'angles'"
    installed = importlib.util.find_spec(form) is not None
    with pytest.raises(symtop.SymtopError, match=words[installed]):
        open_target(midpoint, form, ("axis", "angles")[installed])
