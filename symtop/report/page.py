"""The report: one self-contained page from the findings that the studies left in the results folder."""

import base64
import datetime
import json
from pathlib import Path
from typing import Any

from symtop.base.validate import SymtopError
from symtop.methods.registry import integrators
from symtop.model.scenes import scenes
from symtop.report import interactive, markdown
from symtop.runner import run as runner
from symtop.runner import store

TITLE = "Integrators on the heavy symmetric top"
INTRODUCTION = (
    "One rigid body, one exact solution, and every method measured against it: accuracy, conservation, cost and "
    "failure. All numbers and sentences below are generated from the datasets beside this page."
)


def integrator_table() -> tuple[list[str], list[list[str]]]:
    """Header and rows of the table of integrators, from the registry."""
    records = [entry.record() for entry in integrators().values()]
    return list(records[0]), [list(record.values()) for record in records]


def scene_table() -> tuple[list[str], list[list[str]]]:
    """Header and rows of the table of scenes."""
    records = [entry.record() for entry in scenes().values()]
    return list(records[0]), [list(record.values()) for record in records]


def _embedded(path: Path) -> str:
    return f"data:image/{path.suffix[1:]};base64," + base64.b64encode(path.read_bytes()).decode()


BENCHMARKS = ("peers",)  # programs of `benchmarks` that leave findings in the form of a study's


def _command(name: str) -> str:
    return f"make {name}" if name in BENCHMARKS else f"symtop study {name}"


def gather(results: Path) -> list[dict[str, Any]]:
    """The findings of all studies that were run, in the order of the report, with their pictures."""
    gathered = []
    for name in [*runner.names(), *BENCHMARKS]:
        findings = store.read_json(results / f"{name}.json")
        if findings is None:
            continue
        try:
            for picture in findings["pictures"]:
                picture["data"] = _embedded(results / "figures" / picture["file"])
        except (OSError, KeyError, TypeError) as error:
            raise SymtopError(
                f"the findings of {name} in {results} are incomplete ({error}); run it again: {_command(name)}"
            ) from error
        findings.setdefault("opening", None)
        findings["charts"] = [
            {**chart, "prepared": interactive.prepared(chart)} for chart in findings.get("charts", [])
        ]
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
    facts = {**provenance, "dependencies": _plain(provenance["dependencies"])}
    text = environment.get_template("report.html").render(
        title=TITLE,
        introduction=INTRODUCTION,
        css=_part("style.css"),
        script=_part("chart.js"),
        studies=studies,
        integrators=integrator_table(),
        scenes=scene_table(),
        provenance=facts,
        quick=any(study["quick"] for study in studies),
        date=datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
    )
    target = results / "report.html"
    store.write_text(target, text)
    opening = ["# " + TITLE, INTRODUCTION, *map(markdown.opening, studies)]
    store.write_text(results / "report.md", markdown.page(studies, opening, facts))
    return target


def _part(name: str) -> str:
    """A piece of the page from the templates, unchanged."""
    return (Path(__file__).parent / "templates" / name).read_text(encoding="utf-8")


def _plain(dependencies: str) -> str:
    return ", ".join(f"{name} {version}" for name, version in json.loads(dependencies).items())
