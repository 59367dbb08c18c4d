"""Is what a dataset says of its shapes true? Other libraries on the samples of a finished dataset.

    python -m tests.bench.dataset_truth datasets/mixed [--surfaces 200] [--exports 50]

Surfaces: flags of all parts against trimesh and Open3D, and signed distances against trimesh (length, in 64 bits) and
Open3D (sign, by rays through each part, without our union). Exports: files that MuJoCo, PyBullet and OpenUSD
open; masses, whether stable shapes rest, and whether drawers come out. PyBullet has no wheel for Pythons after 3.11.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from pipeline.errors import Rejected
from stages.export.mjcf import mjcf_files
from stages.export.model import SimulationModel, simulation_model
from stages.export.samples import shape_of_sample
from stages.export.settings import ExportSettings
from stages.export.urdf import urdf_files
from stages.export.usd import usd_files
from stages.package.dataset_sample import DatasetSample
from stages.package.reader import Dataset
from stages.shape.collection.pairs import JOINTS, pairs_of
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.kit import PartMesh
from stages.surface.checks import surface_flags, welded
from stages.surface.distances import cube_around, distance_points, signed_distances
from stages.surface.settings import DistanceConfig
from stages.surface.union import solids_of, union_mesh

POINTS = DistanceConfig(near=128, uniform=128)
LENGTH_SHARE = 1e-5
"""Largest difference of two distances that count as one, as a share of the side of the cube."""
CLEAR_SHARE = 1e-4
"""Signs are compared of points that are farther from the surface: Open3D computes in 32 bits."""
OCCUPANCY_RAYS = 3
PULL_NEWTONS = 20.0
REST_SHARE = 0.025
"""A shape rests if its centre of mass stays within this share of its height."""
SCENE = """<mujoco><include file="{file}"/><option timestep="0.002" integrator="implicitfast" cone="elliptic"/>
<default><geom friction="1 0.005 0.0001"/></default>
<worldbody><geom name="ground" type="plane" size="0 0 1"/></worldbody></mujoco>"""


def samples_of(folder: Path, count: int) -> Iterator[DatasetSample]:
    """Yield at most `count` samples of a finished dataset, evenly spread."""
    dataset = Dataset.open(folder)
    step = max(1, len(dataset) // count)
    yield from (sample for number, sample in enumerate(dataset) if number % step == 0 and number < step * count)


def compare_surfaces(folder: Path, count: int) -> Counter[str]:
    """Return counts of what was compared and of what differs."""
    found, largest = Counter[str](), 0.0
    for sample in samples_of(folder, count):
        shape = shape_of_sample(sample)
        found["shapes"] += 1
        for kind in sorted(set(shape.assembly.types.tolist())):
            _compare_flags(shape.meshes[kind], found)
        try:
            solids = solids_of(shape)
            union = union_mesh(solids)
        except Rejected as error:
            found[f"without a union: {error.reason}"] += 1
            continue
        cube = cube_around(union, 0.05)
        points = distance_points(union, cube, POINTS, np.random.default_rng(found["shapes"]))
        values = signed_distances(solids, union, points).astype(np.float64)
        surface = trimesh.Trimesh(union.vertices, union.faces, process=False)
        lengths = trimesh.proximity.closest_point(surface, points.astype(np.float64))[1]
        gaps = np.abs(np.abs(values) - lengths) / cube.side
        largest = max(largest, float(gaps.max()))
        inside = np.any([_inside(solid.vertices, solid.faces, points) for solid in solids], axis=0)
        clear = np.abs(values) > CLEAR_SHARE * cube.side
        found.update(
            {
                "shapes with distances": 1,
                "distances": len(points),
                "distances that differ from trimesh's": int((gaps > LENGTH_SHARE).sum()),
                "signs compared": int(clear.sum()),
                "signs that differ from Open3D's": int((inside != (values < 0))[clear].sum()),
            }
        )
    print(f"largest difference of a distance: {largest:.1e} of the cube")
    return found


def _compare_flags(mesh: PartMesh, found: Counter[str]) -> None:
    import open3d

    flags, (vertices, faces) = surface_flags(mesh), welded(mesh)
    solid = trimesh.Trimesh(vertices, faces, process=False)
    peer = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(vertices), open3d.utility.Vector3iVector(faces.astype(np.int32))
    )
    pairs = {
        "closed, trimesh": (flags.closed, solid.is_watertight and solid.is_winding_consistent),
        "closed, Open3D": (flags.closed, peer.is_edge_manifold(False) and peer.is_orientable()),
        "manifold, Open3D": (flags.manifold, peer.is_edge_manifold() and peer.is_vertex_manifold()),
        "self-intersecting, Open3D": (flags.self_intersecting, peer.is_self_intersecting()),
    }
    found["surfaces of parts"] += 1
    for name, (ours, theirs) in pairs.items():
        found[f"{name}: we {ours}, they {theirs}"] += 1


def _inside(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    import open3d

    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(open3d.core.Tensor(vertices.astype(np.float32)), open3d.core.Tensor(faces.astype(np.uint32)))
    rays = scene.compute_occupancy(open3d.core.Tensor(points), nthreads=1, nsamples=OCCUPANCY_RAYS)
    inside: np.ndarray = rays.numpy() > 0.5
    return inside


def open_exports(folder: Path, count: int) -> Counter[str]:
    """Return counts of what the engines opened and of what they found."""
    found = Counter[str]()
    for sample in samples_of(folder, count):
        shape, joints = shape_of_sample(sample), pairs_of(sample.members[JOINTS])
        low, high = shape_bounds(shape)
        scale = 1.0 if sample.record["unit"] == "metre" else 1.0 / float(np.linalg.norm(high - low))
        model = simulation_model(sample.key, shape, joints, ExportSettings(links="bodies", scale=scale))
        found["samples"] += 1
        is_stable = bool(sample.record["physics"]["stable"])
        with tempfile.TemporaryDirectory() as place:
            _in_mujoco(Path(place) / "mjcf", model, is_stable, found)
            if find_spec("pybullet"):
                _in_pybullet(Path(place) / "urdf", model, is_stable, found)
            _in_usd(Path(place) / "usd", model, float(high[1] - low[1]) * scale, found)
    return found


def _written(folder: Path, files: Mapping[str, bytes]) -> list[Path]:
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return [folder / name for name in files]


def _note(found: Counter[str], engine: str, mass: float, model: SimulationModel) -> None:
    found[f"{engine} opens"] += 1
    found[f"{engine} has the mass"] += bool(np.isclose(mass, sum(link.mass for link in model.links), rtol=1e-4))


def _note_rest(found: Counter[str], engine: str, moved: bool, is_stable: bool) -> None:
    found[f"{engine}: {'stable' if is_stable else 'unstable'} ones that {'move' if moved else 'rest'}"] += 1


def _in_mujoco(folder: Path, model: SimulationModel, is_stable: bool, found: Counter[str]) -> None:
    import mujoco

    path = _written(folder, mjcf_files(model))[0]
    (folder / "scene.xml").write_text(SCENE.format(file=path.name), encoding="utf-8")
    loaded = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
    state = mujoco.MjData(loaded)
    _note(found, "MuJoCo", float(loaded.body_mass.sum()), model)
    mujoco.mj_forward(loaded, state)
    roots = np.flatnonzero(loaded.body_parentid[1:] == 0) + 1
    start = state.subtree_com[roots, 2].copy()
    mujoco.mj_step(loaded, state, 500)
    moved = np.abs(state.subtree_com[roots, 2] - start) > REST_SHARE * start
    _note_rest(found, "MuJoCo", bool(moved.any()), is_stable)
    for joint in range(loaded.njnt):
        if loaded.jnt_type[joint] != mujoco.mjtJoint.mjJNT_SLIDE:
            continue
        pulled = mujoco.MjData(loaded)
        pulled.qfrc_applied[loaded.jnt_dofadr[joint]] = PULL_NEWTONS
        mujoco.mj_step(loaded, pulled, 1000)
        travel = float(pulled.qpos[loaded.jnt_qposadr[joint]])
        found["drawers"] += 1
        found["drawers that come out to their limit"] += abs(travel - loaded.jnt_range[joint][1]) < 0.02


def _in_pybullet(folder: Path, model: SimulationModel, is_stable: bool, found: Counter[str]) -> None:
    import pybullet as bullet

    paths = [path for path in _written(folder, urdf_files(model)) if path.suffix == ".urdf"]
    client = bullet.connect(bullet.DIRECT)
    try:
        bullet.setGravity(0, 0, -9.81)
        ground = bullet.createMultiBody(0, bullet.createCollisionShape(bullet.GEOM_PLANE))
        bodies = [bullet.loadURDF(str(path), flags=bullet.URDF_USE_INERTIA_FROM_FILE) for path in paths]
        links = [(body, link) for body in bodies for link in range(-1, bullet.getNumJoints(body))]
        _note(found, "PyBullet", sum(bullet.getDynamicsInfo(*link)[0] for link in links), model)
        for body in (ground, *bodies):
            bullet.changeDynamics(body, -1, lateralFriction=1.0)
        start = np.array([bullet.getBasePositionAndOrientation(body)[0][2] for body in bodies])
        for _ in range(240):
            bullet.stepSimulation()
        now = np.array([bullet.getBasePositionAndOrientation(body)[0][2] for body in bodies])
        _note_rest(found, "PyBullet", bool((np.abs(now - start) > REST_SHARE * start).any()), is_stable)
    finally:
        bullet.disconnect(client)


def _in_usd(folder: Path, model: SimulationModel, height: float, found: Counter[str]) -> None:
    from pxr import Usd, UsdGeom, UsdPhysics

    stage = Usd.Stage.Open(str(_written(folder, usd_files(model))[0]))
    bodies: list[Any] = [prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.RigidBodyAPI)]
    _note(found, "OpenUSD", sum(UsdPhysics.MassAPI(prim).GetMassAttr().Get() for prim in bodies), model)
    heights = []  # not of a BBoxCache, which turns the boxes around meshes, and so makes them larger
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Mesh) and UsdGeom.Imageable(prim).ComputePurpose() == UsdGeom.Tokens.default_:
            points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get(), dtype=np.float64)
            to_world = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(0))
            heights.append(points @ to_world[:3, 2] + to_world[3, 2])
    places = np.concatenate(heights)
    found["OpenUSD has the height"] += bool(np.isclose(np.ptp(places), height, rtol=1e-4))


def main() -> None:
    """Compare and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--surfaces", type=int, default=200)
    parser.add_argument("--exports", type=int, default=50)
    asked = parser.parse_args()
    for count, compare in ((asked.surfaces, compare_surfaces), (asked.exports, open_exports)):
        if count:
            print(
                "\n".join(f"{number:>8,} {what}" for what, number in compare(asked.dataset, count).items()), flush=True
            )


if __name__ == "__main__":
    main()
