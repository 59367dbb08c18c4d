"""Where the meshes of a dataset come from, and who made them."""

from __future__ import annotations

from pipeline.paths import file_digest
from pipeline.stage import Plan
from stages.grammars.settings import GrammarsConfig
from stages.shape.collection.origin import Origin


def mesh_origins(plan: Plan) -> list[Origin]:
    """Return the origins of the model files of all grammars, in the order of the config."""
    return [
        Origin(
            kit=model.name,
            file="/".join(model.model.parts[-2:]),
            sha256=file_digest(model.model),
            key=f"grammars.models[{model.name}].credit",
            **model.credit.model_dump(),
        )
        for model in plan.config.section(GrammarsConfig).models
    ]
