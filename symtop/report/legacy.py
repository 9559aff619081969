"""Findings of studies that have sentences and no template, in the form of those that have one."""

from collections.abc import Mapping
from typing import Any

from symtop.report.tables import table
from symtop.report.template import MOST_ROWS


def modern(findings: Mapping[str, Any]) -> dict[str, Any]:
    """The same findings with a page of their sentences and the first rows of their tables."""
    if "facts" in findings:
        return dict(findings)
    opening = findings.get("opening") or {"sentences": [], "table": None}
    tables = [one for one in [opening["table"], *findings["tables"]] if one]
    bullets = [f"- {sentence}" for sentence in [*opening["sentences"], *findings["verdict"]]]
    parts = ["# {{ question }}", _raw("\n".join(bullets))]
    names = []
    for picture in findings["pictures"]:
        name = picture["file"].partition("-")[2].rpartition(".")[0]
        names.append({"name": name, "file": picture["file"]})
        alt = repr(picture["alt"].replace("[", "(").replace("]", ")"))
        parts.append(f"{{% call figure({name!r}, alt={alt}) %}}{_raw(picture['caption'])}{{% endcall %}}")
    parts.append(_raw(f"**How to read it.** {findings['how_to_read']}"))
    parts += [_raw(f"**{one['title']}**\n\n{table(one['header'], one['rows'][:MOST_ROWS])}") for one in tables]
    return {**findings, "facts": {}, "tables": [], "pictures": names, "page": "\n\n".join(parts)}


def _raw(text: str) -> str:
    return f"{{% raw %}}{text}{{% endraw %}}"
