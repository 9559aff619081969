"""The browser that other tests use sees what it should see, and what it should not."""

import pytest

from tests.browser import Browser, BrowserError

GOOD = """<!doctype html><title>good</title><input id=a type=range max=9 value=1><p id=b>1</p>
<script>a.oninput = () => { b.textContent = a.value; };</script>"""
BAD = """<!doctype html><title>bad</title><img src="https://example.invalid/a.png">
<script>console.error("said"); undefinedName.call();</script>"""


def test_a_slider_moves_and_a_clean_page_has_no_problems(tmp_path):
    (tmp_path / "good.html").write_text(GOOD)
    (tmp_path / "bad.html").write_text(BAD)
    with Browser(390, 700) as browser:
        browser.open((tmp_path / "good.html").as_uri())
        assert browser.evaluate("document.title") == "good"
        browser.set("#a", 7)
        assert browser.wait_for("b.textContent") == "7"
        assert browser.screenshot(tmp_path / "good.png").read_bytes().startswith(b"\x89PNG")
        assert browser.problems == []
        assert browser.outside() == []
        assert browser.too_wide == 0
        with pytest.raises(BrowserError, match="not true"):
            browser.wait_for("false", 0.1)
        browser.open((tmp_path / "bad.html").as_uri())
        assert any("said" in problem for problem in browser.problems)
        assert any("undefinedName" in problem for problem in browser.problems)
        assert browser.outside() == ["https://example.invalid/a.png"]
