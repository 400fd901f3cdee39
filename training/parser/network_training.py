"""Training of the parser network: seeded and resumable.

Needs the `train` extra (torch). Step n depends only on the seed, on n and on the previous state. Thus an interrupted
and resumed run ends in the same weights as an uninterrupted one.
"""

from __future__ import annotations

import copy
import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from facade_core.core.errors import ImageError, ModelFileError
from facade_core.core.labels import CLASSES, UNKNOWN, FacadeClass
from facade_core.parsing.network import DOOR_WEIGHT, OCCLUDER_OUTPUT, OUTSIDE_OUTPUT
from training.datasets.facades import ANY_CLASS, LabelledFacade
from training.parser.step_views import StepViews
from training.parser.views import OccluderPainter
from training.progress import track_progress
from training.torch_files import read_state, require_torch, write_state

if TYPE_CHECKING:
    from torch import Tensor
    from torch.optim import Optimizer

    from training.parser.network import ParserNetwork


# Without a GPU, a step is computed in this many parallel parts, one thread each, which synchronise once a step.
_PARALLEL_PARTS = 2
# Processes that draw the views of a GPU, at most, and steps that each draws ahead.
_MAX_LOADERS, _STEPS_AHEAD = 14, 4
_WEIGHT_DECAY = 0.01
# Learning rate of the encoder, as a share of the decoder's.
_ENCODER_RATE = 0.15
# Steps of the learning rate's rise, and their largest share of all steps,
_WARM_UP = (300, 0.25)
# and of its fall.
_COOL_DOWN = (1200, 0.4)
# The averaged weights follow the trained ones with this memory, in steps.
_AVERAGE_STEPS = 250
# Weight of the two binary outputs, occluder and outside, against the classes.
_BINARY_LOSS_WEIGHT = 0.5
# Steps between saved states.
_SAVE_INTERVAL = 100


@dataclass(frozen=True, slots=True)
class TrainingSchedule:
    """Length and content of a training run.

    Attributes
    ----------
    steps : number of steps.
    per_step : photos of each set per step.
    rate : highest learning rate.
    freeze_norms : keep the normalisation fixed: for few or uniform photos, and where an export folded it
        (`network_export`).
    """

    steps: int
    per_step: Mapping[str, int]
    rate: float = 2e-3
    freeze_norms: bool = False


