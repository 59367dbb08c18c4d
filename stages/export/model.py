"""A shape as the links and joints of a simulator: z up, in metres, with its lowest point at height 0."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from stages.export.hulls import convex_piece
from stages.export.mass import PartMasses, part_masses
from stages.export.settings import ExportSettings
from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.kit import PartMesh
from stages.shape.part_joint import PartJoint
from stages.shape.shape import Shape

Y_TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True)
class Link:
    """One rigid body.

    name: name of its first part, unique
    parts: indices of its parts
    frame: its coordinates in the world, rigid, float64 (4, 4); those of a root are the world's
    mass: in kilograms
    centre: centre of mass in its coordinates, in metres, float64 (3,)
    inertia: tensor about the centre along its axes, float64 (3, 3)
    """

    name: str
    parts: tuple[int, ...]
    frame: FloatArray
    mass: float
    centre: FloatArray
    inertia: FloatArray


@dataclass(frozen=True)
class LinkJoint:
    """A joint at the origin of the child's coordinates.

    parent, child: indices of links
    axis: unit vector in the coordinates of the child, float64 (3,); irrelevant if fixed
    upper: largest angle in radians or travel in metres; the lower limit is 0
    """

    kind: Literal["fixed", "revolute", "prismatic"]
    parent: int
    child: int
    axis: FloatArray
    upper: float


@dataclass(frozen=True)
class SimulationModel:
    """Links and joints of a shape.

    shape: the shape, z up, in metres
    links: each after its parent
    joints: one for each link that is not a root
    touching: pairs of links i < j that touch where the model is at rest; simulators must not let these collide
    fixed_base: whether roots are fixed to the world
    """

    name: str
    shape: Shape
    links: tuple[Link, ...]
    joints: tuple[LinkJoint, ...]
    touching: tuple[tuple[int, int], ...]
    fixed_base: bool

    @cached_property
    def roots(self) -> tuple[int, ...]:
        """The links without a parent: one for each piece of the shape."""
        children = {joint.child for joint in self.joints}
        return tuple(link for link in range(len(self.links)) if link not in children)

    @cached_property
    def hulls(self) -> dict[int, PartMesh]:
        """Convex collision piece of each mesh in use."""
        return {mesh: convex_piece(self.shape.meshes[mesh]) for mesh in sorted(set(self.shape.assembly.types.tolist()))}

    def joints_below(self, link: int) -> Iterator[LinkJoint]:
        """Yield the joints whose parent is a link."""
        return (joint for joint in self.joints if joint.parent == link)

    def pose_in_link(self, link: int, part: int) -> FloatArray:
        """Return the pose of a part in the coordinates of a link, float64 (4, 4)."""
        pose: FloatArray = np.linalg.inv(self.links[link].frame) @ self.shape.assembly.poses[part]
        return pose

    def child_frame(self, joint: LinkJoint) -> FloatArray:
        """Return the coordinates of a joint's child in those of its parent, float64 (4, 4)."""
        frame: FloatArray = np.linalg.inv(self.links[joint.parent].frame) @ self.links[joint.child].frame
        return frame


@dataclass(frozen=True)
class _Group:
    """Parts that keep their places relative to each other.

    tree: each part with the part that holds it, -1 for the first
    """

    tree: tuple[tuple[int, int], ...]
    joint: PartJoint | None

    @property
    def parts(self) -> tuple[int, ...]:
        return tuple(part for part, _ in self.tree)


def simulation_model(name: str, shape: Shape, connected: IntArray, settings: ExportSettings) -> SimulationModel:
    """Return the links and joints of an upright shape, y up.

    connected: pairs of parts that hold together, int32 (m, 2); each piece that they make is a root of its own.
    Raises ValueError for a shape without parts or with a part without weight.
    """
    placed = _placed(shape, settings.scale)
    masses = part_masses(placed, settings.density, settings.shell_thickness)
    if not len(placed) or not (masses.masses > 0).all():
        raise ValueError("it has no parts, or a part without volume and area, which has no weight")
    neighbours = replace(placed.assembly, edges=connected).neighbours()
    bases, moving = _groups(placed, neighbours, masses.masses)
    links: list[Link] = []
    joints: list[LinkJoint] = []
    link_of: dict[int, int] = {}
    for group in [*bases, *moving]:
        origin = _joint_frame(group.joint) if group.joint else np.eye(4)
        for part, holder in group.tree:
            if holder >= 0 and settings.links == "bodies":
                link_of[part] = link_of[holder]
                continue
            own = group.parts if settings.links == "bodies" else (part,)
            frame = placed.assembly.poses[part] if holder >= 0 else origin
            link_of[part] = len(links)
            links.append(_link(placed.part_names[part], own, frame, masses))
            if holder >= 0:
                joints.append(LinkJoint("fixed", link_of[holder], link_of[part], np.zeros(3), 0.0))
            elif group.joint is not None:
                parent = link_of[_holder(group, bases, neighbours)]
                axis = np.array(group.joint.axis)
                joints.append(LinkJoint(group.joint.kind, parent, link_of[part], axis, group.joint.upper))
    touching = _touching(bases, moving, connected, link_of, joints)
    return SimulationModel(name, placed, tuple(links), tuple(joints), touching, settings.fixed_base)


