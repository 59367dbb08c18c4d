"""What a dataset was made from, and who owns it: files with their authors, sources and licences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pydantic import Field

from pipeline.config import StrictModel


class Credit(StrictModel):
    """Who owns a file. The report and the card name each missing entry."""

    author: str = Field("", description="Author, such as Jane Doe.")
    source: str = Field("", description="URL that the file comes from.")
    license: str = Field("", description="Its licence, as an SPDX id such as CC-BY-4.0.")
    notice: str = Field(
        "", description="Notice that the licence requires, word by word, such as Copyright (c) 2023 Jane Doe."
    )


@dataclass(frozen=True)
class Origin:
    """One file that samples were made from.

    kit: kit or category that it belongs to
    file: its name with that of its folder
    sha256: digest of its bytes
    author, source, license, notice: as in `Credit`, empty if missing
    key: config key that provides them
    """

    kit: str
    file: str
    sha256: str
    author: str
    source: str
    license: str
    notice: str
    key: str


def missing_licenses(origins: Sequence[Origin]) -> list[str]:
    """Return a sentence for each file without a licence, with the key that provides it."""
    return [
        f"licence of {origin.file}: not stated; say it with {origin.key}: {{license: ..., author: ..., source: ...}}"
        for origin in origins
        if not origin.license
    ]
