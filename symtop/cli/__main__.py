"""The command ``symtop``, also ``python -m symtop.cli``: `main`, and then the end of the process at once.

Python would first take apart what was compiled: up to 3 s for 600 megabytes of kernels, in which the answer stands on
the terminal and the prompt does not come back. Where other threads still work, they are waited for as usual.
"""

import atexit
import os
import sys
import threading

from symtop.cli.main import main


def run() -> None:
    """Run the command line of this process, and end it with its exit code."""
    try:
        main()
    except SystemExit as end:
        alone = all(thread.daemon or thread is threading.main_thread() for thread in threading.enumerate())
        if not alone or not (end.code is None or isinstance(end.code, int)):
            raise
        atexit._run_exitfuncs()
        sys.stdout.flush()  # a reader that is gone is an error as usual
        sys.stderr.flush()
        os._exit(end.code or 0)


if __name__ == "__main__":
    run()
