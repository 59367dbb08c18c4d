"""`make eval TABLE=instantiation`: how many graphs become shapes? (strings §6, figures 8 and 9)"""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from typing import get_args

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, ImageRow, TableResult
from eval.engine.requirements import CORPUS, KITS
from stages.string_sampling.settings import SamplingMethod

SHOWN = 4
"""Pictures of what each model dreamt."""
WARMING = 8
"""Graphs that are put together before anybody looks at a clock: contacts are learnt first."""


def _answer(subject: DatasetRun, asked: Namespace) -> TableResult:
    from eval.engine.pictures import shape_picture
    from eval.generated.instantiation import (
        DRAWS,
        METHODS,
        Attempt,
        attempts,
        distinct_graphs,
        dream_rng,
        edge_categories,
        guides_of,
        instantiator_of,
        methods_table,
        outcome_table,
    )
    from eval.strings.string_vaes import string_vaes
    from stages.exemplars.language import dataset_kits
    from stages.shape.graphs.canonical import graph_digest
    from stages.shape.shape import kit_shape
    from stages.string_sampling.repair import repair_strings
    from stages.strings.alphabet import make_alphabet
    from stages.strings.decoder import decode
    from stages.training.string_vae.latent_sampling import sample

    outcomes: list[tuple[str, Sequence[Attempt]]] = []
    compared: list[tuple[str, str, Sequence[Attempt]]] = []
    strips: list[ImageRow] = []
    models, seed = [each for each in string_vaes(subject.models) if each.seed == 0], subject.config.seed
    for name, kit in dataset_kits(subject.paths).items():
        train, test = (_lines(subject, name, split) for split in ("train", "test"))
        if not test:
            continue
        maker, alphabet = instantiator_of(subject, kit), make_alphabet(kit.labels)
        limits = {"budget": asked.parts, "whole": _tells_all(subject, name)}
        standard = METHODS["all steps"]._replace(**limits)
        unseen = distinct_graphs(test, alphabet, asked.instantiated)
        attempts(maker, unseen[:WARMING], standard, seed)
        for title, method in METHODS.items():
            compared.append((name, title, attempts(maker, unseen, method._replace(**limits), seed)))
        outcomes.append((f"{name}, unseen variations", compared[-len(METHODS)][2]))
        for learnt in edge_categories(subject.models, kit):
            found = attempts(maker, unseen, standard, seed, guides_of(learnt.model, unseen))
            compared.append((name, f"all steps, guided by {learnt.name}", found))
        known = {graph_digest(each.types, each.edges) for each in (decode(line, alphabet) for line in train)}
        for trained in [each for each in models if each.kit == name]:
            learnt_from = [line for line in train if trained.model.is_valid(line)]
            rng = dream_rng(seed, trained.folder)
            drawn = sample(trained.model, asked.way, learnt_from, DRAWS * asked.instantiated, rng)
            mends = repair_strings(trained.model, drawn[: asked.instantiated], maker, standard, asked.mends, seed)
            tried: list[Attempt] = []
            for title, strings in (
                ("new graphs of", [each.string for each in drawn]),
                ("new graphs, repair_strings, of", mends),
            ):
                written = [each for each in strings if each is not None]
                dreamt = distinct_graphs(written, alphabet, asked.instantiated, known)
                if dreamt:
                    tried = attempts(maker, dreamt, standard, seed)
                    outcomes.append((f"{name}, {title} {trained.name}", tried))
            good = [each.assembly for each in tried if each.good and each.assembly is not None]
            pictures = [(f"{len(each)} parts", shape_picture(kit_shape(kit, each))) for each in good[:SHOWN]]
            strips.append(ImageRow(f"What {trained.folder} dreamt", pictures))
    return TableResult([outcome_table(outcomes), methods_table(compared)], strips=strips)


def _lines(subject: DatasetRun, kit: str, split: str) -> list[str]:
    path = subject.corpus / f"{kit}-{split}.txt"
    return path.read_text().splitlines() if path.is_file() else []


def _tells_all(subject: DatasetRun, kit: str) -> bool:
    """Whether the strings of a kit tell of all contacts."""
    vocabulary = json.loads((subject.corpus / "vocabulary.json").read_bytes())
    return bool(vocabulary[kit]["edges"] == "all")


def _seconds(subject: DatasetRun) -> float:
    kits, models = (len(list(folder)) for folder in (subject.corpus.glob("*-test.txt"), subject.models.glob("*")))
    return 30.0 + 90.0 * kits + 150.0 * models


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--instantiated", type=int, default=100, help="graphs of each kit and each model")
    parser.add_argument(
        "--way", choices=get_args(SamplingMethod), default="gaussian", help="as in string_sampling.sources"
    )
    parser.add_argument("--mends", type=int, default=24, help="as in synthesis")
    parser.add_argument("--parts", type=int, default=4000, help="parts put down at most for a graph")


TABLE = Evaluation(
    question="How many graphs become shapes, and what is each step on the way worth?",
    needs=(KITS, CORPUS),
    seconds=_seconds,
    answer=_answer,
    options=_options,
)
