"""A stream that computes the length and the SHA-256 of its content."""

from __future__ import annotations

import hashlib
from typing import BinaryIO


class HashingStream:
    """Passes content on to `stream`, and computes its length and SHA-256."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._hash = hashlib.sha256()
        self.written = 0

    def write(self, content: bytes) -> int:
        """Write all of `content`."""
        self._hash.update(content)
        self.written += len(content)
        return self._stream.write(content)

    def flush(self) -> None:
        """Do nothing: this stream has no buffer."""

    @property
    def closed(self) -> bool:
        """Return False: the owner of `stream` closes it."""
        return False

    def tell(self) -> int:
        """Return the number of bytes written."""
        return self.written

    def digest(self) -> str:
        """Return the SHA-256 of the content, in hex."""
        return self._hash.hexdigest()
