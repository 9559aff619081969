"""The page of a study: its template, in Markdown, filled with its facts, tables and figures.

A template is `page.md` beside the study's `study.py`, or NAME.md beside a user's own study NAME.py; without one, the
page shows everything that the study has (`templates/plain.md`). A template contains

    {{ question }}                            the question of the study
    {{ f.NAME | number(2, "rad") }}           a fact in a format of `symtop.report.formats`
    {{ pages.drift }}                         a link to the page of another study; its question is the text
    {{ table("NAME", title="What it shows") }}
    {% call figure("NAME", title="What is drawn", alt="For those who cannot see it") %}
    The caption: what was found, and how it was drawn.
    {% endcall %}

A sentence with a fact that was not measured is left out, and the page says once that sentences are missing.
`has("NAME", ...)` is true if these facts were measured, and these figures and tables made. A figure that was not drawn
is left out with its title and caption, and so is a table without rows.
"""

import re
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from symtop.core.errors import SymtopError
from symtop.methods.framework.registry import engines, methods
from symtop.report import formats
from symtop.report.formats import table

MOST_ROWS = 15  # of a table on a page; the rest is in its CSV
PLAIN = "plain.md"
MARKER = "<!-- {kind} {name} -->"  # replaced in HTML by an interactive chart or a full table
GAP = "\N{OBJECT REPLACEMENT CHARACTER}"  # marks a fact that was not measured, until its sentence is removed
PARTIAL = "*This run measured a part of the study; sentences about the rest are left out.*"

Findings = Mapping[str, Any]


def filled(findings: Findings, results: Path, *, pages: Mapping[str, str] | None = None) -> str:
    """The page of a study in Markdown; `pages` are links by names of studies. SymtopError for a wrong template."""
    name = findings["study"]
    context = {"question": findings["question"], "pages": Links(pages or {})} | _names([findings], results)
    context |= {"f": SimpleNamespace(**findings["facts"]), "facts": findings["facts"]}
    context |= {kind: [entry["name"] for entry in findings[kind]] for kind in ("pictures", "tables")}
    text = rendered(findings["page"], f"page of {name}", context)
    head, _, body = without_gaps(text).strip().partition("\n\n")
    parts = [head, PARTIAL if GAP in text else "", body, *findings["failures"], findings.get("measured")]
    file, cases = findings.get("dataset"), findings["cases"]
    parts += [f"Data: [{file}]({file}), {formats.count(cases)} case{'' if cases == 1 else 's'}." if file else ""]
    return "\n\n".join(filter(None, parts)) + "\n"


def counts() -> dict[str, int]:
    """The numbers of methods and of maps of engines, for templates."""
    return {"methods": len(methods()), "maps": len(engines())}


def front(template: str, studies: Sequence[Findings], results: Path, pages: Mapping[str, str]) -> str:
    """The front page; in its template `fact("STUDY.NAME")` is a fact or None, figures and tables are ``STUDY-NAME``."""
    facts = {f"{study['study']}.{name}": value for study in studies for name, value in study["facts"].items()}
    titles = {study["title"]: pages.get(study["study"], "").partition("](")[2] for study in studies}
    context = {"pages": Links(pages), "fact": facts.get} | counts()
    context["listed"] = [f"[{title}]({address}" for title, address in titles.items() if address]
    text = rendered(template, "front page", context | _names(studies, results, prefixed=True))
    return without_gaps(text).strip() + "\n"


def answer(findings: Findings, results: Path) -> str:
    """The answer of a study: the first paragraph or list below its question, as plain text; empty if there is none."""
    page = filled(findings, results).replace(f"{PARTIAL}\n\n", "")
    below = re.split(r"\n{2,}", page.partition("\n\n")[2].strip())[0]
    below = ", ".join(re.findall(r"^- (.*)$", below, re.MULTILINE)) if below.startswith("- ") else below
    return (
        ""
        if below.startswith(("#", "**", "!", "|", "<", "Data:"))
        else re.sub(r"[`*]|\[([^]]+)\]\([^)]*\)", r"\1", below)
    )


class Links(dict[str, str]):
    """Links to pages by the names of studies; the plain name if there is no page."""

    def __missing__(self, name: str) -> str:
        return name


