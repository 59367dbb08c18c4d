"""`python -m pipeline.make_kernel_list FOLDER CONFIG...`: record the kernels that short datasets use, and list them."""

from __future__ import annotations

import json
import os
import sys
from graphlib import TopologicalSorter
from pathlib import Path
from typing import Any

from pipeline.compilation_note import RECORD_VARIABLE
from pipeline.config import load_config
from pipeline.kernel_list import KERNEL_LIST, KernelList, ListedKernel
from pipeline.paths import DatasetPaths, write_atomically
from pipeline.registry import find_stages
from pipeline.run import run_stage
from pipeline.trial import short_config


def merged(lines: list[dict[str, Any]], producer: str, before: KernelList) -> KernelList:
    """Return a list that holds what was recorded of a dataset, and what `before` holds of other producers."""
    calls: dict[str, list[str]] = {}
    seconds: dict[str, float] = {}
    used: dict[str, dict[str, set[str]]] = {}
    for_python = set[str]()
    recorded = {json.dumps(line["kernel"]) for line in lines}
    keys = [json.dumps([kernel.name, kernel.arguments]) for kernel in before.kernels]
    for key, kernel in zip(keys, before.kernels, strict=True):
        calls[key] = [keys[index] for index in kernel.calls]
        seconds[key] = 0.0 if key in recorded else kernel.seconds
        if kernel.is_for_python:
            for_python.add(key)
    for name, stages in before.used.items():
        if name != producer:
            used[name] = {stage: {keys[index] for index in indices} for stage, indices in stages.items()}
    fresh = used.setdefault(producer, {})
    for line in lines:
        key = json.dumps(line["kernel"])
        fresh.setdefault(line["stage"], set()).add(key)
        if line["is_for_python"]:
            for_python.add(key)
        if line["seconds"] >= seconds.get(key, 0.0) or line["calls"]:
            calls[key], seconds[key] = line["calls"], round(line["seconds"], 1)
    reached = {key for stages in used.values() for wanted in stages.values() for key in wanted}
    waiting = list(reached)
    while waiting:
        more = set(calls[waiting.pop()]) - reached
        reached |= more
        waiting += more
    graph = {key: sorted(set(calls[key]) - {key}) for key in sorted(reached)}
    order = list(TopologicalSorter(graph).static_order())
    index_of = {key: index for index, key in enumerate(order)}
    kernels = []
    for key in order:
        name, arguments = json.loads(key)
        calls_of = sorted(index_of[callee] for callee in graph[key])
        kernels.append(ListedKernel(name, arguments, calls_of, seconds[key], key in for_python))
    indices = {
        name: {stage: sorted(index_of[key] for key in wanted) for stage, wanted in stages.items()}
        for name, stages in sorted(used.items())
    }
    return KernelList(kernels, indices)


def write_list(listed: KernelList, file: Path) -> None:
    """Write a list, a line for each kernel and each stage."""
    fields = [[k.name, k.arguments, k.calls, k.seconds, k.is_for_python] for k in listed.kernels]
    kernels = [json.dumps(kernel, separators=(",", ":")) for kernel in fields]
    used = [
        f"{json.dumps(name)}: {{\n"
        + ",\n".join(f"{json.dumps(stage)}: {json.dumps(indices)}" for stage, indices in stages.items())
        + "\n}"
        for name, stages in listed.used.items()
    ]
    text = '{"kernels": [\n' + ",\n".join(kernels) + '\n],\n"used": {\n' + ",\n".join(used) + "\n}}\n"
    write_atomically(file, text.encode())


def record_dataset(folder: Path, config_path: Path) -> None:
    """Make a short dataset of a config with a cache of its own, and add the kernels of its stages to the list.

    folder: where cache, record and dataset are; a recording that was stopped goes on there
    """
    stages = find_stages()
    sections = {name: stage.config for name, stage in stages.items()}
    config = short_config(load_config(config_path, sections), stages)
    (producer,) = (name for name, stage in stages.items() if stage.requested_samples(config))
    record = folder / f"{config.name}.jsonl"
    os.environ |= {RECORD_VARIABLE: str(record.absolute()), "NUMBA_CACHE_DIR": str((folder / "cache").absolute())}
    for name, stage in stages.items():
        if not stage.publishes_incomplete:
            # Each stage has fresh workers, which load or compile all that it uses.
            run_stage(name, stages, config, DatasetPaths(folder, config.name), 1)
    lines = [json.loads(line) for line in record.read_text(encoding="utf-8").splitlines()]
    write_list(merged(lines, producer, KernelList.read()), KERNEL_LIST)
    print(f"{len({json.dumps(line['kernel']) for line in lines})} kernels of {config_path} are in {KERNEL_LIST}")


if __name__ == "__main__":
    for argument in sys.argv[2:]:
        record_dataset(Path(sys.argv[1]), Path(argument))
