"""`make eval TABLE=recovery_baselines`: kinds of network outputs, at equal training (geocode Table 3)."""

from __future__ import annotations

from pydantic import Field

from eval.engine.dataset_run import DatasetRun
from eval.engine.evaluation import Evaluation, TableResult
from eval.engine.requirements import RECOVERY
from pipeline.config import StrictModel
from stages.training.checkpoint import weights_of_kind


class RecoveryBaselinesOptions(StrictModel):
    """How much is recovered."""

    shapes: int = Field(100, ge=1, description="shapes recovered by each model")


def _compute(run: DatasetRun, options: RecoveryBaselinesOptions) -> TableResult:
    from eval.recovery.methods import apply_method, held_out, methods
    from eval.recovery.tables import baselines_table
    from pipeline.randomness import decision_rng
    from stages.training.recovery.trained import load_recovery

    rows, steps, seed = [], {}, run.config.seed
    models = {path: load_recovery(path) for path in weights_of_kind(run.models, "recovery")}
    # the model that is no baseline comes first: the others are compared with it
    for path, model in sorted(models.items(), key=lambda pair: pair[1].entry.is_baseline):
        estimate = methods(model, 1, seed)["network"]
        rng = decision_rng(seed, "recovery", model.program.name)
        for name, shapes, inputs in held_out(model, options.shapes, rng):
            label = f"{path.parent.name}, {name}"
            rows.append(apply_method(label, model.program, estimate, shapes, inputs))
            steps[label] = model.entry.steps * model.entry.max_rounds
    return TableResult([baselines_table(rows, steps)])


TABLE = Evaluation(
    question="Do class outputs, the existence label and a single network recover shapes better than the alternatives?",
    requirements=(RECOVERY,),
    estimate_seconds=lambda run: 60.0 * len(weights_of_kind(run.models, "recovery")),
    compute=_compute,
    options=RecoveryBaselinesOptions,
)