def environment(**options: Any) -> Any:
    """The Jinja environment of the report's templates; an undefined name is an error."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("symtop", "report/templates")
    return Environment(loader=loader, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, **options)  # noqa: S701


def rendered(template: str | None, name: str, context: Mapping[str, Any]) -> str:
    """A template (None: the plain one) rendered with `context`; SymtopError for a faulty one or an undefined name."""
    from jinja2 import TemplateError

    env = environment(autoescape=False, finalize=lambda value: GAP if value is None else value)
    env.filters |= {function.__name__: _as_filter(function) for function in formats.FILTERS}
    template = template and template.replace("endraw %}", "endraw +%}")  # keeps the empty line after it
    try:
        parsed = env.get_template(PLAIN) if template is None else env.from_string(template)
        text = parsed.render(**context)
    except (TemplateError, TypeError, ValueError, LookupError, ArithmeticError) as error:
        frames = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == "<template>"]
        lines = [getattr(error, "lineno", None), *frames[::-1]]
        line_words = f", line {line}" if (line := next(filter(None, lines), None)) else ""
        words = str(error).replace("'types.SimpleNamespace object' has no attribute", "there is no fact")
        raise SymtopError(f"{name}{line_words}: {words}") from error
    return "\n\n".join(map(_unwrapped, re.split(r"\n{2,}", text.strip()))) + "\n"


def without_gaps(text: str) -> str:
    """A text without the sentences and list items that contain `GAP`."""
    blocks = [_complete(block) if GAP in block else block for block in text.split("\n\n")]
    return "\n\n".join(filter(None, blocks))


def _complete(block: str) -> str:
    is_list = re.match(r"[-*] |\d+[.)] ", block)
    parts = re.split(r"\n(?=[-*] |\d+[.)] )" if is_list else r"(?<=[.?]) |(?<=[.?]\*\*) ", block)
    full = [part for part in parts if GAP not in part]
    return "" if all(re.fullmatch(r"\*\*[^*]+\*\*", part) for part in full) else ("\n" if is_list else " ").join(full)


def _as_filter(filter_: Callable[..., str | None]) -> Callable[..., str | None]:
    """A format as a filter of templates: None (not measured) is passed on, and an undefined name is an error."""
    from jinja2 import Undefined

    def apply(value: Any, *options: Any, **keywords: Any) -> str | None:
        value = str(value) if isinstance(value, Undefined) else value
        return None if value is None else filter_(value, *options, **keywords)

    return apply


def _unwrapped(block: str) -> str:
    """A paragraph or a list item as one line, because facts of any length are filled in; other blocks unchanged."""
    if re.match(r"[-*] |\d+[.)] ", block):
        return re.sub(r"\n +", " ", block)
    return block if re.match(r"[|#>`\s]|<!--|\$\$", block) else " ".join(block.split("\n"))


def _names(studies: Sequence[Findings], results: Path, *, prefixed: bool = False) -> dict[str, Callable[..., Any]]:
    """The functions `figure`, `table` and `has` of templates, for the figures, tables and facts of some studies."""
    pictures: dict[str, Any] = {}
    tables: dict[str, Any] = {}
    facts: set[str] = set()
    for study in studies:
        prefix = f"{study['study']}-" if prefixed else ""
        pictures |= {f"{prefix}{picture['name']}": picture for picture in study["pictures"]}
        tables |= {f"{prefix}{table['name']}": table for table in study["tables"] if table["rows"]}
        facts |= {f"{prefix}{name}" for name, value in study["facts"].items() if value is not None}

    def figure(name: str, title: str = "", alt: str = "", chart: str = "", caller: Any = None) -> str:
        if name not in pictures:
            return ""
        caption = " ".join(caller().split()) if caller else ""
        if GAP in caption:  # keep a caption, because the paragraph below a figure is taken for it
            caption = f"{_complete(caption) or f'{title}.'} {GAP}"
        parts = [f"**{title}**" if title else "", f"![{alt}](figures/{pictures[name]['file']})", caption]
        return "\n\n".join(filter(None, [*parts, MARKER.format(kind="chart", name=chart) if chart else ""])) + "\n"

    def excerpt(
        name: str, title: str = "", rows: int = MOST_ROWS, columns: Sequence[str] | None = None, digits: int = 3
    ) -> str:
        if name not in tables:
            return ""
        import pandas as pd

        file, count = tables[name]["file"], tables[name]["rows"]
        frame = pd.read_csv(results / "tables" / file, nrows=rows)
        frame = frame if columns is None else frame[list(columns)]
        cells = [[formats.cell(value, digits) for value in row] for row in frame.itertuples(index=False)]
        extent = f"the first {len(cells)} of {count:,} rows; " if count > len(cells) else ""
        marker = [MARKER.format(kind="table", name=Path(file).stem)] if count > len(cells) else []
        head = f"**{title or name}** ({extent}[CSV](tables/{file}))"
        return "\n\n".join([head, table(list(map(str, frame.columns)), cells), *marker]) + "\n"

    def has(*names: str) -> bool:
        return all(name in pictures or name in tables or name in facts for name in names)

    return {"figure": figure, "table": excerpt, "has": has}
