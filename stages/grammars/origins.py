"""Where the meshes of a dataset come from, and whose they are."""

from __future__ import annotations

from pipeline.paths import file_digest
from pipeline.stage import Plan
from stages.grammars.settings import GrammarsConfig
from stages.shape.collection.origin import Origin


def mesh_origins(plan: Plan) -> list[Origin]:
    """The model files of all grammars, in the order of the config."""
    return [
        Origin(
            kit=each.name,
            file="/".join(each.model.parts[-2:]),
            sha256=file_digest(each.model),
            key=f"grammars.models[{each.name}].credit",
            **each.credit.model_dump(),
        )
        for each in plan.config.section(GrammarsConfig).models
    ]
