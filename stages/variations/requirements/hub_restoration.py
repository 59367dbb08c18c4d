"""Backdrop: the hub parts that the search leaves out, put back into a finished shape where they fit."""

from __future__ import annotations

from collections import Counter
from functools import cached_property

import numpy as np

from pipeline.stage import Task
from stages.exemplars.settings import KitConfig
from stages.shape.arrays import FloatArray
from stages.shape.geometry.contact import world_boxes
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.geometry.pose import invert, pose_vectors
from stages.shape.kit import Assembly, Exemplar, Kit, PartType
from stages.shape.kit_input import input_kit
from stages.shape.resolved_settings import RESOLVED_HUB_SHARE
from stages.variations.kernels.structs import FORBIDDEN, NONE
from stages.variations.requirements.required_labels import spanning_hubs
from stages.variations.settings import VariationsConfig

HUBS_NOT_RESTORED = "no backdrop"
"""Why a variant is refused that does not get back the hubs that are required."""
FIT_SHARE = 0.75
"""A hub fits where it has at least this share of the neighbours that one of its type had in an exemplar."""
ASKEW = 1e-2
"""Directions of up that differ by less are one."""
LACKING = 0.05
"""No greater share of a variant's parts may be without a hub that each of their type has in the exemplars."""


class HubRestorer:
    """The hubs of a kit, ready to be put behind shapes.

    With `upright` a hub stands below a part, above it or beside it as one of its type did in an exemplar; without,
    symmetries of the part may turn it over.
    """

    def __init__(self, answers: ContactOracle, upright: bool) -> None:
        self.answers = answers
        self.kit = answers.kit
        self._up = np.array({"y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]}[self.kit.up]) if upright else np.zeros(3)
        self._beside = {hub: self._observed(hub) for hub in self.kit.grammar.hubs}

    def fit(self, assembly: Assembly) -> Assembly:
        """`assembly` with hub parts of its kit where they fit, behind its own parts, and with their contacts.

        Places are those that parts of the assembly had a hub at in an exemplar; the places that most parts agree on
        come first. A hub fits where it has most of the neighbours that one of its type had in an exemplar, and
        touches all that it touches, hubs before it too, in an observed docking; parts too near each other are refused
        as in the search. A shape with stretched parts gets none: how a hub stands to these nobody has seen.
        """
        kit = self.kit
        if assembly.stretches is not None:
            return assembly
        whole = assembly
        boxes = world_boxes(kit.types, whole.types, whole.poses)
        for hub in kit.grammar.hubs:
            for place in self._places(hub, assembly):
                box = world_boxes(kit.types, np.array([hub]), place[None])
                near = _near(boxes, box[0], 1.1 * kit.contact_tolerance)
                touched = self._touched(hub, place, whole.types, whole.poses, near)
                own = [] if touched is None else [part for part in touched if part < len(assembly)]
                if touched is None or not _has_most(kit, hub, whole.types[own]):
                    continue
                whole = _with_part(whole, hub, place, touched)
                boxes = np.concatenate([boxes, box])
        order = np.lexsort((whole.edges[:, 1], whole.edges[:, 0]))
        return Assembly(whole.types, whole.poses, whole.edges[order])

    def has_hubs(self, required: float, whole: Assembly) -> bool:
        """Whether a variant with its backdrop has the hub parts that are required: so many; or, below 1, of the type
        that touches most that share of what so many parts have in the exemplars, and one, and all those of the carcass,
        and beside nearly each part those types that all of its type have beside them: a rail goes no farther than the
        road that it stands on."""
        kit = self.kit
        fitted = whole.types[np.isin(whole.types, kit.grammar.hubs)]
        if not 0 < required < 1:
            return len(fitted) >= required
        if any((fitted == hub).sum() < count for hub, count in self._spanning.items()):
            return False
        widest, share = self._widest
        if int((fitted == widest).sum()) < max(1.0, required * share * len(whole)):
            return False
        beside = zip(whole.types.tolist(), self._hubs_beside(whole), strict=True)
        return sum(not self._always[part_type] <= found for part_type, found in beside) <= LACKING * len(whole)

    @cached_property
    def _spanning(self) -> dict[int, int]:
        """`spanning_hubs` of the kit."""
        return spanning_hubs(self.kit)

    @cached_property
    def _widest(self) -> tuple[int, float]:
        """The hub type that touches most, and its share of the parts of the exemplars."""
        kit = self.kit
        touching = {
            hub: max(sum(count for _, count in seen) for seen in kit.grammar.neighbourhoods[hub])
            for hub in kit.grammar.hubs
        }
        widest = max(touching, key=lambda hub: touching[hub])
        there = sum(int((each.removed_hubs.types == widest).sum()) for each in kit.exemplars)
        return widest, there / sum(len(each.whole) for each in kit.exemplars)

    @cached_property
    def _always(self) -> dict[int, set[int]]:
        """For each type the types of hubs that every part of it touches in the exemplars."""
        always: dict[int, set[int]] = {}
        for exemplar in self.kit.exemplars:
            whole = exemplar.assembly
            for hub, place in zip(exemplar.removed_hubs.types.tolist(), exemplar.removed_hubs.poses, strict=True):
                answers = self.answers.around(whole.types, whole.poses, hub, place)
                whole = _with_part(whole, hub, place, np.flatnonzero(answers >= 0).tolist())
            for part_type, found in zip(whole.types.tolist(), self._hubs_beside(whole), strict=True):
                always[part_type] = always.get(part_type, found) & found
        return always

    def _hubs_beside(self, whole: Assembly) -> list[set[int]]:
        """The types of hubs that each part touches."""
        beside: list[set[int]] = [set() for _ in range(len(whole))]
        types, hubs = whole.types.tolist(), set(self.kit.grammar.hubs)
        for first, second in whole.edges.tolist():
            beside[first] |= {types[second]} & hubs
            beside[second] |= {types[first]} & hubs
        return beside

    def _observed(self, hub: int) -> dict[int, tuple[FloatArray, FloatArray]]:
        """For each type the poses (k, 4, 4) that a hub has in coordinates of a part of that type, by exemplars and the
        part's symmetries, and the direction of up (k, 3) in those coordinates; of what looks the same one."""
        kept: dict[int, list[tuple[FloatArray, FloatArray]]] = {}
        for exemplar in self.kit.exemplars:
            for part_type, pose, up in self._docked(exemplar, hub):
                found = kept.setdefault(part_type, [])
                for symmetry in self.kit.types[part_type].symmetries:
                    turned, turned_up = symmetry @ pose, symmetry[:3, :3] @ up
                    known = np.array([each for each, _ in found]).reshape(-1, 4, 4)
                    known_up = np.array([each for _, each in found]).reshape(-1, 3)
                    same = _look_same(self.kit.types[hub], known, turned, self.kit.pose_tolerance)
                    if not (same & (np.abs(known_up - turned_up).max(axis=1, initial=0.0) < ASKEW)).any():
                        found.append((turned, turned_up))
        return {
            part_type: (np.array([pose for pose, _ in found]), np.array([up for _, up in found]))
            for part_type, found in sorted(kept.items())
        }

    def _docked(self, exemplar: Exemplar, hub: int) -> list[tuple[int, FloatArray, FloatArray]]:
        """Each part of an exemplar that touches a hub: its type, the hub's pose and up, both in its coordinates."""
        assembly, backdrop = exemplar.assembly, exemplar.removed_hubs
        docked: list[tuple[int, FloatArray, FloatArray]] = []
        for place in backdrop.poses[backdrop.types == hub]:
            relative = invert(assembly.poses) @ place
            for part, part_type in enumerate(assembly.types.tolist()):
                if self.answers.dockings.label(part_type, hub, relative[part : part + 1])[0] >= 0:
                    docked.append((part_type, relative[part], assembly.poses[part, :3, :3].T @ self._up))
        return docked

    def _places(self, hub: int, assembly: Assembly) -> FloatArray:
        """The poses (k, 4, 4) that enough parts of the assembly give a hub, those that most give first; of poses that
        look the same one."""
        from scipy.spatial import cKDTree

        found = [np.empty((0, 4, 4))]
        for part_type, (poses, ups) in self._beside[hub].items():
            parts = assembly.poses[assembly.types == part_type]
            gaps = np.abs(ups[None] - (self._up @ parts[:, :3, :3])[:, None])
            part, pose = np.nonzero(gaps.max(axis=2) < ASKEW)
            found.append(parts[part] @ poses[pose])
        places = np.concatenate(found)
        if not len(places):
            return places
        fewest = min(sum(count for _, count in each) for each in self.kit.grammar.neighbourhoods[hub])
        tolerance = self.kit.pose_tolerance
        tree = cKDTree(places[:, :3, 3])
        agreed = tree.query_ball_point(places[:, :3, 3], 2 * tolerance, return_length=True)
        is_open = agreed >= FIT_SHARE * fewest
        chosen: list[int] = []
        for index in np.argsort(-agreed, kind="stable").tolist():
            if is_open[index]:
                chosen.append(index)
                beside = np.array(tree.query_ball_point(places[index, :3, 3], 2 * tolerance, return_sorted=True))
                is_open[beside[_look_same(self.kit.types[hub], places[beside], places[index], tolerance)]] = False
        return places[chosen]

    def _touched(
        self, hub: int, place: FloatArray, types: np.ndarray, poses: FloatArray, near: np.ndarray
    ) -> list[int] | None:
        """Which of the parts `near` a hub at `place` touches; None where it may not stand there."""
        answers = self.answers.around(types[near], poses[near], hub, place)
        if (answers == FORBIDDEN).any():
            return None
        touched: list[int] = near[answers != NONE].tolist()
        return touched


_known: dict[tuple[str, bool], HubRestorer] = {}


def hub_restorer(task: Task, kit: str) -> HubRestorer:
    """The backdrop of a kit, kept from shard to shard of one worker: what it remembers never changes a result."""
    upright = task.config.section(VariationsConfig).search.upright
    read = input_kit(task, kit)  # by every shard, so that its record does not depend on what its worker made before
    made_from = str(task.input("exemplars", f"{kit}.tar")), upright
    if made_from not in _known:
        _known[made_from] = HubRestorer(ContactOracle(read), upright)
    return _known[made_from]


def _with_part(assembly: Assembly, part_type: int, place: FloatArray, touched: list[int]) -> Assembly:
    """An assembly with one part more, the last one, which touches others."""
    edges = np.array([(part, len(assembly)) for part in touched], dtype=np.int32).reshape(-1, 2)
    return Assembly(
        np.append(assembly.types, assembly.types.dtype.type(part_type)),
        np.concatenate([assembly.poses, place[None]]),
        np.concatenate([assembly.edges, edges]),
    )


def auto_min_hubs(asked: KitConfig, kit: Kit) -> float:
    """The share of what exemplars have of hub parts that a variant of `kit` must get back, where nobody states it: of a
    kit whose hubs were chosen, and are put back."""
    chosen = asked.hubs.types == "auto" and asked.hubs.restore and bool(kit.grammar.hubs)
    return RESOLVED_HUB_SHARE if chosen else 0


def _has_most(kit: Kit, hub: int, around: np.ndarray) -> bool:
    """Whether parts of the types `around` are most of what once stood around a hub of this type."""
    counts = Counter(around.tolist())
    return any(
        sum(min(count, counts[other]) for other, count in seen) >= FIT_SHARE * sum(count for _, count in seen)
        for seen in kit.grammar.neighbourhoods[hub]
    )


def _look_same(part_type: PartType, poses: FloatArray, pose: FloatArray, tolerance: float) -> np.ndarray:
    """Which of the parts at `poses` (k, 4, 4) look as if they stood at `pose`, bool (k,)."""
    images = pose @ part_type.symmetries
    length = part_type.diagonal / 2
    gaps = pose_vectors(images, length)[:, None] - pose_vectors(poses, length)[None]
    same: np.ndarray = (np.linalg.norm(gaps, axis=2) <= tolerance).any(axis=0)
    return same


def _near(boxes: FloatArray, box: FloatArray, slack: float) -> np.ndarray:
    """Which of the `boxes` (n, 2, 3) are at most `slack` from a box (2, 3) in every axis, int64, ascending."""
    apart = (boxes[:, 0] > box[1] + slack) | (boxes[:, 1] < box[0] - slack)
    return np.flatnonzero(~apart.any(axis=1))
