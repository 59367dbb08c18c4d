"""The `variations` section of a config."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.config import StrictModel
from stages.rows.settings import RowsConfig
from stages.shape.collection.assignment import SplitConfig
from stages.shape.physics.settings import PhysicsConfig, Requirements
from stages.shape.resolved_settings import KEEP_TYPES_KEY, MAX_COPIED_SHARE_KEY, REQUIRED_LABELS_KEY, STABLE_KEY
from stages.variations.novelty.features import Axis
from stages.variations.requirements.identity import DEFAULT_SHARE_FACTOR


class NoveltyConfig(StrictModel):
    """How a MAP-Elites archive leads the search to new variants: rare cells first."""

    guided: bool = Field(
        True, description="Whether the archive leads the search; otherwise parents and operators are drawn at random."
    )
    axes: tuple[Axis, ...] = Field(
        ("parts", "footprint", "height", "cycle_rank", "mixture", "neighbourhood_mixture", "distance"),
        min_length=1,
        description="Axes of the archive: number of parts, area seen from above, height, longer by shorter side, edges "
        "beyond a tree, share of parts from other exemplars than the main one, share of distinctive neighbourhoods "
        "from other exemplars than the main one, histogram distance to the nearest exemplar, share of parts in the "
        "largest verbatim piece of an exemplar, most frequent part type.",
    )
    resolution: int = Field(
        4, ge=1, le=64, description="Cells per doubling of a size; shares have four times as many from 0 to 1."
    )
    cell_quota: int = Field(
        8,
        ge=1,
        description="Variants of a cell after which another one of a known histogram goes to the reserve: the pool "
        "keeps it, but the search neither counts it nor builds on it.",
    )
    exploration: float = Field(
        0.2,
        ge=0.01,
        le=1,
        description="Share of tries spread evenly over all ways to draw parents (at random, rare ones, by family, of "
        "other ancestry) and all operators; the others go to those that find most new histograms for their work.",
    )


class GrownConfig(StrictModel):
    """The size of grown shapes; by default `min_size` and `max_size` set it."""

    parts: tuple[Annotated[int, Field(ge=2)], Annotated[int, Field(ge=2)]] | None = Field(
        None, description="Minimum and maximum number of parts, met within a quarter."
    )
    footprint: tuple[Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)]] | None = Field(
        None, description="Sides of the area seen from above, in units of the models, met within a quarter."
    )


class StretchConfig(StrictModel):
    """How far the size of a part may differ from the exemplars."""

    max_factor: float = Field(
        1.0,
        ge=1,
        le=4,
        description="Largest factor by which a part may be longer or shorter in any direction; 1: none is stretched. A "
        "piece that fits, and a part that meets the constraints, keeps its size.",
    )
    rigid: tuple[str, ...] = Field((), description="Labels of parts that are never stretched.")


class SearchConfig(StrictModel):
    """How variants are searched for."""

    matching: Literal["pose", "centroid"] = Field(
        "pose",
        description="How a boundary is found in another shape: by relative poses modulo symmetry, or by the paper's "
        "types and centroid distances.",
    )
    duplicates: Literal["docking", "graph", "histogram"] = Field(
        "docking",
        description="When two shapes are the same: same graph and docking configurations, same graph, or (the paper's "
        "rule) same numbers of parts of each type.",
    )
    sub_assemblies: bool = Field(False, description="Whether a piece of an exemplar counts as a variant.")
    upright: bool = Field(
        True,
        description="Whether pieces are turned about the vertical only; set it to false for shapes that float in "
        "space.",
    )
    min_size: float = Field(
        0.5, gt=0, le=1, description="Minimum number of parts of a variant, as a share of the smallest exemplar's."
    )
    max_size: float = Field(
        2.0,
        ge=1,
        le=20,
        description="Maximum number of parts of a variant, as a multiple of that of the largest exemplar with all its "
        "part types; where none has all, of the largest exemplar.",
    )
    method: Literal["both", "exchange", "growth", "substructures", "all"] = Field(
        "both",
        description="How variants are made. `exchange`: pieces of two shapes are exchanged (with `types: meaning` also "
        "parts of one label). `growth`: shapes grow part by part from neighbourhoods seen in the exemplars. `both`: "
        "each gets its share by what it finds. `substructures`: all replaceable substructures are listed, not drawn at "
        "random. `all`: all three.",
    )
    dummy_edges: int = Field(
        1,
        ge=0,
        le=3,
        description="Dummy edges of replaceable substructures: places where the boundaries of two pieces may differ by "
        "a docking site or by an arc of parts between. The work grows exponentially with it, up to a limit in dense "
        "graphs, which status and card report.",
    )
    max_repeats: int = Field(
        3,
        ge=1,
        le=100,
        description="Maximum number of times that a recursive rule of replaceable substructures, where one of two "
        "pieces is part of the other, is applied at once: a row of arches grows or shrinks by several.",
    )
    deform: bool = Field(
        False,
        description="Whether replaceable substructures deform a piece that does not fit as a whole: each part moves as "
        "the boundary near it does. Where contacts are exact, as in most kits, inner parts lose contact, so it finds "
        "little for its time.",
    )
    stretch: StretchConfig = Field(
        default_factory=StretchConfig,
        description="Whether replaceable substructures stretch a piece until it fits, with edges matched by types "
        "alone, and whether parts are resized in height until `require.constraints` are met.",
    )
    grown: GrownConfig = Field(default_factory=GrownConfig, description="The size of grown shapes.")
    growth_share: float = Field(
        0.3,
        ge=0,
        le=1,
        description="Share of exchanged pieces that grow part by part; others are cut by a half-space, slab or box.",
    )
    exemplar_share: float = Field(
        0.15,
        ge=0,
        le=1,
        description="Share of the parents of exchanges that are exemplars; the rest are earlier variants.",
    )
    max_parents: int = Field(
        2000, ge=1, description="Maximum number of earlier variants that one search holds as parents."
    )
    parallel_searches: int = Field(2, ge=1, le=64, description="Search shards of a round, which run in parallel.")
    tries_per_round: int = Field(20_000, ge=1, description="Maximum number of tries of one search in one round.")
    patience: Literal["auto"] | Annotated[int, Field(ge=1)] = Field(
        "auto",
        description="Tries of a kit without a new variant after which its search ends. `auto`: 200,000, and for "
        "exemplars of over 100 parts fewer the larger they are, at least 40,000, which is a minute or two. After these "
        "tries it also ends where, at the pace of the last round, the missing variants would take ten times the tries "
        "so far, or those missing to choose from twice.",
    )
    max_rounds: int = Field(200, ge=1, description="Maximum number of rounds of a kit's search.")
    novelty: NoveltyConfig = Field(
        default_factory=NoveltyConfig, description="How the search is led to new variants by a MAP-Elites archive."
    )


class SelectionConfig(StrictModel):
    """How the dataset is selected from the pool of variants."""

    oversample: float = Field(
        3.0,
        ge=1,
        le=100,
        description="Variants that the search looks for, as a multiple of those wanted. The reserve, variants that add "
        "nothing to the archive, comes on top, up to four times as many in all.",
    )
    max_farthest_first: int = Field(
        10_000,
        ge=1,
        description="Maximum number of variants of a kit selected farthest first; the rest are drawn at random.",
    )


class VariantSplitConfig(SplitConfig):
    """How samples are divided into splits and shards, and what keeps splits apart."""

    by: Literal["family", "graph"] = Field(
        "family",
        description="What is kept in one split. `family`: near relatives (variants that share much of their surface, "
        "parents and children, siblings of one cut, equal graphs), with a gap between splits whose variants are "
        "discarded; raise selection.oversample where a split comes out short. `graph`: equal graphs only.",
    )
    min_shared_surface: float = Field(
        0.8,
        ge=0.3,
        le=1,
        description="Shared surface, as a share of the larger one, from which two variants are relatives when they are "
        "laid on each other as well as possible; at 0.8 the point clouds of two splits are distinguishable.",
    )


class VariantRequirements(StrictModel):
    """What a variant, its hubs restored, must be to be kept; nothing else is required."""

    rooted: bool = Field(False, description="Whether every part must be connected to the ground.")
    stable: Literal["auto"] | bool = Field(
        "auto",
        description="Whether the shape must stand and withstand small pushes. `auto`: where all exemplars of a kit do "
        "and a short search finds some variants that do not, and enough that do. A kit without `auto` keys is not "
        "searched, and no variant is rejected.",
    )
    physics: PhysicsConfig = Field(
        default_factory=PhysicsConfig,
        description="How `rooted` and `stable` are judged. Records are judged by the section validity: use the same "
        "there.",
    )
    labels: Literal["auto"] | tuple[str, ...] = Field(
        "auto",
        description="Required labels: every variant must have a part of each, such as the top and the sides of a "
        "cabinet. `auto`: labels of spanning parts, with two thirds of the diagonal of every exemplar, for a kit with "
        "`auto` keys; otherwise none.",
    )
    keep_types: Literal["auto"] | bool | tuple[str, ...] = Field(
        "auto",
        description="Labels that every variant must have, in about their share in the exemplars: a race "
        "track keeps its track. true: all that occur in each exemplar, hubs aside; false: none. `auto`: true, without "
        "those that a short search cannot keep; false if `search.sub_assemblies` are variants. Unless false, variants "
        "with all types that occur in each exemplar are selected first.",
    )
    share_factor: float = Field(
        DEFAULT_SHARE_FACTOR,
        ge=1,
        le=100,
        description="Factor by which the range of shares that a label of `keep_types` has in the exemplars is widened "
        "to either side, in whole parts: at 2, of one door in 40 parts there are 1 to 4 in 80.",
    )
    min_hubs: Literal["auto"] | Annotated[int, Field(ge=0)] | Annotated[float, Field(gt=0, lt=1)] = Field(
        "auto",
        description="Minimum number of hub parts that must be restored: a pile of bricks on which no road fits is no "
        "bridge. Below 1: the most connected hub type must have this share of its number per part in the exemplars, "
        "all spanning hubs must be there, and at most 5 % of the parts may lack a hub type that all parts of their "
        "type touch in the exemplars. `auto`: 0.5 for a kit whose hubs were chosen, otherwise 0.",
    )
    constraints: dict[str, dict[str, tuple[str, ...]]] = Field(
        default_factory=dict,
        description="Global constraints by name, with the labels of parts that each concerns: `support: {}`, "
        "`path: {entries: [...], exits: [...], through: [...]}`, or one in a file of your own.",
    )
    max_copied_share: Literal["auto"] | Annotated[float, Field(gt=0, le=1)] = Field(
        "auto",
        description="Maximum share of its parts, without hubs, in one verbatim piece of an exemplar; 1 rejects none. "
        "`auto`: 0.9 for a kit for which a short search finds enough other variants, otherwise 1. A kit without `auto` "
        "keys is not searched, and no variant is rejected.",
    )

    @property
    def auto_keys(self) -> tuple[str, ...]:
        """The keys of resolved settings that are left at `auto`."""
        stated = {
            MAX_COPIED_SHARE_KEY: self.max_copied_share,
            STABLE_KEY: self.stable,
            REQUIRED_LABELS_KEY: self.labels,
            KEEP_TYPES_KEY: self.keep_types,
        }
        return tuple(key for key, value in stated.items() if value == "auto")

    def physical(self, stable: bool) -> Requirements:
        """Return the physical requirements. stable: the stated or resolved value of that key."""
        return Requirements(rooted=self.rooted, stable=stable, physics=self.physics)


class VariationsConfig(StrictModel):
    """The variations of each kit."""

    samples_per_kit: int = Field(
        500,
        ge=0,
        le=1_000_000_000,
        description="Variants wanted of each kit; 0 for a dataset of these kits that is made in another way.",
    )
    fallback: Literal["auto", "nothing"] = Field(
        "auto",
        description="What is made of exemplars for which a short search finds almost no other layouts, or only similar "
        "ones, and of those whose rows are held by parts that most others touch, such as a cabinet; also of models of "
        "a building set whose layouts look alike, but whose storeys or bays can be inserted. `auto`: for a single kit "
        "with `auto` keys, the same number of resized shapes, by the section `proportions`, with other rows, bays and "
        "fronts if there are any, if these hold together.",
    )
    search: SearchConfig = Field(default_factory=SearchConfig, description="How variants are searched for.")
    rows: RowsConfig = Field(
        default_factory=RowsConfig, description="How rows of congruent parts become longer and shorter."
    )
    selection: SelectionConfig = Field(
        default_factory=SelectionConfig, description="How the dataset is selected from what was found."
    )
    require: VariantRequirements = Field(
        default_factory=VariantRequirements,
        description="What every variant must be, its hubs restored; others are rejected and counted.",
    )
    splits: VariantSplitConfig = Field(
        default_factory=VariantSplitConfig, description="How samples are divided into splits and shards."
    )

    @property
    def keeps_identity(self) -> bool:
        """Whether variants without a part type of every exemplar are worth less than others."""
        return self.require.keep_types is not False and not self.search.sub_assemblies
