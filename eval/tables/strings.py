"""`make eval TABLE=strings`: how well do string VAEs reconstruct, sample and interpolate? (strings §5 and Table 2)"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from pydantic import Field

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Chart, Evaluation, ImageRow, TableResult
from eval.engine.requirements import CORPUS, STRING_VAE
from pipeline.config import StrictModel
from stages.training.checkpoint import weights_of_kind

if TYPE_CHECKING:
    from eval.engine.models import TrainedModel
    from eval.strings.string_vaes import Reconstruction, Sampling
    from stages.training.string_vae.latent_graph import PathFigures
    from stages.training.string_vae.trained import TrainedStringVae


class StringsOptions(StrictModel):
    """How much is sampled."""

    searches: int = Field(1000, ge=1, description="searches of each sampling method")


def _compute(run: DatasetRun, options: StringsOptions) -> TableResult:
    from eval.engine.models import training_curve
    from eval.engine.parallel_map import parallel_map
    from eval.strings.string_vaes import reconstruction_table, sampling_table, string_vaes, structure_table

    reconstructions, samplings, structures, lines = [], [], [], {}
    image_rows: list[ImageRow] = []
    measure = partial(_measure, run, options.searches)
    for trained, measured in parallel_map(measure, string_vaes(run.models), run.workers, "models"):
        if measured.reconstruction is not None:
            reconstructions.append((trained, measured.reconstruction))
        samplings += [(trained, method, sampling) for method, sampling in measured.samplings.items()]
        structures.append((trained, measured.nodes, measured.paths))
        image_rows += measured.image_rows
        lines[trained.folder] = training_curve(run.models / trained.folder, "val_nats")
    return TableResult(
        [reconstruction_table(reconstructions), sampling_table(samplings), structure_table(structures)],
        [Chart("Validation loss", "training steps", "nats per string", lines)],
        image_rows,
    )


@dataclass(frozen=True)
class _Measured:
    """The results of one model."""

    reconstruction: Reconstruction | None
    samplings: Mapping[str, Sampling]
    """By sampling method."""
    nodes: int
    """Of the latent graphs."""
    paths: Mapping[str, PathFigures]
    """By latent graph."""
    image_rows: Sequence[ImageRow]


def _measure(run: DatasetRun, searches: int, trained: TrainedModel[TrainedStringVae]) -> _Measured:
    from eval.generated.instantiation import instantiator_of
    from eval.strings.latent_interpolation import interpolation_rows
    from eval.strings.string_vaes import corpus_strings, model_rng, reconstruction, sampling, shape_graphs, structure
    from stages.exemplars.language import dataset_kits
    from stages.string_sampling.instantiation.state import STANDARD_METHOD
    from stages.strings.settings import StringsConfig
    from stages.training.string_vae.latent_sampling import SAMPLING_METHODS

    model, seed, kits = trained.model, run.config.seed, dataset_kits(run.paths)
    train, test = (corpus_strings(run.corpus, trained.kit, split, model) for split in ("train", "test"))
    test = [string for string in test if model.is_valid(model.target_of(string))]
    image_rows: list[ImageRow] = []
    if not trained.seed and trained.kit in kits:
        instantiator = instantiator_of(run, kits[trained.kit])
        method = STANDARD_METHOD._replace(whole=run.config.section(StringsConfig).edges == "all")
        rng = model_rng(seed, trained, "journeys")
        image_rows += interpolation_rows(model, train, instantiator, method, trained.folder, rng)
    known = shape_graphs(model, train)
    return _Measured(
        reconstruction(model, test) if test else None,
        {
            name: sampling(model, name, train, known, searches, model_rng(seed, trained, name))
            for name in SAMPLING_METHODS
        },
        *structure(model, train, model_rng(seed, trained, "structure")),
        image_rows,
    )


TABLE = Evaluation(
    question="Do string VAEs reconstruct strings, and how many new shapes does each sampling method find?",
    requirements=(STRING_VAE, CORPUS),
    estimate_seconds=lambda run: 140.0 * len(weights_of_kind(run.models, "string_vae")),
    compute=_compute,
    options=StringsOptions,
)
