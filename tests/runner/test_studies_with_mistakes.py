"""A mistake in a study of one's own is told in one sentence that names the study and its function; cases are kept."""

import sys

import pytest
import xarray as xr

from symtop.runner.study import StudyError, each
from tests.commands import call

SCRIPT = """\
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
import symtop
import pandas as pd
from symtop import Case, Picture, Study

def cases(quick):
    return [Case("spheroid", name, {{"step_size": 0.1}}) for name in ("rk4", "strang")]

def measure(case):
    return xr.Dataset({{"err": 1.0}})

def pictures(data):
    figure = Figure()
    figure.subplots()
    yield Picture("one", figure)

def facts(data):
    return {{"worst": np.float64(0.25), "best": None}}

def tables(data):
    return {{"one": pd.DataFrame({{"a": [1.5]}})}}

more = {{}}
{change}
STUDY = Study(name="mine", title="t", question="q?", cases=cases, measure=measure, pictures=pictures, facts=facts,
              tables=tables, **more)
"""


def run_study(folder, change, *words, code=0):
    """What a study says that is right but for a change; it must end with that exit code."""
    script = folder / "mine.py"
    script.write_text(SCRIPT.format(change=change))
    sys.modules.pop("symtop_study_mine", None)  # of an earlier text
    return call("study", script, "--jobs", 1, "--results", folder / "results", *words, code=code).output


def assert_refused(folder, change, message, *words):
    """Code 2 and one sentence, which names the study."""
    output = run_study(folder, change, *words, code=2)
    assert output.startswith("symtop: study mine: ")
    assert output.count("\n") == 1
    assert message in output


@pytest.mark.parametrize("limit", ["1e8", "1e300"])  # as long as one likes
def test_the_study_itself_is_right_and_none_that_ships_is_replaced(tmp_path, monkeypatch, limit):
    output = run_study(tmp_path, "", "--limit", limit)
    assert "2 of 2 cases computed, 1 figure" in output
    assert "  worst: 0.25\n" in output
    monkeypatch.setattr(sys.modules[__name__], "SCRIPT", SCRIPT.replace('name="mine"', 'name="convergence"'))
    (tmp_path / "other").mkdir()
    output = run_study(tmp_path / "other", "", code=2)
    assert output == "symtop: study mine.py must have a name that is not taken, not 'convergence'\n"
    assert not (tmp_path / "other" / "results").exists()


@pytest.mark.parametrize(("change", "message"), [
    ("cases = lambda quick: None", "cases must return a list of Case, not None"),
    ("cases = lambda quick: 1 / 0", "cases failed: ZeroDivisionError"),
    ("cases = lambda quick: [Case('spheroid', 'rk4', {'a': np.arange(3.0)})]", "setting 'a' must be numbers"),
    ("more = {'uses': lambda case: 1 / 0}", "uses failed: ZeroDivisionError"),
])  # fmt: skip
def test_a_grid_that_is_none_is_refused(tmp_path, change, message):
    for words in [(), ("--status",), ("--only", "rk4")][: 3 if "uses" in change else 1]:  # by whichever command
        assert_refused(tmp_path, change, message, *words)


@pytest.mark.parametrize(("change", "message"), [
    ("facts = lambda data: None", "facts must return numbers by name, not None"),
    ("facts = lambda data: {'a b': 1}", "a fact's name must be a word of letters, digits and _, not 'a b'"),
    ("facts = lambda data: [symtop.simulate('spheroid', 'rk4', step_size=np.nan).title]",
     "facts failed: step_size must be a finite number"),
    ("pictures = lambda data: iter([Figure()])", "pictures must return or yield Pictures; an entry is a Figure"),
    ("pictures = lambda data: [Picture('a', Figure()), Picture('b', Figure()), Picture('a', Figure())]",
     "pictures must have a name each, and two are called a"),
    ("pictures = lambda data: (1 / 0 for _ in 'x')", "pictures failed: ZeroDivisionError"),
    ("tables = lambda data: pd.DataFrame()", "tables must return tables by name, not"),
    ("tables = lambda data: {'../a': pd.DataFrame()}", "name of a table must be"),
    ("more = {'charts': lambda data: None}", "charts must return a list of Chart, not None"),
])  # fmt: skip
def test_an_answer_of_the_wrong_kind_is_refused_and_the_cases_are_kept(tmp_path, change, message):
    assert_refused(tmp_path, change, message)
    assert len(list(tmp_path.rglob("cases/mine/*.npz"))) == 2


