"""Knowledge of shape categories: nodes to flatten, collapse and move, and the order of parts.

The facts are those of shapeassembly App. C, the labels PartNet's, which StructureNet shares.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CategoryRules:
    """The rules of one category; every string is a node's label.

    flatten: the leaves below these become children.
    collapse: these become leaves.
    gather, gather_into: nodes labelled `gather` move below a sibling, or new child of the root, labelled `gather_into`.
    order: order of labels for the order of lines; another label follows its nearest listed ancestor, or comes last.
    """

    flatten: frozenset[str] = frozenset()
    collapse: frozenset[str] = frozenset()
    gather: frozenset[str] = frozenset()
    gather_into: str = ""
    order: tuple[str, ...] = ()


CATEGORY_RULES: dict[str, CategoryRules] = {
    "any": CategoryRules(),
    "chair": CategoryRules(
        flatten=frozenset({"chair_back", "chair_arm", "chair_base", "chair_seat", "footrest", "chair_head"}),
        collapse=frozenset({"caster", "mechanical_control"}),
        order=("chair_base", "chair_seat", "chair_back", "chair_arm", "chair_head", "footrest"),
    ),
    "table": CategoryRules(
        flatten=frozenset({"tabletop", "table_base"}),
        collapse=frozenset({"caster", "cabinet_door", "drawer", "keyboard_tray"}),
        order=("table_base", "tabletop"),
    ),
    "storage": CategoryRules(
        flatten=frozenset({"cabinet_frame", "cabinet_base"}),
        collapse=frozenset({"drawer", "cabinet_door", "mirror", "caster"}),
        gather=frozenset({"countertop", "shelf", "drawer", "cabinet_door", "mirror"}),
        gather_into="cabinet_frame",
        order=("cabinet_base", "cabinet_frame", "countertop", "shelf", "drawer", "cabinet_door", "mirror"),
    ),
}
"""The rules by category; `any` keeps the hierarchy as it is."""
