"""The `views` section of a config."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field, model_validator

from pipeline.config import StrictModel

ImageKind = Literal["color", "depth", "normals", "instances", "classes", "mask", "drawing"]

MIN_DISTANCE_RADII = 1.05
"""Nearest distance of a camera along its axis: the whole shape stays in front of it."""
MAX_VIEWS = 256
MAX_ROTATION_ERROR = 1e-6


class Lens(StrictModel):
    """What the cameras of one entry share."""

    projection: Literal["perspective", "orthographic"] = Field("perspective", description="kind of projection")
    fov: float = Field(
        40.0, ge=2.0, le=100.0, description="full angle of view of the shorter side of the picture; unit: degrees"
    )


class OrbitLens(Lens):
    """Cameras that look at the middle of the shape."""

    distance: float | None = Field(
        None,
        ge=MIN_DISTANCE_RADII,
        le=100.0,
        description="distance from the middle of the shape; unit: radii of its bounding sphere; null fits the sphere "
        "into the picture",
    )
    margin: float = Field(
        0.05, ge=0.0, le=0.4, description="share of the picture left free on each side of the fitted sphere"
    )


class RingCameras(OrbitLens):
    """Cameras at one height around the shape, evenly spaced."""

    kind: Literal["ring"] = Field("ring", description="arrangement: ring, sphere, random or poses")
    count: int = Field(8, ge=1, le=MAX_VIEWS, description="number of cameras")
    elevation: float = Field(20.0, ge=-90.0, le=90.0, description="angle above the horizon; unit: degrees")
    azimuth: float = Field(
        0.0, ge=-360.0, le=360.0, description="angle of the first camera, 0 from the front, 90 from +x; unit: degrees"
    )


class Band(OrbitLens):
    """Cameras on a band of the sphere around the shape."""

    count: int = Field(8, ge=1, le=MAX_VIEWS, description="number of cameras")
    min_elevation: float = Field(-90.0, ge=-90.0, le=90.0, description="lowest camera; unit: degrees")
    max_elevation: float = Field(90.0, ge=-90.0, le=90.0, description="highest camera; unit: degrees")

    @model_validator(mode="after")
    def _band_has_extent(self) -> Band:
        if self.min_elevation > self.max_elevation:
            raise ValueError(f"min_elevation {self.min_elevation} is above max_elevation {self.max_elevation}")
        return self


class SphereCameras(Band):
    """Cameras spread evenly over a sphere, on a Fibonacci spiral."""

    kind: Literal["sphere"] = Field("sphere", description="arrangement: ring, sphere, random or poses")
    turned: bool = Field(
        False, description="whether the spiral of each sample is turned about the up axis by a random angle"
    )


class RandomCameras(Band):
    """Cameras drawn uniformly from a sphere, other ones for each sample."""

    kind: Literal["random"] = Field("random", description="arrangement: ring, sphere, random or poses")


class PosedCameras(Lens):
    """Given cameras, the same for each sample."""

    kind: Literal["poses"] = Field("poses", description="arrangement: ring, sphere, random or poses")
    poses: tuple[tuple[tuple[float, ...], ...], ...] = Field(
        min_length=1,
        max_length=MAX_VIEWS,
        description="camera-to-world matrices, 4x4, with OpenCV's axes (x right, y down, z into the picture), y up in "
        "the world; unit: radii of the bounding sphere of the shape, from its middle",
    )

    @model_validator(mode="after")
    def _poses_see_the_whole_shape(self) -> PosedCameras:
        for index, pose in enumerate(self.poses):
            if [len(row) for row in pose] != [4, 4, 4, 4] or pose[3] != (0.0, 0.0, 0.0, 1.0):
                raise ValueError(f"poses[{index}] is no 4x4 matrix whose last row is 0 0 0 1")
            right, down, ahead, place = (tuple(row[column] for row in pose[:3]) for column in range(4))
            turned = _cross(right, down)
            errors = [abs(_dot(right, right) - 1.0), abs(_dot(down, down) - 1.0), abs(_dot(right, down))]
            errors += [abs(a - b) for a, b in zip(turned, ahead, strict=True)]
            if max(errors) > MAX_ROTATION_ERROR:
                raise ValueError(f"poses[{index}] is no rotation with a translation")
            depth = -_dot(ahead, place)
            if depth < MIN_DISTANCE_RADII:
                raise ValueError(
                    f"poses[{index}] has the middle of the shape {depth:.3g} radii ahead; at least "
                    f"{MIN_DISTANCE_RADII} keep the whole shape in front of the camera"
                )
        return self


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


AnyCameras = Annotated[RingCameras | SphereCameras | RandomCameras | PosedCameras, Field(discriminator="kind")]


class ColorOptions(StrictModel):
    """How colour images are shaded and stored."""

    format: Literal["png", "jpeg", "webp"] = Field(
        "png", description="file format; jpeg and webp are lossy, and jpeg has no transparency"
    )
    quality: int = Field(90, ge=1, le=100, description="quality of jpeg and webp; unit: percent")
    background: Literal["white", "transparent"] = Field(
        "white", description="white: three channels; transparent: a fourth channel, alpha, not multiplied in"
    )
    lighting: Literal["lit", "unlit"] = Field(
        "lit", description="lit: a distant light and the sky, which stay with the shape; unlit: the base colour alone"
    )
    shadows: bool = Field(True, description="whether the shape casts shadows on itself; lit images only")
    light_azimuth: float = Field(
        -50.0, ge=-360.0, le=360.0, description="direction of the light around the up axis; unit: degrees"
    )
    light_elevation: float = Field(
        50.0, ge=-90.0, le=90.0, description="direction of the light above the horizon; unit: degrees"
    )
    supersample: int = Field(
        2, ge=1, le=8, description="colour is the mean of this many samples in x and y; unit: samples per pixel"
    )

    @model_validator(mode="after")
    def _format_holds_background(self) -> ColorOptions:
        if self.format == "jpeg" and self.background == "transparent":
            raise ValueError("jpeg has no transparency; take format png or webp, or background white")
        return self


class ViewsConfig(StrictModel):
    """Rendered images of each sample, if there are cameras."""

    cameras: tuple[AnyCameras, ...] = Field(
        (), max_length=64, strict=False, description="where the cameras are; empty: no views"
    )
    width: int = Field(256, ge=16, le=4096, description="width of the images; unit: pixels")
    height: int = Field(256, ge=16, le=4096, description="height of the images; unit: pixels")
    images: tuple[ImageKind, ...] = Field(
        ("color", "depth", "normals", "instances"),
        min_length=1,
        strict=False,
        description="images of each view: color, depth, normals, instances (parts), classes (of parts), mask, drawing",
    )
    color: ColorOptions = Field(ColorOptions(), description="how colour images are shaded and stored")
    depth_format: Literal["png", "exr"] = Field(
        "png", description="png: 16 bits, times the record's depth_scale; exr: 32-bit floats, channel Z"
    )
    normals_format: Literal["png", "exr"] = Field("png", description="png: 8 bits a channel; exr: half floats")
    normals_space: Literal["camera", "world"] = Field(
        "camera", description="axes of normals: those of the camera, as OpenCV's, or those of the mesh"
    )
    multichannel: bool = Field(
        False,
        description="whether depth, normals, ids and mask of a view are channels of one EXR, `view0.exr`",
    )

    @model_validator(mode="after")
    def _fits_together(self) -> ViewsConfig:
        if len(set(self.images)) < len(self.images):
            raise ValueError(f"images names one twice: {', '.join(self.images)}")
        if not self.cameras and self.model_fields_set - {"cameras"}:
            raise ValueError("views without cameras has no images; add cameras, such as [{kind: ring, count: 8}]")
        if view_count(self) > MAX_VIEWS:
            raise ValueError(f"{view_count(self)} views are more than {MAX_VIEWS}")
        return self


def view_count(config: ViewsConfig) -> int:
    """Return the number of views of each sample."""
    return sum(map(camera_count, config.cameras))


def camera_count(cameras: AnyCameras) -> int:
    """Return the number of cameras of an entry."""
    return len(cameras.poses) if isinstance(cameras, PosedCameras) else cameras.count
