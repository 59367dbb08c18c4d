"""MTL: the colours and textures of an OBJ's materials, in every legal form."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from stages.model_files.colors import color_bytes, decode_image, srgb_from_linear
from stages.model_files.enclosure import Enclosure, Outside
from stages.model_files.scene import GREY
from stages.model_files.source_materials import alpha_mode_of, linear_color, stated_number
from stages.model_files.wavefront_text import TextLine, decode_wavefront_text, text_lines
from stages.shape.appearance import Material, Texture, TextureImage, Wrap
from stages.shape.arrays import ByteArray, FloatArray
from stages.shape.input_file import content_fault

_OPTION_NUMBERS = {"-mm": 2, "-o": 3, "-s": 3, "-t": 3}
"""Largest number of values of the options of maps; the other options take one word."""
_READ_NUMBERS = {"d", "tr", "ns", "pm", "pr", "ke"}
_KEPT_MAPS = {"norm": "normal_texture", "map_ke": "emissive_texture"}
"""Fields of `Material` of maps that are kept, if they are placed as `map_Kd` is."""
_NOT_KEPT_MAPS = {"map_d", "map_bump", "bump", "map_ks", "map_pr", "map_pm", "refl"}
_LINEAR_FROM_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
MAX_BRIGHT_COLOR = 4.0
"""Up to here colours beyond 1 are bright; larger ones range to 255."""


@dataclass
class WavefrontMaterial:
    """A material.

    color: uint8 (3,) sRGB.
    image: the texture.
    scale, offset: of texture coordinates, (2,).
    alpha: 1 is opaque.
    emissive: linear red, green, blue.
    other_images: by the field of `Material`.
    """

    color: ByteArray = field(default_factory=lambda: np.array(GREY, np.uint8))
    image: TextureImage | None = None
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    wrap: Wrap = "repeat"
    alpha: float = 1.0
    metallic: float = 0.0
    roughness: float = 1.0
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    other_images: dict[str, TextureImage] = field(default_factory=dict)

    def described(self, name: str) -> Material:
        """Return the material with the meanings of glTF; both of its sides are seen."""
        texture = None if self.image is None else Texture(self.image, self.wrap, self.wrap)
        red, green, blue = (1.0, 1.0, 1.0) if texture is not None else linear_color((self.color / 255.0).tolist())
        others: dict[str, Any] = {key: Texture(image, self.wrap, self.wrap) for key, image in self.other_images.items()}
        glow = (1.0, 1.0, 1.0) if "emissive_texture" in others and not any(self.emissive) else self.emissive
        return Material(
            *(name, (red, green, blue, self.alpha), texture, self.metallic, self.roughness, glow),
            alpha_mode=alpha_mode_of(self.alpha, None if self.image is None else self.image.pixels),
            double_sided=True,
            **others,
        )


def read_libraries(
    lines: Sequence[TextLine], enclosure: Enclosure, warnings: list[str], not_kept: list[str]
) -> dict[str, WavefrontMaterial]:
    """Return the materials of all `mtllib` lines, by name; warn of what is missing or not read.

    not_kept: gets what an appearance does not hold of a material, a sentence each
    """
    materials: dict[str, WavefrontMaterial] = {}
    for line in {line.full: line for line in lines}.values():
        for content in _library_contents(line, enclosure, warnings):
            if other := content_fault(content):
                warnings.append(f"material library {line.rest!r} {other}; its faces are grey")
                continue
            _Library(enclosure, materials, warnings, not_kept).read(decode_wavefront_text(content))
    return materials


def _library_contents(line: TextLine, enclosure: Enclosure, warnings: list[str]) -> list[bytes]:
    """Return the files that one line names: one name, which may hold blanks, or several names."""
    for name in line.file_names():
        try:
            return [enclosure.read(_unquoted(name), "mtllib")]
        except (Outside, OSError):
            continue
    contents, missing = [], []
    words = line.rest.split()
    for name in words:
        try:
            contents.append(enclosure.read(name, "mtllib"))
        except Outside:
            warnings.append(
                f"material library {name!r} is outside the folder of the model and is not opened; its faces are grey"
            )
        except OSError:
            missing.append(name)
    if len(missing) == len(words):
        missing = [line.rest]
    warnings += [f"material library {name!r} is missing; its faces are grey" for name in missing]
    return contents


class _Library:
    def __init__(
        self,
        enclosure: Enclosure,
        materials: dict[str, WavefrontMaterial],
        warnings: list[str],
        not_kept: list[str],
    ) -> None:
        self.enclosure = enclosure
        self.materials = materials
        self.warnings = warnings
        self.not_kept = not_kept
        self.diffuse: dict[str, FloatArray] = {}
        self.ambient: dict[str, FloatArray] = {}

    def read(self, text: str) -> None:
        name = ""
        ambient_maps: dict[str, TextLine] = {}
        other_maps: list[tuple[str, TextLine]] = []
        for line in text_lines(text):
            keyword = line.keyword.lower()
            if keyword == "newmtl":
                name = line.rest
                self.materials[name] = WavefrontMaterial()
            elif keyword in ("kd", "ka"):
                color = self.color(line)
                if color is not None:
                    (self.diffuse if keyword == "kd" else self.ambient)[name] = color
            elif keyword == "map_kd":
                self.read_map(self.materials.setdefault(name, WavefrontMaterial()), line)
            elif keyword == "map_ka":
                ambient_maps[name] = line
            elif keyword in _READ_NUMBERS:
                self.read_number(self.materials.setdefault(name, WavefrontMaterial()), keyword, line.rest.split())
            elif keyword in _KEPT_MAPS:
                other_maps.append((name, line))
            elif keyword in _NOT_KEPT_MAPS:
                self.not_kept.append(f"material {name!r}: {keyword} is not kept")
        for name, line in ambient_maps.items():
            if name in self.materials and self.materials[name].image is None and name not in self.diffuse:
                self.read_map(self.materials[name], line)
        for name, line in other_maps:
            self.read_other_map(name, line)
        colors = {**self.ambient, **self.diffuse}  # what has no diffuse colour shows its ambient one
        largest = max((float(color.max()) for color in colors.values()), default=0.0)
        limit = 255.0 if largest > MAX_BRIGHT_COLOR else 1.0
        if limit > 1.0:
            self.warnings.append(f"colours of materials reach {largest:g} and are taken to range from 0 to 255")
        for name, color in colors.items():
            self.materials.setdefault(name, WavefrontMaterial()).color = color_bytes(color / limit)

    def read_number(self, material: WavefrontMaterial, keyword: str, words: Sequence[str]) -> None:
        """Read opacity, shininess, metal, roughness or glow; a material that nobody would see is opaque."""
        value = stated_number(words[0] if words else None, math.nan)
        if keyword == "ke":
            numbers = [stated_number(word, 0.0) for word in words[:3]]
            material.emissive = linear_color(numbers if len(numbers) == 3 else numbers[:1] * 3 or [0.0] * 3)
        elif math.isnan(value):
            return
        elif keyword == "d":
            material.alpha = value or 1.0
        elif keyword == "tr" and material.alpha == 1.0:
            material.alpha = 1.0 - value or 1.0
        elif keyword == "pm":
            material.metallic = value
        elif keyword == "pr":
            material.roughness = value
        elif keyword == "ns":
            material.roughness = math.sqrt(2.0 / (2.0 + max(float(words[0]), 0.0)))

    def color(self, line: TextLine) -> FloatArray | None:
        """Return the colour of a line: one number or three, as sRGB or as CIE XYZ; None, with a warning, for others."""
        words = line.rest.split()
        is_xyz = words[:1] == ["xyz"]
        try:
            if words[:1] == ["spectral"]:
                raise ValueError("spectral")
            numbers = [float(word) for word in words[is_xyz : is_xyz + 3]]
            values = np.array(numbers * 3 if len(numbers) == 1 else numbers)
            if values.shape != (3,) or not np.isfinite(values).all():
                raise ValueError("no colour")
        except ValueError:
            if line.keyword.lower() == "kd":
                kind = "a spectral curve, which is not read" if words[:1] == ["spectral"] else "not red, green, blue"
                self.warnings.append(f"material colour '{line.keyword} {line.rest}' is {kind}; its faces are grey")
            return None
        return srgb_from_linear(_LINEAR_FROM_XYZ @ values) / 255.0 if is_xyz else values

    def read_other_map(self, name: str, line: TextLine) -> None:
        """Read a map that is kept if its image can be read and it is placed as that of the diffuse colour."""
        material, placed = self.materials.setdefault(name, WavefrontMaterial()), WavefrontMaterial()
        before = len(self.warnings)
        self.read_map(placed, line)
        del self.warnings[before:]
        same = (placed.scale, placed.offset, placed.wrap) == (material.scale, material.offset, material.wrap)
        if placed.image is not None and material.image is not None and same:
            material.other_images[_KEPT_MAPS[line.keyword.lower()]] = placed.image
        else:
            self.not_kept.append(f"material {name!r}: {line.keyword.lower()} is not kept")

    def read_map(self, material: WavefrontMaterial, line: TextLine) -> None:
        """Read the texture of a `map_Kd` line, with its placing; warn if that fails."""
        names = dict.fromkeys(_map_file(rest, material) for rest in line.file_names())
        for number, name in enumerate(names, start=1):
            try:
                material.image = TextureImage.of(decode_image(self.enclosure.read(name, "map_Kd")))
                return
            except Outside:
                self.warnings.append(
                    f"texture {name!r} is outside the folder of the model and is not opened; its faces have the "
                    "material's colour"
                )
                return
            except FileNotFoundError:
                if number == len(names):
                    self.warnings.append(f"texture {name!r} is missing; its faces have the material's colour")
            except OSError as error:
                self.warnings.append(f"texture {name!r} cannot be read: {error}")
                return


def _map_file(rest: str, material: WavefrontMaterial) -> str:
    """Return the file name of a map, which may hold blanks; the options in front of it go into `material`."""
    words = list(re.finditer(r"\S+", rest))
    while words and words[0][0].startswith("-") and not _is_number(words[0][0]):
        option = words.pop(0)[0].lower()
        values: list[float] = []
        if option in _OPTION_NUMBERS:
            while len(words) > 1 and len(values) < _OPTION_NUMBERS[option] and _is_number(words[0][0]):
                values.append(float(words.pop(0)[0]))
        elif words:
            if option == "-clamp" and words[0][0].lower() == "on":
                material.wrap = "clamp"
            words.pop(0)
        if option == "-s" and values:
            material.scale = (values[0], values[1] if len(values) > 1 else 1.0)
        elif option == "-o" and values:
            material.offset = (values[0], values[1] if len(values) > 1 else 0.0)
    return _unquoted(rest[words[0].start() :]) if words else ""


def _unquoted(name: str) -> str:
    return name[1:-1] if len(name) > 2 and name[0] == name[-1] == '"' else name


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
