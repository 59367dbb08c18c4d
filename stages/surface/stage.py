"""Stage `surface`: facts about surfaces, the watertight union, signed distances and occupancy of each sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from pipeline.shards import array_bytes, json_bytes
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.shape.collection.collection import Collection, add_members
from stages.shape.collection.shards import PRODUCERS, collection_shards, sample_count
from stages.shape.sample import Sample
from stages.shape.shape import Shape
from stages.surface.members import OCCUPANCY, SDF_POINTS, SDF_VALUES, UNION_FACES, UNION_INSTANCES, UNION_VERTICES
from stages.surface.settings import SurfaceConfig

UNION_BYTES = 200_000
"""Of a union, on average."""


def plan(plan: Plan) -> list[Shard]:
    """Plan one shard for each shard of the collection, if the config asks for anything."""
    return collection_shards(plan) if plan.config.section(SurfaceConfig).is_requested else []


def run_shard(task: Task) -> Outcome:
    """Make the members of each sample that `members.py` declares.

    A sample without a clear inside is rejected if something is asked for that needs one.
    """
    config = task.config.section(SurfaceConfig)

    def made(collection: Collection, sample: Sample) -> Mapping[str, bytes]:
        return surface_members(collection.shape(sample), config, task.rng(sample.key))

    return Outcome(add_members(task, made), {"split": task.shard.params["split"]})


def surface_members(shape: Shape, config: SurfaceConfig, rng: np.random.Generator) -> dict[str, bytes]:
    """Return the members of one sample. Raises Rejected for one without a clear inside, where that is needed."""
    fields: dict[str, Any] = {}
    members: dict[str, bytes] = {}
    if config.flags:
        fields["surface"] = flag_fields(shape)
    if config.needs_union:
        _add_union(shape, config, rng, fields, members)
    return {"json": json_bytes(fields), **members}


def flag_fields(shape: Shape) -> dict[str, Any]:
    """Return the record's facts about the surfaces of a shape."""
    from stages.surface.checks import surface_flags

    of_mesh = {kind: surface_flags(shape.meshes[kind]) for kind in sorted(set(shape.assembly.types.tolist()))}
    parts = [of_mesh[kind] for kind in shape.assembly.types.tolist()]
    return {
        "closed": all(part.closed for part in parts),
        "manifold": all(part.manifold for part in parts),
        "self_intersecting": any(part.self_intersecting for part in parts),
        "parts": [asdict(part) for part in parts],
    }


def _add_union(
    shape: Shape, config: SurfaceConfig, rng: np.random.Generator, fields: dict[str, Any], members: dict[str, bytes]
) -> None:
    from stages.surface.distances import cube_around, distance_points, occupancy_grid, signed_distances
    from stages.surface.union import solids_of, union_mesh

    solids = solids_of(shape)
    union = union_mesh(solids)
    cube = cube_around(union, config.padding)
    fields["union"] = {
        "volume": _short(union.volume),
        "area": _short(union.area),
        "components": union.components,
        "cube_low": [_short(value) for value in cube.low.tolist()],
        "cube_side": _short(cube.side),
    }
    if config.union:
        members[UNION_VERTICES] = array_bytes(union.vertices.astype(np.float32))
        members[UNION_FACES] = array_bytes(union.faces)
        members[UNION_INSTANCES] = array_bytes(union.instances)
    if config.point_count:
        points = distance_points(union, cube, config.distances, rng)
        members[SDF_POINTS] = array_bytes(points)
        members[SDF_VALUES] = array_bytes(signed_distances(solids, union, points))
    if config.occupancy:
        members[OCCUPANCY] = array_bytes(occupancy_grid(solids, cube, config.occupancy))


def _short(value: float) -> float:
    """Return a number without the noise of its last digits."""
    return float(f"{value:.9g}")


def estimate_bytes(plan: Plan) -> int:
    """Estimate the bytes of all members."""
    config = plan.config.section(SurfaceConfig)
    if not config.is_requested:
        return 0
    union = UNION_BYTES if config.union else 0
    return sample_count(plan) * (union + 16 * config.point_count + config.occupancy**3 // 8 + 4096)


STAGE = Stage(
    name="surface",
    module=__name__,
    config=SurfaceConfig,
    inputs=(PRODUCERS,),
    plan=plan,
    run_shard=run_shard,
    estimate_bytes=estimate_bytes,
)
