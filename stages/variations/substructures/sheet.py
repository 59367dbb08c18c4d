"""A sheet of replacements: source, cut, replacement and result of each, in the colours of the two pieces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.kit import Assembly, Kit
from stages.shape.sample import Sample
from stages.shape.shape import kit_shape, upright
from stages.shape.views.camera import Camera
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import scene_of
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png
from stages.variations.facing import vertical_turn

__all__ = ["replaced_parts", "replacements_sheet"]

SHOWN = 12
CELL = 300
CAMERA = Camera(azimuth=-40.0, elevation=25.0)
PLAIN, TAKEN, COME = (np.array(each, dtype=np.uint8) for each in ((205, 205, 200), (200, 70, 60), (60, 110, 190)))


def replacements_sheet(kit: Kit, samples: Sequence[Sample]) -> bytes | None:
    """The first replacements between exemplars among the samples of a kit as PNG, a row each: the exemplar with what is
    taken out of it, the other with what is copied, and the result; None where there are none."""
    rows = []
    for sample in samples:
        found = replaced_parts(kit, sample)
        if found is None:
            continue
        (base, taken), (giver, piece) = found
        count = int(piece.sum())
        whole = np.arange(len(sample.assembly)) < count
        rows.append(
            [
                _cell(kit, base, taken, TAKEN, f"{sample.lineage['made_of'][1]}: {int(taken.sum())} parts leave"),
                _cell(kit, giver, piece, COME, f"{sample.lineage['made_of'][0]}: {count} parts are copied"),
                _cell(kit, sample.assembly, whole, COME, f"{sample.key}, {len(sample.assembly)} parts"),
            ]
        )
        if len(rows) == SHOWN:
            break
    if not rows:
        return None
    title = f"{kit.name}: what took the place of what"
    return picture_png(contact_sheet([Section("Source and cut, replacement, result", rows, "")], title, CELL))


def replaced_parts(kit: Kit, sample: Sample) -> tuple[tuple[Assembly, BoolArray], tuple[Assembly, BoolArray]] | None:
    """The base with the parts that left it, and the giver with those that were copied, of a sample that was made of two
    exemplars, once and rigidly; None of others, and where what stayed of the base moved to make room."""
    lineage, exemplars = sample.lineage, {each.name: each.assembly for each in kit.exemplars}
    if lineage["method"] != "substructures" or lineage["times"] > 1 or lineage["bent"]:
        return None
    if any(name not in exemplars for name in lineage["made_of"]):
        return None
    giver, base = (exemplars[name] for name in lineage["made_of"])
    count = lineage["parts_from"][0]
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = lineage["motion"][:3], lineage["motion"][3]
    turn = vertical_turn({"y": 1, "z": 2}[kit.up], lineage["turned"])
    first, rest = np.arange(count), np.arange(count, sum(lineage["parts_from"]))
    piece = _found(kit, giver, turn @ motion @ giver.poses, sample.assembly.select(first))
    stays = _found(kit, base, turn @ base.poses, sample.assembly.select(rest))
    if piece.sum() != len(first) or stays.sum() != len(rest):
        return None
    return (base, ~stays), (giver, piece)


def _found(kit: Kit, assembly: Assembly, poses: FloatArray, there: Assembly) -> BoolArray:
    """Which parts of an assembly, moved to `poses`, stand among those `there`, bool (n,)."""
    gaps = np.abs(poses[:, None] - there.poses).max(axis=(2, 3))
    found: BoolArray = ((gaps < kit.pose_tolerance) & (assembly.types[:, None] == there.types)).any(axis=1)
    return found


def _cell(kit: Kit, assembly: Assembly, chosen: BoolArray, color: np.ndarray, name: str) -> Cell:
    shape = upright(kit_shape(kit, assembly))
    paint = np.where(chosen[:, None], color, PLAIN)
    return Cell(portrait(scene_of(shape), CAMERA, (CELL, CELL), paint), name)
