"""The container of glTF: JSON header, buffers, views and accessors as arrays."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import ConfigError
from stages.model_files.enclosure import Enclosure
from stages.model_files.scene import Malformed
from stages.shape.input_file import content_fault

COMPRESSED = "export it again without compression"

READ_EXTENSIONS = {
    "KHR_mesh_quantization", "KHR_texture_transform", "KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif",
    "MSFT_texture_dds", "KHR_node_visibility", "KHR_lights_punctual", "EXT_lights_image_based", "KHR_animation_pointer",
    "KHR_xmp", "KHR_xmp_json_ld", "KHR_techniques_webgl", "KHR_technique_webgl",
    "KHR_draco_mesh_compression", "EXT_meshopt_compression",
    "KHR_meshopt_compression",
    "EXT_mesh_gpu_instancing", "EXT_mesh_manifold", "FB_ngon_encoding",
    "KHR_node_hoverability", "KHR_node_selectability", "KHR_interactivity",
}  # fmt: skip
"""Extensions that are read, that change no shape and no colour, or that have a message of their own where they are."""
APPEARANCE_PREFIX = "KHR_materials_"
"""Extensions of materials change how light is reflected, not the base colour."""

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class GltfFile:
    """A `.glb` or `.gltf` file whose buffers are read on first use.

    Raises ConfigError for a file that is cut off or names files outside its folder, and Malformed for known faults. If
    the header contradicts itself, indexing and conversion raise other errors; `enclosure.at` then says where.
    """

    def __init__(self, path: Path, enclosure: Enclosure) -> None:
        self.path = path
        self.enclosure = enclosure
        self.header, self.chunk = _container(path)
        self.buffers: dict[int, bytes] = {}
        version = str(self.header.get("asset", {}).get("version", ""))
        if not version.startswith("2."):
            raise ConfigError(f"{path}: glTF version {version or 'unknown'}; only 2.x is read, export it again as 2.0")
        _check_required(path, self.header.get("extensionsRequired", []))
        for index, buffer in enumerate(self.header.get("buffers", [])):
            enclosure.at = f"buffer {index}"
            if "uri" in buffer:
                enclosure.check(buffer["uri"], f"buffer {index}", encoded=True)

    def is_stored(self, accessor: int) -> bool:
        stored: dict[str, Any] = self.header["accessors"][accessor]
        return "bufferView" in stored or "sparse" in stored

    def accessor(self, index: int, element: str) -> np.ndarray:
        """Return the values of an accessor (count, width), sparse ones filled in, normalised ones as float64."""
        accessor = self.header["accessors"][index]
        width, dtype = _WIDTHS[accessor["type"]], np.dtype(_COMPONENTS[accessor["componentType"]])
        values = np.zeros((accessor["count"], width), dtype)
        if "bufferView" in accessor:
            values = self.packed(accessor["bufferView"], accessor.get("byteOffset", 0), values.shape, dtype, element)
        if sparse := accessor.get("sparse"):
            at, new = sparse["indices"], sparse["values"]
            where = self.packed(
                at["bufferView"],
                at.get("byteOffset", 0),
                (sparse["count"], 1),
                _COMPONENTS[at["componentType"]],
                element,
            )
            values[where[:, 0]] = self.packed(
                new["bufferView"], new.get("byteOffset", 0), (sparse["count"], width), dtype, element
            )
        if accessor.get("normalized") and dtype.kind in "iu":
            return np.maximum(values / np.iinfo(dtype).max, -1.0)
        return values

    def packed(self, view: int, offset: int, shape: tuple[int, int], dtype: Any, element: str) -> np.ndarray:
        content, stride = self.view(view, element)
        row = shape[1] * np.dtype(dtype).itemsize
        if offset < 0 or shape[0] < 0 or (shape[0] and offset + (shape[0] - 1) * (stride or row) + row > len(content)):
            raise Malformed(f"{element} needs more bytes than bufferView {view} has")
        return np.ndarray(shape, dtype, content, offset, (stride or row, np.dtype(dtype).itemsize)).copy()

    def view(self, index: int, element: str) -> tuple[bytes, int]:
        """Return bytes and stride (0 for none) of a buffer view."""
        view = self.header["bufferViews"][index]
        buffer = self.buffer(
            view["buffer"], element, any(name.endswith("_meshopt_compression") for name in view.get("extensions", {}))
        )
        start, length = view.get("byteOffset", 0), view["byteLength"]
        if start < 0 or length < 0 or start + length > len(buffer):
            raise ConfigError(
                f"{self.path}: cut off: {element} reads bytes {start} to {start + length} of buffer {view['buffer']}, "
                f"which has {len(buffer)}; copy or export the file again"
            )
        return buffer[start : start + length], view.get("byteStride", 0)

    def buffer(self, index: int, element: str, compressed: bool) -> bytes:
        if index not in self.buffers:
            uri = self.header["buffers"][index].get("uri")
            if uri is not None:
                try:
                    content = self.enclosure.read(uri, f"buffer {index}", encoded=True)
                except FileNotFoundError:
                    raise ConfigError(
                        f"{self.path}: buffer {index} is the file {uri!r}, which is missing; put it next to the model"
                    ) from None
                except OSError:
                    raise ConfigError(f"{self.path}: buffer {index}, the file {uri!r}, cannot be read") from None
                if other := content_fault(content):
                    raise ConfigError(f"{self.path}: buffer {index}, the file {uri[:80]!r}, {other}")
                self.buffers[index] = content
            elif index == 0 and self.chunk is not None:
                self.buffers[index] = self.chunk
            elif compressed:
                raise ConfigError(f"{self.path}: {element} is compressed with meshopt, which is not read; {COMPRESSED}")
            else:
                raise ConfigError(f"{self.path}: buffer {index} has no content; export the file again")
        return self.buffers[index]


def _check_required(path: Path, required: list[str]) -> None:
    """Raise ConfigError for an extension without which the file may not be read, unless it is read or named later."""
    for name in required:
        if name not in READ_EXTENSIONS and not str(name).startswith(APPEARANCE_PREFIX):
            raise ConfigError(
                f"{path}: requires the glTF extension {str(name)[:80]!r}, which is not read; export it again without it"
            )


def _container(path: Path) -> tuple[dict[str, Any], bytes | None]:
    """Return the JSON header and the binary chunk of a file."""
    content = path.read_bytes()
    chunk = None
    if content[:4] == b"glTF":
        if len(content) < 20 or len(content) < struct.unpack_from("<I", content, 8)[0]:
            stated = struct.unpack_from("<I", content, 8)[0] if len(content) >= 12 else "more"
            raise ConfigError(
                f"{path}: truncated GLB: its header says {stated} bytes, the file has {len(content)}; "
                "copy or export it again"
            )
        version, _, length = struct.unpack_from("<III", content, 4)
        if version != 2:
            raise ConfigError(f"{path}: GLB container version {version}; only 2 is read, export it again as glTF 2.0")
        text, rest = content[20 : 20 + length], 20 + length
        if len(text) < length:
            raise ConfigError(f"{path}: truncated GLB: its JSON chunk is cut off; copy or export it again")
        while chunk is None and rest + 8 <= len(content):  # chunks of other kinds may come first
            size, kind = struct.unpack_from("<I4s", content, rest)
            if kind == b"BIN\0":
                chunk = content[rest + 8 : rest + 8 + size]
            rest += 8 + size
    else:
        text = content
    try:
        header = json.loads(text.rstrip(b"\0 \t\r\n"))
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise ConfigError(f"{path}: not a glTF file: its JSON breaks off in {where}; export it again") from None
    except ValueError:
        raise ConfigError(
            f"{path}: not a glTF file: its JSON is no text, or holds endless numbers; export it again"
        ) from None
    except RecursionError:
        raise ConfigError(f"{path}: not a glTF file: its JSON nests too deeply; export it again") from None
    if not isinstance(header, dict):
        raise ConfigError(f"{path}: not a glTF file: its JSON is no object; export it again")
    return header, chunk
