"""Compositions: solids dropped on a heap or a stack, and solids attached to the surfaces of others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stages.primitives.settings import Composition, Kind, PrimitivesConfig
from stages.primitives.solids import ROUND, draw_numbers, solid_mesh
from stages.primitives.text import PlacedSolid, placed_solid
from stages.programs.curves.transforms import rotation, translation
from stages.shape.arrays import FloatArray

UPRIGHT_SHARE = 0.6
"""Share of the solids of a heap that keep their axis upright; the others lie or lean in any direction."""
SINK_SHARE = 0.03
"""Depth to which a dropped solid sinks into what it falls on, as a share of its shortest side."""
ATTACH_SHARE = 0.15
"""Depth to which an attached solid reaches into its parent, as a share of its extent along the axis."""
PROBES_PER_SIDE = 20
"""Points along each side of the box around a falling solid at which its distance from others is measured."""
SPREAD = {"heap": 0.25, "stack": 0.04}
"""Standard deviation of the horizontal places of dropped solids, as a share of `max_size`."""
MAX_COPIES = 6


def random_composition(
    composition: Composition, config: PrimitivesConfig, rng: np.random.Generator
) -> list[PlacedSolid]:
    """Return the solids of a random composition, standing on the plane y = 0."""
    count = int(rng.integers(config.min_parts, config.max_parts + 1))
    if composition == "attached":
        return _attached(count, config, rng)
    solids: list[PlacedSolid] = []
    for _ in range(count):
        turned = rng.random() > UPRIGHT_SHARE if composition == "heap" else False
        kind, numbers = _drawn(config, 1.0, rng)
        turn = _any_rotation(rng) if turned else rotation("y", float(rng.uniform(0, 360)))
        x, z = rng.normal(0, SPREAD[composition] * config.max_size, 2) if solids else (0.0, 0.0)
        loose = placed_solid(kind, numbers, False, translation(float(x), 0.0, float(z)) @ turn)
        height = rest_height(_corners(loose), [_corners(solid) for solid in solids])
        place = (loose.place[0], round(loose.place[1] + height, 6), loose.place[2])
        solids.append(replace(loose, place=place))
    return solids


def _drawn(config: PrimitivesConfig, scale: float, rng: np.random.Generator) -> tuple[Kind, tuple[float, ...]]:
    """Return a random solid whose numbers make a mesh."""
    low, high = np.log(config.min_size), np.log(config.max_size)

    def length() -> float:
        return scale * float(np.exp(rng.uniform(low, high)))

    while True:
        kind = config.kinds[int(rng.integers(len(config.kinds)))]
        numbers = tuple(round(number, 6) for number in draw_numbers(kind, length, rng))
        try:
            solid_mesh(kind, numbers)
        except ValueError:
            continue  # such as a vessel without space within
        return kind, numbers


def _any_rotation(rng: np.random.Generator) -> FloatArray:
    """Return a rotation (4, 4), uniform over all."""
    pose = np.eye(4)
    basis, upper = np.linalg.qr(rng.normal(size=(3, 3)))
    basis *= np.sign(np.diag(upper))
    pose[:3, :3] = basis * np.linalg.det(basis)
    return pose


def rest_height(corners: FloatArray, below: list[FloatArray]) -> float:
    """Return by how much a solid must be raised to rest on others, or on the plane y = 0, slightly sunk in.

    corners: of the triangles of the solid, float64 (t, 3, 3)
    below: those of the others
    """
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    sink = SINK_SHARE * float((high - low).min())
    across = (np.arange(PROBES_PER_SIDE) + 0.5) / PROBES_PER_SIDE
    x, z = np.meshgrid(low[0] + across * (high[0] - low[0]), low[2] + across * (high[2] - low[2]))
    points = np.column_stack([x.ravel(), z.ravel()])
    under = -_heights(corners * [1, -1, 1], points)
    tops = [
        _heights(other, points)
        for other in below
        if (other.min(axis=(0, 1))[[0, 2]] < high[[0, 2]]).all()
        and (other.max(axis=(0, 1))[[0, 2]] > low[[0, 2]]).all()
    ]
    gaps = (top - under for top in tops)
    met = [float(gap[np.isfinite(gap)].max()) - sink for gap in gaps if np.isfinite(gap).any()]
    return max([-float(low[1]), *met])


def _heights(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Return the largest height of triangles (t, 3, 3) above points (p, 2) of the ground, (p,); -inf where none is."""
    near = (corners[..., [0, 2]].min(axis=1) <= points.max(axis=0)) & (
        corners[..., [0, 2]].max(axis=1) >= points.min(axis=0)
    )
    first, second, third = np.moveaxis(corners[near.all(axis=1)], 1, 0)
    along, across, away = second - first, third - first, points[:, None] - first[None, :, [0, 2]]
    area = along[:, 0] * across[:, 2] - along[:, 2] * across[:, 0]
    safe = np.where(np.abs(area) > 1e-12, area, np.inf)
    u = (away[..., 0] * across[:, 2] - away[..., 1] * across[:, 0]) / safe
    v = (along[:, 0] * away[..., 1] - along[:, 2] * away[..., 0]) / safe
    inside = (u >= 0) & (v >= 0) & (u + v <= 1) & np.isfinite(safe)
    height = first[:, 1] + u * along[:, 1] + v * across[:, 1]
    highest: FloatArray = np.where(inside, height, -np.inf).max(axis=1, initial=-np.inf)
    return highest


