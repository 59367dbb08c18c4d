"""Files of simulators and modelling programs as members of samples: they open in what they are for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from pipeline.paths import write_file
from stages.exports.audit import AUDIT
from stages.exports.members import CONTENTS
from stages.package.dataset_sample import DatasetSample
from stages.package.reader import Dataset
from stages.shape.collection.archive import archive_bytes, archive_files, archive_name
from stages.shape.collection.packaged import PackagedSample
from tests.stages.package.conftest import toy_folder  # noqa: F401


@pytest.fixture(scope="module")
def sample(toy_folder: Path) -> DatasetSample:  # noqa: F811
    return next(iter(Dataset.open(toy_folder)))


def unpacked(sample: DatasetSample, kind: str, folder: Path) -> Path:
    for name, content in sample.exported(kind).items():
        write_file(folder / name, content)
    return folder


def test_mujoco_pybullet_openusd_and_trimesh_open_the_members(sample: DatasetSample, tmp_path: Path) -> None:
    mujoco, usd = pytest.importorskip("mujoco"), pytest.importorskip("pxr.Usd")
    parts = len(sample.record["parts"])
    folder = unpacked(sample, "mjcf", tmp_path / "mjcf")
    model = mujoco.MjModel.from_xml_path(str(folder / f"{sample.key}.xml"))
    assert model.ngeom == 2 * parts
    stage = usd.Stage.Open(str(unpacked(sample, "usd", tmp_path / "usd") / f"{sample.key}.usda"))
    from pxr import UsdPhysics

    assert sum(prim.HasAPI(UsdPhysics.CollisionAPI) for prim in stage.Traverse()) == parts
    scene = trimesh.load(unpacked(sample, "obj", tmp_path / "obj") / f"{sample.key}.obj", process=False)
    assert np.allclose(scene.bounds, sample.record["bounds"], atol=1e-5)
    bullet = pytest.importorskip("pybullet")
    files = [path for path in unpacked(sample, "urdf", tmp_path / "urdf").iterdir() if path.suffix == ".urdf"]
    assert len(files) == sample.record["physics"]["components"]
    client = bullet.connect(bullet.DIRECT)
    try:
        bodies = [bullet.loadURDF(str(path)) for path in files]
        assert sum(1 + bullet.getNumJoints(body) for body in bodies) == parts
    finally:
        bullet.disconnect(client)


def test_a_format_that_is_no_member_is_named(sample: DatasetSample) -> None:
    with pytest.raises(KeyError, match=r"has no structurenet\.tar\.gz"):
        sample.exported("structurenet")


def test_the_bytes_of_an_archive_depend_on_its_files_alone() -> None:
    files = {"a.txt": b"one", "meshes/b.obj": b"v 0 0 0\n" * 100, f"{'long-name-' * 40}ö.obj": b""}
    assert archive_bytes(files) == archive_bytes(dict(files))
    assert archive_files(archive_bytes(files)) == files
    assert len(archive_bytes(files)) < 600


def test_corrupted_and_foreign_archives_are_found(sample: DatasetSample, toy_folder: Path) -> None:  # noqa: F811
    sections = {"exports": {"formats": list(CONTENTS)}}
    members = dict(sample.members)
    shape = sample.shape
    good = PackagedSample(sample.key, sample.record, members, {}, shape, sections)
    assert list(AUDIT.faults(good)) == []
    name = archive_name("urdf")
    broken = bytearray(members[name])
    broken[80] ^= 255
    for content in (bytes(broken), b"", b"\x1f\x8b"):
        assert len(list(AUDIT.faults(replace(good, members={**members, name: content})))) == 1
    files = archive_files(members[name])
    del files[next(entry for entry in files if entry.endswith(".urdf"))]
    forged = replace(good, members={**members, name: archive_bytes(files)})
    assert any(name in fault for fault in AUDIT.recheck(forged, None))  # type: ignore[arg-type]
