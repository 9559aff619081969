"""Copies the report in words and its figures to docs/snapshot, which this repository holds: make snapshot.

What the studies write into results/ is not tracked, so that a run of them leaves a checkout as it was. The snapshot is
taken when its messages change; a figure that the report no longer shows is removed from it. What pages quote from the
report is put between their marks: its first answer at the top of docs/choosing.md, first findings in docs/results.md.
"""

import re
import shutil
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SHOWN = re.compile(r"\]\(figures/([^)]+)\)")
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
    (snapshot / "report.md").write_text(text, encoding="utf-8")
    return names


def answer(report: str) -> str:
    """The sentences and the table of the report's first section."""
    first = re.split(r"^## .*$", report, flags=re.MULTILINE)[1]
    sentences, table = (part.strip().splitlines() for part in first.strip().split("\n\n")[:2])
    return "\n".join([*map(_wrapped, sentences), "", *table]) + "\n"


def findings(report: str, section: str, count: int) -> str:
    """The first sentences that the report has in a section."""
    part = re.split(rf"^## {re.escape(section)}$", report, flags=re.MULTILINE)[1]
    sentences = re.findall(r"^- .*$", part, flags=re.MULTILINE)[:count]
    return "\n".join(map(_wrapped, sentences)) + "\n"


def _wrapped(sentence: str) -> str:
    return textwrap.fill(sentence, WIDTH, subsequent_indent="  ", break_on_hyphens=False, break_long_words=False)


def quote(said: str, page: str) -> str:
    """A page with what is said between its two marks. SystemExit if the page has none."""
    parts = re.split(f"({re.escape(BEGIN)}|{re.escape(END)})", page)
    if len(parts) != 5 or (parts[1], parts[3]) != (BEGIN, END):
        sys.exit(f"snapshot: a page must have the lines {BEGIN.strip()} and {END.strip()} once each, in this order")
    return "".join([*parts[:2], said, *parts[3:]])


def quoted(report: str) -> dict[str, str]:
    """What pages of docs quote from the report."""
    return {"choosing.md": answer(report), "results.md": findings(report, "Factors", 3)}


if __name__ == "__main__":
    docs = ROOT / "docs"
    names = take(ROOT / "results", docs / "snapshot")
    report = (docs / "snapshot" / "report.md").read_text(encoding="utf-8")
    for name, said in quoted(report).items():
        page = docs / name
        page.write_text(quote(said, page.read_text(encoding="utf-8")), encoding="utf-8")
    print(f"snapshot: {len(names)} figures in docs/snapshot")  # noqa: T201
