"""A sheet of replacements: source, cut, replacement and result of each, in the colours of the two pieces.

The source is the shape of which more is in the result: a whole shape that is put to four parts of another is easier to
read as four parts that are put to it. Shapes are drawn without their backdrops, and results as they lie upon their
sources, not as they face in the dataset.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.pose import invert
from stages.shape.kit import Assembly, Kit
from stages.shape.sample import Sample
from stages.shape.shape import kit_shape, upright
from stages.shape.views.buffers import visible_triangles
from stages.shape.views.camera import Camera
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import Scene, scene_of
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png
from stages.variations.selection.orientation import vertical_turn

SHOWN = 12
CELL = 300
CAMERAS = tuple(Camera(azimuth=azimuth, elevation=25.0) for azimuth in (-40.0, 50.0, 140.0, 230.0))
GLANCE = 96
"""Sides of the pictures by which a camera is chosen; unit: pixels."""
PLAIN, TAKEN, COME = (np.array(each, dtype=np.uint8) for each in ((205, 205, 200), (200, 70, 60), (60, 110, 190)))

Named = tuple[str, Assembly]


@dataclass(frozen=True)
class DrawnReplacement:
    """base and giver: what they are called, and their parts; taken bool (n,) and piece bool (m,): which parts of them
    leave and come; result: what was made, where the base stands; came bool (k,): which parts of it are the giver's."""

    base: Named
    giver: Named
    taken: BoolArray
    piece: BoolArray
    result: Assembly
    came: BoolArray


def replacements_sheet(kit: Kit, samples: Sequence[Sample]) -> bytes | None:
    """The first replacements among the samples of a kit as PNG, a row each: the source with what is taken out of it,
    what stays of it, the giver with what is copied, and the result; None where there are none."""
    known, rows = known_shapes(kit, samples), []
    for sample in samples:
        found = replacement_of(kit, sample, known)
        if found is None:
            continue
        rows.append(_row(kit, sample.key, found))
        if len(rows) == SHOWN:
            break
    if not rows:
        return None
    title = f"{kit.name}: what took the place of what"
    return picture_png(contact_sheet([Section("Source, cut, replacement, result", rows, "")], title, CELL))


def known_shapes(kit: Kit, samples: Sequence[Sample]) -> dict[str, Named]:
    """By the name that lineages have for them, exemplars and samples, with what they are called here: samples by their
    keys, as the search made them."""
    known = {each.name: (each.name, each.assembly) for each in kit.exemplars}
    return known | {each.lineage["name"]: (each.key, _as_made(kit, each)) for each in samples}


def replacement_of(kit: Kit, sample: Sample, known: Mapping[str, Named]) -> DrawnReplacement | None:
    """What took the place of what in a sample that was made of `known` shapes, once and rigidly, the base being the one
    of which more is in it; None of others, and where what stayed of the base moved to make room."""
    lineage = sample.lineage
    if lineage["method"] != "substructures" or lineage["repeats"] > 1 or lineage["deformed"]:
        return None
    if any(name not in known for name in lineage["made_of"]):
        return None
    giver, base = (known[name] for name in lineage["made_of"])
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = lineage["transform"][:3], lineage["transform"][3]
    result, (come, stay) = _as_made(kit, sample), lineage["parts_from"]
    piece = _found(kit, giver[1], motion @ giver[1].poses, result.select(np.arange(come)))
    stays = _found(kit, base[1], base[1].poses, result.select(np.arange(come, come + stay)))
    if piece.sum() != come or stays.sum() != stay:
        return None
    came = np.arange(len(result)) < come
    if come > stay:
        moved = replace(result, poses=invert(motion) @ result.poses)
        return DrawnReplacement(giver, base, ~piece, stays, moved, ~came)
    return DrawnReplacement(base, giver, ~stays, piece, result, came)


def _as_made(kit: Kit, sample: Sample) -> Assembly:
    """The parts that the search put together, as it placed them: before the shape was turned, without its backdrop."""
    turn = vertical_turn({"y": 1, "z": 2}[kit.up], sample.lineage["turned_degrees"])
    bare = sample.assembly.select(np.arange(len(sample.assembly) - sample.lineage["restored_hubs"]))
    return replace(bare, poses=turn.T @ bare.poses)


def _found(kit: Kit, assembly: Assembly, poses: FloatArray, there: Assembly) -> BoolArray:
    """Which parts of an assembly, moved to `poses`, stand among those `there`, bool (n,)."""
    gaps = np.abs(poses[:, None] - there.poses).max(axis=(2, 3))
    found: BoolArray = ((gaps < kit.pose_tolerance) & (assembly.types[:, None] == there.types)).any(axis=1)
    return found


def _row(kit: Kit, key: str, found: DrawnReplacement) -> list[Cell]:
    """The four pictures of a replacement; all but the giver's from where most is seen of what leaves and comes."""
    (base_name, base), (giver_name, giver), result = found.base, found.giver, found.result
    leave, come = int(found.taken.sum()), int(found.piece.sum())
    stays = base.select(np.flatnonzero(~found.taken))
    scenes = [scene_of(upright(kit_shape(kit, each))) for each in (base, stays, giver, result)]
    marks = [found.taken, np.zeros(len(stays), dtype=bool), found.piece, found.came]
    names = [
        f"{base_name}: {leave} of {len(base)} leave",
        f"{len(stays)} stay",
        f"{giver_name}: {come} of {len(giver)} come",
        f"{key}: {len(result)} parts",
    ]
    there, giving = _camera([(scenes[place], marks[place]) for place in (0, 3)]), _camera([(scenes[2], marks[2])])
    cells = []
    for scene, chosen, color, name in zip(scenes, marks, (TAKEN, PLAIN, COME, COME), names, strict=True):
        camera = giving if scene is scenes[2] else there
        paint = np.where(chosen[:, None], color, PLAIN)
        cells.append(Cell(portrait(scene, camera, (CELL, CELL), paint), name))
    return cells


def _camera(marked: Sequence[tuple[Scene, BoolArray]]) -> Camera:
    """The first camera that sees half as much of the marked parts as the one that sees most of them."""
    seen = []
    for camera in CAMERAS:
        pictures = [visible_triangles(scene, camera, (GLANCE, GLANCE), "raster").triangles for scene, _ in marked]
        parts = [scene.triangle_part[each[each >= 0]] for (scene, _), each in zip(marked, pictures, strict=True)]
        seen.append(sum(int(own[each].sum()) for (_, own), each in zip(marked, parts, strict=True)))
    return CAMERAS[next(place for place, count in enumerate(seen) if 2 * count >= max(seen))]
