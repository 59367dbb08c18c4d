"""Attachment points of executed cuboids, and the points that they should meet."""

from __future__ import annotations

import numpy as np
import pytest

from stages.shapeassembly import parse
from stages.shapeassembly.execution.attachment_points import attachment_points, squeeze_attachments
from stages.shapeassembly.syntax.program import Squeeze

SQUEEZED = """Assembly P {{ bbox = Cuboid(1.0, 1.0, 1.0, True) leg = Cuboid(0.1, {height}, 0.1, {aligned})
squeeze(leg, bbox, bbox, top, 0.2, 0.5) reflect(leg, X) }}"""


@pytest.mark.parametrize(("height", "aligned", "gap"), [(0.96, True, 0.04), (0.5, True, 0.5), (0.5, False, 0.0)])
def test_an_aligned_cuboid_is_not_stretched(height: float, aligned: bool, gap: float) -> None:
    own, stands, wanted = attachment_points(parse(SQUEEZED.format(height=height, aligned=aligned)).root, "leg")
    assert own.tolist() == [[0.5, 1.0, 0.5], [0.5, 0.0, 0.5]]
    assert np.linalg.norm(stands - wanted, axis=1).max() == pytest.approx(gap, abs=1e-9)
    assert np.ptp(wanted[:, 1]) == 1.0


def test_attachment_points_cover_every_attachment_of_a_cuboid() -> None:
    text = """Assembly P { bbox = Cuboid(1.0, 1.0, 1.0, True) a = Cuboid(0.2, 0.2, 0.2, True)
    b = Cuboid(0.2, 0.2, 0.2, True)
    attach(a, bbox, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5) attach(b, a, 0.0, 0.5, 0.5, 1.0, 0.5, 0.5)
    attach(b, bbox, 0.5, 0.0, 0.5, 0.9, 0.0, 0.5) }"""
    block = parse(text).root
    own, stands, wanted = attachment_points(block, "b")
    assert own.tolist() == [[0.0, 0.5, 0.5], [0.5, 0.0, 0.5]]
    np.testing.assert_allclose(wanted, [[0.1, -0.4, 0.0], [0.4, -0.5, 0.0]], atol=1e-12)
    assert len(stands) == 2
    assert [len(point) for point in attachment_points(block, "bbox")] == [0, 0, 0]


def test_a_squeeze_is_two_attachments() -> None:
    """Opposite faces of a cuboid and of its neighbours, the same face of the bounding box."""
    first, second = squeeze_attachments(Squeeze("a", "bbox", "b", "left", 0.2, 0.7))
    assert (first.target, first.source, first.goal) == ("bbox", (0.0, 0.5, 0.5), (0.0, 0.2, 0.7))
    assert (second.target, second.source, second.goal) == ("b", (1.0, 0.5, 0.5), (0.0, 0.2, 0.7))
