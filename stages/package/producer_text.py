"""What producers and stages say of a dataset on its card: each sentence follows from the config or from records."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

from pipeline.config import Config
from pipeline.stage import Plan
from stages.exemplars.settings import ExemplarsConfig
from stages.shape.collection.discovery import language_of, members, producers
from stages.shape.collection.origin import Origin, missing_licenses


def producer_text(
    plan: Plan, makers: Sequence[str], producer: str, adding: Sequence[str], origins: Sequence[Origin]
) -> dict[str, Any]:
    """Return the fields of `CardText` besides the origins, as JSON.

    makers: the stages that made the samples
    producer: the stage whose shards hold them, which joins those of several makers
    adding: the stages that add members to them
    """
    known = producers()
    stages = list(dict.fromkeys((*makers, producer)))
    languages = {language_of(maker).name: language_of(maker) for maker in makers}
    paragraphs = [text for stage in stages for text in known[stage].card(plan)]
    added, config = [members()[stage] for stage in adding], plan.config
    paragraphs += [text for stage in added for text in stage.card(plan)]
    return {
        "made": _by_name({maker: known[maker].sentence(config) for maker in makers}),
        "splits": [
            _by_name({maker: known[maker].splits(config) for maker in makers}).strip(),
            *(known[stage].splits(config) for stage in stages if stage not in makers),
            *(text for stage in stages for text in known[stage].nearness(plan)),
        ],
        "coordinates": _by_name({name: language.coordinates for name, language in languages.items()}),
        "members_coordinates": [text for stage in added for text in stage.coordinates(config)],
        "checks": [check for stage in added for check in stage.checks],
        "limits": [
            _surface_limit(config),
            *(limit for stage in added for limit in stage.limits(config)),
            *(
                f"**{maker}**: {limit}" if len(makers) > 1 else limit
                for maker in makers
                for limit in known[maker].limits(config)
            ),
        ],
        "paragraphs": list(dict.fromkeys(paragraphs)),
        "variety": [text for stage in stages for text in known[stage].variety(plan)],
        "rejects": _rejects(plan, stages),
        "missing_licenses": missing_licenses(origins),
    }


def _surface_limit(config: Config) -> str:
    """Return what meshes have besides vertices and faces."""
    if any(kit.appearance.keep == "textures" for kit in config.section(ExemplarsConfig).kits):
        return "Meshes have the materials, textures and normals of their models, or one colour per face without these."
    return "Meshes have at most one colour per face, and no textures, materials or normals."


def _by_name(texts: dict[str, str]) -> str:
    """Join texts; several become paragraphs of their own, each with the name of what it is about."""
    if len(texts) == 1:
        return next(iter(texts.values()))
    return "".join(f"\n\n**{name}**: {text}" for name, text in texts.items()) + "\n\n"


def _rejects(plan: Plan, stages: Iterable[str]) -> dict[str, int]:
    """Return the number of items that stages refused, by reason."""
    counts: Counter[str] = Counter()
    for stage in stages:
        for shard in plan.shards(stage):
            counts.update(plan.rejects(stage, shard))
    return dict(sorted(counts.items()))
