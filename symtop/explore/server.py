"""The explorer's server: a page, three of its files, and three questions, for this machine only.

    GET  /  /explore.js  /draw.js  /style.css     the page
    GET  /catalogue                               scenes and integrators
    POST /run  /netcdf  /script                   one run: as arrays, as a file, as a script

It listens on 127.0.0.1 and answers only requests that name this machine as their host and send JSON, so that no page of
another origin can use it. Runs take turns: mpmath's precision is one for all threads.
"""

import contextlib
import json
import tempfile
import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from symtop.base import datasets
from symtop.base.validate import SymtopError, whole
from symtop.explore import answers

STATIC = Path(__file__).parent / "static"
PAGES = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/explore.js": ("explore.js", "text/javascript; charset=utf-8"),
    "/draw.js": ("draw.js", "text/javascript; charset=utf-8"),
    "/style.css": ("style.css", "text/css; charset=utf-8"),
}
LONGEST = 65_536  # bytes of a question
POLICY = "default-src 'self'; img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"

_turn = threading.Lock()


def _run(asked: answers.Question) -> tuple[bytes, str]:
    return json.dumps(answers.answer(asked)).encode(), "application/json"


def _netcdf(asked: answers.Question) -> tuple[bytes, str]:
    with tempfile.TemporaryDirectory() as folder:
        path = datasets.write(answers.dataset(asked, str), Path(folder) / "explored.nc")
        return path.read_bytes(), "application/x-netcdf"


def _script(asked: answers.Question) -> tuple[bytes, str]:
    return answers.script(asked).encode(), "text/x-python; charset=utf-8"


QUESTIONS: dict[str, Callable[[answers.Question], tuple[bytes, str]]] = {
    "/run": _run,
    "/netcdf": _netcdf,
    "/script": _script,
}


class Handler(BaseHTTPRequestHandler):
    """Answers one request."""

    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True

    def handle(self) -> None:
        """Answer the requests of one connection, until the browser closes it, even in the middle of one."""
        with contextlib.suppress(ConnectionError):
            super().handle()

    def do_GET(self) -> None:
        """The page, its files and the catalogue."""
        if not self._ours():
            return
        if self.path in PAGES:
            name, kind = PAGES[self.path]
            self._reply(200, (STATIC / name).read_bytes(), kind)
        elif self.path == "/catalogue":
            self._reply(200, json.dumps(answers.catalogue()).encode(), "application/json")
        else:
            self._refuse(404, f"there is no {self.path} here")

    def do_POST(self) -> None:
        """One of the questions."""
        if not self._ours():
            return
        if self.path not in QUESTIONS:
            self._refuse(404, f"there is no {self.path} here")
            return
        if self.headers.get_content_type() != "application/json":
            self._refuse(415, "a question must be JSON")
            return
        try:
            given = self.headers.get("Content-Length", "0")
            length = whole("the length of a question", int(given) if given.isdecimal() else given, 0)
            if length > LONGEST:
                self._refuse(413, f"a question must be at most {LONGEST} bytes, not {length}")
                return
            asked = answers.question(_parsed(self.rfile.read(length)))
            with _turn:
                body, kind = QUESTIONS[self.path](asked)
        except SymtopError as error:
            # a sentence is an ordinary answer to a slider that went too far; a file cannot be given instead
            self._refuse(200 if self.path == "/run" else 400, str(error))
        except Exception as error:  # noqa: BLE001  (a page must hear of it, and the server must go on)
            self._refuse(500, f"the run failed: {type(error).__name__}: {' '.join(str(error).split())}")
        else:
            self._reply(200, body, kind)

    def _ours(self) -> bool:
        """Does the request name this machine? A page of another name that resolves to it must not get in."""
        host = self.headers.get("Host", "").rpartition(":")[0] or self.headers.get("Host", "")
        if host in ("127.0.0.1", "localhost"):
            return True
        self._refuse(403, "the explorer answers this machine only")
        return False

    def _refuse(self, status: int, sentence: str) -> None:
        self.close_connection = self.close_connection or status != 200  # what was sent may not have been read
        self._reply(status, json.dumps({"error": sentence}).encode(), "application/json")

    def _reply(self, status: int, body: bytes, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("X-Content-Type-Options", "nosniff")
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing for each request."""


def _parsed(body: bytes) -> Any:
    try:
        return json.loads(body)
    except (ValueError, RecursionError) as error:
        raise SymtopError(f"a question must be JSON: {error}") from None


def serve(port: int = 0) -> ThreadingHTTPServer:
    """A server on this machine, not yet running; port 0 takes a free one. SymtopError if the port is taken."""
    try:
        server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
    except (OSError, OverflowError) as error:
        raise SymtopError(f"port must be a free one between 0 and 65535, not {port!r}: {error}") from error
    server.daemon_threads = True
    return server


def address(server: ThreadingHTTPServer) -> str:
    """Where the page is."""
    return f"http://127.0.0.1:{server.server_address[1]}/"
