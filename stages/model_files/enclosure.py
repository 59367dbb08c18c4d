"""The folder of a model: files that a model names are read from inside it only."""

from __future__ import annotations

import base64
import binascii
import re
from pathlib import Path
from urllib.parse import unquote, unquote_to_bytes

from pipeline.errors import ConfigError

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")
_MAX_NAME_LENGTH = 4096
"""On Linux."""


class Outside(ConfigError):
    """A file name leads out of the model's folder. Without a texture or a material library only colours are lost."""


class Enclosure:
    """Read the files that the model at `model` names: buffers, materials, images.

    A name that leaves the model's folder (`..`, an absolute path, a URL, a link that points out, percent-encoded
    or with backslashes) is refused before anything is opened.
    """

    def __init__(self, model: Path) -> None:
        self.model = model
        self.at = "the file"  # the element that is being read, for error messages
        self._folder = model.parent.resolve()

    def read(self, name: str, element: str, *, encoded: bool = False) -> bytes:
        """Return the bytes of the file that `element` of the model calls `name`.

        encoded: whether `name` is a URI, which may be percent-encoded or a `data:` URI.

        Raises Outside if the name leaves the folder or is no file name, FileNotFoundError for a missing file, and
        OSError for one that cannot be read.
        """
        self.check(name, element, encoded=encoded)
        if encoded and name.startswith("data:"):
            return self._inline(name, element)
        path = self._path(unquote(name) if encoded else name)
        if encoded and not path.is_file():
            path = self._path(name)
        if not path.is_file():
            raise FileNotFoundError(name)
        return path.read_bytes()

    def check(self, name: str, element: str, *, encoded: bool = False) -> None:
        """Raise Outside, without opening anything, if `name` leaves the folder or is no file name."""
        if not isinstance(name, str):
            raise Outside(f"{self.model}: {element} names a file by something that is no text; export it again")
        if encoded and name.startswith("data:"):
            return
        if len(name) > _MAX_NAME_LENGTH:
            raise Outside(f"{self.model}: {element} names a file by {len(name):,} characters; export it again")
        spellings = [name]
        while (decoded := unquote(spellings[-1])) != spellings[-1]:
            spellings.append(decoded)  # an encoded slash may itself be encoded
        for spelling in spellings:
            plain = spelling.strip().replace("\\", "/")
            leaves = plain.startswith(("/", "~")) or "\0" in plain or _SCHEME.match(plain) is not None
            if leaves or not self._leads_inside(plain):
                raise Outside(
                    f"{self.model}: {element} names {name!r}, a path outside the folder of the model; nothing outside "
                    "is opened. Put the file next to the model and name it by a relative path, or embed it (as .glb)"
                )

    def _leads_inside(self, name: str) -> bool:
        try:
            return self._path(name).resolve().is_relative_to(self._folder)
        except (OSError, RuntimeError, ValueError):  # a name that is too long, circular links, a lone surrogate
            return False

    def _path(self, name: str) -> Path:
        return self._folder / name.strip().replace("\\", "/")

    def _inline(self, uri: str, element: str) -> bytes:
        header, comma, payload = uri.partition(",")
        try:
            if not comma:
                raise binascii.Error("no content")
            if not header.endswith(";base64"):
                return unquote_to_bytes(payload)
            return base64.b64decode("".join(payload.split()), validate=True)
        except binascii.Error:
            raise ConfigError(
                f"{self.model}: {element} has a data URI that is not valid base64; export the model again, as .glb"
            ) from None
