"""`make eval TABLE=generated`: what is lost and what is won when a network invents? (strings §6)"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, ImageRow, Requirement, TableResult
from eval.engine.requirements import FINISHED_DATASET, KITS

SHOWN = 4
"""Pictures of each row."""
MOST = 1000


def _parents(subject: DatasetRun) -> list[str]:
    """The datasets that the models of a config have learnt from, each once."""
    from stages.string_sampling.settings import StringSamplingConfig

    return sorted({each.dataset for each in subject.config.section(StringSamplingConfig).sources})


def _dreamt(subject: DatasetRun) -> str:
    from stages.package.layout import MANIFEST

    parents = _parents(subject)
    if not parents:
        return f"{subject.config.name} was not dreamt by models; take a config with string_sampling.sources"
    gone = [each for each in parents if not (subject.out / each / MANIFEST).is_file()]
    return f"no finished dataset {gone[0]}, which its models have learnt from; make dataset of it" if gone else ""


def _answer(subject: DatasetRun, asked: Namespace) -> TableResult:
    from eval.engine.pictures import shape_picture
    from eval.generated.generated_shapes import Dream, dream_row, dreams_table, finished_shapes
    from pipeline.paths import DatasetPaths
    from stages.exemplars.language import dataset_kits
    from stages.shape.shape import kit_shape

    learnt: dict[str, list[Dream]] = {}
    for parent in _parents(subject):
        for name, each in finished_shapes(subject.out / parent, DatasetPaths(subject.out, parent), ("train",)):
            if len(known := learnt.setdefault(name, [])) < asked.dreams:
                known.append(each)
    dreamt: dict[str, list[Dream]] = {}
    for name, each in finished_shapes(subject.folder, subject.paths, ("train", "val", "test")):
        if len(made := dreamt.setdefault(name, [])) < asked.dreams:
            made.append(each)
    rows, strips = [], []
    for name, kit in dataset_kits(subject.paths).items():
        groups = {f"{name}, learnt": learnt.get(name, []), f"{name}, dreamt": dreamt.get(name, [])}
        base = groups[f"{name}, learnt"]
        for title, shapes in groups.items():
            if shapes:
                rows.append(dream_row(title, kit, shapes, base))
                shown = shapes[:: -(-len(shapes) // SHOWN)]
                pictures = [
                    (f"{len(each.assembly)} parts", shape_picture(kit_shape(kit, each.assembly))) for each in shown
                ]
                strips.append(ImageRow(title, pictures))
    return TableResult([dreams_table(rows)], strips=strips)


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--dreams", type=int, default=MOST, help="shapes of a row of dreams at most")


TABLE = Evaluation(
    question="What is lost and what is won when a network invents shapes, beside those that it has learnt from?",
    needs=(FINISHED_DATASET, KITS, Requirement("dreamt samples and what they were learnt from", _dreamt)),
    seconds=lambda subject: 20 + 0.01 * subject.samples,
    answer=_answer,
    options=_options,
)
