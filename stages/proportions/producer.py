"""Stage `proportions` as a producer of samples."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.config import Config
from pipeline.stage import Plan
from stages.exemplars.origins import exemplar_origins
from stages.exemplars.resolved_table import resolved_table
from stages.proportions.settings import ProportionsConfig
from stages.proportions.stage import choice_name, splits_by_layout
from stages.shape.collection.producer import Producer
from stages.variations.settings import VariationsConfig


def _has_rows(config: Config) -> bool:
    """Return whether rows may have become longer or shorter."""
    return config.section(VariationsConfig).rows.use is not False


def _sentence(config: Config) -> str:
    rows = (
        "Where the exemplars have rows, periods of these may be inserted or removed before, and fronts such as doors "
        "may be divided. "
    )
    return (
        "exemplars are resized: along each axis the lengths between the ends of their parts are multiplied, equal "
        "lengths by equal factors. One map moves all of space, so parts that touch keep touching. "
        f"{rows * _has_rows(config)}The `txt` of a shape holds its {'changes and its ' * _has_rows(config)}factors."
    )


def _limits(config: Config) -> Sequence[str]:
    differ = "sizes, the lengths of rows and the number of fronts" if _has_rows(config) else "sizes"
    return (
        f"All shapes have the kinds of parts and contacts of an exemplar; only {differ} differ.",
        "Round parts become oval, and slopes change.",
    )


def _layouts(plan: Plan) -> Sequence[str]:
    summary = plan.summary("proportions", choice_name(plan.config.name))
    if summary is None or not splits_by_layout(sum(summary["layouts"].values())):
        return []
    return ["Resized exemplars with equal shape graphs are in one split, which measures unseen lengths of rows, too."]


PRODUCER = Producer(
    language="proportions",
    keys="proportions.samples_per_kit",
    is_requested=lambda config: config.section(ProportionsConfig).samples_per_kit > 0,
    sentence=_sentence,
    splits=lambda _: (
        "No two samples are equal: at equal size some end of a part differs. Splits share exemplars, so "
        "they measure generalisation to unseen sizes."
    ),
    nearness=_layouts,
    graphs_share_split=lambda _: False,
    origins=lambda plan: exemplar_origins(plan.config),
    card=resolved_table,
    limits=_limits,
)
