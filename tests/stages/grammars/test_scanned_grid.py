"""Scans of a wall have its planes, symmetries and docking sites; clouds that are no scans are rejected."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from pipeline.errors import ConfigError
from stages.grammars.extraction.docked_pieces import find_docked_pieces
from stages.grammars.scans.planar_patches import planar_patches
from stages.grammars.scans.point_neighbourhoods import point_neighbourhoods
from stages.grammars.scans.ridge_frames import ridge_frames
from stages.grammars.scans.scanned_grid import ScannedCloud, ScannedGrid, required_points, scanned_grid, suitable_radius
from stages.shape.arrays import FloatArray
from stages.symmetry.matching.candidate_transforms import candidate_transforms
from stages.symmetry.matching.r_symmetry import erode_cells, symmetric_cells
from stages.symmetry.surface.grid import surface_grid
from tests.stages.grammars.scanned import scanned
from tests.stages.symmetry.planted import screw, wall

RADIUS_SHARE = 0.04
CELL_SIZE = RADIUS_SHARE * 5.2 / 4
"""Width of a cell of a wall of four windows."""


def cloud_of(triangles: FloatArray, noise: float = 0.1, count: int = 40_000, normals: bool = False) -> ScannedCloud:
    """Return a scan with noise of a standard deviation in cells, and six holes."""
    points, outward = scanned(triangles, count, noise * CELL_SIZE, 6, 1.5 * CELL_SIZE, np.random.default_rng(0))
    return ScannedCloud(points, np.full((len(points), 3), 160, np.uint8), outward if normals else None)


@pytest.fixture(scope="module")
def scan() -> ScannedGrid:
    return scanned_grid(cloud_of(wall(4)), RADIUS_SHARE)


def test_noise_is_estimated_and_removed(scan: ScannedGrid) -> None:
    assert 0.09 < scan.noise / CELL_SIZE < 0.11
    flat = np.abs(scan.normals[:, 1]) > 0.99
    off = np.abs(scan.middles[flat, 1] - np.where(scan.normals[flat, 1] > 0, 0.3, 0.0))
    assert off.max() < 0.02 * CELL_SIZE


def test_faces_of_the_wall_are_one_patch_per_face(scan: ScannedGrid) -> None:
    assert len(scan.normals) == 6 + 4 * 4
    assert (np.abs(scan.normals).max(axis=1) > np.cos(0.02)).all()


@pytest.mark.parametrize("normals", [True, False])
def test_normals_are_outward_whether_or_not_the_scanner_knows_them(normals: bool) -> None:
    cloud = cloud_of(wall(4), normals=normals)
    found = planar_patches(cloud.points, point_neighbourhoods(cloud.points), 0.1 * CELL_SIZE, cloud.normals)
    truth = cloud_of(wall(4), normals=True).normals
    held = found.of >= 0
    assert truth is not None
    assert ((found.normals[found.of[held]] * truth[held]).sum(axis=1) > 0.9).mean() > 0.97


def test_cells_are_those_of_the_mesh_except_in_holes(scan: ScannedGrid) -> None:
    exact = surface_grid(wall(4), RADIUS_SHARE)
    assert 0.95 < len(scan.grid) / len(exact) < 1.01
    assert len(scan.grid.faces) > 0.98 * len(cloud_of(wall(4)).points)


def test_symmetries_of_the_wall_are_found_despite_noise_and_holes(scan: ScannedGrid) -> None:
    transforms = candidate_transforms(scan.grid, 24, np.eye(3)[2], ridge_frames(scan))
    for shift in (1.0, 2.0, 3.0):
        wanted = np.eye(4)
        wanted[0, 3] = shift
        off = [np.abs(candidate - wanted).max() for candidate in transforms]
        assert min(off) < 0.1 * CELL_SIZE
        # as much is symmetric as of the mesh
        exact = surface_grid(wall(4), RADIUS_SHARE)
        shares = []
        for grid, transform in ((scan.grid, transforms[int(np.argmin(off))]), (exact, wanted)):
            kept = erode_cells(grid, symmetric_cells(grid, transform)[0])
            shares.append(grid.area[kept].sum() / grid.area.sum())
        assert shares[0] == pytest.approx(shares[1], abs=0.03)


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.2])
def test_docking_sites_are_those_of_the_mesh(noise: float) -> None:
    found = scanned_grid(cloud_of(wall(4), noise, 50_000), RADIUS_SHARE)
    transforms = candidate_transforms(found.grid, 24, np.eye(3)[2], ridge_frames(found))
    assert Counter(piece.site for piece in find_docked_pieces(found.grid, transforms)) == {0: 8}


def test_scan_may_have_any_pose() -> None:
    pose = screw(0.7, 300.0)
    cloud = cloud_of(wall(4))
    turned = ScannedCloud(cloud.points @ pose[:3, :3].T + pose[:3, 3], cloud.colors)
    found = scanned_grid(turned, RADIUS_SHARE * 5.2 / np.ptp(turned.points, axis=0).max())
    transforms = candidate_transforms(found.grid, 24, np.eye(3)[2], ridge_frames(found))
    wanted = np.eye(4)
    wanted[:3, 3] = pose[:3, :3] @ [1.0, 0.0, 0.0]
    off = [np.abs(known - wanted) for known in transforms]
    assert min(difference[:3, 3].max() + difference[:3, :3].max() for difference in off) < CELL_SIZE / 2


def test_surface_opposite_a_large_hole_is_not_symmetric() -> None:
    """Surface that is missing in small holes counts neither for nor against a symmetry; in large ones it counts."""
    cloud = cloud_of(wall(4))
    blind = np.abs(cloud.points - (1.6, 0.0, 1.0)).max(axis=1) < 0.25
    partial = scanned_grid(ScannedCloud(cloud.points[~blind], cloud.colors[~blind]), RADIUS_SHARE)
    transform = np.eye(4)
    transform[0, 3] = 1.0
    kept = erode_cells(partial.grid, symmetric_cells(partial.grid, transform)[0])
    middle = partial.grid.origin + (partial.grid.cells + 0.5) * partial.grid.cell_size
    onto = np.abs(middle - (0.6, 0.0, 1.0)).max(axis=1) < 0.15
    assert onto.any()
    assert not kept[onto].any()


def test_plane_and_ball_have_no_candidates() -> None:
    """Nothing in them can be exchanged, because they have no corners."""
    flat = np.random.default_rng(0).random((9000, 3)) * (1.0, 0.0, 1.0)
    ball = np.random.default_rng(0).normal(size=(9000, 3))
    for points in (flat, ball / np.linalg.norm(ball, axis=1)[:, None]):
        found = scanned_grid(ScannedCloud(points, np.zeros((len(points), 3), np.uint8)), 0.1)
        assert len(candidate_transforms(found.grid, 24, None, ridge_frames(found))) == 0


def test_finer_radius_requires_more_points() -> None:
    thin, dense, noisy = cloud_of(wall(4), 0.0, 10_000), cloud_of(wall(4), 0.0, 40_000), cloud_of(wall(4), 0.6, 10_000)
    assert suitable_radius(dense, 0.0) == pytest.approx(suitable_radius(thin, 0.0) / 2, rel=0.1)
    assert required_points(thin, suitable_radius(dense, 0.0)) == pytest.approx(40_000, rel=0.2)
    assert required_points(noisy, 0.01) is None


class TestRejected:
    @pytest.mark.parametrize(
        ("points", "why"),
        [
            (np.zeros((0, 3)), "0 points are no scan"),
            (np.random.default_rng(0).random((40, 3)), "40 points are no scan"),
            (np.linspace(0, 1, 900)[:, None] * [1.0, 2.0, 3.0], "lie on one line"),
            (np.ones((900, 3)), "lie on one line"),
            (np.random.default_rng(0).random((20, 3)).repeat(50, axis=0), "at the position of another"),
            (np.r_[np.random.default_rng(0).random((900, 3)), [[np.nan, 0, 0]]], "1 of 901 points are not finite"),
        ],
        ids=["none", "few", "line", "one place", "few places", "nan"],
    )
    def test_points_that_are_no_surface(self, points: FloatArray, why: str) -> None:
        with pytest.raises(ConfigError, match=why):
            scanned_grid(ScannedCloud(points, np.zeros((len(points), 3), np.uint8)), RADIUS_SHARE)

    def test_thin_scan_with_the_radius_that_would_work(self) -> None:
        with pytest.raises(
            ConfigError, match=r"too few for a radius of 0.01: 0.1 in a cell.*; set radius to at least 0.039"
        ):
            scanned_grid(cloud_of(wall(4), 0.05, 20_000), 0.01)

    def test_noise_too_large_for_cells(self) -> None:
        with pytest.raises(ConfigError, match="off the surface in the mean"):
            scanned_grid(cloud_of(wall(4), 1.0), RADIUS_SHARE)
