"""Tables as GitHub-flavoured Markdown."""

from collections.abc import Mapping, Sequence
from typing import Any


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A GitHub-flavoured table."""
    lines = ["| " + " | ".join(_escaped(cell) for cell in row) + " |" for row in [header, *rows]]
    return "\n".join([lines[0], "|" + "---|" * len(header), *lines[1:]])


def _escaped(cell: str) -> str:
    return cell.replace("|", "\\|").replace("<", "\\<")


def columns(records: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[list[Any]]]:
    """Header and rows of a table of records, which all have the same keys."""
    return list(records[0]), [list(record.values()) for record in records]
