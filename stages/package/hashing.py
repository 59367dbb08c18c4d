"""A stream that knows the length and the SHA-256 of what was written to it."""

from __future__ import annotations

import hashlib
from typing import BinaryIO


class HashingStream:
    """What a file is written to: passes all on to `stream`, and knows its length and SHA-256."""

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
        """Nothing is held back here."""

    @property
    def closed(self) -> bool:
        """Whoever gave `stream` closes it."""
        return False

    def tell(self) -> int:
        """How many bytes have been written."""
        return self.written

    def digest(self) -> str:
        """SHA-256 of what has been written, in hexadecimal."""
        return self._hash.hexdigest()
