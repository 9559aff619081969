"""Copies the report in words and its figures to docs/snapshot, which this repository holds: make snapshot.

What the studies write into results/ is not tracked, so that a run of them leaves a checkout as it was. The snapshot is
taken when what it says changes; a figure that the report no longer shows is removed from it. Each question of the
report is a page of its own, named after its short name on the front page, report.md. Tables are in it as far as
the report shows them: the links to whole ones, which `make studies` writes, are taken out. What pages quote is put
between their marks: in the README, which is the first page of the site, the figure of the front page before the first
commands and its tables after them; answers of studies in docs/choosing.md, docs/results.md and docs/about/faq.md. What
the benchmarks bench and peers have stored is said in docs/results.md by the templates beside this file.
"""

import json
import re
import shutil
import sys
import textwrap
from pathlib import Path
from typing import Any

from symtop.report.html import slug

ROOT = Path(__file__).resolve().parents[2]
SHOWN = re.compile(r"\]\(figures/([^)]+)\)")
STORED = re.compile(  # links to what is not tracked
    r" \(\[[^]]+\]\(tables/[^)]+\)\)|; \[CSV\]\(tables/[^)]+\)"
    r"|\[([^]]+)\]\((?:tables/[^)]+|[\w-]+\.nc)\)|<!-- \w+ [\w-]+ -->\n\n"
)
QUOTED = {  # of a page: the question, and the beginnings of further paragraphs
    "choosing.md": ("Which method is the cheapest at the accuracy I need, with what I have?",),
    "results.md": ("What makes",),
    "about/faq.md": ("My body is no symmetric top", "**What fell.** "),
}
TABLE = "**What can you supply?"  # with which the README goes on after its first commands
QUESTIONS = "**All questions:**"  # the front page's list of pages
FRONT = "report.md"
HAVE = "You have one of these?"  # the title of a table of the front page
BEGIN, FIGURE, GUARD, END = (f"<!-- {mark} -->\n" for mark in (
    "from the report", "its figure", "the guard, from the report", "to here"))  # fmt: skip
STORED_BY = {name: f"<!-- from results/{name}.json -->\n" for name in ("bench", "peers")}
WIDTH = 118


def take(results: Path, snapshot: Path) -> list[str]:
    """Copy; returns the names of the figures. SystemExit if there is no report, or a figure of it is missing."""
    try:
        text = (results / "report.md").read_text(encoding="utf-8")
    except OSError:
        sys.exit(f"snapshot: there is no {results / 'report.md'}; run make studies first")
    names = sorted(set(SHOWN.findall(text)))
    if missing := [name for name in names if not (results / "figures" / name).is_file()]:
        sys.exit(f"snapshot: figures of the report are missing: {', '.join(missing)}")
    shutil.rmtree(snapshot, ignore_errors=True)
    (snapshot / "figures").mkdir(parents=True)
    for name in names:
        shutil.copyfile(results / "figures" / name, snapshot / "figures" / name)
    reference = results / "reference.md"
    pages = parted(text) | ({reference.name: reference.read_text(encoding="utf-8")} if reference.is_file() else {})
    for file, page in pages.items():
        (snapshot / file).write_text(STORED.sub(lambda link: link[1] or "", page), encoding="utf-8")
    return names


def parted(report: str) -> dict[str, str]:
    """The pages of a report by their files, the front page first."""
    listed = re.findall(r"\[([^]]+)\]\(#([^)]+)\)", report.partition(QUESTIONS)[2].partition("\n")[0])
    files = {anchor: f"{slug(short)}.md" for short, anchor in listed}
    pages = {FRONT: "", **dict.fromkeys(files.values(), "")}
    for part in re.split(r"^(?=## )", report, flags=re.MULTILINE):
        file = files.get(slug(part.partition("\n")[0].lstrip("# ")), FRONT)
        front = "" if file == FRONT else FRONT  # on which every other anchor is
        text = re.sub(r"\]\(#([^)]+)\)", lambda link: f"]({files.get(link[1], f'{front}#{link[1]}')})", part)  # noqa: B023
        pages[file] += text if file == FRONT else re.sub(r"^#(#+ )", r"\1", text, flags=re.MULTILINE)
    back = f"\n\n[All questions]({FRONT})\n"
    return {file: text if file == FRONT else text.rstrip() + back for file, text in pages.items()}


def whole(snapshot: Path) -> str:
    """The report in one piece again, from the pages of a snapshot."""
    front = (snapshot / FRONT).read_text(encoding="utf-8")
    files = re.findall(r"\]\(([\w-]+\.md)\)", front.partition(QUESTIONS)[2].partition("\n")[0])
    pages = {file: (snapshot / file).read_text(encoding="utf-8") for file in files}
    text = "\n".join([front, *(re.sub(r"^#", "##", page, flags=re.MULTILINE) for page in pages.values())])
    for file, page in pages.items():
        text = text.replace(f"]({file})", f"](#{slug(page.partition(chr(10))[0].lstrip('# '))})")
    return text


