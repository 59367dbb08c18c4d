"""Read inputs of recovery from files: clouds, meshes, drawings, folders of them, and shards of a dataset."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.cloud_files.array_file import read_array_file
from stages.cloud_files.number_table import InvalidTable
from stages.cloud_files.read import CLOUD_SUFFIXES, read_cloud
from stages.cloud_files.read import UNREAD_SUFFIXES as UNREAD_CLOUDS
from stages.model_files.exact_vertices import exact_vertices
from stages.model_files.read import read_model
from stages.model_files.scene import ModelScene
from stages.model_files.scene_file import READERS
from stages.recovery.drawing_file import IMAGE_SUFFIXES, parse_drawing, read_drawing
from stages.recovery.drawing_file import UNREAD_SUFFIXES as UNREAD_DRAWINGS
from stages.recovery.inputs import InputError, RecoveryInput, checked_cloud, ink_from_picture
from stages.shape.arrays import FloatArray
from stages.shape.input_file import check_exists, check_input_file, without_sidecars

INPUT_SUFFIXES = tuple(dict.fromkeys((*CLOUD_SUFFIXES, *READERS, *IMAGE_SUFFIXES)))
MESH_SURFACE_POINTS = 8192
ORDER_STEPS = 1000
"""Steps of a mesh's longest side to which corners are rounded where triangles are put in order."""


def read_inputs(path: Path) -> Iterator[RecoveryInput | InputError]:
    """Read all inputs of a file, a folder or a shard, in order; a faulty one is yielded as its error.

    Raises InputError where there is nothing to read.
    """
    if path.is_dir():
        yield from _read_folder(path)
        return
    try:
        check_exists(path)
    except ConfigError as error:
        raise InputError(str(error)) from None
    if path.suffix.lower() == ".tar" and path.is_file():
        yield from _read_shard(path)
    else:
        try:
            yield _read_file(path)
        except (ConfigError, InputError) as error:
            yield error if isinstance(error, InputError) else InputError(str(error))


def _read_folder(path: Path) -> Iterator[RecoveryInput | InputError]:
    known = (*INPUT_SUFFIXES, *UNREAD_CLOUDS, *UNREAD_DRAWINGS)
    files, sidecars = without_sidecars(
        file for file in sorted(path.iterdir()) if file.is_file() and file.suffix.lower() in known
    )
    if not files:
        left_out = f" ({sidecars} `._` files of macOS were left out)" if sidecars else ""
        raise InputError(f"{path} holds no cloud and no drawing{left_out}; known are {', '.join(INPUT_SUFFIXES)}")
    stems = Counter(file.stem for file in files)
    for number, file in enumerate(files):
        for source in read_inputs(file):
            if isinstance(source, InputError):
                yield source
                continue
            warnings = source.warnings
            if sidecars and number == 0:
                warnings = (*warnings, f"{sidecars} `._` files of macOS in the folder were left out")
            yield replace(source, name=file.name if stems[file.stem] > 1 else source.name, warnings=warnings)


def _read_file(path: Path) -> RecoveryInput:
    """Return the input in a file. Raises ConfigError or InputError, which begins with the path."""
    suffix, name = path.suffix.lower(), str(path)
    if suffix in IMAGE_SUFFIXES or suffix in UNREAD_DRAWINGS:
        drawing = read_drawing(path)
        return RecoveryInput(path.stem, ink=ink_from_picture(drawing.pixels, name), warnings=drawing.warnings)
    cloud = read_cloud(path)
    if cloud is not None:
        return RecoveryInput(path.stem, points=checked_cloud(cloud.points, name), warnings=cloud.warnings)
    if suffix not in READERS:
        check_input_file(path)
        known = ", ".join(INPUT_SUFFIXES)
        raise InputError(f"{path} is neither a cloud nor a drawing; known are {known}, .tar")
    model = read_model(path)
    return RecoveryInput(path.stem, points=checked_cloud(surface_points(model), name), warnings=model.warnings)


def surface_points(model: ModelScene) -> FloatArray:
    """Return points on the surface of a model in its own coordinates, float64 (MESH_SURFACE_POINTS, 3).

    They depend on the triangles and hardly on their order, so that a model gives the same points in every format.
    """
    from stages.points.area_sampling import sample_surface

    placed = zip(exact_vertices(model), model.placements, strict=True)
    corners = np.concatenate([vertices[model.surfaces[place.surface].faces] for vertices, place in placed])
    low = corners.min(axis=(0, 1))
    size = float(np.ptp(corners, axis=(0, 1)).max()) or 1.0
    steps = np.rint((corners - low) / size * ORDER_STEPS).astype(np.int64)
    first = np.lexsort(steps.transpose(2, 0, 1)[::-1], axis=1)[:, 0]
    turns = (first[:, None] + np.arange(3)) % 3
    corners, steps = (np.take_along_axis(array, turns[..., None], axis=1) for array in (corners, steps))
    corners = corners[np.lexsort(steps.reshape(-1, 9).T[::-1])]
    faces = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    points: FloatArray = sample_surface(corners.reshape(-1, 3), faces, MESH_SURFACE_POINTS, np.random.default_rng(0))[0]
    return points


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
                    cloud = read_array_file(members["points.npy"], ".npy").finite()
                    yield RecoveryInput(key, points=checked_cloud(cloud.points, name), warnings=cloud.warnings)
                elif "sketch0.png" in members:
                    drawing = parse_drawing(members["sketch0.png"], name)
                    yield RecoveryInput(key, ink=ink_from_picture(drawing.pixels, name), warnings=drawing.warnings)
                else:
                    yield InputError(f"{name} has neither points.npy nor sketch0.png")
            except InvalidTable as error:
                yield InputError(f"{name} {error}")
            except (ConfigError, InputError) as error:
                yield error if isinstance(error, InputError) else InputError(str(error))
    except tarfile.TarError as error:
        raise InputError(f"{path} is no shard: {error}") from error
