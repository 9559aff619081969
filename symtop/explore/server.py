"""The explorer's server: a page with its files, and seven actions, for this machine only.

    GET  /  /style.css  /*.js           the page and its modules (HEAD: without the body; a query is ignored)
    GET  /catalogue                     scenes and integrators
    POST /run  /netcdf  /script         one run: as arrays, as a file, as a script
    POST /map  /cost                    a grid of runs; error against run time
    POST /oscillator  /damped-top       the damped oscillator; the damped top

It listens on 127.0.0.1. It answers only requests with this machine as their host, and POST requests only if they send
JSON and have no foreign origin, so that pages of other sites cannot use it.
"""

import contextlib
import json
import select
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from symtop.core import netcdf
from symtop.core.errors import SymtopError, whole, words_of
from symtop.core.parallel import cores
from symtop.explore import answers, cost

STATIC = Path(__file__).parent / "static"
CONTENT_TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}  # of static files
PATIENCE = 60.0  # seconds to wait for the rest of a request, or for the next one of a connection
MOST_WAITING = 256  # length of the system's queue of connections
MOST_OPEN, MANY_OPEN, HURRIED_PATIENCE = 256, 64, 2.0  # connections; with more than 64, wait only 2 s for a request
BUSY = b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 2\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
LONGEST_BODY = 65_536  # bytes of a POST request
POLICY = "default-src 'self'; img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"


def _netcdf(config: answers.Setup) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return netcdf.write(answers.dataset(config, str), Path(folder) / "explored.nc").read_bytes()


# by path: the function that parses the request, the one that answers it, and the type of the answer (JSON or bytes)
JSON = "application/json"
ACTIONS: dict[str, tuple[Callable[[Any], Any], Callable[[Any], Any], str]] = {
    "/run": (answers.setup, answers.answer, JSON),
    "/netcdf": (answers.setup, _netcdf, "application/x-netcdf"),
    "/script": (answers.setup, lambda config: answers.script(config).encode(), "text/x-python; charset=utf-8"),
    "/cost": (cost.question, cost.chart, JSON),
    "/oscillator": (answers.damped, lambda values: answers.oscillator(*values), JSON),
    "/damped-top": (answers.damped_top, lambda values: answers.inclination(*values), JSON),
    "/map": (answers.grid, lambda grid: answers.outcome_map(*grid), JSON),
}
_at_work = threading.BoundedSemaphore(cores())  # without it, 42 of 200 concurrent runs took over a minute


class Server(ThreadingHTTPServer):
    """A server with one thread per connection, at most `MOST_OPEN`; an error in one does not affect the others."""

    request_queue_size = MOST_WAITING
    daemon_threads = True
    report_time = 0.0  # when the last refusal was reported

    def process_request(self, request: Any, client_address: Any) -> None:
        """Start a thread for the connection, or refuse it (503) and report that, at most once a second."""
        if threading.active_count() <= MOST_OPEN:
            super().process_request(request, client_address)
            return
        if time.monotonic() - self.report_time > 1.0:
            self.report_time = time.monotonic()
            sys.stderr.write(f"symtop: {MOST_OPEN} connections are open, and others are refused (503)\n")
        with contextlib.suppress(OSError):
            request.settimeout(0.0)
            request.sendall(BUSY)
            request.recv(LONGEST_BODY)  # closing with unread bytes would discard the answer
        self.shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:  # noqa: ARG002
        """Report an error in one line, unless the browser has only closed the connection."""
        error = sys.exception()
        if error is not None and not isinstance(error, (ConnectionError, TimeoutError)):
            sys.stderr.write(f"symtop: a request failed: {words_of(error)}\n")


