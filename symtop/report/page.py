"""The report: one self-contained page from the findings that the studies left in the results folder."""

import base64
import datetime
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from symtop.base.validate import SymtopError
from symtop.methods.registry import Integrator, integrators
from symtop.model.scenes import Scene, scenes
from symtop.report import interactive, markdown
from symtop.runner import run as runner, store

TITLE = "Integrators on the heavy symmetric top"
INTRODUCTION = (
    "One rigid body, one exact solution, and every method measured against it: accuracy, conservation, cost and "
    "failure. All numbers and sentences below are generated from the datasets beside this page."
)


def table_of(catalogue: Mapping[str, Integrator | Scene]) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the table of integrators, or of scenes, from the registry."""
    records = [entry.record() for entry in catalogue.values()]
    return list(records[0]), [list(record.values()) for record in records]


def gather(results: Path) -> list[dict[str, Any]]:
    """The findings that are in the folder, with their pictures: of all studies, in order, then of `make` targets.

    A target of the Makefile may leave findings in the form of a study's, as NAME.json. Raises SymtopError if findings
    are incomplete, or there are none.
    """
    studies, gathered = list(runner.names()), []
    others = sorted({file.stem for file in results.glob("*.json")} - set(studies))
    for name in [*studies, *others]:
        findings = store.read_json(results / f"{name}.json")
        if findings is None or (name in others and not (isinstance(findings, dict) and "pictures" in findings)):
            continue
        try:
            for picture in findings["pictures"]:
                file = results / "figures" / picture["file"]
                code = base64.b64encode(file.read_bytes()).decode()
                picture["data"] = f"data:image/{file.suffix[1:]};base64,{code}"
            for chart in findings["charts"]:
                chart["prepared"] = interactive.prepared(chart)
        except (OSError, KeyError, TypeError) as error:
            command = f"make {name}" if name in others else f"symtop study {name}"
            raise SymtopError(
                f"the findings of {name} in {results} are incomplete ({error}); run it again: {command}"
            ) from error
        findings.setdefault("opening", None)
        findings["dataset"] = f"{name}.nc" if (results / f"{name}.nc").is_file() else ""
        gathered.append(findings)
    if not gathered:
        raise SymtopError(f"no study has left findings in {results}; run one first, for example: symtop study --all")
    return gathered


def write(results: Path) -> Path:
    """Write ``report.html``, and ``report.md`` with the same words, into the results folder; returns the page."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("symtop", "report/templates"), autoescape=True, undefined=StrictUndefined
    )
    studies = gather(results)
    provenance = studies[-1]["provenance"]
    versions = json.loads(provenance["dependencies"])
    facts = {**provenance, "dependencies": ", ".join(f"{name} {version}" for name, version in versions.items())}
    templates = Path(__file__).parent / "templates"
    text = environment.get_template("report.html").render(
        title=TITLE,
        introduction=INTRODUCTION,
        css=(templates / "style.css").read_text(encoding="utf-8"),
        script=(templates / "chart.js").read_text(encoding="utf-8"),
        studies=studies,
        integrators=table_of(integrators()),
        scenes=table_of(scenes()),
        provenance=facts,
        quick=any(study["quick"] for study in studies),
        date=datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
    )
    target = results / "report.html"
    store.write_text(target, text)
    opening = ["# " + TITLE, INTRODUCTION, *map(markdown.opening, studies)]
    store.write_text(results / "report.md", markdown.page(studies, opening, facts))
    return target
