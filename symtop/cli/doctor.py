"""``symtop doctor``: checks of the packages, the caches, the folders and a few computed numbers."""

import concurrent.futures
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
from typing import Any, NamedTuple

import click

from symtop.cli.common import as_text, json_option, results_option
from symtop.core.errors import words_of
from symtop.core.files import DAY, by_last_use, cache_root, distrust, size_of
from symtop.core.progress import progress_bar

LEAST_SPACE = 500_000_000  # free bytes below which a full run of the studies may not fit on the disk
LARGE_CACHE = 5_000_000_000  # bytes above which the advice is to delete a cache
TAYLOR_GAP = 1e-12  # rad, allowed between the closed form and Taylor over one horizon
MIDPOINT_GAP = 1e-2  # rad, allowed between the closed form and midpoint with a step of 0.001


class Finding(NamedTuple):
    """The result of one check, and what to do if it is not healthy."""

    topic: str
    result: str
    healthy: bool = True
    advice: str = ""


def examine(results: Path) -> list[Finding]:
    """Run every check; one that raises becomes a finding that is not healthy."""
    findings = []
    with progress_bar("checking", iterable=CHECKS.items(), unit="check") as bar:
        for topic, check in bar:
            try:
                findings += check(results)
            except Exception as error:  # noqa: BLE001  (one check that fails must not hide the others)
                findings.append(Finding(topic, words_of(error), False, "report this with all of this page"))
    return findings


def _machine(_: Path) -> list[Finding]:
    from symtop.runner import scripts

    return [
        Finding("python", f"{platform.python_version()} at {sys.executable}, {platform.system()} {platform.machine()}"),
        Finding("studies", f"{len(scripts.names())} in {scripts.folder()}"),
        Finding("cores", f"{os.cpu_count()}"),
        Finding("gcc", shutil.which("gcc") or "absent; only the benchmarks of a checkout (make bench) need it"),
    ]


def _packages(_: Path) -> list[Finding]:
    """Every requirement for this machine, and whether its version is in range; those of extras may be absent."""
    from packaging.requirements import Requirement

    extras = importlib.metadata.metadata("symtop").get_all("Provides-Extra") or []
    findings = []
    for requirement in map(Requirement, importlib.metadata.requires("symtop") or []):
        marker, requirement.marker = requirement.marker, None
        required, *optional = (marker is None or marker.evaluate({"extra": extra}) for extra in ("", *extras))
        if not (required or any(optional)):
            continue  # for another system or another Python
        try:
            result = importlib.metadata.version(requirement.name)
            healthy = requirement.specifier.contains(result, prereleases=True)
            advice = f"needs {requirement.specifier}: pip install --upgrade '{requirement}'"
        except importlib.metadata.PackageNotFoundError:
            result, healthy = "absent" if required else "absent, an extra", not required
            advice = f"pip install '{requirement}'"
        findings.append(Finding(requirement.name, result, healthy, advice))
    return findings


def _heyoka(_: Path) -> list[Finding]:
    if importlib.util.find_spec("heyoka") is None:
        words = "no Taylor series: heyoka is absent; it has wheels for Linux only, elsewhere try conda-forge"
        return [Finding("precisions", words)]  # if it is required, `_packages` reports that
    from symtop.methods.taylor.heyoka import arithmetic, stepper

    findings = []
    for precision in ("double", "longdouble", "quad"):
        try:
            epsilon = arithmetic(precision).epsilon
            stepper("axis", precision, 100.0 * epsilon)
            result, healthy = f"{-math.log10(epsilon):.1f} digits", precision != "longdouble" or epsilon < 1e-16
            advice = "long double is double on this machine: use precision='quad' where it matters"
        except Exception as error:  # noqa: BLE001
            result, healthy = words_of(error), False
            advice = f"this build of heyoka has no {precision}; the truth study leaves it out"
        findings.append(Finding(f"heyoka {precision}", result, healthy, advice))
    return findings


def _caches(_: Path) -> list[Finding]:
    root, yesterday = cache_root(), time.time() - DAY
    findings = [_writable("cache", root, "set SYMTOP_CACHE to a folder that can be written")]
    doubts = [distrust(path) for path in (root, root / "kernels", *(root / "kernels").rglob("*"))]
    why, remedy = next(filter(any, doubts), ("nobody else can write it", ""))
    findings.append(Finding("compiled code", why, not remedy, remedy))
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
    sizes = [path.stat().st_size for path in results.glob("**/cases/*/*.npz")]
    return [writable, Finding("stored cases", f"{len(sizes)} in {results}, {_bytes(sum(sizes))}")]


def _writable(topic: str, folder: Path, advice: str) -> Finding:
    """The finding on whether a folder can be written, or made in its nearest parent, and its disk has space."""
    parent = next((path for path in (folder, *folder.resolve().parents) if path.exists()), Path("/"))
    try:
        with tempfile.TemporaryFile(dir=parent):
            free = shutil.disk_usage(parent).free
    except OSError as error:
        return Finding(topic, f"{folder}: {error.strerror or error}", False, advice)
    return Finding(topic, f"{folder}, {_bytes(free)} free", free > LEAST_SPACE, f"make room, or {advice}")


