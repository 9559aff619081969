"""The notebooks run from top to bottom, are small, and hold the outputs that a page shows."""

import contextlib
import io
import json
import re
from pathlib import Path

import pytest

BOOKS = sorted((Path(__file__).resolve().parents[2] / "docs" / "notebooks").glob("*.ipynb"))
LARGEST = 200_000  # characters


@pytest.mark.quick
@pytest.mark.parametrize("book", BOOKS, ids=lambda book: book.stem)
def test_a_notebook_runs_and_prints_what_it_shows(book, tmp_path, monkeypatch):
    """Text that is shown is printed again, to the letter; pictures are drawn and are not compared."""
    monkeypatch.chdir(tmp_path)
    text = book.read_text(encoding="utf-8")
    assert len(text) < LARGEST
    assert not re.search("/home/|/tmp/", text)  # no place of a machine
    pages = json.loads(text)
    assert pages["nbformat"] == 4
    names: dict = {}
    cells = [cell for cell in pages["cells"] if cell["cell_type"] == "code"]
    assert any("image/png" in output.get("data", {}) for cell in cells for output in cell["outputs"])
    for cell in cells:
        stdout = io.StringIO()
        with contextlib.redirect_stdout(stdout):
            exec(compile("".join(cell["source"]), book.name, "exec"), names)
        expected = "".join("".join(part["text"]) for part in cell["outputs"] if part["output_type"] == "stream")
        assert stdout.getvalue() == expected
