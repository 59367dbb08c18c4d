"""Scans of a wall have the planes, motions and docking sites of the wall; what is no scan is refused."""

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

SHARE = 0.04
CELL = SHARE * 5.2 / 4
"""Of a wall of four windows."""


def cloud_of(triangles: FloatArray, noise: float = 0.1, count: int = 40_000, normals: bool = False) -> ScannedCloud:
    """A scan with so many cells of noise and six holes."""
    points, outward = scanned(triangles, count, noise * CELL, 6, 1.5 * CELL, np.random.default_rng(0))
    return ScannedCloud(points, np.full((len(points), 3), 160, np.uint8), outward if normals else None)


@pytest.fixture(scope="module")
def scan() -> ScannedGrid:
    return scanned_grid(cloud_of(wall(4)), SHARE)


def test_noise_is_estimated_and_taken_out(scan: ScannedGrid) -> None:
    assert 0.09 < scan.noise / CELL < 0.11
    flat = np.abs(scan.normals[:, 1]) > 0.99
    off = np.abs(scan.middles[flat, 1] - np.where(scan.normals[flat, 1] > 0, 0.3, 0.0))
    assert off.max() < 0.02 * CELL


def test_each_face_of_the_wall_is_one_patch(scan: ScannedGrid) -> None:
    assert len(scan.normals) == 6 + 4 * 4
    assert (np.abs(scan.normals).max(axis=1) > np.cos(0.02)).all()


@pytest.mark.parametrize("normals", [True, False])
def test_normals_are_outward_whether_or_not_the_scanner_knows_them(normals: bool) -> None:
    cloud = cloud_of(wall(4), normals=normals)
    found = planar_patches(cloud.points, point_neighbourhoods(cloud.points), 0.1 * CELL, cloud.normals)
    truth = cloud_of(wall(4), normals=True).normals
    held = found.of >= 0
    assert truth is not None
    assert ((found.normals[found.of[held]] * truth[held]).sum(axis=1) > 0.9).mean() > 0.97


def test_cells_are_those_of_the_mesh_but_for_holes(scan: ScannedGrid) -> None:
    exact = surface_grid(wall(4), SHARE)
    assert 0.95 < len(scan.grid) / len(exact) < 1.01
    assert len(scan.grid.faces) > 0.98 * len(cloud_of(wall(4)).points)


def test_motions_of_the_wall_are_found_in_spite_of_noise_and_holes(scan: ScannedGrid) -> None:
    motions = candidate_transforms(scan.grid, 24, np.eye(3)[2], ridge_frames(scan))
    for shift in (1.0, 2.0, 3.0):
        wanted = np.eye(4)
        wanted[0, 3] = shift
        off = [np.abs(each - wanted).max() for each in motions]
        assert min(off) < 0.1 * CELL
        # as much is symmetric as of the mesh
        exact = surface_grid(wall(4), SHARE)
        shares = []
        for grid, motion in ((scan.grid, motions[int(np.argmin(off))]), (exact, wanted)):
            kept = erode_cells(grid, symmetric_cells(grid, motion)[0])
            shares.append(grid.area[kept].sum() / grid.area.sum())
        assert shares[0] == pytest.approx(shares[1], abs=0.03)


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.2])
def test_docking_sites_are_those_of_the_mesh(noise: float) -> None:
    found = scanned_grid(cloud_of(wall(4), noise, 50_000), SHARE)
    motions = candidate_transforms(found.grid, 24, np.eye(3)[2], ridge_frames(found))
    assert Counter(each.site for each in find_docked_pieces(found.grid, motions)) == {0: 8}


