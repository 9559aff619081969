"""``symtop doctor``: what is installed, cached and writable here, a few numbers against published ones, and advice.

Each finding is healthy or comes with what to do about it. The self-check takes some seconds: published values of this
problem, the closed form against heyoka's Taylor series, and one compiled method against the closed form.
"""

import importlib.metadata
import importlib.util
import math
import os
import platform
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

LITTLE = 500_000_000  # bytes of a disk below which a full run of the studies may not fit
LARGE = 5_000_000_000  # bytes of a cache that are worth a word
AGREE = 1e-12  # rad, closed form against Taylor over one horizon
OLDEST = (3, 11)


class Finding(NamedTuple):
    """One thing that was looked at."""

    topic: str
    found: str
    healthy: bool = True
    advice: str = ""


def examine(results: Path) -> list[Finding]:
    """Look at everything; a look that fails is a finding too."""
    looks: list[Callable[[], list[Finding]]] = [
        _python, _packages, _heyoka, _caches, lambda: _results(results), _scripts, _tools, _self_check,
    ]  # fmt: skip
    found = []
    for look in looks:
        try:
            found += look()
        except Exception as error:  # noqa: BLE001  (a doctor reports, whatever ails)
            topic = getattr(look, "__name__", "look").strip("_").replace("_", " ")
            said = " ".join(f"{type(error).__name__}: {error}".split())
            found.append(Finding(topic, said, healthy=False, advice="report this with all of this page"))
    return found


def page(findings: list[Finding]) -> str:
    """The findings as text, and what to do at the end."""
    width = max(len(finding.topic) for finding in findings)
    lines = [f"{'ok ' if f.healthy else 'BAD'}  {f.topic.ljust(width)}  {f.found}" for f in findings]
    ill = [finding for finding in findings if not finding.healthy]
    lines += (
        ["", *(f"{finding.topic}: {finding.advice}" for finding in ill)] if ill else ["", "Nothing to complain of."]
    )
    return "\n".join(lines)


def _python() -> list[Finding]:
    said = f"{platform.python_version()} at {sys.executable}, {platform.system()} {platform.machine()}"
    asked = ".".join(map(str, OLDEST))
    return [Finding("python", said, sys.version_info >= OLDEST, f"symtop needs Python {asked} or newer")]


def _packages() -> list[Finding]:
    """Every requirement that symtop's own metadata states, its version, and whether that is enough."""
    found = []
    for requirement in importlib.metadata.requires("symtop") or []:
        wanted, _, marker = requirement.partition(";")
        match = re.fullmatch(r"\s*([\w.-]+)\s*(?:>=\s*([\d.]+))?\s*", wanted)
        if match is None:
            continue
        name, least = match.group(1), match.group(2) or "0"
        optional = "extra" in marker or ("linux" in marker and sys.platform != "linux")
        try:
            version = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            said = "absent, an extra" if optional else "absent"
            found.append(Finding(name, said, optional, f"pip install '{wanted.strip()}'"))
            continue
        good = _numbers(version) >= _numbers(least)
        found.append(Finding(name, version, good, f"needs {least} or newer: pip install --upgrade '{wanted.strip()}'"))
    return found


def _numbers(version: str) -> list[int]:
    return [int(part) for part in re.findall(r"\d+", version)[:3]]


def _heyoka() -> list[Finding]:
    if importlib.util.find_spec("heyoka") is None:
        advice = "heyoka has wheels for Linux only; elsewhere try conda-forge. The closed form stands alone meanwhile"
        return [Finding("precisions", "no Taylor series: heyoka is absent", healthy=False, advice=advice)]
    from symtop.methods.taylor import arithmetic, stepper

    found = []
    for precision in ("double", "longdouble", "quad"):
        try:
            working = arithmetic(precision)
            stepper("axis", precision, 100.0 * working.epsilon)
        except Exception as error:  # noqa: BLE001
            said = " ".join(f"{type(error).__name__}: {error}".split())
            advice = f"this build of heyoka has no {precision}; the truth study leaves it out"
            found.append(Finding(f"heyoka {precision}", said, healthy=False, advice=advice))
            continue
        digits = -math.log10(working.epsilon)
        wide = precision != "longdouble" or working.epsilon < 1e-16
        advice = "long double is double on this machine: use precision='quad' where it matters"
        found.append(Finding(f"heyoka {precision}", f"{digits:.1f} digits", wide, advice))
    return found


