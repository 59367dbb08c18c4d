"""A page in headless Chromium over its DevTools pipe: its requests, its errors, its width."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

NAMES = ("chromium", "chromium-browser", "chromium-headless-shell", "google-chrome", "chrome")
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")


def find_chromium() -> str | None:
    """Return the browser of this machine, if there is one."""
    return next((path for path in map(shutil.which, NAMES) if path), None)


class Browser:
    """One tab. `events`: those of DevTools since the page was requested."""

    def __init__(self, reading: int, writing: int) -> None:
        self._reading, self._writing = os.fdopen(reading, "rb"), os.fdopen(writing, "wb")
        self._numbers = itertools.count(1)
        self._session = ""
        self.events: list[dict[str, Any]] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method and return its result. Raises RuntimeError if the browser refuses it."""
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": parameters}
        self._writing.write(
            json.dumps(message | ({"sessionId": self._session} if self._session else {})).encode() + b"\0"
        )
        self._writing.flush()
        while True:
            message = self._receive()
            if message.get("id") == number:
                if "error" in message:
                    raise RuntimeError(message["error"]["message"])
                result: dict[str, Any] = message["result"]
                return result
            self.events.append(message)

    def show(self, path: Path, width: int, scheme: str) -> None:
        """Load a file in a window of some width in pixels, in a `light` or `dark` scheme, and wait for it."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=False)
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.events.clear()
        self.call("Page.navigate", url=path.resolve().as_uri())
        while not any(event.get("method") == "Page.loadEventFired" for event in self.events):
            self.events.append(self._receive())

    def value(self, expression: str) -> Any:
        """Evaluate a JavaScript expression in the page."""
        return self.call("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def events_of(self, method: str) -> list[dict[str, Any]]:
        """Return the events of one kind since the page was requested."""
        return [event["params"] for event in self.events if event.get("method") == method]

    def _receive(self) -> dict[str, Any]:
        content = bytearray()
        while (byte := self._reading.read(1)) != b"\0":
            if not byte:
                raise RuntimeError("the browser has quit")
            content += byte
        message: dict[str, Any] = json.loads(content)
        return message


@contextmanager
def browser(program: str, folder: Path) -> Iterator[Browser]:
    """Run a browser with its profile in `folder` until the block ends."""
    calls, writing = os.pipe()
    reading, replies = os.pipe()
    # the browser reads calls from descriptor 3 and replies on 4
    pipes = ["bash", "-c", f'exec "$@" 3<&{calls} 4>&{replies}', "-"]
    command = [*pipes, program, *FLAGS, f"--user-data-dir={folder}", "--remote-debugging-pipe"]
    running = subprocess.Popen(command, pass_fds=(calls, replies), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(calls)
    os.close(replies)
    try:
        yield Browser(reading, writing)
    finally:
        running.terminate()
        running.wait(10)
