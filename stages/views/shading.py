"""Colour of a view: base colours of faces in the light of a distant lamp and of the sky, in linear light.

    light = base * (KEY_LIGHT * max(0, n.l) * lit + FILL_LIGHT * max(0, n.f)
                    + SKY_LIGHT * (1 + n_up) / 2 + GROUND_LIGHT * (1 - n_up) / 2)

n is the normal, l the direction of the lamp, f that of a weaker lamp without shadows from the other side. n_up is the
upward part of the normal, and lit the share of the lamp's light that no part of the shape keeps away. The lamps stay
with the shape: a point has the same colour in all views. Base colours are those of faces, or of materials and textures
(`stages.shape.views.texels`). Weights inside a triangle are perspective-correct. Blended surfaces cast no shadow.

Materials bend normals, dim the sky and emit light by their textures (`stages.shape.views.surface_maps`). Metal, and
what has a texture of roughness, also reflects the lamp, by the microfacets of glTF 2.0 (GGX, Schlick), and the sky.

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numba
import numpy as np

from stages.shape.arrays import ByteArray, Float32Array, FloatArray
from stages.shape.views.buffers import Visible
from stages.shape.views.camera import View
from stages.shape.views.palette import linear_to_srgb, srgb_to_linear
from stages.shape.views.scene import Scene
from stages.shape.views.screen import clip_at, eye_depth
from stages.shape.views.surface_maps import bent_normals, emitted_light, surface_finish
from stages.shape.views.texels import has_holes, sample_colors
from stages.views.cameras import Sphere, cosine_and_sine, light_view, orbit_rotation
from stages.views.render import ViewRenderer

KEY_LIGHT, FILL_LIGHT, SKY_LIGHT, GROUND_LIGHT = 0.70, 0.14, 0.40, 0.16
"""Light on a white surface that faces the lamp, the weaker lamp, the sky, the ground; linear."""
FILL_TURN_DEGREES = 150.0
"""Angle from the lamp to the weaker lamp around the up axis; the latter is at the horizon."""
SHADOW_MAP_PIXELS = 1024
SHADOW_TAPS = 8
"""Points of the shadow map that each sample of a picture reads."""
SHADOW_SOFTNESS_RADII = 0.012
SHADOW_OFFSET_RADII = 0.006
"""How far a point is moved along its normal before it is looked up in the shadow map."""
MIN_LAMP_COSINE = 0.1
"""Faces at flatter angles to the lamp count as if at this one, when their plane is looked up in the shadow map."""
MIN_ROUGHNESS = 0.15
"""Smoother surfaces reflect the lamp as if of this roughness, so that it has a visible size."""
DIELECTRIC_REFLECTANCE = 0.04
GOLDEN_ANGLE_DEGREES = 137.50776405003785
LINEAR_LEVELS = 65_536
"""Steps of linear light from which sRGB is looked up."""


@dataclass(frozen=True, eq=False)
class Lamp:
    """A distant light.

    direction: towards the light, in the world, float64 (3,)
    fill: towards the weaker light, float64 (3,)
    view: from the light
    depth: its shadow map, infinite where it sees nothing, float32 (s, s); empty without shadows
    """

    direction: FloatArray
    fill: FloatArray
    view: View
    depth: Float32Array


def lamp_of(scene: Scene, sphere: Sphere, azimuth: float, elevation: float, shadows: bool) -> Lamp:
    """Return the light from a direction in degrees, with the shadow map of a scene if wanted."""
    direction = orbit_rotation(azimuth, cosine_and_sine(elevation)[1])[2]
    fill = orbit_rotation(azimuth + FILL_TURN_DEGREES, 0.0)[2]
    view = light_view(azimuth, elevation, sphere)
    if not shadows:
        return Lamp(direction, fill, view, np.empty((0, 0), dtype=np.float32))
    renderer = ViewRenderer(scene, view, SHADOW_MAP_PIXELS, SHADOW_MAP_PIXELS)
    if has_holes(scene):
        seen = renderer.solid(masked=True)
    else:
        seen = renderer.visible()
    return Lamp(direction, fill, view, _depths(seen.triangles, seen.screen, view.projection))


def base_colors(scene: Scene) -> FloatArray:
    """Return the base colour of each face of the meshes in linear light, float64 (f, 3)."""
    linear: FloatArray = np.round(srgb_to_linear(np.arange(256, dtype=np.uint8)), 12)[scene.meshes.colors]
    return linear


def view_light(renderer: ViewRenderer, supersample: int, lamp: Lamp | None) -> Float32Array:
    """Return linear colours times alpha, and alpha, float32 (h, w, 4): means of `supersample` squared samples.

    lamp: None for base colours without light

    Raises Rejected where the camera sees nothing of the shape.
    """
    scene = renderer.scene
    if not has_holes(scene):
        seen = renderer.visible(supersample)
        if scene.meshes.look is None:
            return shade(seen, renderer.moves, supersample, lamp)
        base = sample_colors(scene, seen.triangles, seen.screen, seen.view.projection)
        return shade(seen, renderer.moves, supersample, lamp, base)
    solid, layers = renderer.layers(supersample)
    base = sample_colors(scene, solid.triangles, solid.screen, solid.view.projection)
    light = shade(solid, renderer.moves, 1, lamp, base)
    for seen, colors in reversed(layers):
        at = np.flatnonzero(seen.triangles >= 0)
        own = shade(seen, renderer.moves, 1, lamp, colors).reshape(-1, 4)[at]
        alpha, behind = colors.reshape(-1, 4)[at, 3:], light.reshape(-1, 4)[at]
        own[:, :3] = own[:, :3] * alpha + behind[:, :3] * (1 - alpha)
        own[:, 3:] = alpha + behind[:, 3:] * (1 - alpha)
        light.reshape(-1, 4)[at] = own
    height, width = light.shape[0] // supersample, light.shape[1] // supersample
    mean: Float32Array = light.reshape(height, supersample, width, supersample, 4).mean(axis=(1, 3))
    return mean


def shade(
    seen: Visible, moves: FloatArray, supersample: int, lamp: Lamp | None, colors: Float32Array | None = None
) -> Float32Array:
    """Return linear colours times alpha, and alpha, float32 (h, w, 4): means of `supersample` squared samples.

    seen: samples of the view
    moves: from the mesh coordinates of each part to eye space, (n, 4, 4)
    lamp: None for base colours without light
    colors: base colour of each sample, float32 (h, w, 4); by default that of its face
    """
    scene, view = seen.scene, seen.view
    parts, faces = scene.triangle_part, scene.triangle_face
    by_sample = colors is not None
    if colors is None:
        base = base_colors(scene)
    else:
        # Most layers are empty nearly everywhere, and memory that nobody writes to costs nothing.
        at = np.flatnonzero(seen.triangles >= 0)
        base = np.zeros((seen.triangles.size, 3))
        base[at] = colors.reshape(-1, 4)[at, :3]
    if lamp is None:
        unlit: Float32Array = _unlit(seen.triangles, supersample, faces, base, by_sample)
        return unlit
    turn = view.eye[:3, :3]
    to_lamp = np.array([_dot(row, lamp.direction) for row in turn])
    to_fill = np.array([_dot(row, lamp.fill) for row in turn])
    up = turn[:, 1].copy()
    taps = _taps(supersample, SHADOW_SOFTNESS_RADII * view.radius)
    maps = scene.meshes.maps if by_sample else None
    bent = finish = np.empty((0, 0, 3), dtype=np.float32)
    if maps is not None and maps.bends is not None:
        rows, normals = bent_normals(seen, maps, moves[:, :3, :3])
        bent = np.zeros((*seen.triangles.shape, 3), dtype=np.float32)
        bent.reshape(-1, 3)[rows] = normals
    if maps is not None and (maps.finish is not None or maps.occlusion is not None):
        finish = surface_finish(seen, maps)
    lit: Float32Array = _lit(
        *(seen.triangles, supersample, seen.screen, seen.normals, parts, faces, base, by_sample),
        *(scene.meshes.corner_normals, moves[:, :3, :3], view.projection, to_lamp, to_fill, up),
        *(lamp.depth, _between(view.eye, lamp.view.eye), lamp.view.projection, taps),
        *(SHADOW_OFFSET_RADII * view.radius, bent, finish),
    )
    if maps is not None and maps.emission is not None:
        height, width = lit.shape[:2]
        emitted = emitted_light(seen, maps).reshape(height, supersample, width, supersample, 3)
        lit[:, :, :3] += emitted.mean(axis=(1, 3))
    return lit


def to_srgb(light: Float32Array, transparent: bool) -> ByteArray:
    """Return sRGB, uint8 (h, w, 3) over white, or (h, w, 4) with alpha that the colours are not multiplied by."""
    encoded: ByteArray = _encode(light, _srgb_table(), transparent)
    return encoded


@cache
def _srgb_table() -> ByteArray:
    return linear_to_srgb(np.arange(LINEAR_LEVELS) / (LINEAR_LEVELS - 1))


def _between(eye: FloatArray, other: FloatArray) -> FloatArray:
    """Return the transform from one eye space to another, (4, 4)."""
    turn = np.array([[_dot(row, column) for column in eye[:3, :3]] for row in other[:3, :3]])
    moved = np.eye(4)
    moved[:3, :3] = turn
    moved[:3, 3] = [other[k, 3] - _dot(turn[k], eye[:3, 3]) for k in range(3)]
    return moved


def _taps(supersample: int, radius: float) -> FloatArray:
    """Return offsets on a disc for each sample of a pixel, (s, SHADOW_TAPS, 2); all together cover it evenly."""
    samples = supersample * supersample
    total = samples * SHADOW_TAPS
    points = [
        [np.sqrt((number + 0.5) / total) * axis for axis in cosine_and_sine(number * GOLDEN_ANGLE_DEGREES)]
        for number in range(total)
    ]
    return radius * np.array(points).reshape(SHADOW_TAPS, samples, 2).transpose(1, 0, 2).copy()


def _dot(a: FloatArray, b: FloatArray) -> float:
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@numba.njit(cache=True, error_model="numpy")
def _depths(triangles, screen, projection):
    height, width = triangles.shape
    depth = np.full((height, width), np.inf, dtype=np.float32)
    for row in range(height):
        for column in range(width):
            t = triangles[row, column]
            if t >= 0:
                depth[row, column] = eye_depth(clip_at(screen, t, column + 0.5, row + 0.5), projection)
    return depth


@numba.njit(cache=True, error_model="numpy")
def _unlit(triangles, supersample, face_of, base, by_sample):
    columns = triangles.shape[1]
    height, width = len(triangles) // supersample, columns // supersample
    light = np.zeros((height, width, 4), dtype=np.float32)
    share = 1.0 / (supersample * supersample)
    for row in range(height):
        for column in range(width):
            red, green, blue, alpha = 0.0, 0.0, 0.0, 0.0
            for r in range(row * supersample, (row + 1) * supersample):
                for c in range(column * supersample, (column + 1) * supersample):
                    if triangles[r, c] >= 0:
                        color = base[r * columns + c if by_sample else face_of[triangles[r, c]]]
                        red, green, blue, alpha = red + color[0], green + color[1], blue + color[2], alpha + 1.0
            light[row, column, 0], light[row, column, 1] = red * share, green * share
            light[row, column, 2], light[row, column, 3] = blue * share, alpha * share
    return light


@numba.njit(cache=True, error_model="numpy", inline="always")
def weights(screen, t, x, y, projection):
    """Return the weights of the last two corners of a triangle at a point of the screen, perspective-correct."""
    ax, ay = screen[t, 1, 0] - screen[t, 0, 0], screen[t, 1, 1] - screen[t, 0, 1]
    bx, by = screen[t, 2, 0] - screen[t, 0, 0], screen[t, 2, 1] - screen[t, 0, 1]
    px, py = x - screen[t, 0, 0], y - screen[t, 0, 1]
    area = ax * by - ay * bx
    if area == 0.0:
        return 0.0, 0.0
    u = min(max((px * by - py * bx) / area, 0.0), 1.0)
    v = min(max((ax * py - ay * px) / area, 0.0), 1.0 - u)
    if projection[3, 3] != 0.0:
        return u, v
    first = (1.0 - u - v) / eye_depth(screen[t, 0, 2], projection)
    u, v = u / eye_depth(screen[t, 1, 2], projection), v / eye_depth(screen[t, 2, 2], projection)
    total = first + u + v
    return u / total, v / total


@numba.njit(cache=True, error_model="numpy")
def _lit(
    triangles,
    supersample,
    screen,
    flat,
    parts,
    face_of,
    base,
    by_sample,
    corners,
    rotations,
    projection,
    to_lamp,
    to_fill,
    up,
    shadow,
    to_shadow,
    lamp_projection,
    taps,
    offset,
    bent,
    finish,
):
    rows, columns = triangles.shape
    height, width = rows // supersample, columns // supersample
    light = np.zeros((height, width, 4), dtype=np.float32)
    share = 1.0 / (supersample * supersample)
    turned = np.empty(3)
    for row in range(height):
        for column in range(width):
            red, green, blue, alpha = 0.0, 0.0, 0.0, 0.0
            for sample in range(supersample * supersample):
                r, c = row * supersample + sample // supersample, column * supersample + sample % supersample
                t = triangles[r, c]
                if t < 0:
                    continue
                u, v = weights(screen, t, c + 0.5, r + 0.5, projection)
                n, rotation = corners[face_of[t]], rotations[parts[t]]
                x = (1.0 - u - v) * n[0, 0] + u * n[1, 0] + v * n[2, 0]
                y = (1.0 - u - v) * n[0, 1] + u * n[1, 1] + v * n[2, 1]
                z = (1.0 - u - v) * n[0, 2] + u * n[1, 2] + v * n[2, 2]
                for k in range(3):
                    turned[k] = rotation[k, 0] * x + rotation[k, 1] * y + rotation[k, 2] * z
                length = np.sqrt(turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2])
                towards = turned[0] * flat[t, 0] + turned[1] * flat[t, 1] + turned[2] * flat[t, 2]
                for k in range(3):
                    turned[k] = flat[t, k] if length == 0.0 else turned[k] / (length if towards >= 0.0 else -length)
                if len(bent) > 0 and (bent[r, c, 0] != 0.0 or bent[r, c, 1] != 0.0 or bent[r, c, 2] != 0.0):
                    for k in range(3):
                        turned[k] = bent[r, c, k]
                open_sky = finish[r, c, 0] * 1.0 if len(finish) > 0 else 1.0
                facing = turned[0] * to_lamp[0] + turned[1] * to_lamp[1] + turned[2] * to_lamp[2]
                rise = turned[0] * up[0] + turned[1] * up[1] + turned[2] * up[2]
                fill = turned[0] * to_fill[0] + turned[1] * to_fill[1] + turned[2] * to_fill[2]
                strength = (
                    FILL_LIGHT * max(fill, 0.0)
                    + SKY_LIGHT * open_sky * (0.5 + 0.5 * rise)
                    + GROUND_LIGHT * open_sky * (0.5 - 0.5 * rise)
                )
                # Where the flat face turns away from the lamp, the smooth normal does not bring light back.
                side = flat[t, 0] * to_lamp[0] + flat[t, 1] * to_lamp[1] + flat[t, 2] * to_lamp[2]
                key = 0.0
                if facing > 0.0 and side > 0.0:
                    reached = 1.0
                    if len(shadow) > 0:
                        x, y, depth = _place(screen, t, r, c, rows, columns, projection)
                        plane = flat[t, 0], flat[t, 1], flat[t, 2], offset
                        reached = _reached(shadow, to_shadow, lamp_projection, x, y, -depth, *plane, taps[sample])
                    key = KEY_LIGHT * facing * reached
                    strength += key
                color = base[r * columns + c if by_sample else face_of[t]]
                alpha += 1.0
                if len(finish) == 0 or finish[r, c, 1] < 0.0:
                    red, green, blue = (
                        red + strength * color[0],
                        green + strength * color[1],
                        blue + strength * color[2],
                    )
                    continue
                x, y, depth = _place(screen, t, r, c, rows, columns, projection)
                away = (-x, -y, depth) if projection[3, 3] == 0.0 else (0.0, 0.0, 1.0)
                sky = SKY_LIGHT * open_sky, GROUND_LIGHT * open_sky
                mirrored, rest = _reflected(turned, away, to_lamp, up, finish[r, c, 1] * 1.0, key, sky)
                metal = finish[r, c, 2] * 1.0
                rest += DIELECTRIC_REFLECTANCE * (1.0 - metal) * mirrored
                strength = strength * (1.0 - metal) + mirrored * metal
                red, green = red + strength * color[0] + rest, green + strength * color[1] + rest
                blue = blue + strength * color[2] + rest
            light[row, column, 0], light[row, column, 1] = red * share, green * share
            light[row, column, 2], light[row, column, 3] = blue * share, alpha * share
    return light


@numba.njit(cache=True, error_model="numpy", inline="always")
def _place(screen, t, row, column, rows, columns, projection):
    """Return where a sample is in eye space: to the right, upwards, and away from the camera."""
    depth = eye_depth(clip_at(screen, t, column + 0.5, row + 0.5), projection)
    scale = 1.0 if projection[3, 3] != 0.0 else depth
    x = ((column + 0.5) * 2.0 / columns - 1.0) / projection[0, 0] * scale
    y = (1.0 - (row + 0.5) * 2.0 / rows) / projection[1, 1] * scale
    return x, y, depth


@numba.njit(cache=True, error_model="numpy")
def _reflected(normal, away, to_lamp, up, roughness, key, sky):
    """Return the light that a surface mirrors: what its reflectance is multiplied by, and what is added to that.

    away: towards the camera
    key: light of the lamp on the surface; sky: light from above and from below
    """
    length = np.sqrt(away[0] * away[0] + away[1] * away[1] + away[2] * away[2])
    ax, ay, az = away[0] / length, away[1] / length, away[2] / length
    facing = min(max(normal[0] * ax + normal[1] * ay + normal[2] * az, 1e-3), 1.0)
    rise = 2.0 * facing * (normal[0] * up[0] + normal[1] * up[1] + normal[2] * up[2])
    rise = min(max(rise - (ax * up[0] + ay * up[1] + az * up[2]), -1.0), 1.0)
    around = sky[0] * (0.5 + 0.5 * rise) + sky[1] * (0.5 - 0.5 * rise)
    grazing = (1.0 - min(roughness, 1.0)) * (1.0 - facing) ** 5
    mirrored, rest = around * (1.0 - grazing), around * grazing
    if key > 0.0:
        hx, hy, hz = ax + to_lamp[0], ay + to_lamp[1], az + to_lamp[2]
        length = max(np.sqrt(hx * hx + hy * hy + hz * hz), 1e-9)
        half = max((normal[0] * hx + normal[1] * hy + normal[2] * hz) / length, 0.0)
        lamp = max(normal[0] * to_lamp[0] + normal[1] * to_lamp[1] + normal[2] * to_lamp[2], 0.0)
        edge = (1.0 - min(max((ax * hx + ay * hy + az * hz) / length, 0.0), 1.0)) ** 5
        a = max(min(roughness, 1.0), MIN_ROUGHNESS) ** 2
        width = half * half * (a * a - 1.0) + 1.0
        hidden = lamp * (facing * (1.0 - a) + a) + facing * (lamp * (1.0 - a) + a)
        peak = key * a * a / (width * width) * 0.5 / hidden
        mirrored, rest = mirrored + peak * (1.0 - edge), rest + peak * edge
    return mirrored, rest


@numba.njit(cache=True, error_model="numpy")
def _reached(shadow, m, projection, x, y, z, nx, ny, nz, offset, taps):
    """Return the share of the taps around a point of eye space (x, y, z) that the lamp sees.

    Taps lie in the plane of the face with the normal (nx, ny, nz), so that a face does not darken itself.
    """
    size = len(shadow)
    side_x = m[0, 0] * nx + m[0, 1] * ny + m[0, 2] * nz
    side_y = m[1, 0] * nx + m[1, 1] * ny + m[1, 2] * nz
    side_z = m[2, 0] * nx + m[2, 1] * ny + m[2, 2] * nz
    across = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3] + offset * side_x
    above = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3] + offset * side_y
    away = -(m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3]) - offset * side_z
    steep = max(side_z, MIN_LAMP_COSINE)
    free = 0
    for tap in range(len(taps)):
        dx, dy = taps[tap, 0], taps[tap, 1]
        column = int(np.floor((projection[0, 0] * (across + dx) + 1.0) * 0.5 * size))
        row = int(np.floor((1.0 - projection[1, 1] * (above + dy)) * 0.5 * size))
        outside = column < 0 or row < 0 or column >= size or row >= size
        free += outside or shadow[row, column] + offset >= away + (side_x * dx + side_y * dy) / steep
    return free / len(taps)


@numba.njit(cache=True, error_model="numpy")
def _encode(light, table, transparent):
    height, width = light.shape[:2]
    encoded = np.empty((height, width, 4 if transparent else 3), dtype=np.uint8)
    for row in range(height):
        for column in range(width):
            alpha = light[row, column, 3] * 1.0
            for k in range(3):
                value = light[row, column, k] * 1.0
                if transparent:
                    value = value / alpha if alpha > 0.0 else 0.0
                else:
                    value += 1.0 - alpha
                encoded[row, column, k] = table[int(min(value, 1.0) * (len(table) - 1) + 0.5)]
            if transparent:
                encoded[row, column, 3] = int(alpha * 255.0 + 0.5)
    return encoded
