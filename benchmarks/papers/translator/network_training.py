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
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.papers.translator.crops import random_real_crop, random_rendering_crop
from benchmarks.papers.translator.neural_translator import TRANSLATOR_VERSION
from benchmarks.papers.translator.steps import (
    TrainingDomains,
    TrainingParts,
    TrainingRecipe,
    crops_to_tensors,
    simulate_earlier,
    stack_inputs,
    step_unpaired,
    tensor_to_image,
)
from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import ImageError, ModelFileError
from training.progress import track_progress
from training.torch_files import read_state, require_torch, write_state

if TYPE_CHECKING:
    from torch import Tensor
    from torch import device as TorchDevice  # noqa: N812

    from benchmarks.papers.translator.network import Generator

# Called with step, distance, and pictures (h, w, 3) uint8 of inputs above outputs.
CheckpointCallback = Callable[[int, float, UInt8Array], None]

LEARNING_RATE = 2e-4
ADAM_BETAS = (0.5, 0.999)
# Share of the steps at the full rate: the paper's 150 of 200 epochs.
CONSTANT_RATE_SHARE = 0.75
# Largest share of the averaged weights that a step keeps; the losses' own weights swing between colours.
AVERAGE_DECAY = 0.998
_EVALUATION_CROPS = 64
_EVALUATION_SEED = 12345


# About ten minutes on an idle core.
RECIPE = TrainingRecipe(width=16, steps=1200, batch=4, check=300)


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


def train_generator(
    domains: TrainingDomains,
    recipe: TrainingRecipe,
    *,
    seed: int,
    state: Path | None = None,
    sample: CheckpointCallback | None = None,
) -> TranslatorCheckpoint:
    """Train a generator and return the checkpoint nearest to the held-out real panoramas.

    Parameters
    ----------
    domains : pictures to learn from and to evaluate by.
    recipe : size of the network and length of the training.
    seed : random seed.
    state : file that keeps the run's state at every checkpoint and resumes from it.
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

    from benchmarks.papers.translator.network import Discriminator, Generator, PatchEmbedding, initialise_weights

    for name, items in vars(domains).items():
        if not items:
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
    identity = f"{TRANSLATOR_VERSION} {seed} {asdict(replace(recipe, steps=0))} {_domains_digest(domains)}"
    done, distances = 0, dict[int, float]()
    average = copy.deepcopy(generator).requires_grad_(False)
    best = copy.deepcopy(average.state_dict())
    if state is not None and state.is_file():
        saved = _read_own_state(state, identity, recipe)
        generator.load_state_dict(saved["generator"])
        average.load_state_dict(saved["average"])
        discriminator.load_state_dict(saved["discriminator"])
        patches.load_state_dict(saved["patches"])
        first.load_state_dict(saved["first"])
        second.load_state_dict(saved["second"])
        done, distances, best = saved["done"], saved["distances"], saved["best"]
    for number in track_progress("translator", range(done, recipe.steps), recipe.steps, earlier=done):
        for optimiser in (first, second):
            for group in optimiser.param_groups:
                group["lr"] = LEARNING_RATE * learning_rate_share(number, recipe.steps)
        loss = step_unpaired(domains, recipe, parts, (seed, number), device)
        if not math.isfinite(loss):
            raise ModelFileError(f"training diverged at step {number}: train with another --seed")
        for kept, latest in zip(average.parameters(), generator.parameters(), strict=True):
            kept.lerp_(latest.detach(), 1 - min(AVERAGE_DECAY, (1 + number) / (10 + number)))
        if (number + 1) % recipe.check == 0 or number + 1 == recipe.steps:
            distance, sheet = evaluate_generator(average, domains, recipe, device)
            if distance < min(distances.values(), default=math.inf):
                best = copy.deepcopy(average.state_dict())
            distances[number + 1] = distance
            if sample:
                sample(number + 1, distance, sheet)
            if state is not None:
                write_state(
                    state,
                    {
                        "generator": generator.state_dict(),
                        "average": average.state_dict(),
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


def _domains_digest(domains: TrainingDomains) -> str:
    """Return a digest of all pictures of the domains."""
    digest = blake2b(digest_size=8)
    for items in vars(domains).values():
        for item in items:
            digest.update(np.ascontiguousarray(item.image).data)
    return digest.hexdigest()


def learning_rate_share(step: int, steps: int) -> float:
    """Return the share of the highest learning rate: constant, then linear to zero."""
    return min(1.0, (steps - step) / max(1.0, (1 - CONSTANT_RATE_SHARE) * steps))


def evaluate_generator(
    generator: Generator, domains: TrainingDomains, recipe: TrainingRecipe, device: TorchDevice
) -> tuple[float, UInt8Array]:
    """Compute the kernel distance of translated held-out renderings to held-out real crops.

    Known pixels keep their colours, as in a street.

    Returns
    -------
    The distance, and a sheet of samples (h, w, 3) uint8.
    """
    import torch

    from benchmarks.papers.translator.kernel_distance import image_features, kernel_distance
    from benchmarks.papers.translator.network import apply_grid, reduce_image

    rng = np.random.default_rng(_EVALUATION_SEED)
    rendered = [random_rendering_crop(domains.judged_rendered, rng) for _ in range(_EVALUATION_CROPS)]
    real = [random_real_crop(domains.judged_real, rng) for _ in range(_EVALUATION_CROPS)]
    translated = []
    with torch.no_grad():
        for crop in rendered:
            plain, given, earlier = crops_to_tensors([crop], device)
            partial, known, _ = simulate_earlier(generator, plain, given, earlier, [crop.place], recipe)
            grid = generator(reduce_image(stack_inputs(partial, plain, known, recipe)), [crop.place])
            kept = known if recipe.conditioned else given
            translated.append(tensor_to_image(torch.where(kept, partial, apply_grid(grid, partial))[0]))
    distance = kernel_distance(image_features(translated), image_features([crop.image for crop in real]))
    sheet = [np.concatenate([crop.image, out]) for crop, out in zip(rendered[:8], translated[:8], strict=True)]
    return distance, np.concatenate([np.concatenate(sheet[:4], 1), np.concatenate(sheet[4:], 1)])


def _read_own_state(path: Path, identity: str, recipe: TrainingRecipe) -> dict[str, Any]:
    saved = read_state(path)
    # the number of steps may change until the rate begins to fall
    changed = saved["steps"] != recipe.steps and saved["done"] > CONSTANT_RATE_SHARE * min(saved["steps"], recipe.steps)
    if saved["identity"] != identity or changed:
        raise ModelFileError(f"{path}: state of another training run; remove it or name another folder")
    return saved
