"""`croissant.json`: the dataset in Croissant 1.1 (MLCommons), for loaders that know no WebDataset.

Each member is a record set of its own, with the sample's key and the member's content. `samples` are the rows of the
index, typed, with the split of each. `<member>-of-samples` joins the two. Measured with mlcroissant: it joins two
sources and no more, and only fields of record sets (a file set in a tar is lost to a join when the tar has others);
what lies in a tar it reads as it is, so fields of the JSON member cannot be had by their paths, nor arrays as arrays.
An array is therefore declared twice: as text, the bytes of an `.npy` that come out, and by the type and shape of what
they hold.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from stages.package.layout import CLASSES

VOCABULARY = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "arrayShape": "cr:arrayShape",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "containedIn": "cr:containedIn",
    "cr": "http://mlcommons.org/croissant/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "description": {"@container": "@language"},
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileObject": "cr:fileObject",
    "fileProperty": "cr:fileProperty",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isArray": "cr:isArray",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "name": {"@container": "@language"},
    "parentField": "cr:parentField",
    "path": "cr:path",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "samplingRate": "cr:samplingRate",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}

FORMATS = {
    "glb": "model/gltf-binary",
    "npy": "application/octet-stream",
    "png": "image/png",
    "txt": "text/plain",
    "json": "application/json",
}
ELEMENTS = {"float32": "cr:Float32", "float64": "cr:Float64", "int16": "cr:Int16", "int32": "cr:Int32"}
ELEMENTS |= {"uint8": "cr:UInt8"}
KINDS = {"string": "sc:Text", "bool": "sc:Boolean", "int32": "sc:Integer", "int64": "sc:Integer", "float64": "sc:Float"}
URLS = {"train": "cr:TrainingSplit", "val": "cr:ValidationSplit", "test": "cr:TestSplit"}
INDEX = "index"


def croissant(
    facts: Mapping[str, Any],
    shards: Sequence[Mapping[str, Any]],
    members: Sequence[Mapping[str, Any]],
    index: Mapping[str, Any],
    classes: Mapping[str, Any],
    origins: Sequence[Mapping[str, Any]],
    citation: str,
) -> dict[str, Any]:
    """The document. `facts` has name, version, title, description, license, creator and published; `shards` are the
    summaries of the package's shards; `members` has name, sentence, dtype and shape of each; `index` has path, bytes,
    sha256 and columns (their Arrow types by name); `classes` has the sha256 of the file of that name; `origins` are
    what the dataset was made from."""
    splits = list(dict.fromkeys(str(shard["split"]) for shard in shards))
    return {
        "@context": VOCABULARY,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.1",
        "name": facts["name"],
        "description": facts["description"],
        "version": facts["version"],
        "license": _license(str(facts["license"])),
        "creator": {"@type": "sc:Organization", "name": facts["creator"]},
        "datePublished": facts["published"],
        "citeAs": citation,
        "keywords": list(facts["tags"]),
        **({"isBasedOn": [_work(origin) for origin in origins]} if origins else {}),
        "distribution": [
            *map(_shard, shards),
            _index(index),
            *(_files(member["name"], member["sentence"], shards) for member in members),
            _class_file(classes),
        ],
        "recordSet": [
            _split_records(splits),
            _sample_records(index["columns"]),
            *map(_member_records, members),
            *map(_joined_records, members),
            _class_records(),
        ],
    }


def _license(spdx: str) -> str:
    return spdx if spdx == "unknown" else f"https://spdx.org/licenses/{spdx}.html"


def _work(origin: Mapping[str, Any]) -> dict[str, Any]:
    """A file that the dataset was made from, as a schema.org CreativeWork."""
    work = {"@type": "sc:CreativeWork", "name": origin["file"], "identifier": f"sha256:{origin['sha256']}"}
    if origin["author"]:
        work["author"] = {"@type": "sc:Person", "name": origin["author"]}
    if origin["source"]:
        work["url"] = origin["source"]
    if origin["license"]:
        work["license"] = origin["license"]
    if origin["notice"]:
        work["creditText"] = origin["notice"]
    return work


def _shard(shard: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "@type": "cr:FileObject",
        "@id": shard["path"],
        "name": str(shard["path"]).rpartition("/")[2],
        "description": f"{shard['samples']} samples of the split {shard['split']}.",
        "contentUrl": shard["path"],
        "contentSize": f"{shard['bytes']} B",
        "encodingFormat": "application/x-tar",
        "sha256": shard["sha256"],
    }


def _index(index: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "@type": "cr:FileObject",
        "@id": INDEX,
        "name": str(index["path"]).rpartition("/")[2],
        "description": "One row a sample. Its folder is next to that of the dataset.",
        "contentUrl": index["path"],
        "contentSize": f"{index['bytes']} B",
        "encodingFormat": "application/x-parquet",
        "sha256": index["sha256"],
    }


def _files(member: str, text: str, shards: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {
        "@type": "cr:FileSet",
        "@id": f"files-{_identifier(member)}",
        "name": f"files-{_identifier(member)}",
        "description": f"{text} One file a sample.",
        "containedIn": [{"@id": shard["path"]} for shard in shards],
        "encodingFormat": FORMATS[member.rpartition(".")[2]],
        "includes": f"*.{member}",
    }


def _split_records(splits: Sequence[str]) -> dict[str, Any]:
    return {
        "@type": "cr:RecordSet",
        "@id": "splits",
        "name": "splits",
        "description": "The splits of the dataset.",
        "dataType": "cr:Split",
        "key": {"@id": "splits/name"},
        "field": [
            _field("splits/name", "Name of the split.", "sc:Text"),
            _field("splits/url", "What the split is for.", "sc:URL"),
        ],
        "data": [{"splits/name": split, "splits/url": URLS[split]} for split in splits],
    }


def _sample_records(columns: Mapping[str, str]) -> dict[str, Any]:
    fields = []
    for name, kind in columns.items():
        source = {"fileObject": {"@id": INDEX}, "extract": {"column": name}}
        joined = {"references": {"field": {"@id": "splits/name"}}} if name == "split" else {}
        fields.append(_field(f"samples/{name}", f"Column {name} of the index.", KINDS[kind], source=source, **joined))
    return _record_set("samples", "One record a sample: the rows of the index.", fields)


def _member_records(member: Mapping[str, Any]) -> dict[str, Any]:
    name, files = _identifier(member["name"]), {"@id": f"files-{_identifier(member['name'])}"}
    key = {
        "fileSet": files,
        "extract": {"fileProperty": "filename"},
        "transform": {"regex": r"^([^.]+)\."},
    }
    content = {"fileSet": files, "extract": {"fileProperty": "content"}}
    fields = [
        _field(f"{name}/key", "The sample's key.", "sc:Text", source=key),
        _field(f"{name}/content", member["sentence"], source=content, **_content_type(member)),
    ]
    return _record_set(name, member["sentence"], fields)


def _joined_records(member: Mapping[str, Any]) -> dict[str, Any]:
    """The member with the split and the kit of its sample."""
    own = _identifier(member["name"])
    name = f"{own}-of-samples"
    fields = [
        _field(
            f"{name}/key",
            "The sample's key.",
            "sc:Text",
            source={"field": {"@id": f"{own}/key"}},
            references={"field": {"@id": "samples/key"}},
        ),
        *(
            _field(f"{name}/{item}", f"The sample's {item}.", "sc:Text", source={"field": {"@id": f"samples/{item}"}})
            for item in ("split", "kit")
        ),
        _field(
            f"{name}/content",
            member["sentence"],
            source={"field": {"@id": f"{own}/content"}},
            **_content_type(member),
        ),
    ]
    return _record_set(name, f"{member['sentence']} With the split and the kit of its sample.", fields)


def _content_type(member: Mapping[str, Any]) -> dict[str, Any]:
    if member["name"].endswith(".png"):
        return {"dataType": "sc:ImageObject"}
    if not member["name"].endswith(".npy"):
        return {"dataType": "sc:Text"}
    lengths = ",".join(str(item) if isinstance(item, int) else "-1" for item in member["shape"])
    return {"dataType": ["sc:Text", ELEMENTS[member["dtype"]]], "isArray": True, "arrayShape": lengths}


def _record_set(name: str, description: str, fields: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {
        "@type": "cr:RecordSet",
        "@id": name,
        "name": name,
        "description": description,
        "key": {"@id": f"{name}/key"},
        "field": list(fields),
    }


def _field(identifier: str, description: str, data_type: str = "", **more: Any) -> dict[str, Any]:
    typed = {"dataType": data_type} if data_type else {}
    name = identifier.rpartition("/")[2]
    return {"@type": "cr:Field", "@id": identifier, "name": name, "description": description, **typed, **more}


def _class_file(classes: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "@type": "cr:FileObject",
        "@id": CLASSES,
        "name": CLASSES,
        "description": "The part labels of the dataset, and how many shapes and parts of each split have them.",
        "contentUrl": CLASSES,
        "encodingFormat": FORMATS["json"],
        "sha256": classes["sha256"],
    }


def _class_records() -> dict[str, Any]:
    fields = {
        "id": ("sc:Integer", "What the labels of points and the classes of parts say."),
        "name": ("sc:Text", "The part label."),
        "kit": ("sc:Text", "The kit, program or category that has it."),
        "color": ("sc:Text", "A colour that stands for it, sRGB."),
    }
    return {
        "@type": "cr:RecordSet",
        "@id": "classes",
        "name": "classes",
        "description": "The part labels of the dataset by id.",
        "key": {"@id": "classes/id"},
        "field": [
            {
                "@type": "cr:Field",
                "@id": f"classes/{name}",
                "name": name,
                "description": text,
                "dataType": kind,
                "source": {"fileObject": {"@id": CLASSES}, "extract": {"jsonPath": f"$[*].{name}"}},
            }
            for name, (kind, text) in fields.items()
        ],
    }


def _identifier(member: str) -> str:
    """`points.npy` as `points`; members of one format only keep their name: `glb`, `json`."""
    return member.partition(".")[0]
