"""A forger: changes one thing in a finished dataset and updates every checksum, offset and count.

    python -m tests.stages.verification.forge datasets/castle --samples 30 --seed 0

copies the dataset with the files of the work folder that `make verify` needs, applies each forgery to a random sample,
verifies the copy by `make verify` and by the dataset's own verifier alone, and prints a table of what each finds. It
passes over forgeries of members that the dataset lacks. `--with-work` keeps the shards of all stages.
"""

from __future__ import annotations

import argparse
import io
import json
import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.paths import file_digest
from pipeline.shards import ShardWriter, array_bytes, bytes_array, json_bytes
from stages.package.index import column_kinds, index_row, tar_bytes, write_index
from stages.package.layout import INDEX, VERIFIER
from stages.package.manifest import checksums
from stages.shape.collection.pairs import CONTACTS, pair_bytes, pairs_of
from stages.shape.geometry.components import connected_components
from stages.verification.shard import shard_samples
from stages.verification.verify import verify_dataset

Members = dict[str, bytes]


@dataclass
class Forged:
    """A sample to be forged, another one of the dataset, and randomness."""

    members: Members
    other: Members
    rng: np.random.Generator

    @property
    def record(self) -> dict[str, Any]:
        """The record as it is now; `write` takes it back."""
        value: dict[str, Any] = json.loads(self.members["json"])
        return value

    def write(self, record: Any) -> None:
        """Take a changed record."""
        self.members["json"] = json_bytes(record)

    def array(self, name: str) -> np.ndarray:
        """An array, to be changed and put back."""
        return bytes_array(self.members[name]).copy()

    def put(self, name: str, array: np.ndarray) -> None:
        """Take a changed array."""
        self.members[name] = array_bytes(array)


FORGERIES: dict[str, Callable[[Forged], None]] = {}
"""What is done to a sample, by name."""


def forgery(change: Callable[[Forged], None]) -> Callable[[Forged], None]:
    """Adds a forgery to the list."""
    FORGERIES[change.__name__.replace("_", " ")] = change
    return change


def glb_parts(content: bytes) -> tuple[dict[str, Any], bytearray]:
    """Header and binary part of a GLB."""
    length = int.from_bytes(content[12:16], "little")
    return json.loads(content[20 : 20 + length]), bytearray(content[28 + length :])


def glb_of(header: dict[str, Any], binary: bytes) -> bytes:
    """A GLB of header and binary part."""
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = len(text).to_bytes(4, "little") + b"JSON" + text + len(binary).to_bytes(4, "little") + b"BIN\0" + binary
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks


@forgery
def a_vertex_of_the_mesh_moved_by_metres(it: Forged) -> None:
    header, binary = glb_parts(it.members["glb"])
    view = header["bufferViews"][header["accessors"][0]["bufferView"]]
    start = view.get("byteOffset", 0)
    vertex = np.frombuffer(bytes(binary[start : start + 12]), np.float32) + np.float32(3.0)
    binary[start : start + 12] = vertex.tobytes()
    it.members["glb"] = glb_of(header, bytes(binary))


@forgery
def a_part_moved_in_mesh_and_record(it: Forged) -> None:
    header, binary = glb_parts(it.members["glb"])
    record = it.record
    part = int(it.rng.integers(len(record["parts"])))
    size = np.ptp(np.array(record["bounds"]), axis=0).max()
    header["nodes"][part]["matrix"][12] += 0.1 * size
    it.members["glb"] = glb_of(header, bytes(binary))
    if "pose" in record["parts"][part]:
        record["parts"][part]["pose"][0][3] += 0.1 * size
    it.write(record)


@forgery
def points_that_are_no_numbers(it: Forged) -> None:
    points = it.array("points.npy")
    points[3] = np.nan
    it.put("points.npy", points)


@forgery
def points_moved(it: Forged) -> None:
    points = it.array("points.npy")
    it.put("points.npy", points + np.float32(0.01) * np.ptp(points, axis=0).max().astype(np.float32))


@forgery
def one_point_moved(it: Forged) -> None:
    points = it.array("points.npy")
    points[int(it.rng.integers(len(points)))] += 0.05 * np.ptp(points, axis=0).max()
    it.put("points.npy", points)


@forgery
def points_as_doubles(it: Forged) -> None:
    it.put("points.npy", it.array("points.npy").astype(np.float64))


@forgery
def a_point_too_few(it: Forged) -> None:
    for name in ("points.npy", "normals.npy", "labels.npy", "instances.npy"):
        it.put(name, it.array(name)[:-1])


@forgery
def normals_negated(it: Forged) -> None:
    it.put("normals.npy", -it.array("normals.npy"))


