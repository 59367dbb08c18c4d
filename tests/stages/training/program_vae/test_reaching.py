"""Cuboids that are written reach what they are attached to."""

from __future__ import annotations

import numpy as np
import pytest

from stages.training.program_vae.lines import ATTACH, SQUEEZE
from stages.training.program_vae.partial_assembly import LineNumbers, PartialAssembly
from stages.training.program_vae.reaching import MAX_GAP_SHARE, add_line, attachment_gap

BOTTOM = LineNumbers(np.array([0.5, 0.0, 0.5, 0.5, 0.0, 0.5]), 2, np.array([0.5, 0.5]), 0, 2, 0.5)
LEG = LineNumbers(np.zeros(6), 2, np.array([0.2, 0.5]), 0, 1, 0.0)


@pytest.mark.parametrize(
    ("height", "aligned", "written"), [(0.96, True, 1.0), (0.96, False, 0.96), (0.995, True, 0.995), (0.5, True, 1.0)]
)
def test_short_aligned_cuboid_is_resized_to_reach_its_attachments(height: float, aligned: bool, written: float) -> None:
    """What is not aligned is stretched where it is attached; a hundredth of the diagonal is no gap."""
    made = PartialAssembly((1.0, 1.0, 1.0))
    made.declare(np.array([0.1, height, 0.1]), aligned, None)
    assert add_line(made, (SQUEEZE, 1, 0, 0), LEG, reaching=True)
    assert made.sizes == [(0.1, written, 0.1)]
    assert attachment_gap(made, 1) <= MAX_GAP_SHARE


def test_line_that_leaves_a_gap_is_added_only_without_reaching() -> None:
    """Two attachments side by side, at the middle of the cuboid both: no size brings them together."""
    made = PartialAssembly((1.0, 1.0, 1.0))
    made.declare(np.array([0.2, 0.4, 1.0]), True, None)
    assert add_line(made, (ATTACH, 1, 0), BOTTOM, reaching=False)
    beside = LineNumbers(np.array([0.5, 1.0, 0.5, 0.8, 1.0, 0.5]), 2, np.zeros(2), 0, 1, 0.0)
    assert not add_line(made, (ATTACH, 1, 0), beside, reaching=True)
    assert made.lines[1:] == []
    assert add_line(made, (ATTACH, 1, 0), beside, reaching=False)
    assert attachment_gap(made, 1) > MAX_GAP_SHARE
    assert made.sizes[0] == (0.2, 1.0, 1.0), "it reaches the top, and not the side"
