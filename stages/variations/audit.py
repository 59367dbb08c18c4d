"""Check samples that are exemplars with longer or shorter rows: repeating their changes gives the same parts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.paths import DatasetPaths
from stages.exemplars.language import LANGUAGE, dataset_kits
from stages.rows.changes import changed, changes_text, read_changes
from stages.rows.layout import graph_layout
from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample
from stages.shape.geometry.pose import invert
from stages.shape.kit import Assembly, Kit
from stages.shape.shape import mesh_name

MAX_ROTATION_DIFFERENCE = 1e-4
"""Largest difference of two entries of equal rotations, which records round."""


def _recheck(sample: PackagedSample, paths: DatasetPaths) -> Iterator[str]:
    """Change the rows of the exemplar as the lineage says, and compare types and relative poses of the parts."""
    record = sample.record
    text = record["lineage"].get("rows", changes_text(()))
    if record["language"] != LANGUAGE.name or text == changes_text(()):
        return
    kit, name = dataset_kits(paths)[record["kit"]], record["lineage"]["made_of"][0]
    try:
        made = _made_again(kit, name, text)
    except (LookupError, TypeError, ValueError) as error:
        yield f"the rows of exemplar {name} cannot be changed as its lineage says: {error}"
        return
    parts = record["parts"][: len(record["parts"]) - record["lineage"]["restored_hubs"]]
    if [mesh_name(part["name"]) for part in parts] != [kit.types[kind].name for kind in made.types.tolist()]:
        yield f"exemplar {name} with its rows changed has other parts"
        return
    poses = np.array([part["pose"] for part in parts], dtype=np.float64)
    gaps = np.abs(invert(poses[0]) @ poses - invert(made.poses[0]) @ made.poses).max(axis=0)
    if gaps[:3, :3].max() > MAX_ROTATION_DIFFERENCE or gaps[:3, 3].max() > kit.pose_tolerance:
        yield f"exemplar {name} with its rows changed has parts at other places"


def _made_again(kit: Kit, name: str, text: str) -> Assembly:
    """Return an exemplar with its rows changed. Raises LookupError for an unknown one, or an error of the changes."""
    exemplar = next((exemplar for exemplar in kit.exemplars if exemplar.name == name), None)
    if exemplar is None:
        raise LookupError(f"kit {kit.name} has no such exemplar")
    layout = graph_layout(kit, exemplar)
    for change in read_changes(text):
        layout = changed(layout, change)
    return layout.assembly()


AUDIT = Audit(recheck=_recheck)