def _corners(solid: PlacedSolid) -> FloatArray:
    """Return the corners of the triangles of a placed solid, float64 (t, 3, 3)."""
    corners: FloatArray = solid.vertices[solid.mesh.triangles]
    return corners


def _attached(count: int, config: PrimitivesConfig, rng: np.random.Generator) -> list[PlacedSolid]:
    """Return solids that each grow from the surface of an earlier one, some of them several times."""
    kind, numbers = _drawn(config, 1.0, rng)
    solids = [placed_solid(kind, numbers, False, rotation("y", float(rng.uniform(0, 360))))]
    depths = [0]
    for _ in range(count - 1):
        parent = int(rng.integers(len(solids)))
        kind, numbers = _drawn(config, config.shrink ** (depths[parent] + 1), rng)
        own = _grown(solids[parent], kind, numbers, rng)
        for mirrored, pose in _copied(solids[parent], own, rng, config.copies):
            solids.append(placed_solid(kind, numbers, mirrored != solids[parent].mirrored, solids[parent].pose @ pose))
            depths.append(depths[parent] + 1)
    lowest = min(float(solid.vertices[:, 1].min()) for solid in solids)
    return [
        replace(solid, place=(solid.place[0], round(solid.place[1] - lowest, 6), solid.place[2])) for solid in solids
    ]


def _grown(parent: PlacedSolid, kind: Kind, numbers: tuple[float, ...], rng: np.random.Generator) -> FloatArray:
    """Return the pose (4, 4) of a solid on a random point of its parent's surface, in the parent's own coordinates."""
    mesh = solid_mesh(parent.kind, parent.numbers)
    corners = mesh.vertices[mesh.triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(across, axis=1)
    face = int(rng.choice(len(areas), p=areas / areas.sum()))
    weights = rng.dirichlet(np.ones(3))
    point, normal = weights @ corners[face], across[face] / areas[face]
    low, high = solid_mesh(kind, numbers).bounds
    extent = float(high[1] - low[1])
    pose = np.eye(4)
    pose[:3, :3] = _turn_to(normal) @ rotation("y", float(rng.uniform(0, 360)))[:3, :3]
    pose[:3, 3] = point + normal * extent * (0.5 - ATTACH_SHARE)
    return pose


def _turn_to(normal: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) that takes the y axis to a unit vector."""
    side = np.cross(normal, [1.0, 0.0, 0.0] if abs(normal[0]) < 0.9 else [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    return np.column_stack([side, normal, np.cross(side, normal)])


def _copied(
    parent: PlacedSolid, pose: FloatArray, rng: np.random.Generator, probability: float
) -> list[tuple[bool, FloatArray]]:
    """Return the poses of a solid and of its copies in the coordinates of its parent, with whether each is mirrored."""
    if rng.random() >= probability:
        return [(False, pose)]
    pattern = ["mirror", "row", "around"][int(rng.integers(3))]
    low, high = solid_mesh(parent.kind, parent.numbers).bounds
    if pattern == "mirror":
        flip = np.diag([-1.0, 1.0, 1.0, 1.0])
        return [(False, pose), (True, flip @ pose @ flip)]
    count = int(rng.integers(2, MAX_COPIES + 1))
    if pattern == "around":
        count = count if parent.kind in ROUND else 2
        return [(False, rotation("y", 360.0 * copy / count) @ pose) for copy in range(count)]
    axis = int(np.argmax(high - low))
    step = np.zeros(3)
    step[axis] = 0.8 * (high - low)[axis] / (count - 1)
    start = pose[:3, 3] * (np.arange(3) != axis) + (low * 0.8) * (np.arange(3) == axis)
    poses = [pose.copy() for _ in range(count)]
    for copy, moved in enumerate(poses):
        moved[:3, 3] = start + copy * step
    return [(False, moved) for moved in poses]
