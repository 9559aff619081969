"""Docstrings as autodoc wants them: from the plain Markdown of the sources to reStructuredText.

A docstring has paragraphs, `code` in one or two backticks, *emphasis*, and blocks that are indented: formulas and
tables in plain text, which are shown as they stand. All other signs (``|``, ``_``, a ``*`` alone) mean themselves and
are escaped.
"""

import re
from typing import Any

from sphinx.application import Sphinx

CODE = re.compile(r"(``[^`]+``|`[^`]+`)")
EMPHASIS = re.compile(r"(?<![\w*])\*(\w[^*\n]*\w|\w)\*(?![\w*])")
SIGNS = re.compile(r"([\\|*_`<>])")


def inline(text: str) -> str:
    """A paragraph: code in double backticks, emphasis kept, everything else as it is written."""
    parts = CODE.split(text)  # every second one is code
    return "".join(rf"``{part.strip('`')}``\ " if place % 2 else _plain(part) for place, part in enumerate(parts))


def _plain(text: str) -> str:
    parts = EMPHASIS.split(text)  # every second one is emphasised
    escaped = [SIGNS.sub(r"\\\1", part) for part in parts]
    return "".join(rf"\ *{part}*\ " if place % 2 else part for place, part in enumerate(escaped))


def restructured(docstring: str) -> list[str]:
    """The lines of a docstring in Markdown as lines of reStructuredText; a block that is indented becomes literal."""
    lines: list[str] = []
    literal = False
    for block in re.split(r"\n\s*\n", docstring.strip("\n")):
        above, literal = literal, block.startswith(" ")
        if literal and not above:
            lines += ["::", ""]
        lines += [f"   {line}" for line in block.splitlines()] if literal else [inline(" ".join(block.split()))]
        lines.append("")
    return lines


def _process(_app: Sphinx, _what: str, _name: str, _obj: Any, _options: Any, lines: list[str]) -> None:
    lines[:] = restructured("\n".join(lines))


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", _process)
    return {"parallel_read_safe": True}
