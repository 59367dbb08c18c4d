"""Sketches per second and core: whole line drawings, and their buffers, of a shape of 7,000 triangles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.kit import Assembly, Grammar, Kit, PartType
from stages.shape.shape import Shape, kit_shape
from stages.shape.views.buffers import RendererName, render_buffers
from stages.shape.views.camera import Camera
from stages.shape.views.image_files import png_bytes
from stages.shape.views.opengl import load_pyrender
from stages.shape.views.renderer_check import check_triangle
from stages.shape.views.scene import Scene, scene_of
from stages.sketches.draw import draw_sketch
from stages.sketches.settings import StrokeOptions
from tests.bench.measure import Measure, rate

IMAGE_SIZE, SUPERSAMPLE_SIDE = 224, 2
COLUMN_COUNT, COLUMN_SIDES = 6, 40


def bench() -> Iterator[Measure]:
    """Drawings of 224 x 224 with 2 x 2 supersampling, PNG included, by backend; then the buffers alone."""
    views = [Camera(azimuth, elevation) for azimuth, elevation in ((-40.0, 25.0), (35.0, 15.0), (25.0, 55.0))]
    backends: list[RendererName] = ["egl", "raster"] if check_triangle("egl") is None else ["raster"]
    triangles = int(colonnade().triangle_first[-1])
    size = f"{IMAGE_SIZE}x{IMAGE_SIZE}, {SUPERSAMPLE_SIDE}x{SUPERSAMPLE_SIDE}"
    note = f"{size}, {triangles:,} triangles, {len(colonnade())} parts"
    for backend in backends:

        def sketches(backend: RendererName = backend) -> int:
            scene = colonnade()
            for view in views:
                png_bytes(draw_sketch(scene, view, IMAGE_SIZE, SUPERSAMPLE_SIDE, StrokeOptions(), backend)[0])
            return len(views)

        yield Measure(f"sketches, {backend}", "sketches", rate(sketches), note=note)
    for backend in backends:

        def buffers(backend: RendererName = backend) -> int:
            scene = colonnade()
            for view in views:
                render_buffers(scene, view, (IMAGE_SIZE, IMAGE_SIZE), SUPERSAMPLE_SIDE, backend)
            return len(views)

        ours = rate(buffers)
        peer = _pyrender_buffers(views) if backend == "egl" else None
        name = "pyrender, depth and segmentation" if peer else ""
        yield Measure(f"buffers, {backend}", "views", ours, name, peer, note)


def _pyrender_buffers(views: list[Camera]) -> float:
    """Views per second of pyrender, used as in its manual: a node per part, and its colour in a segmentation pass.

    Our buffers include normals, which would take pyrender another pass with a custom shader.
    """
    pyrender = load_pyrender()
    import trimesh

    scene = colonnade()
    kept = pyrender.Scene(ambient_light=np.ones(3))
    meshes = []
    for index in range(len(scene.meshes.centers)):
        points = slice(scene.meshes.vertex_first[index], scene.meshes.vertex_first[index + 1])
        faces = scene.meshes.faces[scene.meshes.face_first[index] : scene.meshes.face_first[index + 1]] - points.start
        mesh = trimesh.Trimesh(scene.meshes.vertices[points], faces, process=False)
        meshes.append(pyrender.Mesh.from_trimesh(mesh, smooth=False))
    nodes = [kept.add(meshes[mesh], pose=pose) for mesh, pose in zip(scene.mesh_of, scene.placed, strict=True)]
    colors = {node: (index % 255 + 1, index // 255, 0) for index, node in enumerate(nodes)}
    side = IMAGE_SIZE * SUPERSAMPLE_SIDE
    renderer = pyrender.OffscreenRenderer(side, side)
    cameras = []
    for view in views:
        looked = view.look(scene.points, scene.up)
        lens = pyrender.PerspectiveCamera(np.radians(view.fov), znear=0.1 * looked.radius, zfar=20.0 * looked.radius)
        cameras.append(kept.add(lens, pose=np.linalg.inv(looked.eye)))

    def render() -> int:
        for camera in cameras:
            kept.main_camera_node = camera
            renderer.render(kept, flags=pyrender.RenderFlags.SEG, seg_node_map=colors)
        return len(cameras)

    speed = rate(render)
    renderer.delete()
    return speed


def colonnade() -> Scene:
    """Return the scene of a new assembly of `colonnade_shape`."""
    return scene_of(colonnade_shape())


def colonnade_shape() -> Shape:
    """Return two rows of round columns on plinths, under beams, as a new assembly."""
    poses, types = [], []
    for row in range(2):
        for column in range(COLUMN_COUNT):
            for kind, height in ((0, 0.1), (1, 1.2), (0, 2.3)):
                poses.append((1.2 * column, height, 3.0 * row))
                types.append(kind)
    for column in range(COLUMN_COUNT - 1):
        for row in range(2):
            poses.append((1.2 * column + 0.6, 2.55, 3.0 * row))
            types.append(2)
    placed = np.tile(np.eye(4), (len(poses), 1, 1))
    placed[:, :3, 3] = poses
    gaps = np.abs(placed[:, None, :3, 3] - placed[None, :, :3, 3])
    near = np.argwhere(np.triu((gaps <= [0.7, 1.2, 0.1]).all(axis=2), 1)).astype(np.int32)
    return kit_shape(_KIT, Assembly(np.array(types, dtype=np.int16), placed, near))


def _prism(sides: int, radius: float, height: float, stretch: float = 1.0) -> tuple[FloatArray, IntArray]:
    """Return an upright prism of five drums, its first corner on the diagonal, scaled in x by `stretch`."""
    turn = 2 * np.pi * np.arange(sides) / sides + np.pi / 4
    levels = np.linspace(-height / 2, height / 2, 6)
    flat = [stretch * radius * np.cos(turn), radius * np.sin(turn)]
    rings = [np.stack([flat[0], np.full(sides, level), flat[1]], axis=1) for level in levels]
    faces = []
    for level in range(len(levels) - 1):
        for k in range(sides):
            a, b = level * sides + k, level * sides + (k + 1) % sides
            faces += [(a, a + sides, b), (b, a + sides, b + sides)]
    last = (len(levels) - 1) * sides
    for k in range(1, sides - 1):
        faces += [(0, k, k + 1), (last, last + k + 1, last + k)]
    return np.concatenate(rings), np.array(faces, dtype=np.int32)


def _type(name: str, mesh: tuple[FloatArray, IntArray]) -> PartType:
    colors = np.full((len(mesh[1]), 3), 200, dtype=np.uint8)
    return PartType(name, mesh[0], mesh[1], colors, np.eye(4), np.eye(4)[None])


_KIT = Kit(
    name="colonnade",
    types=(
        _type("plinth", _prism(4, 0.6, 0.2)),
        _type("column", _prism(COLUMN_SIDES, 0.36, 2.0)),
        _type("beam", _prism(4, 0.3, 0.3, 2.8)),
    ),
    exemplars=(),
    grammar=Grammar(neighbourhoods={}, dockings=(), nested={}),
    contact_tolerance=1e-3,
    pose_tolerance=1e-3,
    contact_kinds=("point", "line", "face"),
    up="y",
)
