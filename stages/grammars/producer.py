"""Stage `grammars` as a producer of samples."""

from __future__ import annotations

from stages.grammars.origins import mesh_origins
from stages.grammars.settings import GrammarsConfig
from stages.shape.collection.producer import Producer

PRODUCER = Producer(
    language="derivation",
    keys="grammars.models",
    is_requested=lambda config: bool(config.section(GrammarsConfig).models),
    sentence=lambda _: (
        "the partial symmetries of a surface in one piece make a shape grammar, whose productions and "
        "grids make shapes; a shape's derivation is its `txt`."
    ),
    origins=mesh_origins,
    limits=lambda _: (
        "Every neighbourhood of the radius of similarity is one of the surface's; seen from nearby, nothing is new.",
        "Parts are terminals of the grammar: pieces between docking sites, without a meaning.",
    ),
    splits=lambda _: (
        "No two samples look alike, within a split or across splits: the radius of similarity counts as nothing."
    ),
    graphs_share_split=lambda _: True,
)
