"""Shapes to measure: from a finished dataset, a model file, or a file of boxes."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import ConfigError
from pipeline.shards import read_shard
from stages.exemplars.build import observe_models
from stages.exemplars.read import read_parts
from stages.exemplars.settings import STRICTEST, KitConfig, ShapeFile
from stages.shape.arrays import FloatArray
from stages.shape.collection.pairs import CONTACTS, pairs_of
from stages.shape.kit import Assembly, Kit, PartMesh
from stages.shape.shape import Shape

NO_CONTACTS = np.empty((0, 2), dtype=np.int32)
QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
BOX_FACES = np.array([face for a, b, c, d in QUADS for face in ((a, b, c), (a, c, d))], dtype=np.int32)
UNIT_BOX = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def dataset_shapes(folder: Path, max_shapes: int) -> Iterator[tuple[str, Shape]]:
    """Yield at most `max_shapes` evenly spread shapes of a finished dataset, each with the name of its kit.

    Raises ConfigError if there is no dataset in `folder`.
    """
    shards = _data_shards(folder)
    total: int = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["samples"]
    step = max(1, -(-total // max_shapes))
    samples = (members for shard in shards for _, members in read_shard(shard))
    for members in islice(samples, 0, None, step):
        record = json.loads(members["json"])
        yield str(record["kit"]), _sample_shape(record, members)


def split_shapes(folder: Path) -> Iterator[tuple[str, str, str, Shape]]:
    """Yield kit, split, key and shape of each sample of a finished dataset.

    Raises ConfigError if there is no dataset in `folder`.
    """
    for shard in _data_shards(folder):
        for key, members in read_shard(shard):
            record = json.loads(members["json"])
            yield str(record["kit"]), str(record["split"]), key, _sample_shape(record, members)


def _data_shards(folder: Path) -> list[Path]:
    shards = sorted((folder / "data").glob("*/*.tar"))
    if not shards:
        raise ConfigError(f"there is no dataset in {folder}; make it first: make dataset CONFIG=...")
    return shards


def model_shapes(path: Path, up: str) -> Iterator[tuple[str, Shape]]:
    """Yield the name and the shape of a model file, as in `model_kits`."""
    for name, kit in model_kits(path, up):
        yield name, Shape(kit.types, kit.exemplars[0].assembly, kit.up, kit.type_names())


def model_kits(path: Path, up: str) -> Iterator[tuple[str, Kit]]:
    """Yield the kit of a model file and its name: that of the file, or of its folder if the file is called `model`."""
    name = path.parent.name if path.stem == "model" else path.stem
    config = KitConfig(name="model", shapes=(ShapeFile(path=path),), up="z" if up == "z" else "y")
    config = config.resolve(STRICTEST)
    yield name, observe_models(config, [read_parts(path, config.parts, units=config.units)]).kit


def box_shapes(path: Path, up: str) -> Iterator[tuple[str, Shape]]:
    """Yield the name of a file of boxes and each of its shapes.

    The file is an `.npz` with `part_corners`, float (n, 8, 3), corners of each box in any order, and `part_offsets`,
    int (k + 1,): the boxes of shape i are those from `part_offsets[i]` to `part_offsets[i + 1]`. Raises ConfigError if
    arrays are missing.
    """
    with np.load(path, allow_pickle=False) as stored:
        if not {"part_corners", "part_offsets"} <= set(stored.files):
            raise ConfigError(f"{path} has no arrays part_corners and part_offsets; it holds {', '.join(stored.files)}")
        corners, offsets = stored["part_corners"].astype(np.float64), stored["part_offsets"]
    for first, last in zip(offsets[:-1].tolist(), offsets[1:].tolist(), strict=True):
        yield path.stem, box_shape(corners[first:last], up)


def box_shape(corners: FloatArray, up: str) -> Shape:
    """Return the shape of boxes with corners float64 (n, 8, 3), in any order; boxes without volume are left out.

    Raises ConfigError for corners that form no box.
    """
    from stages.shape.physics.boxes import recognise_boxes

    is_box, centres, axes, halves = recognise_boxes(corners)
    spans = np.linalg.svd(corners - corners.mean(axis=1, keepdims=True), compute_uv=False)
    full = spans[:, 2] > 1e-4 * spans[:, 0]
    if (full & ~is_box).any():
        raise ConfigError(f"the corners of part {int(np.argmax(full & ~is_box))} form no box")
    axes[np.linalg.det(axes) < 0, 2] *= -1
    poses = np.tile(np.eye(4), (int(full.sum()), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = axes[full].transpose(0, 2, 1), centres[full]
    grey = np.full((12, 3), 160, np.uint8)
    meshes = tuple(PartMesh("box", UNIT_BOX * 2 * half, BOX_FACES, grey) for half in halves[full])
    assembly = Assembly(np.arange(len(meshes), dtype=np.int16), poses, NO_CONTACTS)
    return Shape(meshes, assembly, "z" if up == "z" else "y", ("box",))


def _sample_shape(record: Mapping[str, Any], members: Mapping[str, bytes]) -> Shape:
    """Return the shape of a sample; its GLB is y up."""
    import trimesh

    scene = trimesh.load_scene(io.BytesIO(members["glb"]), file_type="glb", process=False)
    placed = [scene.graph.get(part["name"]) for part in record["parts"]]
    names = [part["label"] for part in record["parts"]]
    geometries = list(dict.fromkeys(geometry for _, geometry in placed))
    label_of = {geometry: name for (_, geometry), name in zip(placed, names, strict=True)}
    assembly = Assembly(
        types=np.array([geometries.index(geometry) for _, geometry in placed], dtype=np.int16),
        poses=np.array([pose for pose, _ in placed], dtype=np.float64),
        edges=pairs_of(members[CONTACTS]),
    )
    meshes = tuple(_welded(label_of[geometry], scene.geometry[geometry]) for geometry in geometries)
    return Shape(meshes, assembly, "y", tuple(dict.fromkeys(names)))


def _welded(name: str, mesh: Any) -> PartMesh:
    """Return a mesh without duplicate vertices; a GLB repeats a vertex for each of its colours."""
    vertices, index = np.unique(np.asarray(mesh.vertices, dtype=np.float64), axis=0, return_inverse=True)
    faces = index.reshape(-1)[np.asarray(mesh.faces)].astype(np.int32)
    return PartMesh(name, vertices, faces, np.full((len(faces), 3), 160, np.uint8))


def shared_meshes(shapes: Sequence[Shape]) -> list[Shape]:
    """Return the same shapes on one shared list of distinct meshes."""
    indices: dict[tuple[bytes, bytes], int] = {}
    meshes: list[PartMesh] = []
    index_of: list[list[int]] = []
    for shape in shapes:
        own = []
        for mesh in shape.meshes:
            key = mesh.vertices.tobytes(), mesh.faces.tobytes()
            if key not in indices:
                indices[key] = len(meshes)
                meshes.append(mesh)
            own.append(indices[key])
        index_of.append(own)
    labels = tuple(dict.fromkeys(mesh.name for mesh in meshes))
    shared = tuple(meshes)
    return [
        Shape(
            shared,
            Assembly(np.array(own)[shape.assembly.types], shape.assembly.poses, shape.assembly.edges),
            shape.up,
            labels,
        )
        for shape, own in zip(shapes, index_of, strict=True)
    ]
