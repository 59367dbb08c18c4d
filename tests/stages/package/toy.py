"""A small dataset of boxes, made by the engine: toy stages before the real `points` and `package`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.config import Config
from pipeline.errors import Rejected
from pipeline.paths import DatasetPaths
from pipeline.run import run_stage
from pipeline.shards import ShardWriter
from pipeline.stage import Outcome, Plan, Shard, Stage, Task
from stages.abstraction.settings import AbstractionConfig
from stages.abstraction.stage import STAGE as ABSTRACTION
from stages.captions.settings import CaptionsConfig
from stages.captions.stage import STAGE as CAPTIONS
from stages.exemplars.settings import ExemplarsConfig
from stages.exports.settings import ExportsConfig
from stages.exports.stage import STAGE as EXPORTS
from stages.package.settings import PackageConfig
from stages.package.stage import STAGE as PACKAGE
from stages.points.settings import PointsConfig, ScansConfig
from stages.points.stage import STAGE as POINTS
from stages.shape.collection.collection import Collection, add_members
from stages.shape.collection.shards import PRODUCERS, collection_shards
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Assembly, Docking, Exemplar, Grammar, Kit, PartType
from stages.shape.kit_files import write_kit
from stages.shape.sample import Sample, read_samples, write_sample
from stages.shape.views.scene import scene_of
from stages.sketches.settings import SketchesConfig, SketchView
from stages.sketches.stage import drawings
from stages.sketches.stage import plan as plan_sketches
from stages.strings.settings import StringsConfig
from stages.structure.settings import StructureConfig
from stages.structure.stage import STAGE as STRUCTURE
from stages.surface.settings import DistanceConfig, SurfaceConfig
from stages.surface.stage import STAGE as SURFACE
from stages.validity.settings import ValidityConfig
from stages.validity.stage import STAGE as VALIDITY
from stages.variations.settings import VariationsConfig
from stages.views.settings import RingCameras, ViewsConfig
from stages.views.stage import STAGE as VIEWS
from tests.stages.shape.collection.absent import ABSENT_SECTIONS, ABSENT_STAGES, named_inputs

BOX = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
BOX_SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
BOX_FACES = np.array([face for a, b, c, d in BOX_SIDES for face in ((a, b, c), (a, c, d))], dtype=np.int32)
SPLITS = ("train", "val", "test")
KITS = {"blocks": "y", "planks": "z"}


def box(name: str, size: tuple[float, float, float], color: tuple[int, int, int]) -> PartType:
    """A box with one corner at the origin; its top is white."""
    colors = np.tile(np.array(color, dtype=np.uint8), (12, 1))
    colors[10:] = 255
    return PartType(name, BOX * size, BOX_FACES, colors, np.eye(4), np.eye(4)[None])


def chain(length: int, first: int) -> Assembly:
    """`length` boxes in a row along x, of types 0 and 1 in turn; the boxes of every type are one wide."""
    poses = np.tile(np.eye(4), (length, 1, 1))
    poses[:, 0, 3] = np.arange(length)
    edges = np.stack([np.arange(length - 1), np.arange(1, length)], axis=1).astype(np.int32)
    return Assembly(((np.arange(length) + first) % 2).astype(np.int16), poses, edges)


def toy_kit(name: str) -> Kit:
    """Two types of boxes; the kit `planks` has z up."""
    types = (box("tower", (1.0, 1.0, 3.0), (200, 40, 40)), box("long.wall", (1.0, 0.5, 2.0), (40, 40, 200)))
    exemplar = Exemplar("row", chain(6, 0), tuple(f"part{index}" for index in range(6)))
    poses = [np.eye(4), np.eye(4)]
    poses[0][0, 3], poses[1][0, 3] = 1.0, -1.0
    dockings = tuple(Docking(0, 1, pose, "face", count, 0.0) for pose, count in zip(poses, (3, 2), strict=True))
    rules = {kind: {(): 1, ((1 - kind, 1),): 1, ((1 - kind, 2),): 4} for kind in (0, 1)}
    return Kit(
        name=name,
        types=types,
        exemplars=(exemplar,),
        grammar=Grammar(rules, dockings, {}),
        contact_tolerance=0.001,
        pose_tolerance=0.01,
        contact_kinds=("point", "line", "face"),
        up="z" if KITS[name] == "z" else "y",
    )


def toy_samples(split: str, index: int, count: int) -> list[Sample]:
    """The samples of one shard, of both kits in turn."""
    samples = []
    for item in range(count):
        number = (SPLITS.index(split) * 100 + index) * 10 + item
        kit = list(KITS)[number % 2]
        # loaders take types from what they see first: shapes of one part, in which nothing touches
        length = {"train": 2, "val": 4, "test": 5}[split] + number % 2 * (split != "val")
        first = {"train": 0, "val": 1}.get(split, 0)
        assembly = chain(1, first) if index == 0 and split != "test" else chain(length, number % 2)
        lineage: dict[str, Any] = {
            "method": "toy",
            "parents": ["row"],
            "name": f"toy-{number}",
            "made_of": ["row", "row"],
            "parts_from": [1, len(assembly) - 1],
            "boundary": [0],
            "images": [0],
            "transform": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]],
            "repeats": 1,
            "deformed": False,
            "turned_degrees": 0.0,
            "copied": {"share": 1.0, "pieces": 1, "exemplar_share": 0.5, "exemplar": "row"},
            "rows": "[]",
            "restored_hubs": 0,
        }
        graph = graph_digest(assembly.types, assembly.edges)
        samples.append(Sample(f"{kit}-{number:05d}", split, "variations", kit, graph, lineage, assembly))
    return samples


REFUSED = "planks-00011"
"""The sample that the toy sketches refuse, the second of the second shard of train."""


def toy_keys(split: str, shards: int = 4) -> list[str]:
    """The keys of a split of the finished dataset, in order."""
    return [
        toy_sample.key
        for index in range(shards)
        for toy_sample in toy_samples(split, index, 2)
        if toy_sample.key != REFUSED
    ]


class ToyConfig(VariationsConfig):
    """Shards a split."""

    shards: int = 4


def _make_kit(task: Task) -> Outcome:
    with task.output(f"{task.shard.name}.json") as text, task.output(f"{task.shard.name}.tar") as arrays:
        write_kit(toy_kit(task.shard.name), text, arrays)
    return Outcome(1)


def _plan_collection(plan: Plan) -> list[Shard]:
    return [
        Shard(f"{plan.config.name}-{split}-{index:06d}", {"split": split, "index": index})
        for split in SPLITS
        for index in range(plan.config.section(ToyConfig).shards)
    ]


def _make_collection(task: Task) -> Outcome:
    split, index = task.shard.params["split"], task.shard.params["index"]
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for sample in toy_samples(split, index, 2):
            write_sample(writer, sample)
    return Outcome(2, {"split": split, "samples": 2})


def _plan_strings(plan: Plan) -> list[Shard]:
    return collection_shards(plan) if plan.config.section(StringsConfig).enabled else []


def _make_strings(task: Task) -> Outcome:
    with task.output(f"{task.shard.name}.tar") as stream, ShardWriter(stream) as writer:
        for sample in read_samples(task.input("variations", f"{task.shard.name}.tar")):
            text = "".join("AB"[kind] for kind in sample.assembly.types)
            writer.write(sample.key, {"txt": f"{text}\n{text[::-1]}\n".encode()})
    return Outcome(writer.samples)


def _make_sketches(task: Task) -> Outcome:
    config = task.config.section(SketchesConfig)

    def made(collection: Collection, sample: Sample) -> Mapping[str, bytes]:
        if sample.key == REFUSED:
            raise Rejected("blank drawing")
        return drawings(task, config, sample, scene_of(collection.shape(sample)))

    return Outcome(add_members(task, made))


def _no_bytes(_: Plan) -> int:
    return 0


TOY_STAGES: Mapping[str, Stage] = named_inputs(
    [
        *ABSENT_STAGES.values(),
        Stage(
            "exemplars", __name__, ExemplarsConfig, (), lambda _: [Shard(name) for name in KITS], _make_kit, _no_bytes
        ),
        Stage("variations", __name__, ToyConfig, ("exemplars",), _plan_collection, _make_collection, _no_bytes),
        Stage("strings", __name__, StringsConfig, (PRODUCERS,), _plan_strings, _make_strings, _no_bytes),
        POINTS,
        VALIDITY,
        ABSTRACTION,
        Stage("sketches", __name__, SketchesConfig, (PRODUCERS,), plan_sketches, _make_sketches, _no_bytes),
        VIEWS,
        SURFACE,
        CAPTIONS,
        STRUCTURE,
        EXPORTS,
        replace(PACKAGE, check=lambda _: None),
    ]
)


def toy_config(shards: int = 4) -> Config:
    """Return the config of the toy dataset with a number of shards per split."""
    sections = {
        **ABSENT_SECTIONS,
        "exemplars": ExemplarsConfig(),
        "variations": ToyConfig(shards=shards),
        "strings": StringsConfig(),
        "validity": ValidityConfig(),
        "abstraction": AbstractionConfig(),
        "points": PointsConfig(
            uniform=64, farthest=16, pool=256, clouds=2, min_per_part=4, scans=ScansConfig(points=32, depth_noise=0.01)
        ),
        "sketches": SketchesConfig(
            size=24, renderer="raster", views=(SketchView(name="left"), SketchView(name="right", azimuth=30.0))
        ),
        "views": ViewsConfig(
            cameras=(RingCameras(count=1),),
            width=32,
            height=24,
            images=("color", "depth", "instances"),
            depth_format="exr",
        ),
        "surface": SurfaceConfig(flags=True, union=True, distances=DistanceConfig(near=24, uniform=8), occupancy=8),
        "captions": CaptionsConfig(lengths=("short", "long")),
        "structure": StructureConfig(hierarchy=True, symmetry=True),
        "exports": ExportsConfig(formats=("urdf", "mjcf", "usd", "obj")),
        "package": PackageConfig(previewed=1),
    }
    return Config(
        name="toy", version="1.2.0", seed=7, sections=sections, path=Path("toy.yaml"), title="Toy boxes", license="MIT"
    )


def make_toy(out: Path, config: Config, workers: int = 1) -> Path:
    """Run every stage below `out`; the dataset's folder."""
    for name in TOY_STAGES:
        result = run_stage(name, TOY_STAGES, config, DatasetPaths(out, config.name), workers)
        assert not result.failed, result.failed
    return out / config.name
