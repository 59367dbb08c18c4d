"""A search worker: samples strings from a model, instantiates them, and checks the shapes."""

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
from stages.string_sampling.rounds import pool_graphs
from stages.string_sampling.settings import SourceConfig, StringSamplingConfig
from stages.string_sampling.source import ModelSource, read_source
from stages.strings.decoder import decode
from stages.strings.kit_strings import KitStrings
from stages.strings.tokens import make_alphabet

NO_STRING, DUPLICATE, FAULTY = "no valid string", "duplicate", "not valid by its meshes"
NEW, TRAIN, EXEMPLAR = "new", "train", "exemplar"


@dataclass(frozen=True)
class _SampledShape:
    assembly: Assembly
    string: str
    graph: str
    """Digest of the shape's graph."""
    novelty: str
    """NEW, TRAIN or EXEMPLAR."""
    placements: int
    """Parts placed until there was a shape."""


def run_worker(task: Task) -> Outcome:
    """Write `.tar`: the shapes found, without a split, each graph once and none of an earlier round.

    Rejected strings and shapes are counted by reason.
    """
    from stages.training.loop import set_deterministic

    set_deterministic(1)
    params, name = task.shard.params, task.shard.name
    config = StringSamplingConfig.model_validate_json(json_bytes(params["settings"]))
    model = config.sources[0]
    kit = input_kit(task, model.kit)
    source = read_source(task, params["from"], kit)
    seen = {digest for pool in params["before"] for digest in pool_graphs(task, pool)}
    with task.output(f"{name}.tar") as stream, ShardWriter(stream) as writer:
        for shape in _sampled_shapes(task, config, model, kit, source, seen):
            lineage = {
                "method": "string_sampling",
                "model": f"{model.dataset}/{model.model}-{model.kit}-{model.seed}",
                "weights": source.weights,
                "sampling": model.sampling,
                "string": shape.string,
                "placements": shape.placements,
                "novelty": shape.novelty,
            }
            key = f"{name}-{writer.samples:06d}"
            write_sample(writer, Sample(key, "", "string_sampling", kit.name, shape.graph, lineage, shape.assembly))
    return Outcome(0, {"drawn": config.draws, "found": writer.samples})


def _sampled_shapes(
    task: Task, config: StringSamplingConfig, model: SourceConfig, kit: Kit, source: ModelSource, seen: set[str]
) -> Iterator[_SampledShape]:
    """Yield the shapes of a worker, and add their graphs to `seen`."""
    instantiator = _instantiator(task, kit, config.upright)
    alphabet, exemplars = make_alphabet(kit.labels), _exemplar_graphs(kit)
    writer = KitStrings(kit, source.edges)
    method = SolverMethod(whole=source.whole, budget=config.max_placements)
    for number, string in enumerate(_sampled_strings(task, config, model, source, instantiator, method)):
        task.progress(number + 1, config.draws)
        item = f"{task.shard.name}/{number}"
        if string is None:
            task.reject(item, NO_STRING)
            continue
        decoded = decode(string, alphabet)
        digest = graph_digest(decoded.types, decoded.edges)
        novelty = TRAIN if bytes.fromhex(digest) in source.known else NEW
        if source.whole and digest in seen:
            task.reject(item, DUPLICATE)
            continue
        if novelty != NEW and config.duplicates == "drop":
            task.reject(item, f"known: {novelty}")
            continue
        result = instantiator.instantiate(decoded.types, decoded.edges, task.rng("instantiation", number), method)
        assembly = result.assembly
        if assembly is None:
            task.reject(item, result.reason, string)
            continue
        labelled = kit.labelled(assembly)
        graph = digest if source.whole else graph_digest(labelled.types, labelled.edges)
        novelty = EXEMPLAR if graph in exemplars else TRAIN if _is_in_training(writer, assembly, source) else novelty
        if graph in seen or (novelty != NEW and config.duplicates == "drop"):
            task.reject(item, DUPLICATE if graph in seen else f"known: {novelty}")
            continue
        faults = assembly_faults(kit, assembly, config.upright)
        if faults:
            task.reject(item, FAULTY, f"{string}: {'; '.join(faults)}")
            continue
        unmet = unmet_requirement(config.require, kit_shape(kit, assembly))
        if unmet is not None:
            task.reject(item, unmet, string)
            continue
        seen.add(graph)
        yield _SampledShape(assembly, string, graph, novelty, result.placements)


def _sampled_strings(
    task: Task,
    config: StringSamplingConfig,
    model: SourceConfig,
    source: ModelSource,
    instantiator: Instantiator,
    method: SolverMethod,
) -> list[str | None]:
    """Return the result of each draw: a string of the grammar, or None."""
    from stages.string_sampling.repair import repair_strings
    from stages.training.string_vae.latent_sampling import sample

    rng = task.rng("strings")
    results = sample(source.model, model.sampling, source.strings, config.draws, rng, model.temperature)
    seed = int(task.rng("mending").integers(1 << 31))
    return repair_strings(source.model, results, instantiator, method, config.max_repairs, seed)


def _is_in_training(writer: KitStrings, assembly: Assembly, source: ModelSource) -> bool:
    """Return whether training has the canonical string of a shape, if its strings have some contacts only.

    Such a shape has several string graphs, and the sampled one may not be in training.
    """
    if source.whole:
        return False
    (canonical,) = writer.strings(writer.graph(assembly), 0, np.random.default_rng(0))
    decoded = decode(canonical.string, writer.alphabet)
    return bytes.fromhex(graph_digest(decoded.types, decoded.edges)) in source.known


def _exemplar_graphs(kit: Kit) -> frozenset[str]:
    graphs = [kit.labelled(exemplar.assembly) for exemplar in kit.exemplars]
    return frozenset(graph_digest(graph.types, graph.edges) for graph in graphs)


_instantiators: dict[tuple[str, bool], Instantiator] = {}


def _instantiator(task: Task, kit: Kit, upright: bool) -> Instantiator:
    """Return the instantiator of a kit, cached over the shards of a process; its own cache changes no result."""
    key = str(task.input("exemplars", f"{kit.name}.tar")), upright
    if key not in _instantiators:
        _instantiators[key] = Instantiator(ContactOracle(kit), upright)
    return _instantiators[key]
