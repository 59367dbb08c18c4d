"""Cut a scene into parts: its nodes or objects, or pieces by material, colour, connection, symmetry or sections."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.errors import ConfigError
from stages.exemplars.cut_surface import cut_by_sections, cut_by_symmetry, search_size
from stages.exemplars.model import STATED_IN_CONFIG
from stages.exemplars.recurring_components import divide_objects
from stages.exemplars.settings import Segmentation
from stages.model_files.scene import ModelScene, Placement, Surface, UniqueNames
from stages.shape.geometry.connected_faces import connected_faces

SOURCES: tuple[Segmentation, ...] = ("nodes", "objects", "materials", "colors", "components")
CUTS: tuple[Segmentation, ...] = ("symmetry", "sections")
"""The sources that search a surface for what repeats, instead of reading parts off the file."""
NOT_CUT = "which is not cut"
"""Why a mesh has one part whose cut by symmetry failed."""

MAX_LABEL_COLORS = 64
"""More colours are shading, not labels."""
MIN_SYMMETRY_PARTS = 3
"""Parts from which a mesh in one piece is cut by its symmetries."""
MAX_SEARCH_SIZE = 1_200_000
"""Cells and triangles up to which `auto` looks for symmetries: more takes minutes and gigabytes."""

_WORDS = {
    "nodes": "scene nodes",
    "objects": "named objects",
    "materials": "materials",
    "colors": "face or vertex colours",
    "components": "connected components",
}


def segment_into_parts(
    path: Path, scene: ModelScene, segmentation: Segmentation, may_cut: bool = True
) -> tuple[ModelScene, Segmentation, str]:
    """Return the scene with one placement for each part, the source of the parts, and a sentence that says why.

    may_cut: whether `auto` may cut one mesh by its symmetries.

    Raises ConfigError for a stated source that the scene does not have.
    """
    if segmentation == "auto":
        source, why, segmented = pick_segmentation(scene, may_cut)
        return segmented, source, why
    if segmentation not in (scene.kind, *CUTS):
        counts = count_parts(scene)
        if segmentation not in counts:
            offered = ", ".join(f"{name} ({count})" for name, count in counts.items())
            raise ConfigError(
                f"{path}: has no {segmentation} to take parts from; it has {offered}, or set `parts: auto`"
            )
    return segment_scene(scene, segmentation), segmentation, STATED_IN_CONFIG


def count_parts(scene: ModelScene) -> dict[Segmentation, int]:
    """Return how many parts each source would make of a scene; without sources that the scene does not have, and
    without symmetry, which takes long."""
    counts: dict[Segmentation, int] = {scene.kind: len(scene.placements)}
    for source in SOURCES[2:]:
        pieces = [_pieces(surface, source) for surface in scene.surfaces]
        if any(listed is not None for listed in pieces):
            sizes = [1 if listed is None else len(listed) for listed in pieces]
            counts[source] = sum(sizes[placement.surface] for placement in scene.placements)
    return counts


def pick_segmentation(scene: ModelScene, may_cut: bool = True) -> tuple[Segmentation, str, ModelScene]:
    """Return the source that `auto` takes, one sentence that says why, and the scene with one placement for each part.

    Two or more scene nodes or named objects are their author's parts; components that recur within one of a few objects
    become parts too. Otherwise materials are tried, then colours
    unless they are too many to be labels, then connected components. A mesh in one piece is cut where it repeats
    itself, if `may_cut`, unless its surface is so large for its size that the search would take long.
    """
    if len(scene.placements) > 1:
        counted = f"{len(scene.placements)} {_WORDS[scene.kind]}"
        divided = divide_objects(scene)
        return (scene.kind, counted, scene) if divided is None else (scene.kind, f"{counted}; {divided[1]}", divided[0])
    counts = count_parts(scene)
    passed = [f"one {_WORDS[scene.kind][:-1]}"]
    for source in SOURCES[2:]:
        labels = _label_count(scene, source)
        if labels < 2 and source != "components":
            passed.append(f"one of the {_WORDS[source]}" if labels else f"no {_WORDS[source]}")
        elif source == "colors" and labels > MAX_LABEL_COLORS:
            passed.append(f"{labels} colours, which are shading and not labels")
        elif counts[source] > 1:
            pieces = f"{counts[source]} {_WORDS[source]}"
            if source != "components":
                pieces = f"{counts[source]} connected pieces of {labels} {_WORDS[source]}"
            return source, f"{', '.join(passed)}; {pieces}", segment_scene(scene, source)
        else:
            passed.append("one connected component")
    reasons = ", ".join(passed)
    if not may_cut:
        return scene.kind, f"{reasons}, {NOT_CUT}", scene
    size = search_size(scene)
    if size > MAX_SEARCH_SIZE:
        why = f"{reasons}: too much surface to look unasked for what repeats, about {size:,} cells and triangles"
        return scene.kind, f"{why} where {MAX_SEARCH_SIZE:,} are the most; `parts: symmetry` looks all the same", scene
    segmented = cut_by_symmetry(scene)
    if len(segmented.placements) >= MIN_SYMMETRY_PARTS:
        return "symmetry", f"{reasons}; {len(segmented.placements)} pieces between copies of what repeats", segmented
    return scene.kind, f"{reasons}: nothing tells parts apart", scene


def segment_scene(scene: ModelScene, source: Segmentation) -> ModelScene:
    """Return the scene with one placement for each part, taken from `source`.

    The scene already has its nodes or objects. The pieces of one material or colour are the connected regions of its
    faces, named and labelled by it; pieces of a surface that several nodes place stay shared. Pieces by symmetry are
    those of the whole scene, and equal pieces share a surface.
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
    """Return name, label and faces of each piece of a surface, in the order of their first faces; None if the surface
    does not have the source."""
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
    """Return how many materials or colours the faces of a scene have."""
    labels = [surface.face_material if source == "materials" else surface.paint for surface in scene.surfaces]
    known = [of_faces for of_faces in labels if of_faces is not None]
    return len(np.unique(np.concatenate(known), axis=0)) if known else 0
