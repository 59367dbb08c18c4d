"""`make eval TABLE=growth`: how many shapes and strings come of so few inputs? (strings Table 1)"""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Chart, Evaluation, ImageRow, TableResult
from eval.engine.requirements import KITS, SEARCH
from stages.shape.kit import Kit

if TYPE_CHECKING:
    from eval.strings.growth import Grown

GENERATIONS = 5
"""So many generations of each kit are drawn at most."""


def _answer(subject: DatasetRun, _: Namespace) -> TableResult:
    from eval.strings.growth import generation_table, grown, growth_table
    from stages.exemplars.language import dataset_kits
    from stages.strings.settings import StringsConfig

    strings, folder = subject.config.section(StringsConfig), subject.paths.stage("variations").root
    kits = dataset_kits(subject.paths)
    found = {name: grown(kit, folder, strings, subject.config.seed) for name, kit in kits.items()}
    lines = {
        name: [(0.0, float(each.inputs.graphs)), *((float(n), float(s.graphs)) for n, s in each.generations.items())]
        for name, each in found.items()
    }
    return TableResult(
        [growth_table(found), generation_table(found)],
        [Chart("Distinct graphs, generation by generation", "generation", "graphs", lines)],
        [_strip(kit, found[name]) for name, kit in kits.items()],
    )


def _strip(kit: Kit, found: Grown) -> ImageRow:
    """An input, and the first find of each generation."""
    from eval.engine.pictures import shape_picture
    from stages.shape.shape import kit_shape, upright

    exemplar = kit.exemplars[0]
    shown = [(exemplar.name, exemplar.assembly)]
    for number in list(found.generations)[:GENERATIONS]:
        first = next(each for each in found.finds if each.generation == number)
        shown.append((f"generation {number}, {len(first.assembly)} parts", first.assembly))
    pictures = [(said, shape_picture(upright(kit_shape(kit, assembly)))) for said, assembly in shown]
    return ImageRow(f"{kit.name}: an input, and the first of each generation", pictures)


TABLE = Evaluation(
    question="How many shapes and strings does a search make of so few inputs, iteration by iteration?",
    needs=(KITS, SEARCH),
    seconds=lambda subject: 10 + 0.02 * subject.samples,
    answer=_answer,
)
