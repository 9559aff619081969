"""Findings of a benchmark as the report takes them: a page of sentences, pictures with captions, and short tables.

A benchmark is measured on a quiet machine, and what it says is stored with its numbers; sentences of a study stand in a
template, since it is measured again and again.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from symtop.report.formats import table

ROWS, TABLES = 5, 4  # shown by the page; the command prints all


class Table(NamedTuple):
    """A table of a benchmark; cells are shown as they are."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]

    @property
    def text(self) -> str:
        """All of it for a terminal: each column is as wide as its longest cell."""
        widths = [max(map(len, column)) for column in zip(self.header, *self.rows, strict=True)]
        lines = ("  ".join(map(str.ljust, row, widths)).rstrip() for row in (self.header, *self.rows))
        return "\n".join([self.title, *lines, ""])


def findings(
    name: str, title: str, question: str, sentences: Sequence[str] | Table, how_to_read: str, tables: Sequence[Table],
    *, answer: str = "", further: Sequence[str] = (), captions: Mapping[str, tuple[str, str]] | None = None,
    **others: Any,
) -> dict[str, Any]:  # fmt: skip
    """The contents of NAME.json; `captions`: caption and alt text of each figure; `sentences` can be a table.
    The `answer` to the question comes first.

    From "How to read it" on the page is for reference: the `further` sentences and the tables.
    """
    figures = [
        f'{{% call figure("{figure}", title={title!r}, alt={alt!r}) %}}{_raw(caption)}{{% endcall %}}'
        for figure, (caption, alt) in (captions or {}).items()
    ]
    shown = [_raw(f"**{tab.title}**{_count(tab)}\n\n{table(tab.header, tab.rows[:ROWS])}") for tab in tables[:TABLES]]
    listed, details = (
        _raw(table(part.header, part.rows) if isinstance(part, Table) else "\n".join(f"- {line}" for line in part))
        for part in (sentences, further)
    )
    reading = _raw(f"**How to read it.** {how_to_read}")
    first = [_raw(answer)] if answer else []
    page = "\n\n".join(["# {{ question }}", *first, listed, *figures, reading, *([details] if further else []), *shown])
    return {
        "study": name, "title": title, "question": question, "facts": {}, "tables": [], "charts": [], "pictures": [],
        "failures": [], "quick": False, "page": page, **others,
    }  # fmt: skip


def _count(table: Table) -> str:
    return f" (the first {ROWS} of {len(table.rows)} rows)" if len(table.rows) > ROWS else ""


def _raw(text: str) -> str:
    return f"{{% raw %}}{text}{{% endraw %}}"
