"""The JSON member of a sample: everything that is known of it, with the same fields in every sample."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stages.package.glb import node_names
from stages.points.frame import assembly_bounds
from stages.shape.arrays import FloatArray
from stages.shape.kit import Assembly, Kit
from stages.shape.sample import Sample

__all__ = ["cycle_count", "describe_sample", "rounded"]

DECIMALS = 12


def describe_sample(
    sample: Sample,
    kit: Kit,
    assembly: Assembly,
    string: str,
    points: Mapping[str, Any],
    views: Sequence[str],
) -> dict[str, Any]:
    """What the JSON says. `assembly` is the sample's, upright; `string` is its canonical string; `points`
    says how its cloud was made; `views` names the views of its sketches.

    Nothing is null or empty: loaders guess a field's type from the first samples they see. The lineage differs from
    sample to sample, so it stands as a text that is JSON itself; the names of the parents stand beside it.
    """
    names = kit.type_names()
    parts = [
        {"name": name, "label": names[kind], "type": kind, "instance": instance, "pose": pose}
        for instance, (name, kind, pose) in enumerate(
            zip(node_names(names, assembly), assembly.types.tolist(), assembly.poses.tolist(), strict=True)
        )
    ]
    return {
        "key": sample.key,
        "split": sample.split,
        "producer": sample.producer,
        "kit": sample.kit,
        "graph": sample.graph,
        "parents": list(sample.lineage.get("parents", ())) or [sample.kit],
        "lineage": json.dumps(sample.lineage, sort_keys=True, allow_nan=False),
        "parts": parts,
        "contacts": assembly.edges.tolist(),
        "counts": {
            "parts": len(assembly),
            "contacts": len(assembly.edges),
            "cycles": cycle_count(assembly),
            "types": len(set(assembly.types.tolist())),
        },
        "bounds": rounded(assembly_bounds(kit.types, assembly)).tolist(),
        "string": string,
        "points": dict(points),
        "sketches": list(views),
    }


def rounded(numbers: FloatArray) -> FloatArray:
    """`numbers` without the noise of their last digits, and without minus zeros: shorter and the same to the eye."""
    return np.round(numbers, DECIMALS) + 0.0


def cycle_count(assembly: Assembly) -> int:
    """Number of independent cycles of the shape graph: contacts that close a ring."""
    neighbours = assembly.neighbours()
    seen = [False] * len(assembly)
    components = 0
    for start in range(len(assembly)):
        components += not seen[start]
        waiting = [start]
        while waiting:
            part = waiting.pop()
            if not seen[part]:
                seen[part] = True
                waiting.extend(neighbours[part])
    return len(assembly.edges) - len(assembly) + components
