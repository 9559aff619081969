"""``symtop doctor``: checks of the packages, the caches, the folders and a few computed numbers.

Each finding is healthy or says what to do. The self-check takes some seconds: published values of this problem, the
closed form against heyoka's Taylor series, and one compiled method against the closed form.
"""

import importlib.metadata
import importlib.util
import math
import os
import platform
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from symtop.core.progress import beating

LEAST_SPACE = 500_000_000  # free bytes below which a full run of the studies may not fit on the disk
LARGE_CACHE = 5_000_000_000  # bytes of a cache that the doctor advises to delete
TAYLOR_GAP = 1e-12  # rad, allowed between the closed form and Taylor over one horizon
MIDPOINT_GAP = 1e-2  # rad, allowed between the closed form and midpoint with a step of 0.001
OLDEST_PYTHON = (3, 11)


class Finding(NamedTuple):
    """The result of one check, and what to do if it is not healthy."""

    topic: str
    result: str
    healthy: bool = True
    advice: str = ""


def examine(results: Path) -> list[Finding]:
    """Run every check; one that raises becomes a finding that is not healthy."""
    checks: list[Callable[[], list[Finding]]] = [
        _python, _packages, _heyoka, _caches, lambda: _results(results), _tools, _self_check,
    ]  # fmt: skip
    findings = []
    with beating(tqdm(total=len(checks), desc="checking", unit="check", disable=None, leave=False)) as bar:
        for check in checks:
            try:
                findings += check()
            except Exception as error:  # noqa: BLE001  (one check that fails must not hide the others)
                topic = check.__name__.strip("_").replace("_", " ")
                findings.append(Finding(topic, _sentence(error), False, "report this with all of this page"))
            bar.update()
    return findings


def page(findings: list[Finding]) -> str:
    """The findings as text, one a line, and the advice at the end."""
    width = max(len(finding.topic) for finding in findings)
    lines = [f"{'ok ' if f.healthy else 'BAD'}  {f.topic.ljust(width)}  {f.result}" for f in findings]
    advice = [f"{finding.topic}: {finding.advice}" for finding in findings if not finding.healthy]
    return "\n".join([*lines, "", *(advice or ["No faults were found."])])


