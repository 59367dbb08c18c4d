"""What stage `variations` says of itself as a producer of samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.config import Config
from pipeline.stage import Plan
from stages.exemplars.origins import exemplar_origins
from stages.exemplars.resolved_table import resolved_table
from stages.exemplars.settings import ExemplarsConfig
from stages.shape.collection.members import RecordField
from stages.shape.collection.producer import Producer
from stages.variations.report.measures import measure_table
from stages.variations.report.split_report import splits_table
from stages.variations.settings import VariationsConfig


def _measures(plan: Plan) -> Mapping[str, Any]:
    """What the variants of each kit are worth."""
    summary = plan.summary("variations", f"{plan.config.name}-assignment")
    return dict(summary["kits"]) if summary is not None else {}


def _splits(plan: Plan) -> Sequence[str]:
    measures = _measures(plan)
    return [splits_table(measures)] if measures else []


def _variety(plan: Plan) -> Sequence[str]:
    measures = _measures(plan)
    return [measure_table(measures)] if measures else []


def _endings(plan: Plan) -> Sequence[str]:
    """How the search of each kit ended, in words, from the summaries of its last pool."""
    summaries = [plan.summary("variations", shard) or {} for shard in plan.shards("variations")]
    ended = [
        f"- {each['why']}; {each['graphs']:,} distinct graphs, {each['histograms']:,} distinct histograms."
        + (f" What limits it: {each['advice']}." if each["advice"] else "")
        + (f" What was left out: {each['left']}." if each["left"] else "")
        + (f" Resized: {_listed(each['resized'])}." if each["resized"] else "")
        for each in summaries
        if each.get("why")
    ]
    return ["\n".join(ended)] if ended else []


def _listed(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{count:,} ({reason})" for reason, count in counts.items())


def _made(plan: Plan) -> Sequence[str]:
    return [*resolved_table(plan), *_endings(plan)]


def _lineage(_: Config) -> Mapping[str, RecordField]:
    whole = {"type": "integer", "minimum": 0}
    share = {"type": "number", "exclusiveMinimum": 0, "maximum": 1}
    places = {"type": "array", "items": whole, "minItems": 1}
    row = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
    return {
        "name": RecordField({"type": "string", "minLength": 1, "description": "what the search calls it"}),
        "made_of": RecordField(
            {
                "type": "array",
                "items": {"type": "string", "minLength": 1},
                "minItems": 1,
                "description": "the two shapes that pieces were exchanged of, exemplars or what the search calls them; "
                "of a grown shape the exemplars that its patterns are of, that of its first part first",
            }
        ),
        "parts_from": RecordField(
            {
                **places,
                "description": "how many parts came from each of made_of",
            }
        ),
        "boundary": RecordField(
            {
                **places,
                "description": "parts of the first of made_of along which it was cut, by their places there; of a "
                "grown shape the one that it was grown from",
            }
        ),
        "images": RecordField(
            {
                **places,
                "description": "parts of the second of made_of that each part of the boundary came to lie on, or, by "
                "substitution, to dock to; of a grown shape the place that its first part has in it",
            }
        ),
        "transform": RecordField(
            {
                "type": "array",
                "items": row,
                "minItems": 4,
                "maxItems": 4,
                "description": "moved the piece of the first of made_of to the second: the rows of a rotation, then a "
                "translation, in the coordinates of the model files; a grown shape is not moved",
            }
        ),
        "repeats": RecordField(
            {
                **whole,
                "minimum": 1,
                "description": "how often that was done, each time upon what was made the time before, of which "
                "images and motion are then: a recursive rule may be carried out several times",
            }
        ),
        "deformed": RecordField(
            {
                "type": "boolean",
                "description": "whether parts of it were moved by themselves, or are no longer as long, wide or high "
                "as in the exemplars; where the piece was, motion is that of its first part",
            }
        ),
        "copied": RecordField(
            {
                "type": "object",
                "properties": {
                    "share": {**share, "description": "share of the parts, but for the backdrop, in that piece"},
                    "pieces": {**whole, "minimum": 1, "description": "such pieces that together have all parts"},
                    "exemplar_share": {**share, "description": "share of the parts of that exemplar"},
                    "exemplar": {"type": "string", "minLength": 1, "description": "the name of that exemplar"},
                },
                "required": ["share", "pieces", "exemplar_share", "exemplar"],
                "additionalProperties": False,
                "description": "the largest connected piece that stands just so, moved as a whole, in one exemplar",
            }
        ),
        "restored_hubs": RecordField(
            {**whole, "description": "parts at the end of the list that were put back behind it"}
        ),
        "turned_degrees": RecordField(
            {
                "type": "number",
                "minimum": 0,
                "exclusiveMaximum": 360,
                "description": "degrees about the vertical axis by which all of it was turned in the end, to face as "
                "the exemplars do; motion is that before",
            }
        ),
    }


PRODUCER = Producer(
    language="kit",
    keys="exemplars.kits",
    asked=lambda config: bool(
        config.section(ExemplarsConfig).kits and config.section(VariationsConfig).samples_per_kit
    ),
    sentence="exemplar meshes are cut into parts, a tiling grammar is read off their contacts, and new shapes are "
    "made whose every neighbourhood and every docking of two parts was seen in an exemplar. A sample's "
    "`lineage.parents` are samples of its own split, by their keys, and exemplars.",
    splits="Samples whose shape graphs are equal stand in one split.",
    nearness=_splits,
    graphs_share_split=True,
    lineage=_lineage,
    origins=lambda plan: exemplar_origins(plan.config),
    limits=(
        "All parts are those of the exemplars, and they meet only as parts meet there. What is learnt of these kits "
        "need not hold for other castles, temples or tracks.",
        "A variant is made of pieces of its parents, or grown of what stands around their parts, and resembles them.",
    ),
    card=_made,
    variety=_variety,
    measures=_measures,
)
