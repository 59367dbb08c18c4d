"""A folder or an object store that a dataset is published to, by fsspec."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Mapping
from typing import Any

from pipeline.errors import ConfigError
from stages.package.layout import MANIFEST
from stages.package.locations import file_system
from stages.publishing.publication import Publication, PublishedFile


class Store:
    """The place of one dataset in a store.

    Files go up one by one, the manifest last. An older publication loses its manifest first. So what does not open is
    not whole, and a publication that was stopped goes on with the files that are missing.
    """

    def __init__(self, destination: str, publication: Publication) -> None:
        """List what is there.

        destination: path or URL of the dataset's folder; the index goes to its sibling

        Raises ConfigError for a bucket without a folder and where shards of another dataset are there, and OSError.
        """
        self._files, root = file_system(destination)
        if "://" in destination and "/" not in root:
            raise ConfigError(
                f"{destination}: must name a folder of the bucket, such as {destination}/{publication.name}"
            )
        self._files.invalidate_cache()
        self._root = root
        self._targets = {f"{root}-index/{publication.index.path}": publication.index}
        self._targets |= {f"{root}/{file.path}": file for file in publication.files}
        listed = (self._files.find(folder, detail=True) for folder in (root, f"{root}-index"))
        self._stored: Mapping[str, Any] = {path: facts for found in listed for path, facts in found.items()}
        inside = (path.removeprefix(f"{root}/") for path in self._stored if path.startswith(f"{root}/"))
        self._outdated = publication.outdated(inside, destination)

    def missing(self) -> list[PublishedFile]:
        """Return the files that are not there with the same bytes, in the order in which they are sent."""
        return [file for target, file in self._targets.items() if not self._has(target, file)]

    def send(self, files: list[PublishedFile], show: Callable[[int], None]) -> None:
        """Send files, and delete those of an older publication.

        show: called with the number of bytes sent

        Raises ConfigError for a file that was corrupted since it was verified, and OSError from the store.
        """
        manifest = f"{self._root}/{MANIFEST}"
        changes = bool(files or self._outdated)
        if changes and manifest in self._stored:
            self._files.rm_file(manifest)
        for path in self._outdated:
            self._files.rm_file(f"{self._root}/{path}")
        sent, changed = 0, set(files)
        for target, file in self._targets.items():
            if file in changed or (changes and target == manifest):
                file.check()
                put_file(self._files, target, file)
                sent += file.size
                show(sent)

    def _has(self, target: str, file: PublishedFile) -> bool:
        """Say whether a file is there with the same bytes: by its sha256 in the store, else by reading it back."""
        facts = self._stored.get(target)
        if facts is None or facts["size"] != file.size:
            return False
        if _keeps_metadata(self._files):
            stated = self._files.metadata(target).get("sha256")
            if stated:
                return bool(stated == file.sha256)
        with self._files.open(target, "rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest() == file.sha256


def put_file(files: Any, target: str, file: PublishedFile) -> None:
    """Send a file to an fsspec file system, with its sha256 where that keeps metadata."""
    if _keeps_metadata(files):
        files.put_file(str(file.source), target, Metadata={"sha256": file.sha256})
        return
    if "file" in files.protocol:  # stores have no folders, and s3fs would make a bucket of a wrong name
        files.makedirs(target.rpartition("/")[0], exist_ok=True)
    files.put_file(str(file.source), target)


def failed_requests() -> tuple[type[Exception], ...]:
    """Return what the clients of stores that are in use raise for a failed request."""
    classes = {"botocore.exceptions": "BotoCoreError", "httpx2": "HTTPError"}
    return (OSError, *(getattr(sys.modules[module], name) for module, name in classes.items() if module in sys.modules))


def _keeps_metadata(files: Any) -> bool:
    return "s3" in files.protocol
