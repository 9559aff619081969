"""Calls of functions in a new process, so that memory, code and plug-ins of other cases do not affect a measurement."""

import json
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any

START = (
    "from symtop.runner import scripts; scripts.install(); from symtop_studies import fresh_process as f; f.run_call()"
)


def call(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a study's function in a new process; returns its result as JSON has it. A case's hash includes its code."""
    question = pickle.dumps((function, arguments))
    process = subprocess.run([sys.executable, "-c", START], input=question, stdout=subprocess.PIPE, check=True)  # noqa: S603
    return json.loads(process.stdout.splitlines()[-1])


def run_call() -> None:
    """The new process: reads the pickled function and arguments on standard input, prints the result as last line."""
    function, arguments = pickle.load(sys.stdin.buffer)  # noqa: S301  (of the process that started this one)
    print(json.dumps(function(*arguments)))  # noqa: T201
