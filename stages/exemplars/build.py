"""From models to a kit: clean parts, part types by congruence, contacts, shape graphs, grammar (strings §3)."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.congruence import Surface, congruences, surface
from stages.exemplars.frame import extremal_frame
from stages.exemplars.grammar import observe
from stages.exemplars.read import Model, RawPart
from stages.exemplars.repair import repair_mesh
from stages.exemplars.settings import KitConfig
from stages.shape.arrays import FloatArray
from stages.shape.contact import ContactTest
from stages.shape.kit import Assembly, ContactKind, Exemplar, Kit, PartType

__all__ = ["KitReport", "build_kit"]


@dataclass(frozen=True)
class KitReport:
    """What building a kit found and did: segmentation of each model, repairs, contacts by kind, warnings."""

    segmentation: tuple[str, ...]
    repairs: dict[str, int]
    contacts: dict[ContactKind, int]
    contact_tolerance: float
    warnings: tuple[str, ...]


@dataclass
class _Type:
    """A part type while it is collected."""

    surface: Surface
    part: PartType
    label: str | None


def build_kit(config: KitConfig, models: Sequence[Model]) -> tuple[Kit, KitReport]:
    """The kit of `models`, and what was found on the way.

    Part coordinates have their origin in the part's centroid, so a relative pose's translation is the way from
    centroid to centroid. Raises ConfigError, with the model, the part and the mend, where no kit can be made.
    """
    repairs: Counter[str] = Counter()
    types: list[_Type] = []
    assemblies: list[Assembly] = []
    for model in models:
        if len(model.parts) < 2:
            raise ConfigError(
                f"{model.path}: has {len(model.parts)} part by {model.segmentation}, an exemplar needs at least 2; "
                "set `parts: components` (or materials, colors), or split the model into one scene node a part"
            )
        assemblies.append(_identify_parts(model, config, types, repairs))
    _check_common_type(models, assemblies)
    part_types = tuple(each.part for each in types)
    diagonals = np.concatenate([[part_types[each].diagonal for each in assembly.types] for assembly in assemblies])
    median = float(np.median(diagonals))
    contact = ContactTest(part_types, config.contact.tolerance * median)
    touching = [replace(each, edges=contact.contacts(each.types, each.poses)) for each in assemblies]
    connected, grammar, kinds = observe(
        part_types, touching, contact, config.pose_tolerance * median, config.contact.kinds
    )
    exemplars: list[Exemplar] = []
    warnings = [f"{model.path.name}: {warning}" for model in models for warning in model.warnings]
    for model, assembly in zip(models, connected, strict=True):
        keep = _one_piece(model, assembly, config, warnings)
        names = tuple(model.parts[index].name for index in keep)
        exemplars.append(Exemplar(model.path.stem, _subassembly(assembly, keep), names))
    if any(len(each.assembly) < len(before) for each, before in zip(exemplars, connected, strict=True)):
        _, grammar, _ = observe(
            part_types,
            [each.assembly for each in exemplars],
            contact,
            config.pose_tolerance * median,
            config.contact.kinds,
        )
    kit = Kit(
        name=config.name,
        types=part_types,
        exemplars=tuple(exemplars),
        grammar=grammar,
        contact_tolerance=contact.tolerance,
        pose_tolerance=config.pose_tolerance * median,
        contact_kinds=config.contact.kinds,
        up=config.up,
    )
    report = KitReport(
        segmentation=tuple(f"{model.path.name}: {model.segmentation}: {model.why}" for model in models),
        repairs=dict(sorted(repairs.items())),
        contacts=dict(kinds),
        contact_tolerance=contact.tolerance,
        warnings=tuple(warnings),
    )
    return kit, report


def _identify_parts(model: Model, config: KitConfig, types: list[_Type], repairs: Counter[str]) -> Assembly:
    """Give each part of a model its type, adding types as they appear; the assembly has no edges yet."""
    seen: dict[tuple[str, str | None], tuple[int, FloatArray]] = {}
    indices: list[int] = []
    poses: list[FloatArray] = []
    for number, part in enumerate(model.parts):
        label = part.label if config.types == "labels" else None
        key = (part.mesh_name or f"\0{number}", label)
        if key not in seen:
            seen[key] = _identify(model, part, label, config, types, repairs)
        index, into_type = seen[key]
        indices.append(index)
        poses.append(part.pose @ into_type)
    return Assembly(np.array(indices, dtype=np.int16), np.array(poses), np.empty((0, 2), dtype=np.int32))


def _identify(
    model: Model, part: RawPart, label: str | None, config: KitConfig, types: list[_Type], repairs: Counter[str]
) -> tuple[int, FloatArray]:
    """The type of a part and the motion (4, 4) from the type's coordinates into the part's."""
    vertices, faces, colors, repair = repair_mesh(part.vertices, part.faces, part.face_colors)
    repairs.update(repair.changes)
    if len(faces) == 0:
        raise ConfigError(f"{model.path}: part {part.name!r} has no triangle with area; remove it from the model")
    shape = surface(vertices, faces)
    for index, each in enumerate(types):
        if each.label == label:
            motions = congruences(each.surface, shape, config.congruence_tolerance, config.mirror_images_match)
            if len(motions):
                # Both surfaces are compared about their centroids; the type's coordinates start at its own.
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
    )
    types.append(_Type(shape, part_type, label))
    into_part = np.eye(4)
    into_part[:3, 3] = shape.centroid
    return len(types) - 1, into_part


def _fresh_name(part: RawPart, taken: Sequence[str]) -> str:
    """A type name from the model's own words, of letters, digits, `-` and `_`, not yet taken."""
    stem = re.sub(r"[^A-Za-z0-9_-]+", "_", part.label or part.mesh_name or part.name).strip("_") or "part"
    name, number = stem, 2
    while name in taken:
        name, number = f"{stem}_{number}", number + 1
    return name


