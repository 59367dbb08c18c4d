"""What stage `views` adds to every sample."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.config import Config
from stages.shape.arrays import ByteArray
from stages.shape.collection.members import Member, Members, PreviewRow, RecordField
from stages.shape.views.camera import Camera
from stages.shape.views.camera_record import CAMERA_FIELDS
from stages.shape.views.palette import PAPER, label_colors
from stages.views.settings import ImageKind, ViewsConfig, view_count

COLOR_SUFFIX = {"png": "png", "jpeg": "jpg", "webp": "webp"}
IN_MULTICHANNEL: tuple[ImageKind, ...] = ("depth", "normals", "instances", "classes", "mask")
"""Images that `multichannel` joins in one file."""
NOTHING_SEEN = "0 where nothing is seen"


def _members(config: Config) -> tuple[Member, ...]:
    section = config.section(ViewsConfig)
    return tuple(member for index in range(view_count(section)) for member in _of_view(section, index))


def _of_view(section: ViewsConfig, index: int) -> Iterator[Member]:
    size = (section.height, section.width)
    if "color" in section.images:
        channels = 4 if section.color.background == "transparent" else 3
        yield Member(
            f"color{index}.{COLOR_SUFFIX[section.color.format]}",
            f"Colour of view {index}, {_lighting(section)}, on {section.color.background} ground; sRGB.",
            "uint8",
            (*size, channels),
        )
    joined = [kind for kind in section.images if kind in IN_MULTICHANNEL]
    if section.multichannel and joined:
        listed = " ".join(_channels(section, kind) for kind in joined)
        yield Member(f"view{index}.exr", f"View {index} as channels of one EXR. {listed}", "float32", size)
    elif joined:
        yield from (_surface_member(section, kind, index) for kind in joined)
    if "drawing" in section.images:
        text = f"Line drawing of view {index}: dark ink on white, single-channel PNG."
        yield Member(f"drawing{index}.png", text, "uint8", size)


def _surface_member(section: ViewsConfig, kind: ImageKind, index: int) -> Member:
    size = (section.height, section.width)
    suffix = {"depth": section.depth_format, "normals": section.normals_format}.get(kind, "png")
    text = f"{_meaning(section, kind)} of view {index}. "
    if suffix == "exr":
        return Member(f"{kind}{index}.exr", text + _channels(section, kind), "float32", size)
    if kind == "depth":
        text += f"16-bit PNG: times `views[{index}].depth_scale` of the record it is a length; {NOTHING_SEEN}."
    elif kind == "normals":
        text += "8-bit PNG: value / 127.5 - 1 is a coordinate; black where nothing is seen."
    elif kind == "mask":
        return Member(f"mask{index}.png", f"{text}PNG: 255 where the shape is seen, else 0.", "uint8", size)
    else:
        text += f"16-bit PNG: one more than the {_id_name(kind)}, {NOTHING_SEEN}."
    shape = (*size, 3) if kind == "normals" else size
    return Member(f"{kind}{index}.png", text, "uint8" if kind == "normals" else "uint16", shape)


def _meaning(section: ViewsConfig, kind: ImageKind) -> str:
    axes = {"camera": "axes of the camera (x right, y down, z ahead)", "world": "axes of the mesh"}
    return {
        "depth": "Depth along the axis of the camera, in the unit of the mesh,",
        "normals": f"Unit normals of the faces, towards the camera, in the {axes[section.normals_space]},",
        "instances": "Parts",
        "classes": "Classes of the parts",
        "mask": "Mask",
    }[kind]


def _channels(section: ViewsConfig, kind: ImageKind) -> str:
    """Return in words which channels of an EXR hold an image."""
    if kind == "depth":
        return f"{_meaning(section, kind)} in Z, 32-bit; {NOTHING_SEEN}."
    if kind == "normals":
        return f"{_meaning(section, kind)} in N.X, N.Y and N.Z, 16-bit; {NOTHING_SEEN}."
    if kind == "mask":
        return "Mask in mask: 1 where the shape is seen, else 0."
    channel = {"instances": "instance", "classes": "class"}[kind]
    return f"{_meaning(section, kind)} in {channel}: one more than the {_id_name(kind)}, {NOTHING_SEEN}."


def _id_name(kind: ImageKind) -> str:
    return {"instances": "part's index in the record", "classes": "class id of `classes.json`"}[kind]


def _lighting(section: ViewsConfig) -> str:
    if section.color.lighting == "unlit":
        return "base colours without light"
    return f"lit {'with' if section.color.shadows else 'without'} shadows"


def _fields(config: Config) -> Mapping[str, RecordField]:
    section = config.section(ViewsConfig)
    if not section.cameras:
        return {}
    properties: dict[str, Any] = {
        "cameras": {
            "description": "kind of the entry of the config that the camera comes from",
            "enum": ["ring", "sphere", "random", "poses"],
        },
        **CAMERA_FIELDS,
    }
    if "depth" in section.images and section.depth_format == "png" and not section.multichannel:
        text = "length of a level of the depth image, in the unit of the mesh"
        properties["depth_scale"] = {"description": text, "type": "number", "exclusiveMinimum": 0}
    return {
        "views": RecordField(
            {
                "description": "the cameras of the views in their order",
                "type": "array",
                "items": {
                    "type": "object",
                    "properties": properties,
                    "required": list(properties),
                    "additionalProperties": False,
                },
                "minItems": view_count(section),
                "maxItems": view_count(section),
            }
        )
    }


def _rows(config: Config) -> Sequence[PreviewRow]:
    section = config.section(ViewsConfig)
    size = f"first of {view_count(section)} views, {section.width} × {section.height}"
    captions = {
        "color": f"{size}, {_lighting(section)}",
        "depth": f"{size}; near is dark",
        "normals": f"{size}; axes of the {section.normals_space}",
        "instances": f"{size}, a colour for each part",
        "classes": f"{size}, a colour for each class",
        "mask": size,
        "drawing": size,
    }
    titles = {"color": "Colour", "instances": "Instances", "classes": "Classes", "drawing": "Drawings"}
    return [
        PreviewRow(titles.get(kind, kind.capitalize()), _constant(captions[kind]), _drawn(kind))
        for kind in section.images
        if section.cameras
    ]


def _constant(caption: str) -> Any:
    return lambda _: caption


def _drawn(kind: ImageKind) -> Any:
    def draw(members: Mapping[str, bytes], _: Camera, __: int) -> ByteArray:
        from stages.views.reading import read_view

        return picture(read_view(members, 0)[kind], kind)

    return draw


def picture(image: np.ndarray, kind: ImageKind) -> ByteArray:
    """Return an image of `read_view` as a picture for people on the colour of paper, uint8 (h, w) or (h, w, 3)."""
    if kind == "drawing":
        return image
    paper = np.array(PAPER, dtype=np.float64)
    if kind == "color":
        alpha = image[:, :, 3:] / 255.0 if image.shape[2] == 4 else 1.0
        painted = alpha * image[:, :, :3] * (1.0 if image.shape[2] == 4 else paper / 255.0) + (1.0 - alpha) * paper
    elif kind == "mask":
        painted = np.where(image[:, :, None], 60.0, paper)
    elif kind == "depth":
        near, far = image[image > 0].min(initial=np.inf), image.max()
        shade = 40.0 + 170.0 * (image - near) / max(far - near, np.finfo(np.float32).tiny)
        painted = np.where(image[:, :, None] > 0, shade[:, :, None], paper)
    elif kind == "normals":
        turned = (image * np.array([1.0, -1.0, -1.0]) + 1.0) * 127.5
        painted = np.where(image.any(axis=-1, keepdims=True), turned, paper)
    else:
        painted = np.vstack([label_colors(int(image.max()) + 1), paper])[image]
    return np.rint(painted).astype(np.uint8)


def _tasks(config: Config) -> Sequence[str]:
    shown = {"color", "drawing"} & set(config.section(ViewsConfig).images)
    return ("image-to-3d",) if shown else ()


MEMBERS = Members(of=_members, fields=_fields, rows=_rows, tasks=_tasks)
