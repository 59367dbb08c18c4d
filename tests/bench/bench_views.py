"""Views a CPU second: whole samples, rendering alone against ray casters and OpenGL, and each format with its bytes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from PIL import Image

from stages.shape.appearance import Appearance, Material, Texture, TextureImage
from stages.shape.shape import Shape
from stages.shape.views.image_files import color_png_bytes, data_png_bytes, exr_bytes, jpeg_bytes, webp_bytes
from stages.shape.views.renderer_check import check_triangle
from stages.shape.views.scene import Scene, scene_of
from stages.views.cameras import sample_views
from stages.views.images import surface_channels, view_files
from stages.views.numbers import depth_levels, depth_scale, normal_bytes, rounded_depth
from stages.views.placement import bounding_sphere
from stages.views.render import SeenSurface, ViewRenderer
from stages.views.settings import ViewsConfig
from stages.views.shading import Lamp, lamp_of, shade, to_srgb, view_light
from tests.bench.bench_sketches import colonnade, colonnade_shape
from tests.bench.measure import Measure

IMAGE_SIZE, CAMERA_COUNT, TEXTURE_SIZE = 256, 12, 512
CONFIG = ViewsConfig.model_validate(
    {"cameras": [{"kind": "ring", "count": CAMERA_COUNT}], "width": IMAGE_SIZE, "height": IMAGE_SIZE}
)


def bench() -> Iterator[Measure]:
    """Samples with twelve views of four images, encoded; then the parts of that, and other formats."""
    scene = colonnade()
    triangles = f"{int(scene.triangle_first[-1]):,} triangles, {len(scene)} parts"
    size = f"{CAMERA_COUNT} views of {IMAGE_SIZE}x{IMAGE_SIZE}, {', '.join(CONFIG.images)}"
    total = sum(len(content) for content in _sample(colonnade()).values())
    note = f"{size}, {triangles}, {total / CAMERA_COUNT / 1e3:.1f} kB a view"
    yield Measure("views, samples encoded", "samples", 1.0 / _seconds(lambda: _sample(colonnade())), note=note)
    renderers, lamp = _renderers(scene)
    surfaces = CAMERA_COUNT / _seconds(lambda: [renderer.surface(False) for renderer in renderers])
    for name, rays in (("Open3D rays", _open3d_seconds), ("trimesh rays", _trimesh_seconds)):
        peer = 1.0 / rays(scene, renderers[0])
        yield Measure("views, depth, normals and ids", "views", surfaces, name, peer, f"{triangles}, not encoded")
    colors = CAMERA_COUNT / _seconds(lambda: [_color(renderer, lamp) for renderer in renderers])
    has_egl = check_triangle("egl") is None
    peer_name = "pyrender on EGL, without shadows" if has_egl else ""
    opengl = _pyrender_rate(scene, _joined_mesh(scene)) if has_egl else None
    yield Measure("views, colour", "views", colors, peer_name, opengl, "2x2 samples a pixel, shadows, not encoded")
    shape = _textured()
    textured, (textured_renderers, _) = scene_of(shape), _renderers(scene_of(shape))
    colors = CAMERA_COUNT / _seconds(lambda: [view_light(renderer, 2, lamp) for renderer in textured_renderers])
    opengl = _pyrender_rate(textured, _joined_mesh(textured, shape)) if has_egl else None
    note = f"texture of {TEXTURE_SIZE}x{TEXTURE_SIZE} on all faces; 2x2 samples a pixel, shadows, not encoded"
    yield Measure("views, textured colour", "views", colors, peer_name, opengl, note)
    total = sum(len(content) for content in _sample(textured).values())
    note = f"{size}, textured, {total / CAMERA_COUNT / 1e3:.1f} kB a view"
    yield Measure("views, textured samples encoded", "samples", 1.0 / _seconds(lambda: _sample(textured)), note=note)
    for name, kind, encode in _formats(renderers, lamp):
        contents = encode()
        figure = len(contents) / _seconds(encode)
        mean_bytes = sum(map(len, contents)) / len(contents)
        yield Measure(f"views, {kind} as {name}", "images", figure, note=f"{mean_bytes / 1e3:.1f} kB an image")


def _seconds(work: Callable[[], Any], rounds: int = 3) -> float:
    """Return the CPU seconds that `work` takes: the least of some rounds."""
    work()
    least = np.inf
    for _ in range(rounds):
        start = time.process_time()
        work()
        least = min(least, time.process_time() - start)
    return float(least)


def _renderers(scene: Scene) -> tuple[list[ViewRenderer], Lamp]:
    sphere = bounding_sphere(scene)
    views = sample_views(CONFIG, sphere, np.random.default_rng)
    color = CONFIG.color
    lamp = lamp_of(scene, sphere, color.light_azimuth, color.light_elevation, color.shadows)
    return [ViewRenderer(scene, view, IMAGE_SIZE, IMAGE_SIZE) for _, view in views], lamp


def _sample(scene: Scene) -> dict[str, bytes]:
    """Return the image files of a sample."""
    renderers, lamp = _renderers(scene)
    classes = np.zeros(len(scene), dtype=np.int16)
    files: dict[str, bytes] = {}
    for index, renderer in enumerate(renderers):
        files |= view_files(CONFIG, renderer, lamp, classes, index)[0]
    return files


def _color(renderer: ViewRenderer, lamp: Lamp) -> Any:
    return to_srgb(shade(renderer.visible(2), renderer.moves, 2, lamp), False)


def _formats(renderers: list[ViewRenderer], lamp: Lamp) -> Iterator[tuple[str, str, Callable[[], list[bytes]]]]:
    """Yield format, kind of image, and a function that encodes it for each view."""

    def of_views(encode: Callable[[Any], bytes], images: list[Any]) -> Callable[[], list[bytes]]:
        return lambda: [encode(image) for image in images]

    surfaces = [renderer.surface(False) for renderer in renderers]
    colors = [_color(renderer, lamp) for renderer in renderers]
    clear = [to_srgb(shade(renderer.visible(2), renderer.moves, 2, lamp), True) for renderer in renderers]
    depths = [depth_levels(surface.depth, depth_scale(surface.depth)) for surface in surfaces]
    normals = [normal_bytes(surface.normals) for surface in surfaces]
    ids = [(surface.instances + 1).astype(np.uint16) for surface in surfaces]
    for level in (1, 4, 6, 9):
        yield f"PNG {level}", "colour", of_views(partial(color_png_bytes, level=level), colors)
        yield f"PNG {level}", "depth", of_views(partial(data_png_bytes, smooth=True, level=level), depths)
        yield f"PNG {level}", "normals", of_views(partial(data_png_bytes, level=level), normals)
        yield f"PNG {level}", "ids", of_views(partial(data_png_bytes, level=level), ids)
    yield "PNG 4", "colour with alpha", of_views(color_png_bytes, clear)
    yield "JPEG 90", "colour", of_views(partial(jpeg_bytes, quality=90), colors)
    yield "WebP 90", "colour", of_views(partial(webp_bytes, quality=90), colors)
    yield "WebP 90", "colour with alpha", of_views(partial(webp_bytes, quality=90), clear)
    for codec in ("zip", "zips", "piz", "pxr24", "dwaa"):
        yield f"EXR {codec}", "depth", of_views(partial(_depth_exr, codec=codec), surfaces)
        yield f"EXR {codec}", "depth, normals and ids", of_views(partial(_joined, codec=codec), surfaces)


def _depth_exr(surface: SeenSurface, codec: str) -> bytes:
    return exr_bytes({"Z": (rounded_depth(surface.depth), "float")}, codec)


def _joined(surface: SeenSurface, codec: str) -> bytes:
    return exr_bytes(surface_channels(CONFIG, surface, np.zeros(1000, dtype=np.int16)), codec)


def _world_triangles(scene: Scene) -> np.ndarray:
    """Return the corners of all triangles in the world, float64 (t, 3, 3)."""
    placed = scene.placed[scene.triangle_part]
    corners = scene.meshes.vertices[scene.meshes.faces[scene.triangle_face]]
    triangles: np.ndarray = np.einsum("tij,tkj->tki", placed[:, :3, :3], corners) + placed[:, None, :3, 3]
    return triangles


def _rays(renderer: ViewRenderer) -> tuple[np.ndarray, np.ndarray]:
    """Return the origin (3,) and the directions (n, 3) of the rays of a view."""
    view = renderer.view
    x = ((np.arange(IMAGE_SIZE) + 0.5) * 2 / IMAGE_SIZE - 1) / view.projection[0, 0]
    y = (1 - (np.arange(IMAGE_SIZE) + 0.5) * 2 / IMAGE_SIZE) / view.projection[1, 1]
    across, above = np.meshgrid(x, y)
    ahead = np.stack([across, above, -np.ones_like(across)], axis=-1).reshape(-1, 3)
    return -view.eye[:3, :3].T @ view.eye[:3, 3], ahead @ view.eye[:3, :3]


def _open3d_seconds(scene: Scene, renderer: ViewRenderer) -> float:
    """Return the CPU seconds of a view by Open3D's rays, on one thread."""
    import open3d as o3d

    corners = _world_triangles(scene).astype(np.float32)
    origin, directions = _rays(renderer)
    rays = np.concatenate([np.broadcast_to(origin, directions.shape), directions], axis=1).astype(np.float32)

    def cast() -> None:
        caster = o3d.t.geometry.RaycastingScene(nthreads=1)
        numbers = np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3)
        caster.add_triangles(o3d.core.Tensor(corners.reshape(-1, 3)), o3d.core.Tensor(numbers))
        for _ in range(CAMERA_COUNT):
            caster.cast_rays(o3d.core.Tensor(rays), nthreads=1)

    return _seconds(cast) / CAMERA_COUNT


