"""What notebooks show: records and catalogues as small HTML tables."""

import html
from collections.abc import Iterable, Sequence
from typing import TypeVar

Value = TypeVar("Value")


def html_table(rows: Iterable[Sequence[object]], header: Sequence[str] = ()) -> str:
    """An HTML table of cells, escaped."""

    def row(cells: Iterable[object], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(str(cell))}</{tag}>" for cell in cells) + "</tr>"

    head = f"<thead>{row(header, 'th')}</thead>" if header else ""
    return f"<table>{head}<tbody>{''.join(row(cells, 'td') for cells in rows)}</tbody></table>"


def record_table(record: object, names: Iterable[str]) -> str:
    """One record as a table of attribute and value."""
    return html_table((name, _short(getattr(record, name))) for name in names)


class Catalogue(dict[str, Value]):
    """Named records: a dict that notebooks show as a table of what each record says of itself in `columns`."""

    columns: Sequence[str] = ("name",)

    def _repr_html_(self) -> str:
        rows = [[_short(getattr(record, name)) for name in self.columns] for record in self.values()]
        return html_table(rows, self.columns)


def _short(value: object) -> object:
    value = value() if callable(value) else value
    if isinstance(value, frozenset | tuple):
        return ", ".join(sorted(map(str, value))) or "nothing"
    return "unknown" if value is None else f"{value:.6g}" if isinstance(value, float) else value
