"""`OUT=s3://...`: shards of a dataset go to a store as soon as they are whole, the manifest last."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor

from pipeline.display import counting
from pipeline.errors import ConfigError, Fatal
from pipeline.paths import DatasetPaths
from pipeline.records import read_record
from stages.package.layout import MANIFEST
from stages.package.locations import file_system
from stages.publishing.publication import PublishedFile, read_publication, shards_of
from stages.publishing.store import Store, failed_requests, put_file

STAGE = "package"
PROBE = ".shapemill"
"""File that is written and deleted before the run, to learn early whether the store takes files."""


def open_remote_output(url: str, dataset: str, paths: DatasetPaths) -> StoreOutput:
    """Return the output of a dataset below a URL, such as `s3://bucket/prefix`.

    Raises ConfigError, with the remedy, where the store takes no files.
    """
    output = StoreOutput(f"{url.rstrip('/')}/{dataset}", paths)
    output.check()
    return output


class StoreOutput:
    """The dataset at `destination`, whose records and intermediates are in a local folder.

    One shard goes up at a time, while workers make others. What fails is sent again at the end.
    """

    def __init__(self, destination: str, paths: DatasetPaths) -> None:
        self._destination = destination
        self._paths = paths
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="upload")
        self._sent: list[Future[None]] = []
        self._withdrawn = False

    def check(self) -> None:
        """Write and delete a small file. Raises ConfigError where the store refuses or another dataset is there."""
        if self._destination.startswith("hf://"):
            raise ConfigError(
                f"OUT={self._destination}: shows a dataset only as a whole; make it in a local folder, then run "
                f"`make publish DEST={self._destination}`"
            )
        try:
            files, root = file_system(self._destination)
            files.pipe_file(f"{root}/{PROBE}", b"")
            files.rm_file(f"{root}/{PROBE}")
            inside = [path.removeprefix(f"{root}/") for path in files.find(f"{root}/data")]
        except failed_requests() as error:
            raise ConfigError(f"OUT={self._destination}: cannot be written to: {error}; {_remedy(error)}") from error
        shards_of(self._paths.dataset, inside, self._destination)
        print(
            f"{self._destination}: shards go there as soon as they are whole; "
            f"records and intermediates are in {self._paths.out}",
            flush=True,
        )

    def shard_done(self, stage: str, shard: str) -> None:
        """Send a shard that users load. Returns before it is sent."""
        if stage == STAGE:
            self._sent.append(self._thread.submit(self._send_shard, shard))

    def finish(self, whole: bool) -> None:
        """Wait for the shards. Where the dataset is `whole`, send what is missing, the manifest last.

        Raises Fatal where the store refuses.
        """
        self._thread.shutdown(wait=True, cancel_futures=not whole)
        for sent in self._sent:
            failure = None if sent.cancelled() else sent.exception()
            if failure is not None and not isinstance(failure, failed_requests()):
                raise failure
        if not whole:
            return
        try:
            publication = read_publication(self._paths.out / self._paths.dataset, verified=False)
            store = Store(self._destination, publication)
            files = store.missing()
            total = sum(file.size for file in files)
            with counting("upload", total, "bytes") as show:
                store.send(files, show)
        except failed_requests() as error:
            raise Fatal(f"{self._destination}: {error}; what is there stays, and the same command goes on") from error
        print(
            f"{self._destination}: whole: {len(publication.files) + 1 - len(files):,} files were there already, "
            f'{len(files):,} sent now; open it with stages.api.open_dataset("{self._destination}")'
        )

    def _send_shard(self, shard: str) -> None:
        """Send the tar of one shard, if it has samples; the manifest of an older dataset is deleted before."""
        folder = self._paths.stage(STAGE)
        record = read_record(folder.records / f"{shard}.json")
        name = f"{shard}.tar"
        if record is None or name not in record.files or not record.summary.get("path") or not record.samples:
            return
        files, root = file_system(self._destination)
        facts = record.files[name]
        file = PublishedFile(record.summary["path"], folder.root / name, facts["sha256"], facts["bytes"])
        file.check()
        if not self._withdrawn and files.exists(f"{root}/{MANIFEST}"):
            files.rm_file(f"{root}/{MANIFEST}")
        self._withdrawn = True
        put_file(files, f"{root}/{file.path}", file)


def _remedy(error: BaseException) -> str:
    """Return what to do about a store that refuses."""
    kind = type(error).__name__
    if "Credential" in kind:
        return "set the credentials of the store, such as AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"
    if isinstance(error, FileNotFoundError):
        return "make the bucket first, or name another"
    if isinstance(error, PermissionError):
        return "name credentials that may write there, or another bucket"
    return "check the network and AWS_ENDPOINT_URL, or name a local folder and run `make publish` later"
