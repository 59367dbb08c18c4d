"""Work on what strangers wrote, in a child process that may take so much and no more.

Whatever becomes of the child (an exception, a crash in a native library, no memory, no end), the parent goes on. What
comes back is bytes, which the parent reads as it would read a file: nothing in it runs.
"""

from __future__ import annotations

import faulthandler
import fcntl
import json
import os
import resource
import select
import signal
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, NoReturn

from pipeline.termination import die_with_parent

CLOCK_SECONDS_PER_CPU_SECOND = 10
"""A child is given up after so many times its CPU seconds by the clock, where nobody says."""
_PIPE = 1 << 20
_ANSWER, _REFUSAL, _ESCAPE = b"a", b"r", b"e"


class ChildFailed(Exception):
    """The child has given no answer; the message says why, in words that end a sentence about what it worked on."""


def in_child(
    work: Callable[[], bytes],
    *,
    cpu_seconds: int,
    memory_mb: int,
    seconds: float | None = None,
    refusal: type[Exception] = ChildFailed,
) -> bytes:
    """What `work` answers, called in a forked child with at most `cpu_seconds` of CPU and `memory_mb` MB of memory
    beyond what this process has now; and `seconds` by the clock, for it may sleep: ten times its CPU seconds, where
    nobody says.

    Raises `refusal`, with the child's own message, where `work` raises one; Escaped for everything else that can happen
    to it.
    """
    seconds = CLOCK_SECONDS_PER_CPU_SECOND * cpu_seconds if seconds is None else seconds
    reader, writer = os.pipe()
    fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, _PIPE)
    parent = os.getpid()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _answer(work, writer, parent, cpu_seconds, memory_mb, refusal)
    os.close(writer)
    try:
        reply = _reply(reader, time.monotonic() + seconds)
        if reply is not None and not _is_whole(reply):
            _let_end(child)
    finally:
        os.close(reader)
        os.kill(child, signal.SIGKILL)  # one that has ended waits for us all the same, as nobody else
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if reply is None:
        raise ChildFailed(f"it did not end within {seconds:g} s")
    if not _is_whole(reply):
        raise ChildFailed(_end(status, cpu_seconds, memory_mb))
    kind, content = reply[:1], reply[9:]
    if kind == _ANSWER:
        return content
    message = str(json.loads(content))
    raise refusal(message) if kind == _REFUSAL else ChildFailed(message)


def _is_whole(reply: bytes) -> bool:
    return len(reply) >= 9 and int.from_bytes(reply[1:9], "little") == len(reply) - 9


def _let_end(child: int) -> None:
    """Wait a moment for a child that said too little, for the way in which it ends tells why; it may be killed then."""
    until = time.monotonic() + 1.0
    while time.monotonic() < until and os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT | os.WNOHANG) is None:
        time.sleep(0.001)


def _reply(reader: int, deadline: float) -> bytes | None:
    """All that comes through a pipe until its other end closes; None where that takes too long."""
    chunks: list[bytes] = []
    while (left := deadline - time.monotonic()) > 0:
        if select.select([reader], [], [], left)[0]:
            chunk = os.read(reader, _PIPE)
            if not chunk:
                return b"".join(chunks)
            chunks.append(chunk)
    return None


def _end(status: int, cpu_seconds: int, memory_mb: int) -> str:
    if status == -signal.SIGXCPU:
        return f"it took more than {cpu_seconds} s of CPU"
    if status == -signal.SIGKILL:
        return f"it was killed, as a machine does that runs out of memory (it may take {memory_mb:,} MB)"
    return "a native library crashed on it" if status < 0 else "its reader gave no answer"


def _answer(
    work: Callable[[], bytes], writer: int, parent: int, cpu_seconds: int, memory_mb: int, refusal: type[Exception]
) -> NoReturn:
    """What the child does from its first to its last."""
    try:
        _bind(parent, cpu_seconds, memory_mb)
        with open(writer, "wb") as stream:
            try:
                _say(stream, _ANSWER, work())
            except refusal as error:
                _say(stream, _REFUSAL, json.dumps(str(error)).encode())
            except MemoryError:
                _say(stream, _ESCAPE, json.dumps(f"it needs more than {memory_mb:,} MB of memory").encode())
            except RecursionError:
                _say(stream, _ESCAPE, json.dumps("it nests too deeply").encode())
            except Exception as error:
                _say(stream, _ESCAPE, json.dumps(_unforeseen(error)).encode())
    finally:
        os._exit(0)


def _bind(parent: int, cpu_seconds: int, memory_mb: int) -> None:
    """Set the bounds; print nothing, dump nothing, and die with the parent."""
    die_with_parent()
    if os.getppid() != parent:
        os._exit(1)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    faulthandler.disable()
    silent = open(os.devnull, "r+")
    for descriptor in (0, 1, 2):
        os.dup2(silent.fileno(), descriptor)
    sys.stdout = sys.stderr = silent
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + (memory_mb << 20)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_seconds, cpu_seconds + 1))
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def _say(stream: BinaryIO, kind: bytes, content: bytes) -> None:
    stream.write(kind + len(content).to_bytes(8, "little"))
    stream.write(content)
    stream.flush()


def _unforeseen(error: Exception) -> str:
    """Where in the project's code an exception came up that nobody foresaw: what its author asks for."""
    house = str(Path(__file__).parents[1]) + os.sep
    frames = traceback.extract_tb(error.__traceback__)
    own = [each for each in frames if each.filename.startswith(house) and "site-packages" not in each.filename]
    place = f"{own[-1].filename.removeprefix(house)}, line {own[-1].lineno}"
    return f"something is in it that its reader does not know ({place})"
