"""Stretched parts: stored with the pose, drawn as meshes of their own, and one matrix in the record."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh

from pipeline.paths import DatasetPaths
from pipeline.shards import ShardWriter
from stages.exemplars.language import LANGUAGE
from stages.package.glb import glb_bytes
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.kit import Assembly, Kit
from stages.shape.kit_files import write_kit
from stages.shape.sample import Sample, read_samples, write_sample
from stages.shape.shape import kit_shape, upright
from stages.shape.stretch import moved_by, split
from tests.toy_kits.chains_and_rings import box, kit_of, pose


@pytest.fixture(scope="module")
def kit() -> Kit:
    return kit_of({"foot": box(1, 1, 1), "bar": box(4, 1, 1)}, [[("foot", pose(0, 0, 0)), ("bar", pose(0, 1, 0))]])


def longer(kit: Kit) -> Assembly:
    """The bar and its foot, turned by 45 degrees and then made half as long again along x."""
    turned = np.eye(4)
    turned[:3, :3] = trimesh.transformations.rotation_matrix(np.pi / 4, [0, 1, 0])[:3, :3]
    whole = moved_by(kit.exemplars[0].assembly, np.stack([turned, turned]))
    return moved_by(whole, np.tile(np.diag([1.5, 1.0, 1.0, 1.0]), (2, 1, 1)))


def test_a_placement_is_a_rigid_pose_after_a_symmetric_stretch() -> None:
    rng = np.random.default_rng(0)
    placed = np.tile(np.eye(4), (50, 1, 1))
    placed[:, :3] = rng.normal(size=(50, 3, 4))
    poses, stretches = split(placed)
    assert stretches is not None
    rotations = poses[:, :3, :3]
    np.testing.assert_allclose(rotations @ np.swapaxes(rotations, 1, 2), np.tile(np.eye(3), (50, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(stretches, np.swapaxes(stretches, 1, 2), atol=1e-8)
    assert (np.linalg.eigvalsh(stretches) > 0).all()
    again = Assembly(np.zeros(50, np.int16), poses, np.empty((0, 2), np.int32), stretches).placements
    np.testing.assert_allclose(again, placed, atol=1e-8)


def test_what_is_rigid_stays_as_it_is(kit: Kit) -> None:
    assembly = kit.exemplars[0].assembly
    poses, stretches = split(assembly.poses)
    assert poses is assembly.poses
    assert stretches is None
    assert kit_shape(kit, assembly).meshes is kit.types
    assert kit_shape(kit, assembly).placements is assembly.poses


def test_a_stretched_part_has_a_mesh_of_its_own_and_its_label(kit: Kit) -> None:
    assembly = longer(kit)
    shape = kit_shape(kit, assembly)
    labels = [kit.labels[label] for label in kit.label_of[assembly.types]]
    assert [shape.labels[label] for label in shape.part_labels] == labels
    assert sorted(shape.part_names) == ["bar.000", "foot.000"]
    assert shape.is_stretched
    assert np.ptp(shape_bounds(shape)[:, 0]) == pytest.approx(1.5 * 5 / np.sqrt(2))
    scene = trimesh.load_scene(io.BytesIO(glb_bytes(shape)), file_type="glb", process=False)
    np.testing.assert_allclose(scene.bounds, shape_bounds(shape), atol=1e-6)
    part = labels.index("bar")
    drawn = kit.types[assembly.types[part]].vertices @ shape.placements[part, :3, :3].T + shape.placements[part, :3, 3]
    np.testing.assert_allclose(scene.bounds[:, 0], [drawn[:, 0].min(), drawn[:, 0].max()], atol=1e-6)


def test_samples_carry_stretches_where_there_are_any(kit: Kit, tmp_path: Path) -> None:
    made = [kit.exemplars[0].assembly, longer(kit)]
    with (tmp_path / "shard.tar").open("wb") as stream, ShardWriter(stream) as writer:
        for number, assembly in enumerate(made):
            write_sample(writer, Sample(f"k-{number}", "train", "variations", "toy", "00", {}, assembly))
    rigid, bent = (sample.assembly for sample in read_samples(tmp_path / "shard.tar"))
    assert rigid.stretches is None
    np.testing.assert_array_equal(bent.placements, made[1].placements)
    np.testing.assert_array_equal(bent.select(np.array([1])).placements, made[1].placements[1:])


def test_a_record_says_pose_and_stretch_in_one_matrix(kit: Kit, tmp_path: Path) -> None:
    places = DatasetPaths(tmp_path, "dataset")
    root = places.stage("exemplars").root
    root.mkdir(parents=True)
    with (root / "toy.json").open("wb") as text, (root / "toy.tar").open("wb") as arrays:
        write_kit(kit, text, arrays)
    shape = upright(kit_shape(kit, longer(kit)))
    parts = [
        {"name": name, "pose": placed} for name, placed in zip(shape.part_names, shape.placements.tolist(), strict=True)
    ]
    again = LANGUAGE.rebuild(places)({"kit": "toy", "parts": parts}, shape.assembly.edges)
    assert again.part_names == shape.part_names
    np.testing.assert_allclose(again.placements, shape.placements, atol=1e-11)
    np.testing.assert_allclose(again.assembly.poses, shape.assembly.poses, atol=1e-11)
    np.testing.assert_allclose(shape_bounds(again), shape_bounds(shape), atol=1e-11)
    assert len(again.meshes) == len(shape.meshes)
