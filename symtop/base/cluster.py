"""A dask cluster as a pool of workers. They need this version of symtop, and the plug-ins that are used."""

import contextlib
import gc
import warnings
from collections.abc import Iterator
from typing import Any

from symtop.base.validate import SymtopError

PATIENCE = 10  # seconds to wait for a scheduler's answer


def connect(address: str) -> Any:
    """The client of a scheduler that answers and has workers; SymtopError if there is none."""
    try:
        import distributed
    except ImportError:
        raise SymtopError("scheduler needs the package distributed: pip install 'symtop[distributed]'") from None
    client, failure = None, ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # other versions there; the digest of every case is compared anyway
            client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
            client.wait_for_workers(1, timeout=PATIENCE)
    except (OSError, ValueError, RuntimeError) as error:
        failure = " ".join((str(error) or type(error).__name__).split())[:120]
    if failure:  # out of the handler, so that nothing holds on to what was half made
        leave(client)
        client = None
        gc.collect()  # a client that never connected closes itself here, and not under a lock of the next one
        must = "the address of a dask scheduler that answers and has workers"
        raise SymtopError(f"scheduler must be {must}, not {address!r} ({failure})")
    return client


def leave(client: Any) -> None:
    """Close the connection, whatever state it is in."""
    if client is not None:
        with contextlib.suppress(Exception):
            client.close(timeout=PATIENCE)


@contextlib.contextmanager
def connected(address: str) -> Iterator[Any]:
    """A client while it is needed."""
    client = connect(address)
    try:
        yield client
    finally:
        leave(client)


def width(client: Any) -> int:
    """How many tasks to hand over at a time: enough that nobody waits, few enough to stop soon."""
    return 4 * max(1, int(sum(client.ncores().values())))
