"""The JSON member of a sample: everything that is known of it, with the same fields in every sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from stages.shape.collection.members import TEXT
from stages.shape.collection.pairs import CONTACTS, pairs_of
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.geometry.pose import rounded
from stages.shape.kit import Assembly
from stages.shape.sample import Sample
from stages.shape.shape import Shape


def describe_sample(
    sample: Sample,
    language: str,
    shape: Shape,
    members: Mapping[str, bytes],
    added: Mapping[str, Any],
    owned: bool = False,
) -> dict[str, Any]:
    """What the JSON says; `stages.package.schema` says what each field means. `members` are the sample's others, of
    which contacts and text are looked at; `added` are the fields of the stages that add some. `owned`: whether each
    part has its `own_class`, the number of its label in its kit.

    Nothing is null or empty, and no field differs in type from sample to sample: loaders guess a field's type from
    the first samples they see. So pairs of parts stand in arrays of their own: a shape of one part has none.
    """
    parts = replace(shape.assembly, edges=pairs_of(members[CONTACTS]))
    pieces = piece_count(parts)
    # the first of several strings is the canonical one
    text = sample.text or members.get(TEXT, b"").decode().split("\n", 1)[0]
    return {
        "key": sample.key,
        "split": sample.split,
        "producer": sample.producer,
        "language": language,
        "kit": sample.kit,
        "graph": sample.graph,
        "lineage": {"method": sample.producer, "parents": [sample.kit], **sample.lineage},
        "parts": [
            {
                "name": name,
                "label": shape.labels[label],
                "class": number,
                **({"own_class": label} if owned else {}),
                "instance": instance,
                "pose": pose,
            }
            for instance, (name, label, number, pose) in enumerate(
                zip(
                    shape.part_names,
                    shape.part_labels.tolist(),
                    shape.part_classes.tolist(),
                    shape.placements.tolist(),
                    strict=True,
                )
            )
        ],
        "counts": {
            "parts": len(parts),
            "contacts": len(parts.edges),
            "pieces": pieces,
            "cycles": len(parts.edges) - len(parts) + pieces,
            "types": len(set(shape.part_labels.tolist())),
        },
        "bounds": rounded(shape_bounds(shape)).tolist(),
        "unit": shape.unit,
        **({"text": text} if text else {}),
        **added,
    }


def piece_count(assembly: Assembly) -> int:
    """Number of pieces that the contacts of an assembly make."""
    neighbours = assembly.neighbours()
    seen = [False] * len(assembly)
    pieces = 0
    for start in range(len(assembly)):
        pieces += not seen[start]
        waiting = [start]
        while waiting:
            part = waiting.pop()
            if not seen[part]:
                seen[part] = True
                waiting.extend(neighbours[part])
    return pieces
