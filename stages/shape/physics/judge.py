"""The physical validity of a shape: all checks as one answer, as fields of a record, and as a filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import Any, Literal

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.components import connected_components
from stages.shape.kit import Assembly, PartMesh
from stages.shape.physics.contacts import ContactPatches, PairContacts
from stages.shape.physics.settings import PhysicsConfig, Requirements
from stages.shape.physics.settling import Body, Fall, hull_vertices, tilt_to_fall
from stages.shape.physics.solids import MeshSolids, PlacedParts
from stages.shape.physics.stability import Stability, stability, standing_points, tipping_angle
from stages.shape.physics.structure import ground_share, mirror_score
from stages.shape.shape import Shape

NEVER_FALLS_DEGREES = 90.0
"""Tilt in records of a shape that no tilt brings to another height."""
TIPPING_TOLERANCE_DEGREES = 1e-4
"""A shape that just stands may seem to be this far beyond tipping."""
TOLERANCE_STEP = 1.25
"""Factor between the contact tolerances that are tried."""


@dataclass(frozen=True)
class Validity:
    """The physical validity of a shape, invariant under turns about the vertical and scaling.

    rooted: whether every part is connected to the ground (shapeassembly App. E)
    stable, margin: see `stages.shape.physics.stability.Stability`
    weakest: index of the part that gives way first, -1 if none
    tipping_degrees: how far the shape, if rigid, can be tilted
    components: number of connected pieces
    floating: number of parts that no chain of connected parts leads to the ground
    penetration: volume that parts share, by pairs, as a share of the volume of all parts
    ground: area that it stands on, as a share of its outline from above
    symmetry: share of the weight that an upright mirror maps to equal parts
    weighed: by volume, or by area if a part is open
    joints: connected pairs, int32 (m, 2), i < j in lexicographic order
    """

    rooted: bool
    stable: bool
    margin: float
    weakest: int
    tipping_degrees: float
    components: int
    floating: int
    penetration: float
    ground: float
    symmetry: float
    weighed: Literal["volume", "area"]
    joints: IntArray = field(compare=False, repr=False)


class Judge:
    """Judges assemblies of given meshes: one for each kit, whose answers about pairs recur, or one for each program."""

    def __init__(self, meshes: Sequence[PartMesh], up: Literal["y", "z"], config: PhysicsConfig) -> None:
        self.config = config
        self._meshes, self._up = tuple(meshes), up
        self._solids = MeshSolids(self._meshes)
        self._touch = PairContacts(self._meshes, self._solids)
        self._last: tuple[Assembly, PlacedParts] | None = None

    def rooted(self, assembly: Assembly) -> bool:
        """Return whether every part is connected to the ground (shapeassembly App. E)."""
        placed = self._placed(assembly)
        return not _floating(placed, self._connected(placed, assembly), self.config).any()

    def unmet_requirement(self, assembly: Assembly, requirements: Requirements) -> str | None:
        """Return the first requirement that is not met, or None.

        Whether the whole shape tips over is tested before its parts. Raises ValueError as `validity` does.
        """
        placed = self._placed(assembly)
        standing = self._standing(placed) if requirements.stable else None
        if standing is not None and tipping_angle(placed, standing) < -TIPPING_TOLERANCE_DEGREES:
            return "not stable"
        connected = self._connected(placed, assembly)
        if requirements.rooted and _floating(placed, connected, self.config).any():
            return "not rooted"
        if standing is None:
            return None
        dry = self.config.joints == "dry"
        depths = self._touch.overlaps(placed, connected)[1] if dry else np.zeros(len(connected))
        return None if self._stability(placed, connected, depths, standing).stable else "not stable"

    def fall(self, assembly: Assembly, connected: IntArray | None = None) -> Fall:
        """Return the least tilt by which a dropped piece comes to rest at another height, and the piece.

        connected: the joints of `validity` for this assembly, if they are known

        The tilt is 0 if a part is not rooted, since stable shapes are rooted (shapeassembly App. E). Connected parts
        are one rigid body whatever `config.joints` is. See `stages.shape.physics.settling`. Raises ValueError as
        `validity` does.
        """
        placed = self._placed(assembly)
        connected = self._connected(placed, assembly) if connected is None else connected
        floating = _floating(placed, connected, self.config)
        if floating.any():
            return Fall(0.0, int(floating.argmax()))
        pieces = connected_components(len(placed), connected)
        tilts = np.array(
            [tilt_to_fall(_body(placed, pieces == piece), placed.diagonal) for piece in range(pieces.max() + 1)]
        )
        first = int(tilts.argmin())
        return Fall(float(tilts[first]), int((pieces == first).argmax()) if np.isfinite(tilts[first]) else -1)

    def contacts(self, assembly: Assembly, tolerance: float = 0.0) -> IntArray:
        """Return the pairs of parts that touch or overlap, int32 (m, 2), i < j in lexicographic order.

        These are the assembly's edges and the pairs at most `config.touching` or `tolerance` apart.

        tolerance: in the units of the shape
        """
        placed = self._placed(assembly)
        return self._touch.connected(placed, max(self.config.touching * placed.diagonal, tolerance), assembly.edges)

    def kept_contacts(self, assembly: Assembly, tolerance: float) -> tuple[IntArray, float]:
        """Return the contacts of an assembly at a distance at which all its edges are contacts, and that distance.

        It is the larger one of `config.touching` and `tolerance`, or a multiple of it where edges became longer, as in
        stretched shapes.
        """
        placed = self._placed(assembly)
        distance = max(self.config.touching * placed.diagonal, tolerance)
        wanted, no_edges = set(map(tuple, assembly.edges.tolist())), np.empty((0, 2), dtype=np.int32)
        while True:
            found = self._touch.connected(placed, distance, no_edges)
            if distance >= placed.diagonal or wanted <= set(map(tuple, found.tolist())):
                return found, distance
            distance *= TOLERANCE_STEP

    def validity(self, assembly: Assembly) -> Validity:
        """Return the whole verdict. Raises ValueError for a shape without parts, extent or weight."""
        config = self.config
        placed = self._placed(assembly)
        connected = self._connected(placed, assembly)
        floating = _floating(placed, connected, config)
        volumes, depths = self._touch.overlaps(placed, connected)
        standing = self._standing(placed)
        verdict = self._stability(placed, connected, depths, standing)
        whole = self._solids.volumes[placed.types].sum()
        return Validity(
            rooted=not floating.any(),
            stable=verdict.stable,
            margin=verdict.margin,
            weakest=verdict.weakest,
            tipping_degrees=tipping_angle(placed, standing),
            components=int(connected_components(len(placed), connected).max()) + 1,
            floating=int(floating.sum()),
            penetration=float(volumes.sum() / whole) if whole > 0 else 0.0,
            ground=ground_share(placed, standing),
            symmetry=mirror_score(placed),
            weighed=placed.weighed,
            joints=connected,
        )

    def joint_tolerance(self, assembly: Assembly) -> float:
        """Return `config.connected` in the units of the shape."""
        return self.config.connected * self._placed(assembly).diagonal

    def _placed(self, assembly: Assembly) -> PlacedParts:
        # Several questions follow each other about one assembly.
        if self._last is None or self._last[0] is not assembly:
            self._last = assembly, PlacedParts.of(self._meshes, self._solids, assembly, self._up)
        return self._last[1]

    def _standing(self, placed: PlacedParts) -> ContactPatches:
        return standing_points(placed, np.arange(len(placed)), self.config.connected * placed.diagonal)

    def _stability(
        self, placed: PlacedParts, connected: IntArray, depths: FloatArray, standing: ContactPatches
    ) -> Stability:
        """Return the stability of placed parts.

        depths: penetration depth of the connected pairs; irrelevant if joints are rigid
        """
        deep = connected[depths > self.config.touching * placed.diagonal]
        return stability(placed, self._touch, connected, deep, standing, self.config)

    def _connected(self, placed: PlacedParts, assembly: Assembly) -> np.ndarray:
        return self._touch.connected(placed, self.config.connected * placed.diagonal, assembly.edges)


@lru_cache(maxsize=16)
def judge_of(meshes: tuple[PartMesh, ...], up: Literal["y", "z"], config: PhysicsConfig) -> Judge:
    """Return the cached judge of all shapes with these meshes."""
    return Judge(meshes, up, config)


def physical_fields(validity: Validity) -> dict[str, Any]:
    """Return the `physics` field of a sample's record, rounded so that noise of last digits changes no bytes."""
    values = {field.name: getattr(validity, field.name) for field in fields(validity) if field.name != "joints"}
    return {name: round(value, 6) + 0.0 if isinstance(value, float) else value for name, value in values.items()}


