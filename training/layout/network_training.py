"""Training of the layout network. Needs the `train` extra (torch); uses CUDA where present."""

from __future__ import annotations

import copy
import math
import os
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from typing import TYPE_CHECKING

import numpy as np

from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.facade.layout.network.raster import RASTER, STRIDE, WINDOW_PIXELS, decode_boxes, draw_inputs
from training.layout.network_views import LayoutView, sample_layout_view
from training.progress import track_progress
from training.torch_files import require_torch

if TYPE_CHECKING:
    from torch import Tensor

    from training.layout.ranking_examples import Layout

_RATE = 2e-3
_WEIGHT_DECAY = 0.03
_WARM_UP_SHARE = 0.02
# The averaged weights follow the trained ones with this memory, in steps.
_AVERAGE_STEPS = 400
# Share of the views of painter's plans.
_GENERATED_SHARE = 0.2
# Share of the views of which an earlier round has guessed some hidden elements.
_GUESSED_SHARE = 0.55
# Spread of the places of guessed elements in shares of their sizes, and that of some views, which are wrong.
_GUESS_SPREAD = 0.06
_WRONG_SPREAD = 0.4
_WRONG_SHARE = 0.12
# Elements smaller than this, in pixels, are found by the cells around them too.
_MIN_SIDE = 3.0
_MIN_IOU = 0.5
# Weight of the distance between boxes against their overlap.
_DISTANCE_WEIGHT = 0.3
_BOX_WEIGHT = 3.0
# Added to the number of hidden elements by which a view's loss is divided.
_COUNT_OFFSET = 6.0
# Processes that sample views, at most, and batches in preparation.
_MAX_WORKERS = 14
_AHEAD = 28


@dataclass(frozen=True, slots=True)
class NetworkSchedule:
    """Length of a training.

    Attributes
    ----------
    steps : number of steps.
    batch : views of a step.
    """

    steps: int = 1800
    batch: int = 256


def train_layout_network(
    layouts: Sequence[Layout],
    generated: Sequence[Layout],
    schedule: NetworkSchedule,
    *,
    seed: int,
) -> Mapping[str, Tensor]:
    """Train a network and return its averaged weights (name -> tensor).

    Parameters
    ----------
    layouts : layouts of the database.
    generated : generated layouts.
    schedule : length of the training.
    seed : random seed.

    Raises
    ------
    ModelFileError
        If torch is missing.
    """
    require_torch()
    import torch

    from training.layout.network import LayoutNetwork

    torch.manual_seed(seed)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    network = LayoutNetwork().to(device, memory_format=torch.channels_last)
    average = copy.deepcopy(network).eval()
    optimiser = torch.optim.AdamW(network.parameters(), lr=_RATE, weight_decay=_WEIGHT_DECAY)
    with ProcessPoolExecutor(
        min(_MAX_WORKERS, len(os.sched_getaffinity(0))),
        mp_context=get_context("spawn"),
        initializer=_keep_layouts,
        initargs=(layouts, generated),
    ) as pool:
        tracked = track_progress("layout network", _batches(pool, schedule, seed), schedule.steps)
        for step, batch in enumerate(tracked):
            done = step / schedule.steps
            rate = _RATE * min(1.0, done / _WARM_UP_SHARE + 0.02) * (0.5 + 0.5 * math.cos(math.pi * done)) + 1e-6
            for group in optimiser.param_groups:
                group["lr"] = rate
            views = {name: torch.from_numpy(value).to(device) for name, value in batch.items()}
            inputs, targets = _prepare(views)
            with torch.autocast(device.type, torch.bfloat16, enabled=device.type == "cuda"):
                raw = network(inputs)
            loss = _loss(raw.float(), targets)
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), 2.0)
            optimiser.step()
            _follow(average, network, min(1 - 1 / _AVERAGE_STEPS, (1 + step) / (10 + step)))
    weights: Mapping[str, Tensor] = average.cpu().state_dict()
    return weights


