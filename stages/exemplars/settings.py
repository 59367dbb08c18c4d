"""The `exemplars` section of a config."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from pipeline.config import ExistingFile, StrictModel
from pipeline.errors import ConfigError
from stages.model_files.limits import ReadLimits
from stages.shape.collection.origin import Credit
from stages.shape.kit import ContactKind, Strictness

AUTO_KEYS = ("up", "contact.tolerance", "contact.kinds", "grammar", "hubs.types", "disconnected")
"""The keys of a kit that may be left at `auto`, in the order in which they are resolved."""

STRICTEST: Mapping[str, Any] = {
    "up": "y",
    "contact.tolerance": 1e-3,
    "contact.kinds": ("point", "line", "face"),
    "grammar": "multiset",
    "hubs.types": "none",
    "disconnected": "error",
}
"""The values with which every search for these keys begins."""

MAX_CONTACT_TOLERANCE = 0.05
"""As a share of the median part's diagonal."""

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""Metres of each unit that a config may state."""

Units = Literal["auto", "m", "cm", "mm", "in", "ft"]

Segmentation = Literal["auto", "nodes", "objects", "materials", "colors", "components", "symmetry", "sections"]


class ContactConfig(StrictModel):
    """Which parts are neighbours."""

    tolerance: Literal["auto"] | Annotated[float, Field(gt=0, le=MAX_CONTACT_TOLERANCE)] = Field(
        "auto",
        description="Largest distance of parts in contact, as a share of the median part diagonal; `auto` takes 0.001, "
        "or the smallest multiple that makes one piece of every exemplar.",
    )
    kinds: Literal["auto"] | Annotated[tuple[ContactKind, ...], Field(min_length=1)] = Field(
        "auto",
        description="Kinds of contact that make neighbours; leave out `point` and `line` to demand faces. `auto` takes "
        "all kinds with which a search still finds enough.",
    )


class HubConfig(StrictModel):
    """Hubs: part types with too many contacts for an exchange around them."""

    types: Literal["none", "auto"] | tuple[str, ...] = Field(
        "auto",
        description="Part types left out of the shape graph of the search: none, a list of type names (in quotes if "
        "they are numbers), or, with `auto`, those of the highest degree, one after another, if that helps.",
    )
    restore: bool = Field(
        True,
        description="Whether finished variants get back hub parts where they fit: where a hub has three quarters of "
        "the neighbours that one of its type had in an exemplar, and all its contacts occur in exemplars.",
    )


class AppearanceConfig(StrictModel):
    """What variants keep of the look of their exemplars."""

    keep: Literal["colors", "textures"] = Field(
        "colors",
        description="`colors`: one colour a face. `textures`: the materials of the files, with their names, textures, "
        "texture coordinates and normals.",
    )
    texture_size: int = Field(
        512, ge=16, le=4096, description="Largest side of a texture; larger ones are reduced; unit: pixels."
    )

    @model_validator(mode="before")
    @classmethod
    def _keep_alone(cls, stated: Any) -> Any:
        """Accept what to keep in place of the keys."""
        return {"keep": stated} if isinstance(stated, str) else stated

    @property
    def kept_texture_size(self) -> int | None:
        """The size of textures for `read_parts`: None where colours alone are kept."""
        return self.texture_size if self.keep == "textures" else None


class ShapeFile(StrictModel):
    """One model file."""

    path: ExistingFile = Field(description="The file, from the run's folder.")
    credit: Credit | None = Field(
        None, exclude=True, description="Author and licence of the model, if they differ from the kit's."
    )

    @model_validator(mode="before")
    @classmethod
    def _path_alone(cls, stated: Any) -> Any:
        """Accept a path in place of the keys."""
        return stated if isinstance(stated, dict) else {"path": stated}


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
    # excluded from the stage's fingerprint: a corrected licence rebuilds the card and no shape
    credit: Credit = Field(
        default_factory=Credit, exclude=True, description="Author and licence of the models, for card and manifest."
    )
    parts: Segmentation = Field(
        "auto",
        description="What makes a part; `auto` reports what it picks. `symmetry` cuts one mesh between copies of what "
        "it repeats, `sections` between parallel planes with similar sections. A kit with other keys at `auto` is cut "
        "into sections if a search finds nothing in the pieces of a mesh that `auto` took.",
    )
    types: Literal["congruence", "labels", "meaning"] = Field(
        "congruence",
        description="What makes a part type: congruent geometry; congruent geometry with the model's own label; or "
        "that label alone, whatever the geometry: parts of one meaning replace each other where they fit.",
    )
    label_map: dict[str, Annotated[tuple[str, ...], Field(min_length=1)]] = Field(
        default_factory=dict,
        description="With `types: meaning` or `labels`: labels for parts that have none or useless ones. Each label "
        "lists names or patterns (`leg*`) of parts, of their own labels or of their meshes; `chair/leg*` is limited to "
        "the model of that file or folder. The first pattern that fits a part counts.",
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
        description="With `types: meaning`: largest gap between the contacts of parts that replace each other, as a "
        "share of the median part diagonal; never more than a quarter of the contact.",
    )
    contact: ContactConfig = Field(default_factory=ContactConfig, description="When two parts are neighbours.")
    grammar: Literal["auto"] | Strictness = Field(
        "auto",
        description="Which neighbours a part may have. `multiset`: the observed numbers of neighbours of each type. "
        "`count_and_set`: an observed number of neighbours with their set of types. `count_and_pairs`: an observed "
        "number, each two types observed together. `count_and_types`: an observed number, each type observed (the "
        "published rule). Each level admits whatever the previous one admits. Other levels go by place: `slots` asks "
        "for an observed state in each slot around a part, `slot_fillings` for each two slots also which are filled, "
        "`slot_pairs` for their states. `auto` takes the strictest under which a short search finds enough.",
    )
    row_neighbourhoods: bool = Field(
        True,
        description="Whether the grammar also admits the neighbourhoods that exemplars have once their rows are longer "
        "or shorter, such as that of the middle of a wall of three pieces where exemplars have two.",
    )
    hubs: HubConfig = Field(
        default_factory=HubConfig,
        description="Part types with too many contacts for an exchange around them.",
    )
    disconnected: Literal["auto", "error", "largest"] = Field(
        "auto",
        description="What to do with an exemplar in several pieces: stop, or keep its largest piece; `auto` keeps it "
        "if the other resolved keys leave the exemplar in pieces.",
    )
    up: Literal["auto", "y", "z"] = Field(
        "auto",
        description="The axis that points up in the model files; `auto` decides by the files and by the shapes.",
    )
    units: Units = Field(
        "auto",
        description="Unit of the numbers in the model files; shapes are made in metres. `auto` takes what files say: "
        "glTF is in metres, DAE is converted. OBJ, PLY, STL and OFF say nothing; their shapes keep their numbers.",
    )

    appearance: AppearanceConfig = Field(
        default_factory=AppearanceConfig,
        description="What variants keep of the look of their exemplars: `colors`, `textures`, or the keys below.",
    )

    @model_validator(mode="after")
    def _hubs_need_other_types(self) -> KitConfig:
        if self.types == "meaning" and isinstance(self.hubs.types, tuple):
            raise ValueError("with `types: meaning` no hubs can be left out; set `hubs.types: none`, or other types")
        return self

    @model_validator(mode="after")
    def _label_map_needs_labels(self) -> KitConfig:
        if self.label_map and self.types == "congruence":
            raise ValueError("`label_map` labels parts, and types go by congruence; set `types: meaning`, or `labels`")
        return self

    def auto_keys(self) -> tuple[str, ...]:
        """Return those of AUTO_KEYS that are `auto`."""
        return tuple(key for key in AUTO_KEYS if self._value(key) == "auto")

    def resolve(self, values: Mapping[str, Any]) -> KitConfig:
        """Return this kit with `values`, by AUTO_KEYS, for the keys that it leaves at `auto`; stated keys stay."""
        listed = {key: tuple(value) if isinstance(value, list) else value for key, value in values.items()}
        left = {key: listed[key] for key in self.auto_keys() if key in listed}
        contact = {key.removeprefix("contact."): value for key, value in left.items() if key.startswith("contact.")}
        hubs = {"types": left["hubs.types"]} if "hubs.types" in left else {}
        own = {key: value for key, value in left.items() if "." not in key}
        return self.model_copy(
            update={
                **own,
                "contact": self.contact.model_copy(update=contact),
                "hubs": self.hubs.model_copy(update=hubs),
            }
        )

    def resolved(self) -> ResolvedSettings:
        """Return the values of AUTO_KEYS. Raises ConfigError if one of them is still `auto`."""
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
            raise ConfigError(f"kit {self.name}: {', '.join(self.auto_keys())} must be resolved first")
        return ResolvedSettings(up, tolerance, kinds, grammar, () if hubs == "none" else hubs, disconnected)

    def _value(self, key: str) -> Any:
        value: Any = self
        for step in key.split("."):
            value = getattr(value, step)
        return value


@dataclass(frozen=True)
class ResolvedSettings:
    """The values of a kit's AUTO_KEYS, all resolved.

    tolerance: largest distance of parts in contact, as a share of the median part diagonal.
    kinds: kinds of contact that count.
    grammar: the strictness.
    hubs: names of the types that are left out.
    """

    up: Literal["y", "z"]
    tolerance: float
    kinds: tuple[ContactKind, ...]
    grammar: Strictness
    hubs: tuple[str, ...]
    disconnected: Literal["error", "largest"]


class ExemplarsConfig(StrictModel):
    """The kits of a dataset that is generated from exemplars."""

    kits: tuple[KitConfig, ...] = Field((), description="One or more kits; none for a dataset without exemplars.")
    # excluded from the stage's fingerprint: wider limits do not change a model that was read
    limits: ReadLimits = Field(
        default_factory=ReadLimits,
        exclude=True,
        description="Limits of reading one model, in a child process; a model beyond them is refused.",
    )

    @field_validator("kits")
    @classmethod
    def _names_differ(cls, kits: tuple[KitConfig, ...]) -> tuple[KitConfig, ...]:
        names = [kit.name for kit in kits]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two kits are named {name!r}; give each its own name")
        return kits
