"""Contact analysis: parts, contacts and dockings of some models at one tolerance, computed once for every setting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

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

MAX_CONTACT_GROWTH = 1.1
"""A tolerance is accepted if the next looser one finds at most this multiple of its contacts."""
MIN_LARGEST_SHARE = 0.98
"""Share of the largest possible piece from which a tolerance joins enough."""
ALL_KINDS: tuple[ContactKind, ...] = ("point", "line", "face")


@dataclass(frozen=True)
class _Joined:
    """What a tolerance joins: its factor, the number of contacts, and the parts in the largest piece of each model."""

    factor: float
    contacts: int
    largest: int


def resolve_contact_tolerance(identified: IdentifiedParts, strictest: float) -> tuple[float, str]:
    """Return the contact tolerance, as a share of the median part's diagonal, and the reason.

    `strictest` is taken if it makes one piece of every exemplar. Otherwise multiples of it are tried, in this order of
    preference: the smallest that makes one piece and whose next multiple finds few more contacts; the smallest that
    makes one piece; the smallest whose pieces are as large as possible.
    """
    tried: list[_Joined] = []
    total = sum(len(assembly) for assembly in identified.assemblies)
    for factor in (1.0, *TOLERANCE_FACTORS):
        test = ContactTest(identified.types, factor * strictest * identified.median_diagonal)
        joined = [
            replace(assembly, edges=test.contacts(assembly.types, assembly.poses)) for assembly in identified.assemblies
        ]
        largest = sum(int((connected_pieces(assembly) == 0).sum()) for assembly in joined)
        tried.append(_Joined(factor, sum(len(assembly.edges) for assembly in joined), largest))
        if largest == total and factor == 1.0:
            return strictest, "every exemplar is in one piece"
        whole = [result for result in tried if result.largest == total]
        if len(whole) > 1 and tried[-1].contacts <= MAX_CONTACT_GROWTH * whole[-2].contacts:
            factor = whole[-2].factor
            return _rounded(factor * strictest), f"{_one_piece(factor)}; the next looser one finds no more"
    if whole:
        return _rounded(whole[0].factor * strictest), _one_piece(whole[0].factor)
    best = max(result.largest for result in tried)
    enough = next(result for result in tried if result.largest >= MIN_LARGEST_SHARE * best)
    reason = f"no tolerance makes one piece; this joins {enough.largest} of {total} parts"
    return _rounded(enough.factor * strictest), reason


def _one_piece(factor: float) -> str:
    return f"in pieces with less than {factor:g} times the default, in one piece with it"


def _rounded(tolerance: float) -> float:
    """Round a tolerance to the six digits that a person would type."""
    return float(f"{tolerance:.6g}")


@dataclass(frozen=True)
class Setting:
    """A candidate for the shape graphs and the grammar of a kit.

    kinds: the kinds of contact that count.
    grammar: the strictness.
    hubs: indices of the types that are left out, ascending.
    """

    kinds: tuple[ContactKind, ...]
    grammar: Strictness
    hubs: tuple[int, ...] = ()


class ContactAnalysis:
    """The parts of some models with all their contacts at one tolerance.

    trials: what setting searches of these parts have tried, by what they asked
    """

    def __init__(
        self,
        identified: IdentifiedParts,
        tolerance: float,
        pose_tolerance: float,
        up: Literal["y", "z"],
        fit_tolerance: float | None = None,
    ) -> None:
        """Find the contacts of `identified` parts.

        tolerance, pose_tolerance: shares of the median part's diagonal.
        fit_tolerance: the same for parts of one meaning; None if types do not go by meaning.
        """
        self.types = identified.types
        self.trials: dict[Any, Any] = {}
        self._depths = identified.depths
        self.up = up
        self.pose_tolerance = pose_tolerance * identified.median_diagonal
        self._fit_tolerance = None if fit_tolerance is None else fit_tolerance * identified.median_diagonal
        self._dockings_by_meaning: dict[tuple[ContactKind, ...], tuple[Docking, ...]] = {}
        self._contact = ContactTest(self.types, tolerance * identified.median_diagonal)
        self._touching = [
            replace(assembly, edges=self._contact.contacts(assembly.types, assembly.poses))
            for assembly in identified.assemblies
        ]

    @cached_property
    def contacts(self) -> ObservedContacts:
        """All contacts, with their classes and kinds."""
        return observe_contacts(self.types, self._touching, self._contact, self.pose_tolerance, ALL_KINDS)

    @cached_property
    def _nested(self) -> Mapping[tuple[int, int], float]:
        return observe_nested(self.types, self._touching, self._depths)

    @cached_property
    def kinds(self) -> tuple[ContactKind, ...]:
        """The kinds of contact that occur."""
        observed = {kind for kinds in self.contacts.kinds for kind in kinds}
        return tuple(kind for kind in ALL_KINDS if kind in observed)

    @property
    def part_count(self) -> int:
        """Number of parts of all models."""
        return sum(len(assembly) for assembly in self._touching)

    def most_connected_type(self, hubs: Sequence[int]) -> int | None:
        """Return the type of the part with most contacts once the types `hubs` are removed; None if one type is
        left."""
        degrees = np.zeros(len(self.types), dtype=np.int64)
        for assembly in self._touching:
            bare = assembly.select(np.flatnonzero(~np.isin(assembly.types, hubs)))
            np.maximum.at(degrees, bare.types, np.bincount(bare.edges.ravel(), minlength=len(bare)))
        return int(degrees.argmax()) if (degrees > 0).sum() > 1 else None

    def counted(self, setting: Setting) -> list[Assembly]:
        """Return the assemblies with the contacts that count under a setting, hubs included."""
        assemblies = []
        for assembly, kinds in zip(self._touching, self.contacts.kinds, strict=True):
            counts = np.array([kind in setting.kinds for kind in kinds], dtype=bool)
            assemblies.append(replace(assembly, edges=assembly.edges[counts]))
        return assemblies

    def kept_parts(self, setting: Setting) -> list[np.ndarray]:
        """Return the parts that a setting keeps of each assembly: the largest piece without hubs, int (k,),
        ascending."""
        kept = []
        for assembly in self.counted(setting):
            bare = np.flatnonzero(~np.isin(assembly.types, setting.hubs))
            kept.append(bare[connected_pieces(assembly.select(bare)) == 0] if len(bare) else bare)
        return kept

    def kit(self, setting: Setting) -> Kit:
        """Return the kit under a setting, with every type and without depths of dockings.

        A run would build the same kit without unused types and with depths. Raises ValueError if no part of a model is
        kept.
        """
        counted, kept = self.counted(setting), self.kept_parts(setting)
        if not all(map(len, kept)):
            raise ValueError("no part of a model is kept")
        visible = [
            with_touching_types(assembly, parts, setting.hubs) for assembly, parts in zip(counted, kept, strict=True)
        ]
        everything = [assembly.select(parts) for assembly, parts in zip(counted, visible, strict=True)]
        labels = labels_of(self.types)[1]
        labelled = [replace(assembly, types=labels[assembly.types]) for assembly in everything]
        grammar = Grammar(observe_neighbourhoods(labelled), self._dockings(setting), self._nested, setting.grammar)
        edges = [assembly.edges for assembly in everything]
        face: ContactKind = "face"  # the kinds are not read
        kinds = [(face,) * len(assembly) for assembly in edges]
        bare, hub_parts, grammar, _ = remove_hubs(self._used(setting, everything), everything, grammar, kinds, edges)
        return Kit(
            name="seen",
            types=self.types,
            exemplars=tuple(
                Exemplar(f"exemplar-{number}", assembly, tuple(f"part-{part}" for part in range(len(assembly))), hubs)
                for number, (assembly, hubs) in enumerate(zip(bare, hub_parts, strict=True))
            ),
            grammar=grammar,
            contact_tolerance=self._contact.tolerance,
            pose_tolerance=self.pose_tolerance,
            contact_kinds=setting.kinds,
            up=self.up,
        )

    def _dockings(self, setting: Setting) -> tuple[Docking, ...]:
        """Return the observed dockings, and by meaning those inferred from them."""
        observed = tuple(docking for docking in self.contacts.dockings if docking.kind in setting.kinds)
        if self._fit_tolerance is None:
            return observed
        if setting.kinds not in self._dockings_by_meaning:
            assemblies, deep = self.counted(setting), measure_depths(self.types, observed, self._depths)
            tolerances = (self._fit_tolerance, self.pose_tolerance)
            inferred = infer_dockings(self.types, assemblies, deep, self._contact, *tolerances)
            self._dockings_by_meaning[setting.kinds] = (*deep, *inferred)
        return self._dockings_by_meaning[setting.kinds]

    def _used(self, setting: Setting, assemblies: Sequence[Assembly]) -> list[int]:
        """Return the hub types of a setting that occur in `assemblies`."""
        used = {int(index) for assembly in assemblies for index in assembly.types}
        return [index for index in setting.hubs if index in used]
