"""The `sketches` section of a config."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from pipeline.config import StrictModel
from stages.shape.collection.optional_section import OptionalSection
from stages.shape.views.buffers import RendererName


class SketchView(StrictModel):
    """One drawing of each sample, and how much its camera varies between samples."""

    name: str = Field(
        "view", pattern=r"^[a-z0-9_]+$", max_length=64, description="name of the view, as the sample's JSON lists it"
    )
    azimuth: float = Field(
        -40.0, ge=-360.0, le=360.0, description="angle around the up axis, 0 from the front, 90 from +x; unit: degrees"
    )
    elevation: float = Field(25.0, ge=-90.0, le=90.0, description="angle above the horizon; unit: degrees")
    projection: Literal["perspective", "orthographic"] = Field("perspective", description="kind of projection")
    fov: float = Field(30.0, ge=2.0, le=100.0, description="full angle of view; unit: degrees")
    distance: float | None = Field(
        None,
        ge=1.05,
        le=100.0,
        description="distance of the camera from the middle of the shape; unit: radii of its bounding sphere; null "
        "fits the shape into the picture",
    )
    margin: float = Field(
        0.06, ge=0.0, le=0.4, description="share of the picture left free on each side when fitted; unit: share"
    )
    azimuth_jitter: float = Field(
        0.0, ge=0.0, le=180.0, description="azimuth is drawn uniformly within this on either side; unit: degrees"
    )
    elevation_jitter: float = Field(
        0.0, ge=0.0, le=90.0, description="elevation is drawn uniformly within this on either side; unit: degrees"
    )
    fov_jitter: float = Field(
        0.0, ge=0.0, le=30.0, description="fov is drawn uniformly within this on either side; unit: degrees"
    )
    distance_jitter: float = Field(
        0.0, ge=0.0, le=0.9, description="distance is drawn uniformly within this share of it; unit: share"
    )

    @model_validator(mode="after")
    def _stays_in_range(self) -> SketchView:
        if self.fov - self.fov_jitter < 1.0:
            raise ValueError(f"fov_jitter {self.fov_jitter} takes fov {self.fov} below 1 degree")
        if self.distance is None and self.distance_jitter > 0.0:
            raise ValueError("distance_jitter needs a distance")
        if self.distance is not None and self.distance * (1.0 - self.distance_jitter) < 1.05:
            raise ValueError("distance_jitter takes the camera into the shape: at least 1.05 radii must remain")
        return self


class StrokeOptions(StrictModel):
    """What is drawn, and how heavily. Widths and lengths are in pixels of the finished picture."""

    outline: float = Field(1.8, ge=0.0, le=20.0, description="line width against the background; unit: pixels")
    contour: float = Field(
        1.3, ge=0.0, le=20.0, description="line width where a surface hides what lies behind; unit: pixels"
    )
    boundary: float = Field(1.0, ge=0.0, le=20.0, description="line width where two parts meet; unit: pixels (0: none)")
    crease: float = Field(1.0, ge=0.0, le=20.0, description="line width of sharp edges; unit: pixels (0: none)")
    crease_angle: float = Field(
        35.0, gt=0.0, le=180.0, description="edges whose faces turn by more than this are sharp; unit: degrees"
    )
    step: float = Field(
        0.25, gt=0.0, le=20.0, description="smallest jump in depth that is drawn as a contour; unit: pixels"
    )
    shortest: float = Field(
        4.0, ge=0.0, le=100.0, description="connected lines of less total length are left out; unit: pixels"
    )
    crowding: float = Field(
        3.0,
        ge=0.0,
        le=50.0,
        description="where lines are closer than this, inner lines get thinner and lighter; unit: pixels (0: never)",
    )
    ink: float = Field(0.9, gt=0.0, le=1.0, description="darkness of a full line, 1 is black; unit: share")


class Augmentation(StrictModel):
    """Chances with which each drawing is changed after it is drawn."""

    flip: float = Field(0.0, ge=0.0, le=1.0, description="mirror left and right; unit: probability")
    dilate: float = Field(0.0, ge=0.0, le=1.0, description="thicken all lines; unit: probability")
    erode: float = Field(0.0, ge=0.0, le=1.0, description="thin all lines out; unit: probability")
    size: int = Field(3, ge=3, le=15, description="side of the square for dilate and erode; unit: pixels")

    @model_validator(mode="after")
    def _one_morphology(self) -> Augmentation:
        if self.dilate + self.erode > 1.0:
            raise ValueError("dilate and erode exclude each other: their probabilities add up to more than 1")
        return self


class SketchesConfig(OptionalSection):
    """How many drawings each sample gets, from where, and in what style."""

    size: int = Field(224, ge=16, le=2048, description="side of the square picture; unit: pixels")
    supersample: int = Field(
        2, ge=1, le=8, description="the view is rendered this many times finer in x and y; unit: pixels per pixel"
    )
    views: tuple[SketchView, ...] = Field(
        (
            SketchView(name="left", azimuth=-40.0, elevation=25.0),
            SketchView(name="right", azimuth=35.0, elevation=15.0),
            SketchView(name="high", azimuth=25.0, elevation=55.0),
        ),
        max_length=64,
        strict=False,
        description="one drawing each, `sketch0.png`, `sketch1.png`, ...; empty: no drawings",
    )
    strokes: StrokeOptions = Field(StrokeOptions(), description="what is drawn, and how heavily")
    augment: Augmentation = Field(Augmentation(), description="chances of changes after drawing")
    renderer: RendererName = Field(
        "raster",
        description="what finds the visible surfaces in sketches and preview; raster: our own rasteriser, the "
        "same everywhere; egl: OpenGL, always by Mesa's llvmpipe, at the system's version. Their pictures differ in a "
        "few pixels",
    )

    @model_validator(mode="after")
    def _names_differ(self) -> SketchesConfig:
        names = [view.name for view in self.views]
        if len(set(names)) < len(names):
            raise ValueError(f"two views have one name: {sorted(names)}")
        return self
