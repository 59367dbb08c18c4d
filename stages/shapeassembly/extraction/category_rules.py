"""What the extraction knows of shape categories: which nodes are flattened, collapsed and moved, and their order.

The facts are those of shapeassembly App. C; the names are PartNet's (StructureNet uses the same).
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CategoryRules:
    """The rules of one category; every string is a node's label.

    flatten: below these the leaves become children; collapse: these become leaves. gather: nodes with these labels
    move below a sibling (or new child of the root) labelled `gather_into`. order: semantic order of labels, for the
    order of lines; a label that is not here comes with the nearest part above it that is, or last.
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
"""The rules by category; `any` has none and keeps the hierarchy as it is."""
