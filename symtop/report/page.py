"""The report: one page from the findings that the studies left in the results folder, beside its figures.

It opens with an answer: the first that a study declares (`Study.opening`), with a line on every method and term in it,
and the pictures that studies want seen first (`Picture.lead`). How it was measured follows, then a section a question.
A chart to point at is data for the page's script: each series with the look its integrator has in every figure. The
page asks for nothing but its figures; with `embed` they are in it, for sending it alone.
"""

import base64
import datetime
import itertools
import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from symtop.core import netcdf
from symtop.core.errors import SymtopError
from symtop.methods.framework.registry import integrators, split_name
from symtop.report import markdown, method, tables
from symtop.report.sources import report_files, report_hash
from symtop.report.style import look
from symtop.run import plugins
from symtop.runner import manifest, run as runner

WORDS = "report.md"
TITLE = "Integrators on the heavy symmetric top"
INTRODUCTION = (
    "Every method is run on rigid bodies whose exact motion is known, and measured against it: accuracy, conservation, "
    "cost and failure. All numbers and sentences are generated from the stored datasets."
)
ROWS = (
    "rk4[angles] is the method rk4 integrating Euler's angles, rk4[axis] the same method integrating the axis and the "
    "angular momentum, [attitude] the whole orientation and the angular momentum. In figures the markers of [angles] "
    "are open, those of [axis] full, those of [attitude] half full."
)
KINDS = {".png": "image/png", ".gif": "image/gif"}
LONGEST_ANCHOR = 60  # letters
MATHML = "http://www.w3.org/1998/Math/MathML"


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


class Anchors:
    """Names for the things on a page that a link may lead to, each given once."""

    def __init__(self) -> None:
        self.given: set[str] = set()

    def __call__(self, *words: str) -> str:
        """A name made of words; it differs from all that were given before."""
        name = re.sub(r"[^a-z0-9_]+", "-", " ".join(words).lower()).strip("-")[:LONGEST_ANCHOR].rstrip("-")
        later = (f"{name}-{count}" for count in itertools.count(2))
        free = next(one for one in itertools.chain([name], later) if one not in self.given)
        self.given.add(free)
        return free


def gather(results: Path, *, embed: bool = False) -> list[dict[str, Any]]:
    """The findings that are in the folder, with their pictures: of all studies, in order, then of `make` targets.

    A target of the Makefile (`make peers`, `make bench`) may leave findings in the form of a study's, as NAME.json.
    They stay as they are when the studies run again, so that their ``measured`` says when, where and with what.
    Pictures are addresses beside the page, or the files themselves with `embed`.
    Raises SymtopError if findings are incomplete, or there are none.
    """
    studies, gathered = list(runner.names()), []
    others = sorted({file.stem for file in results.glob("*.json")} - set(studies))
    for name in [*studies, *others]:
        findings = netcdf.read_json(results / f"{name}.json")
        if findings is None or (name in others and not (isinstance(findings, dict) and "pictures" in findings)):
            continue
        try:
            for picture in findings["pictures"]:
                picture.update(_shown(results / "figures" / picture["file"], embed=embed))
                picture.setdefault("lead", "")
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


def _shown(file: Path, *, embed: bool) -> dict[str, Any]:
    """Address, width and height of a PNG or a GIF, so that the page does not move while its figures load."""
    image = file.read_bytes()
    if image.startswith(b"\x89PNG"):
        width, height = (int.from_bytes(image[at : at + 4]) for at in (16, 20))
    else:
        width, height = (int.from_bytes(image[at : at + 2], "little") for at in (6, 8))
    inside = f"data:{KINDS.get(file.suffix, 'image/png')};base64,{base64.b64encode(image).decode()}" if embed else ""
    return {"source": inside or f"figures/{file.name}", "width": width, "height": height}


def _named(studies: Sequence[dict[str, Any]]) -> None:
    """Give every study, picture, chart and table an anchor."""
    anchor = Anchors()
    for name in ("answer", "measured", "integrators", "provenance", *(study["study"] for study in studies)):
        anchor(name)
    for study in studies:
        for picture in study["pictures"]:
            picture["id"] = anchor(Path(picture["file"]).stem)
        for item in [*study["charts"], *study["tables"]]:
            item["id"] = anchor(study["study"], item["title"])


def write(results: Path, *, embed: bool = False) -> Path:
    """Write ``report.html``, and ``report.md`` with the same words, into the results folder; returns the page."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from latex2mathml.converter import convert

    environment = Environment(
        loader=PackageLoader("symtop", "report/templates"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    made_of, sources = report_hash(results, embed=embed), report_files(results)
    studies = gather(results, embed=embed)
    _named(studies)
    titles = {study["study"]: study["title"] for study in studies}
    provenance = next((study for study in reversed(studies) if not study["measured"]), studies[-1])["provenance"]
    versions = json.loads(provenance["dependencies"])
    facts = {**provenance, "dependencies": ", ".join(f"{name} {version}" for name, version in versions.items())}
    first = next((study for study in studies if study["opening"]), None)
    templates = Path(__file__).parent / "templates"
    measured = method.parts()
    text = environment.get_template("report.html").render(
        title=TITLE,
        introduction=INTRODUCTION,
        rows=ROWS,
        css="".join((templates / name).read_text(encoding="utf-8") for name in ("style.css", "report.css")),
        scripts=[(templates / name).read_text(encoding="utf-8") for name in ("page.js", "chart.js")],
        studies=studies,
        answer=first,
        glossary=method.glossary(markdown.sentences(first)) if first else [],
        leads=[(study, picture) for study in studies for picture in study["pictures"] if picture["lead"]],
        measured=measured,
        mathml=lambda formula: convert(formula, display="block").replace(f' xmlns="{MATHML}"', ""),  # HTML needs none
        explanations=lambda study: markdown.explanations(study, titles),
        integrators=tables.columns([method.record() for method in integrators().values()]),
        provenance=facts,
        quick=any(study["quick"] for study in studies),
        date=datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
    )
    target = results / manifest.PAGE
    netcdf.write_text(target, text)
    opening = ["# " + TITLE, INTRODUCTION, *(markdown.opening(study, titles) for study in studies), ROWS]
    opening.append(markdown.measured(measured))
    netcdf.write_text(results / WORDS, markdown.page(studies, opening, facts))
    manifest.note(results, manifest.PAGE, "" if plugins.loaded() else made_of, [target, results / WORDS, *sources])
    return target
