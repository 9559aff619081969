"""Convert the Markdown of the report to HTML: figures with captions, scrolling tables, formulas, interactive charts.

markdown-it-py parses the Markdown. A paragraph that is one image becomes a figure, with the paragraph below it as the
caption; a paragraph in bold above a table is its title. Formulas between ``$$``, and the markers of
`symtop.report.template`, are split off before.
"""

import html
import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from markdown_it import MarkdownIt
from markdown_it.token import Token

LONG_CELL = 27  # characters: longer cells may be broken into lines
AT_ONCE = 2  # figures that are loaded at once; later ones when they are scrolled to
MATHML = "http://www.w3.org/1998/Math/MathML"
PIECES = re.compile(r"^<!-- (?P<kind>chart|table) (?P<name>\S+) -->$|^\$\$(?P<formula>.+?)\$\$$", re.MULTILINE)


def slug(heading: str) -> str:
    """The anchor of a heading, in the form of GitHub and the documentation's site."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


class Writer:
    """Converts the texts of one page; `images` has source, width and height of each figure by its address.

    `markers` returns the HTML for the kind and the name of a marker; `reserved` anchors are not given again.
    """

    def __init__(
        self, images: Mapping[str, Mapping[str, Any]], markers: Callable[[str, str], str], *reserved: str
    ) -> None:
        self.images, self.markers, self.anchors = images, markers, {*reserved}  # unique
        self._figures = 0  # number of figures so far
        self._parser = MarkdownIt("commonmark", {"html": False}).enable("table")

    def __call__(self, text: str) -> str:
        """A text in Markdown as HTML."""
        parts, end = [], 0
        for piece in PIECES.finditer(text):
            parts += [self._markdown(text[end : piece.start()]), self._piece(piece)]
            end = piece.end()
        return "\n".join(filter(None, [*parts, self._markdown(text[end:])]))

    def anchor(self, name: str) -> str:
        """A unique anchor: the name, with a number appended if it is taken."""
        candidates = (f"{name}-{count}" for count in itertools.count(1))
        free = next(anchor for anchor in itertools.chain([name], candidates) if anchor not in self.anchors)
        self.anchors.add(free)
        return free

    def _piece(self, piece: re.Match[str]) -> str:
        if piece["formula"] is None:
            return self.markers(piece["kind"], piece["name"])
        from latex2mathml.converter import convert

        mathml = str(convert(piece["formula"], display="block")).replace(f' xmlns="{MATHML}"', "")  # HTML needs none
        return f'<div class="formulas">{mathml}</div>'

    def _markdown(self, text: str) -> str:
        tokens, title, parts = self._parser.parse(text), "", []
        ends = [index + 1 for index, token in enumerate(tokens) if token.level == 0 and token.nesting <= 0]
        blocks = [tokens[begin:end] for begin, end in itertools.pairwise([0, *ends])]  # of the top level
        while blocks:
            block = blocks.pop(0)
            kind = block[0].type
            bold = _title(block[1]) if kind == "paragraph_open" else ""
            if bold:
                block[0].attrSet("class", "title")
            if kind == "paragraph_open" and _only(block[1], "image"):
                below = blocks[0] if blocks else block
                captioned = below[0].type == "paragraph_open" and not _only(below[1], "image")
                caption = blocks.pop(0)[1:2] if captioned else []
                parts.append(self._figure(block[1].children[0], caption))  # type: ignore[index]
            elif kind == "table_open":
                parts.append(self._table(block, title))
            elif kind == "heading_open":
                parts.append(self._heading(block))
            else:
                parts.append(self._rendered(block))
            title = bold
        return "\n".join(parts)

    def _rendered(self, tokens: Sequence[Token]) -> str:
        return str(self._parser.renderer.render(tokens, self._parser.options, {}))

    def _heading(self, block: Sequence[Token]) -> str:
        name = self.anchor(slug(block[1].content))
        level = block[0].tag
        return f'<{level} id="{name}">{self._rendered(block[1:2])} {link(name, block[1].content)}</{level}>'

    def _figure(self, image: Token, caption: Sequence[Token]) -> str:
        address, alt = str(image.attrs["src"]), html.escape(image.content)
        picture = self.images.get(address, {})
        size = f' width="{picture["width"]}" height="{picture["height"]}"' if picture else ""
        lazy = ' loading="lazy" decoding="async"' if self._figures >= AT_ONCE else ""
        self._figures += 1
        name = self.anchor(Path(address).stem)
        words = f"{self._rendered(caption)} {link(name, f'figure {name}')}" if caption else ""
        return (
            f'<figure id="{name}"><div class="scroll" tabindex="0" role="region" aria-label="Figure {name}"><img '
            f'src="{picture.get("source", address)}"{size}{lazy} alt="{alt}"></div>'
            f"<figcaption>{words}</figcaption></figure>"
        )

    def _table(self, block: Sequence[Token], title: str) -> str:
        name = self.anchor(slug(title) or "table")
        for cell, content in itertools.pairwise(block):
            if cell.type == "td_open" and len(content.content) > LONG_CELL and " " in content.content:
                cell.attrSet("class", "words")
        body = self._rendered(block).replace("<th>", '<th scope="col">')
        body = body.replace("<table>", f'<table data-name="{name}">', 1)
        return (
            f'<div class="scroll" tabindex="0" role="region" aria-label="{html.escape(title) or "Table"}">{body}</div>'
        )


def link(name: str, title: str) -> str:
    """A link, shown as #, to the anchor `name`."""
    return f'<a class="anchor" href="#{name}" aria-label="Link to {html.escape(title)}">#</a>'


def _only(inline: Token, kind: str) -> bool:
    return [token.type for token in inline.children or []] == [kind]


def _title(inline: Token) -> str:
    """The bold text at the beginning of a paragraph, unless it is a sentence."""
    children = [token for token in inline.children or [] if token.type != "text" or token.content]
    bold = children[1].content if children and children[0].type == "strong_open" else ""
    return "" if bold.endswith(".") else bold
