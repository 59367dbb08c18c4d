"""Stage `grammars` as a producer of samples."""

from __future__ import annotations

from stages.grammars.origins import mesh_origins
from stages.grammars.settings import GrammarsConfig
from stages.shape.collection.producer import Producer

PRODUCER = Producer(
    language="derivation",
    keys="grammars.models",
    is_requested=lambda config: bool(config.section(GrammarsConfig).models),
    sentence="the partial symmetries of a mesh in one piece make a shape grammar, whose productions and grids make "
    "shapes; a shape's derivation is its `txt`.",
    origins=mesh_origins,
    limits=(
        "Every neighbourhood of the radius of similarity is one of the mesh's; seen from nearby, nothing is new.",
        "Parts are terminals of the grammar: pieces between docking sites, without a meaning.",
    ),
    splits="No two samples look alike, within a split or across splits: the radius of similarity counts as nothing.",
    graphs_share_split=True,
)
