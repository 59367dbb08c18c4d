from __future__ import annotations

import numpy as np
import pytest

from stages.shapeassembly.extraction.hierarchy import PartNode
from stages.shapeassembly.extraction.shortening import shorten_parts
from tests.stages.shapeassembly.extraction.shapes import leaf, node, turned


def shortened(*parts: PartNode) -> dict[str, PartNode]:
    return {part.label: part for part in shorten_parts(node("root", parts)).leaves()}


def test_leg_that_is_sunk_in_the_top_is_cut_to_its_underside() -> None:
    parts = shortened(leaf("top", (0, 1, 0), (2, 0.2, 2)), leaf("leg", (0.8, 0.5, 0.8), (0.1, 1.0, 0.1)))
    assert parts["leg"].box.size.tolist() == pytest.approx([0.1, 0.9, 0.1])
    assert parts["leg"].box.center.tolist() == pytest.approx([0.8, 0.45, 0.8])
    assert parts["top"].box.size.tolist() == [2, 0.2, 2]


def test_bar_through_two_posts_is_cut_at_both() -> None:
    posts = [leaf(name, (x, 0, 0), (0.2, 2, 0.2)) for name, x in (("left", -1), ("right", 1))]
    bar = shortened(*posts, leaf("bar", (0, 0, 0), (2.1, 0.1, 0.1)))["bar"].box
    assert bar.size.tolist() == pytest.approx([1.8, 0.1, 0.1])
    assert bar.center.tolist() == pytest.approx([0, 0, 0])


@pytest.mark.parametrize(
    "part",
    [
        leaf("part", (0, 1, 0), (0.1, 0.1, 0.1)),
        leaf("part", (0, 1, 0), (2, 0.2, 2)),
        leaf("part", (0, 0.4, 0), (0.1, 1.0, 0.1)),
        leaf("part", (1.0, 0.5, 0), (0.1, 1.0, 0.1)),
    ],
    ids=["hidden", "coincident", "touching", "half outside"],
)
def test_hidden_parts_and_visible_ends_are_not_cut(part: PartNode) -> None:
    box = shortened(leaf("top", (0, 1, 0), (2, 0.2, 2)), part)["part"].box
    np.testing.assert_allclose(box.size, part.box.size)
    np.testing.assert_allclose(box.center, part.box.center)


def test_tilted_leg_is_cut_no_further_than_its_first_corner_shows() -> None:
    leg = leaf("leg", (0, 0.5, 0), (0.1, 1.0, 0.1), turned(0, 20))
    cut = shortened(leaf("top", (0, 1.0, 0), (4, 0.5, 4)), leg)["leg"].box
    top = cut.center[1] + abs(cut.axes[:, 1]) @ cut.size / 2
    lowest_of_end = top - 0.1 * np.sin(np.radians(20))
    assert lowest_of_end == pytest.approx(0.75, abs=1e-9)


def test_order_of_the_file_does_not_matter() -> None:
    parts = [
        leaf("top", (0, 1, 0), (2, 0.2, 2)),
        leaf("a", (0, 0.5, 0), (0.3, 1, 0.3)),
        leaf("b", (0, 0.6, 0), (0.1, 1, 0.1)),
    ]
    forward, backward = shortened(*parts), shortened(*parts[::-1])
    for name, part in forward.items():
        np.testing.assert_array_equal(part.box.size, backward[name].box.size)
