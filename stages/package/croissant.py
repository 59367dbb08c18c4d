"""`croissant.json`: the dataset in Croissant 1.1 (MLCommons), for loaders that do not read WebDataset.

Each member is a record set with the sample's key and the member's content. `samples` are the rows of the index, typed,
with the split of each. `<member>-of-samples` joins the two. mlcroissant joins two sources at most, and only fields of
record sets. It reads files in a tar as they are: fields of the JSON member and arrays cannot be addressed. So an array
is declared twice: as text, the bytes of an `.npy`, and by the type and shape of its content.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

import mlcroissant as mlc

from stages.package.layout import CLASSES, INDEX

VERSION = "http://mlcommons.org/croissant/1.1"
TERMS = {name: f"cr:{name}" for name in ("arrayShape", "containedIn", "isArray")}
"""Terms of version 1.1 that mlcroissant leaves out of the context."""
FORMATS = {
    "glb": "model/gltf-binary",
    "npy": "application/octet-stream",
    "png": "image/png",
    "jpg": "image/jpeg",
    "webp": "image/webp",
    "exr": "image/x-exr",
    "txt": "text/plain",
    "json": "application/json",
    "gz": "application/gzip",
}
IMAGES = (".png", ".jpg", ".webp")
"""Suffixes of members that mlcroissant decodes as images."""
ELEMENTS = {"float32": "cr:Float32", "float64": "cr:Float64", "int16": "cr:Int16", "int32": "cr:Int32"}
ELEMENTS |= {"uint8": "cr:UInt8"}
KINDS = {"string": "sc:Text", "bool": "sc:Boolean", "int32": "sc:Integer", "int64": "sc:Integer", "float64": "sc:Float"}
SPLIT_URLS = {"train": "cr:TrainingSplit", "val": "cr:ValidationSplit", "test": "cr:TestSplit"}
CLASS_FIELDS = {
    "id": ("sc:Integer", "Label of points and class of parts."),
    "name": ("sc:Text", "Part label."),
    "kit": ("sc:Text", "Kit, program or category of the label."),
    "color": ("sc:Text", "Display colour, sRGB."),
}


def croissant(
    facts: Mapping[str, Any],
    shards: Sequence[Mapping[str, Any]],
    members: Sequence[Mapping[str, Any]],
    index: Mapping[str, Any],
    classes: Mapping[str, Any],
    origins: Sequence[Mapping[str, Any]],
    citation: str,
) -> dict[str, Any]:
    """Return the document.

    facts: name, version, title, description, license, creator, published and tags
    shards: summaries of the package's shards
    members: name, sentence, dtype and shape of each
    index: path, bytes, sha256 and columns (Arrow type by name)
    classes: sha256 of `classes.json`
    origins: the files that the dataset was made from
    """
    license = str(facts["license"])
    members = _identified(members)
    document: dict[str, Any] = mlc.Metadata(
        name=facts["name"],
        description=facts["description"],
        version=facts["version"],
        license=[license if license == "unknown" else f"https://spdx.org/licenses/{license}.html"],
        creators=[mlc.Organization(name=facts["creator"])],
        date_published=datetime.fromisoformat(facts["published"]),
        cite_as=citation,
        keywords=list(facts["tags"]),
        conforms_to=[VERSION],
        distribution=[*_files(shards, index, classes), *(_file_set(member, shards) for member in members)],
        record_sets=[
            _splits(list(dict.fromkeys(str(shard["split"]) for shard in shards))),
            _samples(index["columns"]),
            *(_member_records(member) for member in members),
            *(_joined_records(member) for member in members),
            _class_records(),
        ],
        extra_properties={"isBasedOn": [_work(origin) for origin in origins]},
    ).to_json()
    document["@context"] |= TERMS
    return document


def _work(origin: Mapping[str, Any]) -> dict[str, Any]:
    """Return a file that the dataset was made from, as a schema.org CreativeWork."""
    author = {"@type": "sc:Person", "name": origin["author"]} if origin["author"] else None
    work = {"url": origin["source"], "author": author, "license": origin["license"], "creditText": origin["notice"]}
    identity = {"@type": "sc:CreativeWork", "name": origin["file"], "identifier": f"sha256:{origin['sha256']}"}
    return identity | {key: value for key, value in work.items() if value}


def _files(
    shards: Sequence[Mapping[str, Any]], index: Mapping[str, Any], classes: Mapping[str, Any]
) -> list[mlc.FileObject]:
    files = [
        mlc.FileObject(
            id=shard["path"],
            name=str(shard["path"]).rpartition("/")[2],
            description=f"{shard['samples']} samples of the split {shard['split']}.",
            content_url=shard["path"],
            content_size=f"{shard['bytes']} B",
            encoding_formats=["application/x-tar"],
            sha256=shard["sha256"],
        )
        for shard in shards
    ]
    files.append(
        mlc.FileObject(
            id=INDEX,
            name=str(index["path"]).rpartition("/")[2],
            description="One row per sample. Its folder is next to that of the dataset.",
            content_url=index["path"],
            content_size=f"{index['bytes']} B",
            encoding_formats=["application/x-parquet"],
            sha256=index["sha256"],
        )
    )
    text = "The part labels of the dataset, with the numbers of shapes and parts of each split."
    kind = [FORMATS["json"]]
    files.append(
        mlc.FileObject(
            id=CLASSES,
            name=CLASSES,
            description=text,
            content_url=CLASSES,
            encoding_formats=kind,
            sha256=classes["sha256"],
        )
    )
    return files


def _file_set(member: Mapping[str, Any], shards: Sequence[Mapping[str, Any]]) -> mlc.FileSet:
    name = f"files-{member['identifier']}"
    return mlc.FileSet(
        id=name,
        name=name,
        description=f"{member['sentence']} One file per sample.",
        contained_in=[shard["path"] for shard in shards],
        encoding_formats=[FORMATS[member["name"].rpartition(".")[2]]],
        includes=[f"*.{member['name']}"],
    )


def _splits(splits: Sequence[str]) -> mlc.RecordSet:
    fields = [
        _field("splits/name", "Name of the split.", "sc:Text"),
        _field("splits/url", "Purpose of the split.", "sc:URL"),
    ]
    data = [{"splits/name": split, "splits/url": SPLIT_URLS[split]} for split in splits]
    return _record_set(
        "splits", "The splits of the dataset.", fields, "name", data_types=[_full_name("cr:Split")], data=data
    )


def _samples(columns: Mapping[str, str]) -> mlc.RecordSet:
    fields = []
    for name, kind in columns.items():
        source = mlc.Source(file_object=INDEX, extract=mlc.Extract(column=name))
        joined = {"references": mlc.Source(field="splits/name")} if name == "split" else {}
        text = f"Column {name} of the index."
        fields.append(_field(f"samples/{name}", text, KINDS[kind], source=source, **joined))
    return _record_set("samples", "One record per sample: the rows of the index.", fields)


def _member_records(member: Mapping[str, Any]) -> mlc.RecordSet:
    name = str(member["identifier"])
    files = f"files-{name}"
    file_name = mlc.Source(
        file_set=files,
        extract=mlc.Extract(file_property=mlc.FileProperty.filename),
        transforms=[mlc.Transform(regex=r"^([^.]+)\.")],
    )
    content = mlc.Source(file_set=files, extract=mlc.Extract(file_property=mlc.FileProperty.content))
    fields = [
        _field(f"{name}/key", "The sample's key.", "sc:Text", source=file_name),
        _field(f"{name}/content", member["sentence"], *_content_types(member), source=content, **_array(member)),
    ]
    return _record_set(name, member["sentence"], fields)


def _joined_records(member: Mapping[str, Any]) -> mlc.RecordSet:
    """Return the member with the split and the kit of its sample."""
    own = str(member["identifier"])
    name = f"{own}-of-samples"
    key, content = (mlc.Source(field=f"{own}/{field}") for field in ("key", "content"))
    joined = mlc.Source(field="samples/key")
    fields = [_field(f"{name}/key", "The sample's key.", "sc:Text", source=key, references=joined)]
    for column in ("split", "kit"):
        source = mlc.Source(field=f"samples/{column}")
        fields.append(_field(f"{name}/{column}", f"The sample's {column}.", "sc:Text", source=source))
    types = _content_types(member)
    fields.append(_field(f"{name}/content", member["sentence"], *types, source=content, **_array(member)))
    return _record_set(name, f"{member['sentence']} With the split and the kit of its sample.", fields)


def _class_records() -> mlc.RecordSet:
    fields = []
    for name, (kind, text) in CLASS_FIELDS.items():
        source = mlc.Source(file_object=CLASSES, extract=mlc.Extract(json_path=f"$[*].{name}"))
        fields.append(_field(f"classes/{name}", text, kind, source=source))
    return _record_set("classes", "The part labels of the dataset by id.", fields, "id")


def _content_types(member: Mapping[str, Any]) -> list[str]:
    if member["name"].endswith(IMAGES):
        return ["sc:ImageObject"]
    return ["sc:Text", ELEMENTS[member["dtype"]]] if member["name"].endswith(".npy") else ["sc:Text"]


def _array(member: Mapping[str, Any]) -> dict[str, Any]:
    if not member["name"].endswith(".npy"):
        return {}
    lengths = (str(length) if isinstance(length, int) else "-1" for length in member["shape"])
    return {"is_array": True, "array_shape": ",".join(lengths)}


def _record_set(name: str, text: str, fields: Sequence[mlc.Field], key: str = "key", **more: Any) -> mlc.RecordSet:
    return mlc.RecordSet(id=name, name=name, description=text, key=[f"{name}/{key}"], fields=list(fields), **more)


def _field(name: str, text: str, *types: str, **more: Any) -> mlc.Field:
    full = [_full_name(kind) for kind in types]
    return mlc.Field(id=name, name=name.rpartition("/")[2], description=text, data_types=full, **more)


def _full_name(name: str) -> str:
    """Expand the prefix of a type: `sc:Text`, `cr:Float32`."""
    prefix, _, rest = name.partition(":")
    return {"sc": "https://schema.org/", "cr": "http://mlcommons.org/croissant/"}[prefix] + rest


def _identified(members: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return members with an `identifier`: `points` for `points.npy`, `glb` for `glb`, and with its format for a member
    whose name another one has, such as `normals1-png` where there is `normals1.npy`.
    """
    found: dict[str, Mapping[str, Any]] = {}
    for member in members:
        name = str(member["name"])
        identifier = name.partition(".")[0]
        identifier = name.replace(".", "-") if identifier in found else identifier
        found[identifier] = {**member, "identifier": identifier}
    return list(found.values())
