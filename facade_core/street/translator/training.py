"""Training of the translation network (street paper, 4 Training). Needs the `train` extra (torch).

Step n depends on the seed, on n and on the state before it only, so that a run that was interrupted and resumed ends in
the same weights as one that was not.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from facade_core.core.errors import ImageError, ModelError
from facade_core.street.translator.training_steps import (
    Course,
    Domains,
    as_picture,
    restore,
    seen_by,
    step,
    supervise,
    tensors,
)
from facade_core.street.translator.training_views import real_crop, rendered_crop

Progress = Callable[[str, int, int], None]
# What a checkpoint looks like: step, distance, pictures (h, w, 3) uint8 of inputs above outputs.
Sample = Callable[[int, float, np.ndarray], None]

RATE, BETAS = 2e-4, (0.5, 0.999)
WARM_RATE = 4e-4
# Share of the steps at the full rate: the paper's 150 of 200 epochs.
CONSTANT = 0.75
# Crops that a checkpoint is judged by, and seed of theirs.
_JUDGED, _JUDGED_SEED = 64, 12345


# An hour on one core that others use too; and for an accelerator.
SMALL = Course(width=32, steps=1800, warm=400, crop=(96, 192), batch=1, check=300)
FULL = Course(width=64, steps=150_000, warm=3000, crop=(256, 512), batch=4, check=2500)


@dataclass(frozen=True)
class Trained:
    """weights of the best checkpoint (name -> tensor), the step it was made at and its distance; the distance of each."""

    weights: Mapping[str, Any]
    step: int
    distance: float
    distances: Mapping[int, float]


def train(
    domains: Domains,
    course: Course,
    *,
    seed: int,
    state: Path | None = None,
    progress: Progress | None = None,
    sample: Sample | None = None,
) -> Trained:
    """Train a generator and return the checkpoint that is nearest to the real panoramas that were held out. Where there are
    pairs, every other step learns from them.

    state: file that keeps the run's state at every checkpoint, and is read when it is there and of the same run. Raises
    ImageError for an empty domain, ModelError for a state of another run, for a diverged run and where torch is missing.
    """
    require_torch()
    import torch

    from facade_core.street.translator.network import Discriminator, Generator, Patches, initialise

    for name, items in vars(domains).items():
        if name != "paired" and not len(items):
            raise ImageError(f"no pictures in {name}; give at least one place to learn from and one to judge by")
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    random = torch.Generator().manual_seed(seed)
    generator = Generator(course.width, bands=course.bands, equirectangular=course.equirectangular)
    discriminator, patches = Discriminator(course.width), Patches(course.width, course.bands)
    for network in (generator, discriminator, patches):
        initialise(network, random)
        network.to(device)
    first = torch.optim.Adam([*generator.parameters(), *patches.parameters()], lr=RATE, betas=BETAS)
    second = torch.optim.Adam(discriminator.parameters(), lr=RATE, betas=BETAS)
    kept = {
        "generator": generator,
        "discriminator": discriminator,
        "patches": patches,
        "first": first,
        "second": second,
    }
    identity = (
        f"{seed} {asdict(replace(course, steps=0))} {[len(items) for items in vars(domains).values() if len(items)]}"
    )
    done, distances = 0, dict[int, float]()
    best = copy.deepcopy(generator.state_dict())
    if state is not None and state.is_file():
        saved = _read_state(state, identity, course)
        for name, part in kept.items():
            part.load_state_dict(saved[name])
        done, distances, best = saved["done"], saved["distances"], saved["best"]
    report = progress or (lambda step, done, total: None)
    for number in range(done, course.steps):
        report("translator", number, course.steps)
        for optimiser in (first, second):
            for group in optimiser.param_groups:
                group["lr"] = WARM_RATE if number < course.warm else RATE * rate(number, course.steps)
        learn = restore if number < course.warm else supervise if domains.paired and number % 2 else step
        loss = learn(domains, course, kept, (seed, number), device)
        if not math.isfinite(loss):
            raise ModelError(f"training diverged at step {number}: train with another --seed")
        if (number + 1) % course.check == 0 or number + 1 == course.steps:
            distance, sheet = judge(generator, domains, course, device)
            if distance < min(distances.values(), default=math.inf):
                best = copy.deepcopy(generator.state_dict())
            distances[number + 1] = distance
            if sample:
                sample(number + 1, distance, sheet)
            if state is not None:
                parts = {name: part.state_dict() for name, part in kept.items()}
                rest = {"identity": identity, "steps": course.steps, "done": number + 1}
                rest |= {"distances": distances, "best": best}
                _save_state(state, parts | rest)
    at = min(distances, key=distances.__getitem__)
    return Trained({name: value.cpu() for name, value in best.items()}, at, distances[at], distances)


def require_torch() -> None:
    """Raise ModelError where torch is missing."""
    if find_spec("torch") is None:
        raise ModelError("training the translator needs torch; install the extra `train` (make train-setup)")


def rate(step: int, steps: int) -> float:
    """Share of the highest learning rate: constant, then falling straight to zero."""
    return min(1.0, (steps - step) / max(1.0, (1 - CONSTANT) * steps))


def judge(generator: Any, domains: Domains, course: Course, device: Any) -> tuple[float, np.ndarray]:
    """Kernel distance between what the generator makes of renderings held out and real crops held out, and a sheet of some.

    Every crop is translated bare and then, where it was known, once more on top of that, as a street does.
    """
    import torch

    from facade_core.street.translator.kernel_distance import features, kernel_distance

    rng = np.random.default_rng(_JUDGED_SEED)
    rendered = [rendered_crop(domains.judged_rendered, course.crop, rng) for _ in range(_JUDGED)]
    real = [real_crop(domains.judged_real, course.crop, rng) for _ in range(_JUDGED)]
    made = []
    with torch.no_grad():
        for crop in rendered:
            plain, mask = tensors([crop], device)
            if not course.conditioned:
                mask = torch.zeros_like(mask)
            out = generator(seen_by(plain, plain, torch.zeros_like(mask), course), [crop.place])
            if mask.any():
                partial = torch.where(mask, out, plain)
                out = generator(seen_by(partial, plain, mask, course), [crop.place])
            made.append(as_picture(out[0]))
    distance = kernel_distance(features(made), features([crop.image for crop in real]))
    sheet = [np.concatenate([crop.image, out]) for crop, out in zip(rendered[:8], made[:8], strict=True)]
    return distance, np.concatenate([np.concatenate(sheet[:4], 1), np.concatenate(sheet[4:], 1)])


def _read_state(path: Path, identity: str, course: Course) -> dict[str, Any]:
    import torch

    try:
        saved = torch.load(path, weights_only=True)
    except Exception as error:  # a broken archive raises whatever its reader came upon
        raise ModelError(f"{path}: not the state of a training run; remove it to start anew") from error
    # the number of steps may change while the rate has not begun to fall, for the old one or the new
    changed = saved["steps"] != course.steps and saved["done"] > CONSTANT * min(saved["steps"], course.steps)
    if saved["identity"] != identity or changed:
        raise ModelError(f"{path}: state of another training run; remove it or name another folder")
    return saved


def _save_state(path: Path, state: Mapping[str, Any]) -> None:
    """Replace the file in one go: a kill in the middle leaves the one before."""
    import torch

    path.parent.mkdir(parents=True, exist_ok=True)
    written = path.with_name(path.name + ".new")
    torch.save(dict(state), written)
    written.replace(path)
