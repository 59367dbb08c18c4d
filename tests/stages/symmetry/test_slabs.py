"""Parallel planes with like sections cut a mesh into slabs, with all that passes there."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from stages.exemplars.read import parse_model
from stages.exemplars.segmentation import segment_scene
from stages.exemplars.settings import ReadLimits
from stages.symmetry.sections.parallel_cuts import find_parallel_cuts
from stages.symmetry.sections.slabs import slab_pieces
from tests.stages.symmetry.planted import blocks, box, mesh, one_object, wall

CRANE = Path(__file__).resolve().parents[5] / "shared/exemplars/u04_tower_crane/model.glb"


def truss(bays: int) -> np.ndarray:
    """Plates that lean so far over each other that no plane stands between them, on a beam, a bay one unit long."""
    plates = []
    for bay in range(bays):
        plate = box((bay, 0.0, 0.0), (bay + 0.2, 0.4, 1.0))
        plate[..., 0] += 1.5 * plate[..., 2]
        plates.append(plate)
    return np.concatenate([box((-0.5, 0.0, -0.2), (bays + 1.5, 0.4, 0.05)), *plates])


def tetrahedron() -> np.ndarray:
    """A block of which no two sections are alike."""
    corners = np.array([[0.0, 0.1, 0.2], [3.0, 0.5, 0.0], [1.0, 2.0, 0.3], [1.2, 0.9, 1.7]])
    return corners[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]]


class TestCuts:
    def test_stretches_of_one_kind_get_a_joint_each(self) -> None:
        """Between its windows a wall is plain, six times, and it is at each of its five windows."""
        family = next(each for each in find_parallel_cuts(wall(5)) if each.way[0] == 1)
        assert family.planes == 11
        begin, end = family.offsets[::2], family.offsets[1::2]
        assert np.allclose(end - begin, 0.25, atol=1e-4)
        assert np.allclose((begin + end)[1:10] / 2, np.arange(1.1, 5.6, 0.5), atol=1e-4)

    def test_a_row_without_a_plane_between_its_bays_is_found_by_its_shift(self) -> None:
        family = next(each for each in find_parallel_cuts(truss(8)) if each.way[0] == 1)
        assert np.allclose(np.diff(family.offsets), 1.0)
        assert family.planes >= 6

    def test_a_lone_block_has_no_kind_of_section_twice(self) -> None:
        assert find_parallel_cuts(tetrahedron()) == []


class TestSlabs:
    def test_equal_bays_are_one_piece_and_all_pieces_make_the_surface(self) -> None:
        pieces = slab_pieces(*mesh(truss(8)))
        assert max(len(each.poses) for each in pieces) >= 5
        area = sum(len(each.poses) * each.triangles.area for each in pieces)
        corners = truss(8)
        ways = corners[:, 1:] - corners[:, :1]
        assert area == pytest.approx(np.linalg.norm(np.cross(ways[:, 0], ways[:, 1]), axis=1).sum() / 2, rel=1e-6)

    def test_what_runs_through_all_bays_is_cut_with_them(self) -> None:
        """No piece is longer than a bay, though the beam is as long as the row."""
        pieces = slab_pieces(*mesh(truss(8)))
        bays = max(pieces, key=lambda each: len(each.poses))
        assert np.ptp(bays.triangles.corners[..., 0]) == pytest.approx(1.0)

    def test_windows_that_differ_stand_between_equal_joints(self) -> None:
        x = [0.0, 1.0, 1.6, 2.6, 3.5, 4.5, 4.8, 6.0]
        holes = ((1.0, 1.6), (2.6, 3.5), (4.5, 4.8))
        corners = blocks(
            x, [0.0, 0.3], [0.0, 0.5, 1.5, 2.0],
            lambda a, _, c: not (0.5 < c < 1.5 and any(low < a < high for low, high in holes)),
        )  # fmt: skip
        across = [each for each in find_parallel_cuts(corners) if each.way[0] == 1]
        joints = across[0].offsets
        assert across[0].planes == 7
        assert np.allclose(joints[1::2] - joints[::2], [0.5, 0.15, 0.5, 0.15, 0.5, 0.15, 0.5], atol=1e-4)


class TestBridge:
    def test_a_beam_that_all_bays_stand_on_is_cut_with_them(self) -> None:
        parted = segment_scene(one_object(truss(8)), "sections")
        assert np.bincount([each.surface for each in parted.placements]).max() >= 5

    def test_what_has_no_like_sections_stays_whole(self) -> None:
        assert len(segment_scene(one_object(tetrahedron()), "sections").placements) == 1


@pytest.mark.slow
@pytest.mark.skipif(not CRANE.is_file(), reason="no real exemplars beside this folder")
def test_a_real_mast_is_one_bay_twenty_one_times() -> None:
    """A shift that is nearly that of its bays hardly shows from one to the next; it adds up, and no bays are equal."""
    crane = parse_model(CRANE, "sections", ReadLimits())
    assert max(Counter(each.mesh_name for each in crane.parts).values()) == 21