def _self_check(_: Path) -> list[Finding]:
    """Findings on published values, and on midpoint and taylor against the closed form."""
    from symtop.measure.published import published_values
    from symtop.run.simulation import simulate

    advice = "numbers computed here cannot be trusted: reinstall the pinned packages (constraints.txt) and try again"
    began = time.perf_counter()
    values = published_values()
    failures = [f"{value.source}, {value.quantity}" for value in values if not value.reproduced]
    missing = f": not {'; '.join(failures)}" if failures else ""
    result = f"{len(values) - len(failures)} of {len(values)} reproduced{missing}"
    findings = [Finding("published values", result, not failures, advice)]
    exact = simulate("spheroid", "exact", samples=41)
    for name, step, limit in (("midpoint", 1e-3, MIDPOINT_GAP), ("taylor", None, TAYLOR_GAP)):
        if name == "taylor" and importlib.util.find_spec("heyoka") is None:
            continue
        data = simulate("spheroid", name, step_size=step, samples=41, observe="attitude", guard=False)
        gap = float(abs(data["axis"] - exact["axis"]).max())
        result = f"{gap:.1e} rad from the truth on spheroid (allowed {limit:g})"
        findings.append(Finding(name, result, gap <= limit, advice))
    return [*findings, Finding("self-check", f"{time.perf_counter() - began:.1f} s")]


def _bytes(size: float) -> str:
    power = min(math.floor(math.log10(max(size, 1.0))) // 3, 3)
    return f"{size / 1000.0**power:.{power // 3}f} {('B', 'kB', 'MB', 'GB')[power]}"


CHECKS: dict[str, Callable[[Path], list[Finding]]] = {
    "machine": _machine, "packages": _packages, "heyoka": _heyoka, "caches": _caches, "results": _results,
    "self-check": _self_check,
}  # fmt: skip
SCENE, BODY_SCENE = "goldstein", "heavy-brick"
WARM_PERIODS = 0.02  # nutations: the length of a run that compiles a kernel


def _run(name: str) -> str:
    """Compile the kernels of a variant, alone and in an ensemble, or of the reference for name ""; returns an error."""
    import numpy as np

    from symtop.methods.framework.lanes import LEAST_MEMBERS
    from symtop.methods.framework.loop import inside
    from symtop.methods.framework.registry import integrator
    from symtop.model.lazy_kernel import LAZY
    from symtop.model.scenes import scene
    from symtop.run.ensemble.ensemble import ensemble
    from symtop.run.ensemble.inputs import read_members
    from symtop.run.reference.truth import reference
    from symtop.run.simulation import simulate

    scene_name = BODY_SCENE if name.endswith("[body]") else SCENE
    span = WARM_PERIODS * scene(scene_name, bodies=True).nutation_period
    try:
        if not name:
            for kernel in LAZY:
                kernel.compile()
            run = simulate(SCENE, "strang", step_size=span / 2, horizon=50 * span, samples=3)
            reference(SCENE, run["time"].values)
            return ""
        variant = integrator(name)
        setting = variant.given(span / 2 if variant.fixed_step else max(1e-6, variant.least_tolerance))
        observe = "axis" if name.endswith("[axis]") else "attitude"
        options: dict[str, Any] = {**setting, "observe": observe, "horizon": span, "samples": 2}
        simulate(scene_name, name, **options)
        solver = inside(*variant.solvers.values())
        if solver is None or not solver.in_lanes:
            ensemble([scene_name] * 2, name, **options, threads=1, quiet=True)
        else:  # with as many members as fill a block
            rows, ones = read_members([scene_name] * LEAST_MEMBERS).numbers, np.ones(LEAST_MEMBERS)
            solver.many(rows, span / 2 * ones, np.array([[0, 2]] * LEAST_MEMBERS), compiling=True)
    except Exception as error:  # noqa: BLE001  (one that fails must not keep the others from being compiled)
        return f"{name or 'truth'}: {words_of(error)}"
    return ""


def variants() -> list[str]:
    """Every variant, ``method[chart]``, of a compiled method."""
    from symtop.methods.framework.registry import integrators

    compiled = [method for method in integrators().values() if method.implementation == "compiled"]
    return [f"{method.name}[{chart}]" for method in compiled for chart in method.solvers]


def kernels() -> int:
    """The number of kernels on disk."""
    return sum(1 for _ in (cache_root() / "kernels").glob("*"))


@click.command(short_help="Check the installation; say what to do about faults.")
@results_option
@click.option("--warm", is_flag=True, help="First compile every method, for runs and ensembles, so that none waits.")
@json_option
def doctor(results: str, warm: bool, as_json: bool) -> None:
    """Check packages, caches, folders and a few computed numbers, and say what to do about each fault.

    The exit code is 1 if there is a fault. It takes some seconds; with --warm, some minutes the first time.
    """
    if warm:
        from symtop.core.parallel import OneThreadEach, cores

        before, names = kernels(), ["", *variants()]
        with concurrent.futures.ProcessPoolExecutor(cores(), OneThreadEach()) as pool:
            runs = pool.map(_run, names)
            with progress_bar("compiling", iterable=runs, total=len(names), unit="run") as bar:
                failed = list(filter(None, bar))
        click.echo(f"kernels compiled: {kernels() - before}; every method was run in each of its charts", err=as_json)
        for why in failed:
            click.echo(f"  not run: {why}", err=True)
    findings = examine(Path(results))
    if as_json:
        click.echo(as_text([finding._asdict() for finding in findings]))
    else:
        width = max(len(finding.topic) for finding in findings)
        for finding in findings:
            click.echo(f"{'ok ' if finding.healthy else 'BAD'}  {finding.topic.ljust(width)}  {finding.result}")
        advice = [f"{finding.topic}: {finding.advice}" for finding in findings if not finding.healthy]
        click.echo("\n".join(["", *(advice or ["No faults were found."])]))
    if not all(finding.healthy for finding in findings):
        sys.exit(1)
