"""How a recovery model learns: shapes made meanwhile, the losses of all parameters, its validation (geocode §3.3)."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Generator, Tensor
from torch.nn.functional import max_pool2d

from pipeline.places import file_digest
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Task
from stages.programs.program import Program, find_program
from stages.shape.arrays import Float32Array
from stages.sketches.settings import SketchesConfig
from stages.training.loop import device_of
from stages.training.recovery.answers import Answers
from stages.training.recovery.clouds import frame_of, spoilt, taken
from stages.training.recovery.drawings import SIDE, drawn
from stages.training.recovery.model import RecoveryNet
from stages.training.recovery.settings import RecoveryEntry
from stages.training.recovery.shapes import TRAIN, VAL, random_shapes, valid_values
from stages.training.recovery.surface import chamfer_distance, sampled_points, shape_points

__all__ = ["RecoveryLearner", "described_parameters", "entry", "learner", "prepare"]

DENSE = 4096
"""Points of a shape at hand, of which clouds are drawn."""
HELD = 512
"""Shapes at hand at most: clouds of one step are of different ones."""
BEGINNING = 64
"""Shapes at hand in the first step of a round."""
JUDGED = 64
"""Validation shapes whose recovery is measured."""
MEASURED = 2048
"""Points that it is measured with."""

Batch = tuple[Tensor, Tensor]
"""Inputs, and classes int64 (n, parameters)."""


def prepare(task: Task) -> Outcome:
    """The validation inputs of a program, and for a model of drawings those that it learns from.

    Files of the shard: `.val.safetensors` and, of drawings, `.train.safetensors`, with `inputs`, clouds float32 (n,
    points, 3) or the bits of drawings uint8 (n, bytes), and `classes` int16 (n, parameters); `.json`, what they are.
    """
    from safetensors.numpy import save

    params = task.shard.params
    settings = params["settings"]
    program = find_program(params["program"])
    wanted = {"val": (VAL, settings["validation"])}
    if settings["input"] == "sketch":
        wanted["train"] = (TRAIN, settings["pool"])
    config = SketchesConfig.model_validate_json(json.dumps(params.get("sketches", {})))
    views = [view for view in config.views if not settings["views"] or view.name in settings["views"]]
    total = sum(count for _, count in wanted.values())
    texts: list[str] = []
    done = 0
    for split, (interval, count) in wanted.items():
        inputs: list[npt.NDArray[Any]] = []
        classes: list[npt.NDArray[np.int16]] = []
        for number, shape in enumerate(islice(random_shapes(program, interval, task.rng(split)), count)):
            rng = task.rng(split, "input", number)
            if settings["input"] == "points":
                cloud = sampled_points(shape.parts, settings["points"], rng)
                inputs.append(frame_of(cloud).normalized(cloud).astype(np.float32))
            else:
                view = views[number % len(views)]
                inputs.append(np.packbits(drawn(program, shape.parts, view, config, rng)))
            classes.append(shape.classes.astype(np.int16))
            if split == "val":
                texts.append(program.schema.text(shape.values))
            done += 1
            task.progress(done, total)
        arrays: dict[str, npt.NDArray[Any]] = {"inputs": np.array(inputs), "classes": np.array(classes)}
        with task.output(f"{task.shard.name}.{split}.safetensors") as stream:
            stream.write(save(arrays))
    counts = {split: {"shapes": count} for split, (_, count) in wanted.items()}
    with task.output(f"{task.shard.name}.json") as stream:
        stream.write(json_bytes({"counts": counts, "texts": texts, "views": params.get("sketches")}))
    return Outcome(samples=0, summary=counts)


def entry(settings: Mapping[str, Any]) -> RecoveryEntry:
    """The entry whose JSON is `settings`."""
    return RecoveryEntry.model_validate(settings)


def learner(task: Task, entry: RecoveryEntry, seed: int) -> RecoveryLearner:
    """A network with fresh weights beside what it learns from."""
    from safetensors.numpy import load_file

    program, data = find_program(task.shard.params["program"]), task.shard.params["data"]
    described = json.loads(task.input("training", f"{data}.json").read_bytes())
    paths = {split: task.input("training", f"{data}.{split}.safetensors") for split in described["counts"]}
    header = {
        "parameters": described_parameters(program),
        "counts": described["counts"],
        "sketches": described["views"],
        "data": {split: file_digest(path) for split, path in paths.items()},
    }
    splits = {split: load_file(path) for split, path in paths.items()}
    module = new_model(entry, program, seed).to(device_of(entry.device))
    return RecoveryLearner(module, header, entry, program, splits, described["texts"])


def new_model(entry: RecoveryEntry, program: Program, seed: int) -> RecoveryNet:
    """A network for a program with random weights, by its seed alone."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return RecoveryNet(entry, program.parameters)


def described_parameters(program: Program) -> list[list[Any]]:
    """Name, values and number of classes of each parameter: weights are of no use where any is another."""
    return [[each.name, list(each.values), each.classes] for each in program.parameters]


