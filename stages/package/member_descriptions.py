"""Descriptions of the members of samples: those that stages declare, and the package's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from pipeline.config import Config
from stages.shape.collection.discovery import members
from stages.shape.collection.language import Language
from stages.shape.collection.members import TEXT, Member

IMAGES = (".png", ".jpg", ".webp", ".exr")
"""Suffixes of drawings and of images of views."""
OWN_MEMBERS = (
    Member(
        "glb",
        "The mesh: glTF 2.0, one node a part, named by its label (`tower.000`), equal parts sharing one mesh. Node "
        "`extras` hold `class` and `instance`.",
    ),
    Member(
        "json",
        "Everything else: parts with label, class and pose (4x4), counts, bounds, lineage{cameras}; field by field in "
        "`schema.json`.",
    ),
)


def describe_members(config: Config, names: Sequence[str], languages: Sequence[Language]) -> list[dict[str, Any]]:
    """Name, sentence, dtype and shape of each member that samples in `languages` have, as JSON.

    Raises ValueError for a member that nobody declares.
    """
    declared = {item.name: item for stage in members().values() for item in stage.of(config)}
    declared |= {item.name: item for item in OWN_MEMBERS}
    if any(not language.graphs for language in languages) or (TEXT in names and TEXT not in declared):
        strings = [declared[TEXT].sentence] if TEXT in declared else ["A line that says that strings are turned off."]
        texts = [text for language in languages for text in (strings if language.graphs else [language.text])]
        declared[TEXT] = Member(TEXT, " Or: ".join(dict.fromkeys(texts)))
    cameras = ", cameras of the drawings" * ("sketch0.png" in names) + ", cameras of the views" * any(
        name.endswith(IMAGES) and not name.startswith("sketch") for name in names
    )
    declared["json"] = replace(declared["json"], sentence=declared["json"].sentence.format(cameras=cameras))
    unknown = [name for name in names if name not in declared]
    if unknown:
        raise ValueError(f"samples have {', '.join(unknown)}, which no stage declares in its members.py")
    return [
        {"name": name, "sentence": item.sentence, "dtype": item.dtype, "shape": list(item.shape)}
        for name, item in ((name, declared[name]) for name in names)
    ]