def _placed(shape: Shape, scale: float) -> Shape:
    """Return the shape z up, in metres, with its lowest point at height 0."""
    lowest = float(shape_bounds(shape)[0, 1])
    turn = np.eye(4)
    turn[:3, :3], turn[2, 3] = Y_TO_Z, -lowest
    poses = turn @ shape.assembly.poses
    poses[:, :3, 3] *= scale
    meshes = tuple(replace(mesh, vertices=mesh.vertices * scale) for mesh in shape.meshes)
    joints = tuple(joint and _scaled(joint.transformed(turn), scale) for joint in shape.part_joints)
    return replace(shape, meshes=meshes, assembly=replace(shape.assembly, poses=poses), up="z", part_joints=joints)


def _scaled(joint: PartJoint, scale: float) -> PartJoint:
    x, y, z = joint.origin
    upper = joint.upper * scale if joint.kind == "prismatic" else joint.upper
    return replace(joint, origin=(x * scale, y * scale, z * scale), upper=upper)


def _groups(shape: Shape, neighbours: Sequence[Sequence[int]], masses: FloatArray) -> tuple[list[_Group], list[_Group]]:
    """Return the pieces of the parts that stay, and the groups of parts that move together."""
    joint_of = shape.part_joints or (None,) * len(shape)
    if all(joint_of):
        joint_of = (None,) * len(shape)
    bases, moving = [], []
    left = {part for part in range(len(shape)) if joint_of[part] is None}
    while left:
        tree = _tree(_heaviest(left, masses), left, neighbours)
        left -= {part for part, _ in tree}
        bases.append(_Group(tuple(tree), None))
    for joint in dict.fromkeys(joint for joint in joint_of if joint is not None):
        own = {part for part in range(len(shape)) if joint_of[part] == joint}
        first = _heaviest(own, masses)
        tree = _tree(first, own, neighbours)
        apart = sorted(own - {part for part, _ in tree})
        moving.append(_Group((*tree, *((part, first) for part in apart)), joint))
    return bases, moving


def _heaviest(parts: set[int], masses: FloatArray) -> int:
    return min(parts, key=lambda part: (-masses[part], part))


def _tree(first: int, allowed: set[int], neighbours: Sequence[Sequence[int]]) -> list[tuple[int, int]]:
    """Return the parts that chains of neighbours lead to from `first`, breadth first, each with its holder."""
    tree, waiting, seen = [(first, -1)], deque([first]), {first}
    while waiting:
        holder = waiting.popleft()
        for part in neighbours[holder]:
            if part in allowed and part not in seen:
                seen.add(part)
                tree.append((part, holder))
                waiting.append(part)
    return tree


def _holder(group: _Group, bases: Sequence[_Group], neighbours: Sequence[Sequence[int]]) -> int:
    """Return the part that holds a moving group: the lowest index of the staying parts that it touches."""
    staying = {part for base in bases for part in base.parts}
    touched = [part for own in group.parts for part in neighbours[own] if part in staying]
    return min(touched, default=bases[0].parts[0])


def _joint_frame(joint: PartJoint) -> FloatArray:
    frame = np.eye(4)
    frame[:3, 3] = joint.origin
    return frame


def _link(name: str, parts: tuple[int, ...], frame: FloatArray, masses: PartMasses) -> Link:
    mass, centre, inertia = masses.combined(parts)
    back = np.linalg.inv(frame)
    turn = back[:3, :3]
    return Link(name, parts, frame, mass, turn @ centre + back[:3, 3], turn @ inertia @ turn.T)


def _touching(
    bases: Sequence[_Group],
    moving: Sequence[_Group],
    connected: IntArray,
    link_of: dict[int, int],
    joints: Sequence[LinkJoint],
) -> tuple[tuple[int, int], ...]:
    """Return the pairs of links that may touch at rest: connected parts, and a moving group with all that holds it."""
    pairs = {(link_of[first], link_of[second]) for first, second in connected.tolist()}
    base_of = {link_of[part]: base for base in bases for part in base.parts}
    holder_of = {joint.child: joint.parent for joint in joints}
    for group in moving:
        base = base_of[holder_of[link_of[group.parts[0]]]]
        pairs |= {(link_of[own], link_of[part]) for own in group.parts for part in base.parts}
    return tuple(sorted({(min(pair), max(pair)) for pair in pairs if pair[0] != pair[1]}))
