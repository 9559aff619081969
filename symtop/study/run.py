"""The runner: measures the cases that are missing, combines them, draws, and writes down what it found.

A case is computed only if no file holds its digest, so that an interrupted study resumes and an unchanged one
ends in seconds. Untimed cases share all cores through spawned processes; timed ones run alone.
"""

import contextlib
import hashlib
import importlib.util
import multiprocessing
import os
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import xarray as xr
from tqdm import tqdm

from symtop import datasets
from symtop.checks import SymtopError, one_of
from symtop.study import plugins, store
from symtop.study.study import Case, Picture, Study

WORTH_A_POOL = 8  # cases; starting a worker costs two seconds


def folder() -> Path:
    """The folder of study scripts: beside the package, or in the working directory."""
    for place in (Path(__file__).resolve().parents[2] / "studies", Path.cwd() / "studies"):
        if place.is_dir():
            return place
    msg = "no folder of study scripts was found beside the package or in the working directory"
    raise SymtopError(msg)


def names() -> list[str]:
    """Names of all studies, in the order of the report."""
    order = ["truth", "convergence", "work_precision", "drift", "stability", "reduction"]
    found = sorted(path.stem for path in folder().glob("*.py") if not path.stem.startswith("_"))
    return [name for name in order if name in found] + [name for name in found if name not in order]


def load(name: str) -> Study:
    """The study of that name."""
    file = folder() / f"{one_of('study', name, names())}.py"
    module_name = f"symtop_study_{name}"
    if module_name not in sys.modules:
        spec = importlib.util.spec_from_file_location(module_name, file)
        if spec is None or spec.loader is None:
            msg = f"study {name!r} cannot be loaded"
            raise SymtopError(msg)
        module = importlib.util.module_from_spec(spec)
        sys.modules[module_name] = module
        spec.loader.exec_module(module)
    found = sys.modules[module_name].STUDY
    assert isinstance(found, Study)  # noqa: S101
    return found


def _measure(name: str, case: Case, path: str, plugin_files: list[str]) -> None:
    """Compute one case and store it; runs in a worker process as well as in this one."""
    for file in plugin_files:
        plugins.load(file)
    study = load(name)
    data = study.measure(case)
    title = f"{study.name}: {case.integrator} on {case.scene}"
    datasets.write(datasets.describe(data, title, settings=dict(case.settings)), path)


def _measure_all(study: Study, missing: dict[Path, Case], jobs: int, quiet: bool) -> list[str]:
    """Compute all missing cases; returns one sentence for each that failed."""
    failures: list[str] = []
    with tqdm(total=len(missing), desc=study.name, unit="case", disable=quiet or None, leave=False) as bar:
        if jobs == 1:
            for path, case in missing.items():
                bar.set_postfix_str(case.label)
                try:
                    _measure(study.name, case, str(path), plugins.loaded())
                except Exception as error:  # noqa: BLE001  (a failing case must not stop the others)
                    failures.append(_failure(case, error))
                bar.update()
            return failures
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(jobs, context, _obey, (os.getpid(),)) as pool, _dropping(pool):
            futures: dict[Future[None], Case] = {
                pool.submit(_measure, study.name, case, str(path), plugins.loaded()): case
                for path, case in missing.items()
            }
            for future in as_completed(futures):
                problem = future.exception()
                if problem is not None:
                    failures.append(_failure(futures[future], problem))
                bar.update()
    return failures


