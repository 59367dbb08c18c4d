"""The stage `shapeassembly` as a producer of samples."""

from __future__ import annotations

from stages.shape.collection.producer import Producer
from stages.shapeassembly.origins import program_origins
from stages.shapeassembly.settings import ShapeAssemblyConfig

PRODUCER = Producer(
    language="shapeassembly",
    keys="shapeassembly.programs, hierarchies or sampled",
    is_requested=lambda config: config.section(ShapeAssemblyConfig).has_sources,
    sentence="ShapeAssembly programs are executed; a shape's program is its `txt`.",
    origins=program_origins,
    limits=("All parts are cuboids.",),
    splits="Programs that differ only in their numbers are in one split.",
    graphs_share_split=True,
)
