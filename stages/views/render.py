"""What a camera sees of a scene, pixel by pixel, at the centres of pixels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from pipeline.errors import Rejected
from stages.shape.arrays import BoolArray, Float32Array, FloatArray, IntArray
from stages.shape.views.buffers import Visible
from stages.shape.views.camera import View
from stages.shape.views.scene import Scene


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
        from stages.shape.views.screen import facing_normals, project_triangles
        from stages.views.placement import set_back

        size = self.width * supersample, self.height * supersample
        layered = project_triangles(self.scene, self.view, set_back(self.scene, self.view, self.moves), *size)
        triangles = raster(layered, *size)
        if triangles.max() < 0:
            raise Rejected("nothing seen by a camera", f"{len(self.scene)} parts")
        screen = project_triangles(self.scene, self.view, self.moves, *size)
        normals = facing_normals(self.scene, self.moves[:, :3, :3], screen)
        return Visible(self.scene, self.view, triangles, screen, normals)

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
