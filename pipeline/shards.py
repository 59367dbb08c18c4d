"""Shards on disk: tar files whose bytes depend on their contents alone.

A shard is an uncompressed tar in the WebDataset layout: the members of a sample follow each other and are named
`<key>.<member>`, for example `castle-000017.points.npy`. Entries have no time, no user and one mode, so equal samples
make equal files.
"""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt


def json_bytes(value: Any) -> bytes:
    """Encode a value as one line of canonical JSON: sorted keys, no NaN, UTF-8, newline at the end."""
    text = json.dumps(value, sort_keys=True, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.encode() + b"\n"


def array_bytes(array: npt.NDArray[Any]) -> bytes:
    """Encode an array as the bytes of a `.npy` file, never pickled."""
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.ascontiguousarray(array), version=(1, 0), allow_pickle=False)
    return buffer.getvalue()


def bytes_array(content: bytes) -> npt.NDArray[Any]:
    """Decode the array in the bytes of a `.npy` file."""
    return np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)


class ShardWriter:
    """Writes samples to a tar in a stream that the caller commits.

    Raises ValueError for a key with a dot or a slash and for an upper-case member name: loaders group members by the
    part of a file name before its first dot.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._tar = tarfile.open(fileobj=stream, mode="w", format=tarfile.USTAR_FORMAT)
        self.samples = 0
        self.offsets: dict[str, int] = {}

    def write(self, key: str, members: Mapping[str, bytes]) -> None:
        """Append one sample; `members` maps names such as `points.npy` to bytes."""
        if not key or "." in key or "/" in key:
            raise ValueError(f"sample key {key!r} must be non-empty and hold neither a dot nor a slash")
        if key in self.offsets:
            raise ValueError(f"sample key {key!r} is written twice")
        self.offsets[key] = self._tar.offset
        for name in members:
            if name != name.lower():
                raise ValueError(f"member {name!r} of {key!r} must be lower-case")
            entry = tarfile.TarInfo(f"{key}.{name}")
            entry.size = len(members[name])
            entry.mode, entry.mtime, entry.uid, entry.gid, entry.uname, entry.gname = 0o644, 0, 0, 0, "", ""
            self._tar.addfile(entry, io.BytesIO(members[name]))
        self.samples += 1

    def __enter__(self) -> ShardWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self._tar.close()


def read_shard(shard: Path | BinaryIO) -> Iterator[tuple[str, dict[str, bytes]]]:
    """Yield the samples of a shard in order, `(key, {member: bytes})`, one in memory at a time.

    shard: its path, or a stream that can seek, which may begin and end between any two samples

    Skips entries that are not files, such as folders and links.
    """
    key: str | None = None
    members: dict[str, bytes] = {}
    opened = {"name": shard} if isinstance(shard, Path) else {"fileobj": shard}
    with tarfile.open(**opened, mode="r:") as tar:
        for entry in tar:
            if not entry.isfile():
                continue
            entry_key, _, member = entry.name.partition(".")
            if key is not None and entry_key != key:
                yield key, members
                members = {}
            key = entry_key
            content = tar.extractfile(entry)
            assert content is not None, entry.name
            members[member] = content.read()
            tar.members = []  # type: ignore[attr-defined]  # tarfile keeps every header; memory stays flat without them
    if key is not None:
        yield key, members
