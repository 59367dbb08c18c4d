"""Inputs from files: clouds, meshes, drawings, folders of them, and shards of a dataset."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.bounded import ChildFailed, in_child
from stages.shape.arrays import BoolArray, ByteArray, FloatArray
from stages.training.recovery.drawings import fit_to_square

CLOUDS = (".npy", ".txt", ".xyz", ".csv", ".ply", ".obj", ".glb", ".gltf", ".stl", ".off")
IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".webp", ".tif", ".tiff")
PICTURES = ("PNG", "JPEG", "BMP", "WEBP", "TIFF")
"""What is looked for in a picture, whatever it is called: of other formats Pillow starts programs."""
CPU_SECONDS = 300
MEMORY_MB = 4000
"""What reading one file may take, in a process of its own."""
FEWEST_POINTS = 32
SURFACE_POINTS = 8192
"""Points that are drawn of a mesh."""
LARGEST_SIDE = 8192
"""Pixels of a side that a drawing has at most."""
MOST_INK = 0.35
"""Share of a drawing that is ink at most: a photograph has no background."""
MOST_COLOUR = 24.0
"""Mean difference between the channels of a drawing at most, of 255."""
CONTRAST = 40
"""Grey levels that ink differs from the background by at least, of 255."""


class InputError(ValueError):
    """What was given is no cloud and no drawing; the message says why, and what would be one."""


@dataclass(frozen=True)
class RecoveryInput:
    """Either `points` float64 (n, 3) or fitted `ink` bool (side, side), and the name that results are filed under."""

    name: str
    points: FloatArray | None = None
    ink: BoolArray | None = None


def read_inputs(path: Path) -> Iterator[RecoveryInput | InputError]:
    """All inputs of a file, a folder or a shard, in order; what is wrong with one keeps no other back.

    Raises InputError where there is nothing to read at all.
    """
    if path.is_dir():
        files = [each for each in sorted(path.iterdir()) if each.is_file() and each.suffix.lower() in CLOUDS + IMAGES]
        if not files:
            raise InputError(f"{path} holds no cloud and no drawing; known are {', '.join(CLOUDS + IMAGES)}")
        stems = Counter(each.stem for each in files)
        for each in files:
            for given in read_inputs(each):
                if isinstance(given, RecoveryInput) and stems[each.stem] > 1:
                    yield replace(given, name=each.name)
                else:
                    yield given
    elif not path.is_file():
        raise InputError(f"there is no file {path}")
    elif path.suffix.lower() == ".tar":
        yield from _of_shard(path)
    else:
        try:
            yield _of_file(path)
        except InputError as error:
            yield error


def checked_cloud(points: Any, name: str = "the cloud") -> FloatArray:
    """A cloud as float64 (n, 3), of an array (n, 3) or wider. Raises InputError for an empty one, for too few points,
    for numbers that are not finite, and for points that are all at one place."""
    try:
        cloud = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} holds no numbers: {error}") from error
    if cloud.size == 0:
        raise InputError(f"{name} is empty: a cloud needs at least {FEWEST_POINTS} points")
    if cloud.ndim != 2 or cloud.shape[1] < 3:
        raise InputError(f"{name} is of shape {cloud.shape}: a cloud is (points, 3)")
    cloud = np.ascontiguousarray(cloud[:, :3])
    if len(cloud) < FEWEST_POINTS:
        count = f"{len(cloud)} point{'s' if len(cloud) > 1 else ''}"
        raise InputError(f"{name} has {count}: a cloud needs at least {FEWEST_POINTS}")
    wrong = int((~np.isfinite(cloud)).any(axis=1).sum())
    if wrong:
        raise InputError(f"{name}: {wrong} of {len(cloud)} points are not finite (NaN or infinity); take them out")
    if not float(np.ptp(cloud, axis=0).max()) > 0.0:
        raise InputError(f"{name}: all {len(cloud)} points are at one place")
    return cloud


def ink_from_picture(picture: ByteArray, name: str = "the drawing") -> BoolArray:
    """The fitted ink, bool (side, side), of a drawing uint8 (h, w) or (h, w, 3), dark on light or light on dark.

    Raises InputError for a picture in colour, for one without lines, and for one that is no line drawing.
    """
    if picture.ndim == 3 and picture.shape[2] >= 3:
        channels = picture[..., :3].astype(np.int16)
        if float((channels.max(axis=2) - channels.min(axis=2)).mean()) > MOST_COLOUR:
            raise InputError(f"{name} is a picture in colour: give a drawing, lines on a plain ground")
        picture = channels.mean(axis=2).astype(np.uint8)
    if picture.ndim != 2 or not picture.size:
        raise InputError(f"{name} is of shape {picture.shape}: a drawing is (height, width)")
    grey = picture.astype(np.int16)
    ground = int(np.median(grey))
    difference = np.abs(grey - ground)
    strongest = int(difference.max())
    if strongest < CONTRAST:
        raise InputError(f"{name} is blank: no line stands out from its ground")
    ink: BoolArray = difference > max(strongest // 2, CONTRAST // 2)
    busy = float((difference > CONTRAST).mean())
    if busy > MOST_INK:
        raise InputError(f"{name} is a photograph, or shaded: {busy:.0%} of it is no ground; give a line drawing")
    return fit_to_square(ink)


def _of_file(path: Path) -> RecoveryInput:
    suffix = path.suffix.lower()
    if suffix in IMAGES:
        return RecoveryInput(
            path.stem, ink=ink_from_picture(_read_apart(lambda: _picture(path, str(path)), path), str(path))
        )
    if suffix not in CLOUDS:
        raise InputError(f"{path} is neither a cloud nor a drawing; known are {', '.join(CLOUDS + IMAGES)}, .tar")
    return RecoveryInput(path.stem, points=checked_cloud(_read_apart(lambda: _points(path), path), str(path)))


def _read_apart(read: Callable[[], Any], path: Path) -> Any:
    """The array that `read` makes of a file, in a child process that may take so much and no more."""

    def content() -> bytes:
        stream = io.BytesIO()
        np.save(stream, np.asarray(read()), allow_pickle=False)
        return stream.getvalue()

    try:
        found = in_child(content, cpu_seconds=CPU_SECONDS, memory_mb=MEMORY_MB, refusal=InputError)
    except ChildFailed as error:
        raise InputError(f"{path} cannot be read: {error}") from None
    return np.load(io.BytesIO(found), allow_pickle=False)


def _of_shard(path: Path) -> Iterator[RecoveryInput | InputError]:
    """Of each sample the cloud, or, where it has none, the first drawing."""
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
                    yield RecoveryInput(key, points=checked_cloud(_array(members["points.npy"], name), name))
                elif "sketch0.png" in members:
                    yield RecoveryInput(
                        key, ink=ink_from_picture(_picture(io.BytesIO(members["sketch0.png"]), name), name)
                    )
                else:
                    yield InputError(f"{name} has neither points.npy nor sketch0.png")
            except InputError as error:
                yield error
    except tarfile.TarError as error:
        raise InputError(f"{path} is no shard: {error}") from error


def _points(path: Path) -> Any:
    suffix = path.suffix.lower()
    if suffix == ".npy":
        return _array(path.read_bytes(), str(path))
    try:
        if suffix in (".txt", ".xyz", ".csv"):
            return np.loadtxt(path, delimiter="," if suffix == ".csv" else None, ndmin=2)
        return _scene_points(path)
    except MemoryError:
        raise
    except Exception:  # readers of many formats, not ours: whatever they raise, the file is to blame
        kind = "table of numbers" if suffix in (".txt", ".xyz", ".csv") else f"{suffix} file"
        raise InputError(f"{path} cannot be read: it is no whole {kind}; export it again") from None


def _scene_points(path: Path) -> FloatArray:
    """The vertices of a cloud, or points on the surface of a mesh."""
    import trimesh

    from stages.points.area_sampling import sample_surface

    loaded = trimesh.load_scene(path, process=False, skip_materials=True)
    meshes = [each for each in loaded.dump() if isinstance(each, trimesh.Trimesh) and len(each.faces)]
    if meshes:
        starts = np.cumsum([0, *(len(each.vertices) for each in meshes[:-1])])
        vertices = np.concatenate([np.asarray(each.vertices, np.float64) for each in meshes])
        faces = np.concatenate([each.faces + start for each, start in zip(meshes, starts, strict=True)])
        return sample_surface(vertices, faces.astype(np.int32), SURFACE_POINTS, np.random.default_rng(0))[0]
    clouds = [np.asarray(each.vertices, np.float64) for each in loaded.dump() if hasattr(each, "vertices")]
    return np.concatenate(clouds) if clouds else np.empty((0, 3))


def _array(content: bytes, name: str) -> Any:
    try:
        return np.load(io.BytesIO(content), allow_pickle=False)
    except Exception:  # a header that claims too much memory, or is no Python literal, among others
        raise InputError(f"{name} is no whole NumPy array of numbers; save it again") from None


def _picture(source: Path | io.BytesIO, name: str) -> ByteArray:
    """The picture, uint8 (h, w) or (h, w, 3), on white where it is transparent."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(source, formats=PICTURES) as image:
            if max(image.size) > LARGEST_SIDE:
                size = " × ".join(f"{side:,}" for side in image.size)
                raise InputError(f"{name} has {size} pixels: a drawing has at most {LARGEST_SIDE:,} a side; shrink it")
            layer = image.convert("RGBA")
            return np.asarray(Image.alpha_composite(Image.new("RGBA", layer.size, "white"), layer).convert("RGB"))
    except InputError:
        raise
    except UnidentifiedImageError:
        raise InputError(f"{name} is no picture: none of {', '.join(PICTURES)}") from None
    except Image.DecompressionBombError:
        raise InputError(f"{name} has too many pixels: shrink it to {LARGEST_SIDE:,} a side") from None
    except Exception:  # of a damaged file Pillow's readers raise what came up
        raise InputError(f"{name} is no picture: it is cut off or damaged") from None
