"""Part types: which parts of the models are alike, by congruence, or by congruence and the models' own labels; by
meaning, what is called alike is alike in all but its surface."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.congruence import ComparableMesh, comparable_mesh, congruences
from stages.exemplars.frame import extremal_frame
from stages.exemplars.model import Model, RawPart
from stages.exemplars.repair import repair_mesh
from stages.exemplars.settings import KitConfig
from stages.shape.arrays import FloatArray
from stages.shape.kit import Assembly, PartType

__all__ = ["Identified", "identify_parts"]


@dataclass(frozen=True)
class Identified:
    """The parts of the models by type.

    assemblies: one for each model, without edges yet; part_names: the names of their parts; repairs: how often a
    mesh was changed in what way; empty: model and name of each part that has no triangle with area, left out;
    aliases: for each type the models' other words for its parts, in order of appearance.
    """

    types: tuple[PartType, ...]
    assemblies: tuple[Assembly, ...]
    part_names: tuple[tuple[str, ...], ...]
    repairs: Mapping[str, int]
    empty: tuple[tuple[Model, str], ...]
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


def identify_parts(models: Sequence[Model], config: KitConfig) -> Identified:
    """Repair the parts of `models` and give each its type, in the order in which types appear.

    Part coordinates have their origin in the part's centroid, so a relative pose's translation is the way from
    centroid to centroid. Raises ConfigError for a model in which no part has any area.
    """
    repairs: Counter[str] = Counter()
    types: list[_Type] = []
    assemblies: list[Assembly] = []
    part_names: list[tuple[str, ...]] = []
    empty: list[tuple[Model, str]] = []
    for model in models:
        seen: dict[tuple[str, str | None], tuple[int, FloatArray] | None] = {}
        names: list[str] = []
        indices: list[int] = []
        poses: list[FloatArray] = []
        for part in model.parts:
            label = None if config.types == "congruence" else part.label
            key = (part.mesh_name, label)
            if key not in seen:
                seen[key] = _identify(part, label, config, types, repairs)
            found = seen[key]
            if found is None:
                empty.append((model, part.name))
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
    return Identified(
        part_types, tuple(assemblies), tuple(part_names), dict(sorted(repairs.items())), tuple(empty), aliases
    )


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
