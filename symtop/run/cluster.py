"""A dask cluster as a pool of workers. They need this version of symtop, and the plug-ins that are used."""

import asyncio
import contextlib
import gc
import logging
import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from symtop.core.errors import SymtopError, shown

PATIENCE = 10  # seconds to wait for a scheduler's answer, or for its first worker
NO_DISTRIBUTED = "scheduler needs the package distributed: pip install 'symtop[distributed]'"


def check_sent(address: object, work: object, name: str) -> None:
    """SymtopError for an address that is no text, and for `work` of the method `name` that cannot be pickled."""
    if not isinstance(address, str) or not address:
        rule = "the address of a dask scheduler, such as 'tcp://host:8786'"
        raise SymtopError(f"scheduler must be {rule}, not {shown(address)}", "scheduler")
    try:
        from distributed.protocol import pickle
    except ImportError:
        raise SymtopError(NO_DISTRIBUTED) from None
    try:
        pickle.dumps(work)
    except Exception:  # noqa: BLE001  (what cannot be sent says so in many ways)
        remedy = "register it (symtop.register) in a plug-in file, or leave out the scheduler"
        raise SymtopError(f"{name} cannot be sent to other processes: {remedy}") from None


def connect(address: str) -> Any:
    """A dask client of the scheduler at `address`; SymtopError if it does not answer or has no workers."""
    try:
        import distributed
    except ImportError:
        raise SymtopError(NO_DISTRIBUTED) from None
    for name in ("client", "batched"):  # a lost scheduler is reported here, not in their logs
        logging.getLogger(f"distributed.{name}").setLevel(logging.CRITICAL)
    client, failure = None, ""
    try:
        with ThreadPoolExecutor(1) as executor:  # the caller's thread may run an event loop, as in a notebook
            executor.submit(asyncio.run, _query(address)).result()
        with warnings.catch_warnings(action="ignore"):  # on other versions; every case's hash is compared anyway
            client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
            client.wait_for_workers(1, timeout=PATIENCE)
    except (OSError, ValueError, RuntimeError) as error:
        failure = " ".join((str(error) or type(error).__name__).split())[:120]
    if failure:  # outside the handler, whose exception would keep a reference to the unfinished client
        leave(client)
        client = None
        gc.collect()  # a client that never connected closes itself here, and not under a lock of the next one
        rule = "the address of a dask scheduler that answers and has workers"
        raise SymtopError(f"scheduler must be {rule}, not {address!r} ({failure})", "scheduler")
    return client


async def _query(address: str) -> None:
    """TimeoutError if a scheduler accepts the connection but does not answer: a client would wait for ever."""
    from distributed import rpc

    async with asyncio.timeout(PATIENCE), rpc(address) as scheduler:
        await scheduler.identity()


def leave(client: Any) -> None:
    """Close a client in any state, or None, without waiting for a scheduler that does not answer."""
    if client is not None:
        with contextlib.suppress(Exception):
            client.close(timeout=2.0)


def width(client: Any) -> int:
    """How many tasks to submit at a time: enough to keep all workers busy, few enough to stop soon."""
    return 4 * max(1, int(sum(client.ncores().values())))
