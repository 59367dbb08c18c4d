"""The base colour of each sample of a picture: materials and textures, perspective-correct, from levels of half sizes.

Two levels are mixed by how many texels a step of one sample passes, and four texels of each by distance. The texture
coordinates of a sample follow from the plane of its triangle. Only sums, products, quotients and square roots are
taken, so all machines get the same digits.

Surfaces whose material has holes or is blended hide nothing by themselves: `see_through_layers` finds what of them lies
in front of the solid surfaces.

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import Float32Array, FloatArray, IntArray
from stages.shape.views.mesh_look import ALPHA_MODES, MeshLook
from stages.shape.views.palette import srgb_to_linear
from stages.shape.views.raster import COORDINATE_BITS, GRID_BITS, centres_between, raster
from stages.shape.views.scene import Scene
from stages.shape.views.screen import clip_at, eye_depth

MAX_LAYERS = 8
"""Surfaces that are seen through, one behind another, at one sample; farther ones are left out."""
MASK_MODE, BLEND_MODE = ALPHA_MODES["mask"], ALPHA_MODES["blend"]


def sample_colors(scene: Scene, triangles: IntArray, screen: FloatArray, projection: FloatArray) -> Float32Array:
    """Return linear colours and alpha of samples, float32 (h, w, 4); zero where nothing is seen.

    triangles: triangle of each sample or -1, int32 (h, w)
    screen: corners of all triangles on the screen, float64 (t, 3, 3)

    Alpha is 1 for opaque materials; of masked ones it is 1 or 0.
    """
    meshes = scene.meshes
    if meshes.look is None:
        raise ValueError("the scene has no materials")
    return sample_look(scene, triangles, screen, projection, meshes.look, srgb_to_linear(meshes.colors))


def sample_look(
    scene: Scene,
    triangles: IntArray,
    screen: FloatArray,
    projection: FloatArray,
    look: MeshLook,
    face_colors: FloatArray,
) -> Float32Array:
    """Return the colours of a look as `sample_colors` does. face_colors: of faces without a material, float64 (f, 3)"""
    owners = triangles.reshape(-1)
    pixels = np.flatnonzero(owners >= 0)
    colors = np.zeros((len(owners), 4), dtype=np.float32)
    size = triangles.shape[1]
    colors[pixels] = _sample_list(
        pixels, owners[pixels], size, screen, projection, scene.triangle_face, face_colors, look
    )
    return colors.reshape(*triangles.shape, 4)


def has_holes(scene: Scene) -> bool:
    """Return whether something may be seen through a face."""
    look = scene.meshes.look
    return look is not None and bool(look.has_holes[scene.triangle_face].any())


def solid_screen(scene: Scene, screen: FloatArray, masked: bool = False) -> FloatArray:
    """Return the corners of triangles on the screen, those that may be seen through drawn together to a point.

    masked: whether masked triangles stay
    """
    look = scene.meshes.look
    if look is None:
        return screen
    clear = np.flatnonzero((look.is_blended if masked else look.has_holes)[scene.triangle_face])
    solid = screen.copy()
    solid[clear] = solid[clear, :1]
    return solid


def see_through_layers(
    scene: Scene, layered: FloatArray, screen: FloatArray, projection: FloatArray, solid: IntArray
) -> list[tuple[IntArray, Float32Array]]:
    """Return what is seen through, nearest first: triangles int32 (h, w), -1 for none, and their colours (h, w, 4).

    layered: corners of triangles on the screen with parts set back by layer, float64 (t, 3, 3); screen: without
    solid: triangle of each sample that hides what is behind it, or -1, int32 (h, w)
    """
    look = scene.meshes.look
    if look is None:
        return []
    height, width = solid.shape
    chosen = np.flatnonzero(look.has_holes[scene.triangle_face])
    farthest = float(np.abs(layered[:, :, :2]).max(initial=1.0))
    bits = min(COORDINATE_BITS - int(np.frexp(farthest)[1]), GRID_BITS)
    pixels, depths, owners = _fragments(layered, chosen, width, height, bits, solid)
    linear = srgb_to_linear(scene.meshes.colors)
    colors = _sample_list(pixels, owners, width, screen, projection, scene.triangle_face, linear, look)
    seen = np.flatnonzero(colors[:, 3] > 0.0)
    order = seen[np.lexsort((owners[seen], depths[seen], pixels[seen]))]
    pixels, owners, colors = pixels[order], owners[order], colors[order]
    starts = np.flatnonzero(np.r_[True, pixels[1:] != pixels[:-1]]) if len(pixels) else np.empty(0, np.int64)
    place = np.arange(len(pixels)) - np.repeat(starts, np.diff(np.r_[starts, len(pixels)]))
    layers = []
    for number in range(min(int(place.max(initial=-1)) + 1, MAX_LAYERS)):
        own = place == number
        triangles = np.full(height * width, -1, dtype=np.int32)
        light = np.zeros((height * width, 4), dtype=np.float32)
        triangles[pixels[own]], light[pixels[own]] = owners[own], colors[own]
        layers.append((triangles.reshape(height, width), light.reshape(height, width, 4)))
    return layers


def visible_solid(scene: Scene, layered: FloatArray, width: int, height: int, masked: bool = False) -> IntArray:
    """Return the nearest triangle of each sample through which nothing is seen, int32 (h, w), -1 for none."""
    return raster(solid_screen(scene, layered, masked), width, height)


@numba.njit(cache=True, error_model="numpy")
def _fragments(screen, chosen, width, height, bits, solid):
    """Return sample, depth and triangle of each sample of some triangles in front of the solid surface."""
    room = 1024
    pixels, depths, owners = np.empty(room, np.int64), np.empty(room), np.empty(room, np.int32)
    count = 0
    x, y = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    grid, half = 2.0**bits, (1 << bits) >> 1
    for t in chosen:
        for k in range(3):
            x[k] = np.int64(np.floor(screen[t, k, 0] * grid + 0.5))
            y[k] = np.int64(np.floor(screen[t, k, 1] * grid + 0.5))
        left, right = centres_between(x, bits, width)
        top, bottom = centres_between(y, bits, height)
        area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
        if left > right or top > bottom or area == 0:
            continue
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                inside = True
                for k in range(3):
                    a, b = (k, (k + 1) % 3) if area > 0 else ((k + 1) % 3, k)
                    dx, dy = x[b] - x[a], y[b] - y[a]
                    owned = dy < 0 or (dy == 0 and dx > 0)
                    side = dx * ((row << bits) + half - y[a]) - dy * ((column << bits) + half - x[a])
                    inside = inside and side >= (0 if owned else 1)
                if not inside:
                    continue
                depth = clip_at(screen, t, column + 0.5, row + 0.5)
                front = solid[row, column]
                if front >= 0 and depth >= clip_at(screen, front, column + 0.5, row + 0.5):
                    continue
                if count == room:
                    room *= 2
                    pixels = np.concatenate((pixels, np.empty(count, np.int64)))
                    depths = np.concatenate((depths, np.empty(count)))
                    owners = np.concatenate((owners, np.empty(count, np.int32)))
                pixels[count], depths[count], owners[count] = row * width + column, depth, t
                count += 1
    return pixels[:count], depths[:count], owners[:count]


@numba.njit(cache=True, error_model="numpy")
def _sample_list(pixels, owners, width, screen, projection, face_of, colors, look):
    """Return linear colour and alpha of samples, float32 (n, 4), each with the triangle that it shows."""
    # Taking an array out of a tuple counts a reference, which for each sample costs more than all else. So does passing
    # rows: what is called here is inlined and reads numbers.
    face_material, uv, base, texture, mode, cutoff, texels, levels, level_first, wraps, nearest = look
    out = np.zeros((len(pixels), 4), dtype=np.float32)
    for n in range(len(pixels)):
        t, x, y = owners[n], pixels[n] % width + 0.5, pixels[n] // width + 0.5
        face = face_of[t]
        material = face_material[face]
        if material < 0:
            red, green, blue, alpha = colors[face, 0] * 1.0, colors[face, 1] * 1.0, colors[face, 2] * 1.0, 1.0
        else:
            red, green, blue, alpha = base[material, 0], base[material, 1], base[material, 2], base[material, 3]
            number = texture[material]
            if number >= 0:
                r, g, b, a = _texture_color(
                    number, t, x, y, screen, projection, face, uv, texels, levels, level_first, wraps, nearest
                )
                if a > 0.0:
                    red, green, blue = red * r / a, green * g / a, blue * b / a
                alpha *= a
            if mode[material] == MASK_MODE:
                alpha = 1.0 if alpha >= cutoff[material] else 0.0
            elif mode[material] != BLEND_MODE:
                alpha = 1.0
        out[n, 0], out[n, 1], out[n, 2], out[n, 3] = red, green, blue, alpha
    return out


@numba.njit(cache=True, error_model="numpy", inline="always")
def _texture_color(number, t, x, y, screen, projection, face, corners, texels, levels, level_first, wraps, nearest):
    """Return linear colour times alpha, and alpha, of a texture where a point of the screen shows it."""
    first, last = level_first[number], level_first[number + 1] - 1
    wide, high = levels[first, 1], levels[first, 2]
    ax, ay = screen[t, 1, 0] - screen[t, 0, 0], screen[t, 1, 1] - screen[t, 0, 1]
    bx, by = screen[t, 2, 0] - screen[t, 0, 0], screen[t, 2, 1] - screen[t, 0, 1]
    px, py = x - screen[t, 0, 0], y - screen[t, 0, 1]
    area = ax * by - ay * bx
    d1, d2, d3 = 1.0, 1.0, 1.0
    if projection[3, 3] == 0.0:
        d1, d2 = eye_depth(screen[t, 0, 2], projection), eye_depth(screen[t, 1, 2], projection)
        d3 = eye_depth(screen[t, 2, 2], projection)
    uv = (
        corners[face, 0, 0] * 1.0,
        corners[face, 0, 1] * 1.0,
        corners[face, 1, 0] * 1.0,
        corners[face, 1, 1] * 1.0,
        corners[face, 2, 0] * 1.0,
        corners[face, 2, 1] * 1.0,
    )
    plane, depths = (ax, ay, bx, by, area), (d1, d2, d3)
    u, v = _uv_at(px, py, plane, depths, uv, True)
    here_u, here_v = _uv_at(px, py, plane, depths, uv, False)
    right_u, right_v = _uv_at(x + 1.0 - screen[t, 0, 0], py, plane, depths, uv, False)
    down_u, down_v = _uv_at(px, y + 1.0 - screen[t, 0, 1], plane, depths, uv, False)
    across = ((right_u - here_u) * wide) ** 2 + ((right_v - here_v) * high) ** 2
    along = ((down_u - here_u) * wide) ** 2 + ((down_v - here_v) * high) ** 2
    step = np.sqrt(max(across, along))
    level, share = first, 0.0
    if step > 1.0:
        size = 1.0
        while step >= 2.0 * size and level < last:
            size *= 2.0
            level += 1
        share = min(step / size - 1.0, 1.0)
    square = nearest[number] and step <= 1.0
    r, g, b, a = _texel(texels, levels, level, wraps, number, u, v, square)
    if share > 0.0 and level < last:
        r2, g2, b2, a2 = _texel(texels, levels, level + 1, wraps, number, u, v, False)
        r, g, b, a = r + share * (r2 - r), g + share * (g2 - g), b + share * (b2 - b), a + share * (a2 - a)
    return r, g, b, a


@numba.njit(cache=True, error_model="numpy", inline="always")
def _uv_at(px, py, plane, depths, uv, clamped):
    """Return perspective-correct texture coordinates of a point of the screen, inside the triangle if clamped.

    px, py: the point, seen from the first corner of the triangle
    plane: the two other corners, seen from the first, and twice the area
    depths: of the corners
    uv: u and v of each corner
    """
    ax, ay, bx, by, area = plane
    if area == 0.0:
        return uv[0], uv[1]
    two, three = (px * by - py * bx) / area, (ax * py - ay * px) / area
    if clamped:
        two = min(max(two, 0.0), 1.0)
        three = min(max(three, 0.0), 1.0 - two)
    one = (1.0 - two - three) / depths[0]
    two /= depths[1]
    three /= depths[2]
    total = one + two + three
    if total == 0.0:
        return uv[0], uv[1]
    return (one * uv[0] + two * uv[2] + three * uv[4]) / total, (one * uv[1] + two * uv[3] + three * uv[5]) / total


@numba.njit(cache=True, error_model="numpy", inline="always")
def _wrapped(index, size, wrap):
    if 0 <= index < size:
        return index
    if wrap == 2:
        return min(max(index, 0), size - 1)
    if wrap == 0:
        # Most sizes are powers of two, whose remainders take no division.
        return index & (size - 1) if size & (size - 1) == 0 else index % size
    at = index % (2 * size)
    return at if at < size else 2 * size - 1 - at


@numba.njit(cache=True, error_model="numpy", inline="always")
def _texel(texels, levels, level, wraps, number, u, v, square):
    """Return the texel of a level at texture coordinates, or the mean of four by distance."""
    first, wide, high = levels[level, 0], levels[level, 1], levels[level, 2]
    wrap_u, wrap_v = wraps[number, 0], wraps[number, 1]
    across, down = min(max(u, -1e6), 1e6) * wide, min(max(v, -1e6), 1e6) * high
    if square:
        column = _wrapped(np.int64(np.floor(across)), wide, wrap_u)
        n = first + _wrapped(np.int64(np.floor(down)), high, wrap_v) * wide + column
        return texels[n, 0] * 1.0, texels[n, 1] * 1.0, texels[n, 2] * 1.0, texels[n, 3] * 1.0
    across, down = across - 0.5, down - 0.5
    left, top = np.int64(np.floor(across)), np.int64(np.floor(down))
    share_x, share_y = across - left, down - top
    near_column, far_column = _wrapped(left, wide, wrap_u), _wrapped(left + 1, wide, wrap_u)
    r, g, b, a = 0.0, 0.0, 0.0, 0.0
    for dy in range(2):
        row = _wrapped(top + dy, high, wrap_v)
        for dx in range(2):
            n = first + row * wide + (far_column if dx else near_column)
            weight = (share_x if dx else 1.0 - share_x) * (share_y if dy else 1.0 - share_y)
            r, g, b, a = (
                r + weight * texels[n, 0],
                g + weight * texels[n, 1],
                b + weight * texels[n, 2],
                a + weight * texels[n, 3],
            )
    return r, g, b, a
