"""The report: one self-contained page from the findings that the studies left in the results folder.

A chart to point at is data for the page's script: each series with the look its integrator has in every figure.
"""

import base64
import datetime
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from symtop.base.validate import SymtopError
from symtop.methods.registry import integrators, split_name
from symtop.model.scenes import scenes
from symtop.report import markdown
from symtop.report.style import look
from symtop.runner import run as runner, store

TITLE = "Integrators on the heavy symmetric top"
INTRODUCTION = (
    "One rigid body, one exact solution, and every method measured against it: accuracy, conservation, cost and "
    "failure. All numbers and sentences below are generated from the datasets beside this page. A row of a comparison "
    "is a method in one chart: rk4[angles] integrates the Euler angles, rk4[axis] the axis and the angular momentum in "
    "space, and an [attitude] row the rotation and the angular momentum. Markers of rows in angles are open, those of "
    "rows in the axis chart full, those of the attitude chart half full."
)


def prepared(chart: Mapping[str, Any]) -> str:
    """JSON of a chart of the findings, safe inside a script element, without points that a log axis cannot show."""
    panels = {title: [_series(name, points) for name, points in series] for title, series in chart["panels"].items()}
    content = {"title": chart["title"], "x": chart["x"], "y": chart["y"], "panels": panels}
    return json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")


def _series(name: str, points: Sequence[tuple[float | None, float | None, str]]) -> dict[str, Any]:
    method, style = integrators().get(split_name(name)[0]), look(name)
    return {
        "name": name,
        "family": method.family if method else "other",
        "color": style.color,
        "marker": style.marker,
        "dashed": method is not None and method.implementation == "python",
        "points": [list(point) for point in points if all(x is not None and 0.0 < x < math.inf for x in point[:2])],
    }


def gather(results: Path) -> list[dict[str, Any]]:
    """The findings that are in the folder, with their pictures: of all studies, in order, then of `make` targets.

    A target of the Makefile (`make peers`, `make bench`) may leave findings in the form of a study's, as NAME.json.
    They stay as they are when the studies run again, so that their ``measured`` says when, where and with what.
    Raises SymtopError if findings are incomplete, or there are none.
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
                chart["prepared"] = prepared(chart)
        except (OSError, KeyError, TypeError) as error:
            command = f"make {name}" if name in others else f"symtop study {name}"
            raise SymtopError(
                f"the findings of {name} in {results} are incomplete ({error}); run it again: {command}"
            ) from error
        findings.setdefault("opening", None)
        findings.setdefault("measured", "")
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
    titles = {study["study"]: study["title"] for study in studies}
    provenance = next((study for study in reversed(studies) if not study["measured"]), studies[-1])["provenance"]
    versions = json.loads(provenance["dependencies"])
    facts = {**provenance, "dependencies": ", ".join(f"{name} {version}" for name, version in versions.items())}
    templates = Path(__file__).parent / "templates"
    text = environment.get_template("report.html").render(
        title=TITLE,
        introduction=INTRODUCTION,
        css=(templates / "style.css").read_text(encoding="utf-8"),
        script=(templates / "chart.js").read_text(encoding="utf-8"),
        studies=studies,
        explanations=lambda study: markdown.explanations(study, titles),
        integrators=markdown.columns([method.record() for method in integrators().values()]),
        scenes=markdown.columns([scene.record() for scene in scenes().values()]),
        provenance=facts,
        quick=any(study["quick"] for study in studies),
        date=datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
    )
    target = results / "report.html"
    store.write_text(target, text)
    opening = ["# " + TITLE, INTRODUCTION, *(markdown.opening(study, titles) for study in studies)]
    store.write_text(results / "report.md", markdown.page(studies, opening, facts))
    return target