_sources: tuple[Sequence[Layout], Sequence[Layout]] = ((), ())


def _keep_layouts(layouts: Sequence[Layout], generated: Sequence[Layout]) -> None:
    global _sources  # noqa: PLW0603  (of one worker process)
    _sources = (layouts, generated)


def _batches(pool: ProcessPoolExecutor, schedule: NetworkSchedule, seed: int) -> Iterator[Mapping[str, np.ndarray]]:
    """Yield the batch of each step, sampled ahead."""
    pending: deque[Future[Mapping[str, np.ndarray]]] = deque()
    for step in range(schedule.steps):
        pending.append(pool.submit(_sample_batch, schedule.batch, (seed, 5, step)))
        if len(pending) == _AHEAD:
            yield pending.popleft().result()
    yield from (future.result() for future in pending)


def _sample_batch(size: int, seeds: Sequence[int]) -> Mapping[str, np.ndarray]:
    rng = np.random.default_rng(seeds)
    views: list[LayoutView] = []
    while len(views) < size:
        view = sample_layout_view(*_sources, _GENERATED_SHARE, rng)
        if view is not None:
            views.append(view)
    longest = -(-max(len(v.box) for v in views) // 32) * 32

    def pad_to_longest(name: str) -> np.ndarray:
        values = [getattr(v, name) for v in views]
        out = np.zeros((size, longest, *values[0].shape[1:]), np.float32)
        for row, value in zip(out, values, strict=True):
            row[: len(value)] = value
        return out

    return {
        **{name: pad_to_longest(name) for name in ("box", "label", "hidden", "distance")},
        "valid": np.arange(longest) < np.array([[len(v.box)] for v in views]),
        "extent": np.stack([v.extent for v in views]),
        "region": np.stack([np.rint(255 * v.region).astype(np.uint8) for v in views]),
    }


def _prepare(views: Mapping[str, Tensor]) -> tuple[Tensor, Mapping[str, Tensor]]:
    """Guess some of the hidden elements, and return the network's inputs and what it is to find."""
    import torch

    box, label, valid, extent = views["box"], views["label"].long(), views["valid"], views["extent"]
    hidden = (views["hidden"] > 0) & valid
    size, device = len(box), box.device
    share = torch.rand(size, 1, device=device) * (torch.rand(size, 1, device=device) < _GUESSED_SHARE)
    # Near elements are guessed first, or any.
    far = views["distance"] / views["distance"].amax(1, keepdim=True).clip(1)
    by_distance = (torch.rand(size, 1, device=device) < 0.6).float()
    order = by_distance * far + (1.3 - by_distance) * torch.rand_like(far)
    rank = order.masked_fill(~hidden, math.inf).argsort(1).argsort(1)
    guessed = hidden & (rank < (share * hidden.sum(1, keepdim=True)))
    wrong = (torch.rand(size, 1, 1, device=device) < _WRONG_SHARE).float()
    spread = _GUESS_SPREAD * torch.rand(size, 1, 1, device=device) + wrong * _WRONG_SPREAD
    sides = (box[..., 2:] - box[..., :2]).repeat(1, 1, 2)
    moved = torch.randn(*box.shape[:2], 2, device=device).repeat(1, 1, 2)
    edges = torch.randn_like(box)
    known_box = box + guessed[..., None] * spread * sides * (0.7 * moved + 0.4 * edges)
    known = (valid & ~hidden) | guessed
    kinds = torch.nn.functional.one_hot(label, len(ELEMENT_CLASSES)).float() * known[..., None]
    rows, columns = (torch.arange(n, device=device, dtype=torch.float32) for n in RASTER)
    region = views["region"].float() / 255
    drawn = draw_inputs(known_box, kinds, guessed[..., None].float(), extent, rows, columns)
    inputs = torch.cat([*drawn, region], 1).contiguous(memory_format=torch.channels_last)
    wanted = hidden & ~guessed
    rows, columns = (torch.arange(n // STRIDE, device=device, dtype=torch.float32) for n in RASTER)
    x, y = (columns + 0.5) * STRIDE, (rows + 0.5) * STRIDE
    middle = (box[..., :2] + box[..., 2:]) / 2
    reach = (box[..., 2:] - box[..., :2]).clip(_MIN_SIDE)
    away_x = (x - middle[..., :1]).abs() / reach[..., :1]
    away_y = (y - middle[..., 1:]).abs() / reach[..., 1:]
    away = torch.maximum(away_y[..., :, None], away_x[..., None, :])
    nearest, boxes = [], []
    for k in range(len(ELEMENT_CLASSES)):
        own = (wanted & (label == k))[..., None, None]
        value, index = torch.where(own, away, math.inf).min(1)
        nearest.append(value)
        flat = index.flatten(1)[..., None].expand(-1, -1, 4)
        boxes.append(box.gather(1, flat).reshape(*index.shape, 4).permute(0, 3, 1, 2))
    is_open = torch.nn.functional.avg_pool2d(region[:, :1], STRIDE) < 0.5
    is_open &= (x < extent[:, :1])[:, None, None, :] & (y < extent[:, 1:])[:, None, :, None]
    target = torch.stack(boxes, 1)
    inside = (torch.stack(nearest, 1) <= 0.5).float()
    cells = ((target[:, :, 2:] - target[:, :, :2]).clip(_MIN_SIDE) / STRIDE).prod(2)
    return inputs, {
        "box": target,
        "inside": inside,
        "weight": inside / cells.clip(1),
        "open": is_open.float(),
        "number": wanted.sum(1).float(),
    }


def _loss(raw: Tensor, targets: Mapping[str, Tensor]) -> Tensor:
    """Return the loss: of the boxes where an element is, and of the likelihood that a cell's box is right."""
    import torch
    from torch.nn import functional

    rows, columns = (torch.arange(n // STRIDE, device=raw.device, dtype=torch.float32) for n in RASTER)
    made, true = decode_boxes(raw[:, :, 1:], rows, columns), targets["box"]
    overlap = _iou(made, true)
    unit = raw.new_tensor([*WINDOW_PIXELS, *WINDOW_PIXELS])[:, None, None]
    distance = functional.smooth_l1_loss(made / unit, true / unit, reduction="none", beta=0.1).mean(2)
    weight = targets["weight"]
    boxes = ((1 - overlap + _DISTANCE_WEIGHT * distance) * weight).sum() / weight.sum().clip(1)
    right = ((overlap.detach() >= _MIN_IOU) & (targets["inside"] > 0)).float()
    unsure = functional.binary_cross_entropy_with_logits(raw[:, :, 0], right, reduction="none") * targets["open"]
    by_view = unsure.sum((1, 2, 3)) / (targets["number"] + _COUNT_OFFSET)
    return by_view.mean() + _BOX_WEIGHT * boxes


def _iou(a: Tensor, b: Tensor) -> Tensor:
    sides = (a[:, :, 2:].minimum(b[:, :, 2:]) - a[:, :, :2].maximum(b[:, :, :2])).clip(0)
    shared = sides.prod(2)
    areas = (a[:, :, 2:] - a[:, :, :2]).clip(0).prod(2) + (b[:, :, 2:] - b[:, :, :2]).clip(0).prod(2)
    return shared / (areas - shared).clip(1e-6)


def _follow(average, network, memory: float) -> None:  # type: ignore[no-untyped-def]
    """Move averaged weights towards the trained ones."""
    import torch

    with torch.no_grad():
        for mine, other in zip(average.parameters(), network.parameters(), strict=True):
            mine.lerp_(other, 1 - memory)
        for mine, other in zip(average.buffers(), network.buffers(), strict=True):
            mine.copy_(other)
