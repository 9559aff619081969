"""What the cases of a study show: its dataset, its pictures and its findings, in this process or beside the next study.

Combining and drawing take up to half a minute on one core. A study may be `Asked` to be concluded in a process of its
own, from the files of its cases, while the workers compute untimed cases of the next ones. Timed cases wait until it is
done if it has begun, and if it has not, it waits for them.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from symtop.core import files, netcdf
from symtop.core.errors import label, shown
from symtop.runner import depends, plugins, scripts, seen, store
from symtop.runner.cases import Round
from symtop.runner.study import Case, Chart, Combined, Opening, Picture, Study, StudyError, Table, door, sentences

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
    with files.locked(results / f"{study.name}.nc", wait=True):
        for file in (results / f"{study.name}.nc", results / f"{study.name}.json"):
            netcdf.sweep(file)
        combined = cases.combined()
        units = store.units_of(case.scene for case in cases.paths.values())
        combined = netcdf.describe(combined, study.title, units=units, question=study.question)
        netcdf.write(combined, results / f"{study.name}.nc")
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
    said = sentences(study.name, lambda: study.verdict(data))
    tables = door(study.name, "tables").each(lambda: study.tables(data), Table, "a list of Table")
    charts = door(study.name, "charts").each(lambda: study.charts(data), Chart, "a list of Chart")
    rest = {
        "tables": [table._asdict() for table in tables],
        "charts": [chart._asdict() for chart in charts],
        "opening": _opening(study, data),
    }
    pictures = [] if save is None else [_save(results, study, picture, save) for picture in _pictures(study, data)]
    return {
        "study": study.name,
        **{name: getattr(study, name) for name in ("title", "question", "how_to_read")},
        "verdict": said,
        **rest,
        "pictures": pictures,
        "failures": failures,
        "cases": cases,
        "quick": False,
        "provenance": netcdf.provenance(changes=True),
    }


def _opening(study: Study, data: Combined) -> dict[str, Any] | None:
    if study.opening is None:
        return None
    asked = door(study.name, "opening")
    with asked:
        opening = study.opening(data)
        if not isinstance(opening, Opening):
            raise asked.refuse("an Opening", opening)
        return opening._asdict() | {"table": opening.table._asdict(), "explained": dict(opening.explained)}


def _pictures(study: Study, data: Combined) -> Iterator[Picture]:
    """The pictures one by one; StudyError for what is none."""
    for picture in door(study.name, "pictures").each(lambda: study.pictures(data), Picture, "or yield Pictures"):
        wrong = [key for key in ("name", "caption", "alt", "lead") if not isinstance(getattr(picture, key), str)]
        if wrong:
            what = f"{wrong[0]} that is text, not {shown(getattr(picture, wrong[0]))}"
            raise StudyError(f"study {study.name}: a Picture must have a {what}")
        if not hasattr(picture.figure, "savefig"):
            kind = type(picture.figure).__name__
            raise StudyError(f"study {study.name}: the figure of a Picture must be one of matplotlib, not a {kind}")
        with door(study.name, "pictures"):
            label("name of a picture", picture.name)
        yield picture


def _save(results: Path, study: Study, picture: Picture, save: Save) -> dict[str, str]:
    suffix = getattr(picture.figure, "suffix", "png")  # a film is a GIF
    file = f"{study.name}-{picture.name}.{suffix}"
    save(picture.figure, results / "figures" / file)
    return {"file": file} | {key: getattr(picture, key) for key in ("name", "caption", "alt", "lead")}