def _sentence(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


def _python() -> list[Finding]:
    result = f"{platform.python_version()} at {sys.executable}, {platform.system()} {platform.machine()}"
    oldest = ".".join(map(str, OLDEST_PYTHON))
    return [Finding("python", result, sys.version_info >= OLDEST_PYTHON, f"symtop needs Python {oldest} or newer")]


def _packages() -> list[Finding]:
    """Every requirement of symtop's metadata that applies to this machine, and whether its version is in range.

    A requirement of an extra may be absent; one that is installed must be in range too.
    """
    from packaging.requirements import Requirement

    extras = importlib.metadata.metadata("symtop").get_all("Provides-Extra") or []
    findings = []
    for requirement in map(Requirement, importlib.metadata.requires("symtop") or []):
        marker, requirement.marker = requirement.marker, None
        applies = [marker is None or marker.evaluate({"extra": extra}) for extra in ("", *extras)]
        if not any(applies):
            continue  # for another system or another Python
        required = applies[0]
        try:
            result = importlib.metadata.version(requirement.name)
            healthy = requirement.specifier.contains(result, prereleases=True)
            advice = f"needs {requirement.specifier}: pip install --upgrade '{requirement}'"
        except importlib.metadata.PackageNotFoundError:
            result, healthy = "absent" if required else "absent, an extra", not required
            advice = f"pip install '{requirement}'"
        findings.append(Finding(requirement.name, result, healthy, advice))
    return findings


def _heyoka() -> list[Finding]:
    """The precisions that this build of heyoka has."""
    if importlib.util.find_spec("heyoka") is None:
        advice = "heyoka has wheels for Linux only; elsewhere try conda-forge. The closed form works without it"
        return [Finding("precisions", "no Taylor series: heyoka is absent", False, advice)]
    from symtop.methods.taylor.heyoka import arithmetic, stepper

    findings = []
    for precision in ("double", "longdouble", "quad"):
        try:
            epsilon = arithmetic(precision).epsilon
            stepper("axis", precision, 100.0 * epsilon)
            result, healthy = f"{-math.log10(epsilon):.1f} digits", precision != "longdouble" or epsilon < 1e-16
            advice = "long double is double on this machine: use precision='quad' where it matters"
        except Exception as error:  # noqa: BLE001
            result, healthy = _sentence(error), False
            advice = f"this build of heyoka has no {precision}; the truth study leaves it out"
        findings.append(Finding(f"heyoka {precision}", result, healthy, advice))
    return findings


def _caches() -> list[Finding]:
    from symtop.core.files import DAY, by_last_use, cache_root, size_of

    root, yesterday = cache_root(), time.time() - DAY
    findings = [_writable("cache", root, "set SYMTOP_CACHE to a folder that can be written")]
    for name, kind, remedy in (("kernels", "kernel", "compiled again"), ("reference", "file", "computed again")):
        entries = by_last_use(root / name)
        size = sum(map(size_of, entries))
        recent = sum(entry.stat().st_mtime >= yesterday for entry in entries)
        result = f"{len(entries)} {kind}{'s' * (len(entries) != 1)}, {_bytes(size)}"
        result += f", {recent} of them used or made within a day" if entries else ""
        advice = f"{root / name} may be deleted at any time; what is needed is {remedy}"
        findings.append(Finding(f"{name} cache", result, size < LARGE_CACHE, advice))
    return findings


def _results(results: Path) -> list[Finding]:
    writable = _writable("results", results, "name another folder with --results")
    sizes = [path.stat().st_size for path in results.glob("**/cases/*/*.nc")]
    return [writable, Finding("stored cases", f"{len(sizes)} in {results}, {_bytes(sum(sizes))}")]


def _writable(topic: str, folder: Path, advice: str) -> Finding:
    """Can the folder be written, or made in its nearest parent, and is there space on its disk?"""
    place = next((path for path in (folder, *folder.resolve().parents) if path.exists()), Path("/"))
    try:
        with tempfile.TemporaryFile(dir=place):
            free = shutil.disk_usage(place).free
    except OSError as error:
        return Finding(topic, f"{folder}: {error.strerror or error}", False, advice)
    return Finding(topic, f"{folder}, {_bytes(free)} free", free > LEAST_SPACE, f"make room, or {advice}")


def _tools() -> list[Finding]:
    from symtop.runner import scripts

    return [
        Finding("studies", f"{len(scripts.names())} in {scripts.folder()}"),
        Finding("cores", f"{os.cpu_count()}"),
        Finding("gcc", shutil.which("gcc") or "absent; only the benchmarks of a checkout (make bench) need it"),
    ]


def _self_check() -> list[Finding]:
    """Published values, and three ways to compute one motion, against each other."""
    from symtop.measure.published import published_values
    from symtop.run.simulation import simulate

    wrong = "numbers computed here cannot be trusted: reinstall the pinned packages (constraints.txt) and try again"
    began = time.perf_counter()
    values = published_values()
    missed = [f"{value.source}, {value.quantity}" for value in values if not value.reproduced]
    result = f"{len(values) - len(missed)} of {len(values)} reproduced{': not ' + '; '.join(missed) if missed else ''}"
    findings = [Finding("published values", result, not missed, wrong)]
    exact = simulate("spheroid", "exact", samples=41)
    runs: list[tuple[str, float | None, float]] = [("midpoint", 1e-3, MIDPOINT_GAP)]
    runs += [("taylor", None, TAYLOR_GAP)] if importlib.util.find_spec("heyoka") else []
    for name, step, allowed in runs:
        data = simulate("spheroid", name, step_size=step, samples=41, observe="attitude", guard=False)
        gap = float(np.max(np.abs(data["axis"].values - exact["axis"].values)))
        result = f"{gap:.1e} rad from the truth on spheroid (allowed {allowed:g})"
        findings.append(Finding(name, result, gap <= allowed, wrong))
    return [*findings, Finding("self-check", f"{time.perf_counter() - began:.1f} s")]


def _bytes(size: float) -> str:
    for unit in ("B", "kB", "MB"):
        if size < 1000.0:
            return f"{size:.0f} {unit}"
        size /= 1000.0
    return f"{size:.1f} GB"
