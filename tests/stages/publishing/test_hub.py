"""Publishing to Hugging Face, against a server of this machine that has the same interface."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from http.server import ThreadingHTTPServer
from pathlib import Path

import pytest

from stages import api
from tests.command import shapemill
from tests.stages.publishing.conftest import make_dataset
from tests.stages.publishing.hugging_face import HuggingFace, State


@pytest.fixture
def hub(monkeypatch: pytest.MonkeyPatch) -> Iterator[State]:
    """The state of a server that stands in for Hugging Face."""
    from huggingface_hub import constants

    HuggingFace.state = State()
    server = ThreadingHTTPServer(("127.0.0.1", 0), HuggingFace)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    url = f"http://127.0.0.1:{server.server_port}"
    monkeypatch.setattr(constants, "ENDPOINT", url)
    monkeypatch.setattr(constants, "HUGGINGFACE_CO_URL_TEMPLATE", url + "/{repo_id}/resolve/{revision}/{filename}")
    monkeypatch.setattr(constants, "HF_HUB_DISABLE_XET", True)
    monkeypatch.setenv("HF_TOKEN", "hf_secret")
    yield HuggingFace.state
    server.shutdown()
    thread.join()
    server.server_close()


def files_of(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_dataset_and_index_become_two_repositories_by_two_commits(dataset: Path, hub: State) -> None:
    code, text = shapemill("publish", "hf://makers/shapes", dataset, "--dry-run")
    assert (code, "11 files of" in text, hub.repositories) == (0, True, {}), text
    code, text = shapemill("publish", "hf://makers/shapes", dataset)
    assert code == 0, text
    index = dataset.with_name("small-index")
    assert hub.repositories == {"makers/shapes": files_of(dataset), "makers/shapes-index": files_of(index)}
    assert hub.commits == ["makers/shapes-index", "makers/shapes"]
    code, text = shapemill("publish", "hf://makers/shapes", dataset)
    assert (code, "sent 0 files of 0 bytes" in text, len(hub.commits)) == (0, True, 2), text


def test_published_dataset_is_read_from_there(dataset: Path, hub: State) -> None:
    from huggingface_hub import HfFileSystem

    HfFileSystem.clear_instance_cache()
    assert shapemill("publish", "hf://makers/shapes", dataset)[0] == 0
    stored, local = api.open_dataset("hf://makers/shapes"), api.open_dataset(dataset)
    assert list(stored.split("val")) == list(local.split("val"))
    assert list(stored.samples("val")) == list(local.samples("val"))
    HfFileSystem.clear_instance_cache()


def test_stopped_publication_shows_nothing_and_sends_no_content_twice(dataset: Path, hub: State) -> None:
    hub.max_uploads = 4
    code, text = shapemill("publish", "hf://makers/shapes", dataset)
    assert (code, "stopped: hf://makers/shapes: " in text) == (3, True), text
    assert hub.repositories["makers/shapes"] == {}
    hub.max_uploads = 1_000
    assert shapemill("publish", "hf://makers/shapes", dataset)[0] == 0
    assert hub.repositories["makers/shapes"] == files_of(dataset)
    assert len(hub.uploads) == len(set(hub.uploads)) == 7


def test_new_version_replaces_the_shards_of_the_old_one(dataset: Path, tmp_path: Path, hub: State) -> None:
    newer = make_dataset(tmp_path / "newer/small", version="1.1.0")
    assert shapemill("publish", "hf://makers/shapes", dataset)[0] == 0
    hub.repositories["makers/shapes"][".gitattributes"] = b""
    assert shapemill("publish", "hf://makers/shapes", newer)[0] == 0
    assert hub.repositories["makers/shapes"] == {**files_of(newer), ".gitattributes": b""}


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("hf://shapes", "hf://shapes: must be hf://organization/name"),
        ("hf://makers/my shapes!", "Repo id must use alphanumeric chars"),
    ],
)
def test_url_that_names_no_repository_is_refused(dataset: Path, url: str, message: str) -> None:
    code, text = shapemill("publish", url, dataset)
    assert (code, message in text) == (2, True), text
