"""Exported files in MuJoCo, PyBullet and OpenUSD: they load, weigh what they should, rest, and drawers move."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from stages.export.mjcf import mjcf_files
from stages.export.model import SimulationModel, simulation_model
from stages.export.obj import obj_files
from stages.export.settings import ExportSettings
from stages.export.urdf import urdf_files
from stages.export.usd import usd_files
from tests.stages.export.models import cabinet, cabinet_model, height, two_pieces

PULL_NEWTONS = 20.0
SCENE = """<mujoco>
  <include file="{file}"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody><geom name="ground" type="plane" size="0 0 1"/></worldbody>
</mujoco>"""


def written(folder: Path, files: Mapping[str, bytes]) -> Path:
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return folder / next(iter(files))


def in_mujoco(folder: Path, model: SimulationModel) -> tuple[Any, Any, Any]:
    mujoco = pytest.importorskip("mujoco")
    path = written(folder, mjcf_files(model))
    (folder / "scene.xml").write_text(SCENE.format(file=path.name), encoding="utf-8")
    loaded = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
    return mujoco, loaded, mujoco.MjData(loaded)


@pytest.mark.parametrize("links", ["parts", "bodies"])
def test_mujoco_lets_a_stable_cabinet_rest_and_its_drawer_comes_out_to_its_limit(tmp_path: Path, links: Any) -> None:
    model = cabinet_model(ExportSettings(links=links))
    mujoco, loaded, state = in_mujoco(tmp_path, model)
    assert loaded.body_mass.sum() == pytest.approx(sum(link.mass for link in model.links), rel=1e-6)
    mujoco.mj_step(loaded, state, 500)
    assert np.linalg.norm(state.qpos[:3]) < 0.002
    assert np.abs(state.qpos[7:]).max() < 0.002, "nothing pushes drawers and doors open"
    slides = [joint for joint in range(loaded.njnt) if loaded.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE]
    state.qfrc_applied[loaded.jnt_dofadr[slides[0]]] = PULL_NEWTONS
    mujoco.mj_step(loaded, state, 1000)
    place = loaded.jnt_qposadr[slides]
    assert state.qpos[place[0]] == pytest.approx(0.8 * 0.45, abs=0.01)
    assert abs(state.qpos[place[1]]) < 0.01, "the other drawer stays"


def test_mujoco_fixes_what_hangs_and_drops_what_is_apart(tmp_path: Path) -> None:
    shape, pairs = two_pieces()
    mujoco, loaded, _ = in_mujoco(
        tmp_path / "fixed", simulation_model("two", shape, pairs, ExportSettings(fixed_base=True))
    )
    assert loaded.nv == 0
    mujoco, loaded, state = in_mujoco(tmp_path / "free", simulation_model("two", shape, pairs, ExportSettings()))
    assert loaded.nv == 12
    mujoco.mj_step(loaded, state, 500)
    assert np.abs(state.qpos - loaded.qpos0).max() < 0.005


def test_pybullet_lets_a_cabinet_rest_and_its_drawer_moves(tmp_path: Path) -> None:
    bullet = pytest.importorskip("pybullet")
    model = cabinet_model(ExportSettings(links="bodies"))
    path = written(tmp_path, urdf_files(model))
    client = bullet.connect(bullet.DIRECT)
    try:
        bullet.setGravity(0, 0, -9.81)
        bullet.createMultiBody(0, bullet.createCollisionShape(bullet.GEOM_PLANE))
        body = bullet.loadURDF(str(path), flags=bullet.URDF_USE_INERTIA_FROM_FILE)
        masses = [bullet.getDynamicsInfo(body, link)[0] for link in range(-1, bullet.getNumJoints(body))]
        assert masses == pytest.approx([link.mass for link in model.links], rel=1e-6)
        start = bullet.getBasePositionAndOrientation(body)[0]
        for _ in range(240):
            bullet.stepSimulation()
        assert np.subtract(bullet.getBasePositionAndOrientation(body)[0], start) == pytest.approx(
            np.zeros(3), abs=0.003
        )
        bullet.setJointMotorControl2(body, 0, bullet.VELOCITY_CONTROL, force=0)
        for _ in range(480):
            bullet.setJointMotorControl2(body, 0, bullet.TORQUE_CONTROL, force=PULL_NEWTONS)
            bullet.stepSimulation()
        assert bullet.getJointState(body, 0)[0] == pytest.approx(0.8 * 0.45, abs=0.02)
    finally:
        bullet.disconnect(client)


def test_every_piece_is_a_urdf_of_one_tree(tmp_path: Path) -> None:
    shape, pairs = two_pieces()
    files = urdf_files(simulation_model("two", shape, pairs, ExportSettings()))
    assert [name for name in files if name.endswith(".urdf")] == ["two-0.urdf", "two-1.urdf"]
    assert b"plate &amp; top.000" in files["two-0.urdf"]


def test_usd_has_the_bodies_masses_joints_and_bounds(tmp_path: Path) -> None:
    usd = pytest.importorskip("pxr.Usd")
    from pxr import UsdGeom, UsdPhysics

    model = cabinet_model(ExportSettings())
    stage = usd.Stage.Open(str(written(tmp_path, usd_files(model))))
    prims = list(stage.Traverse())
    bodies = [prim for prim in prims if prim.HasAPI(UsdPhysics.RigidBodyAPI)]
    masses = [UsdPhysics.MassAPI(prim).GetMassAttr().Get() for prim in bodies]
    assert masses == pytest.approx([link.mass for link in model.links], rel=1e-6)
    kinds = [prim.GetTypeName() for prim in prims if prim.IsA(UsdPhysics.Joint)]
    assert kinds.count("PhysicsPrismaticJoint") == 2
    assert kinds.count("PhysicsRevoluteJoint") == 1
    assert len(kinds) == len(model.joints)
    bounds = UsdGeom.BBoxCache(0, ["default"]).ComputeWorldBound(stage.GetDefaultPrim()).ComputeAlignedRange()
    assert bounds.GetMax()[2] - bounds.GetMin()[2] == pytest.approx(height(cabinet()), rel=1e-6)
    assert sum(prim.HasAPI(UsdPhysics.CollisionAPI) for prim in prims) == len(cabinet())
    for prim in prims:
        if prim.IsA(UsdPhysics.Joint):
            assert_frames_agree(UsdPhysics.Joint(prim), stage, UsdGeom.XformCache())


def assert_frames_agree(joint: Any, stage: Any, cache: Any) -> None:
    """Both frames of a joint are one frame in the world, or a simulator would tear its bodies."""
    from pxr import Gf

    frames = []
    for number in ("0", "1"):
        target = getattr(joint, f"GetBody{number}Rel")().GetTargets()[0]
        turn = getattr(joint, f"GetLocalRot{number}Attr")().Get()
        place = Gf.Vec3d(getattr(joint, f"GetLocalPos{number}Attr")().Get())
        local = Gf.Matrix4d().SetTransform(Gf.Rotation(Gf.Quatd(turn)), place)
        frames.append(np.array(local * cache.GetLocalToWorldTransform(stage.GetPrimAtPath(target))))
    np.testing.assert_allclose(frames[0], frames[1], atol=1e-5)


def test_obj_has_an_object_a_part_where_the_shape_has_it(tmp_path: Path) -> None:
    written(tmp_path, obj_files("cabinet", cabinet()))
    scene: Any = trimesh.load_scene(tmp_path / "cabinet.obj", split_objects=True, group_material=False, process=False)
    assert len(scene.geometry) == len(cabinet())
    assert scene.extents[1] == pytest.approx(height(cabinet()), rel=1e-6)
    assert (tmp_path / "cabinet.mtl").read_text(encoding="utf-8").count("newmtl") == 5, "one for each colour"
