"""``symtop integrators`` and ``symtop scenes``: lists that fit the terminal."""

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
