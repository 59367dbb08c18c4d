"""What stage `surface` adds to every sample."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.config import Config
from stages.shape.collection.members import Member, Members, RecordField, object_schema
from stages.surface.settings import SurfaceConfig

UNION_VERTICES, UNION_FACES, UNION_INSTANCES = "union_vertices.npy", "union_faces.npy", "union_instances.npy"
SDF_POINTS, SDF_VALUES = "sdf_points.npy", "sdf_values.npy"
OCCUPANCY = "occupancy.npy"

FLAGS = {
    "closed": "every edge is used equally often in both directions",
    "manifold": "at most two faces meet at an edge, the faces at each vertex form one fan, and all have an area",
    "self_intersecting": "two faces have a point in common that is no vertex or edge of both",
}


def _members(config: Config) -> tuple[Member, ...]:
    section = config.section(SurfaceConfig)
    found: list[Member] = []
    if section.union:
        found += [
            Member(UNION_VERTICES, "Vertices of the watertight union of all parts.", "float32", ("union_v", 3)),
            Member(UNION_FACES, "Faces of the union, outwards.", "int32", ("union_f", 3)),
            Member(UNION_INSTANCES, "Part that each face of the union comes from.", "int16", ("union_f",)),
        ]
    if section.point_count:
        near, uniform = section.distances.near, section.distances.uniform
        text = (
            "Points for signed distances, in the coordinates of the mesh: "
            f"{near:,} near the surface, then {uniform:,} in the cube of the record."
        )
        found += [
            Member(SDF_POINTS, text, "float32", (section.point_count, 3)),
            Member(
                SDF_VALUES,
                "Distance of each of these points to the surface of the union, negative inside.",
                "float32",
                (section.point_count,),
            ),
        ]
    if section.occupancy:
        cells = section.occupancy
        text = (
            f"Which of {cells}³ cells of the record's cube have their middle inside the union: bits, z fastest; "
            "`numpy.unpackbits(occupancy, axis=2)` is indexed by x, y and z."
        )
        found.append(Member(OCCUPANCY, text, "uint8", (cells, cells, cells // 8)))
    return tuple(found)


def _fields(config: Config) -> Mapping[str, RecordField]:
    section = config.section(SurfaceConfig)
    fields: dict[str, RecordField] = {}
    flags = {name: {"type": "boolean", "description": text} for name, text in FLAGS.items()}
    if section.flags:
        parts = {"type": "array", "items": object_schema("facts about one part", flags), "minItems": 1}
        whole = {
            "closed": {"type": "boolean", "description": "every part is closed"},
            "manifold": {"type": "boolean", "description": "every part is a manifold"},
            "self_intersecting": {"type": "boolean", "description": "a part intersects itself"},
            "parts": {**parts, "description": "the facts about each part, in the order of `parts`"},
        }
        text = "exact facts about the surfaces of the parts, as the GLB has them; vertices at one place count as one"
        fields["surface"] = RecordField(object_schema(text, whole))
    if section.needs_union:
        positive = {"type": "number", "exclusiveMinimum": 0}
        corner = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
        facts = {
            "volume": {**positive, "description": "volume of the union"},
            "area": {**positive, "description": "area of the surface of the union"},
            "components": {"type": "integer", "minimum": 1, "description": "separate surfaces of the union"},
            "cube_low": {**corner, "description": "lowest corner of the cube of uniform points and the grid"},
            "cube_side": {**positive, "description": "length of the sides of the cube"},
        }
        fields["union"] = RecordField(object_schema("the union of all parts as one solid", facts))
    return fields


def _coordinates(config: Config) -> tuple[str, ...]:
    asked = config.section(SurfaceConfig).needs_union
    return ("The union, points with signed distances and the cube have the coordinates of the mesh.",) if asked else ()


MEMBERS = Members(of=_members, fields=_fields, coordinates=_coordinates, checks=("surfaces",))
