"""What a config says of programs that are extracted from part hierarchies."""

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
    """Files of one kind of shape."""

    name: str = Field(
        pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$",
        max_length=64,
        description="What the shapes are, such as chair; the keys of the samples begin with it.",
    )
    # excluded from what the stage's fingerprint sees, as the credit of exemplars is
    credit: Credit = Field(
        default_factory=Credit, exclude=True, description="Whose they are; card and manifest say it."
    )


class HierarchyFiles(NamedFiles):
    """Part hierarchies of one kind of shape."""

    path: Annotated[Path, AfterValidator(_existing)] = Field(
        description="A folder, searched with all below it, or one file."
    )
    kind: HierarchyKind = Field(
        description="structurenet: .json files; partnet: result_after_merging.json files with objs/ beside them; "
        "grass: one .npz file; glb: .glb files, whose scene graph is the hierarchy."
    )
    category: Category = Field(
        "any",
        description="Whose rules flatten, collapse and order parts by their PartNet labels; any: the hierarchy stays.",
    )
    up: Literal["y", "z"] = Field("y", description="The axis that points up in glb files; the others are y up.")

    @property
    def source(self) -> HierarchySource:
        """What reads the files."""
        return HierarchySource(self.path, self.kind, self.up)

    @property
    def rules(self) -> CategoryRules:
        """The rules of the category."""
        return CATEGORY_RULES[self.category]


class Gates(StrictModel):
    """What an extracted program must pass (shapeassembly §5.3 and the published training set)."""

    f_score: float = Field(75.0, ge=0, le=100, description="Least F-score against the boxes of the input, percent.")
    distance: float = Field(
        0.02, gt=0, lt=1, description="Up to which surfaces agree, as a share of the diagonal of the shape."
    )
    min_leaves: int = Field(3, ge=1, description="Fewest cuboids that the program declares and does not expand.")
    max_leaves: int = Field(12, ge=1, description="Most cuboids that the program declares and does not expand.")
    overflow: float = Field(
        0.05, gt=0, description="How far parts may reach out of the bounding box, as a share of its size; less passes."
    )


class Cleaning(StrictModel):
    """Which steps make hierarchies tidier before a program is written (shapeassembly §5.1, App. C)."""

    shorten: bool = Field(True, description="Leaves sunk into others are cut back to where they can be seen.")
    arrange: bool = Field(
        True, description="Nodes are flattened, collapsed and gathered by the rules of their category."
    )
    group: bool = Field(True, description="Parts that repeat are made by reflect and translate.")
    pool: bool = Field(
        True, description="Of parts that hang together and repeat together, one assembly is made before, and repeated."
    )


EVERY_STEP = Cleaning()
