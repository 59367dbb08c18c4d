"""The paper's figures of what models of ShapeAssembly programs write, as sheets of pictures (shapeassembly §7)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from statistics import fmean
from typing import Any

import numpy as np

from eval.engine.evaluation import Figure
from eval.engine.models import TrainedModel
from eval.engine.pictures import PICTURE_SIZE, shape_portrait
from eval.engine.table import Cell as TableCell
from eval.engine.table import Table
from eval.programs.nearest import nearest_and_which, nearest_programs
from eval.programs.quality import boxes_of_programs, clouds_of, shape_of_boxes
from stages.shape.arrays import ByteArray, FloatArray
from stages.shape.views.portrait import PAPER
from stages.shape.views.sheet import Cell, Section, contact_sheet, picture_png
from stages.shapeassembly.analysis.structure import signature
from stages.shapeassembly.editing.edits import edit_program
from stages.shapeassembly.execution.interpreter import execute
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.part_graph_vae.trained import TrainedPartGraphVae
from stages.training.program_vae.trained import TrainedProgramVae

WIDTH = 200
"""Of a picture on a sheet; unit: pixels."""

SPREAD = 0.25
"""How far the variants of figure 8 go (`shapeassembly.programs.log_std`)."""

STOPS = 5
"""Shapes between the two ends of a way."""


def sheet_of(name: str, title: str, rows: Mapping[str, Sequence[tuple[str, ByteArray]]]) -> Figure:
    """Rows of pictures with captions, under their names."""
    sections = [Section(head, [[Cell(picture, caption) for caption, picture in row]]) for head, row in rows.items()]
    return Figure(name, title, picture_png(contact_sheet(sections, title, WIDTH)))


def neighbours(
    name: str, category: str, programs: Sequence[AssemblyProgram], train: Sequence[AssemblyProgram], clouds: FloatArray
) -> tuple[Figure, tuple[TableCell, ...]]:
    """Figure 7: programs that a model wrote, above each the shape of train that is nearest by Chamfer distance, below
    the one whose program is. clouds: of train. And what the table says of them."""
    boxes = boxes_of_programs(programs)
    distances, places = nearest_and_which(clouds_of(boxes), clouds, False)
    nearest = nearest_programs(programs, train)
    by_shape = boxes_of_programs([train[place] for place in places.tolist()])
    by_program = boxes_of_programs([train[place] for _, place in nearest])
    known = {signature(each) for each in train}
    rows = {
        "Nearest of train by Chamfer distance": [
            (f"{apart:.3f}", drawn(each)) for apart, each in zip(distances.tolist(), by_shape, strict=True)
        ],
        f"Written by {name}": [
            (f"{len(each)} parts" + ("" if signature(program) in known else ", new structure"), drawn(each))
            for program, each in zip(programs, boxes, strict=True)
        ],
        "Nearest of train by the words of its program": [
            (f"edit distance {words}", drawn(each)) for (words, _), each in zip(nearest, by_program, strict=True)
        ],
    }
    novel = fmean(signature(each) not in known for each in programs)
    cells = (name, len(programs), float(distances.mean()), fmean(words for words, _ in nearest), 100 * novel)
    return sheet_of(f"figure7_{name}", f"Figure 7, {category}: beside what was learnt", rows), cells


def neighbours_table(rows: Sequence[tuple[TableCell, ...]]) -> Table:
    """Of the samples that figure 7 shows."""
    notes = (
        "Means over the samples that are shown: Chamfer distance to the nearest shape of train, words that differ from "
        "the nearest program of train; new: percent of structures that train has not.",
    )
    return Table("Samples beside their nearest of train", ("samples of", "shown", "shape", "program", "new %"),
                 tuple(rows), notes)  # fmt: skip


def edits_sheet(name: str, category: str, programs: Sequence[AssemblyProgram], rng: np.random.Generator) -> Figure:
    """Figure 8: programs that a model wrote, below each a variant with other numbers and the same structure."""
    variants = [edit_program(each, SPREAD, rng) for each in programs]
    rows = {
        f"Written by {name}": [("", drawn(each)) for each in boxes_of_programs(programs)],
        "The same program with other sizes and places": [("", drawn(each)) for each in boxes_of_programs(variants)],
    }
    return sheet_of(f"figure8_{name}", f"Figure 8, {category}: edits of continuous parameters", rows)


def beside_sheet(category: str, samples: Mapping[str, Sequence[Sequence[Box]]]) -> Figure:
    """Figure 9: samples of each model, one row a model."""
    rows = {name: [(f"{len(each)} parts", drawn(each)) for each in found] for name, found in samples.items()}
    return sheet_of(f"figure9_{category}", f"Figure 9, {category}: models beside each other, samples not chosen", rows)


def journey_sheet(
    category: str, models: Sequence[TrainedModel[Any]], pairs: Sequence[tuple[AssemblyProgram, AssemblyProgram]]
) -> Figure:
    """Figure 12: on a straight way through the latent space of each model from one shape to another, each of val."""
    rows = {}
    for number, (first, last) in enumerate(pairs, 1):
        for each in models:
            between = _between(each.model, first, last)
            ends = [drawn(found) for found in boxes_of_programs([first, last])]
            stops = [(f"{len(found)} parts", drawn(found)) if found else ("no shape", _blank()) for found in between]
            rows[f"{number}. {each.folder}"] = [("source", ends[0]), *stops, ("target", ends[1])]
    return sheet_of(f"figure12_{category}", f"Figure 12, {category}: ways through latent spaces", rows)


def _between(
    model: TrainedProgramVae | TrainedPartGraphVae, first: AssemblyProgram, last: AssemblyProgram
) -> Iterator[Sequence[Box] | None]:
    """The cuboids at STOPS points between two programs; None where there is no shape."""
    shares = np.linspace(0, 1, STOPS + 2, dtype=np.float32)[1:-1, None]
    if isinstance(model, TrainedPartGraphVae):
        start, end = model.encode([execute(first), execute(last)])
        yield from (each or None for each in model.decode(start + shares * (end - start)))
        return
    start, end = model.encode([first, last])
    for program in model.decode(start + shares * (end - start), reject=False):
        yield boxes_of_programs([program])[0] if program else None


def drawn(boxes: Sequence[Box]) -> ByteArray:
    """The portrait of some cuboids."""
    return shape_portrait(shape_of_boxes(boxes))


def _blank() -> ByteArray:
    return np.full((*PICTURE_SIZE[::-1], 3), PAPER, np.uint8)
