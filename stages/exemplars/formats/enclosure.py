"""The folder of a model: files that a model names are read from inside it, and from nowhere else."""

from __future__ import annotations

import base64
import binascii
import re
from pathlib import Path
from urllib.parse import unquote

from pipeline.errors import ConfigError

__all__ = ["Enclosure"]

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")


class Enclosure:
    """Reads the files that the model at `model` names: buffers, materials, images.

    A name that leaves the model's folder (`..`, an absolute path, a URL, a link that points out, percent-encoded
    or with backslashes) is refused before anything is opened.
    """

    def __init__(self, model: Path) -> None:
        self.model = model
        self._folder = model.parent.resolve()

    def read(self, name: str, element: str, *, encoded: bool = False) -> bytes:
        """The bytes of the file that `element` of the model calls `name`.

        `encoded` says that `name` is a URI: it may be percent-encoded and may be a `data:` URI.
        Raises ConfigError if the name leaves the folder or is no file name at all, FileNotFoundError if there is
        no such file.
        """
        self.check(name, element, encoded=encoded)
        if encoded and name.startswith("data:"):
            return self._inline(name, element)
        path = self._path(unquote(name) if encoded else name)
        if encoded and not path.is_file():
            path = self._path(name)
        if not path.is_file():
            raise FileNotFoundError(name)
        try:
            return path.read_bytes()
        except OSError as error:
            raise ConfigError(
                f"{self.model}: {element} names {name!r}, which cannot be read: {error.strerror}"
            ) from None

    def check(self, name: str, element: str, *, encoded: bool = False) -> None:
        """Raise ConfigError, without opening anything, if `name` leaves the folder."""
        if encoded and name.startswith("data:"):
            return
        written = [name]
        while (decoded := unquote(written[-1])) != written[-1]:
            written.append(decoded)  # an encoded slash may itself be encoded
        for each in written:
            plain = each.strip().replace("\\", "/")
            leaves = plain.startswith(("/", "~")) or "\0" in plain or _SCHEME.match(plain) is not None
            if leaves or not self._path(plain).resolve().is_relative_to(self._folder):
                raise ConfigError(
                    f"{self.model}: {element} names {name!r}, a path outside the folder of the model; nothing outside "
                    "is opened. Put the file beside the model and name it by a relative path, or embed it (as .glb)"
                )

    def _path(self, name: str) -> Path:
        return self._folder / name.strip().replace("\\", "/")

    def _inline(self, uri: str, element: str) -> bytes:
        header, comma, payload = uri.partition(",")
        try:
            if not comma or not header.endswith(";base64"):
                raise binascii.Error("not base64")
            return base64.b64decode(payload, validate=True)
        except binascii.Error:
            raise ConfigError(
                f"{self.model}: {element} has a data URI that is not valid base64; export the model again, as .glb"
            ) from None
