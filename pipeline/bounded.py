"""Work on untrusted files in a child process with limits on CPU time, clock time and memory.

The parent survives whatever happens to the child: an exception, a crash in a native library, no memory, an endless
loop. The child returns bytes, which the parent reads like a file: nothing in them runs.
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
_PIPE_BYTES = 1 << 20
_ANSWER, _REFUSAL, _ESCAPE = b"a", b"r", b"e"


class ChildFailed(Exception):
    """The child gave no answer; the message says why, as the end of a sentence about its input."""


def in_child(
    work: Callable[[], bytes],
    *,
    cpu_seconds: int,
    memory_mb: int,
    seconds: float | None = None,
    refusal: type[Exception] = ChildFailed,
) -> bytes:
    """Return what `work` answers in a forked child.

    cpu_seconds: limit of CPU time
    memory_mb: limit of memory in MB beyond what this process has now
    seconds: limit by the clock; without, CLOCK_SECONDS_PER_CPU_SECOND times `cpu_seconds`

    Raises `refusal` with the child's own message where `work` raises one, and ChildFailed for everything else.
    """
    seconds = CLOCK_SECONDS_PER_CPU_SECOND * cpu_seconds if seconds is None else seconds
    reader, writer = os.pipe()
    fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
    parent = os.getpid()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _run_child(work, writer, parent, cpu_seconds, memory_mb, refusal)
    os.close(writer)
    try:
        reply = _reply(reader, time.monotonic() + seconds)
        if reply is not None and not _is_whole(reply):
            _let_end(child)
    finally:
        os.close(reader)
        os.kill(child, signal.SIGKILL)  # no other process can have its id: it waits for us even when it has ended
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if reply is None:
        raise ChildFailed(f"it did not end within {seconds:g} s")
    if not _is_whole(reply):
        raise ChildFailed(_exit_reason(status, cpu_seconds, memory_mb))
    kind, content = reply[:1], reply[9:]
    if kind == _ANSWER:
        return content
    message = str(json.loads(content))
    raise refusal(message) if kind == _REFUSAL else ChildFailed(message)


def _is_whole(reply: bytes) -> bool:
    return len(reply) >= 9 and int.from_bytes(reply[1:9], "little") == len(reply) - 9


def _let_end(child: int) -> None:
    """Wait a moment for a child whose reply is incomplete: its exit status says why."""
    until = time.monotonic() + 1.0
    while time.monotonic() < until and os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT | os.WNOHANG) is None:
        time.sleep(0.001)


def _reply(reader: int, deadline: float) -> bytes | None:
    """Return the content of a pipe until its other end closes; None after the deadline."""
    chunks: list[bytes] = []
    while (left := deadline - time.monotonic()) > 0:
        if select.select([reader], [], [], left)[0]:
            chunk = os.read(reader, _PIPE_BYTES)
            if not chunk:
                return b"".join(chunks)
            chunks.append(chunk)
    return None


def _exit_reason(status: int, cpu_seconds: int, memory_mb: int) -> str:
    if status == -signal.SIGXCPU:
        return f"it took more than {cpu_seconds} s of CPU"
    if status == -signal.SIGKILL:
        return f"it was killed, as a machine does that runs out of memory (it may take {memory_mb:,} MB)"
    return "a native library crashed on it" if status < 0 else "its reader gave no answer"


def _run_child(
    work: Callable[[], bytes], writer: int, parent: int, cpu_seconds: int, memory_mb: int, refusal: type[Exception]
) -> NoReturn:
    """Run in the child, from start to exit."""
    try:
        _limit(parent, cpu_seconds, memory_mb)
        with open(writer, "wb") as stream:
            try:
                _send(stream, _ANSWER, work())
            except refusal as error:
                _send(stream, _REFUSAL, json.dumps(str(error)).encode())
            except MemoryError:
                _send(stream, _ESCAPE, json.dumps(f"it needs more than {memory_mb:,} MB of memory").encode())
            except RecursionError:
                _send(stream, _ESCAPE, json.dumps("it nests too deeply").encode())
            except Exception as error:
                _send(stream, _ESCAPE, json.dumps(_unexpected(error)).encode())
    finally:
        os._exit(0)


def _limit(parent: int, cpu_seconds: int, memory_mb: int) -> None:
    """Set the limits; print nothing, dump nothing, and die with the parent."""
    die_with_parent()
    if os.getppid() != parent:
        os._exit(1)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    faulthandler.disable()
    silent = open(os.devnull, "r+", encoding="utf-8")
    for descriptor in (0, 1, 2):
        os.dup2(silent.fileno(), descriptor)
    sys.stdout = sys.stderr = silent
    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0])
    max_bytes = pages * resource.getpagesize() + (memory_mb << 20)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_seconds, cpu_seconds + 1))
    resource.setrlimit(resource.RLIMIT_AS, (max_bytes, max_bytes))


def _send(stream: BinaryIO, kind: bytes, content: bytes) -> None:
    stream.write(kind + len(content).to_bytes(8, "little"))
    stream.write(content)
    stream.flush()


def _unexpected(error: Exception) -> str:
    """Say where in the project's code an unexpected exception was raised, for a bug report."""
    source_tree = str(Path(__file__).parents[1]) + os.sep
    frames = traceback.extract_tb(error.__traceback__)
    own = [
        frame for frame in frames if frame.filename.startswith(source_tree) and "site-packages" not in frame.filename
    ]
    where = f"{own[-1].filename.removeprefix(source_tree)}, line {own[-1].lineno}"
    return f"something is in it that its reader does not know ({where})"
