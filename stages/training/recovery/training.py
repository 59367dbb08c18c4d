"""Training of a recovery model: prepared shapes, losses and validation (geocode §3.3)."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Generator, Tensor

from pipeline.paths import file_digest
from pipeline.shards import json_bytes
from pipeline.stage import Outcome, Task
from stages.programs.program import Program, find_program
from stages.shape.arrays import FloatArray
from stages.shape.geometry.clouds import chamfer_squared
from stages.sketches.settings import SketchesConfig
from stages.training.corpus import read_description
from stages.training.kind import Kind
from stages.training.recovery.augmentation import augment_clouds, augment_drawings, quantized_cloud, unpack_drawings
from stages.training.recovery.clouds import frame_of
from stages.training.recovery.drawings import draw_fitted
from stages.training.recovery.estimate import estimate_from_probabilities
from stages.training.recovery.model import RecoveryNet
from stages.training.recovery.outputs import ParameterOutputs
from stages.training.recovery.settings import RecoveryModelConfig
from stages.training.recovery.shapes import (
    TRAIN_INTERVAL,
    VALIDATION_INTERVAL,
    nearest_valid_values,
    random_training_shapes,
)
from stages.training.recovery.surface import sample_points, shape_points
from stages.training.training_task import TrainingTask, resolve_device, seeded

VALIDATED_SHAPES = 64
"""Validation shapes whose recovery is measured."""
CHAMFER_POINTS = 2048

Batch = tuple[Tensor, Tensor]
"""Inputs, and classes int64 (n, parameters)."""


def prepare(task: Task) -> Outcome:
    """Prepare inputs of a program: the validation inputs, or those that training gets in a round and all after it.

    Files of the shard: `.safetensors`, with `inputs`, and `classes` int16 (n, parameters); `.json`, what they are.
    Validation clouds are float32 (n, points, 3). Training clouds are quantized and have twice as many points. Drawings
    are their bits, uint8 (n, bytes).
    """
    from safetensors.numpy import save

    params = task.shard.params
    settings, split = params["settings"], params["split"]
    program = find_program(params["program"])
    config = SketchesConfig.model_validate_json(json.dumps(params.get("sketches", {})))
    views = [view for view in config.views if not settings["views"] or view.name in settings["views"]]
    inputs: list[npt.NDArray[Any]] = []
    classes: list[npt.NDArray[np.int16]] = []
    texts: list[str] = []
    shapes = random_training_shapes(program, VALIDATION_INTERVAL if split == "val" else TRAIN_INTERVAL, task.rng(split))
    for number, shape in enumerate(islice(shapes, params["shapes"])):
        rng = task.rng(split, "input", number)
        if settings["input"] == "sketch":
            view = views[number % len(views)]
            inputs.append(np.packbits(draw_fitted(program, shape.parts, view, config, rng)))
        elif split == "val":
            cloud = sample_points(shape.parts, settings["points"], rng)
            inputs.append(frame_of(cloud).normalized(cloud).astype(np.float32))
        else:
            inputs.append(quantized_cloud(sample_points(shape.parts, 2 * settings["points"], rng)))
        classes.append(shape.classes.astype(np.int16))
        texts.append(program.schema.to_text(shape.values))
        task.progress(number + 1, params["shapes"])
    arrays: dict[str, npt.NDArray[Any]] = {"inputs": np.array(inputs), "classes": np.array(classes)}
    with task.output(f"{task.shard.name}.safetensors") as stream:
        stream.write(save(arrays))
    with task.output(f"{task.shard.name}.json") as stream:
        stream.write(json_bytes({"texts": texts, "views": params.get("sketches")}))
    return Outcome(samples=0, summary={"shapes": params["shapes"]})


def new_task(task: Task, config: RecoveryModelConfig, seed: int) -> RecoveryTask:
    """Make a network with fresh weights, and read its training and validation inputs."""
    from safetensors.numpy import load_file

    params = task.shard.params
    program, description = find_program(params["program"]), read_description(task)
    validation = task.input("training", f"{params['data']}.safetensors")
    header = {
        "parameters": parameter_descriptions(program),
        # the same in every round, since a round reads the weights of the round before by it
        "counts": {"train, a round": {"shapes": config.shapes_per_round}, "val": {"shapes": config.validation_shapes}},
        "sketches": description["views"],
        "data": {"val": file_digest(validation)},
    }
    pooled = [load_file(task.input("training", f"{pool}.safetensors")) for pool in params["pools"]]
    train = {key: np.concatenate([arrays[key] for arrays in pooled]) for key in ("inputs", "classes")}
    module = new_network(config, program, seed).to(resolve_device(config.device))
    return RecoveryTask(module, header, config, train, load_file(validation), program, description["texts"])


def new_network(config: RecoveryModelConfig, program: Program, seed: int) -> RecoveryNet:
    """Make a network for a program with random weights, by its seed alone."""
    return seeded(seed, lambda: RecoveryNet(config, program.parameters))


def parameter_descriptions(program: Program) -> list[list[Any]]:
    """Name, values and number of classes of each parameter. Weights are of no use where any of it has changed."""
    return [[parameter.name, list(parameter.values), parameter.classes] for parameter in program.parameters]


@dataclass(frozen=True)
class RecoveryTask(TrainingTask):
    """Training of a recovery model.

    train, val: their `inputs` and `classes`
    texts: the validation shapes
    """

    program: Program
    texts: Sequence[str]

    @cached_property
    def outputs(self) -> ParameterOutputs:
        """How the outputs of the network are read, on its device."""
        return ParameterOutputs.of(self.config, self.program.parameters).to(self.device)

    def batches(self, rng: np.random.Generator) -> Iterator[Batch]:
        """Yield augmented inputs of random shapes; all inputs are on the device."""
        noise = Generator(self.device).manual_seed(int(rng.integers(2**63)))
        inputs = torch.from_numpy(self.train["inputs"]).to(self.device)
        classes = torch.from_numpy(self.train["classes"].astype(np.int64)).to(self.device)
        while True:
            rows = torch.from_numpy(rng.integers(len(classes), size=self.config.batch_size)).to(self.device)
            if self.config.input == "points":
                augmented = augment_clouds(inputs[rows], self.config.points, self.config.augmented_share, noise)
            else:
                augmented = augment_drawings(inputs[rows], self.config.augmented_share, rng, noise)
            yield augmented, classes[rows]

    def losses(self, batch: Batch, step: int, noise: Generator) -> dict[str, Tensor]:
        """The loss of all parameters together, in nats of an input."""
        inputs, classes = batch
        return {"loss": self.outputs.loss_in_nats(self.module(inputs, noise), classes)}

    def validate(self, noise: Generator) -> dict[str, float]:
        """Figures on the validation shapes.

        loss: in nats
        accuracy, accuracy_within_one: share of the visible parameters with the right class, and within one class
        chamfer, chamfer_p95: mean and 95th percentile of the squared Chamfer distances of the shapes where a search
        begins, in sides of their boxes
        """
        inputs = torch.from_numpy(self.val["inputs"]).to(self.device)
        read = unpack_drawings if self.config.input == "sketch" else Tensor.float
        logits = torch.cat([self.module(read(batch)) for batch in torch.split(inputs, self.config.batch_size)])
        classes = torch.from_numpy(self.val["classes"].astype(np.int64)).to(self.device)
        counts = self.outputs.counts
        probabilities, visible = self.outputs.probabilities(logits), classes < counts
        best = probabilities.argmax(dim=-1)
        within_one = ((best - classes).abs() <= 1) & (best < counts)
        rows = probabilities[:VALIDATED_SHAPES].double().cpu().numpy()
        distances = [self._distance(row, text) for row, text in zip(rows, self.texts, strict=False)]
        return {
            "loss": float(self.outputs.loss_in_nats(logits, classes)),
            "accuracy": float((best == classes)[visible].float().mean()),
            "accuracy_within_one": float(within_one[visible].float().mean()),
            "chamfer": float(np.mean(distances)),
            "chamfer_p95": float(np.quantile(distances, 0.95)),
        }

    def _distance(self, probabilities: FloatArray, text: str) -> float:
        start = estimate_from_probabilities(self.program, probabilities).values(self.program)
        shapes = (nearest_valid_values(self.program, start), self.program.schema.from_text(text))
        clouds = (shape_points(self.program.parts(values), CHAMFER_POINTS) for values in shapes)
        return chamfer_squared(*(frame_of(cloud).normalized(cloud) for cloud in clouds))


KIND = Kind(RecoveryModelConfig, prepare, new_task)