def _check_common_type(models: Sequence[Model], assemblies: Sequence[Assembly]) -> None:
    for model, assembly in zip(models, assemblies, strict=True):
        others = [each for each in assemblies if each is not assembly]
        if others and not set(assembly.types.tolist()) & {t for each in others for t in each.types.tolist()}:
            raise ConfigError(
                f"{model.path}: shares no part type with the other shapes of its kit, so nothing can be exchanged; "
                "make it a kit of its own, or raise `congruence_tolerance` if the parts are meant to be alike"
            )


def _one_piece(model: Model, assembly: Assembly, config: KitConfig, warnings: list[str]) -> np.ndarray:
    """Indices of the parts that stay: all of a connected exemplar, or its largest piece."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges = assembly.edges
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(len(assembly), len(assembly)))
    count, piece = connected_components(graph, directed=False)
    if count == 1:
        return np.arange(len(assembly))
    sizes = np.bincount(piece)
    largest = int(sizes.argmax())
    alone = ", ".join(model.parts[index].name for index in np.flatnonzero(piece != largest)[:5])
    found = f"{count} pieces of {', '.join(str(size) for size in sorted(sizes.tolist(), reverse=True)[:8])} parts"
    if config.disconnected == "error" or sizes[largest] < 2:
        raise ConfigError(
            f"{model.path}: the exemplar falls into {found} (apart: {alone}); move the parts together, raise "
            "`contact.tolerance`, or set `disconnected: largest`"
        )
    warnings.append(f"{model.path.name}: {found}; only the largest is kept (left out: {alone})")
    return np.flatnonzero(piece == largest)


def _subassembly(assembly: Assembly, keep: np.ndarray) -> Assembly:
    renumbered = np.full(len(assembly), -1, dtype=np.int32)
    renumbered[keep] = np.arange(len(keep))
    edges = renumbered[assembly.edges]
    return Assembly(assembly.types[keep], assembly.poses[keep], edges[(edges >= 0).all(axis=1)])
