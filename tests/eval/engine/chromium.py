"""A page in headless Chromium, asked over its DevTools pipe: what it loads, what it complains of, how wide it is."""

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
    """The browser of this machine, if it has one."""
    return next((found for found in map(shutil.which, NAMES) if found), None)


class Browser:
    """One tab. events: what it has told so far, as DevTools does."""

    def __init__(self, reading: int, writing: int) -> None:
        self._reading, self._writing = os.fdopen(reading, "rb"), os.fdopen(writing, "wb")
        self._numbers = itertools.count(1)
        self._session = ""
        self.events: list[dict[str, Any]] = []
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(f"{domain}.enable")

    def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The answer to a call. Raises RuntimeError for one that the browser refuses."""
        number = next(self._numbers)
        call = {"id": number, "method": method, "params": parameters}
        self._writing.write(json.dumps(call | ({"sessionId": self._session} if self._session else {})).encode() + b"\0")
        self._writing.flush()
        while True:
            said = self._hear()
            if said.get("id") == number:
                if "error" in said:
                    raise RuntimeError(said["error"]["message"])
                answer: dict[str, Any] = said["result"]
                return answer
            self.events.append(said)

    def show(self, path: Path, width: int, scheme: str) -> None:
        """Load a file in a window so many pixels wide, in a `light` or `dark` scheme, and wait until it is there."""
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=False)
        self.ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.events.clear()
        self.ask("Page.navigate", url=path.resolve().as_uri())
        while not any(each.get("method") == "Page.loadEventFired" for each in self.events):
            self.events.append(self._hear())

    def value(self, expression: str) -> Any:
        """What JavaScript makes of an expression in the page."""
        return self.ask("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def told(self, method: str) -> list[dict[str, Any]]:
        """The events of one kind since the page was asked for."""
        return [each["params"] for each in self.events if each.get("method") == method]

    def _hear(self) -> dict[str, Any]:
        said = bytearray()
        while (byte := self._reading.read(1)) != b"\0":
            if not byte:
                raise RuntimeError("the browser has gone")
            said += byte
        heard: dict[str, Any] = json.loads(said)
        return heard


@contextmanager
def browser(program: str, folder: Path) -> Iterator[Browser]:
    """A browser with its profile in `folder`; it ends with the block."""
    to_it, writing = os.pipe()
    reading, from_it = os.pipe()
    # it reads calls from its descriptor 3 and answers on 4
    pipes = ["bash", "-c", f'exec "$@" 3<&{to_it} 4>&{from_it}', "-"]
    command = [*pipes, program, *FLAGS, f"--user-data-dir={folder}", "--remote-debugging-pipe"]
    running = subprocess.Popen(command, pass_fds=(to_it, from_it), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(to_it)
    os.close(from_it)
    try:
        yield Browser(reading, writing)
    finally:
        running.terminate()
        running.wait(10)