@forgery
def one_normal_turned(it: Forged) -> None:
    normals = it.array("normals.npy")
    normals[int(it.rng.integers(len(normals)))] *= -1
    it.put("normals.npy", normals)


@forgery
def one_label_changed(it: Forged) -> None:
    labels = it.array("labels.npy")
    labels[int(it.rng.integers(len(labels)))] += 1
    it.put("labels.npy", labels)


@forgery
def one_instance_out_of_range(it: Forged) -> None:
    instances = it.array("instances.npy")
    instances[0] = 32000
    it.put("instances.npy", instances)


@forgery
def the_cloud_of_another_sample(it: Forged) -> None:
    for name in ("points.npy", "normals.npy"):
        it.members[name] = it.other[name]


@forgery
def the_mesh_of_another_sample(it: Forged) -> None:
    it.members["glb"] = it.other["glb"]


@forgery
def the_text_of_another_sample(it: Forged) -> None:
    it.members["txt"] = it.other["txt"]


@forgery
def the_text_of_another_sample_in_record_too(it: Forged) -> None:
    it.members["txt"] = it.other["txt"]
    it.write({**it.record, "text": json.loads(it.other["json"])["text"]})


@forgery
def the_sketch_of_another_sample(it: Forged) -> None:
    it.members["sketch0.png"] = it.other["sketch0.png"]


@forgery
def a_blank_sketch(it: Forged) -> None:
    it.members["sketch0.png"] = _png(np.full_like(_pixels(it.members["sketch0.png"]), 255))


@forgery
def a_mirrored_sketch(it: Forged) -> None:
    it.members["sketch0.png"] = _png(_pixels(it.members["sketch0.png"])[::-1])


@forgery
def a_truncated_sketch(it: Forged) -> None:
    it.members["sketch0.png"] = it.members["sketch0.png"][:60]


@forgery
def stable_flipped(it: Forged) -> None:
    record = it.record
    record["physics"]["stable"] = not record["physics"]["stable"]
    it.write(record)


@forgery
def rooted_flipped(it: Forged) -> None:
    record = it.record
    record["physics"]["rooted"] = not record["physics"]["rooted"]
    it.write(record)


@forgery
def a_margin_of_its_own(it: Forged) -> None:
    record = it.record
    record["physics"]["margin"] = "much"
    it.write(record)


@forgery
def a_dropped_contact(it: Forged) -> None:
    _contacts(it, lambda pairs: pairs[:-1])


@forgery
def a_contact_with_itself(it: Forged) -> None:
    _contacts(it, lambda pairs: [*pairs, [0, 0]])


@forgery
def a_graph_of_another_name(it: Forged) -> None:
    it.write({**it.record, "graph": "f" * 64})


@forgery
def another_label_in_the_record(it: Forged) -> None:
    record = it.record
    record["parts"][0]["label"] = "gargoyle"
    it.write(record)


@forgery
def another_class_in_the_record(it: Forged) -> None:
    record = it.record
    record["parts"][-1]["class"] += 1
    it.write(record)


@forgery
def bounds_twice_as_large(it: Forged) -> None:
    record = it.record
    record["bounds"] = (2 * np.array(record["bounds"])).tolist()
    it.write(record)


@forgery
def a_part_miscounted(it: Forged) -> None:
    record = it.record
    record["counts"]["parts"] += 1
    it.write(record)


@forgery
def a_record_that_is_a_list(it: Forged) -> None:
    it.write([])


@forgery
def a_record_without_parts(it: Forged) -> None:
    record = it.record
    del record["parts"]
    it.write(record)


@forgery
def a_null_in_the_record(it: Forged) -> None:
    it.write({**it.record, "kit": None})


@forgery
def an_array_of_rubbish(it: Forged) -> None:
    it.members["normals.npy"] = b"\x93NUMPY rubbish"


@forgery
def a_member_too_few(it: Forged) -> None:
    del it.members["txt"]


@forgery
def another_key_in_the_record(it: Forged) -> None:
    it.write({**it.record, "key": "somebody-else"})


@forgery
def a_false_sentence(it: Forged) -> None:
    texts = json.loads(it.members["caption.json"])
    last = list(texts)[-1]
    texts[last] += " It is made of 999 parts."
    it.members["caption.json"] = json_bytes(texts)


@forgery
def signed_distances_negated(it: Forged) -> None:
    it.put("sdf_values.npy", -it.array("sdf_values.npy"))


@forgery
def signed_distances_lengthened(it: Forged) -> None:
    it.put("sdf_values.npy", it.array("sdf_values.npy") * np.float32(1.01))


@forgery
def an_occupancy_inside_out(it: Forged) -> None:
    it.put("occupancy.npy", ~it.array("occupancy.npy"))


@forgery
def a_union_with_a_hole(it: Forged) -> None:
    for name in ("union_faces.npy", "union_instances.npy"):
        it.put(name, it.array(name)[1:])


