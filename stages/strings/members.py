"""What stage `strings` adds to every sample that is a shape graph: its text."""

from __future__ import annotations

from collections.abc import Iterator

from stages.shape.collection.declared import languages
from stages.shape.collection.members import TEXT, Member, Members
from stages.shape.collection.packaged import Packaged

__all__ = ["MEMBERS"]


def _faults(sample: Packaged) -> Iterator[str]:
    if languages()[sample.record["language"]].graphs:
        from stages.strings.faults import string_faults

        yield from string_faults(sample)


MEMBERS = Members(of=lambda _: (Member(TEXT, "The shape as text."),), faults=_faults)
