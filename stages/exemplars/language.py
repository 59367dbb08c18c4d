"""The language of kits: a sample is an assembly of a kit's parts, at their poses and with their stretches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.paths import DatasetPaths
from pipeline.stage import Plan
from stages.shape.arrays import IntArray
from stages.shape.collection.language import Language, RebuildShape, Source
from stages.shape.kit import Assembly, Kit
from stages.shape.kit_files import load_kit
from stages.shape.kit_input import input_kits
from stages.shape.sample import Sample
from stages.shape.shape import Shape, kit_shape, mesh_name, part_count
from stages.shape.stretch import split


class KitDecoder:
    """Decode samples with the kits that a shard reads."""

    def __init__(self, kits: Mapping[str, Kit]) -> None:
        self._kits = kits
        self.sources = {name: _source(kit) for name, kit in kits.items()}

    def shape(self, sample: Sample) -> Shape:
        """Return the parts of the sample's assembly at their poses."""
        return kit_shape(self._kits[sample.kit], sample.assembly)

    def shown(self, count: int) -> Sequence[tuple[str, Shape]]:
        """Return the exemplars of all kits, at most twice `count`; the commonest part types fill the last row."""
        exemplars = [(kit, exemplar) for kit in self._kits.values() for exemplar in kit.exemplars][: 2 * count]
        shapes = [(exemplar.name, kit_shape(kit, exemplar.assembly)) for kit, exemplar in exemplars]
        captioned = [(f"{name}, {part_count(shape)}", shape) for name, shape in shapes]
        return [*captioned, *self._commonest(-len(shapes) % count)]

    def _commonest(self, count: int) -> list[tuple[str, Shape]]:
        parts = []
        for kit in self._kits.values():
            used = np.concatenate([exemplar.assembly.types for exemplar in kit.exemplars])
            commonest = np.argsort(-np.bincount(used, minlength=len(kit.types)), kind="stable")
            for index in commonest[: -(-count // len(self._kits))].tolist():
                assemblies = [exemplar.assembly for exemplar in kit.exemplars]
                assembly = next(assembly for assembly in assemblies if index in assembly.types)
                pose = assembly.poses[assembly.types == index][:1]
                alone = Assembly(np.array([index], dtype=np.int16), pose, np.empty((0, 2), dtype=np.int32))
                parts.append((f"part {kit.types[index].name}", kit_shape(kit, alone)))
        return parts[:count]


def _source(kit: Kit) -> Source:
    count = len(kit.exemplars)
    _, first = np.unique(kit.label_of, return_index=True)
    colors = [np.median(kit.types[index].face_colors, axis=0).astype(np.uint8).tolist() for index in first.tolist()]
    return Source(
        kit.labels,
        tuple((red, green, blue) for red, green, blue in colors),
        f"{count} exemplar{'' if count == 1 else 's'}, {len(kit.types)} part types",
        kit.contact_tolerance,
    )


def _reads(plan: Plan) -> tuple[str, ...]:
    return tuple(f"exemplars/{name}" for name in plan.shards("exemplars"))


def dataset_kits(paths: DatasetPaths) -> dict[str, Kit]:
    """Return the kits of a dataset, from the output of the stage `exemplars`."""
    folder = paths.stage("exemplars").root
    return {
        path.stem: load_kit(path, path.with_suffix(".tar"))
        for path in sorted(folder.glob("*.json"))
        if path.with_suffix(".tar").is_file()
    }


def _rebuild(paths: DatasetPaths) -> RebuildShape:
    """Return a function that puts the kit's meshes at the poses of a record."""
    kits = dataset_kits(paths)

    def shape(record: Mapping[str, Any], contacts: IntArray) -> Shape:
        if record["kit"] not in kits:
            raise LookupError(f"kit {record['kit']} is missing next to the dataset in .work")
        kit = kits[record["kit"]]
        index_of = {name: index for index, name in enumerate(kit.type_names())}
        meshes = [mesh_name(part["name"]) for part in record["parts"]]
        poses = [part["pose"] for part in record["parts"]]
        unknown = sorted(set(meshes) - set(index_of))
        if unknown:
            raise ValueError(f"kit {kit.name} has no part type {', '.join(unknown)}")
        types = np.array([index_of[mesh] for mesh in meshes], dtype=np.int16)
        rigid, stretches = split(np.array(poses, dtype=np.float64))
        return replace(kit_shape(kit, Assembly(types, rigid, contacts, stretches)), up="y")

    return shape


LANGUAGE = Language(
    name="kit",
    reads=_reads,
    decoder=lambda task: KitDecoder(input_kits(task)),
    graphs=True,
    text="",
    rebuild=_rebuild,
    coordinates="The origin of a mesh is the middle of the box around the part as "
    "its model file has it. The origin of a shape may be anywhere.",
)
