"""The language of grammars: a sample is a derivation, and its shape consists of the derived terminals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.config import Config
from pipeline.paths import DatasetPaths
from pipeline.stage import Plan, Task
from stages.grammars.derived_shape import exemplar_shape, shape_of_derivation_text
from stages.grammars.files import load_grammar, load_grammars
from stages.grammars.grammar import ShapeGrammar
from stages.grammars.settings import GrammarsConfig
from stages.shape.arrays import IntArray
from stages.shape.collection.language import Language, RebuildShape, Source
from stages.shape.sample import Sample
from stages.shape.shape import Shape, upright


class DerivationDecoder:
    """Decodes derivations by the grammars of a shard."""

    def __init__(self, grammars: Mapping[str, ShapeGrammar]) -> None:
        self._grammars = grammars
        self.sources = {name: _source(grammar) for name, grammar in grammars.items()}

    def shape(self, sample: Sample) -> Shape:
        """Return the derived shape. Raises DerivationError for a text that is no derivation of its grammar."""
        return shape_of_derivation_text(self._grammars[sample.kit], sample.text)

    def shown(self, count: int) -> Sequence[tuple[str, Shape]]:
        """Return at most `count` exemplars with their names."""
        return [(name, exemplar_shape(grammar)) for name, grammar in self._grammars.items()][:count]


def _source(grammar: ShapeGrammar) -> Source:
    colors = [np.median(mesh.face_colors, axis=0).astype(np.uint8).tolist() for mesh in grammar.meshes]
    made_of = f"{len(grammar.exemplar.faces):,} {grammar.made_of}"
    return Source(
        grammar.labels,
        tuple((red, green, blue) for red, green, blue in colors),
        f"{made_of}, {len(grammar.productions)} productions, {len(grammar.grids)} grids",
    )


def grammar_shards(config: Config) -> list[str]:
    """Return the shards of stage `grammars` that hold a grammar each, in the order of the config."""
    return [model.name for model in config.section(GrammarsConfig).models]


def drawing_name(dataset: str) -> str:
    """Return the name of the shard that samples the shapes of a dataset."""
    return f"{dataset}-drawing"


def input_grammars(task: Task) -> dict[str, ShapeGrammar]:
    """Return the grammars among the inputs of a shard, by name."""
    return {
        name: load_grammar(task.input("grammars", f"{name}.json"), task.input("grammars", f"{name}.tar"))
        for name in grammar_shards(task.config)
    }


def _reads(plan: Plan) -> tuple[str, ...]:
    return tuple(f"grammars/{name}" for name in grammar_shards(plan.config))


def _rebuild(paths: DatasetPaths) -> RebuildShape:
    grammars = load_grammars(paths)

    def shape(record: Mapping[str, Any], _: IntArray) -> Shape:
        if record["kit"] not in grammars:
            raise LookupError(f"grammar {record['kit']} is missing in the dataset's .work folder")
        return upright(shape_of_derivation_text(grammars[record["kit"]], record["text"]))

    return shape


LANGUAGE = Language(
    name="derivation",
    reads=_reads,
    decoder=lambda task: DerivationDecoder(input_grammars(task)),
    graphs=False,
    text="Its derivation in the grammar: productions within productions, `S1(B1(B0))`, or a grid and its numbers of "
    "cells, `G1[5,4]`.",
    rebuild=_rebuild,
    coordinates="The unit is that of the model file, and so is the origin. The origin of a mesh is the middle of the "
    "box around the terminal.",
)
