"""The `exemplars` section of a config."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from pipeline.config import ExistingFile, StrictModel
from pipeline.errors import ConfigError
from stages.shape.collection.origin import Credit
from stages.shape.kit import ContactKind, Strictness

AUTO_KEYS = ("up", "contact.tolerance", "contact.kinds", "grammar", "hubs.types", "disconnected")
"""The keys of a kit that may be left at `auto`, in the order in which they are decided."""

STRICTEST: Mapping[str, Any] = {
    "up": "y",
    "contact.tolerance": 1e-3,
    "contact.kinds": ("point", "line", "face"),
    "grammar": "multiset",
    "hubs.types": "none",
    "disconnected": "error",
}
"""Where every choice of these keys begins."""

MAX_CONTACT_TOLERANCE = 0.05
"""The greatest contact tolerance, as a share of the median part's diagonal."""

Segmentation = Literal["auto", "nodes", "objects", "materials", "colors", "components", "symmetry", "sections"]


class ReadLimits(StrictModel):
    """What reading one model may take; a model that takes more is refused."""

    cpu_seconds: int = Field(300, ge=1, le=86_400, description="Most CPU seconds of reading one model.")
    memory_mb: int = Field(4_000, ge=100, description="Most memory of reading one model; unit: MB.")
    parts: int = Field(20_000, ge=1, description="Most parts of one model.")
    triangles: int = Field(
        5_000_000,
        ge=1,
        description="Most triangles of one model, those of a mesh that stands often counted once.",
    )


class ContactConfig(StrictModel):
    """When two parts are neighbours."""

    tolerance: Literal["auto"] | Annotated[float, Field(gt=0, le=MAX_CONTACT_TOLERANCE)] = Field(
        "auto",
        description="Largest distance of parts in contact, as a share of the median part diagonal; `auto` takes 0.001, "
        "or as much more as makes one piece of every exemplar.",
    )
    kinds: Literal["auto"] | Annotated[tuple[ContactKind, ...], Field(min_length=1)] = Field(
        "auto",
        description="Kinds of contact that make neighbours; leave out `point` and `line` to demand faces. `auto` "
        "takes as many as leave something to find.",
    )


