"""The browser that other tests use sees what it should not."""

import pytest

from tests.browser import Browser, BrowserError

BAD = """<!doctype html><title>bad</title><img src="https://example.invalid/a.png">
<script>console.error("said"); undefinedName.call();</script>"""


def test_what_goes_wrong_on_a_page_is_seen(tmp_path):
    """That a clean page has no problems is seen by the tests that use it."""
    (tmp_path / "bad.html").write_text(BAD)
    with Browser(390, 700) as browser:
        with pytest.raises(BrowserError, match="not true"):
            browser.wait_for("false", 0.1)
        browser.open((tmp_path / "bad.html").as_uri())
        assert any("said" in problem for problem in browser.problems)
        assert any("undefinedName" in problem for problem in browser.problems)
        assert browser.outside() == ["https://example.invalid/a.png"]
        browser.evaluate("document.body.innerHTML = '<p style=\"width: 3000px\">wide</p>'")
        assert browser.too_wide > 400
