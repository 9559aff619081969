"""The example of each socket is judged as its first lines say."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from symtop.cli.main import main

EXAMPLES = Path(__file__).resolve().parents[2] / "studies" / "examples"
STEPS = EXAMPLES / "judged_steps.py"


def judged(*arguments):
    done = CliRunner().invoke(main, ["judge", *arguments, "--quick"])
    return done.exit_code, done.output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((f"{STEPS}:heun", "--order", "2"), "It is: order 2, not symplectic"),
        ((f"{STEPS}:Ralston", "--order", "3"), "It is: order 3, not symplectic"),
        (
            (f"{STEPS}:leapfrog", "--form", "separable", "--order", "2", "--symplectic", "--symmetric"),
            "It is: order 2, symplectic, reversible, the energy bounded",
        ),
        ((f"{STEPS}:engine", "--form", "rotation", "--order", "1"), "It is: order 1, not symplectic"),
        pytest.param(
            (f"{sys.executable} {EXAMPLES / 'judged_program.py'}", "--form", "program", "--order", "2"),
            "It is: order 2, not symplectic",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_the_example_of_a_socket_is_what_it_says(arguments, words):
    code, output = judged(*arguments)
    assert code == 0, output
    assert words in output


def test_an_example_that_claims_too_much_is_refuted():
    code, output = judged(f"{STEPS}:heun", "--order", "3")
    assert code == 1, output


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
def test_the_example_in_c_is_what_it_says(tmp_path):
    library = tmp_path / "judged.so"
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", str(EXAMPLES / "judged.c"), "-o", str(library), "-lm"], check=True)
    code, output = judged(str(library), "--order", "1", "--symplectic", "--conserves", "p_phi,p_psi")
    assert code == 0, output
    assert "It is: order 1, symplectic, not reversible" in output
