"""A sheet of replacements: source, cut, replacement and result of each, in the colours of the two pieces.

The source is the shape that gave more parts: a shape with four new parts is easier to read than four parts with a new
    shape. Shapes are drawn without hubs; results lie as their sources do, not as in the dataset.
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

MAX_ROWS_SHOWN = 12
CELL_PIXELS = 300
CAMERAS = tuple(Camera(azimuth=azimuth, elevation=25.0) for azimuth in (-40.0, 50.0, 140.0, 230.0))
CAMERA_TEST_PIXELS = 96
"""Sides of the pictures by which a camera is chosen."""
PLAIN, TAKEN, COME = (np.array(rgb, dtype=np.uint8) for rgb in ((205, 205, 200), (200, 70, 60), (60, 110, 190)))

Named = tuple[str, Assembly]


@dataclass(frozen=True)
class DrawnReplacement:
    """A replacement that is drawn."""

    base: Named
    giver: Named
    taken: BoolArray  # bool (n,), parts of the base that leave
    piece: BoolArray  # bool (m,), parts of the giver that come
    result: Assembly  # in the pose of the base
    came: BoolArray  # bool (k,), parts of the result that are the giver's


def replacements_sheet(kit: Kit, samples: Sequence[Sample]) -> bytes | None:
    """Return the first replacements among the samples of a kit as PNG, a row each; or None.

    A row shows the source with what is taken out, what stays, the giver with what is copied, and the result.
    """
    known, rows = known_shapes(kit, samples), []
    for sample in samples:
        replacement = replacement_of(kit, sample, known)
        if replacement is None:
            continue
        rows.append(_row(kit, sample.key, replacement))
        if len(rows) == MAX_ROWS_SHOWN:
            break
    if not rows:
        return None
    title = f"{kit.name}: what took the place of what"
    return picture_png(contact_sheet([Section("Source, cut, replacement, result", rows, "")], title, CELL_PIXELS))


def known_shapes(kit: Kit, samples: Sequence[Sample]) -> dict[str, Named]:
    """Return exemplars and samples by their names in lineages, with their names here: keys for samples."""
    known = {exemplar.name: (exemplar.name, exemplar.assembly) for exemplar in kit.exemplars}
    return known | {sample.lineage["name"]: (sample.key, _as_made(kit, sample)) for sample in samples}


def replacement_of(kit: Kit, sample: Sample, known: Mapping[str, Named]) -> DrawnReplacement | None:
    """Return the replacement that made a sample of `known` shapes, once and rigidly; None for others.

    The base is the shape that gave more parts. None also where what stayed of the base moved to make room.
    """
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
    """Return the parts that the search put together, as it placed them: before the shape was turned, without hubs."""
    turn = vertical_turn({"y": 1, "z": 2}[kit.up], sample.lineage["turned_degrees"])
    bare = sample.assembly.select(np.arange(len(sample.assembly) - sample.lineage["restored_hubs"]))
    return replace(bare, poses=turn.T @ bare.poses)


def _found(kit: Kit, assembly: Assembly, poses: FloatArray, others: Assembly) -> BoolArray:
    """Return which parts of an assembly, moved to `poses`, are among those `there`, bool (n,)."""
    gaps = np.abs(poses[:, None] - others.poses).max(axis=(2, 3))
    is_there: BoolArray = ((gaps < kit.pose_tolerance) & (assembly.types[:, None] == others.types)).any(axis=1)
    return is_there


def _row(kit: Kit, key: str, drawn: DrawnReplacement) -> list[Cell]:
    """Return the four pictures of a replacement; all but the giver's show most of what leaves and comes."""
    (base_name, base), (giver_name, giver), result = drawn.base, drawn.giver, drawn.result
    leave, come = int(drawn.taken.sum()), int(drawn.piece.sum())
    stays = base.select(np.flatnonzero(~drawn.taken))
    scenes = [scene_of(upright(kit_shape(kit, shape))) for shape in (base, stays, giver, result)]
    marks = [drawn.taken, np.zeros(len(stays), dtype=bool), drawn.piece, drawn.came]
    names = [
        f"{base_name}: {leave} of {len(base)} leave",
        f"{len(stays)} stay",
        f"{giver_name}: {come} of {len(giver)} come",
        f"{key}: {len(result)} parts",
    ]
    base_camera = _camera([(scenes[picture], marks[picture]) for picture in (0, 3)])
    giver_camera = _camera([(scenes[2], marks[2])])
    cells = []
    for scene, chosen, color, name in zip(scenes, marks, (TAKEN, PLAIN, COME, COME), names, strict=True):
        camera = giver_camera if scene is scenes[2] else base_camera
        paint = np.where(chosen[:, None], color, PLAIN)
        cells.append(Cell(portrait(scene, camera, (CELL_PIXELS, CELL_PIXELS), paint), name))
    return cells


def _camera(marked: Sequence[tuple[Scene, BoolArray]]) -> Camera:
    """Return the first camera that sees at least half as much of the marked parts as the best one."""
    seen = []
    for camera in CAMERAS:
        pictures = [
            visible_triangles(scene, camera, (CAMERA_TEST_PIXELS, CAMERA_TEST_PIXELS), "raster").triangles
            for scene, _ in marked
        ]
        parts = [scene.triangle_part[shown[shown >= 0]] for (scene, _), shown in zip(marked, pictures, strict=True)]
        seen.append(sum(int(own[visible].sum()) for (_, own), visible in zip(marked, parts, strict=True)))
    return CAMERAS[next(number for number, count in enumerate(seen) if 2 * count >= max(seen))]
