"""Identify part types: by congruence, by congruence and the models' own labels, or by labels alone (meaning)."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from pipeline.errors import ConfigError
from stages.exemplars.congruence import ComparableMesh, are_alike_in_size, comparable_mesh, congruences
from stages.exemplars.extremal_frame import extremal_frame
from stages.exemplars.label_map import apply_label_map
from stages.exemplars.model import Model, RawPart
from stages.exemplars.moved_look import look_on
from stages.exemplars.repair import repair_mesh
from stages.exemplars.settings import KitConfig
from stages.model_files.scene import Surface
from stages.shape.appearance import NO_MATERIAL, Appearance
from stages.shape.arrays import FloatArray
from stages.shape.geometry.penetration import DepthMemory
from stages.shape.geometry.pose import invert, pose_vectors
from stages.shape.kit import Assembly, PartType


@dataclass(frozen=True)
class IdentifiedParts:
    """The parts of the models by type.

    assemblies: one for each model, without edges yet.
    part_names: the names of their parts.
    repairs: number of repairs by kind.
    left_out: model, name and reason of each part that is not used: it has no triangle with area, or it coincides with
        another of its type.
    aliases: for each type its other names in the models, in order of appearance.
    other_looks: model and name of each part whose colours or materials are lost: it has those of its type's first part.
    """

    types: tuple[PartType, ...]
    assemblies: tuple[Assembly, ...]
    part_names: tuple[tuple[str, ...], ...]
    repairs: Mapping[str, int]
    left_out: tuple[tuple[Model, str, str], ...]
    aliases: tuple[tuple[str, ...], ...]
    other_looks: tuple[tuple[Model, str], ...] = ()

    @property
    def median_diagonal(self) -> float:
        """The median of the parts' diagonals, the unit of tolerances."""
        return float(
            np.median([self.types[index].diagonal for assembly in self.assemblies for index in assembly.types])
        )

    @cached_property
    def depths(self) -> DepthMemory:
        """What is known of the penetration depths of the parts."""
        return DepthMemory(self.types)


@dataclass
class _Type:
    """A part type with its prepared mesh, its label, the models' names for it, its own first, and its looks by what
    they show.
    """

    mesh: ComparableMesh
    part: PartType
    label: str | None
    names: dict[str, None]
    looks: dict[frozenset[Any], int]


class _Types:
    """The types found so far, and their sizes, which rule most of them out for a part at once."""

    def __init__(self) -> None:
        self.found: list[_Type] = []
        self._names: set[str] = set()
        self._numbers: dict[str, int] = {}
        self._sizes = np.empty((64, 3))

    def add(self, new: _Type) -> int:
        """Add a type, and return its index."""
        number = len(self.found)
        if number == len(self._sizes):
            self._sizes = np.concatenate([self._sizes, np.empty_like(self._sizes)])
        self._sizes[number] = new.mesh.size
        self.found.append(new)
        self._names.add(new.part.name)
        return number

    def alike(self, shape: ComparableMesh, label: str | None, tolerance: float) -> Iterator[tuple[int, _Type]]:
        """Yield the types of a label that may be congruent to a mesh, with their indices."""
        for number in np.flatnonzero(are_alike_in_size(self._sizes[: len(self.found)], shape, tolerance)).tolist():
            if self.found[number].label == label:
                yield number, self.found[number]

    def fresh_name(self, part: RawPart) -> str:
        """Return a name for the type of a part that no other type has, of letters, digits, `-` and `_`."""
        stem = _type_name(part)
        name, number = stem, self._numbers.get(stem, 2)
        while name in self._names:
            name, number = f"{stem}_{number}", number + 1
        self._numbers[stem] = max(number - 1, 2)
        return name


class _Identified(NamedTuple):
    """The type of a part, the transform (4, 4) from type to part coordinates, its look, and whether that is its own."""

    part_type: int
    into_part: FloatArray
    look: int
    is_own_look: bool


def identify_parts(models: Sequence[Model], config: KitConfig) -> IdentifiedParts:
    """Repair the parts of `models`, labelled by the config's label map, and find their types, in order of appearance.

    Modelling tools leave coincident parts behind; of those of one type the first is kept. Part coordinates have their
    origin in the part's centroid, so the translation of a relative pose leads from centroid to centroid. Raises
    ConfigError for a model in which no part has any area, and for a pattern that fits no part.
    """
    repairs: Counter[str] = Counter()
    types = _Types()
    assemblies: list[Assembly] = []
    part_names: list[tuple[str, ...]] = []
    left_out: list[tuple[Model, str, str]] = []
    other_looks: list[tuple[Model, str]] = []
    for model, parts in zip(models, apply_label_map(models, config), strict=True):
        known: dict[tuple[str, str | None], _Identified | None] = {}
        names: list[str] = []
        indices: list[int] = []
        poses: list[FloatArray] = []
        looks: list[int] = []
        for part in parts:
            label = None if config.types == "congruence" else part.label
            key = (part.mesh_name, label)
            if key not in known:
                known[key] = _identify(part, label, config, types, repairs)
            identified = known[key]
            if identified is None:
                left_out.append((model, part.name, "it has no triangle with area"))
                continue
            index = identified.part_type
            if model.segmentation != "components":  # whose names are only numbers
                types.found[index].names[_type_name(part)] = None
            if not identified.is_own_look:
                other_looks.append((model, part.name))
            names.append(part.name)
            indices.append(index)
            poses.append(part.pose @ identified.into_part)
            looks.append(identified.look)
        if not names:
            raise ConfigError(f"{model.path}: no part has a triangle with area; export the model with its surfaces")
        no_edges = np.empty((0, 2), dtype=np.int32)
        look_of = np.array(looks, dtype=np.int16)
        assemblies.append(Assembly(np.array(indices, dtype=np.int16), np.array(poses), no_edges, looks=look_of))
        part_names.append(tuple(names))
    part_types = tuple(known_type.part for known_type in types.found)
    aliases = tuple(tuple(known_type.names)[1:] for known_type in types.found)
    whole = IdentifiedParts(
        *(part_types, tuple(assemblies), tuple(part_names), dict(sorted(repairs.items())), (), aliases),
        tuple(other_looks),
    )
    for number, model in enumerate(models):
        earlier = coincident_parts(part_types, assemblies[number], config.pose_tolerance * whole.median_diagonal)
        own_names = part_names[number]
        left_out += [
            (model, own_names[part], f"it coincides with {own_names[first]}") for part, first in earlier.items()
        ]
        keep = np.setdiff1d(np.arange(len(own_names)), list(earlier))
        assemblies[number] = assemblies[number].select(keep)
        part_names[number] = tuple(own_names[part] for part in keep)
    return replace(whole, assemblies=tuple(assemblies), part_names=tuple(part_names), left_out=tuple(left_out))


