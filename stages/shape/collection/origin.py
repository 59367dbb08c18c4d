"""What a dataset was made from, and whose it is: files with their authors, sources and licences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pydantic import Field

from pipeline.config import StrictModel


class Credit(StrictModel):
    """Whose a file is. What is not said here is asked for by name in the report and in the card."""

    author: str = Field("", description="Who made it, such as Jane Doe.")
    source: str = Field("", description="Where it comes from, a URL.")
    license: str = Field("", description="Its licence, as an SPDX id such as CC-BY-4.0.")
    notice: str = Field(
        "", description="What the licence asks to be said, such as Copyright (c) 2023 Jane Doe, word by word."
    )


@dataclass(frozen=True)
class Origin:
    """One file that samples were made from.

    kit: the kit or category that it is of; file: its name and its folder's; sha256: of its bytes;
    author, source, license, notice: as in `Credit`, empty where nobody has said; key: of the config that says it.
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
    """A sentence for each file whose licence nobody has stated, with the key that does."""
    return [
        f"licence of {origin.file}: not stated; say it with {origin.key}: {{license: ..., author: ..., source: ...}}"
        for origin in origins
        if not origin.license
    ]
