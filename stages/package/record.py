"""The JSON member of a sample: everything that is known of it, with the same fields in every sample."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stages.points.frame import shape_bounds
from stages.shape.arrays import FloatArray
from stages.shape.kit import Assembly
from stages.shape.sample import Sample
from stages.shape.shape import Shape

__all__ = ["cycle_count", "describe_sample", "rounded"]

DECIMALS = 12


def describe_sample(
    sample: Sample, shape: Shape, text: str, points: Mapping[str, Any], views: Sequence[str]
) -> dict[str, Any]:
    """What the JSON says. `text` is the producer's own: canonical string, parameters or program; `points` says how
    the cloud was made; `views` names the views of the sketches.

    Nothing is null or empty: loaders guess a field's type from the first samples they see. The lineage differs from
    sample to sample, so it stands as a text that is JSON itself; the names of the parents stand beside it. `type` is
    the index of a part's label.
    """
    parts = shape.assembly
    return {
        "key": sample.key,
        "split": sample.split,
        "producer": sample.producer,
        "kit": sample.kit,
        "graph": sample.graph,
        "parents": list(sample.lineage.get("parents", ())) or [sample.kit],
        "lineage": json.dumps(sample.lineage, sort_keys=True, allow_nan=False),
        "parts": [
            {"name": name, "label": shape.labels[label], "type": label, "instance": instance, "pose": pose}
            for instance, (name, label, pose) in enumerate(
                zip(shape.part_names, shape.part_labels.tolist(), parts.poses.tolist(), strict=True)
            )
        ],
        # a list of pairs would be empty for a shape of one part
        "contacts": json.dumps(parts.edges.tolist()),
        "counts": {
            "parts": len(parts),
            "contacts": len(parts.edges),
            "cycles": cycle_count(parts),
            "types": len(set(shape.part_labels.tolist())),
        },
        "bounds": rounded(shape_bounds(shape)).tolist(),
        "text": text,
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