def answer(report: str, question: str, *further: str) -> str:
    """The paragraph below the heading that begins with a question, and further ones. SystemExit if one is missing."""
    page = re.search(rf"^## {re.escape(question)}.*\n\n((?:(?!## ).*\n)+)", report, flags=re.MULTILINE)
    if page is None:
        sys.exit(f"snapshot: the report has no page with the question {question}")
    paragraphs = [page[1].partition("\n")[0]]
    for begin in further:
        paragraph = re.search(rf"^{re.escape(begin)}(.+)$", page[1], flags=re.MULTILINE)
        if paragraph is None:
            sys.exit(f"snapshot: the page with the question {question} has no paragraph {begin.strip()}")
        paragraphs.append(paragraph[1])
    return "\n\n".join(map(wrapped, paragraphs)) + "\n"


def wrapped(paragraph: str) -> str:
    """Prose in lines of `WIDTH`; figures, rows of tables and lines that are short stay as they are."""
    return (
        paragraph
        if paragraph.startswith(("!", "|"))
        else textwrap.fill(paragraph, WIDTH, break_on_hyphens=False, break_long_words=False)
    )


def titled(report: str, title: str) -> str:
    """The table with a bold title, and the paragraph below it; nothing if the report has none."""
    table = re.search(rf"^\*\*{re.escape(title)}.*\n\n(?:\|.*\n)+\n.+$", report, flags=re.MULTILINE)
    return "\n" + "\n\n".join(map(wrapped, table[0].split("\n\n"))) + "\n" if table else ""


def beginning(report: str) -> str:
    """The front page from its first figure to what will go wrong, figures where the README finds them."""
    text = re.split(r"(?:## |\*\*)What will go wrong", report.partition("\n\n")[2].partition("\n\n")[2])[0].strip()
    text = re.sub(r" \(the first \d+ of \d+ rows\)", "", text).replace("](figures/", "](docs/snapshot/figures/")
    return "\n\n".join(map(wrapped, text.split("\n\n"))) + "\n"


def quote(text: str, page: str, begin: str = BEGIN) -> str:
    """A page with a text between two marks. SystemExit if the page has none."""
    before, *rest = page.split(begin)
    if len(rest) != 1 or END not in rest[0]:
        sys.exit(f"snapshot: a page must have the line {begin.strip()} once, and {END.strip()} after it")
    return f"{before}{begin}{text}{END}{rest[0].partition(END)[2]}"


def quoted(report: str) -> dict[tuple[str, str], str]:
    """What pages quote from the report, by their paths and the marks before it."""
    answers = {(f"docs/{page}", BEGIN): answer(report, *parts) for page, parts in QUOTED.items()}
    answers["docs/choosing.md", BEGIN] += titled(report, HAVE)
    answers["docs/choosing.md", GUARD] = answer(report, "Does the guard need to know the solution?")
    figure, title, tables = beginning(report).partition(TABLE)
    return {("README.md", FIGURE): figure.rstrip() + "\n", ("README.md", BEGIN): title + tables, **answers}


def benchmark(name: str, results: Path) -> str:
    """What a template says of the numbers that a benchmark has stored."""
    from benchmarks import kernels, lanes
    from symtop.report.template import rendered

    data: dict[str, Any] = json.loads((results / f"{name}.json").read_text(encoding="utf-8"))
    context = data | {"f": data["facts"]}
    if name == "bench":
        many: dict[str, list[Any]] = {}
        for row in sorted(data["lanes"]["rows"], key=lambda row: row["ratio"]):
            many.setdefault(lanes.kind_of(row["name"], row["chart"]), []).append(row)
        context |= {
            "slow": [row for row in data["kernels"] if row["unfused"] > kernels.LIMIT], "limit": kernels.LIMIT,
            "fused": sum(row["ratio"] <= kernels.LIMIT for row in data["kernels"]),
            "kernel": {row["name"]: row for row in data["kernels"]},
            "part": {row["name"]: row["seconds"] for row in data["run"]["parts"]},
            "one_step": max(data["run"]["one_step"].values()),
            "many": {row["name"]: row["seconds"] for row in data["ensemble"]},
            "explicit": many["explicit"], "gauss": many["gauss"], "bodies": many[lanes.OF_BODIES],
            "pairs": [row for row in many[lanes.WIDE] if row["name"] in lanes.FIXED],
        }  # fmt: skip
    template = (ROOT / "docs" / "generator" / f"{name}.jinja").read_text(encoding="utf-8")
    return wrapped(rendered(template, f"{name}.jinja", context).strip()) + "\n"


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    snapshot = ROOT / "docs" / "snapshot"
    names = take(ROOT / "results", snapshot)
    for (name, begin), text in quoted(whole(snapshot)).items():
        page = ROOT / name
        page.write_text(quote(text, page.read_text(encoding="utf-8"), begin), encoding="utf-8")
    page = ROOT / "docs" / "results.md"
    for name, begin in STORED_BY.items():
        page.write_text(quote(benchmark(name, ROOT / "results"), page.read_text("utf-8"), begin), encoding="utf-8")
    print(f"snapshot: {len(names)} figures in docs/snapshot")  # noqa: T201
