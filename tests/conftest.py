"""Shared fixtures: a cache of the tests' own, random tops, and the 30-digit states."""

import contextlib
import gc
import json
import math
import os
import random
import shutil
import signal
import sys
from pathlib import Path

import pytest

os.environ.setdefault("SYMTOP_CACHE", str(Path(__file__).resolve().parent.parent / ".pytest_cache" / "symtop"))

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its threads wait for each other on busy cores

# processes that tests start import dask only where they say so
os.environ["PYTHONPATH"] = os.pathsep.join(
    [str(Path(__file__).resolve().parent / "bare"), *filter(None, [os.environ.get("PYTHONPATH")])]
)

if sys.modules.get("dask", sys) is None:  # the processes that share the tests out are such processes
    del sys.modules["dask"]

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell starts what runs in its background like that
    signal.signal(signal.SIGINT, signal.default_int_handler)

from symtop.core import files
from symtop.methods.framework import lanes, registry
from symtop.model import scenes
from symtop.model.lazy_kernel import LAZY
from symtop.model.scenes import Scene
from symtop.model.top import Angles, SymmetricTop
from symtop.run import plugins
from symtop.runner import scripts
from tests.commands import call

scripts.install()  # tests import `symtop_studies`


LONGEST = (  # files whose tests take longest, begun first: one that begins last keeps a process busy alone
    "test_blind", "test_adapters", "test_claims", "test_right_hand_side", "test_explore", "test_report", "test_advise",
    "test_blocks", "test_random_runs", "test_reference", "test_exact", "test_streamed", "test_first_minutes",
    "test_factors", "test_other_systems", "test_stale", "test_analyses",
)  # fmt: skip
STORED = Path(__file__).resolve().parent.parent / "results" / "quick"


@pytest.hookimpl(tryfirst=True)  # before the marks choose
def pytest_collection_modifyitems(items):
    """Files in the order of `LONGEST`, then as they were; tests that read the results of every study are `quick`."""
    for item in items:
        if "quick_results" in item.fixturenames:
            item.add_marker("quick")
    place = {name: k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))


@pytest.hookimpl(trylast=True)
def pytest_collection_finish():
    """What was imported and collected stays: no collection of garbage has to look at it."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop():
    """The first of several processes compiles the closed form, which each would interpret for seconds before it did."""
    if os.environ.get("PYTEST_XDIST_WORKER") == "gw0":
        for kernel in LAZY:
            kernel.compile()


@pytest.fixture(scope="module")
def processes_with_dask():
    """Processes that a file's tests start may import dask, if a cluster can be made here."""
    pytest.importorskip("distributed")  # half a second, of those alone who ask
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("SYMTOP_TESTS_DASK", "1")
        yield


def _forgetting():
    """Forget the integrators, scenes and plug-ins that are registered from now on."""
    registry.integrators()  # the built-in ones are registered first
    stores = (registry._registry, scenes._added, plugins._loaded)
    before = [store.copy() for store in stores]
    yield
    for store, entries in zip(stores, before, strict=True):
        store.clear()
        store.update(entries)


_registered_for_a_while = contextlib.contextmanager(_forgetting)
_registered_for_one_file = pytest.fixture(scope="module", autouse=True)(_forgetting)  # so that files run in any order
clean_registry = pytest.fixture(_forgetting)  # of what one test registers


@pytest.fixture
def in_lanes(monkeypatch):
    """Ensembles of few steps, too, compile their kernels in lanes."""
    monkeypatch.setattr(lanes, "FEW_STEPS", -1)


@pytest.fixture(autouse=True)
def _figures_closed():
    """Close the figures that a test has drawn: matplotlib warns of more than 20, and a warning is an error here."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture(scope="session")
def quick_results(tmp_path_factory) -> Path:
    """Results of every study, quickly, to read: made once for all processes of a run of the tests."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "results-of-all"
    marker = folder / "done"
    with files.locked(folder / "making", wait=True):
        if not marker.is_file():
            if STORED.is_dir():  # after `make quick`: what is up to date need not be computed twice
                shutil.copytree(STORED, folder / "quick", dirs_exist_ok=True)
            with _registered_for_a_while():
                call("study", "--all", "--quick", "--results", folder)
            marker.touch()
    return folder / "quick"


@pytest.fixture(scope="session")
def truth() -> dict:
    """States of named scenes to 30 digits, from four independent evaluations."""
    path = Path(__file__).parent / "data" / "truth.json"
    return {name: entry for name, entry in json.loads(path.read_text()).items() if not name.startswith("_")}


def defer(*sets, mark="quick"):
    """Parameters of a test with a mark: `quick` waits for `make quick`, as it compiles much; `slow` takes long."""
    return [pytest.param(*(row if isinstance(row, tuple) else [row]), marks=getattr(pytest.mark, mark)) for row in sets]


def random_scenes(count: int, seed: int) -> list[Scene]:
    """Ordinary tops in ordinary motion, away from the poles."""
    draw = random.Random(seed)
    ranges = (0.4, 2.6), (-math.pi, math.pi), (-math.pi, math.pi), (-1.0, 1.0), (-2.0, 2.0), (-6.0, 6.0)
    sample = []
    for k in range(count):
        I1 = draw.uniform(0.3, 4.0)
        top = SymmetricTop(I1, draw.uniform(0.2, 1.9) * I1, draw.uniform(-3.0, 6.0))
        sample.append(Scene(f"random-{k}", top, Angles(*(draw.uniform(*between) for between in ranges)), 5.0))
    return sample
