"""Slots as seen: a grammar that asks of each place around a part what was seen there, whatever stands elsewhere.

A *place* is a relative pose in which a part of some type was seen beside a part. Places whose boxes overlap by more
than OVERLAP of the smaller are one *slot*: where one part stands no other can. A slot's *state* is the places in it
that are taken, often one or none. A part is valid if

- `slots`: the state of each slot was seen in it;
- `slot_fillings`: and of each two slots it was seen together which are filled and which empty;
- `slot_pairs`: and of each two slots their very states were seen together.

All is modulo the symmetries of the part, and, where shapes are upright, apart for each way up that a part was seen in.
Each level admits what the next of this list admits, all admit what was observed, and none asks for the numbers or pairs
of neighbour types that the other levels of strictness ask for.
"""

from __future__ import annotations

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
"""Share of the smaller box from which on two places are one slot."""
MAX_SYMMETRIC_IMAGES = 8192
"""Where the symmetric images of what was seen of a way to stand have more members than this, symmetry is left out of
account: round parts have hundreds, all alike."""
MAX_PATTERNS = 256
"""Most patterns of a way to stand that are offered to growth."""
RANDOM_DRAWS = 2048
"""Random neighbourhoods that are drawn where there are too many to list."""
MAX_LISTING_STEPS = 4096
"""Most steps of one listing of neighbourhoods."""
MAX_SLOTS = 32
"""Parts with more slots than this, which are hubs, have no neighbourhoods offered but those that were observed."""
UNSEEN_WEIGHT = 0.5
"""Weight of a neighbourhood that no part shows, beside one that is shown once."""

State = tuple[int, ...]


@dataclass
class _Orientation:
    """One way of standing of a part type: the places around it, and what was seen of them.

    up: float64 (3,), what is up in part coordinates; turns: float64 (k, 3, 3), symmetries that keep it; types int64
    (p,), poses float64 (p, 4, 4) of the places, in cells by type and position; slot_of: int64 (p,); images: (k, p),
    where each turn takes each place; seen: observed neighbourhoods as sorted places, in all images where it is closed,
    with how often, and what exemplar showed it first; states: of each slot, each with how often it was seen; odds: the
    same in the order of the states, float64.
    """

    part_type: int
    up: FloatArray
    turns: FloatArray
    types: list[int] = field(default_factory=list)
    poses: list[FloatArray] = field(default_factory=list)
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
        """The state of each slot where these places are taken."""
        states: list[list[int]] = [[] for _ in range(self.slots)]
        for place in places:
            states[self.slot_of[place]].append(place)
        return [tuple(state) for state in states]


