"""Parallel planes with equal sections cut a mesh into slabs, with everything that passes there."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from stages.exemplars.read import parse_parts
from stages.exemplars.segmentation import segment_scene
from stages.model_files.limits import ReadLimits
from stages.symmetry.sections.parallel_cuts import find_parallel_cuts
from stages.symmetry.sections.slabs import slab_pieces
from tests.stages.symmetry.planted import area as surface_area
from tests.stages.symmetry.planted import blocks, box, mesh, one_object, wall

CRANE = Path(__file__).resolve().parents[4] / "shared/exemplars/u04_tower_crane/model.glb"


def truss(bays: int) -> np.ndarray:
    """Return plates on a beam, one per unit, that lean so far that no plane fits between them."""
    plates = []
    for bay in range(bays):
        plate = box((bay, 0.0, 0.0), (bay + 0.2, 0.4, 1.0))
        plate[..., 0] += 1.5 * plate[..., 2]
        plates.append(plate)
    return np.concatenate([box((-0.5, 0.0, -0.2), (bays + 1.5, 0.4, 0.05)), *plates])


def tetrahedron() -> np.ndarray:
    """Return a block without two equal sections."""
    corners = np.array([[0.0, 0.1, 0.2], [3.0, 0.5, 0.0], [1.0, 2.0, 0.3], [1.2, 0.9, 1.7]])
    return corners[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]]


class TestCuts:
    def test_recurring_stretches_have_a_joint(self) -> None:
        """A wall has six plain stretches between its windows, and five at its windows."""
        family = next(cuts for cuts in find_parallel_cuts(wall(5)) if cuts.normal[0] == 1)
        assert family.planes == 11
        begin, end = family.offsets[::2], family.offsets[1::2]
        assert np.allclose(end - begin, 0.25, atol=1e-4)
        assert np.allclose((begin + end)[1:10] / 2, np.arange(1.1, 5.6, 0.5), atol=1e-4)

    def test_a_row_without_a_plane_between_its_bays_is_found_by_its_shift(self) -> None:
        family = next(cuts for cuts in find_parallel_cuts(truss(8)) if cuts.normal[0] == 1)
        assert np.allclose(np.diff(family.offsets), 1.0)
        assert family.planes >= 6

    def test_block_without_equal_sections_has_no_cuts(self) -> None:
        assert find_parallel_cuts(tetrahedron()) == []


class TestSlabs:
    def test_equal_bays_are_one_piece_and_all_pieces_make_the_surface(self) -> None:
        pieces = slab_pieces(*mesh(truss(8)))
        assert max(len(piece.poses) for piece in pieces) >= 5
        area = sum(len(piece.poses) * piece.triangles.area for piece in pieces)
        corners = truss(8)
        assert area == pytest.approx(surface_area(corners), rel=1e-6)

    def test_beam_through_all_bays_is_cut_with_them(self) -> None:
        """No piece is longer than a bay, although the beam is as long as the row."""
        pieces = slab_pieces(*mesh(truss(8)))
        bays = max(pieces, key=lambda piece: len(piece.poses))
        assert np.ptp(bays.triangles.corners[..., 0]) == pytest.approx(1.0)

    def test_different_windows_lie_between_equal_joints(self) -> None:
        x = [0.0, 1.0, 1.6, 2.6, 3.5, 4.5, 4.8, 6.0]
        holes = ((1.0, 1.6), (2.6, 3.5), (4.5, 4.8))
        corners = blocks(
            x, [0.0, 0.3], [0.0, 0.5, 1.5, 2.0],
            lambda a, _, c: not (0.5 < c < 1.5 and any(low < a < high for low, high in holes)),
        )  # fmt: skip
        across = [cuts for cuts in find_parallel_cuts(corners) if cuts.normal[0] == 1]
        joints = across[0].offsets
        assert across[0].planes == 7
        assert np.allclose(joints[1::2] - joints[::2], [0.5, 0.15, 0.5, 0.15, 0.5, 0.15, 0.5], atol=1e-4)


class TestSegmentation:
    def test_beam_below_all_bays_is_cut_with_them(self) -> None:
        parted = segment_scene(one_object(truss(8)), "sections")
        assert np.bincount([placement.surface for placement in parted.placements]).max() >= 5

    def test_surface_without_equal_sections_stays_whole(self) -> None:
        assert len(segment_scene(one_object(tetrahedron()), "sections").placements) == 1


@pytest.mark.slow
@pytest.mark.skipif(not CRANE.is_file(), reason="no real exemplars next to this folder")
def test_a_real_mast_is_one_bay_twenty_one_times() -> None:
    """A shift that is slightly wrong hardly shows from bay to bay, but adds up until no bays are equal."""
    crane = parse_parts(CRANE, "sections", ReadLimits())
    assert max(Counter(part.mesh_name for part in crane.parts).values()) == 21
