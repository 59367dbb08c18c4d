"""Weights are read only from a whole safetensors file that says it is what was asked for."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
import torch
from safetensors.torch import save

from stages.training.checkpoint import CheckpointError, checkpoint_bytes, load_checkpoint, read_header

TENSORS = {"b": torch.arange(6.0).reshape(2, 3), "a": torch.ones(4, dtype=torch.int64)}
HEADER = {"kit": "castle", "tokens": ["", "A", "B", "(", ")"]}


def written(folder: Path, content: bytes) -> Path:
    path = folder / "weights.safetensors"
    path.write_bytes(content)
    return path


def test_tensors_and_header_round_trip(tmp_path: Path) -> None:
    tensors, header = load_checkpoint(written(tmp_path, checkpoint_bytes(TENSORS, HEADER)), HEADER)
    assert header["kit"] == "castle"
    assert all(torch.equal(tensors[name], tensor) for name, tensor in TENSORS.items())


def test_bytes_do_not_depend_on_the_order_of_names() -> None:
    turned = dict(reversed(TENSORS.items())), dict(reversed(HEADER.items()))
    assert checkpoint_bytes(*turned) == checkpoint_bytes(TENSORS, HEADER)


@pytest.mark.parametrize("zipped", [True, False])
def test_pickle_is_refused_before_it_is_read(tmp_path: Path, zipped: bool) -> None:
    stream = io.BytesIO()
    torch.save(TENSORS, stream, _use_new_zipfile_serialization=zipped)
    with pytest.raises(CheckpointError, match=r"weights.safetensors is a pickle, which may run any code"):
        load_checkpoint(written(tmp_path, stream.getvalue()), {})


def test_weights_that_start_like_a_pickle_are_read(tmp_path: Path) -> None:
    """The first bytes of safetensors are the length of their header: of each 32 files one begins like a pickle."""
    contents = [checkpoint_bytes(TENSORS, {**HEADER, "note": "x" * length}) for length in range(256)]
    alike = [content for content in contents if content.startswith(b"\x80")]
    assert alike
    tensors, _ = load_checkpoint(written(tmp_path, alike[0]), HEADER)
    assert set(tensors) == set(TENSORS)


@pytest.mark.parametrize("kept", [0, 5, 100, -1])
def test_truncated_file_is_refused(tmp_path: Path, kept: int) -> None:
    with pytest.raises(CheckpointError, match="is cut off or damaged"):
        load_checkpoint(written(tmp_path, checkpoint_bytes(TENSORS, HEADER)[:kept]), {})


def test_foreign_weights_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="Shapemill did not write it"):
        load_checkpoint(written(tmp_path, save(TENSORS)), {})


@pytest.mark.parametrize("header", ["{", "[]", "null", "[" * 100_000])
def test_header_that_is_no_mapping_is_refused(tmp_path: Path, header: str) -> None:
    with pytest.raises(CheckpointError, match="its header is no"):
        read_header(written(tmp_path, save(TENSORS, {"shapemill": header})))


def test_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="cannot be read"):
        read_header(tmp_path)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"kit": "playground"}, "of another kit: 'castle', and 'playground' is asked for"),
        ({"tokens": ["", "A", "C", "(", ")"]}, "of another tokens: entry 2 is 'B', and 'C' is asked for"),
        ({"tokens": ["", "A", "B", "(", ")", "0"]}, "of another tokens: it has 5 entries, and 6 are asked for"),
        ({"version": 2}, "of another version: 1, and 2 is asked for"),
    ],
)
def test_weights_with_another_header_are_refused_with_the_difference(
    tmp_path: Path, changed: dict[str, object], message: str
) -> None:
    path = written(tmp_path, checkpoint_bytes(TENSORS, HEADER))
    with pytest.raises(CheckpointError, match=message):
        load_checkpoint(path, HEADER | changed)