def _trimesh_seconds(scene: Scene, renderer: ViewRenderer) -> float:
    """Return the CPU seconds of a view by trimesh's rays: a hundredth of its rays, times a hundred."""
    import trimesh

    corners = _world_triangles(scene)
    mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=False)
    origin, directions = _rays(renderer)
    some = directions[50::100]
    starts = np.broadcast_to(origin, some.shape)
    return 100.0 * _seconds(lambda: mesh.ray.intersects_first(starts, some), rounds=1)


def _textured() -> Shape:
    """Return the colonnade with a photo-like texture on all faces, along the axes of each mesh."""
    waves = np.random.default_rng(0).normal(0, 12, (TEXTURE_SIZE, TEXTURE_SIZE, 3)).cumsum(axis=0).cumsum(axis=1)
    image = TextureImage.of(np.clip(128 + waves / 8, 0, 255).astype(np.uint8))
    shape = colonnade_shape()
    meshes = []
    for mesh in shape.meshes:
        uv = mesh.vertices[mesh.faces] @ np.array([[1.0, 0.0], [0.0, 1.0], [0.7, 0.3]])
        look = Appearance((Material("stone", texture=Texture(image)),), np.zeros(len(uv), np.int32), uv.astype("f4"))
        meshes.append(replace(mesh, appearance=look))
    return replace(shape, meshes=tuple(meshes))


