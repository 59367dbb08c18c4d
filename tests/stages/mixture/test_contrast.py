"""Pairs of a shape that stands and one that falls: one part apart, and the original comes back from the edited one."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from stages.mixture.contrast import (
    EDIT_KINDS,
    MAX_FALLING_DEGREES,
    TIPS_OVER,
    Edit,
    edited,
    falling_partner,
    find_contrast,
    original_record,
    original_sample,
)
from stages.programs.program import build_shape, find_program
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.physics.judge import Judge
from stages.shape.physics.settings import PhysicsConfig
from stages.shape.sample import Sample
from stages.shape.shape import Shape
from tests.command import shapemill

STOOL = "tests.stages.programs.stool"


@pytest.fixture(scope="module")
def stool() -> Shape:
    """A seat on two legs, without a rail: seat, leg, leg."""
    values = {"height": 0.6, "scale x": 0.5, "has_rail": False, "rail_height": 0.3}
    return build_shape(find_program(STOOL), values)


def lowered(part: int) -> Edit:
    """Half of the height of a part of the stool, whose legs end at 0.6."""
    motion = np.diag([1.0, 0.5, 1.0, 1.0])
    motion[1, 3] = 0.3
    return Edit("shortened", part, motion)


def test_an_edit_changes_one_part_and_keeps_names(stool: Shape) -> None:
    names = stool.part_names
    without = edited(stool, Edit("removed", 1, np.eye(4)))
    assert without.part_names == (names[0], names[2])
    shift = np.eye(4)
    shift[0, 3] = 3.0
    moved = edited(stool, Edit("moved", 2, shift))
    assert np.allclose(moved.placements[2] - stool.placements[2], shift - np.eye(4))
    assert np.array_equal(moved.placements[:2], stool.placements[:2])
    short = edited(stool, lowered(2))
    assert short.part_names == names
    alone = edited(edited(short, Edit("removed", 0, np.eye(4))), Edit("removed", 0, np.eye(4)))
    assert np.allclose(shape_bounds(alone)[:, 1], [0.3, 0.6])
    again = edited(short, Edit("shortened", 2, np.linalg.inv(lowered(2).motion)))
    assert np.allclose(shape_bounds(again), shape_bounds(stool))


def test_a_stool_loses_a_leg_and_tips_over_or_its_seat_is_unsupported(stool: Shape) -> None:
    causes = Counter[str]()
    for seed in range(12):
        contrast = find_contrast(stool, PhysicsConfig(), np.random.default_rng(seed))
        assert contrast is not None
        falling = edited(stool, contrast.edit)
        judge = Judge(falling.meshes, "y", PhysicsConfig())
        fall = judge.fall(falling.assembly)
        assert fall.tilt_degrees <= MAX_FALLING_DEGREES
        assert (fall.part, judge.rooted(falling.assembly)) == (contrast.gives_way, contrast.cause == TIPS_OVER)
        causes[contrast.edit.kind] += 1
    assert set(causes) == set(EDIT_KINDS)


def test_what_does_not_stand_or_has_one_part_gets_no_partner(stool: Shape) -> None:
    shift = np.eye(4)
    shift[1, 3] = 2.0
    floating = edited(stool, Edit("moved", 0, shift))
    one = edited(edited(stool, Edit("removed", 0, np.eye(4))), Edit("removed", 0, np.eye(4)))
    for shape in (floating, one):
        assert find_contrast(shape, PhysicsConfig(), np.random.default_rng(0)) is None


@pytest.mark.parametrize("kind", EDIT_KINDS)
def test_the_original_comes_back_from_the_text_of_its_partner(stool: Shape, kind: Any) -> None:
    contrast = next(
        found
        for seed in range(40)
        if (found := find_contrast(stool, PhysicsConfig(), np.random.default_rng(seed))) and found.edit.kind == kind
    )
    sample = Sample("s", "train", "programs", "stool", "ab", {}, text='{"height": 0.6}')
    partner = falling_partner(sample, stool, "program", contrast)
    original, edit = original_sample(replace(partner, producer="mixture"))
    assert (original.producer, original.text) == ("programs", sample.text)
    assert (edit.kind, edit.part) == (contrast.edit.kind, contrast.edit.part)
    assert np.array_equal(edit.motion, contrast.edit.motion)
    shape = edited(stool, edit)
    parts = [
        {"name": name, "pose": pose} for name, pose in zip(shape.part_names, shape.placements.tolist(), strict=True)
    ]
    record, _ = original_record({"text": partner.text, "parts": parts, "language": "mixture"})
    assert (record["language"], record["text"]) == ("program", sample.text)
    assert [part["name"] for part in record["parts"]] == list(stool.part_names)
    assert np.allclose([part["pose"] for part in record["parts"]], stool.placements)


@pytest.mark.parametrize(
    ("section", "reason"),
    [
        ({"mixture": {"contrast": True}}, "enabled: true"),
        ({}, "validity.falls: true"),
    ],
)
def test_pairs_need_a_mixture_and_verdicts(tmp_path: Path, section: dict[str, Any], reason: str) -> None:
    path = tmp_path / "pairs.yaml"
    given = {"programs": {"program": STOOL}, "mixture": {"enabled": True, "contrast": True}, **section}
    path.write_text(yaml.safe_dump({"name": "pairs", "license": "MIT", **given}), encoding="utf-8")
    code, printed = shapemill("run", "programs", "--config", str(path), "--out", str(tmp_path / "out"))
    assert code == 2
    assert reason in printed
