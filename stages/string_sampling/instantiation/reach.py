"""Reachable poses of the last part of a chain, so that cycles are opened only where they can close.

The poses that a sequence of labels reaches from an orientation depend on these alone, and are kept from shape to shape
in a trie of sequences. Collisions within a chain are ignored, so reachable poses are a superset.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from stages.shape.geometry.hash_tables import mix
from stages.shape.geometry.pose_kernels import compose, same_rotation, squared_distance

MAX_CHAIN_LENGTH = 24
"""Longer chains are assumed to reach any pose."""
MAX_POSES = 6000
"""Sequences that reach more poses are assumed to reach any."""
POSE_ROOM = MAX_CHAIN_LENGTH * MAX_POSES + 1
TRIE_ROOM = 4096
NUM_BUCKETS = 1 << 18
BUCKET_TOLERANCES = 16.0
"""Side of a bucket."""
TOLERANCE_PER_DOCKING = 0.5
"""Error of each docking in a chain, in pose tolerances."""
UNLIMITED_POSES = -1
"""In place of the number of poses: any pose is reached."""
N_POSES, N_NODES = 0, 1


class ChainReach(NamedTuple):
    """p poses, grouped by trie node, and t trie nodes: an orientation, followed by labels."""

    orientations: np.ndarray  # int64 (p,)
    rotations: np.ndarray  # float64 (p, 3, 3)
    translations: np.ndarray  # float64 (p, 3)
    chains: np.ndarray  # int64 (p,): the next pose of its bucket, or -1
    buckets: np.ndarray  # int64 (b,)
    labels: np.ndarray  # int64 (t,): last label of each trie node; of a root -1 - its orientation
    children: np.ndarray  # int64 (t,): its first child, or -1
    siblings: np.ndarray  # int64 (t,): the next child of its parent, or -1
    starts: np.ndarray  # int64 (t,)
    sizes: np.ndarray  # int64 (t,): number of poses, or UNLIMITED_POSES
    counts: np.ndarray  # int64 (2,)


def new_reach(orientations: int) -> ChainReach:
    """Return a trie with the orientations alone."""
    reach = ChainReach(
        orientations=np.zeros(POSE_ROOM + orientations, dtype=np.int64),
        rotations=np.zeros((POSE_ROOM + orientations, 3, 3)),
        translations=np.zeros((POSE_ROOM + orientations, 3)),
        chains=np.full(POSE_ROOM + orientations, -1, dtype=np.int64),
        buckets=np.full(NUM_BUCKETS, -1, dtype=np.int64),
        labels=np.zeros(TRIE_ROOM + orientations, dtype=np.int64),
        children=np.full(TRIE_ROOM + orientations, -1, dtype=np.int64),
        siblings=np.full(TRIE_ROOM + orientations, -1, dtype=np.int64),
        starts=np.zeros(TRIE_ROOM + orientations, dtype=np.int64),
        sizes=np.zeros(TRIE_ROOM + orientations, dtype=np.int64),
        counts=np.zeros(2, dtype=np.int64),
    )
    _reset(reach, orientations)
    return reach


@numba.njit(cache=True)
def _reset(reach, orientations):
    """Reset the trie to the orientations alone."""
    reach.buckets[:] = -1
    for orientation in range(orientations):
        reach.orientations[orientation] = orientation
        reach.rotations[orientation] = np.eye(3)
        reach.translations[orientation] = 0.0
        reach.chains[orientation] = -1
        reach.labels[orientation] = -1 - orientation
        reach.children[orientation] = -1
        reach.siblings[orientation] = -1
        reach.starts[orientation] = orientation
        reach.sizes[orientation] = 1
    reach.counts[N_POSES] = orientations
    reach.counts[N_NODES] = orientations


@numba.njit(cache=True)
def can_reach(kit, placements, reach, orientation, sequence, length, target_orientation, rotation, translation):
    """Return whether a chain of labels `sequence[:length]` from an orientation can reach another at a pose."""
    if length > MAX_CHAIN_LENGTH:
        return True
    while True:
        node = orientation
        for index in range(length):
            node = _child(kit, placements, reach, node, sequence[index])
            if node < 0 or reach.sizes[node] == UNLIMITED_POSES:
                break
        if node >= 0:
            break
        _reset(reach, len(placements.orientation_types))
    if reach.sizes[node] == UNLIMITED_POSES:
        return True
    slack = kit.limits[0] * (1.0 + TOLERANCE_PER_DOCKING * length)
    end = reach.starts[node] + reach.sizes[node]
    return _find(kit, placements, reach, node, end, target_orientation, rotation, translation, slack) >= 0


@numba.njit(cache=True)
def _child(kit, placements, reach, node, label):
    """Return the trie node of a sequence extended by a label, or -1 if there is no room."""
    child = reach.children[node]
    while child >= 0:
        if reach.labels[child] == label:
            return child
        child = reach.siblings[child]
    child = reach.counts[N_NODES]
    if child == len(reach.labels) or reach.counts[N_POSES] + MAX_POSES > len(reach.orientations):
        return -1
    reach.counts[N_NODES] += 1
    reach.labels[child] = label
    reach.children[child] = -1
    reach.siblings[child] = reach.children[node]
    reach.children[node] = child
    start = reach.counts[N_POSES]
    reach.starts[child] = start
    labels = len(placements.orientation_starts) - 1
    rotation, translation = np.empty((3, 3)), np.empty(3)
    first = reach.starts[node]
    for pose in range(first, first + reach.sizes[node]):
        row = reach.orientations[pose] * labels + label
        for placement in range(placements.starts[row], placements.starts[row + 1]):
            compose(
                reach.rotations[pose], reach.translations[pose],
                placements.rotations[placement], placements.translations[placement], rotation, translation,
            )  # fmt: skip
            orientation = placements.orientations[placement]
            new = reach.counts[N_POSES]
            if (
                _find(
                    kit,
                    placements,
                    reach,
                    child,
                    new,
                    orientation,
                    rotation,
                    translation,
                    TOLERANCE_PER_DOCKING * kit.limits[0],
                )
                >= 0
            ):
                continue
            if new == start + MAX_POSES:
                # its poses stay in their buckets, but the node no longer uses them
                reach.sizes[child] = UNLIMITED_POSES
                return child
            reach.counts[N_POSES] += 1
            reach.orientations[new] = orientation
            reach.rotations[new] = rotation
            reach.translations[new] = translation
            width = BUCKET_TOLERANCES * kit.limits[0]
            bucket = _bucket(
                child,
                np.int64(np.floor(translation[0] / width)),
                np.int64(np.floor(translation[1] / width)),
                np.int64(np.floor(translation[2] / width)),
            )
            reach.chains[new] = reach.buckets[bucket]
            reach.buckets[bucket] = new
    reach.sizes[child] = reach.counts[N_POSES] - start
    return child


@numba.njit(cache=True)
def _bucket(node, x, y, z):
    key = mix(np.uint64(np.int64(x)) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(node))
    key = mix(key + np.uint64(np.int64(y)) * np.uint64(0xBF58476D1CE4E5B9))
    key = mix(key + np.uint64(np.int64(z)) * np.uint64(0x94D049BB133111EB))
    return np.int64(key & np.uint64(NUM_BUCKETS - 1))


@numba.njit(cache=True)
def _find(kit, placements, reach, node, end, orientation, rotation, translation, slack):
    """Return the pose of a trie node, before `end`, that is the same within `slack`, or -1."""
    width, start = BUCKET_TOLERANCES * kit.limits[0], reach.starts[node]
    kind = placements.orientation_types[orientation]
    first, last = kit.symmetry_starts[kind], kit.symmetry_starts[kind + 1]
    low_x = np.int64(np.floor((translation[0] - slack) / width))
    high_x = np.int64(np.floor((translation[0] + slack) / width))
    low_y = np.int64(np.floor((translation[1] - slack) / width))
    high_y = np.int64(np.floor((translation[1] + slack) / width))
    low_z = np.int64(np.floor((translation[2] - slack) / width))
    high_z = np.int64(np.floor((translation[2] + slack) / width))
    for x in range(low_x, high_x + 1):
        for y in range(low_y, high_y + 1):
            for z in range(low_z, high_z + 1):
                pose = reach.buckets[_bucket(node, x, y, z)]
                while pose >= start:
                    if (
                        pose < end
                        and reach.orientations[pose] == orientation
                        and squared_distance(reach.translations[pose], translation) <= slack * slack
                        and same_rotation(
                            kit.symmetries, first, last, reach.rotations[pose], rotation, slack / kit.reach[kind]
                        )
                        >= 0
                    ):
                        return pose
                    pose = reach.chains[pose]
    return -1
