"""``symtop integrators`` and ``symtop scenes``: lists that fit the terminal, and one entry in full."""

import re

import pytest

import symtop
from symtop.methods.framework.registry import engines, methods
from tests.commands import call


def printed(*words, columns=80):
    return call(*words, COLUMNS=str(columns)).output


@pytest.mark.parametrize(
    ("command", "entries"),
    [(["integrators"], methods), (["integrators", "--engines"], engines), (["scenes"], symtop.scenes)],
)
def test_a_list_fits_the_terminal_and_names_every_entry(command, entries):
    for columns in (80, 120):
        lines = printed(*command, columns=columns).splitlines()
        assert max(map(len, lines)) <= columns
        names = {line.split(" ")[0] for line in lines}
        assert names >= set(entries())
        assert ("mujoco-euler" in names, "strang" in names) == (entries is engines, entries is methods)
    assert max(map(len, printed(*command, "--wide").splitlines())) > 80


def test_the_period_of_a_body_is_its_natural_one():
    body, top = printed("scenes", "heavy-brick"), printed("scenes", "spheroid")
    assert re.search(r"^natural period +2\.99213$", body, re.MULTILINE)
    assert "nutation period" not in body
    assert re.search(r"^nutation period +1\.18017 s$", top, re.MULTILINE)
