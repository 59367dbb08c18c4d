"""The `structure` section of a config."""

from __future__ import annotations

from pydantic import Field

from pipeline.config import StrictModel


class StructureConfig(StrictModel):
    """What records say of the hierarchy and the symmetry of each shape; by default nothing."""

    hierarchy: bool = Field(
        False,
        description="whether records and GLBs have groups of parts: assemblies of ShapeAssembly programs, parts of "
        "curve programs that move together, and in shapes of kits the nodes of the models and rows of congruent parts; "
        "any other shape is one group",
    )
    symmetry: bool = Field(
        False,
        description="whether records have the rotations about the vertical and the upright mirrors that map the parts "
        "of a shape onto each other, and which parts are images of each other",
    )

    @property
    def is_requested(self) -> bool:
        """Whether the stage adds anything."""
        return self.hierarchy or self.symmetry
