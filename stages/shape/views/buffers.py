"""Buffers of a view: depth, normal, part and colour of every pixel, by one of two renderers.

The renderer is never chosen by trying: their pictures differ in a few pixels, so the caller names it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

from pipeline.errors import ShardFailed
from stages.shape.arrays import ByteArray, Float32Array, FloatArray, IntArray
from stages.shape.views.camera import Camera, View
from stages.shape.views.scene import Scene

RendererName = Literal["raster", "egl"]
"""`raster`: our own rasteriser, integers in compiled code. `egl`: OpenGL on EGL, rasterised by Mesa's llvmpipe."""

MAX_RENDERS_PER_CONTEXT = 20_000
"""An OpenGL context is replaced after this many renders: drivers were seen to go blank or to leak."""


class _Renderer(Protocol):
    @property
    def name(self) -> str: ...

    def triangles(self, scene: Scene, view: View, width: int, height: int) -> IntArray: ...

    def close(self) -> None: ...


@dataclass(frozen=True)
class Visible:
    """What a view shows.

    triangles: triangle of each pixel or -1, int32 (h, w)
    screen: corners of all triangles on the screen, float64 (t, 3, 3)
    normals: eye-space normals of all triangles, towards the viewer, float64 (t, 3)
    """

    scene: Scene
    view: View
    triangles: IntArray
    screen: FloatArray
    normals: FloatArray


@dataclass(frozen=True)
class Buffers:
    """Buffers of a view, rows from the top.

    depth: distance along the viewing axis, infinite for background, float32 (h, w)
    normal: unit, in eye space, towards the viewer, zero for background, float32 (h, w, 3)
    part: -1 for background, int32 (h, w)
    color: flat sRGB, white for background, uint8 (h, w, 3)
    """

    depth: Float32Array
    normal: Float32Array
    part: IntArray
    color: ByteArray


def visible_triangles(scene: Scene, camera: Camera, size: tuple[int, int], renderer: RendererName) -> Visible:
    """Return what `camera` sees of the scene on `size` (width, height) pixels.

    Raises ShardFailed for a blank picture or one with triangle numbers that do not exist: drivers have produced both
    without any error.
    """
    from stages.shape.views.screen import screen_normals, screen_triangles

    width, height = size
    view = camera.look(scene.points, scene.up, width / height)
    triangles = _draw(scene, view, width, height, renderer)
    if triangles.max() < 0:
        raise ShardFailed(f"blank picture from {renderer}: {len(scene)} parts, none seen from {camera}")
    if triangles.min() < -1 or triangles.max() >= scene.triangle_first[-1]:
        raise ShardFailed(f"broken picture from {renderer}: it shows triangles that are not in the scene")
    screen = screen_triangles(scene, view, width, height)
    return Visible(scene, view, triangles, screen, screen_normals(scene, view, screen))


def render_buffers(
    scene: Scene, camera: Camera, size: tuple[int, int], supersample: int, renderer: RendererName
) -> Buffers:
    """Return buffers of `size` (width, height) times `supersample` pixels. Raises ShardFailed for a blank picture."""
    from stages.shape.views.screen import surface_buffers

    seen = visible_triangles(scene, camera, (size[0] * supersample, size[1] * supersample), renderer)
    return Buffers(*surface_buffers(scene, seen.view, seen.triangles, seen.screen, seen.normals))


def renderer_version(renderer: RendererName) -> str:
    """Return what draws for a renderer on this machine, with its version. Raises ShardFailed if nothing does."""
    return _instance(renderer).name


_RENDERERS: dict[RendererName, _Renderer] = {}
_RENDERS: dict[RendererName, int] = {}


def _draw(scene: Scene, view: View, width: int, height: int, renderer: RendererName) -> IntArray:
    """Draw with this process's one renderer of this name. A lost context is replaced once."""
    if _RENDERS.get(renderer, 0) >= MAX_RENDERS_PER_CONTEXT:
        _RENDERERS.pop(renderer).close()
        _RENDERS[renderer] = 0
    try:
        return _instance(renderer).triangles(scene, view, width, height)
    except RuntimeError:
        del _RENDERERS[renderer]
    try:
        return _instance(renderer).triangles(scene, view, width, height)
    except RuntimeError as error:
        raise ShardFailed(f"{renderer} fails with a fresh context too: {error}") from error


def _instance(renderer: RendererName) -> _Renderer:
    if renderer not in _RENDERERS:
        _RENDERERS[renderer] = _new_renderer(renderer)
        _RENDERS[renderer] = 0
    _RENDERS[renderer] += 1
    return _RENDERERS[renderer]


def _new_renderer(renderer: RendererName) -> _Renderer:
    if renderer == "raster":
        from stages.shape.views.raster import RasterRenderer

        return RasterRenderer()
    from stages.shape.views.opengl import OpenGLRenderer

    try:
        return OpenGLRenderer()
    except RuntimeError as error:
        raise ShardFailed(str(error)) from error
