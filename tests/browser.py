"""A headless Chromium for tests, driven through its DevTools protocol over a pipe: no package, no port, no network.

    with Browser(width=1280, height=900) as browser:
        browser.open(path.as_uri())
        assert browser.evaluate("document.title") == "..."
        assert browser.problems == [] and browser.outside() == []  # exceptions and failed loads; addresses it asked for

Protocol: https://chromedevtools.github.io/devtools-protocol, messages of JSON ending in a zero byte.
"""

import base64
import contextlib
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any, Self

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-dev-shm-usage",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-extensions",
    "--disable-default-apps", "--no-default-browser-check", "--hide-scrollbars", "--remote-debugging-pipe",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE localhost, EXCLUDE 127.0.0.1",
)  # fmt: skip
PATIENCE = 30.0  # seconds; a first start on a busy machine takes five
FAINT = """(() => {  // texts whose contrast with what is behind them is below that of WCAG 2 AA
    const parts = (color) => color.match(/[\\d.]+/g).map(Number);
    const light = ([r, g, b]) => [r, g, b].map((value) => value / 255).map((value) => value <= 0.04045 ? value / 12.92
        : ((value + 0.055) / 1.055) ** 2.4).reduce((sum, value, k) => sum + value * [0.2126, 0.7152, 0.0722][k], 0);
    const behind = (node) => {
        for (; node; node = node.parentElement) {
            const color = parts(getComputedStyle(node).backgroundColor);
            if (color.length < 4 || color[3] > 0) return color;
        }
        return [255, 255, 255];
    };
    const faint = new Set();
    for (const node of document.querySelectorAll('body *')) {
        const text = [...node.childNodes].some((child) => child.nodeType === 3 && child.textContent.trim());
        if (!text || !node.checkVisibility() || node.closest('script, style')) continue;
        const style = getComputedStyle(node), color = node.namespaceURI.endsWith('svg') ? style.fill : style.color;
        const [a, b] = [light(parts(color)), light(behind(node))].sort((x, y) => y - x);
        const ratio = (a + 0.05) / (b + 0.05);
        if (ratio < 4.5) faint.add(`${node.localName}.${node.className.baseVal ?? node.className} ${ratio.toFixed(2)}`);
    }
    return [...faint];
})()"""


class BrowserError(AssertionError):
    """The browser refused a command, or what was waited for did not happen."""