def test_an_answer_may_come_in_any_order_of_things():
    names = lambda make: list(each("mine", "names", make, str, "a list of names"))
    assert (names(lambda: ("a", "b")), names(lambda: iter(["a"]))) == (["a", "b"], ["a"])
    assert names(list) == []
    for value in ("a", b"a", {"a": 1}, 3, [None]):
        with pytest.raises(StudyError, match="study mine: names must return a list of names"):
            names(lambda value=value: value)


def test_a_page_that_is_wrong_is_told_of(tmp_path):
    for page, message in (
        ("{{ f.wrost | number }}", "page of mine, line 1: there is no fact 'wrost'"),
        ("# Q\n{{ f.worst | numbr }}", "page of mine, line 2: No filter named 'numbr'"),
        ("{% if f.worst %}", "page of mine, line 1: Unexpected end of template"),
        ("# Q\n{{ table('one', columns=['b']) }}", "page of mine, line 2: \"None of [Index(['b']"),
        ("# Q\n{{ 1 / (f.worst - 0.25) }}", "page of mine, line 2: float division by zero"),
    ):
        (tmp_path / "mine.md").write_text(page)
        assert message in run_study(tmp_path, "pictures = lambda data: []", code=2)
    (tmp_path / "mine.md").write_text("# {{ question }}\n\nThe worst is {{ f.worst | number }}.\n\n{{ table('one') }}")
    output = run_study(tmp_path, "")
    assert "0 of 2 cases computed" in output
    assert "  The worst is 0.25.\n" in output
    assert (tmp_path / "results" / "tables" / "mine-one.csv").read_text() == "a\n1.5\n"


@pytest.mark.parametrize("name", ["sizes", "SIZES"])
def test_an_edited_list_of_a_study_of_ones_own_is_computed_again(name, tmp_path):
    """Whatever its name: lower-case ones may change while a study runs, which makes nothing stale."""
    for size, computed in ((1.0, 2), (1.0, 0), (2.0, 2)):
        text = f"{name} = [{size}]\nmemo = {{}}\n"
        text += f"measure = lambda case: xr.Dataset({{'err': memo.setdefault(1, {name}[0])}})"
        assert f"{computed} of 2 cases computed" in run_study(tmp_path, text)
        assert float(xr.load_dataset(tmp_path / "results" / "mine.nc")["err"].max()) == size


def test_a_step_that_is_nan_is_no_option_and_a_limit_holds_for_checked_cases_too(tmp_path, monkeypatch):
    change = "measure = lambda case: symtop.simulate(case.scene, case.integrator, step_size=float('nan'))"
    output = run_study(tmp_path, change, code=2)
    assert "study mine: no case could be measured; rk4 on spheroid failed: step_size must be a finite" in output
    change = "def measure(case):\n    assert case.integrator != 'rk4', 'so'\n    return xr.Dataset({'err': 1.0})"
    combining = "\ncases = lambda quick: [Case('spheroid', n, {'h': h}) for n in ('rk4', 'strang') for h in (1, 2)]"
    first, second, sentence = run_study(tmp_path, change + combining, code=2).splitlines()  # which may be why
    assert first == second == "  rk4 on spheroid failed: AssertionError: so"
    assert "two cases of strang on spheroid measure err" in sentence
    script = "import os, time\ndef measure(case):\n    time.sleep(float(os.environ.get('LATE', '0')))\n"
    script += "    return xr.Dataset({'err': 1.0})"
    run_study(tmp_path, script)
    assert "2 of 2 cases computed again, the same" in run_study(tmp_path, script, "--check", "--limit", 30)
    monkeypatch.setenv("LATE", "3")
    assert run_study(tmp_path, script, "--check", "--limit", 0.2, code=1).count("it was not done after 0.2 s") == 2