def fall_fields(fall: Fall) -> dict[str, Any]:
    """Return what a fall adds to the `physics` field of a record."""
    degrees = round(min(fall.tilt_degrees, NEVER_FALLS_DEGREES), 6)
    return {"falls": fall.falls, "fall_degrees": degrees, "fallen": fall.part}


def unmet_requirement(requirements: Requirements, shape: Shape) -> str | None:
    """Return why a shape is rejected, as counted among the rejects, or None if it is kept.

    Without requirements nothing is computed. A shape without a body to judge meets no requirement.
    """
    if not requirements.rooted and not requirements.stable:
        return None
    try:
        return judge_of(shape.meshes, shape.up, requirements.physics).unmet_requirement(shape.assembly, requirements)
    except ValueError:
        return "no body to judge"


def _body(placed: PlacedParts, own: BoolArray) -> Body:
    """Return the parts `own`, bool (n,), as one body."""
    weights = placed.weights[own]
    points = np.concatenate([placed.points[part] for part in np.flatnonzero(own).tolist()])
    return Body(hull_vertices(points), weights @ placed.centroids[own] / max(weights.sum(), np.finfo(float).tiny))


def _floating(placed: PlacedParts, connected: np.ndarray, config: PhysicsConfig) -> np.ndarray:
    """Return which parts no chain of connected parts leads to the ground, bool (n,)."""
    pieces = connected_components(len(placed), connected)
    low = placed.spans[:, 0, 2] <= config.connected * placed.diagonal
    floating: np.ndarray = ~np.isin(pieces, pieces[low])
    return floating
