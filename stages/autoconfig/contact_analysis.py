"""The geometry of some models, seen once: parts, contacts and dockings at one tolerance, for every setting to come."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from stages.exemplars.diagnostics import TOLERANCE_FACTORS, connected_pieces
from stages.exemplars.hubs import remove_hubs, with_touching_types
from stages.exemplars.identify import IdentifiedParts
from stages.exemplars.inferred_dockings import infer_dockings
from stages.exemplars.observed_grammar import (
    ObservedContacts,
    measure_depths,
    observe_contacts,
    observe_neighbourhoods,
    observe_nested,
)
from stages.shape.geometry.contact import ContactTest
from stages.shape.kit import Assembly, ContactKind, Docking, Exemplar, Grammar, Kit, Strictness, labels_of

MORE_CONTACTS = 1.1
"""A tolerance is good if the next looser one finds at most so many times the contacts."""
AS_LARGE = 0.98
"""A piece of this share of the largest to be had is as good."""
ALL_KINDS: tuple[ContactKind, ...] = ("point", "line", "face")


def resolve_contact_tolerance(identified: IdentifiedParts, strictest: float) -> tuple[float, str]:
    """The tolerance to type, as a share of the median part's diagonal, and the reason.

    `strictest` where it makes one piece of every exemplar; else the least of some multiples that does and of which the
    next finds few contacts more; else the least that does; else the least whose pieces are as large as can be had.
    """
    found: list[tuple[float, int, int, bool]] = []
    total = sum(len(each) for each in identified.assemblies)
    for factor in (1.0, *TOLERANCE_FACTORS):
        test = ContactTest(identified.types, factor * strictest * identified.median_diagonal)
        joined = [replace(each, edges=test.contacts(each.types, each.poses)) for each in identified.assemblies]
        largest = sum(int((connected_pieces(each) == 0).sum()) for each in joined)
        count = sum(len(each.edges) for each in joined)
        if largest == total and factor == 1.0:
            return strictest, "every exemplar is in one piece"
        found.append((factor, count, largest, largest == total))
        whole = [each for each in found if each[3]]
        if len(whole) > 1 and count <= MORE_CONTACTS * whole[-2][1]:
            return _typed(whole[-2][0] * strictest), f"{_one_piece(whole[-2][0])}; the next looser one finds no more"
    whole = [each for each in found if each[3]]
    if whole:
        return _typed(whole[0][0] * strictest), _one_piece(whole[0][0])
    best = max(largest for _, _, largest, _ in found)
    factor, _, largest, _ = next(each for each in found if each[2] >= AS_LARGE * best)
    return _typed(factor * strictest), f"no tolerance makes one piece; this joins {largest} of {total} parts"


def _one_piece(factor: float) -> str:
    return f"in pieces with less than {factor:g} times the default, in one piece with it"


def _typed(tolerance: float) -> float:
    """A number as a person would type it."""
    return float(f"{tolerance:.6g}")


@dataclass(frozen=True)
class Setting:
    """What of the geometry counts. hubs: indices of the types that are left out, ascending."""

    kinds: tuple[ContactKind, ...]
    grammar: Strictness
    hubs: tuple[int, ...] = ()


class ContactAnalysis:
    """The parts of some models with all their contacts at one tolerance."""

    def __init__(
        self,
        identified: IdentifiedParts,
        tolerance: float,
        pose_tolerance: float,
        up: Literal["y", "z"],
        fit_tolerance: float | None = None,
    ) -> None:
        """Tolerances are shares of the median part's diagonal; `fit_tolerance`: of parts of one meaning, else None."""
        self.types = identified.types
        self.up = up
        self.pose_tolerance = pose_tolerance * identified.median_diagonal
        self._fit_tolerance = None if fit_tolerance is None else fit_tolerance * identified.median_diagonal
        self._dockings_by_meaning: dict[tuple[ContactKind, ...], tuple[Docking, ...]] = {}
        self._names = identified.part_names
        self._contact = ContactTest(self.types, tolerance * identified.median_diagonal)
        self._touching = [
            replace(each, edges=self._contact.contacts(each.types, each.poses)) for each in identified.assemblies
        ]

    @cached_property
    def contacts(self) -> ObservedContacts:
        """All contacts, with their classes and kinds."""
        return observe_contacts(self.types, self._touching, self._contact, self.pose_tolerance, ALL_KINDS)

    @cached_property
    def _nested(self) -> Mapping[tuple[int, int], float]:
        return observe_nested(self.types, self._touching)

    @cached_property
    def kinds(self) -> tuple[ContactKind, ...]:
        """The kinds of contact that there are."""
        found = {kind for kinds in self.contacts.kinds for kind in kinds}
        return tuple(kind for kind in ALL_KINDS if kind in found)

    @property
    def parts(self) -> int:
        """Number of parts of all models."""
        return sum(len(each) for each in self._touching)

    def widest(self, hubs: Sequence[int]) -> int | None:
        """The type of the part that touches most others when those of the types `hubs` are gone; None where parts of
        one type alone are left."""
        degrees = np.zeros(len(self.types), dtype=np.int64)
        for assembly in self._touching:
            bare = assembly.select(np.flatnonzero(~np.isin(assembly.types, hubs)))
            np.maximum.at(degrees, bare.types, np.bincount(bare.edges.ravel(), minlength=len(bare)))
        return int(degrees.argmax()) if (degrees > 0).sum() > 1 else None

    def counted(self, setting: Setting) -> list[Assembly]:
        """The assemblies with the contacts that count under a setting, hubs among them."""
        found = []
        for assembly, kinds in zip(self._touching, self.contacts.kinds, strict=True):
            chosen = np.array([kind in setting.kinds for kind in kinds], dtype=bool)
            found.append(replace(assembly, edges=assembly.edges[chosen]))
        return found

    def staying(self, setting: Setting) -> list[np.ndarray]:
        """The parts of each assembly that a setting leaves in its shape graph: those of the largest piece without hubs,
        int (k,), ascending."""
        found = []
        for assembly in self.counted(setting):
            bare = np.flatnonzero(~np.isin(assembly.types, setting.hubs))
            found.append(bare[connected_pieces(assembly.select(bare)) == 0] if len(bare) else bare)
        return found

    def kit(self, setting: Setting) -> Kit:
        """The kit under a setting: like the one that a run builds, but for types that it lets go of and depths of
        dockings. Raises ValueError where nothing stays of a model."""
        counted, staying = self.counted(setting), self.staying(setting)
        if not all(map(len, staying)):
            raise ValueError("nothing stays of a model")
        seen = [with_touching_types(each, keep, setting.hubs) for each, keep in zip(counted, staying, strict=True)]
        everything = [each.select(parts) for each, parts in zip(counted, seen, strict=True)]
        dockings = self._dockings(setting)
        labels = labels_of(self.types)[1]
        labelled = [replace(each, types=labels[each.types]) for each in everything]
        grammar = Grammar(observe_neighbourhoods(labelled), dockings, self._nested, setting.grammar)
        edges = [each.edges for each in everything]
        face: ContactKind = "face"  # no kinds are asked for
        kinds = [(face,) * len(each) for each in edges]
        bare, backdrops, rules, _ = remove_hubs(self._used(setting, everything), everything, grammar, kinds, edges)
        return Kit(
            name="seen",
            types=self.types,
            exemplars=tuple(
                Exemplar(f"exemplar-{number}", each, tuple(f"part-{part}" for part in range(len(each))), behind)
                for number, (each, behind) in enumerate(zip(bare, backdrops, strict=True))
            ),
            grammar=rules,
            contact_tolerance=self._contact.tolerance,
            pose_tolerance=self.pose_tolerance,
            contact_kinds=setting.kinds,
            up=self.up,
        )

    def _dockings(self, setting: Setting) -> tuple[Docking, ...]:
        """Those seen, and by meaning those that follow from them."""
        seen = tuple(each for each in self.contacts.dockings if each.kind in setting.kinds)
        if self._fit_tolerance is None:
            return seen
        if setting.kinds not in self._dockings_by_meaning:
            assemblies, deep = self.counted(setting), measure_depths(self.types, seen)
            tolerances = (self._fit_tolerance, self.pose_tolerance)
            fits = infer_dockings(self.types, assemblies, deep, self._contact, *tolerances)
            self._dockings_by_meaning[setting.kinds] = (*deep, *fits)
        return self._dockings_by_meaning[setting.kinds]

    def _used(self, setting: Setting, assemblies: Sequence[Assembly]) -> list[int]:
        """The hubs of a setting that touch something which stays."""
        there = {int(index) for each in assemblies for index in each.types}
        return [index for index in setting.hubs if index in there]
