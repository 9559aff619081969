"""The report: a front page and one page per study, from the findings of the studies in the results folder.

`report.md` has the results with their figures and tables; `reference.md` has material for checking: the pages of
benchmarks from "How to read it" on, or in full if one has no figure, the equations and scenes, and the provenance.
`report.html` has both. The page of a study is its filled template (`symtop.report.template`). An interactive chart is
stored as data for the page's script, each series in the style of its integrator in all figures; a table that is shown
in part is also stored in full in `report.html`, to be searched and sorted. The page loads only figures; with `embed`
they are part of it, so that it is a single file.
"""

import base64
import datetime
import json
import math
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import to_hex

from symtop.core import netcdf
from symtop.core.errors import SymtopError
from symtop.core.numbers import EPSILON
from symtop.methods.framework.registry import integrators, split_name
from symtop.model.scenes import scenes
from symtop.model.top import flat
from symtop.report import formats, template
from symtop.report.html import Writer, slug
from symtop.report.style import ink, look
from symtop.run.reference.truth import reference
from symtop.runner import run as runner

PAGE, WORDS, REFERENCE = "report.html", "report.md", "reference.md"
TEMPLATES = Path(__file__).parent / "templates"
EQUATIONS = "The equations, the scenes and the exact motion"
READING = "**How to read it.**"  # the begin of the part for `reference.md` in the page of a benchmark
QUICK = "This is a quick pass on coarse grids, for checking that every study works."


def prepared(chart: Mapping[str, Any]) -> str:
    """A chart of the findings as JSON for a script element, without points that a log axis cannot show."""
    panels = {title: [_series(name, points) for name, points in series] for title, series in chart["panels"].items()}
    content = {key: chart[key] for key in ("title", "x", "y", "choices", "marks") if key in chart} | {"panels": panels}
    return json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")


def _series(name: str, points: Sequence[tuple[float | None, float | None, str]]) -> dict[str, Any]:
    method, style = integrators().get(split_name(name)[0]), look(name)
    return {
        "name": name,
        "family": method.family if method else "other",
        "color": style.color,
        "ink": to_hex(ink(style.color)),
        "marker": style.marker,
        "dashed": method is not None and method.implementation == "python",
        "points": [
            [None if isinstance(value, float) and not math.isfinite(value) else value for value in point]
            for point in points
            if len(point) > 3 or all(0.0 < (value or 0.0) < math.inf for value in point[:2])
        ],
    }


def gather(results: Path, *, embed: bool = False) -> list[dict[str, Any]]:
    """The findings in the folder: of all studies, in order, then of benchmarks; with the ``images`` of their figures.

    A benchmark (`make peers`) may write findings in the form of a study's, as NAME.json. Runs of studies do not change
    them, so that their ``measured`` says when, where and with what they were made, and ``command`` how to repeat it.
    The page of a study that ships with symtop is that of its folder, any other page that of its findings.
    Raises SymtopError if findings are incomplete or a file is damaged, or there are none.
    """
    studies, records = list(runner.names()), []
    benchmarks = sorted({file.stem for file in results.glob("*.json")} - set(studies))
    for name in [*studies, *benchmarks]:
        findings = _stored(results / f"{name}.json", f"run it again: symtop study {name}, or " * (name in studies))
        if not isinstance(findings, dict) or (name in benchmarks and "pictures" not in findings):
            continue
        page_file = runner.file_beside(name, "page.md") if name in studies else None
        try:
            extra: dict[str, Any] = {"measured": findings.get("measured", ""), "dataset": f"{name}.nc"}
            extra["dataset"] *= (results / f"{name}.nc").is_file()
            figures = [f"figures/{picture['file']}" for picture in findings["pictures"]]
            parts = [*figures, *(f"tables/{table['file']}" for table in findings["tables"])]
            for file in (file for file in parts if not (results / file).is_file()):
                raise FileNotFoundError(f"{file} is missing")
            extra["images"] = {file: _image(results / file, embed=embed) for file in figures}
            page = findings["page"] if page_file is None else page_file.read_text(encoding="utf-8")
            records.append({**findings, **extra, "page": page})
        except (OSError, KeyError, TypeError) as error:
            folder, quick = (results.parent, " --quick") if results.name == "quick" else (results, "")
            command = findings.get("command", f"symtop study {name}{quick} --results {shlex.quote(str(folder))}")
            words = f"the findings of {name} in {results} are incomplete ({error}); run it again: {command}"
            raise SymtopError(words) from error
    if not records:
        raise SymtopError(f"no study has left findings in {results}; run one first, for example: symtop study --all")
    return records


