"""What every template of a study must do: render whole and with nothing measured, and name only what is there."""

import re
from collections.abc import Collection
from pathlib import Path

import matplotlib.pyplot as plt

from symtop.report import template
from symtop.runner import run as runner

NAMED = re.compile(r"\b(?:figure|table)\(\"([\w-]+)\"|\(tables/\w+?-([\w-]+)\.csv\)")


def checked_page(name: str, data: object, folder: Path, elsewhere: Collection[str] = ()) -> str:
    """The page of a study with what a dataset shows and its template names; what is `elsewhere` is on the first."""
    study, page = runner.load(name), runner.file_beside(name, "page.md")
    assert page is not None
    close = lambda figure, _: plt.close(figure)
    findings = runner.findings_of(study, data, folder, close, failures=[], cases=1, page=page)
    names = {item["name"] for kind in ("pictures", "tables") for item in findings[kind]}
    absent = set(re.findall(r"has\(\"([\w-]+)\"\)", findings["page"])) - names
    assert {first or linked for first, linked in NAMED.findall(findings["page"])} - absent == names - {*elsewhere}, (
        "figures and tables of the template and of the study differ"
    )
    text = template.filled(findings, folder)
    empty = {**findings, "facts": dict.fromkeys(findings["facts"]), "pictures": [], "tables": []}
    for content in (text, template.filled(empty, folder)):
        assert not re.search(r"\b(None|nan|inf)\b", content), content
        assert "{{" not in content
    return text
