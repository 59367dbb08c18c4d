"""Advice: why a search finds nothing in a kit, and what its user can do."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from stages.exemplars.diagnostics import MAX_PARTS_WITHOUT_HUBS, hub_parts
from stages.shape.kit import Kit
from stages.variations.requirements.hub_restoration import HUBS_NOT_RESTORED
from stages.variations.requirements.required_labels import LABELS_MISSING, spanning_labels
from stages.variations.search.variant import DUPLICATE, SUBASSEMBLY

SAME_LAYOUT = (
    "make the same layout in other proportions (`variations.samples_per_kit: 0`, `proportions.samples_per_kit`)"
)
"""What always helps where there are too few layouts, or only similar ones."""
REGULAR_KIT_SHARE = 0.01
"""Share of tries that give an exemplar or a piece of one from which a kit counts as regular."""


def another_model(kit: Kit) -> str:
    """Return what model to add to the exemplars of a kit, in words."""
    return f"{'a second' if len(kit.exemplars) == 1 else 'another'} model of the same parts"


def what_keeps(kit: Kit, rejects: Mapping[str, int], tries: int) -> str:
    """Return in a sentence why the search of a kit finds nothing, and what would help.

    rejects: number of the `tries` that failed, by reason
    """
    labelled = [kit.labelled(exemplar.assembly).types for exemplar in kit.exemplars]
    counts = np.bincount(np.concatenate(labelled), minlength=len(kit.labels))
    used, another = int((counts > 0).sum()), another_model(kit)
    fitting = "by meaning (`types: meaning`; parts are exchanged where their neighbours have one size)"
    if counts.max() < 2:
        return f"every part is its own type; bring {another}, or name types {fitting}"
    if used == 1:
        return "all parts are of one type, so a variant is only longer or shorter; bring a model with other parts too"
    if rejects.get(LABELS_MISSING, 0):
        lost = f"everything found lacks {' or '.join(spanning_labels(kit))}, parts as large as the exemplar"
        return f"{lost}, and is only a piece of one; bring {another} that has them"
    if rejects.get(HUBS_NOT_RESTORED, 0):
        left_out = " or ".join(kit.types[hub].name for hub in kit.grammar.hubs)
        return f"everything found lacks {left_out}, which `hubs.types` left out; bring {another}"
    pinned = _hub(kit)
    if pinned:
        return f"{pinned}; split it into several parts in the model, or bring {another}"
    largest = max(map(len, labelled))
    if largest <= MAX_PARTS_WITHOUT_HUBS:
        by_meaning = "" if kit.by_meaning else f", or name types {fitting}"
        return f"of {largest} parts hardly any can be exchanged; bring more models of the same parts{by_meaning}"
    known = rejects.get(DUPLICATE, 0) + rejects.get(SUBASSEMBLY, 0)
    if known > REGULAR_KIT_SHARE * tries:
        regular = "every exchange gives the exemplar, or a piece of it: it is regular"
        return (
            f"{regular}; bring {another}, or write a program of its counts and sizes, as stages/programs/README.md says"
        )
    alone = int((counts == 1).sum())
    if alone > used / 2:
        return f"{alone} of {used} part types occur once; bring {another}"
    return f"pieces fit only where they already are; bring {another}"


def what_was_left(lists: Mapping[str, int]) -> str:
    """Return what the search has not looked at, in words, and what would help; empty where it was nothing.

    lists: number of lists of replacements, by whether each was `whole` or `cut short`
    """
    short, whole = lists.get("cut short", 0), lists.get("whole", 0)
    if not short:
        return ""
    return (
        f"{short:,} of {short + whole:,} lists of replacements ended at their limit, and the last ones are missing; "
        "a longer search continues them, and fewer `variations.search.dummy_edges` leave less out"
    )


def _hub(kit: Kit) -> str:
    """Return the hub that touches the largest share of its exemplar's parts, in words; or an empty string."""
    worst: tuple[float, str] = (0.0, "")
    for exemplar in kit.exemplars:
        assembly = exemplar.assembly
        degrees = np.bincount(assembly.edges.ravel(), minlength=len(assembly))
        for part in hub_parts(assembly):
            share = degrees[part] / (len(assembly) - 1)
            if share > worst[0]:
                name = exemplar.part_names[part]
                worst = (share, f"part {name} touches {degrees[part]} of {len(assembly) - 1} others and pins them")
    return worst[1]
