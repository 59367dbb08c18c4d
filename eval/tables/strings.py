"""`make eval TABLE=strings`: what string VAEs have learnt (strings §5 and Table 2)."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Chart, Evaluation, ImageRow, TableResult
from eval.engine.requirements import CORPUS, STRING_VAE
from stages.training.checkpoint import weights_of_kind

if TYPE_CHECKING:
    from eval.engine.models import TrainedModel
    from eval.strings.string_vaes import Reconstruction, Sampling
    from stages.training.string_vae.latent_graph import PathFigures
    from stages.training.string_vae.trained import TrainedStringVae


def _answer(subject: DatasetRun, asked: Namespace) -> TableResult:
    from eval.engine.models import training_curve
    from eval.engine.parallel_map import parallel_map
    from eval.strings.string_vaes import reconstruction_table, sampling_table, string_vaes, structure_table

    rebuilt, sampled, joined, lines = [], [], [], {}
    strips: list[ImageRow] = []
    models = string_vaes(subject.models)
    for each, seen in parallel_map(partial(_look_at, subject, asked.searches), models, asked.workers, "models"):
        if seen.rebuilt is not None:
            rebuilt.append((each, seen.rebuilt))
        sampled += [(each, way, figures) for way, figures in seen.sampled.items()]
        joined.append((each, seen.nodes, seen.joined))
        strips += seen.strips
        lines[each.folder] = training_curve(subject.models / each.folder, "val_nats")
    return TableResult(
        [reconstruction_table(rebuilt), sampling_table(sampled), structure_table(joined)],
        [Chart("What a string that was not learnt takes", "steps of training", "nats a string", lines)],
        strips,
    )


@dataclass(frozen=True)
class _Seen:
    """All about one model. joined: of so many nodes."""

    rebuilt: Reconstruction | None
    sampled: Mapping[str, Sampling]
    nodes: int
    joined: Mapping[str, PathFigures]
    strips: Sequence[ImageRow]


def _look_at(subject: DatasetRun, searches: int, trained: TrainedModel[TrainedStringVae]) -> _Seen:
    from eval.generated.instantiation import instantiator_of
    from eval.strings.latent_interpolation import journey_strips
    from eval.strings.string_vaes import corpus_strings, model_rng, reconstruction, sampling, shape_graphs, structure
    from stages.exemplars.language import dataset_kits
    from stages.string_sampling.instantiation.state import STANDARD_METHOD
    from stages.strings.settings import StringsConfig
    from stages.training.string_vae.latent_sampling import SAMPLING_METHODS

    model, seed, kits = trained.model, subject.config.seed, dataset_kits(subject.paths)
    train, test = (corpus_strings(subject.corpus, trained.kit, split, model) for split in ("train", "test"))
    strips: list[ImageRow] = []
    if not trained.seed and trained.kit in kits:
        maker = instantiator_of(subject, kits[trained.kit])
        method = STANDARD_METHOD._replace(whole=subject.config.section(StringsConfig).edges == "all")
        rng = model_rng(seed, trained, "journeys")
        strips += journey_strips(model, train, maker, method, trained.folder, rng)
    known = shape_graphs(model, train)
    return _Seen(
        reconstruction(model, test) if test else None,
        {way: sampling(model, way, train, known, searches, model_rng(seed, trained, way)) for way in SAMPLING_METHODS},
        *structure(model, train, model_rng(seed, trained, "structure")),
        strips,
    )


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--searches", type=int, default=1000, help="searches of each way of sampling")


TABLE = Evaluation(
    question="Do strings come back from a string VAE, and how many new shapes does each way of sampling find?",
    needs=(STRING_VAE, CORPUS),
    seconds=lambda subject: 140.0 * len(weights_of_kind(subject.models, "string_vae")),
    answer=_answer,
    options=_options,
)
