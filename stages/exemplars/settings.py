"""The `exemplars` section of a config."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from pipeline.config import ExistingFile, StrictModel
from stages.shape.collection.origin import Credit
from stages.shape.kit import ContactKind, Strictness

__all__ = ["ContactConfig", "ExemplarsConfig", "HubConfig", "KitConfig", "ShapeFile"]

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


class HubConfig(StrictModel):
    """Part types that touch so much that nothing around them can be exchanged."""

    types: Literal["none", "auto"] | tuple[str, ...] = Field(
        "none",
        description="Part types left out of the shape graph of the search: none, those that `make inspect` calls hubs, "
        "or a list of type names (in quotes where they are numbers).",
    )
    keep: Literal["drop", "backdrop"] = Field(
        "drop",
        description="What becomes of hub parts: they are not in the shapes, or every finished variant gets them back "
        "where they fit: where a hub has three quarters of the neighbours that one of its type had in an exemplar, "
        "and touches nothing in a way that no exemplar shows.",
    )


class ShapeFile(StrictModel):
    """One model file."""

    path: ExistingFile = Field(description="The file, from the run's folder.")
    credit: Credit | None = Field(
        None, exclude=True, description="Whose the model is, where it is not what the kit says."
    )

    @model_validator(mode="before")
    @classmethod
    def _a_path_is_enough(cls, said: Any) -> Any:
        """Of most files the path is all there is to say."""
        return said if isinstance(said, dict) else {"path": said}


class KitConfig(StrictModel):
    """One kit: exemplar shapes that share part types."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]*$", description="Name of the kit; starts the keys of its samples.")
    shapes: tuple[ShapeFile, ...] = Field(
        min_length=1,
        description="Model files (GLB, glTF, OBJ, PLY, STL, OFF, DAE), from the run's folder: their paths, or the keys "
        "below.",
    )
    # excluded from what the stage's fingerprint sees: a mended licence makes the card anew and no shape
    credit: Credit = Field(
        default_factory=Credit, exclude=True, description="Whose the models are; card and manifest say it."
    )
    parts: Segmentation = Field("auto", description="What makes a part; `auto` picks and says what it picked.")
    types: Literal["congruence", "labels", "meaning"] = Field(
        "congruence",
        description="What makes a part type: congruent geometry; congruent geometry with the model's own label; or "
        "that label alone, whatever the geometry: parts of one meaning take each other's places where they fit.",
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
    fit_tolerance: float = Field(
        0.02,
        gt=0,
        le=0.2,
        description="With `types: meaning` how far contacts of parts that take each other's places may miss each "
        "other, as a share of the median part diagonal; never more than a quarter of the contact.",
    )
    contact: ContactConfig = Field(default_factory=ContactConfig, description="When two parts are neighbours.")
    grammar: Strictness = Field(
        "multiset",
        description="Which neighbours a part may have: the very numbers of neighbours of each type that were observed "
        "around its type; as many neighbours, of the same set of types, as observed once; as many neighbours as "
        "observed, each two of their types observed together around its type; or as many neighbours as observed, each "
        "of their types observed around its type (the published rule). Each admits all that the former admits.",
    )
    hubs: HubConfig = Field(
        default_factory=HubConfig,
        description="Part types that touch so much that nothing around them can be exchanged.",
    )
    disconnected: Literal["error", "largest"] = Field(
        "error", description="What to do with an exemplar in several pieces: stop, or keep its largest piece."
    )
    up: Literal["y", "z"] = Field("y", description="The axis that points up in the model files.")

    @model_validator(mode="after")
    def _hubs_are_surfaces(self) -> KitConfig:
        if self.types == "meaning" and self.hubs.types != "none":
            raise ValueError("with `types: meaning` no hubs can be left out; set `hubs.types: none`, or other types")
        return self


class ExemplarsConfig(StrictModel):
    """The kits of a dataset that is made of exemplars."""

    kits: tuple[KitConfig, ...] = Field(
        (), description="One or more kits; none for a dataset that is made of programs."
    )

    @field_validator("kits")
    @classmethod
    def _names_differ(cls, kits: tuple[KitConfig, ...]) -> tuple[KitConfig, ...]:
        names = [kit.name for kit in kits]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two kits are named {name!r}; give each its own name")
        return kits
