from __future__ import annotations

import numpy as np
import pytest

from stages.grammars.terminal_samples import facing_direction, sample_mesh
from stages.grammars.voxel_signature import VoxelSignature, difference, voxel_signature
from stages.shape.kit import PartMesh
from tests.stages.symmetry.planted import blocks, box, mesh, moved, screw, wall

SIMILARITY_RADIUS = 0.15


def signature(triangles: np.ndarray) -> VoxelSignature:
    vertices, faces = mesh(triangles)
    part = PartMesh("wall", vertices, faces, np.full((len(faces), 3), 160, np.uint8))
    low, high = part.bounds
    return voxel_signature([(sample_mesh(part, SIMILARITY_RADIUS / 4), np.eye(4))], low, high, SIMILARITY_RADIUS)


def window(at: float, ticks: tuple[float, ...] = ()) -> np.ndarray:
    """Return a wall of 6 by 2.4 with one window, cut at ticks."""
    x = sorted([0.0, at, at + 0.5, 6.0, *ticks])
    return blocks(x, [0.0, 0.3], [0.0, 0.5, 1.5, 2.4], lambda a, _, c: not (at < a < at + 0.5 and 0.5 < c < 1.5))


def test_signature_depends_on_neither_cuts_nor_position() -> None:
    cut, aside = window(1.0, (0.37, 2.2, 4.9)), np.eye(4)
    aside[:3, 3] = (3.3, -1.7, 0.2)
    assert difference(signature(window(1.0)), signature(cut)) == 0.0
    assert difference(signature(window(1.0)), signature(moved(cut, aside))) == pytest.approx(0.0, abs=0.01)


def test_moves_within_the_radius_make_no_difference() -> None:
    assert difference(signature(window(1.0)), signature(window(1.0 + 0.9 * SIMILARITY_RADIUS))) == 0.0
    assert difference(signature(window(1.0)), signature(window(3.0))) > 0.02


def test_difference_is_the_larger_of_both_missing_shares() -> None:
    plain, more = (
        signature(box((0, 0, 0), (2, 1, 1))),
        signature(np.concatenate([box((0, 0, 0), (2, 1, 1)), box((3, 0, 0), (5, 1, 1))])),
    )
    assert difference(plain, more) == difference(more, plain)
    assert difference(plain, more) == pytest.approx(0.5, abs=0.05)


def test_longer_wall_differs_by_the_added_bay() -> None:
    """Walls of four and five windows are aligned at the end that stays, and differ by one bay."""
    bay = (2 * (2.4 - 0.5) + 0.3 * 5) / 35.4
    for turn in (np.eye(4), screw(np.pi, 0.0)):
        assert difference(signature(wall(4)), signature(moved(wall(5), turn))) == pytest.approx(bay, abs=0.05)


def test_facing_between_two_axes_does_not_depend_on_rounding() -> None:
    level = np.sqrt(0.5)
    normals = np.array([[level, level, 0], [level + 1e-15, level - 1e-15, 0], [-level, 0, -level - 1e-15]])
    assert facing_direction(normals).tolist() == [1, 1, 5]
