"""The language of grammars: a sample is a derivation, and its shape is the terminals that this puts where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.config import Config
from pipeline.paths import DatasetPaths
from pipeline.stage import Plan, Task
from stages.grammars.derivation_text import exemplar_shape, shape_of_text
from stages.grammars.files import load_grammar, load_grammars
from stages.grammars.grammar import ShapeGrammar
from stages.grammars.settings import GrammarsConfig
from stages.shape.arrays import IntArray
from stages.shape.collection.language import Language, RebuildShape, Source
from stages.shape.sample import Sample
from stages.shape.shape import Shape, upright


class Derivations:
    """The grammars that a shard reads."""

    def __init__(self, grammars: Mapping[str, ShapeGrammar]) -> None:
        self._grammars = grammars
        self.sources = {name: _source(each) for name, each in grammars.items()}

    def shape(self, sample: Sample) -> Shape:
        """What the derivation makes. Raises DerivationError for a text that is none of its grammar."""
        return shape_of_text(self._grammars[sample.kit], sample.text)

    def shown(self, count: int) -> Sequence[tuple[str, Shape]]:
        """The exemplars."""
        return [(name, exemplar_shape(each)) for name, each in self._grammars.items()][:count]


def _source(grammar: ShapeGrammar) -> Source:
    colors = [np.median(each.face_colors, axis=0).astype(np.uint8).tolist() for each in grammar.meshes]
    return Source(
        grammar.labels,
        tuple((red, green, blue) for red, green, blue in colors),
        f"one mesh, {len(grammar.productions)} rules, {len(grammar.grids)} grids",
    )


def grammar_shards(config: Config) -> list[str]:
    """The shards of stage `grammars` that hold a grammar each, in the order of the config."""
    return [each.name for each in config.section(GrammarsConfig).models]


def drawing_name(dataset: str) -> str:
    """The shard that draws the shapes of a dataset, and shares them out."""
    return f"{dataset}-drawing"


def input_grammars(task: Task) -> dict[str, ShapeGrammar]:
    """The grammars among the inputs of a shard, by name."""
    return {
        name: load_grammar(task.input("grammars", f"{name}.json"), task.input("grammars", f"{name}.tar"))
        for name in grammar_shards(task.config)
    }


def _reads(plan: Plan) -> tuple[str, ...]:
    return tuple(f"grammars/{name}" for name in grammar_shards(plan.config))


def _anew(places: DatasetPaths) -> RebuildShape:
    grammars = load_grammars(places)

    def shape(record: Mapping[str, Any], _: IntArray) -> Shape:
        if record["kit"] not in grammars:
            raise LookupError(f"grammar {record['kit']} is not beside the dataset in .work")
        return upright(shape_of_text(grammars[record["kit"]], record["text"]))

    return shape


LANGUAGE = Language(
    name="derivation",
    reads=_reads,
    decoder=lambda task: Derivations(input_grammars(task)),
    graphs=False,
    text="Its derivation in the grammar: productions within productions, `S1(B1(B0))`, or a grid and its numbers of "
    "cells, `G1[5,4]`.",
    rebuild=_anew,
    coordinates="The unit is that of the model file, and so is the origin. The origin of a mesh is the middle of the "
    "box around the terminal.",
)
