"""What a PDF embeds of a font: its letters, without the tables by which a program lays out text.

matplotlib has fontTools cut each font down to the letters of a figure. That takes 75 ms a font, 50 ms of them for these
tables, and a figure has two to four fonts. Nobody asks for the tables: a letter of a PDF has its place in it.
"""

import contextlib
from collections.abc import Iterator

LAYOUT = ("GSUB", "GPOS", "GDEF")  # replacement, placing and kinds of letters
DROPPED = "_drop_tables_default"  # matplotlib lets nobody choose the options


@contextlib.contextmanager
def letters_alone() -> Iterator[None]:
    """Have fontTools drop the tables; a version that keeps its list elsewhere embeds them, and is as slow as it was."""
    from fontTools.subset import Options

    before = getattr(Options, DROPPED, None)
    if before is None:
        yield
        return
    setattr(Options, DROPPED, [*before, *LAYOUT])
    try:
        yield
    finally:
        setattr(Options, DROPPED, before)
