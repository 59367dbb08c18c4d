"""Solids and their compositions: closed meshes, texts that make the same shape, rest on what is below, splits."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import yaml

from stages.primitives.compose import random_composition, rest_height
from stages.primitives.settings import KINDS, Composition, Kind, PrimitivesConfig
from stages.primitives.solids import draw_numbers, solid_mesh
from stages.primitives.text import (
    CompositionError,
    PlacedSolid,
    composition_text,
    placed_solid,
    read_composition,
    rotation_of,
    shape_of_composition_text,
    shape_of_solids,
)
from stages.programs.curves import box, mesh_defects
from stages.shape.physics.judge import unmet_requirement
from stages.shape.sample import read_samples
from tests.command import shapemill

CONFIG = PrimitivesConfig(samples=9)


@pytest.mark.parametrize("kind", KINDS)
def test_a_random_solid_is_closed_and_centred(kind: Kind) -> None:
    rng = np.random.default_rng(3)
    made = 0
    while made < 12:
        try:
            mesh = solid_mesh(kind, draw_numbers(kind, lambda: float(rng.uniform(0.1, 0.6)), rng))
        except ValueError:
            continue
        made += 1
        assert mesh.volume > 0
        assert mesh.bounds.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
        assert not [defect for defect in mesh_defects(mesh) if "fold" not in defect and "intersect" not in defect]


def test_volumes_are_those_of_the_numbers() -> None:
    assert solid_mesh("box", (1.0, 2.0, 3.0)).volume == pytest.approx(6.0)
    assert solid_mesh("cylinder", (1.0, 2.0)).volume == pytest.approx(2 * np.pi, rel=0.02)
    assert solid_mesh("cone", (1.0, 3.0, 0.0)).volume == pytest.approx(np.pi, rel=0.02)
    assert solid_mesh("tube", (1.0, 1.0, 0.5, 24.0)).volume == pytest.approx(0.75 * np.pi, rel=0.02)
    assert solid_mesh("extrusion", (0.0, 1.0, 1.0, 2.0, 0.5)).volume == pytest.approx(1.5)


@pytest.mark.parametrize("composition", get_args(Composition))
def test_a_composition_stands_on_the_ground_and_its_text_makes_it_again(composition: Composition) -> None:
    rooted = 0
    for seed in range(8):
        solids = random_composition(composition, CONFIG, np.random.default_rng(seed))
        assert composition_text(solids) == composition_text(
            random_composition(composition, CONFIG, np.random.default_rng(seed))
        )
        assert read_composition(composition_text(solids)) == solids
        shape = shape_of_composition_text(composition_text(solids))
        assert [shape.labels[label] for label in shape.part_labels] == [solid.kind for solid in solids]
        assert len(solids) >= CONFIG.min_parts
        lowest = min(solid.vertices[:, 1].min() for solid in solids)
        assert lowest == pytest.approx(0.0, abs=1e-5)
        for pose in shape.assembly.poses:
            assert pose[:3, :3] @ pose[:3, :3].T == pytest.approx(np.eye(3), abs=1e-9)
        rooted += unmet_requirement(CONFIG.require, shape) is None
    assert rooted >= 6


def test_copies_are_equal_solids_that_share_a_mesh() -> None:
    config = PrimitivesConfig(samples=1, copies=1.0, min_parts=4, max_parts=4)
    shape = shape_of_solids(random_composition("attached", config, np.random.default_rng(2)))
    assert len(shape.meshes) < len(shape)


def test_a_falling_box_rests_on_the_highest_thing_below_it() -> None:
    def corners(size: tuple[float, float, float], center: tuple[float, float, float]) -> np.ndarray:
        mesh = box(size, center)
        return mesh.vertices[mesh.triangles]

    falling = corners((1, 1, 1), (0, 0, 0))
    assert rest_height(falling, []) == pytest.approx(0.5)
    low, high, aside = (
        corners((1, 1, 1), (0, 0.5, 0)),
        corners((1, 3, 1), (0.9, 1.5, 0)),
        corners((1, 9, 1), (5, 4.5, 0)),
    )
    assert rest_height(falling, [low, aside]) == pytest.approx(1.5 - 0.03)
    assert rest_height(falling, [low, high]) == pytest.approx(3.5 - 0.03)


def test_a_turn_survives_its_quaternion_and_a_mirrored_solid_is_mirrored() -> None:
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    pose = np.eye(4)
    pose[:3, :3] = turn * np.linalg.det(turn)
    solid = placed_solid("sweep", (0.5, 0.1, 0.5, 0.3, 0.0, 0.1, 0.2), False, pose)
    assert rotation_of(solid.turn) == pytest.approx(pose[:3, :3], abs=1e-5)
    mirrored = PlacedSolid(solid.kind, solid.numbers, True, (1, 0, 0, 0), (0, 0, 0))
    assert mirrored.mesh.volume == pytest.approx(solid.mesh.volume)
    assert mirrored.vertices[:, 0] == pytest.approx(-solid.mesh.vertices[:, 0])


@pytest.mark.parametrize("text", ["", "{}", '{"solids":[]}', '{"solids":[{"kind":"egg"}]}'])
def test_a_text_without_solids_is_refused(text: str) -> None:
    with pytest.raises(CompositionError):
        shape_of_composition_text(text)


def test_numbers_that_make_no_solid_are_refused() -> None:
    solid = PlacedSolid("box", (1.0, -1.0, 1.0), False, (1, 0, 0, 0), (0, 0, 0))
    with pytest.raises(CompositionError, match="no solid"):
        shape_of_composition_text(composition_text([solid]))


@pytest.mark.slow
def test_structures_share_a_split_and_bytes_do_not_depend_on_workers(tmp_path: Path) -> None:
    config = tmp_path / "toy.yaml"
    section = {"samples": 140, "min_parts": 1, "max_parts": 2, "kinds": ["box", "sphere"], "splits": {"shards": 1}}
    config.write_text(yaml.safe_dump({"name": "toy", "seed": 4, "primitives": section}), encoding="utf-8")
    made = []
    for workers in (1, 2):
        out = tmp_path / f"out-{workers}"
        code, printed = shapemill("run", "primitives", "--config", config, "--out", out, "--workers", workers)
        assert code == 0, printed
        folder = out / ".work" / "toy" / "primitives"
        made.append({path.name: path.read_bytes() for path in sorted(folder.glob("toy-*.tar"))})
    assert made[0] == made[1]
    samples = [sample for path in sorted(folder.glob("toy-*-0*.tar")) for sample in read_samples(path)]
    assert len(samples) == 140
    assert set(Counter(sample.lineage["method"] for sample in samples)) == set(CONFIG.compositions)
    splits: dict[str, set[str]] = {}
    for sample in samples:
        splits.setdefault(sample.graph, set()).add(sample.split)
        assert len(json.loads(sample.text)["solids"]) <= 13
    assert all(len(of_graph) == 1 for of_graph in splits.values())