def _obey(parent: int) -> None:
    """In a worker: leave interrupts to the parent, and end with it however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextlib.contextmanager
def _dropping(pool: ProcessPoolExecutor) -> Iterator[None]:
    """On an interrupt, finish what is being computed and drop the rest of the queue."""
    try:
        yield
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise


def _failure(case: Case, error: BaseException) -> str:
    shown = str(error) if isinstance(error, SymtopError) else "".join(traceback.format_exception_only(error))
    last = " ".join(shown.split())
    return f"{case.integrator} on {case.scene} failed: {last}"


def _job_count(study: Study, cases: Iterable[Case], jobs: int | None) -> int:
    """One process for timed studies, few cases, and methods or scenes that only this process knows."""
    chosen = list(cases)
    ours = {name for case in chosen for name in (case.scene, case.integrator)}
    if study.timed or len(chosen) < WORTH_A_POOL or any(plugins.is_local(name) for name in ours):
        return 1
    return max(1, min(jobs or os.cpu_count() or 1, len(chosen)))


def _stamp(study: Study, digests: Iterable[str]) -> str:
    """Hash of what the drawings depend on: the cases, the script and the drawing code."""
    digest = hashlib.sha256("".join(digests).encode())
    package = Path(__file__).resolve().parents[1]
    for path in [
        folder() / f"{study.name}.py",
        package / "study" / "store.py",
        *sorted((package / "report").glob("*.py")),
    ]:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:20]


def run(study: Study, results: Path, *, quick: bool = False, fresh: bool = False, jobs: int | None = None,
        quiet: bool = False) -> dict[str, Any]:  # fmt: skip
    """Bring a study's dataset, figures and findings up to date; returns the findings."""
    cases = study.cases(quick)
    paths = {store.case_path(results, study, case): case for case in cases}
    done: dict[Path, xr.Dataset] = {}
    if not fresh:
        done = {path: data for path in paths if (data := store.load_case(path)) is not None}
    missing = {path: case for path, case in paths.items() if path not in done}
    findings_path = results / f"{study.name}.json"
    stamp = _stamp(study, sorted(path.name for path in paths))
    before = store.read_json(findings_path)
    drawn = before is not None and before.get("stamp") == stamp
    drawn = drawn and all((results / "figures" / picture["file"]).is_file() for picture in before["pictures"])
    if drawn and not missing and (results / f"{study.name}.nc").is_file():
        return {**before, "computed": 0}
    failures = _measure_all(study, missing, _job_count(study, missing.values(), jobs), quiet)
    done |= {path: data for path in missing if (data := store.load_case(path)) is not None}
    if not done:
        msg = f"study {study.name}: no case could be measured; {failures[0] if failures else 'the grid is empty'}"
        raise SymtopError(msg)
    found = [(case, done[path]) for path, case in paths.items() if path in done]
    combined = datasets.describe(store.combine(found), study.title, question=study.question)
    datasets.write(combined, results / f"{study.name}.nc")
    _forget(results, study, paths)
    pictures = [_save(results, study, picture) for picture in study.pictures(combined)]
    findings = {
        "study": study.name,
        "title": study.title,
        "question": study.question,
        "how_to_read": study.how_to_read,
        "verdict": study.verdict(combined),
        "tables": [table._asdict() for table in study.tables(combined)],
        "pictures": pictures,
        "failures": failures,
        "cases": len(paths),
        "quick": quick,
        "stamp": stamp if not failures else "",
        "provenance": datasets.provenance(),
    }
    store.write_json(findings_path, findings)
    return {**findings, "computed": len(missing)}


def _forget(results: Path, study: Study, keep: Iterable[Path]) -> None:
    """Remove what newer files of the same scene and method replace; cases that were not asked for stay."""
    wanted = {path.name: path.name.rpartition("--")[0] for path in keep}
    labels = set(wanted.values())
    for path in (results / "cases" / study.name).glob("*.nc"):
        if path.name not in wanted and path.name.rpartition("--")[0] in labels:
            path.unlink(missing_ok=True)


def _save(results: Path, study: Study, picture: Picture) -> dict[str, str]:
    import matplotlib.pyplot as plt  # noqa: PLC0415

    from symtop.report import style  # noqa: PLC0415

    suffix = getattr(picture.figure, "suffix", "png")  # a film is a GIF
    file = f"{study.name}-{picture.name}.{suffix}"
    target = results / "figures" / file
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, partial = tempfile.mkstemp(prefix=f".{file}.", suffix=f".part.{suffix}", dir=target.parent)
    os.close(handle)
    try:
        picture.figure.savefig(partial, metadata={"Software": None})
        if suffix == "png":
            style.compact(partial)
        Path(partial).chmod(0o644)
        Path(partial).replace(target)
    finally:
        Path(partial).unlink(missing_ok=True)
    plt.close(picture.figure)
    return {"name": picture.name, "file": file, "caption": picture.caption, "alt": picture.alt}
