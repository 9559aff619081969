"""A page is written again when something it is made of has changed, and only then."""

import json
import os
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner
from symtop.report.unchanged import MARK, is_current, made_of

from symtop.cli.main import main
from symtop.report import page

STORED = Path(__file__).resolve().parents[2] / "results"  # what is tracked: the benchmark and its picture


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "figures").mkdir()
    findings = json.loads((STORED / "peers.json").read_text(encoding="utf-8"))
    for picture in findings["pictures"]:
        shutil.copy(STORED / "figures" / picture["file"], tmp_path / "figures")
    (tmp_path / "peers.json").write_text(json.dumps(findings), encoding="utf-8")
    page.write(tmp_path)
    return tmp_path


def call(folder, *words):
    done = CliRunner().invoke(main, ["report", "--results", str(folder), *words])
    assert done.exit_code == 0, done.output
    return done.output


def rewrite_findings(folder):
    file = folder / "peers.json"
    file.write_text(file.read_text(encoding="utf-8").replace("times", "TIMES", 1), encoding="utf-8")


def add_a_dataset(folder):
    (folder / "peers.nc").write_bytes(b"")


def touch_a_figure(folder):
    file = next((folder / "figures").iterdir())
    os.utime(file, ns=(1, 1))


def lose_the_words(folder):
    (folder / "report.md").unlink()


def spoil_the_page(folder):
    (folder / "report.html").write_bytes(b"\xff\xfe nothing")


def test_a_page_that_nothing_has_changed_is_left_alone(folder):
    before = (folder / "report.html").stat().st_mtime_ns
    assert "(up to date)" in call(folder)
    assert (folder / "report.html").stat().st_mtime_ns == before


CHANGES = [rewrite_findings, add_a_dataset, touch_a_figure, lose_the_words, spoil_the_page]


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.__name__)
def test_what_has_changed_is_on_the_page_afterwards(folder, change):
    change(folder)
    assert not is_current(folder, embed=False)
    assert "up to date" not in call(folder)
    assert is_current(folder, embed=False)
    if change is rewrite_findings:
        assert "TIMES" in (folder / "report.html").read_text(encoding="utf-8")


def test_another_kind_of_page_and_code_that_was_edited_are_told_apart(folder, tmp_path, monkeypatch):
    assert not is_current(folder, embed=True)
    (text,) = MARK.findall((folder / "report.html").read_text(encoding="utf-8"))
    assert text == made_of(folder, embed=False)
    assert text != made_of(folder, embed=False, plugins=["mine.py"])
    edited = tmp_path / "code"
    edited.mkdir()
    (edited / "page.py").write_text("1")
    monkeypatch.setattr("symtop.report.unchanged.PACKAGE", edited)
    assert made_of(folder, embed=False) != text
