"""What a PDF embeds of a font: its letters, without the tables by which a program lays text out.

matplotlib has fontTools cut each font down to the letters of a figure. That takes 75 ms a font, 55 ms of them for these
tables, and a figure has two to five fonts. Nobody asks for the tables: a letter of a PDF has its place in it.
"""

import contextlib
from collections.abc import Iterator
from typing import Any

LAYOUT = ("GSUB", "GPOS", "GDEF", "kern")  # replacement, placing and kinds of letters, and distances of pairs


@contextlib.contextmanager
def letters_alone() -> Iterator[None]:
    """Have fontTools load fonts without the tables, for matplotlib lets nobody choose them."""
    from fontTools import subset

    whole = subset.load_font

    def load_font(*args: Any, **options: Any) -> Any:
        font = whole(*args, **options)
        for table in LAYOUT:
            if table in font:
                del font[table]
        return font

    subset.load_font = load_font
    try:
        yield
    finally:
        subset.load_font = whole
