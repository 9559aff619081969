"""``symtop doctor``: sound here, and each ailment that can be had is found, named and treated."""

import importlib.metadata
import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from symtop.cli import doctor
from symtop.cli.main import main
from symtop.measure import published


def ill(findings):
    return {finding.topic: finding for finding in findings if not finding.healthy}


def test_all_is_well_here_and_it_says_what_it_saw(tmp_path):
    done = CliRunner().invoke(main, ["doctor", "--results", str(tmp_path), "--json"])
    assert done.exit_code == 0, done.output
    topics = {entry["topic"]: entry["found"] for entry in json.loads(done.output)}
    assert {"python", "numba", "cache", "kernels cache", "reference cache", "studies", "published values"} <= set(
        topics
    )
    assert topics["heyoka quad"] == "33.7 digits"
    assert topics["numba"] == importlib.metadata.version("numba")
    count = len(published.published_values())
    assert topics["published values"] == f"{count} of {count} reproduced"


def test_a_package_that_is_missing_or_too_old(monkeypatch):
    real = importlib.metadata.version

    def version(name):
        if name == "tqdm":
            raise importlib.metadata.PackageNotFoundError(name)
        return "0.1" if name == "numba" else real(name)

    monkeypatch.setattr(importlib.metadata, "version", version)
    found = ill(doctor._packages())
    assert set(found) == {"tqdm", "numba"}
    assert found["tqdm"].advice.startswith("pip install 'tqdm")
    assert "or newer" in found["numba"].advice


def test_a_cache_that_cannot_be_written(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("SYMTOP_CACHE", str(tmp_path / "file" / "cache"))
    found = ill(doctor._caches())
    assert "SYMTOP_CACHE" in found["cache"].advice
    assert set(ill(doctor._results(Path("/proc/none")))) == {"results"}


def test_a_disk_without_room(tmp_path, monkeypatch):
    monkeypatch.setattr(doctor, "LITTLE", 1e30)
    assert "make room" in ill(doctor._results(tmp_path))["results"].advice


def test_a_wrong_number_is_seen(monkeypatch):
    wrong = published.Published("somebody", "something", 1.0, 1.1, 1e-3, "printed")
    monkeypatch.setattr(published, "published_values", lambda: [wrong])
    found = ill(doctor._self_check())
    assert "not somebody, something" in found["published values"].found
    assert set(found) == {"published values"}


def test_a_look_that_fails_is_a_finding_and_the_code_is_1(monkeypatch, tmp_path):
    def trouble():
        raise OSError("the tools are gone")

    monkeypatch.setattr(doctor, "_tools", trouble)
    monkeypatch.setattr(doctor, "_self_check", list)
    done = CliRunner().invoke(main, ["doctor", "--results", str(tmp_path)])
    assert done.exit_code == 1
    assert "BAD  trouble" in done.output
    assert "OSError: the tools are gone" in done.output


@pytest.mark.parametrize(("size", "said"), [(0, "0 B"), (1500, "2 kB"), (3e7, "30 MB"), (2e9, "2.0 GB")])
def test_sizes_are_readable(size, said):
    assert doctor._bytes(size) == said
