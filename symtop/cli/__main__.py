"""The command ``symtop``, also ``python -m symtop.cli``: run `main`, then end the process without Python's cleanup.

The cleanup of hundreds of megabytes of compiled kernels would take seconds. If other threads still run, the process
waits for them as usual. Linear algebra has one thread: `symtop.core.parallel` says why.
"""

import atexit
import os
import signal
import sys
import threading


def run(name: str | None = None) -> None:
    """Run the command line of this process, with `name` in its messages, and exit with its exit code."""
    if default_handler := signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # no traceback for Ctrl-C during imports
    from symtop.cli.main import main
    from symtop.core.parallel import VARIABLES
    from symtop.core.signals import BROKEN_PIPE

    if default_handler:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.update({name: "1" for name in VARIABLES if name not in os.environ})  # before NumPy reads them
    try:
        main(prog_name=name)
    except SystemExit as end:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # no traceback for a second Ctrl-C while threads end
        only_daemons = all(thread.daemon or thread is threading.main_thread() for thread in threading.enumerate())
        if not only_daemons or not (end.code is None or isinstance(end.code, int)):
            raise
        atexit._run_exitfuncs()
        code = end.code or 0
        for stream in filter(None, (sys.stdout, sys.stderr)):  # a closed stream is None
            try:
                stream.flush()
            except OSError as error:  # its reader has ended, or the disk is full
                code = code or (BROKEN_PIPE if isinstance(error, BrokenPipeError) else 1)
        os._exit(code)


if __name__ == "__main__":
    run()
