"""`make eval TABLE=strings`: what string VAEs have learnt (strings §5 and Table 2)."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from eval.evaluation import Answer, Curve, Evaluation, Strip
from eval.needs import CORPUS, STRING_VAE
from eval.subject import Subject
from stages.training.checkpoint import weights_of_kind

__all__ = ["TABLE"]


def _answer(subject: Subject, asked: Namespace) -> Answer:
    from eval.journeys import journey_strips
    from eval.models import training_curve
    from eval.strings import (
        corpus_strings,
        model_rng,
        reconstruction,
        reconstruction_table,
        sampling,
        sampling_table,
        string_vaes,
        structure,
        structure_table,
    )
    from stages.exemplars.language import made_kits
    from stages.strings.settings import StringsConfig
    from stages.synthesis.instantiation.instantiate import Instantiator
    from stages.synthesis.instantiation.layout import STANDARD
    from stages.training.string_vae.sampling import WAYS
    from stages.variations.kernels.answers import ContactAnswers

    rebuilt, sampled, joined, lines, seed = [], [], [], {}, subject.config.seed
    strips: list[Strip] = []
    kits, whole = made_kits(subject.places), subject.config.section(StringsConfig).edges == "all"
    for each in string_vaes(subject.models):
        train, test = (corpus_strings(subject.corpus, each.kit, split, each.model) for split in ("train", "test"))
        if test:
            rebuilt.append((each, reconstruction(each.model, test)))
        for way in WAYS:
            rng = model_rng(seed, each, way)
            sampled.append((each, way, sampling(each.model, way, train, asked.searches, rng)))
        joined.append((each, *structure(each.model, train, model_rng(seed, each, "structure"))))
        if not each.seed and each.kit in kits:
            maker = Instantiator(ContactAnswers(kits[each.kit]))
            rng = model_rng(seed, each, "journeys")
            strips += journey_strips(each.model, train, maker, STANDARD._replace(whole=whole), each.folder, rng)
        lines[each.folder] = training_curve(subject.models / each.folder, "val_nats")
    return Answer(
        [reconstruction_table(rebuilt), sampling_table(sampled), structure_table(joined)],
        [Curve("What a string that was not learnt takes", "steps of training", "nats a string", lines)],
        strips,
    )


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--searches", type=int, default=1000, help="searches of each way of sampling")


TABLE = Evaluation(
    question="Do strings come back from a string VAE, and how many new shapes does each way of sampling find?",
    needs=(STRING_VAE, CORPUS),
    seconds=lambda subject: 530.0 * len(weights_of_kind(subject.models, "string_vae")),
    answer=_answer,
    options=_options,
)
