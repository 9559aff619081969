"""The pages that people read, the README and the Markdown of docs/, and the blocks of code in them.

A block says by its language what a test does with it:

    python            is run; blocks of a page share their names and a folder
    python, # NAME    with a file name in the first line it is saved under that name, for what follows
    sh                commands of symtop and python, which are run and end with exit code 0
    console           a command after "$ symtop" and what it prints, to the word
    text              a part of what the block before it prints
    bash              commands for hours, other machines or a reader's files: read as the command line would

The word slow after a language (```sh slow) leaves a block to the slow tests.
"""

import re
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
LANGUAGES = {"python", "sh", "console", "text", "bash"}
FENCE = re.compile(r"^```(?P<info>[^`\n]*)\n(?P<code>.*?)^```$", re.MULTILINE | re.DOTALL)


class Block(NamedTuple):
    """A fenced block of a page."""

    language: str
    slow: bool
    code: str

    @property
    def file(self) -> str:
        """The name that a block of Python is saved under, or ""."""
        match = re.match(r"# ([\w-]+\.py)\n", self.code)
        return match.group(1) if match and self.language == "python" else ""


def pages() -> list[Path]:
    """The README and all pages in Markdown of the site that somebody wrote."""
    generated = {ROOT / "docs" / "_build", ROOT / "docs" / "snapshot"}
    files = (path for path in sorted((ROOT / "docs").rglob("*.md")) if not generated & set(path.parents))
    return [ROOT / "README.md", *files]


def blocks(text: str) -> list[Block]:
    """The blocks of a page in order; directives of the site, whose language stands in braces, are none."""
    result = []
    for fence in FENCE.finditer(text):
        language, *words = fence["info"].split() or [""]
        if not language.startswith("{"):
            assert words in ([], ["slow"]), fence["info"]
            result.append(Block(language, bool(words), fence["code"]))
    return result
