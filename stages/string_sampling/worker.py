"""Drawing shapes from a model: strings, graphs, parts with poses, and all that is asked of a finished shape."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.shards import ShardWriter, json_bytes
from pipeline.stage import Outcome, Task
from stages.shape.assembly_faults import assembly_faults
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit import Assembly, Kit
from stages.shape.kit_input import input_kit
from stages.shape.physics.judge import unmet_requirement
from stages.shape.sample import Sample, write_sample
from stages.shape.shape import kit_shape
from stages.string_sampling.instantiation.instantiate import Instantiator
from stages.string_sampling.instantiation.state import SolverMethod
from stages.string_sampling.settings import SourceConfig, StringSamplingConfig
from stages.string_sampling.source import ModelSource, read_source
from stages.strings.alphabet import make_alphabet
from stages.strings.decoder import decode
from stages.strings.kit_strings import KitStrings

NO_STRING, DUPLICATE, FAULTY = "no valid string", "duplicate", "not valid by its meshes"
NEW, TRAIN, EXEMPLAR = "new", "train", "exemplar"


@dataclass(frozen=True)
class _SampledShape:
    """string: as it was drawn; graph: digest of the shape's graph; tries: parts that were put down."""

    assembly: Assembly
    string: str
    graph: str
    known: str
    tries: int


def run_worker(task: Task) -> Outcome:
    """Files of the shard: `.tar`, the shapes that it found, as samples without a split, none twice, and none that a
    round before had found. Whatever is refused is counted by its reason.
    """
    from stages.training.loop import set_deterministic

    set_deterministic(1)
    params, name = task.shard.params, task.shard.name
    config = StringSamplingConfig.model_validate_json(json_bytes(params["settings"]))
    asked = config.sources[0]
    kit = input_kit(task, asked.kit)
    source = read_source(task, params["from"], kit)
    seen = {each for pool in params["before"] for each in _digests(task, pool)}
    with task.output(f"{name}.tar") as stream, ShardWriter(stream) as writer:
        for dream in _sampled_shapes(task, config, asked, kit, source, seen):
            lineage = {
                "method": "string_sampling",
                "model": f"{asked.dataset}/{asked.model}-{asked.kit}-{asked.seed}",
                "weights": source.weights,
                "way": asked.way,
                "string": dream.string,
                "tries": dream.tries,
                "known": dream.known,
            }
            key = f"{name}-{writer.samples:06d}"
            write_sample(writer, Sample(key, "", "string_sampling", kit.name, dream.graph, lineage, dream.assembly))
    return Outcome(0, {"drawn": config.draws, "found": writer.samples})


def _digests(task: Task, pool: str) -> list[str]:
    return task.input("string_sampling", f"{pool}.graphs.txt").read_text().split()


def _sampled_shapes(
    task: Task, config: StringSamplingConfig, asked: SourceConfig, kit: Kit, source: ModelSource, seen: set[str]
) -> Iterator[_SampledShape]:
    """The shapes of a lane; adds their graphs to `seen`."""
    instantiator = _instantiator(task, kit, config.upright)
    alphabet, exemplars = make_alphabet(kit.labels), _exemplar_graphs(kit)
    writer = KitStrings(kit, source.edges)
    method = SolverMethod(whole=source.whole, budget=config.tries)
    for number, string in enumerate(_drawn(task, config, asked, source, instantiator, method)):
        task.progress(number + 1, config.draws)
        item = f"{task.shard.name}/{number}"
        if string is None:
            task.reject(item, NO_STRING)
            continue
        decoded = decode(string, alphabet)
        digest = graph_digest(decoded.types, decoded.edges)
        known = TRAIN if bytes.fromhex(digest) in source.known else NEW
        if source.whole and digest in seen:
            task.reject(item, DUPLICATE)
            continue
        if known != NEW and config.known == "drop":
            task.reject(item, f"known: {known}")
            continue
        found = instantiator.instantiate(decoded.types, decoded.edges, task.rng("instantiation", number), method)
        if found.assembly is None:
            task.reject(item, found.reason, string)
            continue
        labelled = kit.labelled(found.assembly)
        graph = digest if source.whole else graph_digest(labelled.types, labelled.edges)
        known = EXEMPLAR if graph in exemplars else TRAIN if _is_told(writer, found.assembly, source) else known
        if graph in seen or (known != NEW and config.known == "drop"):
            task.reject(item, DUPLICATE if graph in seen else f"known: {known}")
            continue
        faults = assembly_faults(kit, found.assembly, config.upright)
        if faults:
            task.reject(item, FAULTY, f"{string}: {'; '.join(faults)}")
            continue
        weak = unmet_requirement(config.require, kit_shape(kit, found.assembly))
        if weak is not None:
            task.reject(item, weak, string)
            continue
        seen.add(graph)
        yield _SampledShape(found.assembly, string, graph, known, found.tries)


def _drawn(
    task: Task,
    config: StringSamplingConfig,
    asked: SourceConfig,
    source: ModelSource,
    maker: Instantiator,
    method: SolverMethod,
) -> list[str | None]:
    """What each draw of a lane answers: a string of the grammar, or None."""
    from stages.string_sampling.repair import repair_strings
    from stages.training.string_vae.latent_sampling import sample

    found = sample(source.model, asked.way, source.strings, config.draws, task.rng("strings"), asked.temperature)
    return repair_strings(source.model, found, maker, method, config.mends, int(task.rng("mending").integers(1 << 31)))


def _is_told(writer: KitStrings, assembly: Assembly, source: ModelSource) -> bool:
    """Whether training has a shape by its canonical string, where its strings tell of some contacts only: a shape has
    other such strings besides those in training, and is no new one for it."""
    if source.whole:
        return False
    (canonical,) = writer.strings(writer.graph(assembly), 0, np.random.default_rng(0))
    decoded = decode(canonical.string, writer.alphabet)
    return bytes.fromhex(graph_digest(decoded.types, decoded.edges)) in source.known


def _exemplar_graphs(kit: Kit) -> frozenset[str]:
    graphs = [kit.labelled(each.assembly) for each in kit.exemplars]
    return frozenset(graph_digest(each.types, each.edges) for each in graphs)


_known: dict[tuple[str, bool], Instantiator] = {}


def _instantiator(task: Task, kit: Kit, upright: bool) -> Instantiator:
    """That of a kit, kept from shard to shard of one worker: what it remembers changes no result."""
    made_from = str(task.input("exemplars", f"{kit.name}.tar")), upright
    if made_from not in _known:
        _known[made_from] = Instantiator(ContactOracle(kit), upright)
    return _known[made_from]
