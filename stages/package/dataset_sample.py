"""One sample of a finished dataset, as typed values."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from pipeline.paths import write_file
from pipeline.shards import bytes_array
from stages.shape.arrays import ByteArray
from stages.shape.collection.archive import archive_files, archive_name

if TYPE_CHECKING:
    import trimesh

    from stages.shape.shape import Shape
    from stages.views.reading import SampleView

VIEW_SUFFIXES = (".png", ".jpg", ".webp", ".exr")


@dataclass(frozen=True)
class LabelledCloud:
    """A point cloud of a sample.

    points, normals: float32 (n, 3)
    labels: class of the part of each point, int (n,)
    instances: part of each point, int (n,)
    cameras: of a scan, the camera that saw each point, by its place in the record of the scan, int (n,); else empty
    """

    points: npt.NDArray[Any]
    normals: npt.NDArray[Any]
    labels: npt.NDArray[Any]
    instances: npt.NDArray[Any]
    cameras: npt.NDArray[Any]


@dataclass(frozen=True)
class DatasetSample:
    """One sample of a dataset. Members are decoded when they are first asked for.

    key: the name of the sample, unique in its dataset.
    split: `train`, `val` or `test`.
    members: the bytes of each member, by its name, such as `points.npy`.
    """

    key: str
    split: str
    members: Mapping[str, bytes]

    @cached_property
    def record(self) -> dict[str, Any]:
        """The JSON record; `schema.json` of the dataset describes its fields."""
        record: dict[str, Any] = json.loads(self.members["json"])
        return record

    @cached_property
    def mesh(self) -> trimesh.Scene:
        """The GLB as a trimesh scene, y up: one node a part, named by its label."""
        import trimesh

        return trimesh.load_scene(io.BytesIO(self.members["glb"]), file_type="glb", process=False)

    @cached_property
    def shape(self) -> Shape:
        """The GLB as a `Shape`: part meshes, poses and labels, without contacts."""
        from stages.package.glb_shape import glb_shape

        return glb_shape(self.members["glb"])

    @property
    def points(self) -> npt.NDArray[Any]:
        """Points on the surface, float32 (n, 3)."""
        return self.array("points")

    @property
    def normals(self) -> npt.NDArray[Any]:
        """Unit normals of the points, float32 (n, 3)."""
        return self.array("normals")

    @property
    def labels(self) -> npt.NDArray[Any]:
        """The class of each point, int (n,): its index in `Dataset.classes`."""
        return self.array("labels")

    @property
    def instances(self) -> npt.NDArray[Any]:
        """The part of each point, int (n,): its index in `record["parts"]`."""
        return self.array("instances")

    @cached_property
    def clouds(self) -> tuple[LabelledCloud, ...]:
        """All clouds of the whole surface; the first is that of `points`."""
        count = self.record.get("points", {"clouds": 0}).get("clouds", 1)
        return tuple(self._cloud("", str(index) if index else "") for index in range(count))

    @cached_property
    def scans(self) -> tuple[LabelledCloud, ...]:
        """The partial scans, where the dataset has them; `record["scans"]` has their cameras and noise."""
        return tuple(self._cloud("scan_", str(index)) for index in range(len(self.record.get("scans", ()))))

    def _cloud(self, prefix: str, number: str) -> LabelledCloud:
        names = ("points", "normals", "labels", "instances")
        points, normals, labels, instances = (self.array(f"{prefix}{name}{number}") for name in names)
        cameras = self.array(f"{prefix}cameras{number}") if prefix else np.empty(0, dtype=np.int16)
        return LabelledCloud(points, normals, labels, instances, cameras)

    @cached_property
    def union(self) -> trimesh.Trimesh:
        """The watertight union of all parts, where the dataset has it."""
        import trimesh

        return trimesh.Trimesh(self.array("union_vertices"), self.array("union_faces"), process=False)

    @property
    def distances(self) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Points, float32 (n, 3), and their signed distances to the union, float32 (n,), negative inside."""
        return self.array("sdf_points"), self.array("sdf_values")

    @cached_property
    def occupancy(self) -> npt.NDArray[Any]:
        """Which cells of the cube of `record["union"]` are inside, bool (r, r, r), by x, y and z."""
        return np.unpackbits(self.array("occupancy"), axis=2).astype(bool)

    @property
    def contacts(self) -> npt.NDArray[Any]:
        """Pairs of parts that touch, int32 (2, m)."""
        return self.array("contacts")

    @cached_property
    def sketches(self) -> tuple[ByteArray, ...]:
        """The line drawings, uint8 (h, w) each; `record["sketches"]` has their cameras."""
        from PIL import Image

        names = [f"sketch{index}.png" for index in range(len(self.record.get("sketches", ())))]
        return tuple(np.asarray(Image.open(io.BytesIO(self.members[name])), dtype=np.uint8) for name in names)

    @cached_property
    def views(self) -> tuple[SampleView, ...]:
        """The rendered views: camera, colour, depth, normals, instances and what else the dataset has; else empty."""
        from stages.views.reading import read_views

        return read_views(self.members, self.record.get("views", []))

    def export_views(self, folder: Path | str) -> None:
        """Write the images of all views and `transforms.json` into a folder, as NeRF tools read them.

        Raises KeyError for a sample without colour images, and ValueError for one with orthographic cameras.
        """
        from stages.views.transforms import transforms_bytes

        cameras = self.record.get("views", [])
        suffix = next((name.partition(".")[2] for name in self.members if name.startswith("color0.")), None)
        if suffix is None:
            raise KeyError(f"{self.key} has no colour images; its members are {', '.join(self.members)}")
        colors = [f"color{index}.{suffix}" for index in range(len(cameras))]
        files = {name: content for name, content in self.members.items() if name.endswith(VIEW_SUFFIXES)}
        for name, content in {**files, "transforms.json": transforms_bytes(cameras, colors)}.items():
            write_file(Path(folder) / name, content)

    @cached_property
    def captions(self) -> dict[str, str]:
        """The captions by length, such as `short`; empty where the dataset has none."""
        captions: dict[str, str] = json.loads(self.members.get("caption.json", b"{}"))
        return captions

    def exported(self, kind: str) -> dict[str, bytes]:
        """Return the files of a format, such as `urdf`, by their paths. Raises KeyError where the dataset has none."""
        name = archive_name(kind)
        if name not in self.members:
            raise KeyError(f"{self.key} has no {name}; its members are {', '.join(self.members)}")
        return archive_files(self.members[name])

    @property
    def text(self) -> str:
        """What the sample was made from: strings, parameters, a program or a derivation."""
        return self.members["txt"].decode()

    def array(self, name: str) -> npt.NDArray[Any]:
        """Return the member `<name>.npy`. Raises KeyError, with the members that exist, where it is missing."""
        if f"{name}.npy" not in self.members:
            raise KeyError(f"{self.key} has no {name}.npy; its members are {', '.join(self.members)}")
        return bytes_array(self.members[f"{name}.npy"])
