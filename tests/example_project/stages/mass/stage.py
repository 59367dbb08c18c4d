"""Stage `mass`: each sample of the collection gets the masses of its parts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pydantic import Field

from pipeline.config import StrictModel
from pipeline.shards import array_bytes, json_bytes
from pipeline.stage import Outcome, Stage, Task
from stages.shape.collection.collection import Collection, add_members
from stages.shape.collection.shards import PRODUCERS, collection_shards, sample_count
from stages.shape.sample import Sample


class MassConfig(StrictModel):
    """What the parts are made of."""

    density: float = Field(1.0, gt=0, description="mass of a unit of volume")


def run_shard(task: Task) -> Outcome:
    """The volume of the box around each part, times the density."""
    density = task.config.section(MassConfig).density

    def masses(collection: Collection, sample: Sample) -> Mapping[str, bytes]:
        shape = collection.shape(sample)
        volumes = np.array([np.ptp(mesh.vertices, axis=0).prod() for mesh in shape.meshes])
        mass = (density * volumes[shape.assembly.types]).astype(np.float32)
        return {"mass.npy": array_bytes(mass), "json": json_bytes({"total_mass": round(float(mass.sum()), 4)})}

    return Outcome(add_members(task, masses))


STAGE = Stage(
    "mass", __name__, MassConfig, (PRODUCERS,), collection_shards, run_shard, lambda plan: 1000 * sample_count(plan)
)
