"""The command line: ``symtop integrators | scenes | run | compare | ensemble | study | judge | report | ...``.

A command imports heavy packages inside its function, so that ``symtop --help`` takes a tenth of a second.
"""

import sys

import click

from symtop.cli import compare, doctor, judge, lists, runs, study
from symtop.cli.common import Group, warn
from symtop.core import __version__, progress


@click.group(cls=Group, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="symtop")
def main() -> None:
    """Integrators compared on the heavy symmetric top.

    \b
    symtop run spheroid midpoint --step-size 0.01
    symtop recommend spheroid --accuracy 1e-6
    symtop study convergence --quick

    Exit codes: 1 a case or claim failed, 2 bad input, 3 a run ended early, 130 interrupted, 141 output unread,
    143 terminated.

    Names complete in bash after: eval "$(_SYMTOP_COMPLETE=bash_source symtop)"
    """

    def announce() -> None:  # called once, before the first kernel is compiled
        progress.on_cold.clear()
        (warn if progress.is_terminal(sys.stderr) else progress.post)(progress.compiling())

    progress.on_cold[:] = [announce]


for command in (
    runs.run, judge.recommend, compare.compare, judge.judge, runs.ensemble, runs.long, runs.explore, lists.scenes,
    lists.integrators, judge.claims, study.study, study.report, study.archive, lists.cite, doctor.doctor,
):  # fmt: skip
    main.add_command(command)
