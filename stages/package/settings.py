"""The `package` section of a config: facts for the dataset's card."""

from __future__ import annotations

from pydantic import Field

from pipeline.config import StrictModel


class PackageConfig(StrictModel):
    """Facts for the card, `croissant.json` and the preview picture."""

    creator: str = Field("Shapemill", min_length=1, description="who made the dataset: a person or an organization")
    published: str = Field(
        "2026-01-01",
        pattern=r"^\d{4}-\d{2}-\d{2}$",
        description="date that the card and croissant.json state, year-month-day; no clock is ever asked",
    )
    tags: tuple[str, ...] = Field(
        ("3d", "shapes", "shape-graphs", "procedural"), description="tags of the card, besides the names of the kits"
    )
    task_categories: tuple[str, ...] = Field(
        (),
        description="Hugging Face task categories of the card; if empty, those that its members serve: image-to-3d "
        "where samples have drawings or images, text-to-3d where they have captions",
    )
    previewed: int = Field(24, ge=1, le=96, description="variants that the preview picture shows; unit: variants")
