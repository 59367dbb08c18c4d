"""Where a chain of parts can lead: all poses of its last part, so that a cycle is begun only where it can be closed.

The poses that a sequence of labels reaches from a stance depend on these alone and are kept from shape to shape, as a
trie of sequences. Parts of a chain may lie within each other here: what is not reached cannot be, what is reached may
not be.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from stages.shape.geometry.hash_tables import mix
from stages.shape.geometry.pose_kernels import same_rotation, squared_distance
from stages.string_sampling.instantiation.transforms import compose

LONGEST = 24
"""Longer chains are taken to reach anything."""
MOST = 6000
"""Sequences that reach more poses are taken to reach anything."""
ROOM = LONGEST * MOST + 1
TRIE = 4096
BUCKETS = 1 << 18
WIDTH = 16.0
"""Side of the buckets in pose tolerances."""
DRIFT = 0.5
"""So many pose tolerances may each docking of a chain be off."""
ANYTHING = -1
"""In place of the number of poses."""
POSES, NODES = 0, 1


class ChainReach(NamedTuple):
    """Poses in the order in which they were found, those of a trie node beside each other; a trie node is a stance to
    begin with and labels behind it."""

    stances: np.ndarray  # int64 (p,)
    rotations: np.ndarray  # float64 (p, 3, 3)
    translations: np.ndarray  # float64 (p, 3)
    chains: np.ndarray  # int64 (p,): the next pose of its bucket, or -1
    buckets: np.ndarray  # int64 (b,)
    labels: np.ndarray  # int64 (t,): the last label of each trie node; of a root -1 - its stance
    children: np.ndarray  # int64 (t,): its first child, or -1
    siblings: np.ndarray  # int64 (t,): the next child of its parent, or -1
    starts: np.ndarray  # int64 (t,)
    sizes: np.ndarray  # int64 (t,): or ANYTHING
    counts: np.ndarray  # int64 (2,)


def new_reach(stances: int) -> ChainReach:
    """Nothing but the stances themselves."""
    reach = ChainReach(
        stances=np.zeros(ROOM + stances, dtype=np.int64),
        rotations=np.zeros((ROOM + stances, 3, 3)),
        translations=np.zeros((ROOM + stances, 3)),
        chains=np.full(ROOM + stances, -1, dtype=np.int64),
        buckets=np.full(BUCKETS, -1, dtype=np.int64),
        labels=np.zeros(TRIE + stances, dtype=np.int64),
        children=np.full(TRIE + stances, -1, dtype=np.int64),
        siblings=np.full(TRIE + stances, -1, dtype=np.int64),
        starts=np.zeros(TRIE + stances, dtype=np.int64),
        sizes=np.zeros(TRIE + stances, dtype=np.int64),
        counts=np.zeros(2, dtype=np.int64),
    )
    _begin(reach, stances)
    return reach


@numba.njit(cache=True)
def _begin(reach, stances):
    """Forget everything but the stances."""
    reach.buckets[:] = -1
    for stance in range(stances):
        reach.stances[stance] = stance
        reach.rotations[stance] = np.eye(3)
        reach.translations[stance] = 0.0
        reach.chains[stance] = -1
        reach.labels[stance] = -1 - stance
        reach.children[stance] = -1
        reach.siblings[stance] = -1
        reach.starts[stance] = stance
        reach.sizes[stance] = 1
    reach.counts[POSES] = stances
    reach.counts[NODES] = stances


@numba.njit(cache=True)
def can_reach(kit, candidates, reach, stance, sequence, length, stance_there, rotation, translation):
    """Whether a part in a stance, followed by parts of the labels `sequence[:length]`, can lead to a part in another
    stance at a pose in its coordinates."""
    if length > LONGEST:
        return True
    while True:
        node = stance
        for place in range(length):
            node = _child(kit, candidates, reach, node, sequence[place])
            if node < 0 or reach.sizes[node] == ANYTHING:
                break
        if node >= 0:
            break
        _begin(reach, len(candidates.stance_types))
    if reach.sizes[node] == ANYTHING:
        return True
    slack = kit.limits[0] * (1.0 + DRIFT * length)
    end = reach.starts[node] + reach.sizes[node]
    return _find(kit, candidates, reach, node, end, stance_there, rotation, translation, slack) >= 0


@numba.njit(cache=True)
def _child(kit, candidates, reach, node, label):
    """The trie node of a sequence that is longer by a label; -1 where there is no room for it."""
    child = reach.children[node]
    while child >= 0:
        if reach.labels[child] == label:
            return child
        child = reach.siblings[child]
    child = reach.counts[NODES]
    if child == len(reach.labels) or reach.counts[POSES] + MOST > len(reach.stances):
        return -1
    reach.counts[NODES] += 1
    reach.labels[child] = label
    reach.children[child] = -1
    reach.siblings[child] = reach.children[node]
    reach.children[node] = child
    start = reach.counts[POSES]
    reach.starts[child] = start
    labels = len(candidates.stance_starts) - 1
    rotation, translation = np.empty((3, 3)), np.empty(3)
    first = reach.starts[node]
    for pose in range(first, first + reach.sizes[node]):
        row = reach.stances[pose] * labels + label
        for candidate in range(candidates.starts[row], candidates.starts[row + 1]):
            compose(
                reach.rotations[pose], reach.translations[pose],
                candidates.rotations[candidate], candidates.translations[candidate], rotation, translation,
            )  # fmt: skip
            stance = candidates.stances[candidate]
            new = reach.counts[POSES]
            if _find(kit, candidates, reach, child, new, stance, rotation, translation, DRIFT * kit.limits[0]) >= 0:
                continue
            if new == start + MOST:
                # the poses stay where they are, in buckets: their node says that they are of no use
                reach.sizes[child] = ANYTHING
                return child
            reach.counts[POSES] += 1
            reach.stances[new] = stance
            reach.rotations[new] = rotation
            reach.translations[new] = translation
            width = WIDTH * kit.limits[0]
            bucket = _bucket(
                child,
                np.int64(np.floor(translation[0] / width)),
                np.int64(np.floor(translation[1] / width)),
                np.int64(np.floor(translation[2] / width)),
            )
            reach.chains[new] = reach.buckets[bucket]
            reach.buckets[bucket] = new
    reach.sizes[child] = reach.counts[POSES] - start
    return child


@numba.njit(cache=True)
def _bucket(node, x, y, z):
    key = mix(np.uint64(x) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(node))
    key = mix(key + np.uint64(y) * np.uint64(0xBF58476D1CE4E5B9))
    key = mix(key + np.uint64(z) * np.uint64(0x94D049BB133111EB))
    return np.int64(key & np.uint64(BUCKETS - 1))


@numba.njit(cache=True)
def _find(kit, candidates, reach, node, end, stance, rotation, translation, slack):
    """The pose of a trie node, one of those before `end`, that looks the same within `slack`, or -1."""
    width, start = WIDTH * kit.limits[0], reach.starts[node]
    kind = candidates.stance_types[stance]
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
                        and reach.stances[pose] == stance
                        and squared_distance(reach.translations[pose], translation) <= slack * slack
                        and same_rotation(
                            kit.symmetries, first, last, reach.rotations[pose], rotation, slack / kit.reach[kind]
                        )
                        >= 0
                    ):
                        return pose
                    pose = reach.chains[pose]
    return -1
