"""The gallery: every figure in docs/snapshot with its caption, the study that makes it and the command to type.

Titles, captions and notes on reading are those of the pages there, in the order of the front page. A figure is of the
study whose folder its name begins with; those of benchmarks are named in `OTHERS`. A figure that the report does not
show, and one that nothing makes, is an error: the site does not build.
"""

import re
from pathlib import Path
from typing import NamedTuple

from generator.snapshot import whole
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

ROOT = Path(__file__).resolve().parents[2]
SNAPSHOT = ROOT / "docs" / "snapshot"
PAGE, MARK = "reference/gallery", "<!-- gallery -->"
OTHERS = {  # a command and the code, by the name's beginning
    "peers": ("make peers", "benchmarks/peers/study.py"),
    "guard": ("python -m benchmarks.guard", "benchmarks/guard.py"),
}
FRONT = "Front page"
SHOWN = re.compile(
    r"^(?:\*\*(?P<title>[^*\n]+)\*\*\n\n)?!\[(?P<alt>.*)\]\(figures/(?P<file>[^)]+)\)\n\n(?P<caption>\S(?:.|\n(?!\n))*)",
    re.MULTILINE,
)


class Figure(NamedTuple):
    """A figure as the report shows it."""

    file: str
    title: str
    alt: str
    caption: str


def sections(report: str) -> dict[str, tuple[str, list[Figure]]]:
    """Of each section of the report that has figures: its text, and its figures in order."""
    with_figures: dict[str, tuple[str, list[Figure]]] = {}
    first, *others = re.split(r"^## ", report, flags=re.MULTILINE)
    for title, _, text in [(FRONT, "", first), *(part.partition("\n") for part in others)]:
        shown = SHOWN.finditer(text)
        if figures := [Figure(entry["file"], entry["title"] or "", entry["alt"], entry["caption"]) for entry in shown]:
            with_figures[title.strip()] = (text, figures)
    return with_figures


def maker(file: str, root: Path = ROOT) -> tuple[str, str]:
    """The command that makes a figure, and the file with the code."""
    name = file.partition("-")[0]
    if (root / "studies" / name / "study.py").is_file():
        code = next(code for code in ("figures.py", "study.py") if (root / "studies" / name / code).is_file())
        return f"symtop study {name}", f"studies/{name}/{code}"
    if name in OTHERS:
        return OTHERS[name]
    raise ExtensionError(f"gallery: nothing is known to make the figure {file}")


def markdown(report: str, tracked: set[str], root: Path = ROOT) -> str:
    """The page below its heading; ExtensionError for a figure without a caption and for a caption without a figure."""
    parts = sections(report)
    shown = {figure.file for _, figures in parts.values() for figure in figures}
    if shown != tracked:
        raise ExtensionError(f"gallery: report and figures of docs/snapshot differ by {sorted(shown ^ tracked)}")
    lines: list[str] = []
    for title, (text, figures) in parts.items():
        lines += [f"## {title}", ""]
        for command, code in dict.fromkeys(maker(figure.file, root) for figure in figures):
            lines += [f"Made by `{command}`; the code that draws is in `{code}`.", ""]
        if reading := re.search(r"^\*\*How to read it\.\*\*.*", text, re.MULTILINE):
            lines += [reading.group(), ""]
        for figure in figures:
            lines += [f"**{figure.title}**", ""] if figure.title else []
            lines += [f"```{{figure}} ../snapshot/figures/{figure.file}", f":name: {Path(figure.file).stem}"]
            lines += [
                f":alt: {figure.alt}",
                ":loading: lazy",
                f":target: ../_images/{figure.file}",
                "",
                figure.caption,
                "```",
                "",
            ]
    return "\n".join(lines)


def _fill(_app: Sphinx, page: str, source: list[str]) -> None:
    if page == PAGE:
        tracked = {path.name for path in (SNAPSHOT / "figures").iterdir()}
        source[0] = source[0].replace(MARK, markdown(whole(SNAPSHOT), tracked))


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("source-read", _fill)
    return {"parallel_read_safe": True}
