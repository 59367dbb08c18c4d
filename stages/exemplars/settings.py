"""The `exemplars` section of a config."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, field_validator

from pipeline.config import ExistingFile, StrictModel
from stages.shape.kit import ContactKind

__all__ = ["ContactConfig", "ExemplarsConfig", "KitConfig"]

Segmentation = Literal["auto", "nodes", "objects", "materials", "colors", "components"]


class ContactConfig(StrictModel):
    """When two parts are neighbours."""

    tolerance: float = Field(
        1e-3, gt=0, le=0.05, description="Largest distance of parts in contact, as a share of the median part diagonal."
    )
    kinds: tuple[ContactKind, ...] = Field(
        ("point", "line", "face"),
        min_length=1,
        description="Kinds of contact that make neighbours; leave out `point` and `line` to demand faces.",
    )


class KitConfig(StrictModel):
    """One kit: exemplar shapes that share part types."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]*$", description="Name of the kit; starts the keys of its samples.")
    shapes: tuple[ExistingFile, ...] = Field(
        min_length=1, description="Model files (GLB, glTF, OBJ, PLY, STL, OFF, DAE), from the run's folder."
    )
    parts: Segmentation = Field("auto", description="What makes a part; `auto` picks and says what it picked.")
    types: Literal["congruence", "labels"] = Field(
        "congruence",
        description="What makes a part type: congruent geometry, or congruent geometry with the model's own label.",
    )
    mirror_images_match: bool = Field(False, description="Whether a part and its mirror image are one type.")
    congruence_tolerance: float = Field(
        1e-3, gt=0, le=0.05, description="Largest distance of congruent surfaces, as a share of the part's diagonal."
    )
    pose_tolerance: float = Field(
        2e-3,
        gt=0,
        le=0.1,
        description="Largest displacement of relative poses that count as one docking, as a share of the median part "
        "diagonal.",
    )
    contact: ContactConfig = Field(default_factory=ContactConfig, description="When two parts are neighbours.")
    disconnected: Literal["error", "largest"] = Field(
        "error", description="What to do with an exemplar in several pieces: stop, or keep its largest piece."
    )
    up: Literal["y", "z"] = Field("y", description="The axis that points up in the model files.")


class ExemplarsConfig(StrictModel):
    """The kits of a dataset."""

    kits: tuple[KitConfig, ...] = Field(min_length=1, description="One or more kits.")

    @field_validator("kits")
    @classmethod
    def _names_differ(cls, kits: tuple[KitConfig, ...]) -> tuple[KitConfig, ...]:
        names = [kit.name for kit in kits]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two kits are named {name!r}; give each its own name")
        return kits
