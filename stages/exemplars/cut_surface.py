"""A scene whose surface is cut into the pieces that its symmetries or its sections make."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from stages.model_files.scene import ModelScene, Placement, Surface
from stages.shape.appearance import Appearance, barycentric, joined_appearance
from stages.shape.arrays import ByteArray, FloatArray, IntArray
from stages.shape.geometry.pose import transform_points
from stages.symmetry.pieces import RADIUS_SHARE, SurfacePiece, repeated_pieces
from stages.symmetry.sections.slabs import slab_pieces
from stages.symmetry.surface.grid import estimate_grid_size, has_area
from stages.symmetry.surface.soup import Soup
from stages.symmetry.surface.welding import weld

MIN_WARNED_LOSS = 1e-5
"""A warning tells if a larger share of the surface is left out."""
MIN_WARNED_STRAIN = 0.02
"""A warning tells if chunks along a row that are made equal differed by a larger share."""


def cut_by_symmetry(scene: ModelScene) -> ModelScene:
    """Cut a scene, as one mesh in world coordinates, into repeated pieces.

    Each piece is a surface, `piece-00` and so on, with a placement for each of its poses. Triangles without area are
    left out, with a warning that counts them; a scene of such triangles alone stays as it is.
    """
    return _cut(scene, repeated_pieces)


def cut_by_sections(scene: ModelScene) -> ModelScene:
    """Cut a scene, as one mesh in world coordinates, into pieces of slabs; otherwise like `cut_by_symmetry`."""
    return _cut(scene, slab_pieces)


def search_size(scene: ModelScene) -> int:
    """Estimate the size of a search for symmetries of the scene: triangles and cells."""
    vertices, faces = _world_mesh(scene)
    return estimate_grid_size(vertices[faces], RADIUS_SHARE)


def _cut(scene: ModelScene, pieces_of: Callable[[FloatArray, IntArray], list[SurfacePiece]]) -> ModelScene:
    vertices, faces = _world_mesh(scene)
    real = has_area(vertices[faces])
    if not real.any():
        return scene
    colors = np.concatenate([scene.surfaces[placement.surface].face_colors for placement in scene.placements])
    look = _world_look(scene)
    pieces = pieces_of(vertices, faces)
    width = max(2, len(str(len(pieces))))
    surfaces: list[Surface] = []
    placements: list[Placement] = []
    for number, piece in enumerate(pieces):
        name = f"piece-{number:0{width}d}"
        surfaces.append(_surface(name, piece, colors, look, vertices[faces]))
        placements += [Placement(f"{name}.{copy}", None, number, pose) for copy, pose in enumerate(piece.poses)]
    flat = len(faces) - int(real.sum())
    warnings = (*scene.warnings, f"{flat} triangles without area are left out") if flat else scene.warnings
    whole = float(Soup(vertices[faces], np.arange(len(faces), dtype=np.int32)).area)
    lost = 1.0 - sum(len(piece.poses) * piece.triangles.area for piece in pieces) / whole
    if lost > MIN_WARNED_LOSS:
        warnings = (*warnings, f"splinters between copies, {lost:.2%} of the surface, are left out")
    strain = max(piece.strain for piece in pieces)
    if strain > MIN_WARNED_STRAIN:
        warnings = (*warnings, f"what runs along a row was made equal at its copies; it differed by {strain:.0%}")
    return replace(scene, kind="nodes", surfaces=tuple(surfaces), placements=tuple(placements), warnings=warnings)


def _world_mesh(scene: ModelScene) -> tuple[FloatArray, IntArray]:
    """Return all placed surfaces as one mesh in world coordinates: vertices float64 (v, 3), faces int32 (f, 3)."""
    surfaces = [scene.surfaces[placement.surface] for placement in scene.placements]
    moved = [
        transform_points(placement.pose, surface.vertices)
        for placement, surface in zip(scene.placements, surfaces, strict=True)
    ]
    shifts = np.cumsum([0, *map(len, moved[:-1])])
    mirrored = [np.linalg.det(placement.pose[:3, :3]) < 0 for placement in scene.placements]
    faces = [
        (surface.faces[:, ::-1] if is_mirrored else surface.faces) + shift
        for surface, shift, is_mirrored in zip(surfaces, shifts, mirrored, strict=True)
    ]
    return np.concatenate(moved), np.concatenate(faces).astype(np.int32)


def _world_look(scene: ModelScene) -> Appearance | None:
    """Return the look of the faces of `_world_mesh`."""
    looks: list[Appearance | None] = []
    for placement in scene.placements:
        look, linear = scene.surfaces[placement.surface].appearance, placement.pose[:3, :3]
        if look is not None:
            look = look.turned(linear).mirrored() if np.linalg.det(linear) < 0 else look.turned(linear)
        looks.append(look)
    return joined_appearance(looks, [len(scene.surfaces[placement.surface].faces) for placement in scene.placements])


def _surface(
    name: str, piece: SurfacePiece, colors: ByteArray, look: Appearance | None, corners: FloatArray
) -> Surface:
    """Return the surface of a piece, with corners at equal positions welded.

    colors, look: of the faces of the whole mesh, whose corners are `corners` (f, 3, 3)
    """
    soup = piece.triangles
    indices, vertices = weld(soup.corners, 0.0)
    if look is not None:
        look = look.interpolated(soup.faces, barycentric(corners[soup.faces], soup.corners))
    return Surface(name, vertices, indices, colors[soup.faces], appearance=look)
