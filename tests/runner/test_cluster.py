"""The runner on a dask cluster of two processes on this machine: the same bits (`tests.hostile` ends clusters)."""

import sys

import pytest

from symtop.core.errors import SymtopError
from symtop.run.ensemble import chunks
from symtop.run.ensemble.ensemble import ensemble
from symtop.run.ensemble.population import population
from symtop.runner.pool import Pool
from tests.commands import PROBE, finish, symtop

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("processes_with_dask"),
              pytest.mark.filterwarnings("ignore")]  # fmt: skip  # of the cluster's own making


@pytest.fixture(scope="module")
def cluster(processes_with_dask):
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50) as it:
        yield it


def test_a_case_that_fails_there_is_recorded_here(cluster, tmp_path):
    plugin = tmp_path / "bad.py"
    plugin.write_text(
        "import symtop\n"
        "def solve(top, start, plan):\n    raise RuntimeError('no luck')\n"
        "symtop.register(symtop.Integrator(name='bad-raises', family='other', summary='', solvers={'angles': solve}))\n"
    )
    words = ["study", PROBE, "--results", tmp_path / "r", "--plugin", plugin, "--scheduler", cluster.scheduler_address]
    code, out, err = finish(symtop(*words))
    assert (code, err.count("RuntimeError: no luck")) == (1, 2)
    assert "of 14 cases computed" in out


def test_an_ensemble_computed_there_is_the_one_computed_here(cluster, tmp_path, monkeypatch):
    members, options = population(90, seed=4), {"per_nutation": 20, "nutations": 2, "samples": 11, "quiet": True}
    monkeypatch.setattr(chunks, "CHUNK", 11 * 20)
    for name in ("strang", "cayley-tuned[axis]"):
        expected = ensemble(members, name, **options)
        assert ensemble(members, name, scheduler=cluster.scheduler_address, **options).identical(expected)
    path = tmp_path / "runs.nc"
    with ensemble(members, name, scheduler=cluster.scheduler_address, path=path, **options) as data:
        assert data.load().identical(expected)


def test_without_the_package_it_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SymtopError, match=r"pip install 'symtop\[distributed\]'"):
        Pool(scheduler="tcp://127.0.0.1:8786")
