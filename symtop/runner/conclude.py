"""What the cases of a study show: its dataset, its pictures and its findings, in this process or beside the next study.

Combining and drawing take up to half a minute on one core. A study may be `Asked` to be concluded in a process of its
own, from the files of its cases, while the workers compute untimed cases of the next ones. Timed cases wait until it is
done if it has begun, and if it has not, it waits for them.
"""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from symtop.base import datasets, locks
from symtop.base.validate import label
from symtop.runner import depends, plugins, scripts, seen, store
from symtop.runner.cases import Round
from symtop.runner.study import Case, Combined, Picture, Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Save = Callable[["Figure", Path], object]  # writes a picture's figure to a file


class Asked(NamedTuple):
    """What another process must know to conclude a study whose cases are stored."""

    script: str
    results: Path
    paths: dict[Path, Case]
    failures: list[str]
    plugins: tuple[str, ...]
    stamp: str
    code: str
    save: Save | None
    quick: bool


def conclude_stored(asked: Asked) -> dict[str, Any]:
    """The findings of a study from the files of its cases, written as `conclude` does."""
    for file in asked.plugins:
        plugins.load(file)
    cases = Round(scripts.load(asked.script), asked.results, paths=asked.paths, failures=asked.failures)
    cases.look_again()
    edited = code_of(cases.study, asked.save) != asked.code  # since the cases were computed: drawn again the next time
    return conclude(cases, "" if edited else asked.stamp, asked.save, quick=asked.quick)


def code_of(study: Study, save: Save | None) -> str:
    """Hash of the code that combines, draws and judges."""
    return depends.script_digest(scripts.file_of(study.name), store, save)


def conclude(cases: Round, stamp: str, save: Save | None, *, quick: bool) -> dict[str, Any]:
    """Combine, draw, judge and write."""
    study, results = cases.study, cases.results
    with locks.locked(results / f"{study.name}.nc", wait=True):
        for file in (results / f"{study.name}.nc", results / f"{study.name}.json"):
            datasets.sweep(file)
        combined = cases.combined()
        units = store.units_of(case.scene for case in cases.paths.values())
        combined = datasets.describe(combined, study.title, units=units, question=study.question)
        datasets.write(combined, results / f"{study.name}.nc")
        store.forget(results, study, cases.paths)
        findings = findings_of(study, combined, results, save, failures=cases.failures, cases=len(cases.paths))
        findings |= {"quick": quick, "stamp": stamp if not cases.failures else ""}
        store.write_json(results / f"{study.name}.json", findings)
        if not cases.failures and stamp:
            seen.note(results, study, stamp, cases.paths)
    return findings


def findings_of(
    study: Study, data: Combined, results: Path, save: Save | None, *, failures: list[str], cases: int
) -> dict[str, Any]:
    """Draw a dataset and say what it shows, as the report wants it."""
    pictures = [] if save is None else [_save(results, study, picture, save) for picture in study.pictures(data)]
    first = None
    if study.opening is not None:
        opening = study.opening(data)
        first = opening._asdict() | {"table": opening.table._asdict(), "explained": dict(opening.explained)}
    return {
        "study": study.name,
        **{name: getattr(study, name) for name in ("title", "question", "how_to_read")},
        "verdict": study.verdict(data),
        "tables": [table._asdict() for table in study.tables(data)],
        "charts": [chart._asdict() for chart in study.charts(data)],
        "opening": first,
        "pictures": pictures,
        "failures": failures,
        "cases": cases,
        "quick": False,
        "provenance": datasets.provenance(),
    }


def _save(results: Path, study: Study, picture: Picture, save: Save) -> dict[str, str]:
    suffix = getattr(picture.figure, "suffix", "png")  # a film is a GIF
    file = f"{study.name}-{label('name of a picture', picture.name)}.{suffix}"
    save(picture.figure, results / "figures" / file)
    return {"file": file} | {key: getattr(picture, key) for key in ("name", "caption", "alt", "lead")}