def _joined_mesh(scene: Scene, textured: Shape | None = None) -> Any:
    """Return all triangles as one mesh of trimesh, with the texture of a shape."""
    import trimesh

    corners = _world_triangles(scene).reshape(-1, 3)
    mesh = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    if textured is not None:
        looks = [part_mesh.appearance for part_mesh in textured.meshes if part_mesh.appearance is not None]
        uv = np.concatenate([look.uv for look in looks if look.uv is not None])[scene.triangle_face]
        texture = looks[0].materials[0].texture
        assert texture is not None
        image = Image.fromarray(texture.image.pixels)
        mesh.visual = trimesh.visual.TextureVisuals(uv=uv.reshape(-1, 2), image=image)
    return mesh


def _pyrender_rate(scene: Scene, mesh: Any) -> float:
    """Return views a CPU second of pyrender's colour: a lamp without shadows, Mesa's llvmpipe."""
    from stages.shape.views.opengl import load_pyrender

    pyrender = load_pyrender()
    kept = pyrender.Scene(ambient_light=np.full(3, 0.3), bg_color=np.ones(4))
    kept.add(pyrender.Mesh.from_trimesh(mesh, smooth=False))
    kept.add(pyrender.DirectionalLight(intensity=3.0), pose=np.eye(4))
    drawer = pyrender.OffscreenRenderer(IMAGE_SIZE, IMAGE_SIZE)
    renderers, _ = _renderers(scene)
    nodes = []
    for renderer in renderers:
        radius = renderer.view.radius
        lens = pyrender.PerspectiveCamera(np.radians(40.0), znear=0.1 * radius, zfar=20.0 * radius)
        nodes.append(kept.add(lens, pose=np.linalg.inv(renderer.view.eye)))

    def draw() -> None:
        for node in nodes:
            kept.main_camera_node = node
            drawer.render(kept)

    seconds = _seconds(draw)
    drawer.delete()
    return len(nodes) / seconds
