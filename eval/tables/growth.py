"""`make eval TABLE=growth`: how many shapes and strings does the search make of its inputs? (strings Table 1)"""

from __future__ import annotations

from typing import TYPE_CHECKING

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Chart, Evaluation, ImageRow, NoOptions, TableResult
from eval.engine.requirements import KITS, SEARCH
from stages.shape.kit import Kit

if TYPE_CHECKING:
    from eval.strings.growth import SearchGrowth

GENERATIONS_SHOWN = 5


def _compute(run: DatasetRun, _: NoOptions) -> TableResult:
    from eval.strings.growth import generation_table, growth_table, measure_growth
    from stages.exemplars.language import dataset_kits
    from stages.strings.settings import StringsConfig

    config, folder = run.config.section(StringsConfig), run.paths.stage("variations").root
    kits = dataset_kits(run.paths)
    growth = {name: measure_growth(kit, folder, config, run.config.seed) for name, kit in kits.items()}
    lines = {
        name: [
            (float(generation), float(size.graphs))
            for generation, size in {0: search.inputs, **search.generations}.items()
        ]
        for name, search in growth.items()
    }
    return TableResult(
        [growth_table(growth), generation_table(growth)],
        [Chart("Distinct graphs by generation", "generation", "graphs", lines)],
        [_image_row(kit, growth[name]) for name, kit in kits.items()],
    )


def _image_row(kit: Kit, growth: SearchGrowth) -> ImageRow:
    from eval.engine.pictures import rendered_png
    from stages.shape.shape import kit_shape, upright

    exemplar = kit.exemplars[0]
    shown = [(exemplar.name, exemplar.assembly)]
    for generation in list(growth.generations)[:GENERATIONS_SHOWN]:
        first = next(variant for variant in growth.variants if variant.generation == generation)
        shown.append((f"generation {generation}, {len(first.assembly)} parts", first.assembly))
    pictures = [(caption, rendered_png(upright(kit_shape(kit, assembly)))) for caption, assembly in shown]
    return ImageRow(f"{kit.name}: an input, and the first variant of each generation", pictures)


TABLE = Evaluation(
    question="How many shapes and strings does the search make of its inputs, round by round?",
    requirements=(KITS, SEARCH),
    estimate_seconds=lambda run: 10 + 0.02 * run.samples,
    compute=_compute,
)
