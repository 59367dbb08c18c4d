"""What is a part: scene nodes, named objects, or the pieces of a mesh by material, colour, connection, symmetry or
sections."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from stages.exemplars.cut_surface import cut_by_sections, cut_by_symmetry, search_size
from stages.exemplars.formats.scene import ModelScene, Placement, Surface, UniqueNames
from stages.shape.geometry.connected_faces import connected_faces

Segmentation = Literal["auto", "nodes", "objects", "materials", "colors", "components", "symmetry", "sections"]
SOURCES: tuple[Segmentation, ...] = ("nodes", "objects", "materials", "colors", "components")

PALETTE = 64
"""More colours than this are shading, not labels."""
ENOUGH = 3
"""A mesh in one piece is cut by its symmetries if that makes so many parts."""
LARGEST = 1_200_000
"""Cells and triangles up to which symmetries are looked for unasked: with more it takes minutes and gigabytes."""

_WORDS = {
    "nodes": "scene nodes",
    "objects": "named objects",
    "materials": "materials",
    "colors": "face or vertex colours",
    "components": "connected components",
}


def count_parts(scene: ModelScene) -> dict[Segmentation, int]:
    """How many parts each source of parts would make of a scene; a source that the scene does not have is left out, and
    so is symmetry, which takes long."""
    counts: dict[Segmentation, int] = {scene.kind: len(scene.placements)}
    for source in SOURCES[2:]:
        pieces = [_pieces(each, source) for each in scene.surfaces]
        if any(each is not None for each in pieces):
            sizes = [1 if each is None else len(each) for each in pieces]
            counts[source] = sum(sizes[placement.surface] for placement in scene.placements)
    return counts


def pick_segmentation(scene: ModelScene) -> tuple[Segmentation, str, ModelScene]:
    """The source that `auto` takes, one sentence that says why, and the scene with one placement for each part.

    Scene nodes or named objects if there are at least two, for they are their author's parts; then materials, then
    colours, unless they are too many to be labels; then connected components; and of a mesh in one piece what repeats,
    unless it has so much surface for its size that the search would take long.
    """
    if len(scene.placements) > 1:
        return scene.kind, f"{len(scene.placements)} {_WORDS[scene.kind]}", scene
    counts = count_parts(scene)
    passed = [f"one {_WORDS[scene.kind][:-1]}"]
    for source in SOURCES[2:]:
        labels = _label_count(scene, source)
        if labels < 2 and source != "components":
            passed.append(f"one of the {_WORDS[source]}" if labels else f"no {_WORDS[source]}")
        elif source == "colors" and labels > PALETTE:
            passed.append(f"{labels} colours, which are shading and not labels")
        elif counts[source] > 1:
            pieces = f"{counts[source]} {_WORDS[source]}"
            if source != "components":
                pieces = f"{counts[source]} connected pieces of {labels} {_WORDS[source]}"
            return source, f"{', '.join(passed)}; {pieces}", segment_scene(scene, source)
        else:
            passed.append("one connected component")
    told = ", ".join(passed)
    size = search_size(scene)
    if size > LARGEST:
        why = f"{told}: too much surface to look unasked for what repeats, about {size:,} cells and triangles"
        return scene.kind, f"{why} where {LARGEST:,} are the most; `parts: symmetry` looks all the same", scene
    parted = cut_by_symmetry(scene)
    if len(parted.placements) >= ENOUGH:
        return "symmetry", f"{told}; {len(parted.placements)} pieces between copies of what repeats", parted
    return scene.kind, f"{told}: nothing tells parts apart", scene


def segment_scene(scene: ModelScene, source: Segmentation) -> ModelScene:
    """The scene with one placement for each part.

    Nodes and objects are what the scene already has. The pieces of one material or of one colour are the connected
    regions of its faces, named and labelled by it; pieces of a surface that several nodes place stay shared. Pieces by
    symmetry are those of the whole scene, and those that are equal share a surface.
    """
    if source == scene.kind:
        return scene
    if source == "symmetry":
        return cut_by_symmetry(scene)
    if source == "sections":
        return cut_by_sections(scene)
    alone = len(scene.placements) == 1
    surfaces: list[Surface] = []
    cut: list[list[tuple[str, str | None, int]]] = []
    for surface in scene.surfaces:
        named: list[tuple[str, str | None, int]] = []
        for name, label, faces in _pieces(surface, source) or [("rest", None, np.arange(len(surface.faces)))]:
            named.append((name, label, len(surfaces)))
            surfaces.append(replace(surface.select(faces), name=name if alone else f"{surface.name}/{name}"))
        cut.append(named)
    placements = [
        Placement(name if alone else f"{placement.name}/{name}", label, index, placement.pose)
        for placement in scene.placements
        for name, label, index in cut[placement.surface]
    ]
    return replace(scene, surfaces=tuple(surfaces), placements=tuple(placements))


def _pieces(surface: Surface, source: Segmentation) -> list[tuple[str, str | None, np.ndarray]] | None:
    """Name, label and faces of each piece of a surface, in the order of their first faces; None without a source."""
    labels: list[str | None]
    kinds = np.zeros(len(surface.faces), dtype=np.int64)
    if source == "materials":
        if surface.face_material is None or surface.face_material.max(initial=-1) < 0:
            return None
        kinds = surface.face_material.astype(np.int64) + 1
        labels = ["no material", *surface.materials]
    elif source == "colors":
        if surface.paint is None:
            return None
        palette, kinds = np.unique(surface.paint, axis=0, return_inverse=True)
        kinds = kinds.reshape(-1)
        labels = ["#{:02x}{:02x}{:02x}".format(*color) for color in palette.tolist()]
    else:
        labels = [None]
    component = connected_faces(surface.vertices, surface.faces, kinds)
    order = np.argsort(component, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(component[order])) + 1) if len(order) else []
    width = max(3, len(str(len(groups))))
    names = UniqueNames()
    pieces: list[tuple[str, str | None, np.ndarray]] = []
    for number, faces in enumerate(groups):
        label = labels[kinds[faces[0]]]
        name = names(label) if label is not None else f"component-{number:0{width}d}"
        pieces.append((name, label, faces))
    return pieces


def _label_count(scene: ModelScene, source: Segmentation) -> int:
    """How many materials or colours the faces of a scene have."""
    of_faces = [each.face_material if source == "materials" else each.paint for each in scene.surfaces]
    found = [each for each in of_faces if each is not None]
    return len(np.unique(np.concatenate(found), axis=0)) if found else 0
