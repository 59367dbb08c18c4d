"""Shapes per second packed as string and categories, and restored; the peer: types and poses as JSON in gzip."""

from __future__ import annotations

import gzip
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from stages.exemplars.build import read_kit
from stages.exemplars.settings import STRICTEST, KitConfig, ShapeFile
from stages.strings.compression import Codebook, decode_shape, encode_shape, pack, unpack
from tests.bench.measure import Measure, rate

SHAPES_PER_CALL = 10


def bench() -> Iterator[Measure]:
    """Shapes per second and core, of the larger shipped castle."""
    shapes = tuple(ShapeFile(path=path) for path in sorted(Path("datasets/exemplars/castle").glob("*.glb")))
    kit = read_kit(KitConfig(name="castle", shapes=shapes).resolve(STRICTEST))
    book, assembly = Codebook(kit, "all"), kit.exemplars[0].assembly
    (encoded,) = book.writer.strings(book.writer.graph(assembly), 0, np.random.default_rng(0))
    packed = pack(book, encode_shape(book, assembly, encoded))

    def packing() -> int:
        return len([pack(book, encode_shape(book, assembly, encoded)) for _ in range(SHAPES_PER_CALL)])

    def restoring() -> int:
        return len([decode_shape(book, unpack(book, packed)) for _ in range(SHAPES_PER_CALL)])

    def zipped() -> bytes:
        arrays = (assembly.types, assembly.poses, assembly.edges)
        return gzip.compress(json.dumps([array.tolist() for array in arrays]).encode())

    text = zipped()

    def zipping() -> int:
        return len([zipped() for _ in range(SHAPES_PER_CALL)])

    def unzipping() -> int:
        return len([[np.array(values) for values in json.loads(gzip.decompress(text))] for _ in range(SHAPES_PER_CALL)])

    size, note = f"{len(assembly)} parts", f"{len(packed)} bytes; the peer's {len(text):,}"
    yield Measure(f"shapes packed, {size}", "shapes", rate(packing, 0.5), "JSON in gzip", rate(zipping, 0.5), note)
    back, peer = rate(restoring, 0.5), rate(unzipping, 0.5)
    yield Measure(f"shapes restored, {size}", "shapes", back, "JSON in gzip", peer, note)
