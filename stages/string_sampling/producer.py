"""Stage `string_sampling` as a producer of samples."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.config import Config
from pipeline.stage import Plan
from stages.exemplars.origins import exemplar_origins
from stages.shape.collection.members import RecordField
from stages.shape.collection.producer import Producer
from stages.string_sampling.rounds import model_rounds
from stages.string_sampling.settings import StringSamplingConfig


def _measures(plan: Plan) -> Mapping[str, Any]:
    """Return the draws, shapes and rejects of each model."""
    config = plan.config.section(StringSamplingConfig)
    measures = {}
    for number, source in enumerate(config.sources):
        model = model_rounds(plan, number, source)
        rejected: Counter[str] = Counter()
        for worker in model.workers:
            rejected.update(plan.rejects("string_sampling", worker))
        brought = plan.summary("string_sampling", model.shards[0].name) or {"weights": "", "graphs": 0}
        measures[f"{source.dataset}/{source.model}-{source.kit}-{source.seed} {source.sampling}"] = {
            "weights": brought["weights"],
            "training_graphs": brought["graphs"],
            "drawn": len(model.pools) * config.parallel_searches * config.draws,
            "shapes": sum(pool["new"] for pool in model.pools),
            "rejected": dict(sorted(rejected.items())),
        }
    return measures


def _card(plan: Plan) -> Sequence[str]:
    rows = ["| model | weights | training graphs | draws | new shapes |", "|---|---|---:|---:|---:|"]
    rows += [
        f"| {name} | `{measured['weights'][:12]}…` | {measured['training_graphs']:,} | {measured['drawn']:,} "
        f"| {measured['shapes']:,} |"
        for name, measured in _measures(plan).items()
    ]
    return ["\n".join(rows)]


def _lineage(_: Config) -> Mapping[str, RecordField]:
    text = {"type": "string", "minLength": 1}
    return {
        "model": RecordField(
            {**text, "description": "dataset that the model was trained on, and the model's folder there"}
        ),
        "weights": RecordField({"type": "string", "pattern": "^[0-9a-f]{64}$", "description": "sha256 of its weights"}),
        "sampling": RecordField({**text, "description": "how the latent point was chosen"}),
        "string": RecordField({**text, "description": "string decoded there"}),
        "placements": RecordField(
            {
                "type": "integer",
                "minimum": 1,
                "description": "parts placed until the string was a shape; at least the number of parts",
            }
        ),
        "novelty": RecordField(
            {
                "enum": ["new", "train", "exemplar"],
                "description": "new, or a graph of a training shape or an exemplar",
            }
        ),
    }


PRODUCER = Producer(
    language="kit",
    keys="string_sampling.sources",
    is_requested=lambda config: bool(config.section(StringSamplingConfig).sources),
    sentence=lambda _: (
        "models trained on the strings of other shapes generate new strings. Each is instantiated part by part "
        "with the dockings of its kit, and kept if its contacts, computed from the meshes, its neighbourhoods and "
        "its dockings are those of the exemplars."
    ),
    splits=lambda _: "No two samples have the same shape graph. Similar shapes may be in different splits.",
    graphs_share_split=lambda _: True,
    lineage=_lineage,
    origins=lambda plan: exemplar_origins(plan.config),
    limits=lambda _: (
        "All parts are those of the exemplars, and they dock as parts do there.",
        "A model generates shapes like its training shapes, which are of another dataset with other splits.",
    ),
    card=_card,
    measures=_measures,
)
