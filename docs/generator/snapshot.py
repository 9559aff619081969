"""Copies the report in words and its figures to docs/snapshot, which this repository holds: make snapshot.

What the studies write into results/ is not tracked, so that a run of them leaves a checkout as it was. The snapshot is
taken when what it says changes; a figure that the report no longer shows is removed from it. Tables are in it as far as
the report shows them: the links to whole ones, which `make studies` writes, are taken out. What pages quote is put
between their marks: the beginning of the front page in the README, which is the first page of the site, and answers of
studies at the top of docs/choosing.md and in docs/results.md.
"""

import re
import shutil
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SHOWN = re.compile(r"\]\(figures/([^)]+)\)")
STORED = re.compile(  # links to what is not tracked
    r" \(\[[^]]+\]\(tables/[^)]+\)\)|; \[CSV\]\(tables/[^)]+\)"
    r"|\[([^]]+)\]\((?:tables/[^)]+|[\w-]+\.nc)\)|<!-- \w+ [\w-]+ -->\n\n"
)
QUOTED = {
    "choosing.md": "Which method is the cheapest at the accuracy I need, with what I have?",
    "results.md": "What makes",
}
BEGIN, END = "<!-- from the report -->\n", "<!-- to here -->\n"
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
    shutil.rmtree(snapshot / "figures", ignore_errors=True)
    (snapshot / "figures").mkdir(parents=True)
    for name in names:
        shutil.copyfile(results / "figures" / name, snapshot / "figures" / name)
    for file in (results / name for name in ("report.md", "reference.md") if (results / name).is_file()):
        text = STORED.sub(lambda link: link[1] or "", file.read_text(encoding="utf-8"))
        (snapshot / file.name).write_text(text, encoding="utf-8")
    return names


def answer(report: str, question: str) -> str:
    """The paragraph below the heading that begins with a question. SystemExit if there is none."""
    page = re.search(rf"^## {re.escape(question)}.*\n\n(.+)$", report, flags=re.MULTILINE)
    if page is None:
        sys.exit(f"snapshot: the report has no page with the question {question}")
    return wrapped(page[1]) + "\n"


def wrapped(paragraph: str) -> str:
    """Prose in lines of `WIDTH`; figures, rows of tables and lines that are short stay as they are."""
    return (
        paragraph
        if paragraph.startswith(("!", "|"))
        else textwrap.fill(paragraph, WIDTH, break_on_hyphens=False, break_long_words=False)
    )


def beginning(report: str) -> str:
    """The front page from its first figure to what will go wrong, figures where the README finds them."""
    text = re.split(r"(?:## |\*\*)What will go wrong", report.partition("\n\n")[2].partition("\n\n")[2])[0].strip()
    text = text.replace("](figures/", "](docs/snapshot/figures/")
    return "\n\n".join(map(wrapped, text.split("\n\n"))) + "\n"


def quote(said: str, page: str) -> str:
    """A page with what is said between its two marks. SystemExit if the page has none."""
    parts = re.split(f"({re.escape(BEGIN)}|{re.escape(END)})", page)
    if len(parts) != 5 or (parts[1], parts[3]) != (BEGIN, END):
        sys.exit(f"snapshot: a page must have the lines {BEGIN.strip()} and {END.strip()} once each, in this order")
    return "".join([*parts[:2], said, *parts[3:]])


def quoted(report: str) -> dict[str, str]:
    """What pages quote from the report, by their paths."""
    answers = {f"docs/{page}": answer(report, question) for page, question in QUOTED.items()}
    return {"README.md": beginning(report), **answers}


if __name__ == "__main__":
    snapshot = ROOT / "docs" / "snapshot"
    names = take(ROOT / "results", snapshot)
    for name, said in quoted((snapshot / "report.md").read_text(encoding="utf-8")).items():
        page = ROOT / name
        page.write_text(quote(said, page.read_text(encoding="utf-8")), encoding="utf-8")
    print(f"snapshot: {len(names)} figures in docs/snapshot")  # noqa: T201
