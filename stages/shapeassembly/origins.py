"""The origins of the programs and part hierarchies of a dataset, with their credits."""

from __future__ import annotations

from pathlib import Path

from pipeline.paths import file_digest
from pipeline.stage import Plan
from stages.shape.collection.origin import Origin
from stages.shapeassembly.extraction.settings import NamedFiles
from stages.shapeassembly.settings import ShapeAssemblyConfig
from stages.shapeassembly.sources import source_digest


def program_origins(plan: Plan) -> list[Origin]:
    """Return folders, archives and model weights in the order of the config.

    The digest of a folder is of the names and bytes of the files that are read.
    """
    section = plan.config.section(ShapeAssemblyConfig)
    programs = [_origin("programs", files, files.path, source_digest(files.path)) for files in section.programs]
    hierarchies = [
        _origin("hierarchies", files, files.path, files.source.digest(0, len(files.source)))
        for files in section.hierarchies
    ]
    weights = [(model, plan.published(f"{model.folder}/weights.safetensors")) for model in section.sampled]
    sampled = [_origin("sampled", model, path, file_digest(path)) for model, path in weights]
    return [*programs, *hierarchies, *sampled]


def _origin(key: str, files: NamedFiles, path: Path, digest: str) -> Origin:
    return Origin(
        kit=files.name,
        file="/".join(path.parts[-2:]),
        sha256=digest,
        key=f"shapeassembly.{key}[{files.name}].credit",
        **files.credit.model_dump(),
    )
