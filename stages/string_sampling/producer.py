"""What stage `string_sampling` says of itself as a producer of samples."""

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
    """For each model what it drew, what of it became shapes, and why the rest did not."""
    config = plan.config.section(StringSamplingConfig)
    found = {}
    for number, source in enumerate(config.sources):
        model = model_rounds(plan, number, source)
        refused: Counter[str] = Counter()
        for lane in model.lanes:
            refused.update(plan.rejects("string_sampling", lane))
        begun = plan.summary("string_sampling", model.shards[0].name) or {"weights": "", "graphs": 0}
        found[f"{source.dataset}/{source.model}-{source.kit}-{source.seed} {source.way}"] = {
            "weights": begun["weights"],
            "learnt": begun["graphs"],
            "drawn": len(model.pools) * config.lanes * config.draws,
            "shapes": sum(each["new"] for each in model.pools),
            "refused": dict(sorted(refused.items())),
        }
    return found


def _card(plan: Plan) -> Sequence[str]:
    rows = ["| model | weights | graphs it learnt from | draws | new shapes |", "|---|---|---:|---:|---:|"]
    rows += [
        f"| {name} | `{each['weights'][:12]}…` | {each['learnt']:,} | {each['drawn']:,} | {each['shapes']:,} |"
        for name, each in _measures(plan).items()
    ]
    return ["\n".join(rows)]


def _lineage(_: Config) -> Mapping[str, RecordField]:
    text = {"type": "string", "minLength": 1}
    return {
        "model": RecordField(
            {**text, "description": "dataset that the model was trained on, and the model's folder there"}
        ),
        "weights": RecordField({"type": "string", "pattern": "^[0-9a-f]{64}$", "description": "sha256 of its weights"}),
        "way": RecordField({**text, "description": "how the point of the latent space was found"}),
        "string": RecordField({**text, "description": "what the model wrote there"}),
        "tries": RecordField(
            {
                "type": "integer",
                "minimum": 1,
                "description": "parts that were put down until the string was a shape; at least the number of parts",
            }
        ),
        "known": RecordField(
            {
                "enum": ["new", "train", "exemplar"],
                "description": "whether the model has learnt from a shape of this graph, or an exemplar has it",
            }
        ),
    }


PRODUCER = Producer(
    language="kit",
    keys="string_sampling.sources",
    asked=lambda config: bool(config.section(StringSamplingConfig).sources),
    sentence="models that have learnt the strings of other shapes write new ones; each is put together part by part at "
    "the dockings of its kit, and kept where the contacts, found anew from the meshes, the neighbourhoods and the "
    "dockings are as the exemplars show them.",
    splits="No two samples have the same shape graph. Near relatives may stand in different splits.",
    graphs_share_split=True,
    lineage=_lineage,
    origins=lambda plan: exemplar_origins(plan.config),
    limits=(
        "All parts are those of the exemplars, and they meet only as parts meet there.",
        "A model writes what is like what it has learnt from: that of another dataset of the same kits, whose splits "
        "are not those of this one.",
    ),
    card=_card,
    measures=_measures,
)
