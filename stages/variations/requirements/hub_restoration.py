"""Hub restoration: hub parts that the search leaves out are put back into a finished shape where they fit."""

from __future__ import annotations

from collections import Counter
from functools import cached_property, lru_cache

import numpy as np

from pipeline.stage import Task
from stages.exemplars.settings import KitConfig
from stages.shape.arrays import FloatArray
from stages.shape.geometry.contact import world_boxes
from stages.shape.geometry.contact_lookup import FORBIDDEN_CONTACT, NO_CONTACT
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.geometry.pose import invert, pose_vectors
from stages.shape.kit import Assembly, Exemplar, Kit, PartType
from stages.shape.kit_input import input_oracle
from stages.shape.resolved_settings import RESOLVED_HUB_SHARE
from stages.variations.requirements.required_labels import spanning_hubs
from stages.variations.settings import VariationsConfig

HUBS_NOT_RESTORED = "hubs not restored"
"""Reject reason of a variant that does not get back the hubs that are required."""
MIN_NEIGHBOUR_SHARE = 0.75
"""A hub fits where it has at least this share of the neighbours that one of its type had in an exemplar."""
MAX_UP_DIFFERENCE = 1e-2
"""Directions of up whose entries differ by less are equal."""
MAX_SHARE_LACKING_HUBS = 0.05
"""Largest share of parts without a hub type that all parts of their type touch in the exemplars."""


