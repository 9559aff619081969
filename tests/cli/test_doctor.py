"""``symtop doctor``: no fault here, and each fault that can be made is found; ``--warm`` compiles every method."""

import importlib.metadata
import json
import shutil
from pathlib import Path

import pytest

import symtop
from symtop.cli import doctor
from symtop.core.files import cache_root
from symtop.measure import published
from tests.commands import call


def faults(findings):
    return {finding.topic: finding for finding in findings if not finding.healthy}


def test_all_is_well_here_and_it_says_what_it_saw(tmp_path):
    result = call("doctor", "--results", tmp_path, "--json")
    topics = {entry["topic"]: entry["result"] for entry in json.loads(result.output)}
    expected = {"python", "numba", "cache", "kernels cache", "reference cache", "studies", "published values"}
    assert expected <= set(topics)
    assert topics["heyoka quad"] == "33.7 digits"
    assert topics["numba"] == importlib.metadata.version("numba")
    count = len(published.published_values())
    assert topics["published values"] == f"{count} of {count} reproduced"


@pytest.mark.parametrize(("requirement", "result", "healthy"), [
    ("numpy[some-extra]>=2.0", "2.4.6", True), ("numpy[some-extra]>=3.0", "2.4.6", False),
    ("numpy~=2.0", "2.4.6", True), ("numpy~=1.26", "2.4.6", False), ("numpy>=2,!=2.4.6", "2.4.6", False),
    ("no-such-package", "absent", False), ("no-such-package; extra == 'peers'", "absent, an extra", True),
    ("numpy<2; extra == 'peers'", "2.4.6", False), ("no-such-package; sys_platform == 'amiga'", None, True),
    ("no-such-package; extra == 'peers' and sys_platform == 'amiga'", None, True),
    ("no-such-package; python_version >= '3.8'", "absent", False),
])  # fmt: skip
def test_every_form_of_a_requirement_is_read(monkeypatch, requirement, result, healthy):
    real = importlib.metadata.version
    monkeypatch.setattr(importlib.metadata, "requires", lambda _: [requirement])
    monkeypatch.setattr(importlib.metadata, "version", lambda name: "2.4.6" if name == "numpy" else real(name))
    findings = doctor._packages(Path())
    assert [(finding.result, finding.healthy) for finding in findings] == ([(result, healthy)] if result else [])
    assert all(finding.healthy or finding.advice for finding in findings)


def test_a_cache_that_cannot_be_written_and_a_wrong_number_are_seen(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("SYMTOP_CACHE", str(tmp_path / "file" / "cache"))
    assert "SYMTOP_CACHE" in faults(doctor._caches(Path()))["cache"].advice
    assert set(faults(doctor._results(Path("/proc/none")))) == {"results"}
    wrong = published.Published("somebody", "something", 1.0, 1.1, 1e-3, "printed")
    monkeypatch.setattr(published, "published_values", lambda: [wrong])
    findings = faults(doctor._self_check(Path()))
    assert "not somebody, something" in findings["published values"].result
    assert set(findings) == {"published values"}


def test_a_check_that_fails_is_a_finding_and_the_code_is_1(monkeypatch, tmp_path):
    def trouble(results):
        raise OSError("the tools are gone")

    monkeypatch.setitem(doctor.CHECKS, "machine", trouble)
    monkeypatch.setitem(doctor.CHECKS, "self-check", lambda _: [])
    result = call("doctor", "--results", tmp_path, code=1)
    assert "BAD  machine" in result.output
    assert "OSError: the tools are gone" in result.output


def test_every_compiled_method_is_run_in_each_of_its_charts():
    names = doctor.variants()
    assert len(names) == len(set(names))
    for method in symtop.integrators().values():
        variants = {f"{method.name}[{chart}]" for chart in method.charts()}
        assert variants <= set(names) if method.implementation != "python" else not variants & set(names)


@pytest.mark.slow
def test_all_of_them_are_compiled_once(monkeypatch, tmp_path):
    """From the kernels that other tests have left, less an eighth: all of them take six minutes."""
    (cache_root() / "kernels").mkdir(parents=True, exist_ok=True)
    shutil.copytree(cache_root() / "kernels", tmp_path / "kernels")
    for folder in sorted((tmp_path / "kernels").iterdir())[::8]:
        shutil.rmtree(folder)
    monkeypatch.setenv("SYMTOP_CACHE", str(tmp_path))
    result = call("doctor", "--warm", "--results", tmp_path / "r")
    assert doctor.kernels() > 100
    assert "not run" not in result.output
    again = call("doctor", "--warm", "--results", tmp_path / "r")
    assert "kernels compiled: 0;" in again.output
