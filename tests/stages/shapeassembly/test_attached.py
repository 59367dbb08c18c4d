"""Cuboids stand where they are attached, or are named."""

from __future__ import annotations

import pytest

from stages.shapeassembly import parse
from stages.shapeassembly.attached import coming_apart

SQUEEZED = """Assembly P {{ bbox = Cuboid(1.0, 1.0, 1.0, True) leg = Cuboid(0.1, {height}, 0.1, {aligned})
squeeze(leg, bbox, bbox, top, 0.2, 0.5) reflect(leg, X) }}"""


@pytest.mark.parametrize(("height", "aligned", "apart"), [(0.9, True, ["leg"]), (0.95, True, []), (0.5, False, [])])
def test_what_is_too_short_and_cannot_be_stretched_comes_apart(height: float, aligned: bool, apart: list[str]) -> None:
    """The diagonal of the box is 1.73: a leg may end 0.087 below its top."""
    assert coming_apart(parse(SQUEEZED.format(height=height, aligned=aligned)).root) == apart


def test_what_was_moved_away_from_an_attachment_comes_apart() -> None:
    text = """Assembly P { bbox = Cuboid(1.0, 1.0, 1.0, True) a = Cuboid(0.2, 0.2, 0.2, True)
    attach(a, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5) attach(a, bbox, 0.5, 1.0, 0.5, 0.5, 1.0, 0.5) }"""
    assert coming_apart(parse(text).root) == ["a"]
