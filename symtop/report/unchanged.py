"""Is the page that stands in a folder the one that would be written now? It holds a hash of all it is made of.

That is the code and the templates of symtop, what installed packages announce to it, the findings of all studies by
their content, and each figure by its size and the time of its last change. Asking takes a tenth of a second, writing
the page two.
"""

import re
from collections.abc import Sequence
from pathlib import Path

from symtop.core.code_hash import PACKAGE, digest, file_reasons, hashed, packages
from symtop.runner.settled import announced

PAGE, WORDS = "report.html", "report.md"
MARK = re.compile(r'<meta name="made-of" content="(\w+)">')
HEAD = 4000  # characters from the beginning of a page, in which the mark stands


def made_of(results: Path, *, embed: bool, plugins: Sequence[str] = ()) -> str:
    """The hash of what the page of a folder is made of, with some plug-ins in use."""
    code = [path for path in PACKAGE.rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    reasons = file_reasons(code) | packages("jinja2") | {"embed": str(embed)}
    reasons |= {"announced": announced(), "plug-ins": hashed(*plugins)}
    for path in results.glob("*.json"):  # read anew: `file_reasons` keeps what it has read
        reasons[f"findings {path.name}"] = hashed(path.read_text(encoding="utf-8", errors="replace"))
    for path in results.glob("*.nc"):
        reasons[f"dataset {path.name}"] = "there"  # the page links it
    for path in (results / "figures").glob("*"):
        facts = path.stat()
        reasons[f"figure {path.name}"] = f"{facts.st_size} {facts.st_mtime_ns}"
    return digest(reasons)


def is_current(results: Path, *, embed: bool) -> bool:
    """Does the page of a folder stand there as it would be written without plug-ins?"""
    try:
        with (results / PAGE).open(encoding="utf-8") as page:
            mark = MARK.search(page.read(HEAD))
    except (OSError, UnicodeDecodeError):
        return False
    return mark is not None and (results / WORDS).is_file() and mark.group(1) == made_of(results, embed=embed)
