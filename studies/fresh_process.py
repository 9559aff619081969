"""Calls in a process of their own: what a study measures there meets no memory, code or plug-in of other cases."""

import json
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any

START = (
    "from symtop.runner import scripts; scripts.install(); from symtop_studies import fresh_process as it; it.answer()"
)


def call(function: Callable[..., Any], *arguments: Any) -> Any:
    """What a function of a study's module returns, as JSON has it; a case that names it depends on its code."""
    question = pickle.dumps((function, arguments))
    done = subprocess.run([sys.executable, "-c", START], input=question, stdout=subprocess.PIPE, check=True)  # noqa: S603
    return json.loads(done.stdout.splitlines()[-1])


def answer() -> None:
    """What the process does: function and arguments are pickled on standard input, the answer is its last line."""
    function, arguments = pickle.load(sys.stdin.buffer)  # noqa: S301  (of the process that started this one)
    print(json.dumps(function(*arguments)))  # noqa: T201
