"""What the cases of a study show: its dataset, its figures and its findings."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from symtop.core import files, netcdf
from symtop.core.errors import label, shown
from symtop.measure import columns
from symtop.runner import fingerprint, manifest, scripts, store
from symtop.runner.cases import StudyCases
from symtop.runner.execute_case import prepare
from symtop.runner.study import Case, Chart, Combined, Opening, Picture, Study, StudyError, Table, door, sentences

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Save = Callable[["Figure", Path], object]  # writes a picture's figure to a file


class Analysis(NamedTuple):
    """What a worker must know to analyse a study whose cases are stored."""

    script: str
    results: Path
    cases: dict[Path, Case]
    failures: list[str]
    plugins: tuple[str, ...]
    made_of: str  # of the findings, for the manifest
    drawing: str  # the part of it that is code
    save: Save | None
    quick: bool


def analyse_stored(work: Analysis) -> dict[str, Any]:
    """The findings of a study from the files of its cases, written as `analyse` does."""
    study = prepare(work.script, work.plugins)
    cases = StudyCases(study, work.results, cases=work.cases, failures=work.failures)
    cases.read_all()
    edited = drawing_digest(study, work.save) != work.drawing  # since the cases were computed: drawn again next time
    return analyse(cases, "" if edited else work.made_of, work.save, quick=work.quick)


def drawing_digest(study: Study, save: Save | None) -> str:
    """Hash of what combines, draws and judges."""
    return fingerprint.drawing_digest(study, scripts.file_of(study.name), store.combine, columns.described, save)


def analyse(cases: StudyCases, made_of: str, save: Save | None, *, quick: bool) -> dict[str, Any]:
    """Combine, draw, judge and write."""
    study, results = cases.study, cases.results
    dataset, words = results / f"{study.name}.nc", results / f"{study.name}.json"
    with files.locked(dataset, wait=True):
        for file in (dataset, words):
            netcdf.sweep(file)
        combined = cases.combined()
        units = store.units_of(case.scene for case in cases.cases.values())
        combined = columns.described(combined, study.name, units)
        combined = netcdf.describe(combined, study.title, units=units, question=study.question)
        netcdf.write(combined, dataset)
        store.forget(results, study, cases.cases)
        findings = findings_of(study, combined, results, save, failures=cases.failures, cases=len(cases.cases))
        findings["quick"] = quick
        store.write_json(words, findings)
        if not cases.failures and made_of:
            pictures = [results / "figures" / picture["file"] for picture in findings["pictures"]]
            manifest.note(results, study.name, made_of, [dataset, words, *pictures, *cases.cases])
    return findings


def findings_of(
    study: Study, data: Combined, results: Path, save: Save | None, *, failures: list[str], cases: int
) -> dict[str, Any]:
    """Draw a dataset and say what it shows, as the report wants it."""
    verdict = sentences(study.name, lambda: study.verdict(data))
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
        "verdict": verdict,
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
    within = door(study.name, "opening")
    with within:
        opening = study.opening(data)
        if not isinstance(opening, Opening):
            raise within.refuse("an Opening", opening)
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
