"""Training of the translation network. Needs the `train` extra (torch).

Step n depends only on the seed, on n and on the previous state, so that a resumed run ends in the same weights.

References
----------
Street paper, 4 Training.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import ImageError, ModelFileError
from facade_core.street.translator.training_steps import (
    TrainingDomains,
    TrainingParts,
    TrainingRecipe,
    crops_to_tensors,
    stack_texture_and_grey,
    step_paired,
    step_restoration,
    step_unpaired,
    tensor_to_image,
)
from facade_core.street.translator.training_views import random_panorama_crop, random_rendering_crop

if TYPE_CHECKING:
    from torch import Tensor
    from torch import device as TorchDevice  # noqa: N812

    from facade_core.street.translator.network import Generator

Progress = Callable[[str, int, int], None]
# Called with step, distance, and pictures (h, w, 3) uint8 of inputs above outputs.
CheckpointCallback = Callable[[int, float, UInt8Array], None]

LEARNING_RATE = 2e-4
ADAM_BETAS = (0.5, 0.999)
WARMUP_RATE = 4e-4
# Share of the steps at the full rate: the paper's 150 of 200 epochs.
CONSTANT_RATE_SHARE = 0.75
_EVALUATION_CROPS = 64
_EVALUATION_SEED = 12345


# One hour on a shared core, and a recipe for an accelerator.
SMALL_RECIPE = TrainingRecipe(width=32, steps=1800, warm=400, crop=(96, 192), batch=1, check=300)
FULL_RECIPE = TrainingRecipe(width=64, steps=150_000, warm=3000, crop=(256, 512), batch=4, check=2500)


@dataclass(frozen=True)
class TranslatorCheckpoint:
    """Best checkpoint of a training run.

    Attributes
    ----------
    weights : name -> tensor.
    step : step of the checkpoint.
    distance : its kernel distance.
    distances : kernel distance of every checkpoint by step.
    """

    weights: Mapping[str, Tensor]
    step: int
    distance: float
    distances: Mapping[int, float]


class _TrainingState(TypedDict):
    """State of a run in its file: states of the `TrainingParts`, `done` of `steps`, distances and best weights."""

    generator: dict[str, Tensor]
    discriminator: dict[str, Tensor]
    patches: dict[str, Tensor]
    first: dict[str, object]
    second: dict[str, object]
    identity: str
    steps: int
    done: int
    distances: dict[int, float]
    best: dict[str, Tensor]


def train_generator(
    domains: TrainingDomains,
    recipe: TrainingRecipe,
    *,
    seed: int,
    state: Path | None = None,
    progress: Progress | None = None,
    sample: CheckpointCallback | None = None,
) -> TranslatorCheckpoint:
    """Train a generator and return the checkpoint nearest to the held-out real panoramas.

    With pairs every other step learns from them.

    Parameters
    ----------
    domains : pictures to learn from and to evaluate by.
    recipe : size of the network and length of the training.
    seed : random seed.
    state : file that keeps the run's state at every checkpoint and resumes from it.
    progress : called before each step.
    sample : called at each checkpoint.

    Raises
    ------
    ImageError
        A domain is empty.
    ModelError
        The state belongs to another run, training diverged, or torch is missing.
    """
    require_torch()
    import torch

    from facade_core.street.translator.network import Discriminator, Generator, PatchEmbedding, initialise_weights

    for name, items in vars(domains).items():
        if name != "paired" and not len(items):
            raise ImageError(f"no pictures in {name}; give at least one place to learn from and one to judge by")
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    random = torch.Generator().manual_seed(seed)
    generator = Generator(recipe.width, bands=recipe.bands, equirectangular=recipe.equirectangular)
    discriminator, patches = Discriminator(recipe.width), PatchEmbedding(recipe.width, recipe.bands)
    for network in (generator, discriminator, patches):
        initialise_weights(network, random)
        network.to(device)
    first = torch.optim.Adam([*generator.parameters(), *patches.parameters()], lr=LEARNING_RATE, betas=ADAM_BETAS)
    second = torch.optim.Adam(discriminator.parameters(), lr=LEARNING_RATE, betas=ADAM_BETAS)
    parts: TrainingParts = {
        "generator": generator,
        "discriminator": discriminator,
        "patches": patches,
        "first": first,
        "second": second,
    }
    identity = (
        f"{seed} {asdict(replace(recipe, steps=0))} {[len(items) for items in vars(domains).values() if len(items)]}"
    )
    done, distances = 0, dict[int, float]()
    best = copy.deepcopy(generator.state_dict())
    if state is not None and state.is_file():
        saved = _read_state(state, identity, recipe)
        generator.load_state_dict(saved["generator"])
        discriminator.load_state_dict(saved["discriminator"])
        patches.load_state_dict(saved["patches"])
        first.load_state_dict(saved["first"])
        second.load_state_dict(saved["second"])
        done, distances, best = saved["done"], saved["distances"], saved["best"]
    report = progress or (lambda step, done, total: None)
    for number in range(done, recipe.steps):
        report("translator", number, recipe.steps)
        for optimiser in (first, second):
            for group in optimiser.param_groups:
                group["lr"] = (
                    WARMUP_RATE if number < recipe.warm else LEARNING_RATE * learning_rate_share(number, recipe.steps)
                )
        learn = (
            step_restoration
            if number < recipe.warm
            else step_paired
            if domains.paired and number % 2
            else step_unpaired
        )
        loss = learn(domains, recipe, parts, (seed, number), device)
        if not math.isfinite(loss):
            raise ModelFileError(f"training diverged at step {number}: train with another --seed")
        if (number + 1) % recipe.check == 0 or number + 1 == recipe.steps:
            distance, sheet = evaluate_generator(generator, domains, recipe, device)
            if distance < min(distances.values(), default=math.inf):
                best = copy.deepcopy(generator.state_dict())
            distances[number + 1] = distance
            if sample:
                sample(number + 1, distance, sheet)
            if state is not None:
                _save_state(
                    state,
                    {
                        "generator": generator.state_dict(),
                        "discriminator": discriminator.state_dict(),
                        "patches": patches.state_dict(),
                        "first": first.state_dict(),
                        "second": second.state_dict(),
                        "identity": identity,
                        "steps": recipe.steps,
                        "done": number + 1,
                        "distances": distances,
                        "best": best,
                    },
                )
    best_step = min(distances, key=distances.__getitem__)
    return TranslatorCheckpoint(
        {name: value.cpu() for name, value in best.items()}, best_step, distances[best_step], distances
    )


def require_torch() -> None:
    """Raise ModelError if torch is missing."""
    if find_spec("torch") is None:
        raise ModelFileError("training the translator needs torch; install the extra `train` (make train-setup)")


def learning_rate_share(step: int, steps: int) -> float:
    """Return the share of the highest learning rate: constant, then linear to zero."""
    return min(1.0, (steps - step) / max(1.0, (1 - CONSTANT_RATE_SHARE) * steps))


def evaluate_generator(
    generator: Generator, domains: TrainingDomains, recipe: TrainingRecipe, device: TorchDevice
) -> tuple[float, UInt8Array]:
    """Compute the kernel distance of translated held-out renderings to held-out real crops.

    Each crop is translated without texture and then, where it had texture, once more on top of the result, as in a
    street.

    Returns
    -------
    The distance, and a sheet of samples (h, w, 3) uint8.
    """
    import torch

    from facade_core.street.translator.kernel_distance import image_features, kernel_distance

    rng = np.random.default_rng(_EVALUATION_SEED)
    rendered = [random_rendering_crop(domains.judged_rendered, recipe.crop, rng) for _ in range(_EVALUATION_CROPS)]
    real = [random_panorama_crop(domains.judged_real, recipe.crop, rng) for _ in range(_EVALUATION_CROPS)]
    translated = []
    with torch.no_grad():
        for crop in rendered:
            plain, mask = crops_to_tensors([crop], device)
            if not recipe.conditioned:
                mask = torch.zeros_like(mask)
            out = generator(stack_texture_and_grey(plain, plain, torch.zeros_like(mask), recipe), [crop.place])
            if mask.any():
                partial = torch.where(mask, out, plain)
                out = generator(stack_texture_and_grey(partial, plain, mask, recipe), [crop.place])
            translated.append(tensor_to_image(out[0]))
    distance = kernel_distance(image_features(translated), image_features([crop.image for crop in real]))
    sheet = [np.concatenate([crop.image, out]) for crop, out in zip(rendered[:8], translated[:8], strict=True)]
    return distance, np.concatenate([np.concatenate(sheet[:4], 1), np.concatenate(sheet[4:], 1)])


def _read_state(path: Path, identity: str, recipe: TrainingRecipe) -> _TrainingState:
    import torch

    try:
        saved: _TrainingState = torch.load(path, weights_only=True)
    except Exception as error:  # a broken archive can raise any error
        raise ModelFileError(f"{path}: not the state of a training run; remove it to start anew") from error
    # the number of steps may change until the rate begins to fall
    changed = saved["steps"] != recipe.steps and saved["done"] > CONSTANT_RATE_SHARE * min(saved["steps"], recipe.steps)
    if saved["identity"] != identity or changed:
        raise ModelFileError(f"{path}: state of another training run; remove it or name another folder")
    return saved


def _save_state(path: Path, state: _TrainingState) -> None:
    """Replace the file atomically: a kill leaves the previous one."""
    import torch

    path.parent.mkdir(parents=True, exist_ok=True)
    written = path.with_name(path.name + ".new")
    torch.save(dict(state), written)
    written.replace(path)
