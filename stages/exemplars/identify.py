"""Part types: which parts of the models are alike, by congruence, or by congruence and the models' own labels; by
meaning, what is called alike is alike in all but its surface."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from pipeline.errors import ConfigError
from stages.exemplars.congruence import ComparableMesh, comparable_mesh, congruences
from stages.exemplars.extremal_frame import extremal_frame
from stages.exemplars.label_map import apply_label_map
from stages.exemplars.model import Model, RawPart
from stages.exemplars.repair import repair_mesh
from stages.exemplars.settings import KitConfig
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert, pose_vectors
from stages.shape.kit import Assembly, PartType


@dataclass(frozen=True)
class IdentifiedParts:
    """The parts of the models by type.

    assemblies: one for each model, without edges yet; part_names: the names of their parts; repairs: how often a
    mesh was changed in what way; left_out: model, name and reason of each part that is not among them, for it has no
    triangle with area or stands where another of its type does; aliases: for each type the models' other words for
    its parts, in order of appearance.
    """

    types: tuple[PartType, ...]
    assemblies: tuple[Assembly, ...]
    part_names: tuple[tuple[str, ...], ...]
    repairs: Mapping[str, int]
    left_out: tuple[tuple[Model, str, str], ...]
    aliases: tuple[tuple[str, ...], ...]

    @property
    def median_diagonal(self) -> float:
        """The median of the parts' diagonals, by which tolerances are measured."""
        return float(np.median([self.types[index].diagonal for each in self.assemblies for index in each.types]))


@dataclass
class _Type:
    """A part type, its mesh ready for comparison, the label it stands for, and the models' words for it,
    its own first."""

    mesh: ComparableMesh
    part: PartType
    label: str | None
    words: dict[str, None]


def identify_parts(models: Sequence[Model], config: KitConfig) -> IdentifiedParts:
    """Repair the parts of `models`, called by what the config says they mean, and give each its type, in the order in
    which types appear.

    Of parts of one type at one place, as modelling tools leave them behind, the first stays. Part
    coordinates have their origin in the part's centroid, so a relative pose's translation is the way from centroid to
    centroid. Raises ConfigError for a model in which no part has any area, and for a meaning of no part.
    """
    repairs: Counter[str] = Counter()
    types: list[_Type] = []
    assemblies: list[Assembly] = []
    part_names: list[tuple[str, ...]] = []
    left_out: list[tuple[Model, str, str]] = []
    for model, parts in zip(models, apply_label_map(models, config), strict=True):
        seen: dict[tuple[str, str | None], tuple[int, FloatArray] | None] = {}
        names: list[str] = []
        indices: list[int] = []
        poses: list[FloatArray] = []
        for part in parts:
            label = None if config.types == "congruence" else part.label
            key = (part.mesh_name, label)
            if key not in seen:
                seen[key] = _identify(part, label, config, types, repairs)
            found = seen[key]
            if found is None:
                left_out.append((model, part.name, "it has no triangle with area"))
                continue
            if model.segmentation != "components":  # whose names are only numbers
                types[found[0]].words[_word(part)] = None
            names.append(part.name)
            indices.append(found[0])
            poses.append(part.pose @ found[1])
        if not names:
            raise ConfigError(f"{model.path}: no part has a triangle with area; export the model with its surfaces")
        no_edges = np.empty((0, 2), dtype=np.int32)
        assemblies.append(Assembly(np.array(indices, dtype=np.int16), np.array(poses), no_edges))
        part_names.append(tuple(names))
    part_types = tuple(each.part for each in types)
    aliases = tuple(tuple(each.words)[1:] for each in types)
    whole = IdentifiedParts(
        part_types, tuple(assemblies), tuple(part_names), dict(sorted(repairs.items())), (), aliases
    )
    for index, model in enumerate(models):
        other = coincident_parts(part_types, assemblies[index], config.pose_tolerance * whole.median_diagonal)
        called = part_names[index]
        left_out += [
            (model, called[part], f"it stands at the very place of {called[first]}") for part, first in other.items()
        ]
        keep = np.setdiff1d(np.arange(len(called)), list(other))
        assemblies[index], part_names[index] = assemblies[index].select(keep), tuple(called[part] for part in keep)
    return replace(whole, assemblies=tuple(assemblies), part_names=tuple(part_names), left_out=tuple(left_out))


def coincident_parts(types: Sequence[PartType], assembly: Assembly, tolerance: float) -> dict[int, int]:
    """The parts at the very place of an earlier one of their type, each with that one.

    tolerance: how far a pose, up to the symmetries of its type, may be from another's to be the same, in units of the
    models.
    """
    twice: dict[int, int] = {}
    for index in np.unique(assembly.types).tolist():
        parts, part_type = np.flatnonzero(assembly.types == index), types[index]
        poses, length = assembly.poses[parts], part_type.diagonal / 2
        near = cKDTree(poses[:, :3, 3]).query_pairs(tolerance, output_type="ndarray")
        symmetries = pose_vectors(part_type.symmetries, length)
        for first, second in near[np.lexsort((near[:, 1], near[:, 0]))].tolist():
            moved = pose_vectors(invert(poses[first])[None] @ poses[second][None], length)
            if parts[first] not in twice and np.linalg.norm(symmetries - moved, axis=1).min() <= tolerance:
                twice.setdefault(int(parts[second]), int(parts[first]))
    return twice


def _identify(
    part: RawPart, label: str | None, config: KitConfig, types: list[_Type], repairs: Counter[str]
) -> tuple[int, FloatArray] | None:
    """The type of a part, added to `types` if it is new, and the motion (4, 4) from the type's coordinates into the
    part's; None for a part without area."""
    vertices, faces, colors, repair = repair_mesh(part.vertices, part.faces, part.face_colors)
    repairs.update(repair.changes)
    if len(faces) == 0:
        return None
    shape = comparable_mesh(vertices, faces)
    for index, each in enumerate(types):
        if each.label == label:
            motions = congruences(each.mesh, shape, config.congruence_tolerance, config.mirror_images_match)
            if len(motions):
                # Both meshes are compared about their centroids; the type's coordinates start at its own.
                motion = motions[0].copy()
                motion[:3, 3] = shape.centroid
                return index, motion
    centred = vertices - shape.centroid
    symmetries = congruences(shape, shape, config.congruence_tolerance, config.mirror_images_match)
    symmetries[:, :3, 3] = 0.0
    part_type = PartType(
        name=_fresh_name(part, [each.part.name for each in types]),
        vertices=centred,
        faces=faces,
        face_colors=colors,
        frame=extremal_frame(centred, np.zeros(3)),
        symmetries=symmetries,
        meaning=_word(part) if config.types == "meaning" else "",
    )
    types.append(_Type(shape, part_type, label, {_word(part): None}))
    into_part = np.eye(4)
    into_part[:3, 3] = shape.centroid
    return len(types) - 1, into_part


def _fresh_name(part: RawPart, taken: Sequence[str]) -> str:
    """A type name from the model's own words, of letters, digits, `-` and `_`, not yet taken."""
    stem = _word(part)
    name, number = stem, 2
    while name in taken:
        name, number = f"{stem}_{number}", number + 1
    return name


def _word(part: RawPart) -> str:
    """The model's own word for a part's type, of letters, digits, `-` and `_`."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", part.label or part.mesh_name or part.name).strip("_") or "part"
