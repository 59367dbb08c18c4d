"""Shapes to measure, from wherever they are: a finished dataset, a model file, a file of boxes."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import ConfigError
from pipeline.shards import read_shard
from stages.exemplars.build import observe_models
from stages.exemplars.read import read_model
from stages.exemplars.settings import STRICTEST, KitConfig, ShapeFile
from stages.shape.arrays import FloatArray
from stages.shape.collection.pairs import CONTACTS, pairs_of
from stages.shape.kit import Assembly, Kit, PartMesh
from stages.shape.shape import Shape

NO_CONTACTS = np.empty((0, 2), dtype=np.int32)
QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
BOX_FACES = np.array([face for a, b, c, d in QUADS for face in ((a, b, c), (a, c, d))], dtype=np.int32)
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def dataset_shapes(folder: Path, most: int) -> Iterator[tuple[str, Shape]]:
    """Shapes of a finished dataset with the names of their kits, read from its shards: at most `most`, evenly spread.

    Raises ConfigError where no dataset stands in `folder`.
    """
    shards = sorted((folder / "data").glob("*/*.tar"))
    if not shards:
        raise ConfigError(f"no dataset stands in {folder}; make it first: make dataset CONFIG=...")
    total: int = json.loads((folder / "manifest.json").read_text())["samples"]
    step = max(1, -(-total // most))
    number = 0
    for shard in shards:
        for _, members in read_shard(shard):
            if number % step == 0:
                record = json.loads(members["json"])
                yield str(record["kit"]), _sample_shape(record, members)
            number += 1


def split_shapes(folder: Path) -> Iterator[tuple[str, str, str, Shape]]:
    """Every shape of a finished dataset with its kit, its split and its key.

    Raises ConfigError where no dataset stands in `folder`.
    """
    shards = sorted((folder / "data").glob("*/*.tar"))
    if not shards:
        raise ConfigError(f"no dataset stands in {folder}; make it first: make dataset CONFIG=...")
    for shard in shards:
        for key, members in read_shard(shard):
            record = json.loads(members["json"])
            yield str(record["kit"]), str(record["split"]), key, _sample_shape(record, members)


def model_shapes(path: Path, up: str) -> Iterator[tuple[str, Shape]]:
    """The shape in a model file, with the name of `model_kits`."""
    for name, kit in model_kits(path, up):
        yield name, Shape(kit.types, kit.exemplars[0].assembly, kit.up, kit.type_names())


def model_kits(path: Path, up: str) -> Iterator[tuple[str, Kit]]:
    """The kit of a model file, with the file's name, or its folder's where the file is just called `model`."""
    name = path.parent.name if path.stem == "model" else path.stem
    config = KitConfig(name="model", shapes=(ShapeFile(path=path),), up="z" if up == "z" else "y")
    config = config.resolve(STRICTEST)
    yield name, observe_models(config, [read_model(path, config.parts)]).kit


def box_shapes(path: Path, up: str) -> Iterator[tuple[str, Shape]]:
    """The shapes in a file of boxes: an `.npz` with `part_corners` float (n, 8, 3), the corners of each box in any
    order, and `part_offsets` int (k + 1,), where the boxes of each of the k shapes begin and the last end.

    Raises ConfigError for a file that is not so.
    """
    with np.load(path, allow_pickle=False) as stored:
        if not {"part_corners", "part_offsets"} <= set(stored.files):
            raise ConfigError(f"{path} has no arrays part_corners and part_offsets; it holds {', '.join(stored.files)}")
        corners, offsets = stored["part_corners"].astype(np.float64), stored["part_offsets"]
    for first, last in zip(offsets[:-1].tolist(), offsets[1:].tolist(), strict=True):
        yield path.stem, box_shape(corners[first:last], up)


def box_shape(corners: FloatArray, up: str) -> Shape:
    """The shape of boxes with these corners, float64 (n, 8, 3), in any order; boxes without volume are left out.

    Raises ConfigError for corners that are not those of a box.
    """
    from stages.shape.physics.boxes import recognise_boxes

    found, centres, axes, halves = recognise_boxes(corners)
    spans = np.linalg.svd(corners - corners.mean(axis=1, keepdims=True), compute_uv=False)
    full = spans[:, 2] > 1e-4 * spans[:, 0]
    if (full & ~found).any():
        raise ConfigError(f"the corners of part {int(np.argmax(full & ~found))} are not those of a box")
    axes[np.linalg.det(axes) < 0, 2] *= -1
    poses = np.tile(np.eye(4), (int(full.sum()), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = axes[full].transpose(0, 2, 1), centres[full]
    grey = np.full((12, 3), 160, np.uint8)
    meshes = tuple(PartMesh("box", CORNERS * 2 * half, BOX_FACES, grey) for half in halves[full])
    assembly = Assembly(np.arange(len(meshes), dtype=np.int16), poses, NO_CONTACTS)
    return Shape(meshes, assembly, "z" if up == "z" else "y", ("box",))


def _sample_shape(record: Mapping[str, Any], members: Mapping[str, bytes]) -> Shape:
    """A sample of a dataset; its GLB stands upright, y up."""
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
    """A mesh of a file, in which a vertex stands once for each of its colours, with each vertex once."""
    vertices, place = np.unique(np.asarray(mesh.vertices, dtype=np.float64), axis=0, return_inverse=True)
    faces = place.reshape(-1)[np.asarray(mesh.faces)].astype(np.int32)
    return PartMesh(name, vertices, faces, np.full((len(faces), 3), 160, np.uint8))


def shared_meshes(shapes: Sequence[Shape]) -> list[Shape]:
    """The same shapes on one list of meshes, each mesh once: what is known of it serves them all."""
    places: dict[tuple[bytes, bytes], int] = {}
    meshes: list[PartMesh] = []
    place_of: list[list[int]] = []
    for shape in shapes:
        own = []
        for mesh in shape.meshes:
            key = mesh.vertices.tobytes(), mesh.faces.tobytes()
            if key not in places:
                places[key] = len(meshes)
                meshes.append(mesh)
            own.append(places[key])
        place_of.append(own)
    labels = tuple(dict.fromkeys(mesh.name for mesh in meshes))
    shared = tuple(meshes)
    return [
        Shape(
            shared,
            Assembly(np.array(own)[shape.assembly.types], shape.assembly.poses, shape.assembly.edges),
            shape.up,
            labels,
        )
        for shape, own in zip(shapes, place_of, strict=True)
    ]
