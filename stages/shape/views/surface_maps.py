"""Normals, finish and emission that the textures of materials give to each sample of a picture.

Only sums, products, quotients and square roots are taken, in a fixed order, so all machines get the same digits.
"""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import Float32Array, FloatArray
from stages.shape.views.buffers import Visible
from stages.shape.views.mesh_look import MATT, NO_BEND, MeshLook, SurfaceMaps


def bent_normals(seen: Visible, maps: SurfaceMaps, rotations: FloatArray) -> tuple[np.ndarray, Float32Array]:
    """Return which samples have a normal texture, int64 (k,), rows of (h * w,), and their normals in eye space (k, 3).

    rotations: of each part to eye space, float64 (n, 3, 3)

    A texture bends the smooth normal towards where its coordinates grow, to the right and upwards in the image.
    """
    from stages.shape.views.pixel_normals import smooth_normals

    look, scene = maps.bends, seen.scene
    triangles = seen.triangles.ravel()
    rows = np.flatnonzero(triangles >= 0)
    if look is None:
        return rows[:0], np.empty((0, 3), np.float32)
    is_bent = np.array([*(look.texture >= 0), False])[look.face_material]
    rows = rows[is_bent[scene.triangle_face[triangles[rows]]]]
    triangle = triangles[rows]
    face, turn = scene.triangle_face[triangle], rotations[scene.triangle_part[triangle]]
    smooth = smooth_normals(seen, rotations).reshape(-1, 3)[rows].astype(np.float64)
    bend = _sampled(seen, look, NO_BEND).reshape(-1, 4)[rows].astype(np.float64)
    is_back = _dots(_turned(turn, scene.meshes.normals[face]), seen.normals[triangle]) < 0.0
    bent = bend[:, 2:3] * smooth
    for axis in range(2):
        way = _turned(turn, scene.meshes.frames[face, axis])
        way = _units(way - _dots(way, smooth)[:, None] * smooth)
        bent += np.where(is_back, -bend[:, axis], bend[:, axis])[:, None] * way
    return rows, _units(bent).astype(np.float32)


def surface_finish(seen: Visible, maps: SurfaceMaps) -> Float32Array:
    """Return the seen share of the sky, roughness, negative where matt, and metal of samples, float32 (h, w, 3)."""
    finish = np.empty((*seen.triangles.shape, 3), np.float32)
    finish[:] = MATT if maps.finish is None else _sampled(seen, maps.finish, MATT)[:, :, :3]
    finish[:, :, 0] = 1.0
    if maps.occlusion is not None:
        strength = maps.occlusion_strength[maps.occlusion.face_material][seen.scene.triangle_face[seen.triangles]]
        finish[:, :, 0] += strength * (_sampled(seen, maps.occlusion, (1.0, 1.0, 1.0))[:, :, 0] - 1.0)
    return finish


def emitted_light(seen: Visible, maps: SurfaceMaps) -> Float32Array:
    """Return the light that samples emit, linear, float32 (h, w, 3)."""
    if maps.emission is None:
        return np.zeros((*seen.triangles.shape, 3), np.float32)
    return _sampled(seen, maps.emission, (0.0, 0.0, 0.0))[:, :, :3]


def _sampled(seen: Visible, look: MeshLook, without: tuple[float, float, float]) -> Float32Array:
    """Return the numbers of a look at each sample, float32 (h, w, 4). without: of faces without a material"""
    from stages.shape.views.texels import sample_look

    face_colors = np.tile(np.array(without), (len(look.face_material), 1))
    return sample_look(seen.scene, seen.triangles, seen.screen, seen.view.projection, look, face_colors)


def _turned(turns: FloatArray, vectors: FloatArray) -> FloatArray:
    turned: FloatArray = (
        turns[:, :, 0] * vectors[:, :1] + turns[:, :, 1] * vectors[:, 1:2] + turns[:, :, 2] * vectors[:, 2:]
    )
    return turned


def _dots(a: FloatArray, b: FloatArray) -> FloatArray:
    dots: FloatArray = a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]
    return dots


def _units(vectors: FloatArray) -> FloatArray:
    """Return vectors (k, 3) of length 1; those of no length stay."""
    lengths = np.sqrt(_dots(vectors, vectors))[:, None]
    units: FloatArray = vectors / np.where(lengths > 0.0, lengths, 1.0)
    return units