def train_parser_network(
    sets: Mapping[str, Sequence[LabelledFacade]],
    schedule: TrainingSchedule,
    *,
    seed: int,
    state: Path | None = None,
    start: Mapping[str, Tensor] | None = None,
    paint_occluders: OccluderPainter | None = None,
) -> dict[str, Tensor]:
    """Train on the named sets and return the network's averaged weights (name -> tensor).

    Runs on a GPU where torch finds one; its weights equal those of processors up to rounding.

    Parameters
    ----------
    sets : labelled photos by name of the set.
    schedule : schedule of the run.
    seed : random seed.
    state : file of the run's state, written every 100 steps; read if it exists and belongs to the same run.
    start : weights to continue from; without, the encoder starts from ImageNet weights.
    paint_occluders : painter of thin occluders before the views.

    Raises
    ------
    ImageError
        If a photo cannot be used.
    ModelError
        If the state belongs to another run, or torch is missing.
    """
    require_torch()
    import torch

    from training.parser.network import ParserNetwork

    _check_sets(sets, schedule)
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    network = ParserNetwork()
    if start is None:
        network.load_imagenet_weights()
    else:
        network.load_state_dict(start)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    network = network.to(device, memory_format=torch.channels_last)
    # ImageNet taught edges and colours well; training them again would take a quarter of the time.
    for parameter in network.early_encoder_parameters():
        parameter.requires_grad_(False)
    optimiser = _make_optimiser(network, schedule)
    average = {name: value.clone() for name, value in network.state_dict().items()}
    identity = f"{seed} {schedule.rate} {dict(schedule.per_step)} {schedule.freeze_norms} {_digest(sets, start)}"
    done = 0
    if state is not None and state.is_file():
        saved = read_state(state)
        # The number of steps may change while no rate has begun to fall, for the old one or the new.
        shorter = min(saved["steps"], schedule.steps)
        changed = saved["steps"] != schedule.steps and saved["done"] > shorter - _cool_down_steps(shorter)
        if saved["identity"] != identity or changed:
            raise ModelFileError(f"{state}: state of another training run; remove it or name another folder")
        network.load_state_dict(saved["network"])
        optimiser.load_state_dict(saved["optimiser"])
        average, done = {name: value.to(device) for name, value in saved["average"].items()}, saved["done"]
    network.train(not schedule.freeze_norms)
    parts = 1 if device.type == "cuda" else _PARALLEL_PARTS
    replicas = [network, *(_replicate(network) for _ in range(parts - 1))]
    loaders = min(_MAX_LOADERS, len(os.sched_getaffinity(0)) - 1) if device.type == "cuda" else 0
    steps = torch.utils.data.DataLoader(
        StepViews(sets, schedule.per_step, schedule.steps, seed, parts, paint_occluders),
        batch_size=None,
        sampler=range(done, schedule.steps),
        num_workers=loaders,
        prefetch_factor=_STEPS_AHEAD if loaders else None,
    )
    with ThreadPoolExecutor(parts, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        tracked = track_progress("network", steps, schedule.steps, earlier=done)
        for step, batches in enumerate(tracked, start=done):
            for group in optimiser.param_groups:
                group["lr"] = group["highest"] * _rate_share(step, schedule.steps)
            losses = list(pool.map(_backward, replicas, batches))
            if not all(map(math.isfinite, losses)):
                raise ModelFileError(f"training diverged at step {step}: lower the learning rate {schedule.rate}")
            _average_replicas(replicas)
            optimiser.step()
            _update_average(average, network.state_dict(), min(1 - 1 / _AVERAGE_STEPS, (1 + step) / (10 + step)))
            if state is not None and ((step + 1) % _SAVE_INTERVAL == 0 or step + 1 == schedule.steps):
                write_state(
                    state,
                    {
                        "identity": identity,
                        "steps": schedule.steps,
                        "network": network.state_dict(),
                        "optimiser": optimiser.state_dict(),
                        "average": average,
                        "done": step + 1,
                    },
                )
    return {name: value.cpu() for name, value in average.items()}


def _digest(sets: Mapping[str, Sequence[LabelledFacade]], start: Mapping[str, Tensor] | None) -> str:
    """Digest of a run's input: photos with their labels, and start weights."""
    digest = blake2b(digest_size=16)
    for name, photos in sets.items():
        digest.update(name.encode())
        for photo in photos:
            for array in (photo.image, photo.possible, photo.occluder, photo.outside):
                digest.update(np.ascontiguousarray(array).tobytes())
    for name, value in (start or {}).items():
        digest.update(name.encode() + value.numpy().tobytes())
    return digest.hexdigest()


def read_finished_weights(state: Path) -> dict[str, Tensor]:
    """Read the averaged weights of a finished run.

    Raises
    ------
    ModelError
        If there is no finished run.
    """
    if not state.is_file():
        raise ModelFileError(f"{state}: no such file; train the network first, into the same folder")
    saved = read_state(state)
    if saved["done"] < saved["steps"]:
        raise ModelFileError(f"{state}: {saved['done']} of {saved['steps']} steps done; finish this training first")
    average: dict[str, Tensor] = saved["average"]
    return average


def _check_sets(sets: Mapping[str, Sequence[LabelledFacade]], schedule: TrainingSchedule) -> None:
    for name in schedule.per_step:
        if not sets.get(name):
            raise ImageError(f"no training photos in the set {name}; give at least one labelled photo")
    for name, photos in sets.items():
        for number, photo in enumerate(photos):
            shape = photo.image.shape[:2]
            if photo.image.dtype != np.uint8 or photo.image.shape != (*shape, 3) or not photo.image.size:
                raise ImageError(f"training photo {name} {number}: must be uint8 RGB (H, W, 3), not {shape}")
            if any(layer.shape != shape for layer in (photo.possible, photo.occluder, photo.outside)):
                raise ImageError(f"training photo {name} {number}: its label maps must have the photo's size {shape}")


def _replicate(network: ParserNetwork) -> ParserNetwork:
    """Copy that shares the weights but has its own gradients and running means."""
    replica = copy.deepcopy(network)
    for own, shared in zip(replica.parameters(), network.parameters(), strict=True):
        own.data = shared.data
    return replica


def _backward(network: ParserNetwork, batch: Sequence[Tensor]) -> float:
    network.zero_grad()
    device = next(network.parameters()).device
    loss = _loss(network, [layer.to(device) for layer in batch])
    loss.backward()
    value: float = loss.item()
    return value


def _average_replicas(replicas: Sequence[ParserNetwork]) -> None:
    """Average gradients into the first replica, and running statistics into all."""
    import torch

    for same in zip(*(replica.parameters() for replica in replicas), strict=True):
        if same[0].requires_grad:
            same[0].grad = sum(parameter.grad for parameter in same) / len(same)
    for same in zip(*(replica.buffers() for replica in replicas), strict=True):
        if same[0].is_floating_point():
            mean = torch.stack(same).mean(0)
            for buffer in same:
                buffer.copy_(mean)


def _rate_share(step: int, steps: int) -> float:
    """Share of the highest learning rate: a linear rise, a plateau and a linear fall.

    The plateau does not depend on the number of steps, so that a run can be extended during it.
    """
    rise = max(1, min(_WARM_UP[0], int(_WARM_UP[1] * steps)))
    return min(1.0, (step + 1) / rise, (steps - step) / _cool_down_steps(steps))


def _cool_down_steps(steps: int) -> int:
    return max(1, min(_COOL_DOWN[0], int(_COOL_DOWN[1] * steps)))


def _make_optimiser(network: ParserNetwork, schedule: TrainingSchedule) -> Optimizer:
    import torch

    encoder = network.encoder_parameters()
    known = {id(parameter) for parameter in encoder}
    decoder = [parameter for parameter in network.parameters() if id(parameter) not in known]
    groups = [
        {
            "params": [parameter for parameter in encoder if parameter.requires_grad],
            "highest": schedule.rate * _ENCODER_RATE,
        },
        {"params": decoder, "highest": schedule.rate},
    ]
    return torch.optim.AdamW(groups, lr=0.0, weight_decay=_WEIGHT_DECAY)


def _loss(network: ParserNetwork, batch: Sequence[Tensor]) -> Tensor:
    """Return the loss on the layers of a `ViewBatch`: negative log of the summed probability of a pixel's possible classes.

    The cross-entropies of both binary outputs are added.
    """
    import torch
    from torch.nn import functional

    image, possible, occluder, occluder_weight, outside, place = batch
    image = image.permute(0, 3, 1, 2).float()
    logits = network(image.contiguous(memory_format=torch.channels_last), place)
    logits = functional.interpolate(logits, scale_factor=2.0, mode="bilinear", align_corners=False)
    classes = logits[:, : len(CLASSES)]
    bits = torch.tensor([1 << number for number in range(len(CLASSES))], dtype=torch.uint8, device=possible.device)
    may_be = (possible[:, None] & bits[:, None, None]) != 0
    weight = ((possible != ANY_CLASS) & (possible != 0)).float()
    weight = torch.where(possible == 1 << FacadeClass.DOOR, DOOR_WEIGHT, weight)
    wrong = torch.logsumexp(classes, 1) - torch.logsumexp(classes.masked_fill(~may_be, -1e4), 1)
    loss = (wrong * weight).sum() / weight.sum().clamp(min=1)
    for output, truth, count in (
        (OCCLUDER_OUTPUT, occluder, occluder_weight),
        (OUTSIDE_OUTPUT, outside, outside != UNKNOWN),
    ):
        error = functional.binary_cross_entropy_with_logits(logits[:, output], (truth == 1).float(), reduction="none")
        loss = loss + _BINARY_LOSS_WEIGHT * (error * count).sum() / count.sum().clamp(min=1)
    return loss


def _update_average(average: dict[str, Tensor], current: Mapping[str, Tensor], memory: float) -> None:
    for name, value in current.items():
        if value.is_floating_point():
            average[name].mul_(memory).add_(value, alpha=1 - memory)
        else:
            average[name].copy_(value)
