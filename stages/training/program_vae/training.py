"""Train a VAE of ShapeAssembly programs with teacher forcing;

only the numbers that a line has count (shapeassembly §6.2).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from torch import Generator, Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, cross_entropy

from pipeline.stage import Task
from stages.training.corpus import read_description, read_splits
from stages.training.kind import Kind
from stages.training.latent import reparameterize
from stages.training.program_vae.batches import AssemblyLevel, ProgramCorpus, batches
from stages.training.program_vae.corpus import prepare
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
from stages.training.training_task import TrainingTask, seeded


@dataclass(frozen=True)
class ProgramVaeTask(TrainingTask):
    """Training of a VAE of programs."""

    def epoch(self, samples: ProgramCorpus, rng: np.random.Generator | None) -> Iterator[list[AssemblyLevel]]:
        return batches(samples, self.config.batch_size, rng)

    def losses(self, batch: Sequence[AssemblyLevel], step: int, noise: Generator) -> dict[str, Tensor]:
        """Compute means over programs: nats of choices, absolute errors of numbers, divergence from the prior."""
        mean, log_variance = self.module.encode(batch)
        codes, divergence = reparameterize(mean, log_variance, noise)
        nats, errors = (total / len(codes) for total in program_reconstruction(self.module, batch, codes))
        loss = nats + self.config.number_weight * errors + self.config.kl_weight * divergence
        return {"loss": loss, "nats": nats, "errors": errors, "divergence": divergence}


def new_task(task: Task, config: ProgramVaeConfig, seed: int) -> ProgramVaeTask:
    samples = read_splits(task, ProgramCorpus)
    return ProgramVaeTask.of(task, config, new_model(config, seed), samples, read_description(task))


def new_model(config: ProgramVaeConfig, seed: int) -> ProgramVae:
    return seeded(seed, lambda: ProgramVae(config))


def program_reconstruction(module: ProgramVae, levels: Sequence[AssemblyLevel], codes: Tensor) -> tuple[Tensor, Tensor]:
    """Return sums over the programs with root codes: nats of choices, and absolute errors of numbers."""
    nats = codes.new_zeros(())
    errors = (module.root_box(codes) - levels[0].boxes).abs().sum()
    for level in levels:
        states, _ = module.decode(level.before, module.start(codes))
        more, below = _line_losses(module, level, states, codes)
        nats, errors = nats + more[0], errors + more[1]
        # Expanded cuboids are in the order of the assemblies of the level below.
        codes = below[level.opened]
    return nats, errors


def _line_losses(
    module: ProgramVae, level: AssemblyLevel, states: Tensor, codes: Tensor
) -> tuple[tuple[Tensor, Tensor], Tensor]:
    """Return nats and errors of all lines of a level, summed, and codes for its cuboids, float (cuboids, latent).

    Lines are sorted by command, so that the layers of a command read a slice.
    """
    heads, counts = module.lines, level.counts
    rows = level.places // level.lines.shape[1]
    lines, state = level.lines.flatten(0, 1)[level.places], states.flatten(0, 1)[level.places]
    boxes, sizes = level.boxes[rows], level.sizes[rows]
    commands = lines[:, COMMAND]
    nats = _nats(heads.command(state, boxes), commands.argmax(dim=-1))
    ends = np.cumsum(counts).tolist()
    cuboid, attach, squeeze, translate, reflect = (
        slice(ends[command] - counts[command], ends[command])
        for command in (CUBOID, ATTACH, SQUEEZE, TRANSLATE, REFLECT)
    )
    slots = lines[:, INDICES].view(-1, 3, SLOT_COUNT)
    logits = heads.indices(state[attach.start :], commands[attach.start :])
    # Attachments name two cuboids, squeezes three, macros one.
    for position, last in enumerate((reflect.stop, squeeze.stop, squeeze.stop)):
        named = slice(squeeze.start if position == 2 else attach.start, last)
        chosen = slots[named, position].argmax(dim=-1)
        nats = nats + _nats(logits[named.start - attach.start : last - attach.start, position], chosen)
    dims, aligned = heads.cuboid(state[cuboid], boxes[cuboid])
    nats = nats + _flag_nats(aligned, lines[cuboid, ALIGNED][:, 0])
    errors = (dims - lines[cuboid, DIMS]).abs().sum()
    expanded, below = heads.child(state[cuboid], lines[cuboid, DIMS], codes[rows[cuboid]])
    nats = nats + _flag_nats(expanded, level.expanded)
    pair = slots[attach, :2]
    points = heads.attach(state[attach], pair, sizes_of(pair, sizes[attach]))
    errors = errors + (points - lines[attach, POINTS]).abs().sum()
    faces, uv = heads.squeeze(state[squeeze], slots[squeeze], sizes_of(slots[squeeze], sizes[squeeze]))
    nats = nats + _nats(faces, lines[squeeze, FACE].argmax(dim=-1))
    errors = errors + (uv - lines[squeeze, UV]).abs().sum()
    macros = slice(translate.start, reflect.stop)
    moved = slots[macros, 0]
    axes, copies = heads.symmetry(state[macros], moved, sizes_of(moved[:, None], sizes[macros])[:, 0], boxes[macros])
    nats = nats + _nats(axes, lines[macros, AXIS].argmax(dim=-1))
    errors = errors + (copies[: counts[TRANSLATE]] - lines[translate, COPIES]).abs().sum()
    return (nats, errors), below


def _nats(logits: Tensor, chosen: Tensor) -> Tensor:
    return cross_entropy(logits.float(), chosen, reduction="sum")


def _flag_nats(logits: Tensor, flags: Tensor) -> Tensor:
    return binary_cross_entropy_with_logits(logits.float(), flags.float(), reduction="sum")


KIND = Kind(ProgramVaeConfig, prepare, new_task)
