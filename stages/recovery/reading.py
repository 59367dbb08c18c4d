"""Read inputs of recovery from files: clouds, meshes, drawings, folders of them, and shards of a dataset."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.bounded import ChildFailed, in_child
from stages.recovery.inputs import InputError, RecoveryInput, checked_cloud, ink_from_picture
from stages.shape.arrays import ByteArray, FloatArray

TABLE_SUFFIXES = (".txt", ".xyz", ".csv")
CLOUD_SUFFIXES = (".npy", *TABLE_SUFFIXES, ".ply", ".obj", ".glb", ".gltf", ".stl", ".off")
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".webp", ".tif", ".tiff")
PICTURE_FORMATS = ("PNG", "JPEG", "BMP", "WEBP", "TIFF")
"""Formats that Pillow may try, whatever the file is called; for some others it starts programs."""
READING_CPU_SECONDS = 300
READING_MEMORY_MB = 4000
MESH_SURFACE_POINTS = 8192
MAX_DRAWING_SIDE_PIXELS = 8192


def read_inputs(path: Path) -> Iterator[RecoveryInput | InputError]:
    """Read all inputs of a file, a folder or a shard, in order; a faulty one is yielded as its error.

    Raises InputError where there is nothing to read.
    """
    known = CLOUD_SUFFIXES + IMAGE_SUFFIXES
    if path.is_dir():
        files = [file for file in sorted(path.iterdir()) if file.is_file() and file.suffix.lower() in known]
        if not files:
            raise InputError(f"{path} holds no cloud and no drawing; known are {', '.join(known)}")
        stems = Counter(file.stem for file in files)
        for file in files:
            for source in read_inputs(file):
                if isinstance(source, RecoveryInput) and stems[file.stem] > 1:
                    yield replace(source, name=file.name)
                else:
                    yield source
    elif not path.is_file():
        raise InputError(f"there is no file {path}")
    elif path.suffix.lower() == ".tar":
        yield from _read_shard(path)
    else:
        try:
            yield _read_file(path)
        except InputError as error:
            yield error


def _read_file(path: Path) -> RecoveryInput:
    suffix, name = path.suffix.lower(), str(path)
    if suffix in IMAGE_SUFFIXES:
        return RecoveryInput(path.stem, ink=ink_from_picture(_in_child(lambda: _read_picture(path, name), path), name))
    if suffix not in CLOUD_SUFFIXES:
        known = ", ".join(CLOUD_SUFFIXES + IMAGE_SUFFIXES)
        raise InputError(f"{path} is neither a cloud nor a drawing; known are {known}, .tar")
    return RecoveryInput(path.stem, points=checked_cloud(_in_child(lambda: _read_points(path), path), name))


def _in_child(read: Callable[[], Any], path: Path) -> Any:
    """Run `read`, which returns an array, in a child process with limits of CPU time and memory."""

    def content() -> bytes:
        stream = io.BytesIO()
        np.save(stream, np.asarray(read()), allow_pickle=False)
        return stream.getvalue()

    try:
        array = in_child(content, cpu_seconds=READING_CPU_SECONDS, memory_mb=READING_MEMORY_MB, refusal=InputError)
    except ChildFailed as error:
        raise InputError(f"{path} cannot be read: {error}") from None
    return np.load(io.BytesIO(array), allow_pickle=False)


def _read_shard(path: Path) -> Iterator[RecoveryInput | InputError]:
    """Yield the cloud of each sample, or its first drawing where it has no cloud."""
    import tarfile

    from pipeline.shards import read_shard

    try:
        for key, members in read_shard(path):
            name = f"{path}, sample {key}"
            if key in ("", ".", "..") or set(key) & set("/\\\0"):
                yield InputError(f"{path}, sample {key!r}: its key is no file name, and results are filed under it")
                continue
            try:
                if "points.npy" in members:
                    yield RecoveryInput(key, points=checked_cloud(_load_array(members["points.npy"], name), name))
                elif "sketch0.png" in members:
                    picture = _read_picture(io.BytesIO(members["sketch0.png"]), name)
                    yield RecoveryInput(key, ink=ink_from_picture(picture, name))
                else:
                    yield InputError(f"{name} has neither points.npy nor sketch0.png")
            except InputError as error:
                yield error
    except tarfile.TarError as error:
        raise InputError(f"{path} is no shard: {error}") from error


def _read_points(path: Path) -> Any:
    suffix = path.suffix.lower()
    if suffix == ".npy":
        return _load_array(path.read_bytes(), str(path))
    try:
        if suffix in TABLE_SUFFIXES:
            return np.loadtxt(path, delimiter="," if suffix == ".csv" else None, ndmin=2)
        return _scene_points(path)
    except MemoryError:
        raise
    except Exception:  # the readers are third-party code and raise anything; the file is to blame
        kind = "table of numbers" if suffix in TABLE_SUFFIXES else f"{suffix} file"
        raise InputError(f"{path} cannot be read: it is no whole {kind}; export it again") from None


def _scene_points(path: Path) -> FloatArray:
    """The vertices of a cloud, or points on the surface of a mesh, float64 (n, 3)."""
    import trimesh

    from stages.points.area_sampling import sample_surface

    geometries = trimesh.load_scene(path, process=False, skip_materials=True).dump()
    meshes = [mesh for mesh in geometries if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)]
    if meshes:
        starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
        vertices = np.concatenate([np.asarray(mesh.vertices, np.float64) for mesh in meshes])
        faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)])
        return sample_surface(vertices, faces.astype(np.int32), MESH_SURFACE_POINTS, np.random.default_rng(0))[0]
    clouds = [np.asarray(cloud.vertices, np.float64) for cloud in geometries if hasattr(cloud, "vertices")]
    return np.concatenate(clouds) if clouds else np.empty((0, 3))


def _load_array(content: bytes, name: str) -> Any:
    try:
        return np.load(io.BytesIO(content), allow_pickle=False)
    except Exception:  # such as a header that claims too much memory, or is no Python literal
        raise InputError(f"{name} is no whole NumPy array of numbers; save it again") from None


def _read_picture(source: Path | io.BytesIO, name: str) -> ByteArray:
    """The picture, uint8 (h, w, 3), on white where it is transparent."""
    from PIL import Image, UnidentifiedImageError

    limit = f"{MAX_DRAWING_SIDE_PIXELS:,}"
    try:
        with Image.open(source, formats=PICTURE_FORMATS) as image:
            if max(image.size) > MAX_DRAWING_SIDE_PIXELS:
                size = " × ".join(f"{side:,}" for side in image.size)
                raise InputError(f"{name} has {size} pixels: a drawing has at most {limit} a side; shrink it")
            layer = image.convert("RGBA")
            return np.asarray(Image.alpha_composite(Image.new("RGBA", layer.size, "white"), layer).convert("RGB"))
    except InputError:
        raise
    except UnidentifiedImageError:
        raise InputError(f"{name} is no picture: none of {', '.join(PICTURE_FORMATS)}") from None
    except Image.DecompressionBombError:
        raise InputError(f"{name} has too many pixels: shrink it to {limit} a side") from None
    except Exception:  # Pillow's readers raise anything for a damaged file
        raise InputError(f"{name} is no picture: it is cut off or damaged") from None
