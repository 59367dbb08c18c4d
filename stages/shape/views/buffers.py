"""Buffers of a view: depth, normal, part and colour of every pixel, by either of two backends.

Which of them draws is never found out by trying: their pictures differ in a few pixels, so it is a choice of who asks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

from pipeline.errors import ShardFailed
from stages.shape.arrays import ByteArray, Float32Array, FloatArray, IntArray
from stages.shape.views.camera import Camera, View
from stages.shape.views.scene import Scene

RendererName = Literal["raster", "egl"]
"""`raster`: our own, whole numbers in compiled code; `egl`: OpenGL on EGL, rasterised by Mesa's llvmpipe."""

MAX_RENDERS_PER_CONTEXT = 20_000
"""A context is given back and made anew after so many renders: drivers have been seen to go blank or to grow."""


class _Renderer(Protocol):
    @property
    def name(self) -> str: ...

    def triangles(self, scene: Scene, view: View, width: int, height: int) -> IntArray: ...

    def close(self) -> None: ...


@dataclass(frozen=True)
class Visible:
    """What a view shows: `triangles` int32 (h, w), the triangle of each pixel or -1; where all triangles stand on the
    screen, float64 (t, 3, 3); and their eye-space normals turned to the viewer, float64 (t, 3)."""

    scene: Scene
    view: View
    triangles: IntArray
    screen: FloatArray
    normals: FloatArray


@dataclass(frozen=True)
class Buffers:
    """Buffers of a view, rows from the top.

    depth: float32 (h, w), distance along the viewing axis, infinite for background; normal: float32 (h, w, 3), unit,
    in eye space, towards the viewer, zero for background; part: int32 (h, w), -1 for background; color: uint8
    (h, w, 3), flat sRGB, white for background.
    """

    depth: Float32Array
    normal: Float32Array
    part: IntArray
    color: ByteArray


def visible_triangles(scene: Scene, camera: Camera, size: tuple[int, int], backend: RendererName) -> Visible:
    """What `camera` sees of the scene on `size` (width, height) pixels.

    Raises ShardFailed for a blank picture or one with numbers of triangles that do not exist: both have been seen
    to come from drivers without any error.
    """
    from stages.shape.views.screen import screen_normals, screen_triangles

    width, height = size
    view = camera.look(scene.points, scene.up, width / height)
    triangles = _draw(scene, view, width, height, backend)
    if triangles.max() < 0:
        raise ShardFailed(f"blank picture from {backend}: {len(scene)} parts, none seen from {camera}")
    if triangles.min() < -1 or triangles.max() >= scene.triangle_first[-1]:
        raise ShardFailed(f"broken picture from {backend}: it shows triangles that are not in the scene")
    screen = screen_triangles(scene, view, width, height)
    return Visible(scene, view, triangles, screen, screen_normals(scene, view, screen))


def render_buffers(
    scene: Scene, camera: Camera, size: tuple[int, int], supersample: int, backend: RendererName
) -> Buffers:
    """Buffers of `size` (width, height) times `supersample` pixels. Raises ShardFailed for a blank picture."""
    from stages.shape.views.screen import surface_buffers

    seen = visible_triangles(scene, camera, (size[0] * supersample, size[1] * supersample), backend)
    return Buffers(*surface_buffers(scene, seen.view, seen.triangles, seen.screen, seen.normals))


def renderer_version(backend: RendererName) -> str:
    """What draws for `backend` on this machine, with its version. Raises ShardFailed where nothing does."""
    return _renderer(backend).name


_RENDERERS: dict[RendererName, _Renderer] = {}
_RENDERS: dict[RendererName, int] = {}


def _draw(scene: Scene, view: View, width: int, height: int, backend: RendererName) -> IntArray:
    """Draw with this process's one renderer of the kind `backend`; a lost context is made anew once."""
    if _RENDERS.get(backend, 0) >= MAX_RENDERS_PER_CONTEXT:
        _RENDERERS.pop(backend).close()
        _RENDERS[backend] = 0
    try:
        return _renderer(backend).triangles(scene, view, width, height)
    except RuntimeError:
        del _RENDERERS[backend]
    try:
        return _renderer(backend).triangles(scene, view, width, height)
    except RuntimeError as error:
        raise ShardFailed(f"{backend} fails with a fresh context too: {error}") from error


def _renderer(backend: RendererName) -> _Renderer:
    if backend not in _RENDERERS:
        _RENDERERS[backend] = _new_renderer(backend)
        _RENDERS[backend] = 0
    _RENDERS[backend] += 1
    return _RENDERERS[backend]


def _new_renderer(backend: RendererName) -> _Renderer:
    if backend == "raster":
        from stages.shape.views.raster import RasterRenderer

        return RasterRenderer()
    from stages.shape.views.opengl import OpenGLRenderer

    try:
        return OpenGLRenderer()
    except RuntimeError as error:
        raise ShardFailed(str(error)) from error
