"""An explorer that answers this process."""

import threading

import pytest

from symtop.explore.server import serve


@pytest.fixture(scope="module")
def site():
    server = serve()
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()
