"""``symtop integrators`` and ``symtop scenes``: lists that fit the terminal, and one entry in full."""

import json
import math
import re

import pytest

import symtop
from symtop.cli.common import table
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


def test_a_list_breaks_its_last_column_and_loses_no_word():
    words = " ".join(printed("integrators").split())
    assert "discrete Lagrangian, trapezoidal rule" in words
    lines = table(["a", "b"], [["1", "one two three four five six"]], 24).splitlines()
    assert lines == ["a  b", "-  ---------------------", "1  one two three four", "   five six"]


def test_the_flags_are_the_claims():
    lines = dict(line.split(" ", 1) for line in printed("integrators").splitlines() if " " in line)
    flags = {"midpoint": ["2", "ist"], "strang": ["2", "est"], "rk4": ["4", "e--"], "taylor": ["?", "e--"]}
    assert {name: lines[name].split()[:2] for name in flags} == flags


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("gauss-4", "axis_length, energy, p_phi, p_psi of a top in every one of its charts"),
        ("gauss-4[body]", "axis_length, energy, p_phi, p_psi of a top"),  # of a body p_phi is lost: `test_gauss`
        ("simo-wong", "axis_length, energy, p_phi in every one of its charts"),
        ("rk4", "nothing in every one of its charts"),
    ],
)
def test_what_a_method_that_steps_bodies_conserves_is_said_of_a_top(name, kept):
    assert re.search(rf"^conserves +{re.escape(kept)}$", printed("integrators", name, columns=120), re.MULTILINE)


def test_one_integrator_is_shown_in_full():
    page = printed("integrators", "midpoint")
    assert page.startswith("midpoint: discrete Lagrangian, midpoint rule\n")
    assert re.search(r"^conserves +p_phi, p_psi$", page, re.MULTILINE)
    assert re.search(r"^charts +angles$", page, re.MULTILINE)
    assert re.search(r"^charts +axis$", printed("integrators", "rk4[axis]"), re.MULTILINE)  # a variant has one
    assert re.search(r"^source +marsden-west-2001$", page, re.MULTILINE)
    assert "@article{marsden-west-2001," in page
    (record,) = json.loads(printed("integrators", "rk45", "--json"))
    assert float(record["least tolerance"]) > 1e-15
    assert record["source"] == symtop.integrator("rk45").reference


def test_one_scene_is_shown_in_full():
    page = printed("scenes", "spheroid")
    spheroid = symtop.scene("spheroid")
    assert page.startswith(f"spheroid: {spheroid.purpose}\n")
    assert "I1=2, I3=1, mgl=26.86579145" in page
    assert "theta_dot=0.1" in page
    (record,) = json.loads(printed("scenes", "spheroid", "--json"))
    assert record["top"]["mgl"] == spheroid.top.mgl
    assert math.degrees(record["theta"][1]) == pytest.approx(99.44, abs=0.01)
    assert all(max(map(len, printed("scenes", name).splitlines())) <= 80 for name in symtop.scenes())


def test_the_period_of_a_body_is_its_natural_one():
    body, top = printed("scenes", "heavy-brick"), printed("scenes", "spheroid")
    assert re.search(r"^natural period +2\.99213$", body, re.MULTILINE)
    assert "nutation period" not in body
    assert re.search(r"^nutation period +1\.18017 s$", top, re.MULTILINE)
