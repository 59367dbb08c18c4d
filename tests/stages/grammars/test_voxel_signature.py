from __future__ import annotations

import numpy as np
import pytest

from stages.grammars.terminal_samples import facing_axis, sample_surface
from stages.grammars.voxel_signature import VoxelSignature, difference, voxel_signature
from stages.shape.kit import PartMesh
from tests.stages.symmetry.planted import blocks, box, mesh, moved, screw, wall

RADIUS = 0.15


def seen(triangles: np.ndarray) -> VoxelSignature:
    vertices, faces = mesh(triangles)
    part = PartMesh("wall", vertices, faces, np.full((len(faces), 3), 160, np.uint8))
    low, high = part.bounds
    return voxel_signature([(sample_surface(part, RADIUS / 4), np.eye(4))], low, high, RADIUS)


def window(at: float, ticks: tuple[float, ...] = ()) -> np.ndarray:
    """A wall of 6 by 2.4 with one window, cut at ticks."""
    x = sorted([0.0, at, at + 0.5, 6.0, *ticks])
    return blocks(x, [0.0, 0.3], [0.0, 0.5, 1.5, 2.4], lambda a, _, c: not (at < a < at + 0.5 and 0.5 < c < 1.5))


def test_a_surface_is_itself_however_it_is_cut_and_wherever_it_stands() -> None:
    cut, aside = window(1.0, (0.37, 2.2, 4.9)), np.eye(4)
    aside[:3, 3] = (3.3, -1.7, 0.2)
    assert difference(seen(window(1.0)), seen(cut)) == 0.0
    assert difference(seen(window(1.0)), seen(moved(cut, aside))) == pytest.approx(0.0, abs=0.01)


def test_what_moves_by_less_than_the_radius_has_not_moved() -> None:
    assert difference(seen(window(1.0)), seen(window(1.0 + 0.9 * RADIUS))) == 0.0
    assert difference(seen(window(1.0)), seen(window(3.0))) > 0.02


def test_of_two_shapes_the_share_of_the_one_that_has_more_counts_whichever_is_asked() -> None:
    plain, more = (
        seen(box((0, 0, 0), (2, 1, 1))),
        seen(np.concatenate([box((0, 0, 0), (2, 1, 1)), box((3, 0, 0), (5, 1, 1))])),
    )
    assert difference(plain, more) == difference(more, plain)
    assert difference(plain, more) == pytest.approx(0.5, abs=0.05)


def test_a_shape_that_grows_at_one_end_differs_by_what_has_come() -> None:
    """Laid on at the end that stays, whichever it is: a wall of five windows has a bay more than one of four."""
    bay = (2 * (2.4 - 0.5) + 0.3 * 5) / 35.4
    for turn in (np.eye(4), screw(np.pi, 0.0)):
        assert difference(seen(wall(4)), seen(moved(wall(5), turn))) == pytest.approx(bay, abs=0.05)


def test_what_faces_between_two_axes_faces_alike_whatever_rounding_does() -> None:
    level = np.sqrt(0.5)
    normals = np.array([[level, level, 0], [level + 1e-15, level - 1e-15, 0], [-level, 0, -level - 1e-15]])
    assert facing_axis(normals).tolist() == [1, 1, 5]
