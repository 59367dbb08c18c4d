"""Whether the exemplars of a kit can meet in one variant: what they share, and where one could go over into another."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Any

from stages.exemplars.observed_grammar import observe_neighbourhoods
from stages.shape.kit import Kit, Multiset

Rule = tuple[int, Multiset]


def kit_overlap(kit: Kit) -> dict[str, Any]:
    """What the exemplars of a kit share, as JSON; empty for a kit of one.

    types: part types that several exemplars have, of `all_types`; neighbourhoods: types with a multiset of neighbour
    types that several show, of `all_neighbourhoods`; joints: pairs of neighbourhoods that different exemplars show,
    each with the other's type among its neighbours, so that their parts might stand side by side; meets: False where
    it is proved that no variant under the grammar `multiset` has neighbourhoods which different exemplars alone show.

    The proof: a shape graph is connected. If it held a neighbourhood of one exemplar alone and one of another alone,
    on the way between them two neighbourhoods of no common exemplar would stand side by side, which is a joint, or
    there would be one that several exemplars show.
    """
    if len(kit.exemplars) < 2:
        return {}
    seen = [
        {
            (part_type, rule)
            for part_type, rules in observe_neighbourhoods([kit.labelled(each.assembly)]).items()
            for rule in rules
        }
        for each in kit.exemplars
    ]
    types = [{part_type for part_type, _ in rules} for rules in seen]
    shared_types = {each for a, b in combinations(types, 2) for each in a & b}
    shared = {rule for a, b in combinations(seen, 2) for rule in a & b}
    joints = sum(_fit(one, other) for a, b in combinations(seen, 2) for one in a - shared for other in b - shared)
    return {
        "types": len(shared_types),
        "all_types": len(set().union(*types)),
        "neighbourhoods": len(shared),
        "all_neighbourhoods": len(set().union(*seen)),
        "joints": joints,
        "meets": bool(shared or joints),
    }


def _fit(one: Rule, other: Rule) -> bool:
    """Whether each has the other's type among its neighbours."""
    return any(near == other[0] for near, _ in one[1]) and any(near == one[0] for near, _ in other[1])


def overlap_sentence(found: Mapping[str, Any], strictness: str, crossings: Mapping[str, int]) -> str:
    """`kit_overlap` in words, with what became of the tries to dock pieces of different ancestry, by outcome."""
    text = (
        f"the exemplars share {found['types']} of {found['all_types']} part types and {found['neighbourhoods']:,} of "
        f"{found['all_neighbourhoods']:,} neighbourhoods; {found['joints']:,} pairs of others might stand side by side"
    )
    if not found["meets"] and strictness == "multiset":
        text += ", so no variant can show both"
    total = sum(crossings.values())
    if total:
        most = sorted(crossings.items(), key=lambda each: (-each[1], each[0]))
        text += f"; {total:,} tries across them: " + ", ".join(f"{count:,} {why}" for why, count in most)
    return text
