"""``symtop judge``: from a file with a step to a screen, in one command."""

import json
import re

import pytest
import xarray as xr
from click.testing import CliRunner

from symtop.cli.main import main

HEUN = """
def step(f, t, y, h):
    k = f(t, y)
    return y + h / 2 * (k + f(t + h, y + h * k))
"""


@pytest.fixture
def mine(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(HEUN)
    return str(file)


def judge(*arguments):
    done = CliRunner().invoke(main, ["judge", *arguments], catch_exceptions=False)
    return done.exit_code, done.output


def test_a_file_with_a_step_says_what_it_is(mine, tmp_path, only):
    only("order", "symplectic", "symmetric", "energy", "p_phi")
    code, output = judge(mine, "--quick", "--output", str(tmp_path / "found.nc"))
    assert code == 0
    assert re.search(r"^mine in the axis chart on spheroid, \S+ us a step, seed \d+$", output, re.MULTILINE)
    assert re.search(r"^order +2\.00", output, re.MULTILINE)
    assert "It is: order 2, not symplectic, not reversible, keeps p_phi; not the energy" in output
    with xr.open_dataset(tmp_path / "found.nc") as data:
        assert str(data.sel(claim="order")["verdict"].values) == "measured"


def test_a_false_claim_gives_code_1_and_says_why(mine, only):
    only("order", "symplectic")
    code, output = judge(f"{mine}:step", "--order", "3", "--not-symplectic", "--quick", "--json")
    rows = {row["claim"]: row for row in json.loads(output)}
    assert code == 1
    assert (rows["order"]["verdict"], rows["symplectic"]["verdict"]) == ("refuted", "confirmed")
    assert "the h^3 term of a step is off by" in rows["order"]["why"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("MINE:leap",), "mine.py must have a function 'leap'; it has step"),
        (("MINE", "--conserves", "spin"), "'spin' is unknown"),
        (("MINE", "--card", "x.txt"), "--card must be a file that ends in .html or .htm, not 'x.txt'"),
        (("MINE", "--badge", "x.png"), "--badge must be a file that ends in .svg, not 'x.png'"),
    ],
)
def test_bad_input_to_the_command(mine, arguments, words):
    code, output = judge(*(argument.replace("MINE", mine) for argument in arguments))
    assert code == 2
    assert output.startswith("symtop: ")
    assert words in output


def test_a_target_may_be_at_home(mine, tmp_path, monkeypatch, only):
    only("order", "energy")
    monkeypatch.setenv("HOME", str(tmp_path))
    code, output = judge("~/mine.py", "--quick", "--card=~/card.html", "--badge", "~/badge.svg")
    assert code == 0, output
    assert {"card.html", "badge.svg"} <= {file.name for file in tmp_path.iterdir()}
