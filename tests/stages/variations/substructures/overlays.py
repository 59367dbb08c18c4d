"""Every replacement along a motion by trying all: an oracle that shares no code with the list that it judges.

Every part of a base is laid upon every equal one of a giver in every way in which that part is symmetric. Parts that
coincide then are matched; what is left hangs together along contacts, and where a neighbour in the base and one in the
giver of a matched part stand in one place. Each of several such regions that brings something and touches what is
matched is a replacement.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import networkx as nx
import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.kit import Assembly, Kit

MAX_GAP = 1e-4
MIN_UPRIGHT_COSINE = 0.999

Pairs = frozenset[tuple[int, int]]
Replaced = tuple[frozenset[int], frozenset[int], Pairs]
"""The parts of the base that leave, those of the giver that come, and the pairs that coincide at their border."""


def replacements(kit: Kit, base: Assembly, giver: Assembly, *, upright: bool) -> Counter[Replaced]:
    """All replacements of a piece of the base by one of the giver, which may be the same; how often each is met."""
    found = Counter[Replaced]()
    for motion in _motions(kit, base, giver):
        if upright and motion[1, 1] < MIN_UPRIGHT_COSINE:
            continue
        if base is giver and np.abs(motion - np.eye(4)).max() < MAX_GAP:
            continue
        found.update(_left_over(kit, base, giver, motion))
    return found


def _motions(kit: Kit, base: Assembly, giver: Assembly) -> Iterator[FloatArray]:
    """Every motion that lays some part of the base upon an equal one of the giver."""
    for kind, pose in zip(base.types.tolist(), base.poses, strict=True):
        for other, there in zip(giver.types.tolist(), giver.poses, strict=True):
            if kind == other:
                yield from (there @ symmetry @ np.linalg.inv(pose) for symmetry in kit.types[kind].symmetries)


def _left_over(kit: Kit, base: Assembly, giver: Assembly, motion: FloatArray) -> Iterator[Replaced]:
    """The replacements along one motion of the base onto the giver."""
    moved = motion @ base.poses
    matched = {
        (part, other)
        for part in range(len(base))
        for other in range(len(giver))
        if base.types[part] == giver.types[other]
        and _coincide(kit, int(base.types[part]), moved[part], giver.poses[other])
    }
    near, beyond = base.neighbours(), giver.neighbours()
    whole = nx.Graph()
    whole.add_nodes_from(("base", part) for part in range(len(base)))
    whole.add_nodes_from(("giver", part) for part in range(len(giver)))
    whole.add_edges_from((("base", i), ("base", j)) for i, j in base.edges.tolist())
    whole.add_edges_from((("giver", i), ("giver", j)) for i, j in giver.edges.tolist())
    for part, other in matched:
        for one in near[part]:
            for two in beyond[other]:
                if _in_one_place(kit, int(base.types[one]), moved[one], int(giver.types[two]), giver.poses[two]):
                    whole.add_edge(("base", one), ("giver", two))
    whole.remove_nodes_from([("base", part) for part, _ in matched] + [("giver", other) for _, other in matched])
    regions = list(nx.connected_components(whole))
    for region in regions if len(regions) > 1 else ():
        taken = frozenset(part for side, part in region if side == "base")
        piece = frozenset(part for side, part in region if side == "giver")
        border = frozenset(
            (part, other) for part, other in matched if taken & set(near[part]) or piece & set(beyond[other])
        )
        if piece and border:
            yield taken, piece, border


def _coincide(kit: Kit, kind: int, pose: FloatArray, other: FloatArray) -> bool:
    """Whether two parts of one type take the same points."""
    between = np.linalg.inv(other) @ pose
    return bool((np.abs(kit.types[kind].symmetries - between).max(axis=(1, 2)) < MAX_GAP).any())


def _in_one_place(kit: Kit, kind: int, pose: FloatArray, other_kind: int, other: FloatArray) -> bool:
    """Whether two parts are nearer to each other, middle to middle, than the larger of them is in half."""
    one, two = kit.types[kind], kit.types[other_kind]
    apart = (pose @ [*one.centroid, 1.0] - other @ [*two.centroid, 1.0])[:3]
    return float(np.linalg.norm(apart)) < max(one.diagonal, two.diagonal) / 2