class HubRestorer:
    """Puts the hubs of a kit back into shapes.

    upright: whether a hub stands below, above or next to a part only as one of its type did in an exemplar; otherwise
        symmetries of the part may turn it over
    """

    def __init__(self, oracle: ContactOracle, upright: bool) -> None:
        self.oracle = oracle
        self.kit = oracle.kit
        self._up = np.array({"y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]}[self.kit.up]) if upright else np.zeros(3)
        self._hub_poses = {hub: self._observed(hub) for hub in self.kit.grammar.hubs}

    def fit(self, assembly: Assembly) -> Assembly:
        """Return `assembly` with hub parts where they fit, after its own parts, and with their contacts.

        Candidate poses are those that parts of the assembly had a hub at in an exemplar, most agreed first. A hub fits
        where it has most of the neighbours that one of its type had in an exemplar and every contact is an observed
        docking. Shapes with stretched parts get none, since no exemplar shows how a hub docks to these.
        """
        kit = self.kit
        if assembly.stretches is not None:
            return assembly
        whole = assembly
        boxes = world_boxes(kit.types, whole.types, whole.poses) if kit.grammar.hubs else np.empty((0, 2, 3))
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
        """Return whether a variant with restored hubs has those that are required.

        required >= 1: minimum number of hub parts.
        0 < required < 1: all three must hold. (1) Every spanning hub is present. (2) The most connected hub type has at
            least `required` times its number per part in the exemplars, and at least one. (3) At most
            MAX_SHARE_LACKING_HUBS of the parts lack a hub type that all parts of their type touch in the exemplars: a
            rail ends where its road ends.
        """
        kit = self.kit
        fitted = whole.types[np.isin(whole.types, kit.grammar.hubs)]
        if not 0 < required < 1:
            return len(fitted) >= required
        if any((fitted == hub).sum() < count for hub, count in self._spanning.items()):
            return False
        widest, share = self._widest
        if int((fitted == widest).sum()) < max(1.0, required * share * len(whole)):
            return False
        touching = zip(whole.types.tolist(), self._touching_hubs(whole), strict=True)
        lacking = sum(not self._always[part_type] <= hubs for part_type, hubs in touching)
        return lacking <= MAX_SHARE_LACKING_HUBS * len(whole)

    @cached_property
    def _spanning(self) -> dict[int, int]:
        """Return `spanning_hubs` of the kit."""
        return spanning_hubs(self.kit)

    @cached_property
    def _widest(self) -> tuple[int, float]:
        """Return the hub type with most neighbours, and its number per part in the exemplars."""
        kit = self.kit
        touching = {
            hub: max(sum(count for _, count in seen) for seen in kit.grammar.neighbourhoods[hub])
            for hub in kit.grammar.hubs
        }
        widest = max(touching, key=lambda hub: touching[hub])
        count = sum(int((exemplar.removed_hubs.types == widest).sum()) for exemplar in kit.exemplars)
        return widest, count / sum(len(exemplar.whole) for exemplar in kit.exemplars)

    @cached_property
    def _always(self) -> dict[int, set[int]]:
        """Return for each type the hub types that every part of it touches in the exemplars."""
        always: dict[int, set[int]] = {}
        for exemplar in self.kit.exemplars:
            whole = exemplar.assembly
            for hub, place in zip(exemplar.removed_hubs.types.tolist(), exemplar.removed_hubs.poses, strict=True):
                answers = self.oracle.around(whole.types, whole.poses, hub, place)
                whole = _with_part(whole, hub, place, np.flatnonzero(answers >= 0).tolist())
            for part_type, hubs in zip(whole.types.tolist(), self._touching_hubs(whole), strict=True):
                always[part_type] = always.get(part_type, hubs) & hubs
        return always

    def _touching_hubs(self, whole: Assembly) -> list[set[int]]:
        """Return the hub types that each part touches."""
        touching: list[set[int]] = [set() for _ in range(len(whole))]
        types, hubs = whole.types.tolist(), set(self.kit.grammar.hubs)
        for first, second in whole.edges.tolist():
            touching[first] |= {types[second]} & hubs
            touching[second] |= {types[first]} & hubs
        return touching

    def _observed(self, hub: int) -> dict[int, tuple[FloatArray, FloatArray]]:
        """Return for each type the poses (k, 4, 4) of a hub in coordinates of a part, and up (k, 3) in those
        coordinates.

        They come from all exemplars and symmetries of the part; of poses that look the same only one is kept.
        """
        kept: dict[int, list[tuple[FloatArray, FloatArray]]] = {}
        for exemplar in self.kit.exemplars:
            for part_type, pose, up in self._docked(exemplar, hub):
                poses = kept.setdefault(part_type, [])
                for symmetry in self.kit.types[part_type].symmetries:
                    turned, turned_up = symmetry @ pose, symmetry[:3, :3] @ up
                    known = np.array([known_pose for known_pose, _ in poses]).reshape(-1, 4, 4)
                    known_up = np.array([known_up for _, known_up in poses]).reshape(-1, 3)
                    same = _look_same(self.kit.types[hub], known, turned, self.kit.pose_tolerance)
                    if not (same & (np.abs(known_up - turned_up).max(axis=1, initial=0.0) < MAX_UP_DIFFERENCE)).any():
                        poses.append((turned, turned_up))
        return {
            part_type: (np.array([pose for pose, _ in poses]), np.array([up for _, up in poses]))
            for part_type, poses in sorted(kept.items())
        }

    def _docked(self, exemplar: Exemplar, hub: int) -> list[tuple[int, FloatArray, FloatArray]]:
        """Return for each part of an exemplar that touches a hub its type, the hub's pose and up in its coordinates."""
        assembly, hubs = exemplar.assembly, exemplar.removed_hubs
        docked: list[tuple[int, FloatArray, FloatArray]] = []
        for place in hubs.poses[hubs.types == hub]:
            relative = invert(assembly.poses) @ place
            for part, part_type in enumerate(assembly.types.tolist()):
                if self.oracle.dockings.label(part_type, hub, relative[part : part + 1])[0] >= 0:
                    docked.append((part_type, relative[part], assembly.poses[part, :3, :3].T @ self._up))
        return docked

    def _places(self, hub: int, assembly: Assembly) -> FloatArray:
        """Return the poses (k, 4, 4) that enough parts of the assembly give a hub, most agreed first, without
        look-alikes.
        """
        from scipy.spatial import cKDTree

        proposed = [np.empty((0, 4, 4))]
        for part_type, (poses, ups) in self._hub_poses[hub].items():
            parts = assembly.poses[assembly.types == part_type]
            gaps = np.abs(ups[None] - (self._up @ parts[:, :3, :3])[:, None])
            part, pose = np.nonzero(gaps.max(axis=2) < MAX_UP_DIFFERENCE)
            proposed.append(parts[part] @ poses[pose])
        places = np.concatenate(proposed)
        if not len(places):
            return places
        neighbourhoods = self.kit.grammar.neighbourhoods[hub]
        min_neighbours = min(sum(count for _, count in neighbourhood) for neighbourhood in neighbourhoods)
        tolerance = self.kit.pose_tolerance
        tree = cKDTree(places[:, :3, 3])
        agreed = tree.query_ball_point(places[:, :3, 3], 2 * tolerance, return_length=True)
        is_open = agreed >= MIN_NEIGHBOUR_SHARE * min_neighbours
        chosen: list[int] = []
        for index in np.argsort(-agreed, kind="stable").tolist():
            if is_open[index]:
                chosen.append(index)
                near = np.array(tree.query_ball_point(places[index, :3, 3], 2 * tolerance, return_sorted=True))
                is_open[near[_look_same(self.kit.types[hub], places[near], places[index], tolerance)]] = False
        return places[chosen]

    def _touched(
        self, hub: int, place: FloatArray, types: np.ndarray, poses: FloatArray, near: np.ndarray
    ) -> list[int] | None:
        """Return the parts among `near` that a hub at `place` touches, or None where the hub is forbidden there."""
        answers = self.oracle.around(types[near], poses[near], hub, place)
        if (answers == FORBIDDEN_CONTACT).any():
            return None
        touched: list[int] = near[answers != NO_CONTACT].tolist()
        return touched


def hub_restorer(task: Task, kit: str) -> HubRestorer:
    """Return the hub restorer of a kit, kept from shard to shard of a worker; its memory never changes a result."""
    upright = task.config.section(VariationsConfig).search.upright
    return _restorer(input_oracle(task, kit), upright)


@lru_cache(maxsize=32)
def _restorer(oracle: ContactOracle, upright: bool) -> HubRestorer:
    return HubRestorer(oracle, upright)


def _with_part(assembly: Assembly, part_type: int, place: FloatArray, touched: list[int]) -> Assembly:
    """Return an assembly with one more part, the last one, which touches others."""
    edges = np.array([(part, len(assembly)) for part in touched], dtype=np.int32).reshape(-1, 2)
    return Assembly(
        np.append(assembly.types, assembly.types.dtype.type(part_type)),
        np.concatenate([assembly.poses, place[None]]),
        np.concatenate([assembly.edges, edges]),
    )


def auto_min_hubs(asked: KitConfig, kit: Kit) -> float:
    """Return the `min_hubs` of a kit whose config leaves it open: above 0 where its hubs are chosen and restored."""
    chosen = asked.hubs.types == "auto" and asked.hubs.restore and bool(kit.grammar.hubs)
    return RESOLVED_HUB_SHARE if chosen else 0


def _has_most(kit: Kit, hub: int, around: np.ndarray) -> bool:
    """Return whether parts of the types `around` are most of the neighbours that a hub of this type once had."""
    counts = Counter(around.tolist())
    return any(
        sum(min(count, counts[other]) for other, count in seen) >= MIN_NEIGHBOUR_SHARE * sum(count for _, count in seen)
        for seen in kit.grammar.neighbourhoods[hub]
    )


def _look_same(part_type: PartType, poses: FloatArray, pose: FloatArray, tolerance: float) -> np.ndarray:
    """Return which of the parts at `poses` (k, 4, 4) look as if they were at `pose`, bool (k,)."""
    images = pose @ part_type.symmetries
    length = part_type.diagonal / 2
    gaps = pose_vectors(images, length)[:, None] - pose_vectors(poses, length)[None]
    same: np.ndarray = (np.linalg.norm(gaps, axis=2) <= tolerance).any(axis=0)
    return same


def _near(boxes: FloatArray, box: FloatArray, slack: float) -> np.ndarray:
    """Return the indices of `boxes` (n, 2, 3) at most `slack` from a box (2, 3) in every axis, int64, ascending."""
    apart = (boxes[:, 0] > box[1] + slack) | (boxes[:, 1] < box[0] - slack)
    return np.flatnonzero(~apart.any(axis=1))
