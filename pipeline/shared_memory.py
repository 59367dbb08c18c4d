"""The shared memory in which workers keep their semaphores."""

from __future__ import annotations

import errno
import multiprocessing
from collections.abc import Iterator
from contextlib import contextmanager

from pipeline.errors import Fatal

REMEDY = "mount a writable one: mount -t tmpfs tmpfs /dev/shm; in a container: --shm-size=64m"

_NOT_WRITABLE = {errno.EROFS, errno.EACCES, errno.EPERM, errno.ENOSPC, errno.EDQUOT, errno.ENOENT}


@contextmanager
def semaphores_needed() -> Iterator[None]:
    """Raise Fatal, with the remedy, where the block creates semaphores and /dev/shm cannot hold them."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno in _NOT_WRITABLE:
            raise Fatal(f"/dev/shm cannot hold the workers' semaphores ({error.strerror}): {REMEDY}") from error
        raise


def semaphore_fault() -> str:
    """Return why no semaphore can be created; empty where one can."""
    try:
        multiprocessing.Semaphore()
    except OSError as error:
        return str(error.strerror)
    return ""
