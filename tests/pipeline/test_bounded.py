"""Whatever a child does, its parent gets an answer, a refusal or one sentence, and goes on."""

from __future__ import annotations

import ctypes
import os
import signal
import time
from collections.abc import Callable

import numpy as np
import pytest

from pipeline.bounded import ChildFailed, in_child


class Refused(Exception):
    pass


def refuse() -> bytes:
    raise Refused("the file, line 3: 'x' is no number")


def sleep() -> bytes:
    time.sleep(60)
    return b""


def loop() -> bytes:
    while True:
        pass


def down() -> bytes:
    return down()


def interrupted() -> bytes:
    raise KeyboardInterrupt


def test_child_returns_the_whole_answer() -> None:
    content = np.random.default_rng(0).bytes(5_000_000)
    assert in_child(lambda: content, cpu_seconds=20, memory_mb=200) == content


def test_refusal_keeps_class_and_message() -> None:
    with pytest.raises(Refused, match=r"^the file, line 3: 'x' is no number$"):
        in_child(refuse, cpu_seconds=20, memory_mb=200, refusal=Refused)


@pytest.mark.parametrize(
    ("work", "reported"),
    [
        (down, "it nests too deeply"),
        (lambda: np.zeros(10**10).tobytes(), "it needs more than 200 MB of memory"),
        (lambda: ctypes.string_at(0), "a native library crashed on it"),
        (lambda: os.kill(os.getpid(), signal.SIGKILL), "it was killed, as a machine does that runs out of memory"),
        (interrupted, "its reader gave no answer"),
        (lambda: {}["key"], "something is in it that its reader does not know"),
    ],
)
def test_unexpected_error_is_one_sentence(work: Callable[[], bytes], reported: str) -> None:
    with pytest.raises(ChildFailed) as caught:
        in_child(work, cpu_seconds=10, memory_mb=200)
    assert str(caught.value).startswith(reported)
    assert "KeyError" not in str(caught.value)


def test_child_that_loops_or_sleeps_is_ended() -> None:
    with pytest.raises(ChildFailed, match="it took more than 1 s of CPU"):
        in_child(loop, cpu_seconds=1, memory_mb=200, seconds=60)
    with pytest.raises(ChildFailed, match=r"it did not end within 0.5 s"):
        in_child(sleep, cpu_seconds=1, memory_mb=200, seconds=0.5)


def test_nothing_is_left_behind(capfd: pytest.CaptureFixture[str]) -> None:
    before = len(os.listdir("/proc/self/fd"))

    def noisy() -> bytes:
        print("noise", flush=True)
        os.write(2, b"noise")
        return b"%d" % os.getpid()

    child = int(in_child(noisy, cpu_seconds=20, memory_mb=200))
    assert child != os.getpid()
    assert len(os.listdir("/proc/self/fd")) == before
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)
    assert capfd.readouterr() == ("", "")
