"""Grammars of slots: each place around a part must look as it was observed, whatever the other places hold.

A *place* is a relative pose in which a part of some type was observed next to a part. Places whose boxes overlap by
more than MIN_SLOT_OVERLAP of the smaller are one *slot*: it holds one part at a time. A slot's *state* is the set of
its taken places, often one or none. A part is valid if

- `slots`: the state of each slot was observed in it;
- `slot_fillings`: and for each two slots it was observed together which are filled and which are empty;
- `slot_pairs`: and for each two slots their very states were observed together.

All is modulo the symmetries of the part. If shapes are upright, each up direction of a part is treated separately. Each
level admits what the next of this list admits, all admit what was observed, and none restricts the numbers or pairs of
neighbour types as the other levels of strictness do.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import combinations, product

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.docking import DockingTable
from stages.shape.geometry.pose import invert
from stages.shape.graphs.patterns import MAX_UP_DIFFERENCE, Pattern, observed_patterns
from stages.shape.kit import Assembly, Kit, Strictness

MIN_SLOT_OVERLAP = 0.3
"""Places whose boxes overlap by this share of the smaller box are one slot."""
MAX_SYMMETRIC_IMAGES = 8192
"""Above this number of parts in the symmetric images of an orientation, symmetry is ignored: round parts have hundreds.
"""
MAX_PATTERNS = 256
"""Maximum number of patterns of an orientation that are offered to growth."""
RANDOM_DRAWS = 2048
"""Random neighbourhoods drawn if there are too many to list."""
MAX_LISTING_STEPS = 4096
MAX_SLOTS = 32
"""Parts with more slots than this, which are hubs, are offered only observed neighbourhoods."""
UNSEEN_WEIGHT = 0.5
"""Weight of an unobserved neighbourhood relative to one that was observed once."""

KEY_BYTES = 16
FAR_LIMITS_SQUARED = 1.01
"""Squared distance, in squared limits, from which a place is plainly another one; nearer ones are measured exactly."""
MAX_REMEMBERED = 200_000
"""Neighbourhoods whose answers are remembered, about 100 bytes each."""

State = tuple[int, ...]


@dataclass
class _Orientation:
    """One orientation of a part type: the places around it, and what was observed of them.

    up: up direction in part coordinates, float64 (3,)
    turns: symmetries that keep it, float64 (k, 3, 3)
    types: type of each place
    poses: pose of each place, float64 (4, 4)
    positions: position of each place
    slot_of: slot of each place, int64 (p,)
    cells: places by type and cell of their position
    closed: whether all symmetric images are known
    images: where each turn takes each place, int64 (k, p)
    seen: observed neighbourhoods as sorted places, with their number and the first exemplar; in all images if `closed`
    states: observed states of each slot, with their numbers
    odds: the same numbers in the order of the states, float64
    fillings: pairs of slots observed together, with whether each is filled
    pairs: pairs of slots observed together, with their states
    vectors: observed combinations of filled slots
    patterns: observed patterns
    """

    part_type: int
    up: FloatArray
    turns: FloatArray
    types: list[int] = field(default_factory=list)
    poses: list[FloatArray] = field(default_factory=list)
    positions: list[tuple[float, float, float]] = field(default_factory=list)
    slot_of: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    cells: dict[tuple[int, ...], list[int]] = field(default_factory=dict)
    slots: int = 0
    closed: bool = True
    images: np.ndarray = field(default_factory=lambda: np.empty((0, 0), dtype=np.int64))
    seen: dict[State, tuple[float, int]] = field(default_factory=dict)
    states: list[dict[State, float]] = field(default_factory=list)
    odds: list[FloatArray] = field(default_factory=list)
    fillings: set[tuple[int, int, bool, bool]] = field(default_factory=set)
    pairs: set[tuple[int, int, State, State]] = field(default_factory=set)
    vectors: set[tuple[bool, ...]] = field(default_factory=set)
    patterns: list[Pattern] = field(default_factory=list)

    def split(self, places: State) -> list[State]:
        """Return the state of each slot if these places are taken."""
        states: list[list[int]] = [[] for _ in range(self.slots)]
        for place in places:
            states[self.slot_of[place]].append(place)
        return [tuple(state) for state in states]


class SlotGrammar:
    """What a kit's exemplars show of the slots around its types. The kit's grammar sets the strictness."""

    def __init__(self, kit: Kit, dockings: DockingTable, upright: bool, level: Strictness | None = None) -> None:
        self.kit = kit
        self.level = level or kit.grammar.strictness
        self.upright = upright
        self._axis = {"y": 1, "z": 2}[kit.up]
        self._limit = 2.0 * kit.pose_tolerance
        self._orientations: dict[int, list[_Orientation]] = {}
        self._admitted: dict[bytes, bool] = {}
        for pattern in observed_patterns(kit, dockings, upright):
            self._orientation(pattern).patterns.append(pattern)
        for orientations in self._orientations.values():
            for orientation in orientations:
                self._observe(orientation)

    def _orientation(self, pattern: Pattern) -> _Orientation:
        known = self._orientations.setdefault(pattern.part_type, [])
        turns = self.kit.types[pattern.part_type].symmetries[:, :3, :3]
        for orientation in known:
            if (
                not self.upright
                or np.linalg.norm(turns @ pattern.up - orientation.up, axis=1).min() < MAX_UP_DIFFERENCE
            ):
                return orientation
        kept = turns
        if self.upright:
            kept = turns[np.linalg.norm(turns @ pattern.up - pattern.up, axis=1) < MAX_UP_DIFFERENCE]
        known.append(_Orientation(pattern.part_type, pattern.up, kept))
        return known[-1]

    def _turns_to(self, orientation: _Orientation, up: FloatArray) -> FloatArray:
        """Return the symmetries (k, 3, 3) that bring a part's up direction to the orientation's.

        All are returned if shapes need not be upright.
        """
        turns: FloatArray = self.kit.types[orientation.part_type].symmetries[:, :3, :3]
        if self.upright:
            turns = turns[np.linalg.norm(turns @ up - orientation.up, axis=1) < MAX_UP_DIFFERENCE]
        return turns

    def _observe(self, orientation: _Orientation) -> None:
        """Read the places, slots and states of an orientation off its patterns."""
        members = sum(1 + len(pattern.types) for pattern in orientation.patterns)
        widest = max(len(pattern.types) for pattern in orientation.patterns)
        if len(orientation.turns) * max(members, widest**2) > MAX_SYMMETRIC_IMAGES:
            orientation.turns, orientation.closed = orientation.turns[:1], False
        for pattern in orientation.patterns:
            first = self._turns_to(orientation, pattern.up)[0]
            for turn in orientation.turns:
                places = tuple(
                    sorted(
                        self._place(orientation, kind, _turned(turn @ first, pose), add=True)
                        for kind, pose in zip(pattern.types.tolist(), pattern.poses, strict=True)
                    )
                )
                seen, owner = orientation.seen.get(places, (0.0, pattern.owner))
                orientation.seen[places] = seen + pattern.seen / len(orientation.turns), owner
        orientation.slot_of, orientation.slots = self._slots(orientation)
        orientation.images = np.array(
            [
                [
                    self._place(orientation, kind, _turned(turn, pose))
                    for kind, pose in zip(orientation.types, orientation.poses, strict=True)
                ]
                for turn in orientation.turns
            ],
            dtype=np.int64,
        ).reshape(len(orientation.turns), -1)
        orientation.states = [{} for _ in range(orientation.slots)]
        for places, (seen, _) in orientation.seen.items():
            split = orientation.split(places)
            orientation.vectors.add(tuple(bool(state) for state in split))
            for slot, state in enumerate(split):
                orientation.states[slot][state] = orientation.states[slot].get(state, 0.0) + seen
            for i, j in combinations(range(orientation.slots), 2):
                orientation.fillings.add((i, j, bool(split[i]), bool(split[j])))
                orientation.pairs.add((i, j, split[i], split[j]))
        orientation.states = [dict(sorted(states.items())) for states in orientation.states]
        orientation.odds = [np.array(list(states.values())) for states in orientation.states]

    def _place(self, orientation: _Orientation, kind: int, pose: FloatArray, add: bool = False) -> int:
        """Return the index of a place, a new one if it may be added, else -1."""
        part_type, at = self.kit.types[kind], pose[:3, 3]
        x, y, z = at.tolist()
        limit = self._limit
        beyond, cells = FAR_LIMITS_SQUARED * limit**2, orientation.cells
        spans = (_cells_near(value, limit) for value in (x, y, z))
        for cell in product(*spans):
            for number in cells.get((kind, *cell), ()):
                known = orientation.poses[number]
                there = orientation.positions[number]
                if (there[0] - x) ** 2 + (there[1] - y) ** 2 + (there[2] - z) ** 2 > beyond:
                    continue
                if np.linalg.norm(known[:3, 3] - at) <= self._limit:
                    gaps = part_type.symmetries[:, :3, :3] - known[:3, :3].T @ pose[:3, :3]
                    if np.linalg.norm(gaps.reshape(-1, 9), axis=1).min() * part_type.diagonal / 2 <= self._limit:
                        return number
        if not add:
            return -1
        orientation.types.append(kind)
        orientation.poses.append(pose)
        orientation.positions.append((x, y, z))
        own = np.floor(at / (4 * self._limit)).astype(int).tolist()
        orientation.cells.setdefault((kind, *own), []).append(len(orientation.types) - 1)
        return len(orientation.types) - 1

    def _slots(self, orientation: _Orientation) -> tuple[np.ndarray, int]:
        """Return the slot of each place, int64 (p,), and the number of slots; overlapping places are one."""
        count = len(orientation.types)
        boxes = np.empty((count, 2, 3))
        for number, (kind, pose) in enumerate(zip(orientation.types, orientation.poses, strict=True)):
            low, high = self.kit.types[kind].bounds
            middle = pose[:3, :3] @ (low + high) / 2 + pose[:3, 3]
            half = np.abs(pose[:3, :3]) @ (high - low) / 2 + self.kit.contact_tolerance
            boxes[number] = middle - half, middle + half
        owner = np.arange(count)
        volumes = np.prod(boxes[:, 1] - boxes[:, 0], axis=1)
        for i in range(count - 1):
            shared = np.minimum(boxes[i, 1], boxes[i + 1 :, 1]) - np.maximum(boxes[i, 0], boxes[i + 1 :, 0])
            much = np.prod(shared, axis=1) > MIN_SLOT_OVERLAP * np.minimum(volumes[i], volumes[i + 1 :])
            for j in (np.flatnonzero((shared > 0).all(axis=1) & much) + i + 1).tolist():
                owner[owner == owner[j]] = owner[i]
        _, slot_of = np.unique(owner, return_inverse=True)
        return slot_of.astype(np.int64), int(slot_of.max()) + 1 if count else 0

    def around(self, assembly: Assembly, part: int, neighbours: list[int]) -> Iterator[tuple[_Orientation, State]]:
        """Yield the orientations that a part of an assembly may have, with the taken places around it.

        Yields nothing if a neighbour's place was never observed. Yields once if all symmetric images are known, else
        for each symmetry.
        """
        up, inverse = assembly.poses[part][self._axis, :3], invert(assembly.poses[part])
        relative = [(int(assembly.types[other]), inverse @ assembly.poses[other]) for other in neighbours]
        for orientation in self._orientations.get(int(assembly.types[part]), []):
            for turn in self._turns_to(orientation, up)[: 1 if orientation.closed else None]:
                places: list[int] = []
                for kind, pose in relative:
                    places.append(self._place(orientation, kind, _turned(turn, pose)))
                    if places[-1] < 0:
                        break
                else:
                    yield orientation, tuple(sorted(places))

    def admits(self, assembly: Assembly, part: int, neighbours: list[int]) -> bool:
        """Return whether a part of an assembly may have these neighbours, by their places; remembered by exact poses.

        Variants keep most parts of a shape where they were, so the same parts are asked for again and again.
        """
        members = [part, *neighbours]
        asked = assembly.types[members].tobytes() + assembly.poses[members].tobytes()
        key = hashlib.blake2b(asked, digest_size=KEY_BYTES).digest()
        if key not in self._admitted:
            if len(self._admitted) >= MAX_REMEMBERED:
                self._admitted.clear()
            self._admitted[key] = self._admits(assembly, part, neighbours)
        return self._admitted[key]

    def _admits(self, assembly: Assembly, part: int, neighbours: list[int]) -> bool:
        for orientation, places in self.around(assembly, part, neighbours):
            split = orientation.split(places)
            known = all(state in states for state, states in zip(split, orientation.states, strict=True))
            if known and all(self._fits(orientation, split, slot, range(slot)) for slot in range(orientation.slots)):
                return True
        return False

    def misfits(self, assembly: Assembly) -> list[int]:
        """Return the parts of an assembly whose neighbours the grammar does not admit, ascending."""
        return [part for part, near in self._free(assembly) if not self.admits(assembly, part, near)]

    def admits_all(self, assembly: Assembly) -> bool:
        """Return whether the grammar admits the neighbours of all parts of an assembly."""
        return all(self.admits(assembly, part, near) for part, near in self._free(assembly))

    def _free(self, assembly: Assembly) -> Iterator[tuple[int, list[int]]]:
        """Yield the parts of an assembly that are not hubs, with their neighbours that are not hubs."""
        is_hub = np.isin(assembly.types, self.kit.grammar.hubs)
        for part, near in enumerate(assembly.neighbours()):
            if not is_hub[part]:
                yield part, [other for other in near if not is_hub[other]]

    def observed_share(self, assembly: Assembly) -> float:
        """Return the share of parts whose combination of filled slots was observed.

        It shows whether a level is too permissive for a kit.
        """
        good = parts = 0
        for part, near in self._free(assembly):
            parts += 1
            good += any(
                tuple(bool(state) for state in orientation.split(places)) in orientation.vectors
                for orientation, places in self.around(assembly, part, near)
            )
        return good / max(parts, 1)

    def patterns(self) -> list[Pattern]:
        """Return neighbourhoods that the grammar admits, as patterns ordered by type.

        All observed ones are there, and others, at most MAX_PATTERNS for each orientation, modulo symmetry.
        """
        admitted: list[Pattern] = []
        for part_type, orientations in sorted(self._orientations.items()):
            for orientation in orientations:
                chosen: dict[State, tuple[float, int]] = {}
                for places, (seen, owner) in orientation.seen.items():
                    key = _canonical(orientation, places)
                    before, first = chosen.get(key, (0.0, owner))
                    chosen[key] = before + seen, first
                owner = orientation.patterns[0].owner
                for places in self._others(orientation):
                    if len(chosen) >= MAX_PATTERNS:
                        break
                    chosen.setdefault(_canonical(orientation, places), (UNSEEN_WEIGHT, owner))
                for places, (weight, owner) in chosen.items():
                    poses = np.array([orientation.poses[place] for place in places]).reshape(-1, 4, 4)
                    types = np.array([orientation.types[place] for place in places], dtype=np.int64)
                    admitted.append(Pattern(part_type, types, poses, orientation.up, weight, owner))
        return admitted

    def _others(self, orientation: _Orientation) -> Iterator[State]:
        """Yield neighbourhoods that the grammar admits: all in order if few, else random ones."""
        if not 0 < orientation.slots <= MAX_SLOTS:
            return
        listed = list(self._list(orientation))
        if len(listed) < MAX_PATTERNS * len(orientation.turns):
            yield from listed
            return
        rng = np.random.Generator(np.random.PCG64([orientation.part_type, orientation.slots]))
        for _ in range(RANDOM_DRAWS):
            places = self._draw(orientation, rng)
            if places is not None:
                yield places

    def _list(self, orientation: _Orientation) -> Iterator[State]:
        split: list[State] = [()] * orientation.slots
        steps = 0

        def fill(slot: int) -> Iterator[State]:
            nonlocal steps
            if slot == orientation.slots:
                yield tuple(sorted(place for state in split for place in state))
                return
            for state in orientation.states[slot]:
                steps += 1
                if steps > MAX_LISTING_STEPS:
                    return
                split[slot] = state
                if self._fits(orientation, split, slot, range(slot)):
                    yield from fill(slot + 1)

        yield from fill(0)

    def _draw(self, orientation: _Orientation, rng: np.random.Generator) -> State | None:
        """Return a random neighbourhood, slot by slot, states by their observed frequency, or None at a dead end."""
        split: list[State] = [()] * orientation.slots
        done: list[int] = []
        for slot in rng.permutation(orientation.slots).tolist():
            states, odds = list(orientation.states[slot]), orientation.odds[slot]
            if self.level != "slots":
                fitting = []
                for number, state in enumerate(states):
                    split[slot] = state
                    if self._fits(orientation, split, slot, done):
                        fitting.append(number)
                if not fitting:
                    return None
                states, odds = [states[number] for number in fitting], odds[fitting]
            chosen = int(odds.cumsum().searchsorted(rng.random() * odds.sum()))
            split[slot] = states[min(chosen, len(states) - 1)]
            done.append(slot)
        return tuple(sorted(chosen for state in split for chosen in state))

    def _fits(self, orientation: _Orientation, split: list[State], slot: int, others: Iterable[int]) -> bool:
        """Return whether the level admits the state of a slot together with those of some others."""
        if self.level == "slots":
            return True
        own, filled = split[slot], bool(split[slot])
        if self.level == "slot_fillings":
            pairs = (
                (i, slot, bool(split[i]), filled) if i < slot else (slot, i, filled, bool(split[i])) for i in others
            )
            return all(pair in orientation.fillings for pair in pairs)
        return all(
            ((i, slot, split[i], own) if i < slot else (slot, i, own, split[i])) in orientation.pairs for i in others
        )


def _cells_near(value: float, limit: float) -> range:
    """Return the cells along one axis, 4 limits wide, that are at most a limit away from a position."""
    return range(math.floor((value - limit) / (4 * limit)), math.floor((value + limit) / (4 * limit)) + 1)


def _canonical(orientation: _Orientation, places: State) -> State:
    """Return the first of the symmetric images of some places."""
    if not places:
        return places
    images = np.sort(orientation.images[:, list(places)], axis=1)
    first: State = min(map(tuple, images[(images >= 0).all(axis=1)].tolist()), default=places)
    return first


def _turned(turn: FloatArray, pose: FloatArray) -> FloatArray:
    """Return a pose turned about the origin by a rotation (3, 3)."""
    turned = pose.copy()
    turned[:3] = turn @ pose[:3]
    return turned
