"""The origins of a dataset's exemplars: files, authors and licences."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from pipeline.config import Config
from pipeline.paths import file_digest
from stages.exemplars.settings import ExemplarsConfig
from stages.shape.collection.origin import Origin


def exemplar_origins(config: Config) -> list[Origin]:
    """Return the origins of the model files of all kits, in the order of the config."""
    return [
        Origin(
            kit=kit.name,
            file="/".join(shape.path.parts[-2:]),
            sha256=_digest(shape.path, shape.path.stat().st_mtime_ns),
            key=f"exemplars.kits[{kit.name}].credit",
            **(shape.credit or kit.credit).model_dump(),
        )
        for kit in config.section(ExemplarsConfig).kits
        for shape in kit.shapes
    ]


@lru_cache(maxsize=256)
def _digest(path: Path, _: int) -> str:
    return file_digest(path)
