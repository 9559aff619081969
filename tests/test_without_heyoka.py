"""symtop where heyoka cannot be imported, as on systems it has no wheels for: everything but the rows of `taylor`.

A `sitecustomize` hides the package from a whole tree of processes, the workers of a study included.
"""

import json
import re

import pytest

from tests.commands import customized, printed_by

HIDING = "import sys\nsys.modules['heyoka'] = None  # an import fails, and `find_spec` finds nothing\n"


@pytest.fixture
def hidden(tmp_path):
    return customized(tmp_path, HIDING)


def test_heyoka_is_hidden(hidden):
    done = hidden(python="import heyoka")
    assert done.returncode == 1
    assert "ModuleNotFoundError" in done.stderr


def test_the_registry_has_everything_but_taylor(hidden):
    pytest.importorskip("heyoka")  # else both lists are the same
    code = "import symtop, json; print(json.dumps(sorted(symtop.integrators())))"
    without = set(json.loads(hidden(python=code).stdout))
    with_it = set(json.loads(printed_by(code)))
    assert {name.split("-")[0] for name in with_it - without} == {"taylor"}
    assert not without - with_it


def test_taylor_is_refused_in_a_sentence(hidden):
    done = hidden("run", "spheroid", "taylor")
    assert done.returncode == 2
    (said,) = (line for line in done.stderr.splitlines() if not re.fullmatch(r"symtop: (loading|running), \d+ s", line))
    assert "taylor needs the package heyoka" in said


def test_a_run_its_error_and_a_certificate_in_40_digits(hidden):
    code = (
        "import symtop, numpy as np\n"
        "data = symtop.simulate('spheroid', 'strang', step_size=0.001, horizon=1.0)\n"
        "truth = symtop.reference('spheroid', data.time.values, certify='digits')\n"
        "print(float(abs(data.theta - truth.theta).max()), float(truth.theta_error_bound.max()))\n"
    )
    done = hidden(python=code)
    assert done.returncode == 0, done.stderr
    error, bound = done.stdout.split()
    assert 1e-9 < float(error) < 1e-4
    assert float(bound) < 1e-12


def test_advice_needs_no_taylor(hidden):
    done = hidden("recommend", "spheroid", "--accuracy", "1e-4", "--json")
    assert done.returncode == 0, done.stderr
    advice = json.loads(done.stdout)
    assert advice["integrator"]
    assert not advice["integrator"].startswith("taylor")


@pytest.mark.slow
def test_every_study_runs(hidden, tmp_path):
    """On coarse grids; three minutes."""
    done = hidden("study", "--all", "--quick", "--results", "here")
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    names = {path.stem for path in (tmp_path / "here" / "quick").glob("*.nc")}
    assert {"truth", "convergence", "cost", "drift", "stability", "reduction", "claims"} <= names
    assert hidden("report", "--results", "here/quick").returncode == 0
