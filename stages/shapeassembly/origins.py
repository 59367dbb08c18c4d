"""Where the programs and part hierarchies of a dataset come from, and whose they are."""

from __future__ import annotations

from pathlib import Path

from pipeline.paths import file_digest
from pipeline.stage import Plan
from stages.shape.collection.origin import Origin
from stages.shapeassembly.extraction.settings import NamedFiles
from stages.shapeassembly.settings import ShapeAssemblyConfig
from stages.shapeassembly.sources import source_digest


def program_origins(plan: Plan) -> list[Origin]:
    """The folders and archives of the config, in its order, and the weights of the models that write programs. The
    digest of a folder is of the names and bytes of the files in it that count."""
    section = plan.config.section(ShapeAssemblyConfig)
    programs = [_origin("programs", each, each.path, source_digest(each.path)) for each in section.programs]
    hierarchies = [
        _origin("hierarchies", each, each.path, each.source.digest(0, len(each.source))) for each in section.hierarchies
    ]
    weights = [(each, plan.published(f"{each.folder}/weights.safetensors")) for each in section.sampled]
    written = [_origin("sampled", each, path, file_digest(path)) for each, path in weights]
    return [*programs, *hierarchies, *written]


def _origin(key: str, files: NamedFiles, path: Path, digest: str) -> Origin:
    return Origin(
        kit=files.name,
        file="/".join(path.parts[-2:]),
        sha256=digest,
        key=f"shapeassembly.{key}[{files.name}].credit",
        **files.credit.model_dump(),
    )
