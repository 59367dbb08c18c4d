"""How a model of ShapeAssembly programs learns: teacher forcing; only what a line has counts (shapeassembly §6.2)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Generator, Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, cross_entropy

from pipeline.stage import Outcome, Task
from stages.training.latent import reparameterize
from stages.training.loop import resolve_device
from stages.training.program_vae.batches import AssemblyLevel, ProgramCorpus, batches
from stages.training.program_vae.corpus import prepare_corpus, read_corpus
from stages.training.program_vae.lines import (
    ALIGNED,
    ATTACH,
    AXIS,
    COMMAND,
    COPIES,
    CUBOID,
    DIMS,
    FACE,
    INDICES,
    POINTS,
    REFLECT,
    SLOT_COUNT,
    SQUEEZE,
    TRANSLATE,
    UV,
)
from stages.training.program_vae.model import ProgramVae, sizes_of
from stages.training.program_vae.settings import ProgramVaeConfig
from stages.training.training_task import sample_digests, weighted_means


def prepare(task: Task) -> Outcome:
    """The programs of a category, as numbers."""
    return prepare_corpus(task)


def entry(settings: Mapping[str, Any]) -> ProgramVaeConfig:
    """The entry whose JSON is `settings`."""
    return ProgramVaeConfig.model_validate(settings)


def learner(task: Task, entry: ProgramVaeConfig, seed: int) -> ProgramVaeTask:
    """A model with fresh weights beside the programs of its category."""
    described, programs = read_corpus(task, task.shard.params["data"])
    header = {"counts": described["counts"], "data": sample_digests(task, "safetensors")}
    module = new_model(entry, seed).to(resolve_device(entry.device))
    return ProgramVaeTask(module, header, entry, programs["train"], programs["val"])


def new_model(entry: ProgramVaeConfig, seed: int) -> ProgramVae:
    """A model with random weights, by its seed alone."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return ProgramVae(entry)


@dataclass(frozen=True)
class ProgramVaeTask:
    """The `Learner` of a model of programs."""

    module: ProgramVae
    header: Mapping[str, Any]
    entry: ProgramVaeConfig
    train: ProgramCorpus
    val: ProgramCorpus

    def batches(self, rng: np.random.Generator) -> Iterator[list[AssemblyLevel]]:
        """Random batches of train, one pass after another."""
        device = next(self.module.parameters()).device
        while True:
            for levels in batches(self.train, self.entry.batch_size, rng):
                yield [level.to(device) for level in levels]

    def losses(self, batch: Sequence[AssemblyLevel], step: int, noise: Generator) -> dict[str, Tensor]:
        """Means over programs: nats of what lines choose, absolute errors of their numbers, and the divergence from
        the prior."""
        codes, divergence = reparameterize(*self.module.encode(batch), noise)
        nats, errors = (each / len(codes) for each in reconstruction(self.module, batch, codes))
        loss = nats + self.entry.number_weight * errors + self.entry.kl_weight * divergence
        return {"loss": loss, "nats": nats, "errors": errors, "divergence": divergence}

    def validate(self, noise: Generator) -> dict[str, float]:
        """The same on val; and the module learns where the programs of train stand."""
        device = next(self.module.parameters()).device
        train, val = (batches(each, self.entry.batch_size, None) for each in (self.train, self.val))
        self.module.fit_posterior(self.module.encode([level.to(device) for level in levels]) for levels in train)
        found = ((self.losses([each.to(device) for each in levels], 0, noise), len(levels[0].lines)) for levels in val)
        return weighted_means(found, len(self.val))


def reconstruction(module: ProgramVae, levels: Sequence[AssemblyLevel], codes: Tensor) -> tuple[Tensor, Tensor]:
    """Sums over all programs, whose roots have `codes`: nats of choices, and absolute errors of numbers."""
    nats = codes.new_zeros(())
    errors = (module.root_box(codes) - levels[0].boxes).abs().sum()
    for level in levels:
        states, _ = module.write(level.shown, module.start(codes))
        more, below = _line_losses(module, level, states, codes)
        nats, errors = nats + more[0], errors + more[1]
        # Rows and lines are in one order here and in the level below.
        codes = below[level.opened]
    return nats, errors


def _line_losses(
    module: ProgramVae, level: AssemblyLevel, states: Tensor, codes: Tensor
) -> tuple[tuple[Tensor, Tensor], Tensor]:
    """Nats and errors of all lines of a level, summed, and what the model would expand each cuboid of it by, float
    (cuboids, latent). Lines of one command stand together, so that its head reads a slice."""
    heads, counts = module.lines, level.counts
    rows = level.places // level.lines.shape[1]
    lines, state = level.lines.flatten(0, 1)[level.places], states.flatten(0, 1)[level.places]
    boxes, sizes = level.boxes[rows], level.sizes[rows]
    commands = lines[:, COMMAND]
    nats = _nats(heads.command(state, boxes), commands.argmax(dim=-1))
    ends = np.cumsum(counts).tolist()
    cuboid, attach, squeeze, translate, reflect = (
        slice(ends[each] - counts[each], ends[each]) for each in (CUBOID, ATTACH, SQUEEZE, TRANSLATE, REFLECT)
    )
    slots = lines[:, INDICES].view(-1, 3, SLOT_COUNT)
    logits = heads.indices(state[attach.start :], commands[attach.start :])
    # Behind the attachments stand the squeezes, which alone name three cuboids, and what names but one.
    for place, last in enumerate((reflect.stop, squeeze.stop, squeeze.stop)):
        named = slice(squeeze.start if place == 2 else attach.start, last)
        chosen = slots[named, place].argmax(dim=-1)
        nats = nats + _nats(logits[named.start - attach.start : last - attach.start, place], chosen)
    dims, aligned = heads.cuboid(state[cuboid], boxes[cuboid])
    nats = nats + _flag_nats(aligned, lines[cuboid, ALIGNED][:, 0])
    errors = (dims - lines[cuboid, DIMS]).abs().sum()
    expanded, below = heads.child(state[cuboid], lines[cuboid, DIMS], codes[rows[cuboid]])
    nats = nats + _flag_nats(expanded, level.expanded)
    two = slots[attach, :2]
    points = heads.attach(state[attach], two, sizes_of(two, sizes[attach]))
    errors = errors + (points - lines[attach, POINTS]).abs().sum()
    faces, place_on = heads.squeeze(state[squeeze], slots[squeeze], sizes_of(slots[squeeze], sizes[squeeze]))
    nats = nats + _nats(faces, lines[squeeze, FACE].argmax(dim=-1))
    errors = errors + (place_on - lines[squeeze, UV]).abs().sum()
    macros = slice(translate.start, reflect.stop)
    one = slots[macros, 0]
    axes, copies = heads.symmetry(state[macros], one, sizes_of(one[:, None], sizes[macros])[:, 0], boxes[macros])
    nats = nats + _nats(axes, lines[macros, AXIS].argmax(dim=-1))
    errors = errors + (copies[: counts[TRANSLATE]] - lines[translate, COPIES]).abs().sum()
    return (nats, errors), below


def _nats(logits: Tensor, chosen: Tensor) -> Tensor:
    return cross_entropy(logits.float(), chosen, reduction="sum")


def _flag_nats(logits: Tensor, flags: Tensor) -> Tensor:
    return binary_cross_entropy_with_logits(logits.float(), flags.float(), reduction="sum")
