"""A scene whose placements are the pieces that its symmetries cut it into."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from stages.exemplars.formats.scene import ModelScene, Placement, Surface
from stages.shape.arrays import ByteArray, FloatArray, IntArray
from stages.shape.geometry.pose import transform_points
from stages.symmetry.pieces import RADIUS, SurfacePiece, repeated_pieces
from stages.symmetry.sections.slabs import slab_pieces
from stages.symmetry.surface.grid import estimate_grid_size, has_area
from stages.symmetry.surface.soup import Soup
from stages.symmetry.surface.welding import weld

LEFT_OUT = 1e-5
"""Share of the surface from which on it is told that it is left out."""
STRAINED = 0.02
"""Share of the surface of what runs along a row from which on it is told that one copy stands for others."""


def cut_by_symmetry(scene: ModelScene) -> ModelScene:
    """The scene as one mesh in the world, cut into `repeated_pieces`: a surface for each of them, `piece-00` and so on,
    with a placement for each of its poses. Triangles without area are left out, with a warning that counts them; where
    there are no others, the scene stays as it is."""
    return _parted(scene, repeated_pieces)


def cut_by_sections(scene: ModelScene) -> ModelScene:
    """The scene as one mesh in the world, cut into `slab_pieces`; as `cut_by_symmetry`."""
    return _parted(scene, slab_pieces)


def _parted(scene: ModelScene, pieces_of: Callable[[FloatArray, IntArray], list[SurfacePiece]]) -> ModelScene:
    vertices, joined = _in_the_world(scene)
    real = has_area(vertices[joined])
    if not real.any():
        return scene
    colors = np.concatenate([scene.surfaces[placement.surface].face_colors for placement in scene.placements])
    pieces = pieces_of(vertices, joined)
    width = max(2, len(str(len(pieces))))
    surfaces: list[Surface] = []
    placements: list[Placement] = []
    for number, piece in enumerate(pieces):
        name = f"piece-{number:0{width}d}"
        surfaces.append(_surface(name, piece, colors))
        placements += [Placement(f"{name}.{copy}", None, number, pose) for copy, pose in enumerate(piece.poses)]
    flat = len(joined) - int(real.sum())
    warnings = (*scene.warnings, f"{flat} triangles without area are left out") if flat else scene.warnings
    whole = float(Soup(vertices[joined], np.arange(len(joined), dtype=np.int32)).area)
    left = 1.0 - sum(len(each.poses) * each.triangles.area for each in pieces) / whole
    if left > LEFT_OUT:
        warnings = (*warnings, f"splinters between copies, {left:.2%} of the surface, are left out")
    strained = max(each.strained for each in pieces)
    if strained > STRAINED:
        warnings = (*warnings, f"what runs along a row is alike at all its copies now; it differed by {strained:.0%}")
    return replace(scene, kind="nodes", surfaces=tuple(surfaces), placements=tuple(placements), warnings=warnings)


def search_size(scene: ModelScene) -> int:
    """How large a search for symmetries of the scene would be: `estimate_grid_size`."""
    vertices, faces = _in_the_world(scene)
    return estimate_grid_size(vertices[faces], RADIUS)


def _in_the_world(scene: ModelScene) -> tuple[FloatArray, IntArray]:
    """All surfaces where they are placed, as one mesh: vertices float64 (v, 3), faces int32 (f, 3)."""
    moved = [
        transform_points(placement.pose, scene.surfaces[placement.surface].vertices) for placement in scene.placements
    ]
    shifts = np.cumsum([0, *map(len, moved[:-1])])
    own = [scene.surfaces[placement.surface] for placement in scene.placements]
    turned = [np.linalg.det(placement.pose[:3, :3]) < 0 for placement in scene.placements]
    faces = [
        (each.faces[:, ::-1] if mirrored else each.faces) + shift
        for each, shift, mirrored in zip(own, shifts, turned, strict=True)
    ]
    return np.concatenate(moved), np.concatenate(faces).astype(np.int32)


def _surface(name: str, piece: SurfacePiece, colors: ByteArray) -> Surface:
    """The surface of a piece, corners at one position one vertex."""
    places, vertices = weld(piece.triangles.corners, 0.0)
    return Surface(name, vertices, places, colors[piece.triangles.faces])
