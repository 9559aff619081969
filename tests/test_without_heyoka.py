"""symtop where heyoka cannot be imported, as on systems it has no wheels for: everything but the rows of `taylor`.

A `sitecustomize` hides the package from a whole tree of processes, the workers of a study included.
"""

import importlib.util
import json

import pytest

import symtop
from tests.commands import customized

HIDING = "sys.modules['heyoka'] = None  # an import fails, and `find_spec` finds nothing\n"
COMMANDS = """
import importlib.util, json, symtop
from tests.commands import call
data = symtop.simulate("spheroid", "strang", step_size=0.001, horizon=1.0)
truth = symtop.reference("spheroid", data.time.values, certify="digits")
print(json.dumps({
    "spec": importlib.util.find_spec("heyoka"), "known": list(symtop.integrators()),
    "refused": call("run", "spheroid", "taylor", code=2).stderr,
    "error": float(abs(data.theta - truth.theta).max()), "bound": float(truth.theta_error_bound.max()),
    "advice": json.loads(call("recommend", "spheroid", "--accuracy", "1e-4", "--json").stdout),
}))
"""


@pytest.fixture
def hidden(tmp_path):
    return customized(tmp_path, HIDING)


@pytest.mark.slow
def test_taylor_alone_is_missing_and_refused_and_a_run_a_certificate_in_40_digits_and_advice_need_none(hidden):
    """All in one process, as each start takes two seconds."""
    result = hidden(python=COMMANDS)
    assert result.returncode == 0, result.stderr
    report = json.loads(result.stdout)
    assert report["spec"] is None
    (error,) = report["refused"].splitlines()
    assert "taylor needs the package heyoka" in error
    assert 1e-9 < report["error"] < 1e-4
    assert report["bound"] < 1e-12
    assert report["advice"]["integrator"]
    assert not report["advice"]["integrator"].startswith("taylor")
    names, all_names = set(report["known"]), set(symtop.integrators())
    assert not names - all_names
    missing = {"taylor"} if importlib.util.find_spec("heyoka") else set()  # without it both lists are the same
    assert {name.split("-")[0] for name in all_names - names} == missing


@pytest.mark.slow
def test_every_study_runs(hidden, tmp_path):
    """On coarse grids; three minutes."""
    result = hidden("study", "--all", "--quick", "--results", "here")
    assert result.returncode == 0, result.stdout[-3000:] + result.stderr[-3000:]
    names = {path.stem for path in (tmp_path / "here" / "quick").glob("*.nc")}
    assert {"truth", "convergence", "cost", "drift", "stability", "reduction", "claims"} <= names
    assert hidden("report", "--results", "here/quick").returncode == 0
