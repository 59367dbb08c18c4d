"""A skin over rings of points: the mesh of sweeps, lofts, extrusions and revolutions."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from stages.programs.curves.caps import Cap, fan
from stages.programs.curves.mesh import QuadMesh, reversed_faces
from stages.shape.arrays import FloatArray, IntArray


def skin(rings: FloatArray, cap: Cap, closed: bool = False) -> QuadMesh:
    """The closed mesh over rings of points, float64 (r, k, 3).

    Each ring is counter-clockwise seen from the rings after it. A first or last ring whose points coincide is a pole;
    another is filled by `cap`. `closed` joins the last ring to the first. Raises ValueError where an inner ring has no
    extent, and for fewer than two rings (closed: three).
    """
    count, around = rings.shape[:2]
    if count < (3 if closed else 2):
        raise ValueError(f"a skin needs {'three' if closed else 'two'} rings, not {count}")
    extent = np.abs(rings - rings[:, :1]).max(axis=(1, 2))
    flat = extent <= 1e-9 * extent.max()
    if flat.any() and (extent.max() == 0.0 or flat.all() or closed or flat[1:-1].any()):
        indices = np.flatnonzero(flat).tolist()
        raise ValueError(f"rings {indices} of {count} shrink to a point: only the first and the last may")
    if closed:
        return QuadMesh(rings.reshape(-1, 3), _sides(count, around, True))
    poles = bool(flat[0]), bool(flat[-1])
    kept = rings[int(poles[0]) : count - int(poles[1])]
    vertices = [kept.reshape(-1, 3)]
    for end, pole in ((0, poles[0]), (-1, poles[1])):
        if pole:
            vertices.append(rings[end, :1])
        elif cap.middle:
            vertices.append(rings[end].mean(axis=0)[None])
    return QuadMesh(np.concatenate(vertices), _quads(len(kept), around, poles, cap))


def _quads(rings: int, around: int, poles: tuple[bool, bool], cap: Cap) -> IntArray:
    if cap.quads is fan(around):
        return _fanned(rings, around, poles)
    return _assembled(rings, around, poles, cap.quads, cap.middle)


@lru_cache(maxsize=1024)
def _fanned(rings: int, around: int, poles: tuple[bool, bool]) -> IntArray:
    return _assembled(rings, around, poles, fan(around), around > 4)


def _assembled(rings: int, around: int, poles: tuple[bool, bool], filling: IntArray, middle: bool) -> IntArray:
    """Sides, and a pole or a filling at both ends; the points of the ends are after those of the rings."""
    parts = [_sides(rings, around, False)]
    extra = rings * around
    index = np.arange(around, dtype=np.int32)
    after = np.roll(index, -1)
    for last, pole in enumerate(poles):
        base = (rings - 1) * around if last else 0
        if pole:
            tip = np.full(around, extra, dtype=np.int32)
            edge = (index, after) if last else (after, index)
            parts.append(np.stack([base + edge[0], base + edge[1], tip, tip], axis=1))
        else:
            indices = np.where(filling == around, extra, filling + base)
            if not last:
                indices = reversed_faces(indices)
            parts.append(indices)
        extra += int(pole or middle)
    quads = np.concatenate(parts).astype(np.int32)
    quads.flags.writeable = False
    return quads


@lru_cache(maxsize=1024)
def _sides(rings: int, around: int, closed: bool) -> IntArray:
    """Quads between rings of `around` points each, int32 (q, 4)."""
    ring = np.arange(rings if closed else rings - 1, dtype=np.int32)[:, None] * around
    next_ring = (ring + around) % (rings * around)
    index = np.arange(around, dtype=np.int32)
    after = np.roll(index, -1)
    quads = np.stack([ring + index, ring + after, next_ring + after, next_ring + index], axis=-1).reshape(-1, 4)
    quads.flags.writeable = False
    return quads
