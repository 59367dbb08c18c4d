"""The JSON member of a sample: everything that is known of it, with the same fields in every sample."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.kit import Assembly
from stages.shape.sample import Sample
from stages.shape.shape import Shape

__all__ = ["cycle_count", "describe_sample", "rounded"]

DECIMALS = 12


def describe_sample(sample: Sample, language: str, shape: Shape, text: str, added: Mapping[str, Any]) -> dict[str, Any]:
    """What the JSON says. `text` is the member of that name, of which the record has the first line where it is a
    list of strings; `added` are the fields of the stages that add some, `contacts` among them.

    Nothing is null or empty: loaders guess a field's type from the first samples they see. The lineage differs from
    sample to sample, so it stands as a text that is JSON itself; the names of the parents stand beside it.
    """
    parts = replace(shape.assembly, edges=np.array(added["contacts"], dtype=np.int32).reshape(-1, 2))
    return {
        "key": sample.key,
        "split": sample.split,
        "producer": sample.producer,
        "language": language,
        "kit": sample.kit,
        "graph": sample.graph,
        "parents": list(sample.lineage.get("parents", ())) or [sample.kit],
        "lineage": json.dumps(sample.lineage, sort_keys=True, allow_nan=False),
        "parts": [
            {"name": name, "label": shape.labels[label], "class": number, "instance": instance, "pose": pose}
            for instance, (name, label, number, pose) in enumerate(
                zip(
                    shape.part_names,
                    shape.part_labels.tolist(),
                    shape.part_classes.tolist(),
                    parts.poses.tolist(),
                    strict=True,
                )
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
        "text": sample.text or text.split("\n", 1)[0],
        **{name: value for name, value in added.items() if name != "contacts"},
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
