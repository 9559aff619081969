"""Every block of code in the README and on the site does what it says (`tests.pages` has the languages)."""

import contextlib
import importlib
import io
import re
import shlex
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from symtop import __version__
from symtop.cli.main import main
from symtop.run.ensemble.population import population
from tests.commands import call, stdout_of, symtop
from tests.judging.conftest import shorten
from tests.pages import LANGUAGES, ROOT, Block, blocks, pages

pytestmark = pytest.mark.usefixtures("clean_registry")  # what a page adds goes with its test
TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
PAGES = {path.relative_to(ROOT).as_posix(): blocks(path.read_text(encoding="utf-8")) for path in pages()}
OTHERS = {"pip": {"install"}, "dask": {"scheduler", "worker"}}  # programs of bash blocks that are not ours


def words(text):
    return " ".join(text.split())


class Page:
    """A page as a reader follows it: one folder, one Python, block after block."""

    def __init__(self, name, *, slow):
        self.slow = slow
        self.name = re.sub(r"\W", "_", f"{name}_{slow}")
        self.names = {}
        self.output = None  # by the last block that was run

    def follow(self, block):
        """Do what the language of a block asks for."""
        if block.file:
            Path(block.file).write_text(block.code, encoding="utf-8")
        elif block.language == "text":
            assert self.output is None or words(block.code) in words(self.output)
        elif block.slow and not self.slow:
            self.output = None
        elif block.language == "python":
            self.output = self.python(block.code)
        elif block.language == "sh":
            self.output = "".join(self.command(line, apart=block.slow) for line in block.code.splitlines())
        elif block.language == "console":
            line, _, expected = block.code.partition("\n")
            self.output = self.command(line.removeprefix("$ "))
            assert words(expected) in words(self.output)

    def python(self, code):
        """What a block prints. A function that `judge` is given is sent to its process by the file it stands in."""
        output = io.StringIO()
        with contextlib.redirect_stdout(output):
            if re.search(r"symtop\.judge\([a-z]", code):
                Path(f"{self.name}.py").write_text(code, encoding="utf-8")
                importlib.import_module(self.name)
            else:
                exec(compile(code, self.name, "exec"), self.names)
        plt.close("all")
        return output.getvalue()

    def command(self, line, *, apart=False):
        """What a command prints; it must end with exit code 0. Those of slow blocks are processes of their own."""
        program, *args = shlex.split(line, comments=True)
        if program == "python":
            result = subprocess.run([sys.executable, *args], capture_output=True, text=True, timeout=240, check=True)
            return result.stdout
        assert program == "symtop"
        if apart:
            return stdout_of(symtop(*args), seconds=900.0)
        return call(*args).output


def follow(page, slow, folder, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    if not slow:
        shorten(monkeypatch)
        monkeypatch.setattr("symtop.population", lambda n, **options: population(min(n, 100), **options))
    reader = Page(page, slow=slow)
    for block in PAGES[page]:
        reader.follow(block)


@pytest.mark.parametrize(("page", "slow"), [
    *(pytest.param(page, False, marks=[pytest.mark.quick][page == "README.md" :]) for page in PAGES if PAGES[page]),
    *(pytest.param(page, True, marks=pytest.mark.slow) for page in PAGES if any(block.slow for block in PAGES[page])),
])  # fmt: skip
def test_a_page_runs(page, slow, tmp_path, monkeypatch):
    follow(page, slow, tmp_path, monkeypatch)


def test_a_page_that_is_wrong_fails(tmp_path, monkeypatch):
    """Negative control: a wrong output, a wrong command and a raise are seen, and each is right when mended."""
    pages = {
        "```python\nprint(1 + 1)\n```\n```text\n3\n```\n": ("3\n", "2\n"),
        "```sh\nsymtop scenes sphreoid\n```\n": ("sphreoid", "spheroid"),
        "```console\n$ symtop --version\nsymtop, version 0.0\n```\n": ("0.0", __version__),
        "```python\nimport symtop\nsymtop.scene('no such')\n```\n": ("no such", "spheroid"),
        "```python\n# a.py\nx = 1\n```\n```sh\npython b.py\n```\n": ("b.py", "a.py"),
    }
    for text, (before, after) in pages.items():
        monkeypatch.setitem(PAGES, "page", blocks(text.replace(before, after)))
        follow("page", False, tmp_path, monkeypatch)
        monkeypatch.setitem(PAGES, "page", blocks(text))
        with pytest.raises((AssertionError, ValueError, subprocess.CalledProcessError)):
            follow("page", False, tmp_path, monkeypatch)


@pytest.mark.parametrize("page", PAGES)
def test_every_block_has_a_language_that_says_what_to_do_with_it(page):
    assert {block.language for block in PAGES[page]} <= LANGUAGES
    for index, block in enumerate(PAGES[page]):
        if block.file:  # is run by a later block that names it
            codes = [entry.code for entry in PAGES[page][index + 1 :] if entry.language in {"sh", "python"}]
            assert any(block.file in code for code in codes)


@pytest.mark.parametrize("block", [block for blocks in PAGES.values() for block in blocks if block.language == "bash"])
def test_a_command_that_is_not_run_is_one(block: Block):
    """Negative control: an option that is not there is refused by the same reading."""
    for line in block.code.splitlines():
        program, *args = shlex.split(line, comments=True)
        if program == "symtop":
            name, command, args = main.resolve_command(main.make_context("symtop", [], resilient_parsing=True), args)
            known_args = [word for word in args if word != "--plugin" and not word.startswith("my_methods")]
            command.make_context(str(name), known_args, resilient_parsing=True)
            for option in (word for word in args if word.startswith("--")):
                assert any(option in parameter.opts for parameter in command.params), (line, option)
        elif program == "make":
            assert args[0] in TARGETS
        else:
            assert args[0] in OTHERS[program]
    assert not any("--no-such" in parameter.opts for parameter in main.commands["run"].params)


def absent(text):
    """Files of the project that a page names, `folder/file.py`, and that are not there."""
    named = re.findall(r"`([a-z_]+(?:/[a-z_]+)*/[a-z_]+\.py)`", text)
    return [file for file in named if not any((root / file).is_file() for root in (ROOT, ROOT / "symtop"))]


def test_the_files_that_pages_name_are_there():
    assert absent("`methods/framework/loop.py`, `methods/no.py` and `studies/drift/study.py`") == ["methods/no.py"]
    texts = {page.name: page.read_text(encoding="utf-8") for page in {*pages(), ROOT / "docs" / "design.md"}}
    assert len(re.findall(r"`[\w/]+/\w+\.py`", texts["design.md"])) > 5
    assert [(page, absent(text)) for page, text in texts.items() if absent(text)] == []
