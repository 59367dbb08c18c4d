"""Hugging Face, where a dataset is published as a repository, and its index as another."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable

from pipeline.errors import ConfigError
from pipeline.package_groups import require_group
from stages.publishing.publication import Publication, PublishedFile

MAX_TEXT_BYTES = 10_000_000
"""Hugging Face stores larger files by their sha256, and smaller ones as git does or by their sha256."""


class Hub:
    """The repositories `<organization>/<name>` and `<organization>/<name>-index`.

    Contents go up first, and one commit makes all of them visible. So a repository is never half published. Contents
    that Hugging Face has already are not sent again, after a stop either.
    """

    def __init__(self, destination: str, publication: Publication) -> None:
        """List what is there. Raises ConfigError for another URL than `hf://organization/name`, and OSError."""
        require_group("stores")
        from huggingface_hub import HfApi

        repository = destination.removeprefix("hf://").removeprefix("datasets/").rstrip("/")
        if repository.count("/") != 1:
            raise ConfigError(f"{destination}: must be hf://organization/name")
        self._api = HfApi()
        self._message = f"{publication.name} {publication.version}"
        self._parts = {f"{repository}-index": (publication.index,), repository: publication.files}
        self._stored = {part: self._listed(part) for part in self._parts}
        self._outdated = {repository: publication.outdated(self._stored[repository], destination)}

    def missing(self) -> list[PublishedFile]:
        """Return the files that are not there with the same bytes, in the order in which they are sent."""
        return [file for part, files in self._parts.items() for file in self._missing_of(part, files)]

    def send(self, files: list[PublishedFile], show: Callable[[int], None]) -> None:
        """Send files, and delete shards of an older publication.

        show: called with the number of bytes sent

        Raises ConfigError for a file that was corrupted since it was verified, and OSError.
        """
        from huggingface_hub import CommitOperationAdd, CommitOperationDelete

        sent = 0
        for part, own in self._parts.items():
            additions = []
            self._api.create_repo(part, repo_type="dataset", exist_ok=True)
            for file in own:
                if file in files:
                    file.check()
                    additions.append(CommitOperationAdd(file.path, str(file.source)))
                    try:
                        self._api.preupload_lfs_files(part, additions[-1:], repo_type="dataset")
                    except RuntimeError as error:  # how huggingface_hub wraps what failed
                        raise OSError(f"{error} {error.__cause__}") from error
                    sent += file.size
                    show(sent)
            deletions = [CommitOperationDelete(path) for path in self._outdated.get(part, ())]
            operations: list[CommitOperationAdd | CommitOperationDelete] = [*additions, *deletions]
            if operations:
                self._api.create_commit(part, operations, commit_message=self._message, repo_type="dataset")

    def _missing_of(self, part: str, files: Iterable[PublishedFile]) -> Iterable[PublishedFile]:
        stored = self._stored[part]
        return (file for file in files if stored.get(file.path) not in (file.sha256, _git_digest(file)))

    def _listed(self, part: str) -> dict[str, str]:
        """Return the digest of each file of a repository by its path; none where there is no repository."""
        from huggingface_hub import RepoFile
        from huggingface_hub.errors import HFValidationError, RepositoryNotFoundError

        try:
            tree = list(self._api.list_repo_tree(part, recursive=True, repo_type="dataset"))
        except RepositoryNotFoundError:
            return {}
        except HFValidationError as error:
            raise ConfigError(f"hf://{part}: {error}") from error
        return {
            entry.path: entry.lfs.sha256 if entry.lfs else entry.blob_id
            for entry in tree
            if isinstance(entry, RepoFile)
        }


def _git_digest(file: PublishedFile) -> str:
    """Return the sha1 of a small file as git stores it; empty for a large one."""
    if file.size > MAX_TEXT_BYTES:
        return ""
    content = file.source.read_bytes()
    return hashlib.sha1(b"blob %d\0" % len(content) + content, usedforsecurity=False).hexdigest()
