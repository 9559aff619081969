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


@pytest.fixture(scope="module")
def browser():
    with Browser(1280, 900) as opened:
        yield opened


@pytest.fixture
def explorer(site, browser):
    """Opens the page, or the link that follows its address; a test may leave no error on it."""

    def opened(link=""):
        browser.resize(1280, 900)
        browser.open(address(site) + link)
        return browser

    yield opened
    problems = browser.problems.copy()
    browser.problems.clear()
    browser.open("data:text/html,")  # a page that stays open goes on drawing, and another link would not load it anew
    assert problems == []
