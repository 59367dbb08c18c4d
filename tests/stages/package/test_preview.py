"""Which variants the preview picture shows."""

from __future__ import annotations

from dataclasses import replace

from stages.package.preview import varied
from stages.shape.sample import Sample
from stages.shape.shape import Shape, kit_shape
from tests.stages.package.toy import chain, toy_kit, toy_samples


def row(kit: str, key: str, length: int) -> tuple[Sample, Shape]:
    sample = replace(toy_samples("train", 0, 1)[0], kit=kit, key=key, assembly=chain(length, 0))
    return sample, kit_shape(toy_kit("blocks"), sample.assembly)


def test_kits_take_turns_and_every_begins_with_its_largest() -> None:
    samples = [row("a", f"a{length}", length) for length in (2, 3, 9, 5)] + [row("b", "b4", 4), row("b", "b7", 7)]
    chosen = [sample.key for sample, _ in varied(samples, 5)]
    assert chosen[:2] == ["a9", "b7"]
    assert chosen[2:4] == ["a2", "b4"]
    assert len(set(chosen)) == 5


def test_all_samples_are_shown_when_there_are_fewer_than_asked_for() -> None:
    samples = [row("a", f"a{length}", length) for length in (2, 2, 4)]
    assert len(varied(samples, 24)) == 3


def test_equal_shapes_come_last() -> None:
    samples = [row("a", f"a{place}", length) for place, length in enumerate((6, 6, 6, 3, 2))]
    assert [sample.key for sample, _ in varied(samples, 3)] == ["a0", "a4", "a3"]
