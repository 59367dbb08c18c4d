"""What stage `strings` adds to every sample that is a shape graph: its text."""

from __future__ import annotations

from stages.shape.collection.members import TEXT, Member, Members

__all__ = ["MEMBERS"]

MEMBERS = Members(of=lambda _: (Member(TEXT, "The shape as text."),))