class SlotGrammar:
    """What a kit's exemplars show of the slots around its types; the kit's grammar says how strict it is."""

    def __init__(self, kit: Kit, dockings: DockingTable, upright: bool, level: Strictness | None = None) -> None:
        """dockings: those of the kit."""
        self.kit = kit
        self.level = level or kit.grammar.strictness
        self.upright = upright
        self._axis = {"y": 1, "z": 2}[kit.up]
        self._limit = 2.0 * kit.pose_tolerance
        self._orientations: dict[int, list[_Orientation]] = {}
        for pattern in observed_patterns(kit, dockings, upright):
            self._orientation(pattern).patterns.append(pattern)
        for stances in self._orientations.values():
            for stance in stances:
                self._observe(stance)

    def _orientation(self, pattern: Pattern) -> _Orientation:
        known = self._orientations.setdefault(pattern.part_type, [])
        turns = self.kit.types[pattern.part_type].symmetries[:, :3, :3]
        for stance in known:
            if not self.upright or np.linalg.norm(turns @ pattern.up - stance.up, axis=1).min() < MAX_UP_DIFFERENCE:
                return stance
        kept = turns
        if self.upright:
            kept = turns[np.linalg.norm(turns @ pattern.up - pattern.up, axis=1) < MAX_UP_DIFFERENCE]
        known.append(_Orientation(pattern.part_type, pattern.up, kept))
        return known[-1]

    def _turns_to(self, stance: _Orientation, up: FloatArray) -> FloatArray:
        """The symmetries (k, 3, 3) that bring a part's way up to that of the stance; all where nothing is upright."""
        turns: FloatArray = self.kit.types[stance.part_type].symmetries[:, :3, :3]
        if self.upright:
            turns = turns[np.linalg.norm(turns @ up - stance.up, axis=1) < MAX_UP_DIFFERENCE]
        return turns

    def _observe(self, stance: _Orientation) -> None:
        """Read the places, slots and states of a stance off its patterns."""
        members = sum(1 + len(pattern.types) for pattern in stance.patterns)
        widest = max(len(pattern.types) for pattern in stance.patterns)
        if len(stance.turns) * max(members, widest**2) > MAX_SYMMETRIC_IMAGES:
            stance.turns, stance.closed = stance.turns[:1], False
        for pattern in stance.patterns:
            first = self._turns_to(stance, pattern.up)[0]
            for turn in stance.turns:
                places = tuple(
                    sorted(
                        self._place(stance, kind, _turned(turn @ first, pose), add=True)
                        for kind, pose in zip(pattern.types.tolist(), pattern.poses, strict=True)
                    )
                )
                seen, owner = stance.seen.get(places, (0.0, pattern.owner))
                stance.seen[places] = seen + pattern.seen / len(stance.turns), owner
        stance.slot_of, stance.slots = self._slots(stance)
        stance.images = np.array(
            [
                [
                    self._place(stance, kind, _turned(turn, pose))
                    for kind, pose in zip(stance.types, stance.poses, strict=True)
                ]
                for turn in stance.turns
            ],
            dtype=np.int64,
        ).reshape(len(stance.turns), -1)
        stance.states = [{} for _ in range(stance.slots)]
        for places, (seen, _) in stance.seen.items():
            split = stance.split(places)
            stance.vectors.add(tuple(bool(state) for state in split))
            for slot, state in enumerate(split):
                stance.states[slot][state] = stance.states[slot].get(state, 0.0) + seen
            for i, j in combinations(range(stance.slots), 2):
                stance.fillings.add((i, j, bool(split[i]), bool(split[j])))
                stance.pairs.add((i, j, split[i], split[j]))
        stance.states = [dict(sorted(states.items())) for states in stance.states]
        stance.odds = [np.array(list(states.values())) for states in stance.states]

    def _place(self, stance: _Orientation, kind: int, pose: FloatArray, add: bool = False) -> int:
        """The number of a place, new if it may be added, else -1."""
        part_type, at = self.kit.types[kind], pose[:3, 3]
        low, high = (np.floor((at + gap) / (4 * self._limit)).astype(int) for gap in (-self._limit, self._limit))
        for cell in product(*(range(first, last + 1) for first, last in zip(low.tolist(), high.tolist(), strict=True))):
            for number in stance.cells.get((kind, *cell), ()):
                known = stance.poses[number]
                if np.linalg.norm(known[:3, 3] - at) <= self._limit:
                    gaps = part_type.symmetries[:, :3, :3] - known[:3, :3].T @ pose[:3, :3]
                    if np.linalg.norm(gaps.reshape(-1, 9), axis=1).min() * part_type.diagonal / 2 <= self._limit:
                        return number
        if not add:
            return -1
        stance.types.append(kind)
        stance.poses.append(pose)
        own = np.floor(at / (4 * self._limit)).astype(int).tolist()
        stance.cells.setdefault((kind, *own), []).append(len(stance.types) - 1)
        return len(stance.types) - 1

    def _slots(self, stance: _Orientation) -> tuple[np.ndarray, int]:
        """The slot of each place, int64 (p,), and how many there are: overlapping places are one."""
        count = len(stance.types)
        boxes = np.empty((count, 2, 3))
        for number, (kind, pose) in enumerate(zip(stance.types, stance.poses, strict=True)):
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
        """How a part of an assembly may be seen to stand, with the places around it that are taken; nothing where one
        was never seen. Once, where all symmetric images of what was seen are known; else by each symmetry."""
        up, inverse = assembly.poses[part][self._axis, :3], invert(assembly.poses[part])
        relative = [(int(assembly.types[other]), inverse @ assembly.poses[other]) for other in neighbours]
        for stance in self._orientations.get(int(assembly.types[part]), []):
            for turn in self._turns_to(stance, up)[: 1 if stance.closed else None]:
                places = [self._place(stance, kind, _turned(turn, pose)) for kind, pose in relative]
                if min(places, default=0) >= 0:
                    yield stance, tuple(sorted(places))

    def admits(self, assembly: Assembly, part: int, neighbours: list[int]) -> bool:
        """Whether a part of an assembly may have these neighbours, by their places."""
        for stance, places in self.around(assembly, part, neighbours):
            split = stance.split(places)
            known = all(state in states for state, states in zip(split, stance.states, strict=True))
            if known and all(self._fits(stance, split, slot, range(slot)) for slot in range(stance.slots)):
                return True
        return False

    def misfits(self, assembly: Assembly) -> list[int]:
        """The parts of an assembly whose neighbours the grammar does not admit, ascending."""
        return [part for part, near in self._free(assembly) if not self.admits(assembly, part, near)]

    def _free(self, assembly: Assembly) -> Iterator[tuple[int, list[int]]]:
        """The parts of an assembly that are no hubs, with those of their neighbours that are none."""
        is_hub = np.isin(assembly.types, self.kit.grammar.hubs)
        for part, near in enumerate(assembly.neighbours()):
            if not is_hub[part]:
                yield part, [other for other in near if not is_hub[other]]

    def observed_share(self, assembly: Assembly) -> float:
        """The share of parts of which it was seen just so which slots are filled and which are empty: it tells whether
        a level is too loose for a kit."""
        good = parts = 0
        for part, near in self._free(assembly):
            parts += 1
            good += any(
                tuple(bool(state) for state in stance.split(places)) in stance.vectors
                for stance, places in self.around(assembly, part, near)
            )
        return good / max(parts, 1)

    def patterns(self) -> list[Pattern]:
        """Neighbourhoods that the grammar admits, as patterns, ordered by type: all that were observed, and others, at
        most PATTERNS a way of standing, modulo symmetry."""
        found: list[Pattern] = []
        for part_type, stances in sorted(self._orientations.items()):
            for stance in stances:
                chosen: dict[State, tuple[float, int]] = {}
                for places, (seen, owner) in stance.seen.items():
                    key = _canonical(stance, places)
                    before, first = chosen.get(key, (0.0, owner))
                    chosen[key] = before + seen, first
                owner = stance.patterns[0].owner
                for places in self._others(stance):
                    if len(chosen) >= MAX_PATTERNS:
                        break
                    chosen.setdefault(_canonical(stance, places), (UNSEEN_WEIGHT, owner))
                for places, (weight, owner) in chosen.items():
                    poses = np.array([stance.poses[place] for place in places]).reshape(-1, 4, 4)
                    types = np.array([stance.types[place] for place in places], dtype=np.int64)
                    found.append(Pattern(part_type, types, poses, stance.up, weight, owner))
        return found

    def _others(self, stance: _Orientation) -> Iterator[State]:
        """Neighbourhoods that the grammar admits: all in order where they are few, else drawn at random."""
        if not 0 < stance.slots <= MAX_SLOTS:
            return
        listed = list(self._list(stance))
        if len(listed) < MAX_PATTERNS * len(stance.turns):
            yield from listed
            return
        rng = np.random.Generator(np.random.PCG64([stance.part_type, stance.slots]))
        for _ in range(RANDOM_DRAWS):
            drawn = self._draw(stance, rng)
            if drawn is not None:
                yield drawn

    def _list(self, stance: _Orientation) -> Iterator[State]:
        split: list[State] = [()] * stance.slots
        steps = 0

        def fill(slot: int) -> Iterator[State]:
            nonlocal steps
            if slot == stance.slots:
                yield tuple(sorted(place for state in split for place in state))
                return
            for state in stance.states[slot]:
                steps += 1
                if steps > MAX_LISTING_STEPS:
                    return
                split[slot] = state
                if self._fits(stance, split, slot, range(slot)):
                    yield from fill(slot + 1)

        yield from fill(0)

    def _draw(self, stance: _Orientation, rng: np.random.Generator) -> State | None:
        """One neighbourhood, slot after slot, states by how often they were seen; None at a dead end."""
        split: list[State] = [()] * stance.slots
        done: list[int] = []
        for slot in rng.permutation(stance.slots).tolist():
            states, odds = list(stance.states[slot]), stance.odds[slot]
            if self.level != "slots":
                fitting = []
                for number, state in enumerate(states):
                    split[slot] = state
                    if self._fits(stance, split, slot, done):
                        fitting.append(number)
                if not fitting:
                    return None
                states, odds = [states[number] for number in fitting], odds[fitting]
            place = int(odds.cumsum().searchsorted(rng.random() * odds.sum()))
            split[slot] = states[min(place, len(states) - 1)]
            done.append(slot)
        return tuple(sorted(place for state in split for place in state))

    def _fits(self, stance: _Orientation, split: list[State], slot: int, others: Iterable[int]) -> bool:
        """Whether the level admits the state of a slot beside those of some others."""
        if self.level == "slots":
            return True
        own, filled = split[slot], bool(split[slot])
        if self.level == "slot_fillings":
            return all(
                ((i, slot, bool(split[i]), filled) if i < slot else (slot, i, filled, bool(split[i])))
                in stance.fillings
                for i in others
            )
        return all(((i, slot, split[i], own) if i < slot else (slot, i, own, split[i])) in stance.pairs for i in others)


def _canonical(stance: _Orientation, places: State) -> State:
    """The first of the symmetric images of some places."""
    if not places:
        return places
    images = np.sort(stance.images[:, list(places)], axis=1)
    first: State = min(map(tuple, images[(images >= 0).all(axis=1)].tolist()), default=places)
    return first


def _turned(turn: FloatArray, pose: FloatArray) -> FloatArray:
    """A pose turned about the origin by a rotation (3, 3)."""
    turned = pose.copy()
    turned[:3] = turn @ pose[:3]
    return turned