@forgery
def an_orbit_too_many(it: Forged) -> None:
    record = it.record
    record["symmetry"]["orbits"] = [0] * (len(record["parts"]) + 1)
    it.write(record)


@forgery
def a_group_that_is_not_there(it: Forged) -> None:
    record = it.record
    record["hierarchy"]["part_groups"][0] += 1
    it.write(record)


WHOLE_GEOMETRY = {"a false sentence", "signed distances negated", "signed distances lengthened"}
"""What `make verify` finds only in the samples that it checks by independent means."""

FOLDER_FORGERIES: dict[str, Callable[[Path], None]] = {}
"""What is done to the folder of a dataset, by name."""


def of_folder(change: Callable[[Path], None]) -> Callable[[Path], None]:
    """Adds a forgery of a folder to the list."""
    FOLDER_FORGERIES[change.__name__.replace("_", " ")] = change
    return change


@of_folder
def an_edited_card(folder: Path) -> None:
    card = folder / "README.md"
    card.write_text(card.read_text(encoding="utf-8").replace("rooted", "well rooted"), encoding="utf-8")


@of_folder
def a_link_to_elsewhere(folder: Path) -> None:
    (folder / "data" / "more").symlink_to("/etc")


@of_folder
def an_empty_folder(folder: Path) -> None:
    (folder / "data" / "later").mkdir()


@of_folder
def a_foreign_file(folder: Path) -> None:
    (folder / "notes.txt").write_text("mine", encoding="utf-8")


@of_folder
def samples_of_two_splits_exchanged(folder: Path) -> None:
    shards = _shards(folder)
    paths = [next(path for path in sorted(shards) if f"-{split}-" in path) for split in ("train", "test")]
    (key, one), (other, two) = (next(iter(shards[path].items())) for path in paths)
    for members, split in ((one, "test"), (two, "train")):
        members["json"] = json_bytes({**json.loads(members["json"]), "split": split})
    del shards[paths[0]][key], shards[paths[1]][other]
    shards[paths[0]] = {other: two, **shards[paths[0]]}
    shards[paths[1]] = {key: one, **shards[paths[1]]}
    _write(folder, shards)


@of_folder
def shards_of_two_splits_exchanged(folder: Path) -> None:
    train, test = (sorted((folder / "data" / split).glob("*.tar"))[0] for split in ("train", "test"))
    one, two = train.read_bytes(), test.read_bytes()
    train.write_bytes(two)
    test.write_bytes(one)


@of_folder
def a_manifest_that_ends_early(folder: Path) -> None:
    (folder / "manifest.json").write_text("{", encoding="utf-8")


@of_folder
def a_manifest_that_is_a_list(folder: Path) -> None:
    (folder / "manifest.json").write_text("[]", encoding="utf-8")


