"""Part hierarchies of a folder or a file, by index: what a config names, and a shard reads."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

from pipeline.errors import ConfigError, Rejected
from stages.model_files.scene_file import READERS
from stages.shape.input_file import check_input_file, without_sidecars
from stages.shapeassembly.extraction.hierarchy import UNREADABLE, PartHierarchy
from stages.shapeassembly.extraction.readers.child_process import read_grass_in_child, read_in_child
from stages.shapeassembly.extraction.readers.grass import GrassFile
from stages.shapeassembly.sources import cached_digest

HierarchyKind = Literal["structurenet", "partnet", "grass", "model", "glb"]

_ENDINGS = {
    "structurenet": (".json",),
    "partnet": ("result_after_merging.json",),
    "glb": (".glb",),
    "model": tuple(READERS),
}


@dataclass(frozen=True)
class HierarchySource:
    """A folder or file of hierarchies.

    path: a folder, or one file; for `grass` an npz file with many shapes.
    up: the axis that points up in model files; other kinds are y up.
    """

    path: Path
    kind: HierarchyKind
    up: Literal["auto", "y", "z"]

    def __len__(self) -> int:
        """Return the number of hierarchies, unreadable ones included; an unreadable npz file counts as one."""
        if self.kind != "grass":
            return len(self._files())
        try:
            return len(self._grass())
        except Rejected:
            return 1

    def read(self, first: int, last: int) -> Iterator[tuple[str, PartHierarchy | Rejected]]:
        """Yield hierarchies `first` to before `last`: name below the path, and the hierarchy or why it was rejected."""
        files = () if self.kind == "grass" else self._files()
        for index in range(first, last):
            name = self._name(files[index]) if files else f"{self.path.name}/{index:05d}"
            try:
                yield name, self._read(files[index]) if files else self._grass().shape(index)
            except Rejected as error:
                yield name, error

    @property
    def sidecars(self) -> int:
        """The number of `._` files of macOS in the folder, which are left out."""
        return without_sidecars(self._found())[1] if self.path.is_dir() and self.kind != "grass" else 0

    def digest(self, first: int, last: int) -> str:
        """Return the hex sha256 of names and bytes of what `read` reads."""
        digest = hashlib.sha256()
        for file in (self.path,) if self.kind == "grass" else self._files()[first:last]:
            meshes = sorted((file.parent / "objs").glob("*.obj")) if self.kind == "partnet" else []
            for part in (file, *meshes):
                digest.update(f"{self._name(part)}\0{cached_digest(part)}\n".encode())
        return digest.hexdigest()

    def _files(self) -> Sequence[Path]:
        if self.path.is_file():
            return (self.path,)
        return sorted(without_sidecars(self._found())[0], key=self._name)

    def _found(self) -> list[Path]:
        endings = _ENDINGS[self.kind]
        found = (file for file in self.path.rglob("*") if file.name.lower().endswith(endings))
        return [file for file in found if file.is_file() and not file.is_symlink()]

    def _name(self, file: Path) -> str:
        return file.relative_to(self.path).as_posix() if self.path.is_dir() else file.name

    def _grass(self) -> GrassFile:
        state = self.path.stat()
        return _known_grass(self.path, state.st_mtime_ns, state.st_size)

    def _read(self, file: Path) -> PartHierarchy:
        try:
            check_input_file(file)
        except ConfigError as error:
            raise Rejected(UNREADABLE, str(error).replace(str(file), file.name, 1)) from None
        # Here, since a plan needs no reader, and before the fork, so that children have the imports.
        from stages.shapeassembly.extraction.readers.model import read_model_hierarchy
        from stages.shapeassembly.extraction.readers.partnet import read_partnet
        from stages.shapeassembly.extraction.readers.structurenet import read_structurenet

        readers = {"structurenet": read_structurenet, "partnet": read_partnet}
        return read_in_child(readers.get(self.kind, lambda path: read_model_hierarchy(path, self.up)), file)


@lru_cache(maxsize=4)
def _known_grass(file: Path, modified: int, size: int) -> GrassFile:
    return read_grass_in_child(file)