def coincident_parts(types: Sequence[PartType], assembly: Assembly, tolerance: float) -> dict[int, int]:
    """Return the parts that coincide with an earlier part of their type, each with that part.

    tolerance: largest distance of equal poses, up to the symmetries of the type, in units of the models.
    """
    earlier: dict[int, int] = {}
    for index in np.unique(assembly.types).tolist():
        parts, part_type = np.flatnonzero(assembly.types == index), types[index]
        poses, length = assembly.poses[parts], part_type.diagonal / 2
        near = cKDTree(poses[:, :3, 3]).query_pairs(tolerance, output_type="ndarray")
        symmetries = pose_vectors(part_type.symmetries, length)
        for first, second in near[np.lexsort((near[:, 1], near[:, 0]))].tolist():
            moved = pose_vectors(invert(poses[first])[None] @ poses[second][None], length)
            if parts[first] not in earlier and np.linalg.norm(symmetries - moved, axis=1).min() <= tolerance:
                earlier.setdefault(int(parts[second]), int(parts[first]))
    return earlier


def _identify(
    part: RawPart, label: str | None, config: KitConfig, types: _Types, repairs: Counter[str]
) -> _Identified | None:
    """Return the type of a part, added to `types` if new, and its look, added to its type if new and if the config
    keeps it; None for a part without area.
    """
    vertices, faces, sources, repair = repair_mesh(part.vertices, part.faces)
    repairs.update(repair.changes)
    if len(faces) == 0:
        return None
    shape = comparable_mesh(vertices, faces)
    for index, known_type in types.alike(shape, label, config.congruence_tolerance):
        transforms = congruences(known_type.mesh, shape, config.congruence_tolerance, config.mirror_images_match)
        if len(transforms):
            # Both meshes are compared about their centroids; the type's coordinates start at its own.
            transforms[:, :3, 3] = shape.centroid
            shown = _look_of(part)
            if shown in known_type.looks:
                return _Identified(index, transforms[0].copy(), known_type.looks[shown], True)
            if config.appearance.keep == "textures":
                own = Surface(part.name, vertices, faces, part.face_colors[sources])
                own = replace(own, appearance=_repaired_look(part, vertices[faces], sources))
                found = look_on(known_type.part, own, transforms, config.congruence_tolerance)
                if found is not None:
                    into_part, look = found
                    known_type.looks[shown] = len(known_type.looks)
                    others = (*known_type.part.other_looks, look)
                    known_type.part = replace(known_type.part, other_looks=others)
                    return _Identified(index, into_part, known_type.looks[shown], True)
            return _Identified(index, transforms[0].copy(), 0, False)
    centred = vertices - shape.centroid
    symmetries = congruences(shape, shape, config.congruence_tolerance, config.mirror_images_match)
    symmetries[:, :3, 3] = 0.0
    part_type = PartType(
        name=types.fresh_name(part),
        vertices=centred,
        faces=faces,
        face_colors=part.face_colors[sources],
        frame=extremal_frame(centred, np.zeros(3)),
        symmetries=symmetries,
        meaning=_type_name(part) if config.types == "meaning" else "",
        appearance=_repaired_look(part, vertices[faces], sources),
    )
    added = types.add(_Type(shape, part_type, label, {_type_name(part): None}, {_look_of(part): 0}))
    into_part = np.eye(4)
    into_part[:3, 3] = shape.centroid
    return _Identified(added, into_part, 0, True)


def _look_of(part: RawPart) -> frozenset[Any]:
    """Return the materials of a part, or the colours of its faces if it has none."""
    look = part.appearance
    if look is not None and look.face_material.max(initial=NO_MATERIAL) > NO_MATERIAL:
        return frozenset(look.materials[number] for number in np.unique(look.face_material) if number != NO_MATERIAL)
    return frozenset(map(tuple, np.unique(part.face_colors, axis=0).tolist()))


def _repaired_look(part: RawPart, corners: FloatArray, sources: np.ndarray) -> Appearance | None:
    """Return the look of the repaired faces with `corners` (k, 3, 3), whose faces in the file are `sources` (k,)."""
    if part.appearance is None:
        return None
    given = part.vertices[part.faces[sources]]
    place = (corners[:, :, None] == given[:, None]).all(axis=3).argmax(axis=2)
    return part.appearance.select(sources, place).facing(corners)


def _type_name(part: RawPart) -> str:
    """Return the model's own name for a part's type, of letters, digits, `-` and `_`."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", part.label or part.mesh_name or part.name).strip("_") or "part"