class Browser:
    """One page of a headless browser; its profile is a new folder that goes with it."""

    def __init__(self, width: int = 1280, height: int = 900) -> None:
        self.problems: list[str] = []
        self.requests: list[str] = []
        self._size = width, height
        self._count = 0
        self._buffer = b""
        self._session = ""
        self._program = next(filter(None, map(shutil.which, NAMES)), "")
        if not self._program:
            pytest.skip(f"no browser on this machine ({', '.join(NAMES)}); on Debian: apt-get install chromium")

    def __enter__(self) -> Self:
        self._profile = tempfile.mkdtemp(prefix="symtop-browser-")
        self._home = {**os.environ, "HOME": self._profile, "XDG_CONFIG_HOME": self._profile}
        ours, theirs = os.pipe(), os.pipe()  # we write to ours[1], the browser to theirs[1]
        # the browser reads commands from descriptor 3 and writes to 4; a shell puts the two ends there
        script = f'exec "$@" 3<&{ours[0]} 4>&{theirs[1]}'
        self._process = subprocess.Popen(
            ["/bin/bash", "-c", script, "browser", self._program, *FLAGS, f"--user-data-dir={self._profile}"],
            pass_fds=(ours[0], theirs[1]), env=self._home, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip
        os.close(ours[0])
        os.close(theirs[1])
        self._write, self._read = ours[1], theirs[0]
        try:
            target = self._send("Target.createTarget", url="about:blank")["targetId"]
            self._session = self._send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
            for domain in ("Page", "Runtime", "Log", "Network"):
                self._send(f"{domain}.enable")
            self.resize(*self._size)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(BrowserError, OSError):
            self._session = ""
            self._send("Browser.close")
        os.close(self._write)
        os.close(self._read)
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            os.killpg(self._process.pid, 9)
            self._process.wait()
        shutil.rmtree(self._profile, ignore_errors=True)

    def _send(self, method: str, **params: Any) -> dict[str, Any]:
        self._count += 1
        message: dict[str, Any] = {"id": self._count, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        payload = json.dumps(message).encode() + b"\0"
        while payload:
            payload = payload[os.write(self._write, payload) :]
        deadline = time.monotonic() + PATIENCE
        while True:
            reply = self._receive(deadline - time.monotonic(), method)
            if reply.get("id") == self._count:
                if "error" in reply:
                    raise BrowserError(f"{method}: {reply['error']['message']}")
                return reply["result"]

    def _receive(self, patience: float, awaited: str) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            if not select.select([self._read], [], [], max(patience, 0.0))[0]:
                raise BrowserError(f"no answer to {awaited} within {PATIENCE:g} s")
            piece = os.read(self._read, 1 << 20)
            if not piece:
                raise BrowserError(f"the browser ended before it answered {awaited}")
            self._buffer += piece
        first, _, self._buffer = self._buffer.partition(b"\0")
        message = json.loads(first)
        self._note(message.get("method", ""), message.get("params", {}))
        return message

    def _note(self, event: str, params: dict[str, Any]) -> None:
        """Keep what a test must not overlook."""
        if event == "Runtime.exceptionThrown":
            details = params["exceptionDetails"]
            self.problems.append(details.get("exception", {}).get("description") or details["text"])
        elif event == "Runtime.consoleAPICalled" and params["type"] in ("error", "assert", "warning"):
            self.problems.append(" ".join(str(arg.get("value", arg.get("description"))) for arg in params["args"]))
        elif event == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.problems.append(f"{params['entry']['text']} {params['entry'].get('url', '')}".strip())
        elif event == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])

    def resize(self, width: int, height: int) -> None:
        """Give the page the window of a desk or, below 500 pixels, of a telephone."""
        self._size = width, height
        self._send("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1,
                   mobile=width < 500)  # fmt: skip
        self.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")

    def open(self, address: str) -> None:
        """Go to an address and wait until the page has loaded."""
        reply = self._send("Page.navigate", url=address)
        if "errorText" in reply:
            raise BrowserError(f"{address}: {reply['errorText']}")
        self.wait_for("document.readyState === 'complete' && location.href !== 'about:blank'")

    def evaluate(self, expression: str) -> Any:
        """The value of a JavaScript expression; a promise is awaited."""
        reply = self._send("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in reply:
            details = reply["exceptionDetails"]
            raise BrowserError(details.get("exception", {}).get("description") or details["text"])
        return reply["result"].get("value")

    def wait_for(self, condition: str, patience: float = PATIENCE) -> Any:
        """Wait until a JavaScript expression is true, and return it."""
        deadline = time.monotonic() + patience
        while time.monotonic() < deadline:
            if value := self.evaluate(condition):
                return value
            time.sleep(0.02)
        raise BrowserError(f"not true within {patience:g} s: {condition}")

    def set(self, selector: str, value: object) -> None:
        """Move a slider or choose from a list, as a user's hand would."""
        self.evaluate(
            f"(() => {{ const control = document.querySelector({selector!r}); control.value = {json.dumps(str(value))};"
            "control.dispatchEvent(new Event('input', {bubbles: true}));"
            "control.dispatchEvent(new Event('change', {bubbles: true})); })()"
        )

    def click(self, selector: str) -> None:
        """Click on an element."""
        self.evaluate(f"document.querySelector({selector!r}).click()")

    def prefer(self, scheme: str) -> None:
        """Have the system ask for colours that are "light" or "dark", or take the request back with ""."""
        self._send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def press(self, key: str) -> None:
        """Press a key that writes nothing, such as "Tab" or "ArrowRight", as a reader's hand would."""
        code = {"Tab": 9, "Enter": 13, "Escape": 27, "ArrowLeft": 37, "ArrowRight": 39}[key]
        text = {"text": "\r"} if key == "Enter" else {}
        for kind in ("keyDown", "keyUp"):
            self._send("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code, **text)

    def pdf(self, path: Path) -> Path:
        """Print the page."""
        reply = self._send("Page.printToPDF", printBackground=False, preferCSSPageSize=True)
        path.write_bytes(base64.b64decode(reply["data"]))
        return path

    def drag(self, selector: str, right: float = 0.0, down: float = 0.0, xy: tuple[float, float] = (0.5, 0.5)) -> None:
        """Press the mouse at two shares of an element's width and height, move it by so many pixels, and let go."""
        box = self.evaluate(f"document.querySelector({selector!r}).getBoundingClientRect().toJSON()")
        x, y = box["x"] + xy[0] * box["width"], box["y"] + xy[1] * box["height"]
        for kind, share in (("mousePressed", 0.0), ("mouseMoved", 0.5), ("mouseMoved", 1.0), ("mouseReleased", 1.0)):
            place = {"x": x + share * right, "y": y + share * down}
            self._send("Input.dispatchMouseEvent", type=kind, button="left", buttons=1, clickCount=1, **place)

    def screenshot(self, path: Path, *, whole: bool = False) -> Path:
        """Save what is in the window, or the whole page, as a PNG."""
        size = self._send("Page.getLayoutMetrics")["cssContentSize"] if whole else {}
        clip = {"clip": {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}} if size else {}
        reply = self._send("Page.captureScreenshot", format="png", captureBeyondViewport=whole, **clip)
        path.write_bytes(base64.b64decode(reply["data"]))
        return path

    def outside(self) -> list[str]:
        """What the page asked of other machines: anything but files, data and this one."""
        prefixes = ("file:", "data:", "blob:", "about:", "http://127.0.0.1", "http://localhost")
        return [address for address in self.requests if not address.startswith(prefixes)]

    @property
    def too_wide(self) -> int:
        """By how many pixels the page is wider than its window."""
        return int(self.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth"))
