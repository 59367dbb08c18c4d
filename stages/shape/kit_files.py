"""A kit on disk: `<kit>.json`, the grammar for people to read, and `<kit>.tar`, the arrays for programs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.shards import ShardWriter, array_bytes, bytes_array, json_bytes, read_shard
from stages.shape.appearance import (
    Appearance,
    Look,
    Material,
    TextureImage,
    describe_materials,
    restore_materials,
    shared_materials,
)
from stages.shape.arrays import IntArray
from stages.shape.geometry.docking import DockingTable
from stages.shape.kit import Assembly, Docking, Exemplar, Grammar, Kit, PartGroup, PartType, labels_of


def kit_json(kit: Kit) -> dict[str, Any]:
    """Return the kit as readable JSON: types, exemplars, neighbourhoods by label, dockings by type name."""
    names, labels = kit.type_names(), kit.labels
    table = DockingTable.of(kit)
    materials, _ = describe_materials(_materials(kit)[0])
    return {
        "kit": kit.name,
        "up": kit.up,
        "contact_tolerance": kit.contact_tolerance,
        "pose_tolerance": kit.pose_tolerance,
        "contact_kinds": list(kit.contact_kinds),
        **({"one_surface": True} if kit.one_surface else {}),
        "unit": kit.unit,
        **({"materials": materials} if materials else {}),
        "types": [
            {
                "name": kind.name,
                **({"meaning": kind.meaning} if kind.meaning else {}),
                "triangles": len(kind.faces),
                "diagonal": round(kind.diagonal, 6),
                "symmetries": len(kind.symmetries),
                **({"looks": len(kind.looked)} if kind.other_looks else {}),
            }
            for kind in kit.types
        ],
        "exemplars": [
            {
                "name": exemplar.name,
                "parts": [
                    {"name": name, "type": names[index]}
                    for name, index in zip(exemplar.part_names, exemplar.assembly.types.tolist(), strict=True)
                ],
                "contacts": _contacts(kit, table, exemplar.assembly),
            }
            for exemplar in kit.exemplars
        ],
        "strictness": kit.grammar.strictness,
        "hubs": [names[index] for index in kit.grammar.hubs],
        "neighbourhoods": {
            labels[index]: [
                {"neighbours": {labels[other]: count for other, count in multiset}, "seen": seen}
                for multiset, seen in sorted(rules.items(), key=lambda rule: (-rule[1], rule[0]))
            ]
            for index, rules in sorted(kit.grammar.neighbourhoods.items())
        },
        "dockings": [
            {
                "a": names[docking.a],
                "b": names[docking.b],
                "kind": docking.kind,
                "seen": docking.count,
                "depth": docking.depth,
                **({"slack": docking.slack} if docking.slack else {}),
                "pose": docking.pose.tolist(),
            }
            for docking in kit.grammar.dockings
        ],
        "nested": [{"a": names[a], "b": names[b], "depth": depth} for (a, b), depth in kit.grammar.nested.items()],
        **({"groups": [_group_json(group) for group in kit.groups]} if kit.groups else {}),
    }


def _group_json(group: PartGroup) -> dict[str, Any]:
    return {"name": group.name, "parts": [part.name for part in group.parts], "poses": group.poses.tolist()}


def _materials(kit: Kit) -> tuple[tuple[Material, ...], list[list[IntArray | None]]]:
    """Return the materials of all types, and for each look of each type those of its faces, int32 (f,), or None."""
    looks = [[looked.appearance for looked in kind.looked] for kind in kit.types]
    materials, places = shared_materials([look for of_type in looks for look in of_type if look is not None])
    place_of = iter(places)
    return materials, [
        [None if look is None else next(place_of)[look.face_material] for look in of_type] for of_type in looks
    ]


def _contacts(kit: Kit, table: DockingTable, assembly: Assembly) -> list[list[int | str]]:
    """Return contacts as `[part, part, kind]`."""
    labels = table.label_edges(assembly.types, assembly.poses, assembly.edges)[:, 0] // 2
    kinds = [kit.grammar.dockings[label].kind for label in labels.tolist()]
    return [[i, j, kind] for (i, j), kind in zip(assembly.edges.tolist(), kinds, strict=True)]


def write_kit(kit: Kit, text: Any, arrays: Any) -> None:
    """Write `kit` to two binary streams: the JSON of `kit_json` to `text`, the tar to `arrays`."""
    text.write(json.dumps(kit_json(kit), indent=1, ensure_ascii=False, allow_nan=False).encode() + b"\n")
    materials, face_materials = _materials(kit)
    with ShardWriter(arrays) as writer:
        for index, image in enumerate(describe_materials(materials)[1]):
            writer.write(f"image-{index:04d}", {"pixels.npy": array_bytes(image.pixels)})
        for index, (kind, of_looks) in enumerate(zip(kit.types, face_materials, strict=True)):
            members = {
                "vertices.npy": array_bytes(kind.vertices),
                "faces.npy": array_bytes(kind.faces),
                "colors.npy": array_bytes(kind.face_colors),
                "frame.npy": array_bytes(kind.frame),
                "symmetries.npy": array_bytes(kind.symmetries),
            }
            for number, (looked, face_material) in enumerate(zip(kind.looked, of_looks, strict=True)):
                prefix = _look_prefix(number)
                if number:
                    members[f"{prefix}colors.npy"] = array_bytes(looked.face_colors)
                if looked.appearance is not None and face_material is not None:
                    members[f"{prefix}materials.npy"] = array_bytes(face_material)
                    if looked.appearance.uv is not None:
                        members[f"{prefix}uv.npy"] = array_bytes(looked.appearance.uv)
                    if looked.appearance.normals is not None:
                        members[f"{prefix}normals.npy"] = array_bytes(looked.appearance.normals)
            writer.write(f"type-{index:04d}", members)
        for index, exemplar in enumerate(kit.exemplars):
            members = {
                "json": json_bytes({"name": exemplar.name, "part_names": list(exemplar.part_names)}),
                "types.npy": array_bytes(exemplar.assembly.types),
                "poses.npy": array_bytes(exemplar.assembly.poses),
                "edges.npy": array_bytes(exemplar.assembly.edges),
                "hub-types.npy": array_bytes(exemplar.removed_hubs.types),
                "hub-poses.npy": array_bytes(exemplar.removed_hubs.poses),
            }
            looks, hub_looks = exemplar.assembly.looks, exemplar.removed_hubs.looks
            if looks is not None and any(kind.other_looks for kind in kit.types):
                members["looks.npy"] = array_bytes(looks)
                if hub_looks is not None:
                    members["hub-looks.npy"] = array_bytes(hub_looks)
            writer.write(f"exemplar-{index:04d}", members)


def load_kit(text: Path, arrays: Path) -> Kit:
    """Return the kit that `write_kit` wrote to these two files."""
    described = json.loads(text.read_text(encoding="utf-8"))
    heads = iter([(kind["name"], kind.get("meaning", "")) for kind in described["types"]])
    types: list[PartType] = []
    exemplars: list[Exemplar] = []
    images: list[TextureImage] = []
    materials: tuple[Material, ...] | None = None
    for key, members in read_shard(arrays):
        if key.startswith("image-"):
            images.append(TextureImage.of(bytes_array(members["pixels.npy"])))
        elif key.startswith("type-"):
            if materials is None:
                materials = restore_materials(described.get("materials", []), images)
            types.append(_part_type(*next(heads), members, materials))
        else:
            exemplars.append(_exemplar(members))
    return Kit(
        name=described["kit"],
        types=tuple(types),
        exemplars=tuple(exemplars),
        grammar=_grammar(described, labels_of(types)[0]),
        contact_tolerance=described["contact_tolerance"],
        pose_tolerance=described["pose_tolerance"],
        contact_kinds=tuple(described["contact_kinds"]),
        up=described["up"],
        one_surface=described.get("one_surface", False),
        unit=described.get("unit", "unknown"),
        groups=tuple(_group(group, {kind.name: kind for kind in types}) for group in described.get("groups", ())),
    )


def _group(described: Mapping[str, Any], types: Mapping[str, PartType]) -> PartGroup:
    parts = tuple(types[name] for name in described["parts"])
    return PartGroup(described["name"], parts, np.array(described["poses"]))


def _look_prefix(number: int) -> str:
    """Return what stands before the names of the members of a look, by its index in `PartType.looked`."""
    return f"look{number}-" if number else ""


def _part_type(name: str, meaning: str, members: Mapping[str, bytes], materials: tuple[Material, ...]) -> PartType:
    looks: list[Look] = []
    while f"{_look_prefix(len(looks))}colors.npy" in members:
        looks.append(_look(_look_prefix(len(looks)), members, materials))
    return PartType(
        name=name,
        vertices=bytes_array(members["vertices.npy"]),
        faces=bytes_array(members["faces.npy"]),
        face_colors=looks[0].face_colors,
        frame=bytes_array(members["frame.npy"]),
        symmetries=bytes_array(members["symmetries.npy"]),
        meaning=meaning,
        appearance=looks[0].appearance,
        other_looks=tuple(looks[1:]),
    )


def _look(prefix: str, members: Mapping[str, bytes], materials: tuple[Material, ...]) -> Look:
    colors = bytes_array(members[f"{prefix}colors.npy"])
    if f"{prefix}materials.npy" not in members:
        return Look(colors, None)
    uv, normals = (
        bytes_array(members[prefix + name]) if prefix + name in members else None for name in ("uv.npy", "normals.npy")
    )
    return Look(colors, Appearance(materials, bytes_array(members[f"{prefix}materials.npy"]), uv, normals))


def _exemplar(members: Mapping[str, bytes]) -> Exemplar:
    header = json.loads(members["json"])
    return Exemplar(
        name=header["name"],
        part_names=tuple(header["part_names"]),
        assembly=Assembly(
            types=bytes_array(members["types.npy"]),
            poses=bytes_array(members["poses.npy"]),
            edges=bytes_array(members["edges.npy"]),
            looks=bytes_array(members["looks.npy"]) if "looks.npy" in members else None,
        ),
        removed_hubs=Assembly(
            types=bytes_array(members["hub-types.npy"]),
            poses=bytes_array(members["hub-poses.npy"]),
            edges=np.empty((0, 2), dtype=np.int32),
            looks=bytes_array(members["hub-looks.npy"]) if "hub-looks.npy" in members else None,
        ),
    )


def _grammar(described: Mapping[str, Any], labels: Sequence[str]) -> Grammar:
    """Return the grammar of a kit with these labels from the JSON of `kit_json`."""
    index_of = {kind["name"]: index for index, kind in enumerate(described["types"])}
    neighbourhoods = {
        labels.index(name): {
            tuple(sorted((labels.index(other), count) for other, count in rule["neighbours"].items())): rule["seen"]
            for rule in rules
        }
        for name, rules in described["neighbourhoods"].items()
    }
    dockings = tuple(
        Docking(
            a=index_of[docking["a"]],
            b=index_of[docking["b"]],
            pose=np.array(docking["pose"]),
            kind=docking["kind"],
            count=docking["seen"],
            depth=docking["depth"],
            slack=docking.get("slack", 0.0),
        )
        for docking in described["dockings"]
    )
    return Grammar(
        neighbourhoods=neighbourhoods,
        dockings=dockings,
        nested={(index_of[pair["a"]], index_of[pair["b"]]): pair["depth"] for pair in described["nested"]},
        strictness=described["strictness"],
        hubs=tuple(index_of[name] for name in described["hubs"]),
    )
