"""The report as Markdown beside its figures: the same words and tables, small enough to keep under version control."""

from collections.abc import Mapping, Sequence
from typing import Any

from symtop.report.method import Block, Part, glossary
from symtop.report.tables import table

FEW = 14  # rows of a table that is shown at once; longer ones are folded


def section(study: Mapping[str, Any]) -> str:
    """One study: question, verdict, figures, how to read them, tables."""
    tables = []
    for item in study["tables"]:
        title, body, count = item["title"], table(item["header"], item["rows"]), len(item["rows"])
        folded = f"<details><summary>{title} ({count} rows)</summary>\n\n{body}\n\n</details>"
        tables.append(f"**{title}**\n\n{body}" if count <= FEW else folded)
    parts = [
        f"## {study['title']}",
        f"*{study['question']}*",
        "\n".join(f"- {sentence}" for sentence in study["verdict"]),
        *(f"![{item['alt']}](figures/{item['file']})\n\n{item['caption']}" for item in study["pictures"]),
        f"**How to read it.** {study['how_to_read']}",
        *tables,
        *study["failures"],
        study["measured"],
    ]
    return "\n\n".join(part for part in parts if part)


def opening(study: Mapping[str, Any], titles: Mapping[str, str]) -> str:
    """A study's answer on the first screen, with links to the studies that explain it; empty if it has none.

    `titles` are those of the studies on the page.
    """
    first = study["opening"]
    if not first:
        return ""
    answer = "\n".join(f"- {sentence}" for sentence in first["sentences"])
    words = "\n".join(f"- {name}: {meaning}" for name, meaning in glossary(sentences(study)))
    parts = [f"## {first['question']}", answer, table(first["table"]["header"], first["table"]["rows"]), words]
    links = [f"[{words}](#{titles[name].lower().replace(' ', '-')})" for name, words in explanations(study, titles)]
    return "\n\n".join(filter(None, [*parts, f"More: {'; '.join(links)}."] if links else parts))


def sentences(study: Mapping[str, Any]) -> str:
    """All words of a study's answer, with those of its table."""
    first = study["opening"]
    cells = [*first["table"]["header"], *(cell for row in first["table"]["rows"] for cell in row)]
    return " ".join([first["question"], *first["sentences"], *cells])


def measured(parts: Sequence[Part]) -> str:
    """How it was measured: the same words as on the page, formulas in LaTeX."""
    sections = [f"### {part.title}\n\n" + "\n\n".join(map(_block, part.blocks)) for part in parts]
    return "\n\n".join(["## How it was measured", *sections])


def _block(block: Block) -> str:
    if block.rows:
        return table(block.header, block.rows)
    return block.words or "\n\n".join(f"$${formula}$$" for formula in block.formulas)


def explanations(study: Mapping[str, Any], titles: Mapping[str, str]) -> list[tuple[str, str]]:
    """The studies on the page that explain a study's answer, and what the answer calls them."""
    return [(name, words) for name, words in study["opening"].get("explained", {}).items() if name in titles]


def page(studies: Sequence[Mapping[str, Any]], opening: Sequence[str], provenance: Mapping[str, str]) -> str:
    """The whole report; ``opening`` comes first, provenance last."""
    facts = table(["what", "which"], [[key, str(value)] for key, value in provenance.items()])
    body = [*opening, *(section(study) for study in studies), f"## Provenance\n\n{facts}"]
    return "\n\n".join(part for part in body if part) + "\n"