def _caches() -> list[Finding]:
    from symtop.methods.compiled import cache_root, source_digest

    root = cache_root()
    found = [_writable("cache", root, "set SYMTOP_CACHE to a folder that can be written")]
    for name, remedy in (("kernels", "compiled again"), ("reference", "computed again")):
        folder = root / name
        files = [path for path in folder.rglob("*") if path.is_file()] if folder.is_dir() else []
        size = sum(path.stat().st_size for path in files)
        said = f"{len(files)} files, {_bytes(size)}"
        if name == "kernels":
            said += ", these sources' among them" if (folder / source_digest()).is_dir() else ", none of these sources"
        advice = f"{folder} may be deleted at any time; what is needed is {remedy}"
        found.append(Finding(f"{name} cache", said, size < LARGE, advice))
    return found


def _results(results: Path) -> list[Finding]:
    found = [_writable("results", results, "name another folder with --results")]
    stored = list(results.glob("**/cases/*/*.nc")) if results.is_dir() else []
    size = sum(path.stat().st_size for path in stored)
    found.append(Finding("stored cases", f"{len(stored)} in {results}, {_bytes(size)}"))
    return found


def _writable(topic: str, folder: Path, advice: str) -> Finding:
    place = next((path for path in (folder, *folder.resolve().parents) if path.exists()), Path("/"))
    try:
        with tempfile.TemporaryFile(dir=place):
            free = shutil.disk_usage(place).free
    except OSError as error:
        return Finding(topic, f"{folder}: {error.strerror or error}", healthy=False, advice=advice)
    said = f"{folder}, {_bytes(free)} free"
    return Finding(topic, said, free > LITTLE, f"make room, or {advice}")


def _scripts() -> list[Finding]:
    from symtop.runner import scripts

    return [Finding("studies", f"{', '.join(scripts.names())} in {scripts.folder()}")]


def _tools() -> list[Finding]:
    compiler = shutil.which("gcc")
    return [
        Finding("cores", f"{os.cpu_count()}"),
        Finding("gcc", compiler or "absent; only make bench needs it"),
    ]


def _self_check() -> list[Finding]:
    from symtop.measure.published import published_values
    from symtop.methods.registry import integrators
    from symtop.run.simulation import simulate

    wrong = "numbers made here cannot be trusted: reinstall the pinned packages (constraints.txt) and try again"
    began = time.perf_counter()
    values = published_values()
    missed = [f"{value.source}, {value.quantity}" for value in values if not value.reproduced]
    said = f"{len(values) - len(missed)} of {len(values)} reproduced{': not ' + '; '.join(missed) if missed else ''}"
    found = [Finding("published values", said, not missed, wrong)]
    known, exact = integrators(), simulate("spheroid", "exact", samples=41)
    checks: list[tuple[str, float | None, float]] = [("midpoint", 1e-3, 1e-2)]
    checks += [("taylor", None, AGREE)] if importlib.util.find_spec("heyoka") else []
    for name, step, least in checks:
        run = simulate("spheroid", known[name], step_size=step, samples=41, observe="attitude", guard=False)
        gap = float(np.max(np.abs(run["axis"].values - exact["axis"].values)))
        said = f"{gap:.1e} rad from the closed form on spheroid (allowed {least:g})"
        found.append(Finding(name, said, gap <= least, wrong))
    return [*found, Finding("self-check", f"{time.perf_counter() - began:.1f} s")]


def _bytes(size: float) -> str:
    for unit in ("B", "kB", "MB"):
        if size < 1000.0:
            return f"{size:.0f} {unit}"
        size /= 1000.0
    return f"{size:.1f} GB"