class Handler(BaseHTTPRequestHandler):
    """Answers one request."""

    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True

    @property
    def timeout(self) -> float:  # type: ignore[override]
        """Seconds to wait for bytes; if many connections are open, idle ones are closed soon."""
        return PATIENCE if threading.active_count() <= MANY_OPEN else HURRIED_PATIENCE

    def handle(self) -> None:
        """Answer the requests of one connection, until the browser closes it, even in the middle of one."""
        with contextlib.suppress(ConnectionError):
            super().handle()

    def do_GET(self) -> None:
        """Send the page, its files or the catalogue."""
        if not self._is_local():
            return
        file = {path.name: path for path in STATIC.iterdir()}.get(self.place.removeprefix("/") or "page.html")
        if file is not None and file.suffix in CONTENT_TYPES:
            self._reply(200, file.read_bytes(), f"{CONTENT_TYPES[file.suffix]}; charset=utf-8")
        elif self.place == "/catalogue":
            self._reply(200, json.dumps(answers.catalogue()).encode(), JSON)
        else:
            self._refuse(404, f"there is no {self.place} here")

    do_HEAD = do_GET  # `_reply` leaves the body out

    @property
    def place(self) -> str:
        """The path of the request, without its query."""
        return self.path.partition("#")[0].partition("?")[0]

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:  # noqa: ARG002
        """Answer a request that the standard library refuses (its method or a malformed line) in plain text."""
        self.close_connection = True
        if code == 501:
            code, message = 405, f"{self.command} is not answered here; GET, HEAD and POST are"
        sentence = message or self.responses[code][0] if code in self.responses else message or "refused"
        self._reply(int(code), f"{sentence}\n".encode(), "text/plain; charset=utf-8")

    def do_POST(self) -> None:
        """Answer one of the `ACTIONS`."""
        if not self._is_local():
            return
        if self.place not in ACTIONS:
            self._refuse(404, f"there is no {self.place} here")
            return
        if self.headers.get_content_type() != JSON:
            self._refuse(415, "a question must be JSON")
            return
        try:
            header = self.headers.get("Content-Length", "0")
            length = whole("the length of a question", int(header) if header.isdecimal() else header, 0)
            if length > LONGEST_BODY:
                self._refuse(413, f"a question must be at most {LONGEST_BODY} bytes, not {length}")
                return
            read, action, kind = ACTIONS[self.place]
            try:
                question = dict(json.loads(self.rfile.read(length)))
            except (TypeError, ValueError, RecursionError) as error:
                raise SymtopError(f"a question must be JSON, names and their values: {error}") from None
            config = read(question)
            with _at_work:
                if self._has_left():
                    self.close_connection = True
                    return
                answer = action(config)
        except SymtopError as error:
            # the page shows the message instead of a run, so it is a regular answer; instead of a file it is an error
            self._refuse(200 if self.place not in ("/netcdf", "/script") else 400, str(error))
        except Exception as error:  # noqa: BLE001  (the page shows it, and the server keeps running)
            self._refuse(500, f"the run failed: {type(error).__name__}: {' '.join(str(error).split())}")
        else:
            self._reply(200, json.dumps(answer).encode() if kind == JSON else answer, kind)

    def _has_left(self) -> bool:
        """Has the browser closed the connection while its request waited?"""
        try:
            readable, _, _ = select.select([self.connection], [], [], 0.0)
            return bool(readable) and not self.connection.recv(1, socket.MSG_PEEK)
        except (OSError, ValueError):
            return True

    def _is_local(self) -> bool:
        """Is this machine the host of a request, and a POST's origin? Refuse all else, also other names of it."""
        origin, site = self.headers.get("Origin"), self.headers.get("Sec-Fetch-Site", "none")
        foreign = origin not in (None, f"http://{self.headers.get('Host')}") or site not in ("none", "same-origin")
        if self.command == "POST" and foreign:
            self._refuse(403, "the explorer answers its own page only")
            return False
        host = self.headers.get("Host", "").rpartition(":")[0] or self.headers.get("Host", "")
        if host in ("127.0.0.1", "localhost"):
            return True
        self._refuse(403, "the explorer answers this machine only")
        return False

    def _refuse(self, status: int, sentence: str) -> None:
        self.close_connection = self.close_connection or status != 200  # the body may be unread
        self._reply(status, json.dumps({"error": sentence}).encode(), JSON)

    def _reply(self, status: int, body: bytes, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("X-Content-Type-Options", "nosniff")
        if status == 405:
            self.send_header("Allow", "GET, HEAD, POST")
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Do not log requests."""


def serve(port: int = 0) -> ThreadingHTTPServer:
    """A server on this machine, not yet running; port 0 selects a free one. SymtopError if the port is in use."""
    try:
        return Server(("127.0.0.1", port), Handler)
    except (OSError, OverflowError) as error:
        raise SymtopError(f"port must be a free one between 0 and 65535, not {port!r}: {error}", "port") from error


def address(server: ThreadingHTTPServer) -> str:
    """The address of the page."""
    return f"http://127.0.0.1:{server.server_address[1]}/"
