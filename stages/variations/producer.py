"""Stage `variations` as a producer of samples."""

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
    """Return the measures of each kit's samples."""
    summary = plan.summary("variations", f"{plan.config.name}-assignment")
    return dict(summary["kits"]) if summary is not None else {}


def _splits(plan: Plan) -> Sequence[str]:
    measures = _measures(plan)
    return [splits_table(measures)] if measures else []


def _variety(plan: Plan) -> Sequence[str]:
    measures = _measures(plan)
    return [measure_table(measures)] if measures else []


def _endings(plan: Plan) -> Sequence[str]:
    """Return how the search of each kit ended, in words, from the summaries of its last pool."""
    summaries = [plan.summary("variations", shard) or {} for shard in plan.shards("variations")]
    ended = [
        f"- {summary['ending']}; {summary['graphs']:,} distinct graphs, {summary['histograms']:,} distinct histograms."
        + (f" What limits it: {summary['advice']}." if summary["advice"] else "")
        + (f" What was left out: {summary['skipped']}." if summary["skipped"] else "")
        + (f" Resized: {_listed(summary['resized'])}." if summary["resized"] else "")
        for summary in summaries
        if summary.get("ending")
    ]
    return ["\n".join(ended)] if ended else []


def _listed(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{count:,} ({reason})" for reason, count in counts.items())


def _card(plan: Plan) -> Sequence[str]:
    return [*resolved_table(plan), *_endings(plan)]


def _lineage(_: Config) -> Mapping[str, RecordField]:
    count = {"type": "integer", "minimum": 0}
    share = {"type": "number", "exclusiveMinimum": 0, "maximum": 1}
    counts = {"type": "array", "items": count, "minItems": 1}
    row = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
    name = {"type": "string", "minLength": 1}
    return {
        "name": RecordField({**name, "description": "its name in the search"}),
        "made_of": RecordField(
            {
                "type": "array",
                "items": name,
                "minItems": 1,
                "description": "the two shapes whose pieces were exchanged, exemplars or names in the search; of a "
                "grown shape the exemplars of its patterns, that of its first part first; of an exemplar with other "
                "rows that exemplar",
            }
        ),
        "parts_from": RecordField({**counts, "description": "number of parts from each of made_of"}),
        "boundary": RecordField(
            {
                **counts,
                "description": "boundary parts of the first of made_of, by their index there; of a grown shape the "
                "part that it grew from, and of one with other rows the part that its first one was",
            }
        ),
        "images": RecordField(
            {
                **counts,
                "description": "parts of the second of made_of that each boundary part came to lie on or, by "
                "substitution, docked to; of a grown shape, or one with other rows, the index of its first part",
            }
        ),
        "transform": RecordField(
            {
                "type": "array",
                "items": row,
                "minItems": 4,
                "maxItems": 4,
                "description": "rigid transform of the piece from the first of made_of to the second: the rows of a "
                "rotation, then a translation, in the coordinates of the model files; a grown shape, or one with "
                "other rows, is not moved",
            }
        ),
        "rows": RecordField(
            {
                **name,
                "description": "JSON array of the changes of the rows of made_of, one after another: periods inserted "
                "or removed, or another number of sectors; `[]` for all other methods",
            }
        ),
        "repeats": RecordField(
            {
                **count,
                "minimum": 1,
                "description": "number of times that a recursive rule was applied, each time to its own result, to "
                "which images and transform refer",
            }
        ),
        "deformed": RecordField(
            {
                "type": "boolean",
                "description": "whether parts moved independently or differ in size from the exemplars; if the piece "
                "did, transform is that of its first part",
            }
        ),
        "copied": RecordField(
            {
                "type": "object",
                "properties": {
                    "share": {**share, "description": "share of the parts, without restored hubs, in that piece"},
                    "pieces": {**count, "minimum": 1, "description": "number of such pieces that cover the shape"},
                    "exemplar_share": {**share, "description": "share of the parts of that exemplar"},
                    "exemplar": {**name, "description": "name of that exemplar"},
                },
                "required": ["share", "pieces", "exemplar_share", "exemplar"],
                "additionalProperties": False,
                "description": "the largest connected piece that one rigid transform lays on an exemplar",
            }
        ),
        "restored_hubs": RecordField(
            {**count, "description": "number of hub parts put back, at the end of the list of parts"}
        ),
        "turned_degrees": RecordField(
            {
                "type": "number",
                "minimum": 0,
                "exclusiveMaximum": 360,
                "description": "rotation about the vertical axis that finally oriented the shape as the exemplars "
                "are, in degrees; transform is before that",
            }
        ),
    }


def _deforms(config: Config) -> bool:
    """Return whether parts may be resized or moved on their own, so that dockings differ from the exemplars'."""
    search = config.section(VariationsConfig).search
    return search.deform or search.stretch.max_factor > 1


def _sentence(config: Config) -> str:
    exact = all(kit.grammar == "multiset" for kit in config.section(ExemplarsConfig).kits)
    observed = "occurs in an exemplar" if exact else "is one that the grammar admits"
    dockings = "" if _deforms(config) else ", and every docking of two parts occurs in an exemplar"
    return (
        "exemplar meshes are cut into parts, a tiling grammar is read off their contacts, and new shapes are made in "
        f"which every neighbourhood {observed}{dockings}. A sample's `lineage.parents` are samples of its own split, "
        "by their keys, and exemplars."
    )


def _limits(config: Config) -> Sequence[str]:
    parts = (
        "All parts are those of the exemplars, some of them resized or moved on their own (`deformed` in the lineage)."
        if _deforms(config)
        else "All parts are those of the exemplars, and they touch only as parts touch there."
    )
    return (
        f"{parts} What is learnt from these kits may not hold for others.",
        "A variant consists of pieces of its parents or grew from their neighbourhoods, and resembles them.",
    )


PRODUCER = Producer(
    language="kit",
    keys="exemplars.kits",
    is_requested=lambda config: bool(
        config.section(ExemplarsConfig).kits and config.section(VariationsConfig).samples_per_kit
    ),
    sentence=_sentence,
    splits=lambda _: "Samples with equal shape graphs are in one split.",
    nearness=_splits,
    graphs_share_split=lambda _: True,
    lineage=_lineage,
    origins=lambda plan: exemplar_origins(plan.config),
    limits=_limits,
    card=_card,
    variety=_variety,
    measures=_measures,
)
