"""`croissant.json`: the dataset in Croissant 1.1 (MLCommons), for loaders that know no WebDataset.

Each member is a record set of its own, with the sample's key and the member's content: mlcroissant joins two
sources at most, and when both are contents of files it reads the first one's for both. Equal keys belong together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from stages.package.layout import CLASSES

__all__ = ["croissant"]

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


def croissant(
    facts: Mapping[str, Any],
    shards: Sequence[Mapping[str, Any]],
    members: Sequence[Mapping[str, Any]],
    classes: Mapping[str, Any],
    citation: str,
) -> dict[str, Any]:
    """The document. `facts` has name, version, title, description, license, creator and published; `shards` are the
    summaries of the package's shards; `members` has name, sentence, dtype and shape of each; `classes` has the sha256
    of the file of that name."""
    spdx = str(facts["license"])
    return {
        "@context": VOCABULARY,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.1",
        "name": facts["name"],
        "description": facts["description"],
        "version": facts["version"],
        "license": spdx if spdx == "unknown" else f"https://spdx.org/licenses/{spdx}.html",
        "creator": {"@type": "sc:Organization", "name": facts["creator"]},
        "datePublished": facts["published"],
        "citeAs": citation,
        "keywords": list(facts["tags"]),
        "distribution": [
            *map(_shard, shards),
            *(_files(each["name"], each["sentence"], shards) for each in members),
            _class_file(classes),
        ],
        "recordSet": [*(_records(each["name"], each["sentence"]) for each in members), _class_records()],
    }


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


def _records(member: str, text: str) -> dict[str, Any]:
    name = _identifier(member)
    return {
        "@type": "cr:RecordSet",
        "@id": name,
        "name": name,
        "description": text,
        "key": {"@id": f"{name}/key"},
        "field": [
            {
                "@type": "cr:Field",
                "@id": f"{name}/key",
                "name": "key",
                "description": "The sample's key.",
                "dataType": "sc:Text",
                "source": {
                    "fileSet": {"@id": f"files-{name}"},
                    "extract": {"fileProperty": "filename"},
                    "transform": {"regex": r"^([^.]+)\."},
                },
            },
            {
                "@type": "cr:Field",
                "@id": f"{name}/content",
                "name": "content",
                "description": text,
                "dataType": "sc:ImageObject" if member.endswith(".png") else "sc:Text",
                "source": {"fileSet": {"@id": f"files-{name}"}, "extract": {"fileProperty": "content"}},
            },
        ],
    }


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
