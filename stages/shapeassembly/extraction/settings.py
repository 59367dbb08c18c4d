"""The config of programs that are extracted from part hierarchies."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from pipeline.config import StrictModel
from stages.shape.collection.origin import Credit
from stages.shapeassembly.extraction.category_rules import CATEGORY_RULES, CategoryRules
from stages.shapeassembly.extraction.readers.source import HierarchyKind, HierarchySource

Category = Literal["any", "chair", "table", "storage"]


def _existing(path: Path) -> Path:
    if not path.exists():
        raise ValueError(f"there is no folder and no file {path}")
    return path


class NamedFiles(StrictModel):
    """Files of one category of shapes."""

    name: str = Field(
        pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$",
        max_length=64,
        description="Category of the shapes, such as chair; it starts the keys of their samples.",
    )
    # excluded from the fingerprint of the stage, like the credit of exemplars
    credit: Credit = Field(
        default_factory=Credit, exclude=True, description="Authors and licence, stated in card and manifest."
    )


class HierarchyFiles(NamedFiles):
    """Part hierarchies of one category of shapes."""

    path: Annotated[Path, AfterValidator(_existing)] = Field(description="A folder, searched recursively, or one file.")
    kind: HierarchyKind = Field(
        description="structurenet: .json files; partnet: result_after_merging.json files and objs/ in one folder; "
        "grass: one .npz file; model: model files (GLB, glTF, OBJ, PLY, STL, OFF, DAE), whose nodes, objects or "
        "connected components are the parts; glb: of these the .glb files."
    )
    category: Category = Field(
        "any",
        description="Category whose rules flatten, collapse and order parts by PartNet labels; any: no rules.",
    )
    up: Literal["auto", "y", "z"] = Field(
        "auto",
        description="The axis that points up in model files; `auto` takes what the file says, else y. Others are y up.",
    )

    @property
    def source(self) -> HierarchySource:
        """The reader of the files."""
        return HierarchySource(self.path, self.kind, self.up)

    @property
    def rules(self) -> CategoryRules:
        """The rules of the category."""
        return CATEGORY_RULES[self.category]


class Gates(StrictModel):
    """The quality gates of an extracted program (shapeassembly §5.3 and the published training set)."""

    min_f_score: float = Field(
        75.0, ge=0, le=100, description="Minimum F-score against the boxes of the input; unit: percent."
    )
    distance: float = Field(
        0.02, gt=0, lt=1, description="Distance within which surfaces agree, as a share of the diagonal of the shape."
    )
    min_leaves: int = Field(3, ge=1, description="Minimum number of declared cuboids that are not expanded.")
    max_leaves: int = Field(12, ge=1, description="Maximum number of declared cuboids that are not expanded.")
    max_overflow: float = Field(
        0.05, gt=0, description="Maximum excess of parts over the bounding box, as a share of its size."
    )


class Cleaning(StrictModel):
    """Steps that clean hierarchies before a program is extracted (shapeassembly §5.1, App. C)."""

    shorten: bool = Field(True, description="Cut leaves back to their visible part where they are sunk into others.")
    arrange: bool = Field(True, description="Flatten, collapse and gather nodes by the rules of their category.")
    group: bool = Field(True, description="Make repeated parts by reflect and translate.")
    pool: bool = Field(True, description="First merge connected parts that repeat together into one assembly.")


EVERY_STEP = Cleaning()
