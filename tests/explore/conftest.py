"""An explorer that answers this process, and its page in a browser."""

import threading

import pytest

from symtop.explore.server import address, serve
from tests.browser import Browser


@pytest.fixture(scope="module")
def site():
    server = serve()
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


@pytest.fixture
def explorer(site):
    """Opens the page, or the link that follows its address; a test may leave no error on it."""
    with Browser(1280, 900) as browser:

        def opened(link=""):
            browser.open(address(site) + link)
            return browser

        yield opened
        assert browser.problems == []
