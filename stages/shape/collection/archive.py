"""Files of a format as one archive, `.tar.gz`, whose bytes depend on the files alone.

No zip: `zipfile.is_zipfile`, which readers of datasets ask, takes a shard with a zip near its end for a zip.
"""

from __future__ import annotations

import gzip
import io
import tarfile
import zlib
from collections.abc import Mapping


def archive_name(kind: str) -> str:
    """Return the name of the member with the files of a format."""
    return f"{kind}.tar.gz"


def archive_bytes(files: Mapping[str, bytes]) -> bytes:
    """Return an archive of files by their paths, in their order, without times."""
    buffer = io.BytesIO()
    with (
        gzip.GzipFile("", "wb", compresslevel=6, fileobj=buffer, mtime=0) as packed,
        tarfile.open(fileobj=packed, mode="w", format=tarfile.GNU_FORMAT) as archive,
    ):
        for name, content in files.items():
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            archive.addfile(entry, io.BytesIO(content))
    return buffer.getvalue()


def archive_files(content: bytes) -> dict[str, bytes]:
    """Return the files of an archive by their paths. Raises ValueError where it is corrupted."""
    try:
        with tarfile.open(fileobj=io.BytesIO(gzip.decompress(content))) as archive:
            found = ((entry.name, archive.extractfile(entry)) for entry in archive)
            return {name: stream.read() for name, stream in found if stream is not None}
    except (tarfile.TarError, OSError, EOFError, zlib.error) as error:
        raise ValueError(str(error)) from None