def has_studies(results: Path) -> bool:
    """Does the folder hold findings, or damaged ones, that are not of a benchmark?"""
    contents = map(netcdf.read_json, results.glob("*.json"))
    return any(not (isinstance(content, dict) and content.get("measured")) for content in contents)


def _stored(file: Path, remedy: str) -> Any:
    """The content of a JSON file, None if there is no file; SymtopError with the `remedy` if it is damaged."""
    try:
        return json.loads(file.read_text(encoding="utf-8")) if file.is_file() else None
    except (OSError, ValueError) as error:
        raise SymtopError(f"{file} is damaged ({error}); {remedy}remove the file") from error


def _image(file: Path, *, embed: bool) -> dict[str, Any]:
    """Address, width and height of a PNG or a GIF; with the size the page does not move while figures load."""
    from PIL import Image

    with Image.open(file) as image:
        (width, height), kind = image.size, f"image/{str(image.format).lower()}"
    inside = f"data:{kind};base64,{base64.b64encode(file.read_bytes()).decode()}" if embed else ""
    return {"source": inside or f"figures/{file.name}", "width": width, "height": height}


def texts(results: Path, studies: Sequence[Mapping[str, Any]]) -> tuple[dict[str, str], dict[str, str]]:
    """The parts of `report.md` and of `reference.md`, in Markdown by name: "front", the studies, "measured", ..."""
    parts, appendix, pages = dict[str, str](), dict[str, str](), {"measured": _link("How it was measured")}
    for study in studies:
        pages[study["study"]] = _link(formats.typeset(study["question"]), REFERENCE if _checks_only(study) else "")
    parts["front"] = formats.typeset(template.front(_template("front"), studies, results, pages))
    for study in studies:
        name, text = study["study"], formats.typeset(_lower(template.filled(study, results, pages=pages)))
        if _checks_only(study):
            appendix[name] = text
            continue
        parts[name], mark, rest = text.partition(READING) if study["measured"] else (text, "", "")
        if mark:
            title = f"{study['title']}: tables"
            parts[name] += f"More: {_link(title, REFERENCE)}.\n"
            appendix[f"{name}-tables"] = f"## {title}\n\n{mark}{rest}"
    values = {"reference": f"{REFERENCE}#{slug(EQUATIONS)}"} | template.counts() | scene_tables()
    parts["measured"], appendix["equations"] = (
        template.rendered(_template(name), name, values) for name in ("measured", "equations")
    )
    newest = next((study for study in reversed(studies) if not study["measured"]), studies[-1])["provenance"]
    versions = ", ".join(f"{name} {version}" for name, version in json.loads(newest["dependencies"]).items())
    facts = [[key, str(value)] for key, value in {**newest, "dependencies": versions}.items()]
    appendix["provenance"] = f"## Provenance\n\n{formats.table(['what', 'which'], facts)}\n"
    if any(study["quick"] for study in studies):
        parts["front"] += f"\n{QUICK}\n"
    return parts, appendix


def _checks_only(study: Mapping[str, Any]) -> bool:
    """Is it a benchmark without a figure, so that its page belongs into `reference.md`?"""
    return bool(study["measured"]) and not study["pictures"]


def _template(name: str) -> str:
    return (TEMPLATES / f"{name}.md").read_text(encoding="utf-8")


def _link(heading: str, file: str = "") -> str:
    return f"[{heading}]({file}#{slug(heading)})"


def _lower(text: str) -> str:
    """The text with all headings one level lower."""
    return re.sub(r"^(#+) ", r"\1# ", text, flags=re.MULTILINE)