def test_a_scan_may_stand_anywhere() -> None:
    pose = screw(0.7, 300.0)
    cloud = cloud_of(wall(4))
    turned = ScannedCloud(cloud.points @ pose[:3, :3].T + pose[:3, 3], cloud.colors)
    found = scanned_grid(turned, SHARE * 5.2 / np.ptp(turned.points, axis=0).max())
    motions = candidate_transforms(found.grid, 24, np.eye(3)[2], ridge_frames(found))
    way = pose[:3, :3] @ [1.0, 0.0, 0.0]
    assert min(np.abs(each[:3, 3] - way).max() + np.abs(each[:3, :3] - np.eye(3)).max() for each in motions) < CELL / 2


def test_what_a_hole_as_large_as_a_window_leaves_is_not_symmetric() -> None:
    """Surface that is missing in small holes counts neither for nor against; in large ones it counts."""
    cloud = cloud_of(wall(4))
    blind = np.abs(cloud.points - (1.6, 0.0, 1.0)).max(axis=1) < 0.25
    torn = scanned_grid(ScannedCloud(cloud.points[~blind], cloud.colors[~blind]), SHARE)
    motion = np.eye(4)
    motion[0, 3] = 1.0
    kept = erode_cells(torn.grid, symmetric_cells(torn.grid, motion)[0])
    middle = torn.grid.origin + (torn.grid.cells + 0.5) * torn.grid.cell_size
    onto = np.abs(middle - (0.6, 0.0, 1.0)).max(axis=1) < 0.15
    assert onto.any()
    assert not kept[onto].any()


def test_a_plane_and_a_ball_are_like_themselves_everywhere() -> None:
    """Nothing in them can be exchanged: they have no corners."""
    flat = np.random.default_rng(0).random((9000, 3)) * (1.0, 0.0, 1.0)
    ball = np.random.default_rng(0).normal(size=(9000, 3))
    for points in (flat, ball / np.linalg.norm(ball, axis=1)[:, None]):
        found = scanned_grid(ScannedCloud(points, np.zeros((len(points), 3), np.uint8)), 0.1)
        assert len(candidate_transforms(found.grid, 24, None, ridge_frames(found))) == 0


def test_how_many_points_a_finer_radius_takes() -> None:
    thin, dense, noisy = cloud_of(wall(4), 0.0, 10_000), cloud_of(wall(4), 0.0, 40_000), cloud_of(wall(4), 0.6, 10_000)
    assert suitable_radius(dense, 0.0) == pytest.approx(suitable_radius(thin, 0.0) / 2, rel=0.1)
    assert required_points(thin, suitable_radius(dense, 0.0)) == pytest.approx(40_000, rel=0.2)
    assert required_points(noisy, 0.01) is None


class TestRefused:
    @pytest.mark.parametrize(
        ("points", "why"),
        [
            (np.zeros((0, 3)), "0 points are no scan"),
            (np.random.default_rng(0).random((40, 3)), "40 points are no scan"),
            (np.linspace(0, 1, 900)[:, None] * [1.0, 2.0, 3.0], "lie on one line"),
            (np.ones((900, 3)), "lie on one line"),
            (np.random.default_rng(0).random((20, 3)).repeat(50, axis=0), "at the place of another"),
            (np.r_[np.random.default_rng(0).random((900, 3)), [[np.nan, 0, 0]]], "1 of 901 points are not finite"),
        ],
        ids=["none", "few", "line", "one place", "few places", "nan"],
    )
    def test_what_is_no_surface(self, points: FloatArray, why: str) -> None:
        with pytest.raises(ConfigError, match=why):
            scanned_grid(ScannedCloud(points, np.zeros((len(points), 3), np.uint8)), SHARE)

    def test_a_scan_too_thin_for_the_radius_with_the_radius_that_would_do(self) -> None:
        with pytest.raises(
            ConfigError, match=r"too few for a radius of 0.01: 0.1 in a cell.*; set radius to at least 0.039"
        ):
            scanned_grid(cloud_of(wall(4), 0.05, 20_000), 0.01)

    def test_noise_in_which_cells_see_nothing(self) -> None:
        with pytest.raises(ConfigError, match="off the surface in the mean"):
            scanned_grid(cloud_of(wall(4), 1.0), SHARE)
