"""`make eval TABLE=recovery_baselines`: ways in which a network may answer, at equal training (geocode Table 3)."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, TableResult
from eval.engine.requirements import RECOVERY
from stages.training.checkpoint import weights_of_kind


def _answer(subject: DatasetRun, asked: Namespace) -> TableResult:
    from eval.recovery.accuracy import baselines_table, held_out, methods, tried
    from pipeline.randomness import decision_rng
    from stages.training.recovery.trained import load_recovery

    rows, steps, seed = [], {}, subject.config.seed
    paths = {path: load_recovery(path) for path in weights_of_kind(subject.models, "recovery")}
    # what is no baseline first, with which the others are compared
    for path, model in sorted(paths.items(), key=lambda each: each[1].entry.is_baseline):
        guess = methods(model, 1, seed)["network"]
        for name, shapes, inputs in held_out(model, asked.compared, decision_rng(seed, "recovery", model.program.name)):
            label = f"{path.parent.name}, {name}"
            rows.append(tried(label, model.program, guess, shapes, inputs))
            steps[label] = model.entry.steps * model.entry.max_rounds
    return TableResult([baselines_table(rows, steps)])


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("--compared", type=int, default=100, help="shapes that are recovered by each model")


TABLE = Evaluation(
    question="Do classes recover better than values, with the existence label than without, one network than two?",
    needs=(RECOVERY,),
    seconds=lambda subject: 60.0 * len(weights_of_kind(subject.models, "recovery")),
    answer=_answer,
    options=_options,
)
