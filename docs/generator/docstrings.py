"""Docstrings as autodoc wants them: from the plain Markdown of the sources to reStructuredText.

A docstring has paragraphs, `code` in one or two backticks, *emphasis*, lists with a dash and blocks that are indented:
formulas and tables in plain text. Blocks are shown as they stand. All other signs (``|``, ``_``, ``*`` alone) mean
nothing in the sources and are escaped.
"""

import re
from typing import Any

from sphinx.application import Sphinx

CODE = re.compile(r"(``[^`]+``|`[^`]+`)")
EMPHASIS = re.compile(r"(?<![\w*])\*(\w[^*\n]*\w|\w)\*(?![\w*])")
SIGNS = re.compile(r"([\\|*_`<>])")


def _plain(text: str) -> str:
    parts = re.split(EMPHASIS, text)  # every second part is emphasised
    escaped = [SIGNS.sub(r"\\\1", part) for part in parts]
    return "".join(rf"\ *{part}*\ " if place % 2 else part for place, part in enumerate(escaped))


def inline(text: str) -> str:
    """A paragraph, its lines joined: code in double backticks, emphasis kept, everything else as it is written."""
    parts = CODE.split(text)
    return "".join(rf"``{part.strip('`')}``\ " if place % 2 else _plain(part) for place, part in enumerate(parts))


def restructured(docstring: list[str]) -> list[str]:
    """The lines of a docstring in Markdown as lines of reStructuredText."""
    lines: list[str] = []
    for block in re.split(r"\n\s*\n", "\n".join(docstring).strip("\n")):
        if block.startswith(" "):
            if not (lines and lines[-1] == "" and lines[-2:-1] and lines[-2].startswith("   ")):
                lines += ["::", ""]
            lines += [f"   {line}" for line in block.splitlines()]
        elif re.match(r"- ", block):
            for item in re.split(r"^- ", block, flags=re.MULTILINE)[1:]:
                lines.append("- " + inline(" ".join(item.split())))
        else:
            lines += _paragraph(block)
        lines.append("")
    return lines


def _paragraph(block: str) -> list[str]:
    """A paragraph; lines that are indented below it without an empty line between are a block of their own."""
    above = re.match(r"(?:\S.*\n?)+", block)
    assert above is not None
    rest = block[above.end() :]
    lines = [inline(" ".join(above.group().split()))]
    if rest:
        lines += ["", *restructured(rest.split("\n"))]
    return lines


def _process(_app: Sphinx, _what: str, _name: str, _obj: Any, _options: Any, lines: list[str]) -> None:
    lines[:] = restructured(lines)


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", _process)
    return {"parallel_read_safe": True}
