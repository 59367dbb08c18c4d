"""The stage `shapeassembly` as a producer of samples."""

from __future__ import annotations

from pipeline.config import Config
from stages.shape.collection.producer import Producer
from stages.shapeassembly.origins import program_origins
from stages.shapeassembly.settings import ShapeAssemblyConfig


def _sentence(config: Config) -> str:
    section = config.section(ShapeAssemblyConfig)
    origins = {
        "given": section.programs,
        "edited": any(files.edits for files in section.programs),
        "extracted from part hierarchies": section.hierarchies,
        "sampled from trained models": section.sampled,
        "drawn at random": section.random,
    }
    listed = ", ".join(origin for origin, used in origins.items() if used)
    return f"ShapeAssembly programs ({listed}) are executed; a shape's program is its `txt`."


def _published(config: Config) -> list[str]:
    """Return the categories whose splits are published lists."""
    return [files.name for files in config.section(ShapeAssemblyConfig).programs if files.lists]


def _splits(config: Config) -> str:
    names, own = _published(config), "Programs that differ only in their numbers are in one split."
    if not names:
        return own
    text = f"The splits of {', '.join(names)} are published lists."
    section = config.section(ShapeAssemblyConfig)
    entries = (*section.programs, *section.hierarchies, *section.sampled, *section.random)
    others = len(entries) > len(names)
    return f"{text} Of the others: {own}" if others else text


PRODUCER = Producer(
    language="shapeassembly",
    keys="shapeassembly.programs, hierarchies, sampled or random",
    is_requested=lambda config: config.section(ShapeAssemblyConfig).has_sources,
    sentence=_sentence,
    origins=program_origins,
    limits=lambda _: ("All parts are cuboids.",),
    splits=_splits,
    graphs_share_split=lambda config: not _published(config),
)
