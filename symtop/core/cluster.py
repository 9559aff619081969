"""A dask cluster as a pool of workers. They need this version of symtop, and the plug-ins that are used."""

import asyncio
import contextlib
import gc
import logging
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from queue import SimpleQueue
from typing import Any

from symtop.core.errors import SymtopError, shown

PATIENCE = 10  # seconds to wait for a scheduler's answer, or for a worker when there is none
ABSENT = "scheduler needs the package distributed: pip install 'symtop[distributed]'"
LOOKS = 2.0  # seconds between two looks at a scheduler


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
        raise SymtopError(
            f"{name} cannot be sent to other processes: register it (symtop.register) in a plug-in file, or leave out "
            f"the scheduler"
        ) from None


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
            apart.submit(asyncio.run, _asked(address)).result()
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


async def _asked(address: str) -> None:
    """Raise TimeoutError if a scheduler does not answer: a client waits for ever for one that takes the connection."""
    from distributed import rpc

    async def ask() -> None:
        async with rpc(address) as scheduler:
            await scheduler.identity()

    await asyncio.wait_for(ask(), PATIENCE)


def leave(client: Any) -> None:
    """Close the connection, whatever state it is in, and do not wait for a scheduler that does not answer."""
    if client is not None:
        with contextlib.suppress(Exception):
            client.close(timeout=LOOKS)


class Watched(Executor):
    """A client's executor whose futures end when the cluster does.

    A client waits for ever for a scheduler that stands still, and for workers that are gone, in case others come. Here
    a thread asks the scheduler for its workers every `LOOKS` seconds; when it has had no answer for `PATIENCE` seconds,
    or there was no worker, every future that is waited for raises SymtopError, and so does whatever is submitted.
    """

    def __init__(self, client: Any) -> None:
        self._client, self._address = client, client.scheduler.address  # a client that closes has no scheduler
        self._waiting: dict[Future[Any], Any] = {}  # and the client's, which cancels what nobody holds
        self._lock, self._ended, self._gone = threading.Lock(), threading.Event(), ""
        self._done: SimpleQueue[tuple[Future[Any], Any] | None] = SimpleQueue()
        for work in (self._watch, self._hand_on):
            threading.Thread(target=work, daemon=True).start()

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        """A future of the cluster's."""
        if self._gone:
            raise SymtopError(self._gone)
        future: Future[Any] = Future()
        inner = self._client.submit(function, *args, pure=False, **kwargs)
        with self._lock:
            gone = self._gone  # it may have gone since, and nobody looks any more for what is waited for
            if not gone:
                self._waiting[future] = inner
        if gone:
            raise SymtopError(gone)
        inner.add_done_callback(lambda done: self._done.put((future, done)))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002
        """Look no more; the client is its owner's."""
        self._ended.set()
        self._done.put(None)

    def _hand_on(self) -> None:
        """How tasks end: as their functions do, or lost with the scheduler or on the way from it.

        A result that is on its way from a scheduler that has gone is waited for without end, and not by a thread of the
        client's: those are waited for when the process exits.
        """
        while (entry := self._done.get()) is not None:
            future, done = entry
            result, error = None, None
            try:
                result = done.result()
            except Exception as raised:  # noqa: BLE001  (a future hands on what its function raised)
                error = raised if done.status == "error" else SymtopError(self._told("has gone away"))
            self._settle(future, result, error)

    def _settle(self, future: "Future[Any]", result: Any, error: Exception | None) -> None:
        """End a future, if nobody has before."""
        with self._lock:
            if self._waiting.pop(future, None) is None:
                return
        if error is None:
            future.set_result(result)
        else:
            future.set_exception(error)

    def _told(self, what: str) -> str:
        return f"the cluster at {self._address} {what}; what was computed is kept"

    def _watch(self) -> None:
        last, what = time.monotonic(), ""
        while not self._ended.wait(LOOKS):
            try:
                workers = self._client.sync(self._client.scheduler.ncores, callback_timeout=LOOKS)
                what = "" if workers else "has no workers any more"
            except Exception:  # noqa: BLE001  (a connection ends in many ways)
                what = "does not answer any more"
            if not what:
                last = time.monotonic()
            elif time.monotonic() - last > PATIENCE:
                with self._lock:
                    self._gone = self._told(what)
                    waiting = list(self._waiting)
                for future in waiting:
                    self._settle(future, None, SymtopError(self._gone))
                return


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
