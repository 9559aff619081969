"""The README and the pages of docs/ say what the code says: their Python runs, their commands and links are there.

Blocks are Python, which is run; ``console``, whose commands are run and print what is shown; and ``sh``, of which many
would take minutes: they are read as the command line reads them, and targets of make are looked up.
"""

import importlib
import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from symtop.cli.main import main
from symtop.report.markdown import columns, table

registry = importlib.import_module("symtop.methods.registry")
scenes = importlib.import_module("symtop.model.scenes")

ROOT = Path(__file__).resolve().parents[2]
PAGES = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
         for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))}  # fmt: skip
TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
MOST_LINES, MOST_WORDS = 150, 1200  # of the README


def blocks(kind):
    """Page, place and text of every block of a kind."""
    found = []
    for page, text in PAGES.items():
        for place, block in enumerate(re.findall(rf"```{kind}\n(.*?)```", text, re.DOTALL)):
            found.append(pytest.param(block, id=f"{page}-{place}"))
    return found


def test_the_readme_is_read_in_a_few_minutes():
    text = PAGES["README.md"]
    assert text.count("\n") <= MOST_LINES
    assert len(text.split()) <= MOST_WORDS
    assert len(re.findall(r"^\| \w+ \|", text.partition("## Eight words")[2], re.MULTILINE)) == 1 + 8


def test_the_table_of_integrators_is_the_generated_one():
    shown = re.search(r"<!-- integrators -->\n(.*?)\n<!-- /integrators -->", PAGES["docs/integrators.md"], re.DOTALL)
    assert shown is not None
    records = [method.record() for method in registry.methods().values()]
    assert shown.group(1) == table(*columns(records)), "regenerate: symtop integrators --markdown"
    assert f"It runs {len(records)} integrators" in PAGES["README.md"]


def test_every_study_is_explained():
    for script in (ROOT / "studies").glob("*/study.py"):
        assert f"| `{script.parent.name}` |" in PAGES["docs/studies.md"]


@pytest.mark.parametrize("block", blocks("python"))
def test_python_runs(block, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(registry, "_registry", registry.integrators())  # what they add goes with the test
    monkeypatch.setattr(scenes, "_added", {})
    if "symtop.judge(" in block:  # a step is sent to its process by the file that it stands in
        (tmp_path / "page.py").write_text(block, encoding="utf-8")
        monkeypatch.syspath_prepend(tmp_path)
        importlib.import_module("page")
        return
    exec(compile(block, "page", "exec"), {})


@pytest.mark.parametrize("block", blocks("console"))
def test_a_command_prints_what_is_shown(block):
    command, *shown = block.splitlines()
    done = CliRunner().invoke(main, shlex.split(command.removeprefix("$ symtop ")))
    assert done.exit_code == 0
    assert " ".join(" ".join(shown).split()) in " ".join(done.output.split())


@pytest.mark.parametrize("block", blocks("sh"))
def test_a_command_is_one(block):
    """Negative control: an option that is not there is refused by the same reading."""
    for line in block.splitlines():
        program, *words = shlex.split(line, comments=True)
        if program == "symtop":
            name, command, rest = main.resolve_command(main.make_context("symtop", [], resilient_parsing=True), words)
            wanted = [word for word in rest if word != "--plugin" and not word.startswith("my_methods")]
            command.make_context(str(name), wanted, resilient_parsing=True)
            for option in (word for word in rest if word.startswith("--")):
                assert any(option in parameter.opts for parameter in command.params), (line, option)
        elif program == "make":
            assert words[0] in TARGETS
        else:
            assert (program, words) == ("pip", ["install", "."])
    assert not any("--no-such" in parameter.opts for parameter in main.commands["run"].params)


def test_the_first_run_prints_what_the_readme_shows():
    shown = re.search(r"```text\n(rk4 on spheroid.*?)```", PAGES["README.md"], re.DOTALL)
    done = CliRunner().invoke(main, ["run", "spheroid", "rk4", "--step-size", "0.01"])
    assert shown is not None
    assert done.stdout.startswith(shown.group(1))
    assert done.stderr == ""


def test_pictures_and_links_are_there():
    for page, text in PAGES.items():
        for link in re.findall(r"\]\(([^)#]+)\)", text):
            assert (ROOT / page).parent.joinpath(link).is_file(), (page, link)
    named = {Path(page).name for page in PAGES if page.startswith("docs/")}
    assert named == set(re.findall(r"\(docs/([\w-]+\.md)\)", PAGES["README.md"]))


def test_no_line_is_wider_than_the_code():
    for page, text in PAGES.items():
        wide = [line for line in text.splitlines() if len(line) > 130 and not line.startswith("|")]
        assert not wide, page
