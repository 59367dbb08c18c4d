"""Pairs for learning: a shape that stands, and the same shape with one part changed, so that it falls."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import TYPE_CHECKING, Any, Literal, cast, get_args

import numpy as np

from pipeline.shards import json_bytes
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import rounded, transform_points
from stages.shape.kit import Assembly
from stages.shape.physics.settings import PhysicsConfig
from stages.shape.sample import Sample
from stages.shape.shape import Shape
from stages.shape.stretch import StretchedMesh, bake, split

if TYPE_CHECKING:
    from stages.shape.physics.settling import Fall

EditKind = Literal["removed", "shortened", "moved"]
EDIT_KINDS = cast(tuple[EditKind, ...], get_args(EditKind))
UNSUPPORTED, TIPS_OVER = "unsupported", "tips over"
KEY_SUFFIX = "-falls"
NAME = "mixture"
"""Language of edited samples."""

MIN_STANDING_DEGREES = 8.0
"""Least tilt that the shape bears that stands. Engines agree on what falls, except near the 5.71 degrees of a push."""
MAX_FALLING_DEGREES = 3.5
"""Largest tilt after which the other one falls."""
MAX_PARTS_TRIED = 4
"""Parts that are tried for each kind of edit."""
SHORTENED_SHARE = 0.5
"""What is left of the height of a shortened part, from its top down."""
MOVED_GAP_SHARE = 0.1
"""Distance of a moved part from where it was, as a share of the diagonal of the box around the shape."""

NO_CONTRAST: Mapping[str, Any] = {
    "role": "alone",
    "partner": "none",
    "edit": "none",
    "part": -1,
    "part_name": "none",
    "cause": "none",
    "gives_way": -1,
}
"""What the lineage of a sample without a partner says."""


@dataclass(frozen=True)
class Edit:
    """A change of one part of an upright shape.

    part: its index
    motion: affine map of the part, float64 (4, 4); the identity for one that is removed
    """

    kind: EditKind
    part: int
    motion: FloatArray


@dataclass(frozen=True)
class Contrast:
    """An edit that makes a shape fall.

    cause: UNSUPPORTED, where no chain of joints connects a part to the ground, or TIPS_OVER
    gives_way: first part of the piece that falls, as an index into the parts of the edited shape
    """

    edit: Edit
    cause: str
    gives_way: int


def edited(shape: Shape, edit: Edit) -> Shape:
    """Return an upright shape after an edit. Its parts keep their names, and no contacts are known."""
    kept = [part for part in range(len(shape)) if edit.kind != "removed" or part != edit.part]
    placed = shape.placements.copy()
    placed[edit.part] = edit.motion @ placed[edit.part]
    poses, stretches = split(placed[kept])
    meshes = [mesh.of if isinstance(mesh, StretchedMesh) else mesh for mesh in shape.meshes]
    unbaked = Assembly(shape.assembly.types[kept], poses, np.empty((0, 2), dtype=np.int32), stretches)
    baked, assembly = bake(meshes, unbaked)
    return replace(
        shape,
        meshes=baked,
        assembly=assembly,
        own_names=tuple(shape.part_names[part] for part in kept),
        part_joints=tuple(shape.part_joints[part] for part in kept) if shape.part_joints else (),
    )


def find_contrast(shape: Shape, config: PhysicsConfig, rng: np.random.Generator) -> Contrast | None:
    """Return an edit of an upright shape that makes it fall; None if it does not stand, or no tried edit does.

    Kinds of edits and parts are tried in random order. An edit after which another part than the edited one gives way
    is preferred. Both verdicts are far from the push that decides.
    """
    shape = replace(shape, assembly=replace(shape.assembly, edges=np.empty((0, 2), dtype=np.int32)))
    standing = _dropped(shape, config)
    if len(shape) == 1 or standing is None or standing[0].tilt_degrees < MIN_STANDING_DEGREES:
        return None
    boxes = _part_boxes(shape)
    box = np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    loosened = None
    for number in rng.permutation(len(EDIT_KINDS)).tolist():
        kind = EDIT_KINDS[number]
        for part in rng.permutation(len(shape))[:MAX_PARTS_TRIED].tolist():
            edit = Edit(kind, part, rounded(_motion(kind, boxes[part], box)))
            falling = _dropped(edited(shape, edit), config)
            if falling is not None and falling[0].tilt_degrees <= MAX_FALLING_DEGREES:
                fall, is_rooted = falling
                contrast = Contrast(edit, TIPS_OVER if is_rooted else UNSUPPORTED, fall.part)
                if kind == "removed" or fall.part != part:
                    return contrast
                loosened = loosened or contrast
    return loosened


def _dropped(shape: Shape, config: PhysicsConfig) -> tuple[Fall, bool] | None:
    """Return how a shape falls and whether it is rooted, at poses as in records; None for one without weight."""
    from stages.shape.physics.judge import judge_of

    judge = judge_of(shape.meshes, shape.up, config)
    assembly = replace(shape.assembly, poses=rounded(shape.assembly.poses))
    try:
        return judge.fall(assembly), judge.rooted(assembly)
    except ValueError:
        return None


def _part_boxes(shape: Shape) -> FloatArray:
    """Return the lowest and highest corner of the box around each part, float64 (n, 2, 3)."""
    meshes = [shape.meshes[mesh] for mesh in shape.assembly.types.tolist()]
    placed = [transform_points(pose, mesh.vertices) for pose, mesh in zip(shape.assembly.poses, meshes, strict=True)]
    return np.array([[points.min(axis=0), points.max(axis=0)] for points in placed])


def _motion(kind: EditKind, part_box: FloatArray, box: FloatArray) -> FloatArray:
    """Return the affine map, float64 (4, 4), of a part of a shape, both given by their boxes (2, 3).

    A moved part goes away from the middle, along the shorter of its level sides, until it is clear of its place.
    """
    motion = np.eye(4)
    if kind == "shortened":
        motion[1, 1], motion[1, 3] = SHORTENED_SHARE, (1 - SHORTENED_SHARE) * part_box[1, 1]
    elif kind == "moved":
        axis = min((0, 2), key=lambda side: float(part_box[1, side] - part_box[0, side]))
        outwards = 1.0 if part_box[:, axis].sum() >= box[:, axis].sum() else -1.0
        gap = MOVED_GAP_SHARE * float(np.linalg.norm(box[1] - box[0]))
        motion[axis, 3] = outwards * (part_box[1, axis] - part_box[0, axis] + gap)
    return motion


def falling_partner(sample: Sample, shape: Shape, language: str, contrast: Contrast) -> Sample:
    """Return the edited sample. Its text holds the edit, and what is needed to make the shape that was edited.

    shape: of the sample, upright
    language: of the sample, as records call it
    """
    edit = contrast.edit
    text = {
        "edit": edit.kind,
        "part": edit.part,
        "motion": edit.motion.tolist(),
        "part_name": shape.part_names[edit.part],
        "pose": rounded(shape.placements[edit.part]).tolist(),
        "producer": sample.producer,
        "language": language,
        "text": sample.text,
    }
    digest = sha256(f"{sample.graph} {edit.kind} {edit.part}".encode()).hexdigest()
    return replace(sample, key=f"{sample.key}{KEY_SUFFIX}", graph=digest, text=json_bytes(text).decode().strip())


def original_sample(sample: Sample) -> tuple[Sample, Edit]:
    """Return the sample that was edited, and the edit, from one that `falling_partner` made."""
    text = json.loads(sample.text)
    return replace(sample, producer=text["producer"], text=text["text"]), _edit_of(text)


def described_language(language: str, text: str) -> str:
    """Return the language that names the parts of a sample: of an edited one, that of the sample before the edit.

    language, text: of the sample, as records call them
    """
    edited_from: str = json.loads(text)["language"] if language == NAME else language
    return edited_from


def original_record(record: Mapping[str, Any]) -> tuple[dict[str, Any], Edit]:
    """Return what a language needs of the record of the sample that was edited, and the edit."""
    text = json.loads(record["text"])
    edit, parts = _edit_of(text), list(record["parts"])
    before = {"name": text["part_name"], "pose": text["pose"]}
    parts[edit.part : edit.part + (edit.kind != "removed")] = [before]
    return {**record, "parts": parts, "language": text["language"], "text": text["text"]}, edit


def _edit_of(text: Mapping[str, Any]) -> Edit:
    return Edit(text["edit"], text["part"], np.array(text["motion"], dtype=np.float64))


def contrast_fields(shape: Shape, contrast: Contrast, keys: tuple[str, str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the field `contrast` of the lineage of the sample that stands, and of the one that falls.

    shape: the one that stands
    keys: of both samples
    """
    edit, removed = contrast.edit, contrast.edit.kind == "removed"
    common = {"edit": edit.kind, "part_name": shape.part_names[edit.part], "cause": contrast.cause}
    gives_way = contrast.gives_way + (removed and contrast.gives_way >= edit.part)
    stands = {"role": "stands", "partner": keys[1], "part": edit.part, "gives_way": gives_way}
    falls = {
        "role": "falls",
        "partner": keys[0],
        "part": -1 if removed else edit.part,
        "gives_way": contrast.gives_way,
    }
    return {**common, **stands}, {**common, **falls}
