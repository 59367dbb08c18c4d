"""Surfaces with known symmetries, built from boundaries of sets of boxes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stages.model_files.scene import ModelScene, Placement, Surface

Ticks = list[float]


def mesh(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (v, 3) and faces (f, 3) of triangles (f, 3, 3)."""
    vertices, place = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    return vertices, place.reshape(-1, 3).astype(np.int32)


def one_object(triangles: np.ndarray) -> ModelScene:
    """Return a scene with one grey object of triangles (f, 3, 3)."""
    vertices, faces = mesh(triangles)
    grey = np.full((len(faces), 3), 160, dtype=np.uint8)
    return ModelScene("objects", (Surface("all", vertices, faces, grey),), (Placement("all", None, 0, np.eye(4)),))


def blocks(x: Ticks, y: Ticks, z: Ticks, solid: Callable[[float, float, float], bool]) -> np.ndarray:
    """Return the boundary, outward triangles (f, 3, 3), of the boxes between the ticks whose centres are solid."""
    axes = [np.array(ticks, dtype=float) for ticks in (x, y, z)]
    middles = [(ticks[1:] + ticks[:-1]) / 2 for ticks in axes]
    full = np.zeros([len(ticks) + 1 for ticks in axes], dtype=bool)
    for place in np.ndindex(*map(len, middles)):
        full[tuple(np.add(place, 1))] = solid(*(float(middles[d][place[d]]) for d in range(3)))
    triangles = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for place in np.ndindex(*map(len, middles)):
            here = tuple(np.add(place, 1))
            if not full[here]:
                continue
            for side in (0, 1):
                neighbour = list(here)
                neighbour[axis] += 2 * side - 1
                if full[tuple(neighbour)]:
                    continue
                quad = np.zeros((4, 3))
                quad[:, axis] = axes[axis][place[axis] + side]
                quad[:, u] = axes[u][[place[u], place[u] + 1, place[u] + 1, place[u]]]
                quad[:, v] = axes[v][[place[v], place[v], place[v] + 1, place[v] + 1]]
                quad = quad if side else quad[::-1]
                triangles += [quad[[0, 1, 2]], quad[[0, 2, 3]]]
    return np.array(triangles)


def wall(windows: int, storeys: int = 1) -> np.ndarray:
    """Return a wall with `windows` by `storeys` holes at intervals of one by two along x and z, with margins."""
    x = [0.0, *(0.6 + k + o for k in range(windows) for o in (0.25, 0.75)), windows + 1.2]
    z = [0.0, *(2 * k + o for k in range(storeys) for o in (0.5, 1.5)), 2.0 * storeys + 0.4]
    return blocks(x, [0.0, 0.3], z, lambda a, _, c: not (_in(a - 0.6, windows, 1, 0.25) and _in(c, storeys, 2, 0.5)))


def _in(at: float, count: int, period: float, margin: float) -> bool:
    return 0 <= at < count * period and margin < at % period < period - margin


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> np.ndarray:
    """Return a box as triangles (12, 3, 3)."""
    x, y, z = ([a, b] for a, b in zip(low, high, strict=True))
    return blocks(x, y, z, lambda *_: True)


def moved(triangles: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return triangles under a rigid transform (4, 4)."""
    turned: np.ndarray = triangles @ pose[:3, :3].T + pose[:3, 3]
    return turned


def area(triangles: np.ndarray) -> float:
    """Return the area of triangles (f, 3, 3)."""
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return float(np.linalg.norm(cross, axis=1).sum() / 2)


def shift(*by: float) -> np.ndarray:
    """Return a translation (4, 4)."""
    pose = np.eye(4)
    pose[:3, 3] = by
    return pose


def screw(angle: float, rise: float) -> np.ndarray:
    """Return a screw motion (4, 4): a turn about z by `angle` radians with a rise along z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, rise], [0, 0, 0, 1]])


def spiral_stair(steps: int, angle: float = 0.5, rise: float = 0.35) -> np.ndarray:
    """Return overlapping steps around an axis: each is the previous one under a screw motion."""
    step = box((0.4, -0.35, 0.0), (2.0, 0.35, 0.4))
    pose, parts = np.eye(4), []
    for _ in range(steps):
        parts.append(moved(step, pose))
        pose = screw(angle, rise) @ pose
    return np.concatenate(parts)


def uneven_wall() -> np.ndarray:
    """Return a wall of four by three windows; those of the third bay are higher.

    Storeys repeat in each bay, bays only next to other bays.
    """
    x = [0.0, *(0.6 + k + o for k in range(4) for o in (0.25, 0.75)), 5.2]
    z = sorted({0.0, 6.4, *(2 * k + o for k in range(3) for o in (0.5, 0.8, 1.5, 1.8))})

    def solid(across: float, _: float, up: float) -> bool:
        raised = 0.3 if _in(across - 2.6, 1, 1, 0.0) else 0.0
        return not (_in(across - 0.6, 4, 1, 0.25) and _in(up - raised, 3, 2, 0.5))

    return blocks(x, [0.0, 0.3], z, solid)


def blind_corners() -> np.ndarray:
    """Return a wall of four by four windows without those in its corners.

    Bays and storeys can be inserted at sites that go around the corners. Where a site of bays crosses one of storeys,
    it does not cross it in the next bay (symmetry figure 7b).
    """
    ticks = [0.0, *(k + o for k in range(4) for o in (0.2, 0.8)), 4.0]

    def solid(across: float, _: float, up: float) -> bool:
        corner = int(across) in (0, 3) and int(up) in (0, 3)
        return corner or not (_in(across, 4, 1, 0.2) and _in(up, 4, 1, 0.2))

    return blocks(ticks, [0.0, 0.3], ticks, solid)


def prongs_and_bridge() -> np.ndarray:
    """Return a plate with two prongs, and at a distance of nine two prongs joined by a bar."""
    return blocks(
        [0, 1, 2, 5, 6, 7, 9, 10, 11, 14, 15, 16], [0, 1], [0, 1, 3, 4],
        lambda x, _, z: z < 1 or (x in (1.5, 5.5)) or (x in (10.5, 14.5)) or (z > 3 and 10 < x < 15),
    )  # fmt: skip
