"""What the built-in integrators are, in a paragraph each: `about.md`, by name."""

import functools
import re
from importlib import resources


@functools.cache
def paragraphs() -> dict[str, str]:
    """The text under each heading ``## NAME``, on one line."""
    text = resources.files("symtop.methods").joinpath("about.md").read_text(encoding="utf-8")
    _, *sections = re.split(r"^## (.+)$", text, flags=re.MULTILINE)
    return {name: " ".join(body.split()) for name, body in zip(sections[::2], sections[1::2], strict=True)}