class HubConfig(StrictModel):
    """Part types that touch so much that nothing around them can be exchanged."""

    types: Literal["none", "auto"] | tuple[str, ...] = Field(
        "auto",
        description="Part types left out of the shape graph of the search: none, a list of type names (in quotes where "
        "they are numbers), or, with `auto`, those of the highest degree, one after another, as far as it helps.",
    )
    restore: bool = Field(
        True,
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

    name: str = Field(
        pattern=r"^[a-z0-9][a-z0-9-]*$", max_length=64, description="Name of the kit; starts the keys of its samples."
    )
    shapes: tuple[ShapeFile, ...] = Field(
        min_length=1,
        description="Model files (GLB, glTF, OBJ, PLY, STL, OFF, DAE), from the run's folder: their paths, or the keys "
        "below.",
    )
    # excluded from what the stage's fingerprint sees: a mended licence makes the card anew and no shape
    credit: Credit = Field(
        default_factory=Credit, exclude=True, description="Whose the models are; card and manifest say it."
    )
    parts: Segmentation = Field(
        "auto",
        description="What makes a part; `auto` picks and says what it picked. `symmetry` cuts one mesh between copies "
        "of what it repeats, `sections` between parallel planes whose sections are alike. A kit that "
        "leaves a key of its own open is cut so where a search finds nothing in the pieces of a mesh that `auto` took.",
    )
    types: Literal["congruence", "labels", "meaning"] = Field(
        "congruence",
        description="What makes a part type: congruent geometry; congruent geometry with the model's own label; or "
        "that label alone, whatever the geometry: parts of one meaning take each other's places where they fit.",
    )
    label_map: dict[str, Annotated[tuple[str, ...], Field(min_length=1)]] = Field(
        default_factory=dict,
        description="With `types: meaning` or `labels` what parts mean whose models do not say so: a meaning, and the "
        "names or patterns (`leg*`) of the parts, of their labels or of their meshes; `chair/leg*` for those of the "
        "one model of that file or folder. The first that fits a part counts.",
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
    grammar: Literal["auto"] | Strictness = Field(
        "auto",
        description="Which neighbours a part may have: the very numbers of neighbours of each type that were observed "
        "around its type; as many neighbours, of the same set of types, as observed once; as many neighbours as "
        "observed, each two of their types observed together around its type; or as many neighbours as observed, each "
        "of their types observed around its type (the published rule). Each of these admits all that the former "
        "admits. Beside them, by place and not by number: in each slot around a part a state that was seen there "
        "(`slots`), of each two slots also which are filled and which empty (`slot_fillings`), or their very states "
        "(`slot_pairs`). `auto` takes the strictest under which a short search finds enough.",
    )
    hubs: HubConfig = Field(
        default_factory=HubConfig,
        description="Part types that touch so much that nothing around them can be exchanged.",
    )
    disconnected: Literal["auto", "error", "largest"] = Field(
        "auto",
        description="What to do with an exemplar in several pieces: stop, or keep its largest piece; `auto` keeps it "
        "where the other choices leave the exemplar in pieces.",
    )
    up: Literal["auto", "y", "z"] = Field(
        "auto",
        description="The axis that points up in the model files; `auto` looks at what they say and at how they stand.",
    )

    @model_validator(mode="after")
    def _hubs_are_surfaces(self) -> KitConfig:
        if self.types == "meaning" and isinstance(self.hubs.types, tuple):
            raise ValueError("with `types: meaning` no hubs can be left out; set `hubs.types: none`, or other types")
        return self

    @model_validator(mode="after")
    def _meanings_are_asked_for(self) -> KitConfig:
        if self.label_map and self.types == "congruence":
            raise ValueError("`meanings` name parts, and types go by congruence; set `types: meaning`, or `labels`")
        return self

    def auto_keys(self) -> tuple[str, ...]:
        """Those of OPEN_KEYS that are `auto`."""
        return tuple(key for key in AUTO_KEYS if self._value(key) == "auto")

    def resolve(self, chosen: Mapping[str, Any]) -> KitConfig:
        """This kit with the values `chosen`, by OPEN_KEYS, of the keys that it leaves open; what it states stays."""
        listed = {key: tuple(each) if isinstance(each, list) else each for key, each in chosen.items()}
        left = {key: listed[key] for key in self.auto_keys() if key in listed}
        contact = {key.removeprefix("contact."): each for key, each in left.items() if key.startswith("contact.")}
        hubs = {"types": left["hubs.types"]} if "hubs.types" in left else {}
        own = {key: each for key, each in left.items() if "." not in key}
        return self.model_copy(
            update={
                **own,
                "contact": self.contact.model_copy(update=contact),
                "hubs": self.hubs.model_copy(update=hubs),
            }
        )

    def resolved(self) -> ResolvedSettings:
        """The values of OPEN_KEYS. Raises ConfigError where one of them is still `auto`."""
        tolerance, kinds, hubs = self.contact.tolerance, self.contact.kinds, self.hubs.types
        up, grammar, disconnected = self.up, self.grammar, self.disconnected
        if (
            up == "auto"
            or tolerance == "auto"
            or kinds == "auto"
            or grammar == "auto"
            or hubs == "auto"
            or disconnected == "auto"
        ):
            raise ConfigError(f"kit {self.name}: nobody has decided {', '.join(self.auto_keys())}")
        return ResolvedSettings(up, tolerance, kinds, grammar, () if hubs == "none" else hubs, disconnected)

    def _value(self, key: str) -> Any:
        found: Any = self
        for step in key.split("."):
            found = getattr(found, step)
        return found


@dataclass(frozen=True)
class ResolvedSettings:
    """What a kit's config says of the keys that could be left open. tolerance: a share of the median part diagonal;
    hubs: names of the types that are left out."""

    up: Literal["y", "z"]
    tolerance: float
    kinds: tuple[ContactKind, ...]
    grammar: Strictness
    hubs: tuple[str, ...]
    disconnected: Literal["error", "largest"]


class ExemplarsConfig(StrictModel):
    """The kits of a dataset that is made of exemplars."""

    kits: tuple[KitConfig, ...] = Field(
        (), description="One or more kits; none for a dataset that is made of programs."
    )
    # excluded from what the stage's fingerprint sees: a model that was read is read alike under wider limits
    limits: ReadLimits = Field(
        default_factory=ReadLimits,
        exclude=True,
        description="What reading one model may take, in a process of its own; one that takes more is refused.",
    )

    @field_validator("kits")
    @classmethod
    def _names_differ(cls, kits: tuple[KitConfig, ...]) -> tuple[KitConfig, ...]:
        names = [kit.name for kit in kits]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two kits are named {name!r}; give each its own name")
        return kits
