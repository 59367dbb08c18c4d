"""Objects of many pieces: connected components that recur within one object become parts of their own.

A blind in one object holds a row of slats, and a chest in two objects six drawers. Components that always come in the
same arrangement, such as a drawer's front and its handle, stay together. What occurs once stays one part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stages.model_files.scene import ModelScene, Placement, Surface
from stages.shape.arrays import FloatArray
from stages.shape.geometry.connected_faces import connected_faces
from stages.shape.geometry.triangles import triangle_areas

MAX_OBJECTS = 12
"""Models of more objects have been divided into parts by their authors."""
MAX_COPIES = 64
"""More congruent components of one object are a texture, such as leaves, not parts."""
MAX_PARTS = 300
"""Parts of a model up to which objects are divided."""
CONGRUENCE_TOLERANCE = 1e-3
"""Relative difference of areas and of moments up to which components are congruent."""
ARRANGEMENT_TOLERANCE = 1e-2
"""Difference of positions, as a share of the larger component's size, up to which arrangements are equal."""
MAX_GAP_SHARE = 0.05
"""Largest gap between components of one group, as a share of the larger one's size."""


def divide_objects(scene: ModelScene) -> tuple[ModelScene, str] | None:
    """Return the scene with recurring components as placements of their own, and what was divided, in words.

    None if there is nothing to divide: the author made many parts, parts share surfaces, or no component recurs. The
    parts of an object have its name as their label.
    """
    used = [placement.surface for placement in scene.placements]
    if len(used) > MAX_OBJECTS or len(set(used)) < len(used):
        return None
    divided = {index: pieces for index in used if len(pieces := recurring_pieces(scene.surfaces[index])) > 1}
    if not divided or sum(map(len, divided.values())) + len(used) - len(divided) > MAX_PARTS:
        return None
    surfaces: list[Surface] = []
    placements: list[Placement] = []
    for placement in scene.placements:
        surface = scene.surfaces[placement.surface]
        pieces = divided.get(placement.surface, [np.arange(len(surface.faces))])
        width = max(2, len(str(len(pieces))))
        for number, faces in enumerate(pieces):
            name = placement.name if len(pieces) == 1 else f"{placement.name}/{number:0{width}d}"
            label = placement.label or (placement.name if len(pieces) > 1 else None)
            placements.append(replace(placement, name=name, label=label, surface=len(surfaces)))
            surfaces.append(replace(surface.select(faces), name=name))
    named = ", ".join(
        f"{placement.name} holds {len(divided[placement.surface])} pieces"
        for placement in scene.placements
        if placement.surface in divided
    )
    return replace(scene, surfaces=tuple(surfaces), placements=tuple(placements)), named


def recurring_pieces(surface: Surface) -> list[np.ndarray]:
    """Return the faces of each piece of a surface: groups of components that recur, then all others as one piece."""
    component = connected_faces(surface.vertices, surface.faces, np.zeros(len(surface.faces), dtype=np.int64))
    count = int(component.max(initial=-1)) + 1
    if count < 2:
        return [np.arange(len(surface.faces))]
    order = np.argsort(component, kind="stable")
    faces_of = np.split(order, np.flatnonzero(np.diff(component[order])) + 1)
    classes = _classes(surface, faces_of)
    sizes = np.bincount(classes)
    solid = np.array([triangle_areas(surface.vertices[surface.faces[faces]]).any() for faces in faces_of])
    recurs = (sizes[classes] > 1) & (sizes[classes] <= MAX_COPIES) & solid
    groups = _groups(surface, faces_of, classes, np.flatnonzero(recurs))
    rest = np.flatnonzero(~recurs)
    pieces = [np.sort(np.concatenate([faces_of[member] for member in members])) for members in groups]
    if len(rest):
        pieces.append(np.sort(np.concatenate([faces_of[member] for member in rest.tolist()])))
    return pieces


def _classes(surface: Surface, faces_of: Sequence[np.ndarray]) -> np.ndarray:
    """Return the class of each component, int64 (k,): equal number of faces, area and moments."""
    known: list[tuple[int, FloatArray]] = []
    classes = []
    for faces in faces_of:
        corners = surface.vertices[surface.faces[faces]]
        areas = triangle_areas(corners)
        area = max(float(areas.sum()), 1e-300)
        middles = corners.mean(axis=1)
        centre = (middles * areas[:, None]).sum(axis=0) / area
        spread = middles - centre
        moments = np.linalg.eigvalsh((spread * areas[:, None]).T @ spread / area)
        reach = float(np.linalg.norm(corners.reshape(-1, 3) - centre, axis=1).max())
        measures = np.array([area**0.5, reach, *np.sqrt(np.maximum(moments, 0.0))])
        tolerance = CONGRUENCE_TOLERANCE * max(measures[0], reach)
        equal = (
            number
            for number, (face_count, other) in enumerate(known)
            if face_count == len(faces) and (np.abs(other - measures) <= tolerance).all()
        )
        number = next(equal, len(known))
        if number == len(known):
            known.append((len(faces), measures))
        classes.append(number)
    return np.array(classes, dtype=np.int64)


def _groups(
    surface: Surface, faces_of: Sequence[np.ndarray], classes: np.ndarray, members: np.ndarray
) -> list[list[int]]:
    """Return groups of components that always come in the same arrangement, each once, in order of appearance."""
    boxes = np.array([_box(surface, faces) for faces in faces_of])
    group_of = {member: member for member in members.tolist()}

    def root(member: int) -> int:
        while group_of[member] != member:
            member = group_of[member]
        return member

    kinds = list(dict.fromkeys(classes[members].tolist()))
    for number, kind in enumerate(kinds):
        for other in kinds[number + 1 :]:
            pairs = _same_arrangement(boxes, np.flatnonzero(classes == kind), np.flatnonzero(classes == other))
            for one, two in pairs:
                group_of[root(two)] = root(one)
    groups: dict[int, list[int]] = {}
    for member in members.tolist():
        groups.setdefault(root(member), []).append(member)
    return list(groups.values())


def _same_arrangement(boxes: FloatArray, first: np.ndarray, second: np.ndarray) -> list[tuple[int, int]]:
    """Return pairs of components of two classes, one of each, all at the same offset and near each other; or none."""
    if len(first) != len(second):
        return []
    middles = boxes.mean(axis=1)
    sizes = np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)
    size = float(max(sizes[first[0]], sizes[second[0]]))
    for candidate in second.tolist():
        offset = middles[candidate] - middles[first[0]]
        gaps = np.linalg.norm(middles[first][:, None] + offset - middles[second], axis=2)
        partners = second[gaps.argmin(axis=1)]
        if (gaps.min(axis=1) > ARRANGEMENT_TOLERANCE * size).any() or len(set(partners.tolist())) < len(second):
            continue
        apart = np.maximum(boxes[first, 0] - boxes[partners, 1], boxes[partners, 0] - boxes[first, 1])
        if (apart.max(axis=1) <= MAX_GAP_SHARE * size).all():
            return list(zip(first.tolist(), partners.tolist(), strict=True))
    return []


def _box(surface: Surface, faces: np.ndarray) -> FloatArray:
    points = surface.vertices[surface.faces[faces]].reshape(-1, 3)
    return np.stack([points.min(axis=0), points.max(axis=0)])
