"""The key `rows` of the section `variations`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.config import StrictModel


class RowsConfig(StrictModel):
    """How rows of congruent parts become longer and shorter."""

    use: Literal["auto"] | bool = Field(
        "auto",
        description="Whether exemplars get longer and shorter rows. `auto`: in a search by `share`, and of resized "
        "exemplars where a short search finds almost no other layouts (see `fallback`); both only if there are rows. "
        "Fronts of resized exemplars, such as doors, are then divided too (see `divide_fronts`).",
    )
    divide_fronts: bool = Field(
        True,
        description="Whether doors, drawers and other fronts of resized exemplars are divided into several. Without "
        "`use` they never are. `make inspect` forecasts shapes as if this were true.",
    )
    share: float = Field(
        0.25,
        ge=0,
        le=1,
        description="Share of the variants of a search's first round that are exemplars with longer and shorter rows, "
        "where these consist of the kit's own parts; pieces of them are then exchanged as of any other. Lower where "
        "there are fewer such shapes.",
    )
    min_count: float = Field(
        0.5,
        gt=0,
        le=1,
        description="Minimum length of a row, as a multiple of its length in the exemplar, rounded down to at least 1.",
    )
    max_count: float = Field(
        2.0,
        ge=1,
        le=20,
        description="Maximum length of a row, as a multiple of its length in the exemplar. The ends of a shape between "
        "which bays are inserted count as a row of two.",
    )
    max_changes: int = Field(3, ge=1, le=20, description="Maximum number of rows that one shape changes.")
    size: Literal["keep", "grow"] = Field(
        "keep",
        description="Overall size of a shape with other rows. `keep`: its sides stay within `size_range`, and its "
        "parts shrink or grow to fit. `grow`: parts and steps keep their sizes.",
    )
    size_range: tuple[Annotated[float, Field(gt=0, le=1)], Annotated[float, Field(ge=1)]] = Field(
        (0.7, 1.5),
        description="With `size: keep`: smallest and largest side of the box around a shape, as a multiple of that of "
        "the exemplar.",
    )

    @property
    def pool_share(self) -> float:
        """The share of a search's first round, 0 without rows."""
        return 0.0 if self.use is False else self.share
