"""The `variations` section of a config."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.config import StrictModel
from stages.shape.collection.assignment import SplitConfig
from stages.shape.physics.settings import PhysicsConfig, Requirements
from stages.shape.resolved_settings import MAX_COPIED_SHARE_KEY, REQUIRED_LABELS_KEY, STABLE_KEY
from stages.variations.novelty.features import Axis


class NoveltyConfig(StrictModel):
    """How the search is led to what its pool lacks: an archive of cells, rare ones first."""

    guided: bool = Field(
        True, description="Whether the archive leads the search; without it parents and cuts are plain random."
    )
    axes: tuple[Axis, ...] = Field(
        ("parts", "footprint", "height", "cycle_rank", "mixture", "neighbourhood_mixture", "distance"),
        min_length=1,
        description="Axes of the archive's grid: number of parts, area seen from above, height, longer by shorter "
        "side, edges beyond a tree, share of parts from other exemplars than the main one, share of "
        "telling neighbourhoods from other exemplars than the main one, histogram distance to the "
        "nearest exemplar, share of parts in the largest piece copied whole from an exemplar, commonest part type.",
    )
    resolution: int = Field(
        4, ge=1, le=64, description="Cells along a doubling of a size; a share has four times as many from 0 to 1."
    )
    cell_quota: int = Field(
        8,
        ge=1,
        description="Variants of a cell after which one more of a known histogram is spare: it goes into the pool, but "
        "the search neither counts it nor builds on it.",
    )
    exploration: float = Field(
        0.2,
        ge=0.01,
        le=1,
        description="Share of tries spread alike over all ways to draw parents (at random, rare ones, by family, of "
        "other ancestry) and to cut; the others go to those ways that find most new histograms for their work.",
    )


class GrownConfig(StrictModel):
    """The size of shapes that are grown; without it they are as large as `smallest` and `largest` say."""

    parts: tuple[Annotated[int, Field(ge=2)], Annotated[int, Field(ge=2)]] | None = Field(
        None, description="Fewest and most parts, met within a quarter."
    )
    footprint: tuple[Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)]] | None = Field(
        None, description="Sides of the area seen from above, in units of the models, met within a quarter."
    )


class StretchConfig(StrictModel):
    """How far a part may be made another size than it has in the exemplars."""

    max_factor: float = Field(
        1.0,
        ge=1,
        le=4,
        description="How many times longer or shorter than it is a part may be made in any direction; 1: none is. "
        "Where a piece fits as it is, or a constraint holds, nothing is stretched.",
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
    sub_assemblies: bool = Field(
        False, description="Whether a shape that is nothing but a piece of an exemplar counts as a variant."
    )
    upright: bool = Field(
        True,
        description="Whether pieces are turned about the vertical only; set it to false for what floats in space.",
    )
    min_size: float = Field(
        0.5, gt=0, le=1, description="Fewest parts of a variant, as a share of the smallest exemplar's."
    )
    max_size: float = Field(
        2.0,
        ge=1,
        le=20,
        description="Most parts of a variant, as a share of the largest exemplar's of those that have all its part "
        "types; where none has all, of the largest.",
    )
    method: Literal["both", "exchange", "growth", "substructures", "all"] = Field(
        "both",
        description="How variants are made: pieces of two shapes are exchanged (with `types: meaning` also parts that "
        "mean the same), shapes are grown part by part from what was seen around parts, or both, each given its share "
        "by what it finds; by replaceable substructures, where all pieces that can take each other's place are listed, "
        "not drawn by chance; or all three.",
    )
    dummy_edges: int = Field(
        1,
        ge=0,
        le=3,
        description="Dummy edges of replaceable substructures: places where the boundaries of two pieces may differ by "
        "a docking site or by an arc of parts between. What is looked at grows exponentially with it, up to a limit in "
        "dense graphs, which status and card then tell.",
    )
    max_repeats: int = Field(
        3,
        ge=1,
        le=100,
        description="Most times that a recursive rule of replaceable substructures, where one of two pieces is part of "
        "the other, is carried out at once: it lets a row of arches grow or shrink by several.",
    )
    deform: bool = Field(
        False,
        description="Whether replaceable substructures bend a piece that does not fit as a whole: each of its parts "
        "moves as the boundary near it does. Parts between come out of contact where contacts are as exact as those of "
        "most kits: it finds little beside the time that it takes.",
    )
    stretch: StretchConfig = Field(
        default_factory=StretchConfig,
        description="Whether replaceable substructures stretch a piece as a whole until it fits its place, edges then "
        "being matched by types alone; and whether parts are resized in height until `require.constraints` are met.",
    )
    grown: GrownConfig = Field(default_factory=GrownConfig, description="What grown shapes are to be like.")
    growth_share: float = Field(
        0.3,
        ge=0,
        le=1,
        description="Share of exchanged pieces that are grown part by part; others are cut by half-space, slab or box.",
    )
    exemplar_share: float = Field(
        0.15,
        ge=0,
        le=1,
        description="Share of the exchange's parents drawn from the exemplars; the rest are earlier variants.",
    )
    max_parents: int = Field(
        2000, ge=1, description="Most earlier variants that one shard of the search holds as parents."
    )
    parallel_searches: int = Field(
        2, ge=1, le=64, description="Shards of the search that run beside each other in a round."
    )
    tries_per_round: int = Field(20_000, ge=1, description="Most tries of one lane in one round.")
    patience: Literal["auto"] | Annotated[int, Field(ge=1)] = Field(
        "auto",
        description="Tries of a kit without a new variant after which its search has ended; `auto`: 200,000, and for "
        "exemplars of over 100 parts the fewer the larger they are, 40,000 at least, which is a minute or two. After "
        "so many it ends, too, where at the pace of the last round the variants that are missing would take ten times "
        "the tries so far, or what is missing to choose from twice.",
    )
    max_rounds: int = Field(200, ge=1, description="Most rounds of a kit's search.")
    novelty: NoveltyConfig = Field(
        default_factory=NoveltyConfig, description="How the search is led to what its pool lacks."
    )


class SelectionConfig(StrictModel):
    """How the dataset is chosen from the pool of found variants."""

    oversample: float = Field(
        3.0,
        ge=1,
        le=100,
        description="Variants that the search looks for, as a multiple of those wanted; those that add nothing "
        "to the archive come on top, up to four times as many in all.",
    )
    max_farthest_first: int = Field(
        10_000,
        ge=1,
        description="Most variants of a kit that are chosen farthest first; the rest are drawn at random.",
    )


class VariantSplitConfig(SplitConfig):
    """How the samples are divided into splits and shards, and what keeps splits apart."""

    by: Literal["family", "graph"] = Field(
        "family",
        description="What stands whole in one split: near relatives, with a gap between splits (variants that share "
        "much of their surface, parents and children, siblings of one cut, and equal graphs; what stands between two "
        "splits is let go of, so ask for a larger pool, selection.oversample, where a split comes out short), or "
        "equal graphs and no more.",
    )
    min_shared_surface: float = Field(
        0.8,
        ge=0.3,
        le=1,
        description="Share of the larger surface that two variants have in common, laid upon each other as well as "
        "may be, from which on they are relatives; at 0.8 the point clouds of two splits are told apart.",
    )


class VariantRequirements(StrictModel):
    """What a variant must be, its backdrop included, so that it is kept; what is not named is not required."""

    rooted: bool = Field(False, description="Whether every part must be connected to the ground.")
    stable: Literal["auto"] | bool = Field(
        "auto",
        description="Whether the shape must stand and bear small pushes. `auto`: for a kit whose exemplars do, where a "
        "short search finds some that do not, and enough that do; a kit that leaves no key of its own to be chosen is "
        "not searched, and none is refused.",
    )
    physics: PhysicsConfig = Field(
        default_factory=PhysicsConfig,
        description="What they are judged by. Records are judged by the section validity: say the same there.",
    )
    labels: Literal["auto"] | tuple[str, ...] = Field(
        "auto",
        description="Labels of which every variant must have a part, such as the top and the sides of a cabinet. "
        "`auto`: those of which every exemplar has a part about as large as itself (two thirds of its diagonal), for a "
        "kit that leaves a key of its own to be chosen; else none.",
    )
    min_hubs: Literal["auto"] | Annotated[int, Field(ge=0)] | Annotated[float, Field(gt=0, lt=1)] = Field(
        "auto",
        description="Fewest hub parts that it must get back as its backdrop: a pile of bricks on which no road fits is "
        "no bridge. Below 1: of the type that touches most, the share of what so many parts have of it in the "
        "exemplars, of hubs as large as the exemplars all, and beside 95 % of its parts each type of hub that all of "
        "their type touch there. `auto`: 0.5, of a kit whose hubs were chosen and not stated.",
    )
    constraints: dict[str, dict[str, tuple[str, ...]]] = Field(
        default_factory=dict,
        description="Global constraints, by name, with the labels of parts that each speaks of: `support: {}`, "
        "`path: {entries: [...], exits: [...], through: [...]}`, or one in a file of your own.",
    )
    max_copied_share: Literal["auto"] | Annotated[float, Field(gt=0, le=1)] = Field(
        "auto",
        description="Greatest share of its parts, without its backdrop, that may stand in one piece just so in an "
        "exemplar; 1 refuses none. `auto`: 0.9 for a kit of which a short search finds enough beside such copies, else "
        "1; a kit that leaves no key of its own to be chosen is not searched, and none is refused.",
    )

    @property
    def auto_keys(self) -> tuple[str, ...]:
        """Those of CHOSEN_COPIED, CHOSEN_STABLE and CHOSEN_CARCASS that are left at `auto`."""
        said = {MAX_COPIED_SHARE_KEY: self.max_copied_share, STABLE_KEY: self.stable, REQUIRED_LABELS_KEY: self.labels}
        return tuple(key for key, each in said.items() if each == "auto")

    def physical(self, stable: bool) -> Requirements:
        """What a shape must be physically, where `stable` says what was chosen or stated of that key."""
        return Requirements(rooted=self.rooted, stable=stable, physics=self.physics)


class VariationsConfig(StrictModel):
    """The variations of each kit."""

    samples_per_kit: int = Field(
        500,
        ge=0,
        le=1_000_000_000,
        description="Variants wanted of each kit; 0 for a dataset of these kits that is made otherwise.",
    )
    fallback: Literal["auto", "nothing"] = Field(
        "auto",
        description="What is made of exemplars of which a short search finds next to no other layouts, or all of them "
        "alike. `auto`: of a single kit that leaves a key of its own to be chosen, as many shapes of the same layout "
        "in other proportions, by the section `proportions`, if these hold together.",
    )
    search: SearchConfig = Field(default_factory=SearchConfig, description="How variants are searched for.")
    selection: SelectionConfig = Field(
        default_factory=SelectionConfig, description="How the dataset is chosen from what was found."
    )
    require: VariantRequirements = Field(
        default_factory=VariantRequirements,
        description="What every variant must be physically, its backdrop included; others are refused and counted.",
    )
    splits: VariantSplitConfig = Field(
        default_factory=VariantSplitConfig, description="How the samples are shared out."
    )
