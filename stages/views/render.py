"""What a camera sees of a scene, pixel by pixel, at the centres of pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipeline.errors import Rejected
from stages.shape.arrays import BoolArray, Float32Array, FloatArray, IntArray
from stages.shape.views.buffers import Visible
from stages.shape.views.camera import View
from stages.shape.views.scene import Scene


@dataclass(frozen=True)
class _Projected:
    """All triangles on the screen, before it is known which are seen.

    layered: their corners with parts set back by layer, float64 (t, 3, 3)
    """

    layered: FloatArray
    visible: Visible


@dataclass(frozen=True, eq=False)
class ViewRenderer:
    """Renders one view of a scene in one size.

    width, height: pixels
    """

    scene: Scene
    view: View
    width: int
    height: int

    def visible(self, supersample: int = 1) -> Visible:
        """Return the triangle of each sample, `supersample` to a pixel in x and y.

        Raises Rejected where the camera sees nothing of the shape.
        """
        from stages.shape.views.raster import raster

        seen = self._everything(supersample)
        triangles = raster(seen.layered, self.width * supersample, self.height * supersample)
        if triangles.max() < 0:
            raise Rejected("nothing seen by a camera", f"{len(self.scene)} parts")
        return replace(seen.visible, triangles=triangles)

    def solid(self, masked: bool = False) -> Visible:
        """Return the triangle of each pixel through which nothing is seen; masked: masked ones count as whole."""
        from stages.shape.views.texels import visible_solid

        seen = self._everything(1)
        triangles = visible_solid(self.scene, seen.layered, self.width, self.height, masked)
        return replace(seen.visible, triangles=triangles)

    def layers(self, supersample: int) -> tuple[Visible, list[tuple[Visible, Float32Array]]]:
        """Return the samples of solid surfaces, and those of what is seen through, nearest first, with base colours.

        Raises Rejected where the camera sees nothing of the shape.
        """
        from stages.shape.views.texels import see_through_layers, visible_solid

        seen = self._everything(supersample)
        size = self.width * supersample, self.height * supersample
        triangles = visible_solid(self.scene, seen.layered, *size)
        layers = see_through_layers(self.scene, seen.layered, seen.visible.screen, self.view.projection, triangles)
        if triangles.max() < 0 and not layers:
            raise Rejected("nothing seen by a camera", f"{len(self.scene)} parts")
        return replace(seen.visible, triangles=triangles), [
            (replace(seen.visible, triangles=own), colors) for own, colors in layers
        ]

    def _everything(self, supersample: int) -> _Projected:
        from stages.shape.views.screen import facing_normals, project_triangles
        from stages.views.placement import set_back

        size = self.width * supersample, self.height * supersample
        layered = project_triangles(self.scene, self.view, set_back(self.scene, self.view, self.moves), *size)
        screen = project_triangles(self.scene, self.view, self.moves, *size)
        normals = facing_normals(self.scene, self.moves[:, :3, :3], screen)
        nothing = np.full((0, 0), -1, dtype=np.int32)
        return _Projected(layered, Visible(self.scene, self.view, nothing, screen, normals))

    @cached_property
    def moves(self) -> FloatArray:
        """Transforms from the mesh coordinates of each part to eye space, float64 (n, 4, 4)."""
        from stages.views.placement import moves_to_eye

        return moves_to_eye(self.scene, self.view.eye)

    def surface(self, world_normals: bool) -> SeenSurface:
        """Return depth, normals and parts. Raises Rejected where the camera sees nothing of the shape."""
        from stages.shape.views.screen import surface_buffers

        seen = self.visible()
        normals = normal_axes(seen.normals, self.view, world_normals)
        depth, normal, part, _ = surface_buffers(self.scene, self.view, seen.triangles, seen.screen, normals)
        depth[part < 0] = 0.0
        return SeenSurface(depth, normal, part)


@dataclass(frozen=True, eq=False)
class SeenSurface:
    """The surface that a camera sees, rows from the top.

    depth: distance along the axis of the camera, 0 where nothing is seen, float32 (h, w)
    normals: unit, towards the camera, zero where nothing is seen, float32 (h, w, 3)
    instances: part, -1 where nothing is seen, int32 (h, w)
    """

    depth: Float32Array
    normals: Float32Array
    instances: IntArray

    @property
    def mask(self) -> BoolArray:
        """Whether something is seen, bool (h, w)."""
        seen: BoolArray = self.instances >= 0
        return seen


def normal_axes(normals: FloatArray, view: View, world: bool) -> FloatArray:
    """Return normals of eye space (n, 3) in the axes of the world, or of OpenCV's camera: x right, y down, z ahead."""
    x, y, z = normals.T
    turned = normals.copy()
    if not world:
        turned[:, 1:] = 0.0 - normals[:, 1:]
        return turned
    for axis in range(3):
        turned[:, axis] = view.eye[0, axis] * x + view.eye[1, axis] * y + view.eye[2, axis] * z
    return turned