def scene_tables() -> dict[str, Any]:
    """Template values on all scenes: uses, starts to the last bit, units, the largest bound of the reference (rad)."""
    uses, starts, bounds = [], [], []
    for scene in scenes().values():
        bounds.append(float(reference(scene, np.array([scene.horizon]))["axis_error_bound"].values[0]))
        period = f"{scene.nutation_period:.9g}" if math.isfinite(scene.nutation_period) else "infinite"
        uses.append([scene.name, scene.purpose, period, f"{scene.horizon:.6g}", f"{bounds[-1]:.1e}"])
        starts.append([scene.name, *(repr(number).removesuffix(".0") for number in flat(scene.top, scene.start))])
    use_header = ["scene", "what it is for", "nutation period", "horizon", "bound of the truth (rad)"]
    start_header = ["scene", "I1", "I3", "mgl", "theta", "phi", "psi", "theta'", "phi'", "psi'"]
    return {
        "uses": formats.table(use_header, uses), "starts": formats.table(start_header, starts),
        "units": ", ".join(scene.name for scene in scenes().values() if scene.units == "SI"),
        "bound": max(bounds), "roundings": max(bounds) / EPSILON,
    }  # fmt: skip


def write(results: Path, *, embed: bool = False) -> Path:
    """Write ``report.html``, ``report.md`` and ``reference.md`` into the results folder; returns the page."""
    page, studies = template.environment(autoescape=True).get_template("report.html"), gather(results, embed=embed)
    parts, appendix = texts(results, studies)
    images = dict(item for study in studies for item in study["images"].items())
    charts = {f"{study['study']}-{chart['name']}": chart for study in studies for chart in study["charts"]}
    records = formats.columns([method.record() for method in integrators().values()])

    def replacement(kind: str, name: str) -> str:
        if kind == "table":
            return _full_table(name, *_read(results / "tables" / f"{name}.csv"))
        return f'<div class="chart"><script type="application/json">{prepared(charts[name])}</script></div>'

    sections = parts | appendix
    writer = Writer(images, replacement, "content", "scheme", *(f"part-{name}" for name in sections))
    text = page.render(
        title=re.sub(r"^# ", "", parts["front"].partition("\n")[0]),
        css="".join((TEMPLATES / name).read_text(encoding="utf-8") for name in ("style.css", "report.css")),
        scripts=[(TEMPLATES / name).read_text(encoding="utf-8") for name in ("page.js", "chart.js")],
        contents=[(name, part.partition("\n")[0].lstrip("# ")) for name, part in sections.items()],
        parts={name: writer(part.replace(f"]({REFERENCE}#", "](#")) for name, part in sections.items()},
        integrators=_full_table("integrators", *records),
        provenance=netcdf.provenance(changes=True),
        date=datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
    )
    target = results / PAGE
    netcdf.write_text(target, text)
    netcdf.write_text(results / WORDS, "\n".join(parts.values()))
    netcdf.write_text(results / REFERENCE, "# For reference\n\n" + "\n".join(appendix.values()))
    return target


def _full_table(name: str, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A full table as a folded HTML element, which the page's script fills when it is opened."""
    cells = [["" if value != value else str(value) for value in row] for row in rows]  # noqa: PLR0124  (not a number)
    names = [formats.typeset(str(name)) for name in header]
    content = json.dumps({"header": names, "rows": cells}, ensure_ascii=False, separators=(",", ":"))
    content = content.replace("</", "<\\/")
    return (
        f'<details class="whole" data-table="{name}"><summary>All {len(cells):,} rows, to search and to sort</summary>'
        f'<script type="application/json">{content}</script></details>'
    )


def _read(file: Path) -> tuple[list[str], Iterable[Sequence[Any]]]:
    """Header and rows of a stored table."""
    import pandas as pd

    frame = pd.read_csv(file)
    for name in frame.select_dtypes("float"):
        frame[name] = [float(f"{value:.4g}") for value in frame[name]]
    return list(frame.columns), frame.itertuples(index=False)
