"""Overlap of the exemplars of a kit: what they share, and where a variant could go over from one to another."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Any

from stages.exemplars.observed_grammar import observe_neighbourhoods
from stages.shape.kit import Kit, Multiset

Rule = tuple[int, Multiset]


def kit_overlap(kit: Kit) -> dict[str, Any]:
    """Return what the exemplars of a kit share, as JSON; empty for a kit of one exemplar.

    types, all_types: part types that several exemplars have, and all
    neighbourhoods, all_neighbourhoods: types with a multiset of neighbour types that several exemplars show, and all
    joints: pairs of neighbourhoods of different exemplars, each with the other's type among its neighbours
    mixable: False if provably no variant under the grammar `multiset` can show neighbourhoods of different exemplars

    Proof: a shape graph is connected. Suppose it holds a neighbourhood that only one exemplar shows and one that only
    another shows. On a path between them either two adjacent neighbourhoods have no exemplar in common, which is a
    joint, or several exemplars show one of them.
    """
    if len(kit.exemplars) < 2:
        return {}
    seen = [
        {
            (part_type, rule)
            for part_type, rules in observe_neighbourhoods([kit.labelled(exemplar.assembly)]).items()
            for rule in rules
        }
        for exemplar in kit.exemplars
    ]
    types = [{part_type for part_type, _ in rules} for rules in seen]
    shared_types = {part_type for a, b in combinations(types, 2) for part_type in a & b}
    shared = {rule for a, b in combinations(seen, 2) for rule in a & b}
    joints = sum(_fit(first, second) for a, b in combinations(seen, 2) for first in a - shared for second in b - shared)
    return {
        "types": len(shared_types),
        "all_types": len(set().union(*types)),
        "neighbourhoods": len(shared),
        "all_neighbourhoods": len(set().union(*seen)),
        "joints": joints,
        "mixable": bool(shared or joints),
    }


def _fit(first: Rule, second: Rule) -> bool:
    """Return whether each of two neighbourhoods has the other's type among its neighbours."""
    return any(near == second[0] for near, _ in first[1]) and any(near == first[0] for near, _ in second[1])


def overlap_sentence(shared: Mapping[str, Any], strictness: str, crossings: Mapping[str, int]) -> str:
    """Return `kit_overlap` in words, with the outcomes of tries to join pieces of different ancestry."""
    text = (
        f"the exemplars share {shared['types']} of {shared['all_types']} part types and {shared['neighbourhoods']:,} "
        f"of {shared['all_neighbourhoods']:,} neighbourhoods; {shared['joints']:,} pairs of others might be side "
        "by side"
    )
    if not shared["mixable"] and strictness == "multiset":
        text += ", so no variant can show both"
    total = sum(crossings.values())
    if total:
        outcomes = sorted(crossings.items(), key=lambda outcome: (-outcome[1], outcome[0]))
        text += f"; {total:,} tries across them: " + ", ".join(f"{count:,} {why}" for why, count in outcomes)
    return text
