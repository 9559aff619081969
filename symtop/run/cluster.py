"""A dask cluster as a pool of workers. They need this version of symtop, and the plug-ins that are used."""

import asyncio
import contextlib
import gc
import logging
import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from symtop.core.errors import SymtopError, shown

PATIENCE = 10  # seconds to wait for a scheduler's answer, or for a worker when there is none
ABSENT = "scheduler needs the package distributed: pip install 'symtop[distributed]'"


def check_sent(address: object, work: object, name: str) -> None:
    """Refuse an address that is no text, and work of a method, `name`, that cannot be sent to other processes."""
    if not isinstance(address, str) or not address:
        must = "the address of a dask scheduler, such as 'tcp://host:8786'"
        raise SymtopError(f"scheduler must be {must}, not {shown(address)}", "scheduler")
    try:
        from distributed.protocol import pickle
    except ImportError:
        raise SymtopError(ABSENT) from None
    try:
        pickle.dumps(work)
    except Exception:  # noqa: BLE001  (what cannot be sent says so in many ways)
        remedy = "register it (symtop.register) in a plug-in file, or leave out the scheduler"
        raise SymtopError(f"{name} cannot be sent to other processes: {remedy}") from None


def connect(address: str) -> Any:
    """The client of a scheduler that answers and has workers; SymtopError if there is none."""
    try:
        import distributed
    except ImportError:
        raise SymtopError(ABSENT) from None
    for name in ("client", "batched"):  # what they log of a lost scheduler is told here
        logging.getLogger(f"distributed.{name}").setLevel(logging.CRITICAL)
    client, failure = None, ""
    try:
        with ThreadPoolExecutor(1) as apart:  # the caller's thread may run a loop of its own, as in a notebook
            apart.submit(asyncio.run, _query(address)).result()
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
        raise SymtopError(f"scheduler must be {must}, not {address!r} ({failure})", "scheduler")
    return client


async def _query(address: str) -> None:
    """Raise TimeoutError if a scheduler does not answer: a client waits for ever for one that takes the connection."""
    from distributed import rpc

    async with asyncio.timeout(PATIENCE), rpc(address) as scheduler:
        await scheduler.identity()


def leave(client: Any) -> None:
    """Close the connection, whatever state it is in, and do not wait for a scheduler that does not answer."""
    if client is not None:
        with contextlib.suppress(Exception):
            client.close(timeout=2.0)


def width(client: Any) -> int:
    """How many tasks to hand over at a time: enough that nobody waits, few enough to stop soon."""
    return 4 * max(1, int(sum(client.ncores().values())))
