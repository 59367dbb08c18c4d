"""What a shard may do with its task."""

from __future__ import annotations

import contextlib
import errno
import hashlib
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.compilation_note import note_compilation, note_end_of_compilation, read_compilation_note
from pipeline.config import Config
from pipeline.errors import ConfigError, Fatal, Rejected, ShardFailed
from pipeline.paths import DatasetPaths
from pipeline.records import read_record
from pipeline.stage import Outcome, Shard, Task
from pipeline.task import Job, Report, make_shard

Body = Callable[[Task], Outcome]

FLOUR_DIGEST = hashlib.sha256(b"flour").hexdigest()


@pytest.fixture
def make(tmp_path: Path) -> Callable[[Body], Report]:
    places = DatasetPaths(tmp_path, "toy")
    for name in ("earlier", "own"):
        places.stage(name).make()
    (places.stage("earlier").root / "in.txt").write_text("flour", encoding="utf-8")

    def run(body: Body) -> Report:
        shard, config = Shard("shard", {}, ("earlier/in",)), Config("toy", "1.0.0", 5, {}, Path("t.yaml"))
        return make_shard(Job("own", body, shard, config, places, {}, {"earlier/in.txt": FLOUR_DIGEST}))

    return run


def own(folder: Path) -> Path:
    return folder / ".work/toy/own"


def test_files_appear_together_with_their_record(make: Callable[[Body], Report], tmp_path: Path) -> None:
    def body(task: Task) -> Outcome:
        task.output("shard.b.txt").write(task.input("earlier", "in.txt").read_bytes())
        with task.output("shard.a") as stream:
            stream.write(b"salt")
        assert not list(own(tmp_path).glob("shard*"))
        return Outcome(1, {"kind": "rye"})

    assert make(body) == Report("shard", "done")
    assert sorted(path.name for path in own(tmp_path).glob("*.*")) == ["shard.a", "shard.b.txt"]
    assert (own(tmp_path) / "shard.b.txt").read_text(encoding="utf-8") == "flour"
    assert (own(tmp_path) / "records/shard.json").is_file()


def test_compilation_of_kernels_is_noted_while_it_lasts(make: Callable[[Body], Report], tmp_path: Path) -> None:
    note = DatasetPaths(tmp_path, "toy").stage("own").compilation_note("shard")
    seen = []

    def body(task: Task) -> Outcome:
        seen.append(read_compilation_note(note))
        note_compilation(0)
        note_compilation(3)
        seen.append(read_compilation_note(note))
        note_end_of_compilation(3)
        seen.append(read_compilation_note(note))
        note_compilation(4)
        raise ShardFailed("no salt")

    assert make(body).message == "no salt"
    assert seen == [(0, False), (3, True), (3, False)]
    assert not note.exists()
    note_compilation(5)
    assert not note.exists(), "no shard is made"


def test_file_that_the_shard_writes_no_more_is_removed(make: Callable[[Body], Report], tmp_path: Path) -> None:
    def both(task: Task) -> Outcome:
        task.output("shard.a").write(b"1")
        task.output("shard.b").write(b"1")
        task.reject("one", "stale")
        return Outcome(0)

    def one(task: Task) -> Outcome:
        task.output("shard.b").write(b"2")
        return Outcome(0)

    make(both)
    make(one)
    assert sorted(path.name for path in own(tmp_path).rglob("*") if path.is_file()) == ["shard.b", "shard.json"]


def test_record_names_the_bytes_that_were_read(make: Callable[[Body], Report], tmp_path: Path) -> None:
    make(lambda task: Outcome(len(task.input("earlier", "in.txt").read_bytes())))
    record = read_record(own(tmp_path) / "records/shard.json")
    assert record is not None
    assert record.inputs == {"earlier/in.txt": FLOUR_DIGEST}


def test_corrupted_input_is_named_and_nothing_is_committed(make: Callable[[Body], Report], tmp_path: Path) -> None:
    def reads(task: Task) -> Outcome:
        return Outcome(len(task.input("earlier", "in.txt").read_bytes()))

    def goes_on(task: Task) -> Outcome:
        with contextlib.suppress(ShardFailed):
            reads(task)
        return Outcome(0)

    source = tmp_path / ".work/toy/earlier/in.txt"
    source.write_text("floor", encoding="utf-8")
    for body in (reads, goes_on):
        report = make(body)
        assert (report.status, report.corrupted) == ("corrupted", "earlier/in")
        assert report.message == "earlier/in.txt is corrupted: its sha256 is not the one in its record"
    source.unlink()
    assert make(reads).message == "earlier/in.txt is corrupted: the file is missing"
    assert not [path for path in own(tmp_path).rglob("*") if path.is_file()]


@pytest.mark.parametrize("name", ["other.txt", "shard", "shardx.txt", "../shard.txt", "shard./../../x", "shard.a/b"])
def test_file_of_another_name_is_refused(make: Callable[[Body], Report], tmp_path: Path, name: str) -> None:
    report = make(lambda task: Outcome(task.output(name).write(b"x")))
    assert report.status == "failed"
    assert "must be named shard.<anything>" in report.message
    assert not [path for path in tmp_path.rglob("*") if path.is_file() and path.name != "in.txt"]


def test_file_that_is_no_input_is_not_read(make: Callable[[Body], Report], tmp_path: Path) -> None:
    (tmp_path / ".work/toy/earlier/other.txt").write_text("not listed", encoding="utf-8")
    report = make(lambda task: Outcome(len(task.input("earlier", "other.txt").read_bytes())))
    assert (report.status, report.message) == (
        "failed",
        "own/shard reads other.txt, but earlier/other is not among its inputs",
    )
    assert make(lambda task: Outcome(len(str(task.input("earlier", "in.json"))))).message == (
        "earlier/in has no file in.json"
    )


def test_random_stream_depends_on_the_decision_alone(make: Callable[[Body], Report]) -> None:
    drawn: list[float] = []

    def body(task: Task) -> Outcome:
        task.rng("other").random(1000)
        drawn.extend(task.rng("decision", index).random() for index in (0, 1, 0))
        return Outcome(0)

    make(body)
    assert drawn[0] == drawn[2] != drawn[1]


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (ShardFailed("dull"), "failed"),
        (KeyError("x"), "failed"),
        (MemoryError(), "failed"),
        (SystemExit(3), "failed"),
        (Rejected("hollow"), "refused"),
        (ConfigError("no such key"), "refused"),
        (Fatal("no more"), "fatal"),
        (OSError(errno.ENOSPC, "full"), "fatal"),
        (OSError(errno.EROFS, "read-only"), "fatal"),
        (PermissionError(errno.EACCES, "no"), "fatal"),
        (FileNotFoundError(errno.ENOENT, "none"), "failed"),
    ],
)
def test_every_failure_has_its_status_and_leaves_nothing(
    make: Callable[[Body], Report], tmp_path: Path, error: BaseException, status: str
) -> None:
    def body(task: Task) -> Outcome:
        task.output("shard.a").write(b"half")
        task.reject("one", "odd")
        task.progress(1, 2)
        raise error

    report = make(body)
    assert report.status == status
    assert type(error).__name__ in report.trace
    assert not [path for path in own(tmp_path).rglob("*") if path.is_file()]


def test_full_disk_wrapped_in_another_error_is_still_fatal(make: Callable[[Body], Report]) -> None:
    def body(task: Task) -> Outcome:
        try:
            raise OSError(errno.ENOSPC, "full")
        except OSError as error:
            raise ValueError("could not save the picture") from error

    assert make(body).status == "fatal"
