"""What pycollada leaves out of COLLADA meshes: polygons with holes, and whole geometries for one unknown primitive."""

from __future__ import annotations

import io
from collections import Counter
from typing import Any

import numpy as np

from stages.model_files.polygons import bridge_holes, triangulate
from stages.shape.arrays import FloatArray, IntArray


def without_unreadable_primitives(document: Any) -> tuple[io.BytesIO | None, list[str]]:
    """Return the file without the primitives for which pycollada left out their geometries, and warnings.

    document: the collada.Collada as loaded; None stands for a file in which no primitive is to blame.
    """
    import collada

    read = {geometry.id for geometry in document.geometries}
    mesh_tag, source_tag, vertices_tag = (document.tag(name) for name in ("mesh", "source", "vertices"))
    warnings: list[str] = []
    for node in document.xmlnode.getroot().iter(document.tag("geometry")):
        mesh = node.find(mesh_tag)
        if node.get("id") in read or mesh is None:
            continue
        primitives = [child for child in mesh if child.tag not in (source_tag, vertices_tag, document.tag("extra"))]
        for child in primitives:
            mesh.remove(child)
        blamed: Counter[str] = Counter()
        kept = []
        for child in primitives:
            mesh.append(child)
            try:
                collada.geometry.Geometry.load(document, {}, node)
                kept.append(child)
            except collada.common.DaeError:
                blamed[str(child.tag).rpartition("}")[2]] += 1
            mesh.remove(child)
        mesh.extend(kept)
        name = node.get("name") or node.get("id")
        warnings += [
            f"{count:,} primitives <{tag}> of geometry {name!r} are unknown or invalid and are left out"
            for tag, count in blamed.items()
        ]
    if not warnings:
        return None, []
    stream = io.BytesIO()
    document.xmlnode.write(stream, encoding="utf-8", xml_declaration=True)
    stream.seek(0)
    return stream, warnings


def vertex_positions(primitive: Any) -> FloatArray:
    """Return the vertices of a primitive, float64 (n, 3), also of one that has no index but those of holes."""
    positions: FloatArray = np.asarray(primitive.sources["VERTEX"][0][4].data, dtype=np.float64)[:, :3]
    return positions


def polygon_triangles(primitive: Any, counts: IntArray) -> tuple[np.ndarray, IntArray, list[str]]:
    """Return the index table of a polylist with the corners of polygons with holes, triangles, and warnings.

    counts: corners of each polygon without holes.
    The table is int (n, inputs); triangles are rows of it, int32 (f, 3).
    """
    table = np.asarray(primitive.index).reshape(-1, primitive.nindices)
    offset = primitive.sources["VERTEX"][0][0]
    vertices = vertex_positions(primitive)
    rows, sizes, tables = [np.arange(len(table))], list(counts), [table]
    warnings: list[str] = []
    for number, outline_and_holes in enumerate(_polygons_with_holes(primitive)):
        valid = [
            loop.reshape(-1, primitive.nindices) for loop in outline_and_holes if len(loop) % primitive.nindices == 0
        ]
        if len(valid) < len(outline_and_holes) or any(
            loop.min(initial=0) < 0 or loop[:, offset].max(initial=0) >= len(vertices) for loop in valid
        ):
            warnings.append(f"polygon {number} with holes has an invalid index and is left out")
            continue
        outline, *holes = (vertices[loop[:, offset]] for loop in valid)
        ring = bridge_holes(outline, holes)
        rows.append(ring + sum(map(len, tables)))
        sizes.append(len(ring))
        tables += valid
    table, row = np.concatenate(tables), np.concatenate(rows)
    triangles = triangulate(vertices, table[row, offset], np.array(sizes, dtype=np.int64))[0]
    return table, row[triangles].astype(np.int32), warnings


def _polygons_with_holes(primitive: Any) -> list[list[np.ndarray]]:
    """Return the indices of outline and holes of each `<ph>`. Raises ValueError for words that are no numbers."""
    node = getattr(primitive, "xmlnode", None)
    if node is None or not str(node.tag).endswith("polygons"):
        return []
    space = str(node.tag).removesuffix("polygons")
    return [
        [
            np.array((loop.text or "").split(), dtype=np.int64)
            for loop in polygon
            if loop.tag in (f"{space}p", f"{space}h")
        ]
        for polygon in node.findall(f"{space}ph")
        if polygon.find(f"{space}p") is not None
    ]