def reseal(folder: Path) -> None:
    """Make index, manifest, Croissant and checksums agree with what stands in `folder` now, as far as they can be
    read."""
    try:
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        kinds = column_kinds(json.loads((folder / "schema.json").read_bytes())["properties"])
        rows = []
        for shard in manifest["shards"]:
            path = folder / shard["path"]
            shard["sha256"], shard["bytes"] = file_digest(path), path.stat().st_size
            for key, offset, members in shard_samples(path):
                rows.append({**dict.fromkeys(kinds), **_row(key, shard, offset, members)})
        index = folder.parent / f"{folder.name}-index" / f"{folder.name}.parquet"
        stream = io.BytesIO()
        write_index(rows, kinds, stream)
        index.write_bytes(stream.getvalue())
        manifest["index"] |= {"sha256": file_digest(index), "bytes": index.stat().st_size}
        croissant = json.loads((folder / "croissant.json").read_text(encoding="utf-8"))
        digests = {shard["path"]: shard["sha256"] for shard in manifest["shards"]}
        digests[INDEX] = manifest["index"]["sha256"]
        for item in croissant["distribution"]:
            if item["@id"] in digests:
                item["sha256"] = digests[item["@id"]]
        (folder / "croissant.json").write_text(
            json.dumps(croissant, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )
        manifest["files"]["croissant.json"] = file_digest(folder / "croissant.json")
        (folder / "manifest.json").write_text(
            json.dumps(manifest, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )
    except (ValueError, TypeError, KeyError):
        pass  # a manifest of rubbish: only the checksums are updated
    listed = (path for path in sorted(folder.rglob("*")) if path.is_file() and not path.is_symlink())
    digests = {path.relative_to(folder).as_posix(): file_digest(path) for path in listed}
    digests.pop("checksums.txt", None)
    if "notes.txt" in digests:
        del digests["notes.txt"]
    (folder / "checksums.txt").write_text(checksums(digests), encoding="utf-8")


def forge(folder: Path, name: str, rng: np.random.Generator) -> str:
    """Apply the forgery `name` to the dataset in `folder`, to a sample chosen at random, and seal it again. Answers
    what must be named: the sample's key, or nothing for a forgery of the folder."""
    if name in FOLDER_FORGERIES:
        FOLDER_FORGERIES[name](folder)
        reseal(folder)
        return ""
    shards = _shards(folder)
    places = [(path, key) for path, samples in shards.items() for key in samples]
    path, key = places[int(rng.integers(len(places)))]
    members, others = shards[path][key], [shards[p][k] for p, k in places if k != key]
    differing = [other for other in others if other["txt"] != members["txt"] and other["glb"] != members["glb"]]
    it = Forged(dict(members), differing[int(rng.integers(len(differing)))], rng)
    FORGERIES[name](it)
    if it.members == members:
        raise ValueError(f"{name} changes nothing in {key}")
    shards[path][key] = it.members
    _write(folder, {path: shards[path]})
    reseal(folder)
    return key


def _row(key: str, shard: Mapping[str, Any], offset: int, members: Members) -> dict[str, Any]:
    record: Any = json.loads(members["json"])
    try:
        return index_row(record, shard["path"], offset, tar_bytes(members))
    except (KeyError, TypeError):
        blank = {"key": key, "split": shard["split"], "shard": shard["path"], "offset": offset}
        return {**blank, "bytes": tar_bytes(members)}


def _shards(folder: Path) -> dict[str, dict[str, Members]]:
    paths = sorted((folder / "data").rglob("*.tar"))
    return {
        path.relative_to(folder).as_posix(): {key: members for key, _, members in shard_samples(path)} for path in paths
    }


def _write(folder: Path, shards: Mapping[str, Mapping[str, Members]]) -> None:
    for path, samples in shards.items():
        (folder / path).unlink()
        with open(folder / path, "wb") as stream, ShardWriter(stream) as writer:
            for key, members in samples.items():
                writer.write(key, members)


def _contacts(it: Forged, change: Callable[[list[list[int]]], list[list[int]]]) -> None:
    record = it.record
    pairs = change(pairs_of(it.members[CONTACTS]).tolist())
    it.members[CONTACTS] = pair_bytes(np.array(pairs, dtype=np.int32).reshape(-1, 2))
    pieces = connected_components(len(record["parts"]), np.array(pairs).reshape(-1, 2)).max() + 1
    record["counts"]["pieces"] = int(pieces)
    record["counts"]["cycles"] = len(pairs) - len(record["parts"]) + int(pieces)
    record["counts"]["contacts"] = len(pairs)
    it.write(record)


def _pixels(content: bytes) -> np.ndarray:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(content)).convert("L"))


def _png(pixels: np.ndarray) -> bytes:
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "png")
    return stream.getvalue()


def copy_dataset(source: Path, target: Path, with_work: bool) -> Path:
    """A copy of a dataset and its index in the folder `target`, with the files of the work folder that verify needs."""
    for name in (source.name, f"{source.name}-index"):
        shutil.copytree(source.parent / name, target / name)
    work = source.parent / ".work" / source.name
    for stage in work.iterdir() if with_work else [work / "exemplars"]:
        if stage.is_dir() and stage.name != "package":
            shutil.copytree(stage, target / ".work" / source.name / stage.name)
    return target / source.name


def main() -> None:
    """Forge a dataset in many ways, one at a time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--samples", default="100")
    parser.add_argument("--with-work", action="store_true")
    asked = parser.parse_args()
    samples, found = None if asked.samples == "all" else int(asked.samples), [0, 0]
    names = [*FORGERIES, *FOLDER_FORGERIES]
    print("| forgery | make verify | verify.py | first fault of verify.py |\n|---|---|---|---|")
    for number, name in enumerate(names):
        with tempfile.TemporaryDirectory() as place:
            folder = copy_dataset(asked.folder, Path(place), asked.with_work)
            try:
                key = forge(folder, name, np.random.default_rng([asked.seed, number]))
            except KeyError as error:
                print(f"| {name} | no {error} | | |", flush=True)
                continue
            both = verify_dataset(folder, samples, 0).faults
            own = both.pop(VERIFIER, [])
            said = [
                [fault for faults in both.values() for fault in faults if key in fault],
                [f for f in own if key in f],
            ]
            found = [count + bool(faults) for count, faults in zip(found, said, strict=True)]
            verdicts = " | ".join("found" if faults else "not found" for faults in said)
            print(f"| {name} | {verdicts} | {said[1][0] if said[1] else ''} |", flush=True)
    print(f"\n{len(names)} forgeries; make verify finds {found[0]}, verify.py alone {found[1]}")


if __name__ == "__main__":
    main()
