"""Portraits: shaded pictures of shapes and of point clouds, for contact sheets, previews and the README."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numba
import numpy as np

from stages.shape.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from stages.shape.views.buffers import RendererName, Visible, visible_triangles
from stages.shape.views.camera import Camera, View
from stages.shape.views.light import KeyLight, eye_positions, ground_seen, key_light, openness, to_world
from stages.shape.views.palette import PAPER, label_colors, linear_to_srgb, srgb_to_linear
from stages.shape.views.scene import Scene, without_faces

INK = (38, 32, 36)
SUBPIXELS_PER_PIXEL = 2

KEY = np.array([1.0, 0.965, 0.90]) * 0.86
SKY = np.array([0.93, 0.97, 1.0]) * 0.50
GROUND = np.array([1.0, 0.95, 0.88]) * 0.26
SHADOW = np.array([0.56, 0.55, 0.60])
"""What a full shadow leaves of the paper, in linear light."""


def portrait(
    scene: Scene,
    camera: Camera,
    size: tuple[int, int],
    part_colors: ByteArray | None = None,
    renderer: RendererName = "raster",
) -> ByteArray:
    """Return a shaded picture of a scene, uint8 (height, width, 3).

    size: (width, height)
    part_colors: colour of each part instead of its faces' own, uint8 (n, 3)

    A soft key light from the upper left with shadows, sky and ground light, darker corners, thin lines where parts
    meet, and a shadow on the ground. Materials have their textures, bent normals, emission and alpha, unless
    `part_colors` are given; what is seen through is rasterised. Where textures leave nothing to see, such as part of a
    fine net, the scene is drawn without them. Raises ShardFailed for a blank picture.
    """
    from stages.shape.views.pixel_normals import smooth_normals
    from stages.shape.views.screen import surface_buffers
    from stages.shape.views.surface_maps import bent_normals, emitted_light
    from stages.shape.views.texels import has_holes, sample_colors

    width, height = size[0] * SUBPIXELS_PER_PIXEL, size[1] * SUBPIXELS_PER_PIXEL
    look = scene.meshes.look if part_colors is None else None
    maps = scene.meshes.maps if part_colors is None else None
    layers: list[tuple[IntArray, Float32Array]] = []
    through = _solid_and_layers(scene, camera, width, height) if look is not None and has_holes(scene) else None
    if through is not None:
        seen, layers = through
    else:
        if look is not None and has_holes(scene):
            look = maps = None
        seen = visible_triangles(scene, camera, (width, height), renderer)
    depth, _, part, color = surface_buffers(scene, seen.view, seen.triangles, seen.screen, seen.normals)
    normal = smooth_normals(seen)
    if maps is not None:
        rows, bent = bent_normals(seen, maps, (seen.view.eye @ scene.poses)[:, :3, :3])
        normal.reshape(-1, 3)[rows] = bent
    if part_colors is not None:
        color = np.where(part[..., None] >= 0, part_colors[part], color)
    opaque = scene
    if look is not None and look.is_blended.any() and not look.is_blended[scene.triangle_face].all():
        opaque = without_faces(scene, look.is_blended)
    light = key_light(opaque, camera.azimuth - 52.0, 52.0, renderer)
    shown = part >= 0
    picture = np.broadcast_to(srgb_to_linear(np.array(PAPER, dtype=np.uint8)), (height, width, 3)).copy()
    if camera.elevation > 0.0:
        pixels, left = _ground_light(scene, seen.view, light, shown)
        picture.reshape(-1, 3)[pixels] *= left
    positions = eye_positions(depth, seen.view)
    world = to_world(positions[shown], seen.view)
    upright = normal[shown] @ seen.view.eye[:3, :3]
    lit = np.clip(upright @ light.direction, 0.0, None) * light.reaches(world, 0.012 * seen.view.radius)[0]
    up = upright[:, 1 if scene.up == "y" else 2]
    sky = (0.5 + 0.5 * up)[:, None] * SKY + (0.5 - 0.5 * up)[:, None] * GROUND
    open_sky = openness(depth, normal, positions, seen.view, 0.10 * seen.view.radius)[shown][:, None]
    # Bright albedos are reduced a little, so that white models keep their shading.
    base = srgb_to_linear(color[shown])
    if look is not None:
        base = sample_colors(scene, seen.triangles, seen.screen, seen.view.projection)[shown, :3].astype(np.float64)
    albedo = 0.02 + 0.90 * base
    picture[shown] = albedo * (lit[:, None] * KEY * (0.35 + 0.65 * open_sky) + sky * open_sky)
    if maps is not None:
        picture[shown] += emitted_light(seen, maps)[shown]
    for triangles, colors in reversed(layers):
        _blend_layer(picture, replace(seen, triangles=triangles), colors, light)
    lines = _ink(seen, size)[..., None]
    picture = _reduced(picture) * (1.0 - lines) + srgb_to_linear(np.array(INK, dtype=np.uint8)) * lines
    return linear_to_srgb(picture)


def _solid_and_layers(
    scene: Scene, camera: Camera, width: int, height: int
) -> tuple[Visible, list[tuple[IntArray, Float32Array]]] | None:
    """Return what is seen of solid surfaces, and the layers of what is seen through, nearest first; None if textures
    leave nothing to see.
    """
    from stages.shape.views.layers import layered_moves
    from stages.shape.views.screen import project_triangles, screen_normals, screen_triangles
    from stages.shape.views.texels import see_through_layers, visible_solid

    view = camera.look(scene.points, scene.up, width / height)
    layered = project_triangles(scene, view, layered_moves(scene, view), width, height)
    screen = screen_triangles(scene, view, width, height)
    solid = visible_solid(scene, layered, width, height)
    layers = see_through_layers(scene, layered, screen, view.projection, solid)
    if solid.max() < 0 and not layers:
        return None
    return Visible(scene, view, solid, screen, screen_normals(scene, view, screen)), layers


def _blend_layer(picture: FloatArray, seen: Visible, colors: Float32Array, light: KeyLight) -> None:
    """Blend a layer of surfaces that are seen through into a picture in linear light, (h, w, 3)."""
    from stages.shape.views.pixel_normals import smooth_normals
    from stages.shape.views.screen import surface_buffers

    shown = seen.triangles >= 0
    depth, _, _, _ = surface_buffers(seen.scene, seen.view, seen.triangles, seen.screen, seen.normals)
    world = to_world(eye_positions(depth, seen.view)[shown], seen.view)
    upright = smooth_normals(seen)[shown] @ seen.view.eye[:3, :3]
    lit = np.clip(upright @ light.direction, 0.0, None) * light.reaches(world, 0.012 * seen.view.radius)[0]
    up = upright[:, 1 if seen.scene.up == "y" else 2]
    sky = (0.5 + 0.5 * up)[:, None] * SKY + (0.5 - 0.5 * up)[:, None] * GROUND
    alpha = colors[shown, 3:].astype(np.float64)
    own = (0.02 + 0.90 * colors[shown, :3]) * (lit[:, None] * KEY + sky)
    picture[shown] = alpha * own + (1.0 - alpha) * picture[shown]


def points_portrait(
    points: FloatArray,
    labels: IntArray,
    camera: Camera,
    size: tuple[int, int],
    up: Literal["y", "z"],
    paint: ByteArray | None = None,
) -> ByteArray:
    """Return points (n, 3) as small shaded balls coloured by `labels` (n,), uint8 (height, width, 3).

    size: (width, height)
    paint: colour of each label, uint8 (k, 3) sRGB; by default distinct colours

    More points make smaller balls. Raises ValueError for no points.
    """
    width, height = size[0] * SUBPIXELS_PER_PIXEL, size[1] * SUBPIXELS_PER_PIXEL
    view = camera.look(points, up, width / height)
    radius = 0.9 * view.radius / np.sqrt(len(points))
    local = points @ view.eye[:3, :3].T + view.eye[:3, 3]
    depth, normal, owner = _balls(local, radius, view.projection, width, height)
    shown = owner >= 0
    picture = np.broadcast_to(srgb_to_linear(np.array(PAPER, dtype=np.uint8)), (height, width, 3)).copy()
    upright = normal[shown] @ view.eye[:3, :3]
    above = upright[:, 1 if up == "y" else 2]
    lit = np.clip(normal[shown] @ np.array([-0.5, 0.68, 0.54]), 0.0, None)
    sky = (0.5 + 0.5 * above)[:, None] * SKY + (0.5 - 0.5 * above)[:, None] * GROUND
    open_sky = openness(depth, normal, eye_positions(depth, view), view, 0.10 * view.radius)[shown][:, None]
    colors = label_colors(int(labels.max()) + 1) if paint is None else paint
    albedo = srgb_to_linear(colors)[labels[owner[shown]]]
    picture[shown] = albedo * (lit[:, None] * KEY * 0.9 + 1.15 * sky) * (0.25 + 0.75 * open_sky)
    return linear_to_srgb(_reduced(picture))


def _ground_light(scene: Scene, view: View, light: KeyLight, hidden: BoolArray) -> tuple[IntArray, FloatArray]:
    """Return the pixels of ground in shadow, int64 (n,), and what is left of the light there, float64 (n, 3).

    hidden: pixels without ground, bool (h, w)
    """
    height, width = hidden.shape
    axis = 1 if scene.up == "y" else 2
    middle = (scene.points.min(axis=0) + scene.points.max(axis=0)) / 2
    pixels, points = ground_seen(~hidden, view, axis, float(scene.points[:, axis].min()), middle, 4.0 * view.radius)
    soft, wide = light.reaches(points, 0.05 * view.radius, 0.22 * view.radius)
    left = 0.6 * soft + 0.4 * wide
    pixels, left = pixels[left < 1.0], left[left < 1.0]
    # A shadow fades out at the border, so that pictures join without a seam.
    rows, columns = pixels // width + 0.5, pixels % width + 0.5
    edge = np.minimum(np.minimum(rows, height - rows), np.minimum(columns, width - columns))
    inside = np.clip(edge / (0.10 * min(height, width)), 0.0, 1.0)
    fade = inside**2 * (3.0 - 2.0 * inside)
    return pixels, 1.0 - ((1.0 - left) * fade)[:, None] * (1.0 - SHADOW)


def _ink(seen: Visible, size: tuple[int, int]) -> FloatArray:
    """Return thin lines over the picture, (height, width) 0..1."""
    from stages.shape.views.corner_normals import CREASE_ANGLE_DEGREES
    from stages.shape.views.ink import ink_strokes
    from stages.shape.views.strokes import BOUNDARY_LINE, CONTOUR_LINE, CREASE_LINE, OUTLINE_LINE, find_strokes

    strokes = find_strokes(seen, CREASE_ANGLE_DEGREES, 0.5 * SUBPIXELS_PER_PIXEL, 4.0 * SUBPIXELS_PER_PIXEL)
    widths = {OUTLINE_LINE: 1.1, CONTOUR_LINE: 0.9, BOUNDARY_LINE: 0.7, CREASE_LINE: 0.35}
    return 0.62 * ink_strokes(strokes, widths, size[0], size[1], 1.0 / SUBPIXELS_PER_PIXEL, 4.0)


def _reduced(picture: FloatArray) -> FloatArray:
    """Return the mean over each square of SUBPIXELS_PER_PIXEL pixels."""
    rows = np.zeros_like(picture[::SUBPIXELS_PER_PIXEL])
    total = np.zeros_like(rows[:, ::SUBPIXELS_PER_PIXEL])
    for row in range(SUBPIXELS_PER_PIXEL):
        rows += picture[row::SUBPIXELS_PER_PIXEL]
    for column in range(SUBPIXELS_PER_PIXEL):
        total += rows[:, column::SUBPIXELS_PER_PIXEL]
    mean: FloatArray = total / SUBPIXELS_PER_PIXEL**2
    return mean


@numba.njit(cache=True, error_model="numpy")
def _balls(local, radius, projection, width, height):
    """Return depth (h, w), normal (h, w, 3) and number (h, w) of the ball that each pixel shows; -1 for none.

    local: centres of the balls in eye space, float64 (n, 3)
    """
    depth = np.full((height, width), np.inf, dtype=np.float32)
    normal = np.zeros((height, width, 3), dtype=np.float32)
    owner = np.full((height, width), -1, dtype=np.int32)
    for k in range(len(local)):
        w = projection[3, 2] * local[k, 2] + projection[3, 3]
        x = (projection[0, 0] * local[k, 0] / w + 1.0) * 0.5 * width
        y = (1.0 - projection[1, 1] * local[k, 1] / w) * 0.5 * height
        reach = radius * projection[1, 1] / w * 0.5 * height
        for row in range(max(int(y - reach), 0), min(int(y + reach) + 1, height)):
            for column in range(max(int(x - reach), 0), min(int(x + reach) + 1, width)):
                u, v = (column + 0.5 - x) / reach, (y - row - 0.5) / reach
                bulge = 1.0 - u * u - v * v
                if bulge < 0.0:
                    continue
                towards = np.sqrt(bulge)
                away = -local[k, 2] - radius * towards
                if away < depth[row, column]:
                    depth[row, column], owner[row, column] = away, k
                    normal[row, column, 0], normal[row, column, 1], normal[row, column, 2] = u, v, towards
    return depth, normal, owner
