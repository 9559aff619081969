"""The conclusion of a study: its facts, tables, figures and charts, as NAME.json holds them for the report."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from symtop.core import netcdf
from symtop.core.errors import label, shown
from symtop.measure.datasets import Combined
from symtop.runner.study import LONGEST, Chart, Picture, Save, Study, StudyError, each, failing

QUICK = "quick pass: coarse grid"  # beside a figure of one


def findings_of(
    study: Study, data: Combined, results: Path, save: Save | None, *, failures: list[str], cases: int,
    quick: bool = False, page: Path | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Draw a dataset, write its tables, and say what it shows; `page` is the template of its page."""
    charts = each(study.name, "charts", lambda: study.charts(data), Chart, "a list of Chart")
    found: dict[str, Any] = {
        "study": study.name, "title": study.title, "question": study.question,
        "charts": [chart._asdict() | {"marks": dict(chart.marks)} for chart in charts],
        "failures": failures, "cases": cases, "quick": quick,
        "provenance": netcdf.provenance(changes=True),
    }  # fmt: skip
    return found | {
        "facts": _facts(study, data),
        "tables": list(_tables(study, data, results)),
        "pictures": [] if save is None else list(_saved(study, data, results, save, quick=quick)),
        "page": None if page is None else page.read_text(encoding="utf-8"),
    }


def _facts(study: Study, data: Combined) -> dict[str, Any]:
    """Facts as JSON holds them: numbers, names, and None for what was not measured."""
    if study.facts is None:
        return {}
    with failing(study.name, "facts"):
        made = study.facts(data)
    if not isinstance(made, Mapping):
        raise StudyError(f"study {study.name}: facts must return numbers by name, not {shown(made)[:LONGEST]}")
    return {_named(study, "fact", name): _fact(study, name, value) for name, value in made.items()}


def _named(study: Study, what: str, name: object) -> str:
    if not (isinstance(name, str) and name.isidentifier()):
        raise StudyError(
            f"study {study.name}: the name of a {what} must be a word of letters, digits and _, not {name!r}"
        )
    return name


def _fact(study: Study, name: str, value: Any) -> float | str | bool | None:
    value = value.item() if getattr(value, "ndim", None) == 0 else value  # of NumPy
    if isinstance(value, float) and math.isnan(value):
        return None
    if value is not None and not isinstance(value, (bool, int, float, str)):
        raise StudyError(
            f"study {study.name}: fact {name} must be a number, text or None, not {shown(value)[:LONGEST]}"
        )
    return value


def _tables(study: Study, data: Combined, results: Path) -> Iterator[dict[str, Any]]:
    """Write the tables, one CSV each."""
    import pandas as pd

    with failing(study.name, "tables"):
        made = study.tables(data)
    if not isinstance(made, Mapping):
        raise StudyError(f"study {study.name}: tables must return tables by name, not {shown(made)[:LONGEST]}")
    for name, frame in made.items():
        if not isinstance(frame, pd.DataFrame):
            raise StudyError(f"study {study.name}: table {name} must be a DataFrame, not a {type(frame).__name__}")
        with failing(study.name, "tables"):
            label("name of a table", name)
        file = f"{study.name}-{name}.csv"
        netcdf.write_text(results / "tables" / file, frame.to_csv(index=False))
        yield {"name": name, "file": file, "rows": len(frame)}


def _saved(study: Study, data: Combined, results: Path, save: Save, *, quick: bool) -> Iterator[dict[str, str]]:
    """Save the pictures one by one; StudyError for what is none."""
    for picture in each(study.name, "pictures", lambda: study.pictures(data), Picture, "or yield Pictures"):
        if not hasattr(picture.figure, "savefig"):
            kind = type(picture.figure).__name__
            raise StudyError(f"study {study.name}: the figure of a Picture must be one of matplotlib, not a {kind}")
        with failing(study.name, "pictures"):
            label("name of a picture", picture.name)
        file = f"{study.name}-{picture.name}.{getattr(picture.figure, 'suffix', 'png')}"  # a film is a GIF
        if quick and hasattr(picture.figure, "text"):
            picture.figure.text(
                0.998, 0.01, QUICK, rotation=90.0, ha="right", va="bottom", fontsize=6.0, color="#AD4A00"
            )
        save(picture.figure, results / "figures" / file)
        yield {"name": picture.name, "file": file}
