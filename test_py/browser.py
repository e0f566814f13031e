"""Headless Chromium over the DevTools protocol: console messages, requests and screenshots of a page."""

from __future__ import annotations

import base64
import io
import json
import shutil
import subprocess
import time
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

import matplotlib.image
import numpy as np
from websockets.sync.client import connect

TIMEOUT = 60.0
"""Timeout of each wait, s; a start on a busy machine takes seconds."""
PROGRAMS = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"]
FLAGS = [
    "--enable-unsafe-swiftshader",
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--disable-sync",
    "--disable-component-update",
    "--disable-background-networking",
    "--no-first-run",
    "--hide-scrollbars",
    "--remote-debugging-port=0",
]
"""Command line options. No sandbox: Chromium has none for root. The other options disable background requests."""


def find_browser() -> str | None:
    """Returns the path of Chromium, or None."""
    return next(filter(None, map(shutil.which, PROGRAMS)), None)


class Browser:
    """Browser with one page; a context manager."""

    def __init__(self, program: str, profile: Path):
        self.events: list[dict] = []
        self._last_id = 0
        self._session: str | None = None
        self._open = ExitStack()
        self._log = self._open.enter_context((profile / "chromium.log").open("wb"))
        command = [program, *FLAGS, f"--user-data-dir={profile}", "about:blank"]
        self._process = subprocess.Popen(command, stdout=self._log, stderr=self._log, stdin=subprocess.DEVNULL)
        try:
            connection = connect(self._address(profile), proxy=None, max_size=None, open_timeout=TIMEOUT)
            self._socket = self._open.enter_context(connection)
            target = self.send("Target.createTarget", url="about:blank")["targetId"]
            self._session = self.send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
            for domain in ("Log", "Runtime", "Network", "Page"):
                self.send(f"{domain}.enable")
        except BaseException:
            self._end()
            raise

    def _address(self, profile: Path) -> str:
        """Returns the address of the DevTools server, which the browser writes into its profile."""
        file = profile / "DevToolsActivePort"
        deadline = time.monotonic() + TIMEOUT
        while time.monotonic() < deadline:
            if self._process.poll() is not None:
                raise RuntimeError(f"the browser ended with status {self._process.returncode}: {self._log.name}")
            lines = file.read_text().split() if file.exists() else []
            if len(lines) == 2:
                port, path = lines
                return f"ws://127.0.0.1:{port}{path}"
            time.sleep(0.05)
        raise TimeoutError(f"no DevTools connection after {TIMEOUT} s: {self._log.name}")

    def send(self, method: str, **params: object) -> dict:
        """Returns a command's result; keeps events that arrive meanwhile."""
        self._last_id += 1
        message = {"id": self._last_id, "method": method, "params": params}
        if self._session is not None:
            message["sessionId"] = self._session
        self._socket.send(json.dumps(message))
        deadline = time.monotonic() + TIMEOUT
        while True:
            answer = self._receive(deadline)
            if answer.get("id") == self._last_id:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]

    def _receive(self, deadline: float) -> dict:
        message = json.loads(self._socket.recv(timeout=max(0.0, deadline - time.monotonic())))
        if "method" in message:
            self.events.append(message)
        return message

    def events_of(self, *methods: str) -> list[dict]:
        """Returns the events of the given names since the page was opened."""
        return [event["params"] for event in self.events if event["method"] in methods]

    def open(self, url: str) -> None:
        """Loads a page completely."""
        self.events.clear()
        failed = self.send("Page.navigate", url=url).get("errorText")
        assert not failed, f"{url}: {failed}"
        deadline = time.monotonic() + TIMEOUT
        while not self.events_of("Page.loadEventFired"):
            self._receive(deadline)

    def show_as(self, *, scheme: str = "light", media: str = "", width: int = 1280) -> None:
        """Sets color scheme, medium (screen or print) and width."""
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.send("Emulation.setEmulatedMedia", media=media, features=features)
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        self.send("Emulation.setDeviceMetricsOverride", **size)

    def evaluate(self, expression: str) -> object:
        """Evaluates a JavaScript expression in the page."""
        result = self.send("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def screenshot(self, keep: Path | None = None) -> np.ndarray:
        """Returns the whole page: height, width, three colors in 0…1."""
        shot = self.send("Page.captureScreenshot", format="png", captureBeyondViewport=True)
        png = base64.b64decode(shot["data"])
        if keep is not None:
            keep.write_bytes(png)
        return matplotlib.image.imread(io.BytesIO(png))[:, :, :3]

    def pdf(self) -> bytes:
        """Returns the printed page."""
        return base64.b64decode(self.send("Page.printToPDF", printBackground=False)["data"])

    def _end(self) -> None:
        self._process.terminate()
        try:
            self._process.wait(TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait(TIMEOUT)
        self._open.close()

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None):
        try:
            self._session = None
            self.send("Browser.close")
        finally:
            self._end()
