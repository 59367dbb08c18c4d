"""Stage `exports`: files of simulators and modelling programs for each sample, where the config asks for them."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.errors import Rejected
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.exports.settings import ExportsConfig
from stages.shape.collection.archive import archive_bytes, archive_name
from stages.shape.collection.collection import Collection, add_members, stage_members
from stages.shape.collection.pairs import JOINTS, pairs_of
from stages.shape.collection.shards import PRODUCERS, collection_shards, sample_count
from stages.shape.sample import Sample

BYTES_PER_ARCHIVE = 100_000


def plan(plan: Plan) -> list[Shard]:
    """Plan one shard for each shard of the collection, if the config asks for any format."""
    return collection_shards(plan, "validity") if plan.config.section(ExportsConfig).formats else []


def run_shard(task: Task) -> Outcome:
    """Write the archives of each sample. A sample that statics rejects, or with a part without weight, is rejected."""
    from stages.export.formats import shape_files

    config = task.config.section(ExportsConfig)
    judged = stage_members(task, "validity")

    def exported(collection: Collection, sample: Sample) -> Mapping[str, bytes]:
        joints = pairs_of(judged(sample.key)[JOINTS])
        shape = collection.shape(sample)
        try:
            files = {kind: shape_files(kind, sample.key, shape, joints, config.assumed) for kind in config.formats}
        except ValueError as error:
            raise Rejected("cannot be exported", str(error)) from error
        archives = {archive_name(kind): archive_bytes(of_kind) for kind, of_kind in files.items()}
        return {"json": json_bytes({}), **archives}

    return Outcome(add_members(task, exported), {"split": task.shard.params["split"]})


def estimate_bytes(plan: Plan) -> int:
    """Estimate the bytes of all archives."""
    return BYTES_PER_ARCHIVE * len(plan.config.section(ExportsConfig).formats) * sample_count(plan)


STAGE = Stage(
    name="exports",
    module=__name__,
    config=ExportsConfig,
    inputs=(PRODUCERS, "validity"),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
)