@dataclass(frozen=True)
class RecoveryLearner:
    """The `Learner` of a recovery model. splits: `inputs` and `classes` by split; texts: the validation shapes."""

    module: RecoveryNet
    header: Mapping[str, Any]
    entry: RecoveryEntry
    program: Program
    splits: Mapping[str, Mapping[str, npt.NDArray[Any]]]
    texts: Sequence[str]

    @property
    def device(self) -> torch.device:
        """Where it learns."""
        return next(self.module.parameters()).device

    @cached_property
    def answers(self) -> Answers:
        """What the outputs of the network say, on its device."""
        return Answers.of(self.entry, self.program.parameters).to(self.device)

    def batches(self, rng: np.random.Generator) -> Iterator[Batch]:
        """Clouds of shapes that are made meanwhile, or drawings of the pool, changed at random."""
        batches = self._clouds(rng) if self.entry.input == "points" else self._drawings(rng)
        return ((inputs.to(self.device), classes.to(self.device)) for inputs, classes in batches)

    def losses(self, batch: Batch, step: int, noise: Generator) -> dict[str, Tensor]:
        """That of all parameters together, in nats of an input."""
        inputs, classes = batch
        return {"loss": self.answers.nats(self.module(inputs, noise), classes)}

    def validate(self, noise: Generator) -> dict[str, float]:
        """On shapes that are never learnt from: nats; of the parameters that are visible, the share that is right and
        that within one class; and the mean and the 95th percentile of how far the shapes that come out are from the
        true ones, squared, in sides of their boxes."""
        val = self.splits["val"]
        outputs = []
        for start in range(0, len(val["classes"]), self.entry.batch):
            inputs = val["inputs"][start : start + self.entry.batch]
            outputs.append(self.module(_input_tensor(inputs, self.entry.input).to(self.device)))
        found, classes = torch.cat(outputs), torch.from_numpy(val["classes"].astype(np.int64)).to(self.device)
        counts = self.answers.counts
        best, visible = self.answers.chances(found).argmax(dim=-1), classes < counts
        near = (best - classes).abs() <= 1
        distances = [
            self._distance(chosen, text) for chosen, text in zip(best[:JUDGED].tolist(), self.texts, strict=False)
        ]
        return {
            "loss": float(self.answers.nats(found, classes)),
            "right": float((best == classes)[visible].float().mean()),
            "near": float((near & (best < counts))[visible].float().mean()),
            "chamfer": float(np.mean(distances)),
            "chamfer_high": float(np.quantile(distances, 0.95)),
        }

    def _distance(self, classes: Sequence[int], text: str) -> float:
        schema = self.program.schema
        recovered = valid_values(self.program, schema.from_classes(classes))
        clouds = (shape_points(self.program.parts(each), MEASURED) for each in (recovered, schema.values(text)))
        return chamfer_distance(*(frame_of(each).normalized(each) for each in clouds))

    def _clouds(self, rng: np.random.Generator) -> Iterator[Batch]:
        made, chances = rng.spawn(2)
        shapes = random_shapes(self.program, TRAIN, made)
        dense: list[Float32Array] = []
        classes: list[npt.NDArray[np.int64]] = []
        owed, oldest = float(BEGINNING), 0
        while True:
            for shape in islice(shapes, int(owed)):
                cloud = sampled_points(shape.parts, DENSE, made).astype(np.float32)
                if len(dense) < HELD:
                    dense.append(cloud)
                    classes.append(shape.classes)
                else:
                    dense[oldest], classes[oldest] = cloud, shape.classes
                    oldest = (oldest + 1) % HELD
            owed = owed % 1.0 + self.entry.batch / self.entry.reuse
            chosen = chances.integers(len(dense), size=self.entry.batch).tolist()
            clouds = np.array([self._seen(dense[each], chances) for each in chosen])
            yield torch.from_numpy(clouds), torch.from_numpy(np.array([classes[each] for each in chosen]))

    def _seen(self, dense: Float32Array, rng: np.random.Generator) -> Float32Array:
        """A cloud as it is learnt from, float32 (points, 3)."""
        cloud = taken(dense.astype(np.float64), min(2 * self.entry.points, DENSE), rng)
        if rng.random() < self.entry.noise:
            cloud = spoilt(cloud, rng)
        cloud = taken(cloud, self.entry.points, rng)
        return frame_of(cloud).normalized(cloud).astype(np.float32)

    def _drawings(self, rng: np.random.Generator) -> Iterator[Batch]:
        train = self.splits["train"]
        while True:
            chosen = rng.integers(len(train["classes"]), size=self.entry.batch)
            drawings = _input_tensor(train["inputs"][chosen], "sketch")
            kinds = rng.random((len(chosen), 2))
            for row, (mirror, morphology) in enumerate(kinds.tolist()):
                if mirror < 0.5 * self.entry.noise:
                    drawings[row] = drawings[row].flip(-1)
                if morphology < 0.5 * self.entry.noise:
                    drawings[row] = max_pool2d(drawings[row], 3, 1, 1)
                elif morphology < self.entry.noise:
                    drawings[row] *= torch.from_numpy(rng.random(drawings[row].shape) < 0.9)
            yield drawings, torch.from_numpy(train["classes"][chosen].astype(np.int64))


def _input_tensor(inputs: npt.NDArray[Any], kind: str) -> Tensor:
    """What the network reads, of clouds or of the bits of drawings."""
    if kind == "points":
        return torch.from_numpy(inputs)
    ink = np.unpackbits(inputs, axis=1, count=SIDE * SIDE).reshape(-1, 1, SIDE, SIDE)
    return torch.from_numpy(ink.astype(np.float32))
