"""Single steps of training the translation network. Needs the `train` extra (torch).

The adversarial loss is least squares, as in the method that the paper builds on. The printed E[1 - log d] has no
minimum that a discriminator could not push away.

References
----------
Street paper, 4 Training.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypedDict

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.street.translator.training_views import (
    TrainingCrop,
    TrainingPair,
    TrainingRendering,
    imitate_rendering,
    random_pair_crop,
    random_panorama_crop,
    random_rendering_crop,
)

if TYPE_CHECKING:
    from torch import Tensor
    from torch import device as TorchDevice  # noqa: N812
    from torch.optim import Optimizer

    from facade_core.street.translator.network import Discriminator, Generator, PatchEmbedding

TEMPERATURE = 0.07
PATCHES_PER_OUTPUT = 256
ADVERSARIAL_WEIGHT = 1.0
CONSISTENCY_WEIGHT = 10.0
CONTRAST_RENDERED_WEIGHT = 0.5
CONTRAST_REAL_WEIGHT = 0.5
PAIR_WEIGHT = 10.0
# Without normalisation one crop of sky alone could drive the output to white for good.
MAX_GRADIENT_NORM = 0.5


@dataclass(frozen=True, slots=True)
class TrainingRecipe:
    """Size of the network, length of its training and variants of the method.

    Attributes
    ----------
    width : channels of the first layer.
    steps : number of steps.
    warm : number of first steps that only restore real crops.
    crop : height and width, pixels.
    batch : crops of either domain per step.
    check : steps between checkpoints.
    conditioned : input contains earlier texture.
    masked : consistency loss only where texture existed.
    equirectangular : first convolution on the sphere.
    merged : texture and grey rendering in one RGB image.
    """

    width: int
    steps: int
    warm: int
    crop: tuple[int, int]
    batch: int
    check: int
    conditioned: bool = True
    masked: bool = True
    equirectangular: bool = True
    merged: bool = True

    @property
    def bands(self) -> int:
        """Return the number of input channels."""
        return 3 if self.merged else 4


@dataclass(frozen=True)
class TrainingDomains:
    """Pictures to learn from and to evaluate by.

    Attributes
    ----------
    rendered, real : renderings and real panoramas (h, w, 3) uint8 to learn from.
    judged_rendered, judged_real : renderings and panoramas of other places to evaluate by.
    paired : pairs to learn from.
    """

    rendered: Sequence[TrainingRendering]
    real: Sequence[UInt8Array]
    judged_rendered: Sequence[TrainingRendering]
    judged_real: Sequence[UInt8Array]
    paired: Sequence[TrainingPair] = ()


class TrainingParts(TypedDict):
    """Networks of a training run with the optimisers of the generator's and of the discriminator's steps."""

    generator: Generator
    discriminator: Discriminator
    patches: PatchEmbedding
    first: Optimizer
    second: Optimizer


def step_restoration(
    domains: TrainingDomains, recipe: TrainingRecipe, parts: TrainingParts, seeds: tuple[int, int], device: TorchDevice
) -> float:
    """Train the generator alone to restore real crops from their shading.

    Crops keep simulated earlier texture. Not in the paper: this step learns street colours in minutes that take the
    losses of `step_unpaired` a day on two cores.

    Returns
    -------
    The loss.
    """
    import torch

    generator, rng = parts["generator"], np.random.default_rng(seeds)
    real = [random_panorama_crop(domains.real, recipe.crop, rng) for _ in range(recipe.batch)]
    known = [random_rendering_crop(domains.rendered, recipe.crop, rng).textured for _ in range(recipe.batch)]
    photo, _ = crops_to_tensors(real, device)
    grey = [np.repeat(imitate_rendering(crop.image)[..., None], 3, 2) for crop in real]
    plain, mask = crops_to_tensors(
        [TrainingCrop(g, k, c.place) for g, k, c in zip(grey, known, real, strict=True)], device
    )
    if not recipe.conditioned:
        mask = torch.zeros_like(mask)
    restored = generator(
        stack_texture_and_grey(torch.where(mask, photo, plain), plain, mask, recipe), [crop.place for crop in real]
    )
    loss = (restored - photo).abs().mean()
    _optimise(parts["first"], loss)
    return float(loss.detach())


def step_unpaired(
    domains: TrainingDomains, recipe: TrainingRecipe, parts: TrainingParts, seeds: tuple[int, int], device: TorchDevice
) -> float:
    """Train the generator and the discriminator by one unpaired step.

    Returns
    -------
    The generator's loss.
    """
    import torch
    from torch.nn import functional

    generator, discriminator, patches = parts["generator"], parts["discriminator"], parts["patches"]
    rng = np.random.default_rng(seeds)
    rendered = [random_rendering_crop(domains.rendered, recipe.crop, rng) for _ in range(recipe.batch)]
    real = [random_panorama_crop(domains.real, recipe.crop, rng) for _ in range(recipe.batch)]
    plain, mask = crops_to_tensors(rendered, device)
    photo, _ = crops_to_tensors(real, device)
    places = [crop.place for crop in (*rendered, *real)]
    rendered_places = places[: recipe.batch]
    mixed = torch.autocast(device.type, torch.bfloat16, enabled=device.type == "cuda")
    with mixed:
        with torch.no_grad():
            if not recipe.conditioned:
                mask = torch.zeros_like(mask)
            if mask.any():
                # simulate an earlier viewpoint's output, blurred once by the atlas
                translated = generator(
                    stack_texture_and_grey(plain, plain, torch.zeros_like(mask), recipe), rendered_places
                )
                earlier = functional.avg_pool2d(
                    functional.pad(translated.float(), (1, 1, 1, 1), mode="replicate"), 3, 1
                )
                partial = torch.where(mask, earlier, plain)
            else:
                partial = plain
            keys = generator.encode(
                stack_texture_and_grey(plain, plain, torch.ones_like(mask), recipe), rendered_places
            )
        inputs = torch.cat([stack_texture_and_grey(partial, plain, mask, recipe), _encoder_input(photo, recipe)])
        features = [inputs]
        encoded = generator.run_blocks(generator.gather_inputs(inputs, places), False, features)
        translated, restored = generator.decode(encoded, False).float().split(recipe.batch)
        photo_keys = [feature[recipe.batch :].detach() for feature in features]
        discriminator.requires_grad_(True)
        fake_score, real_score = discriminator(translated.detach()), discriminator(photo)
        loss = 0.5 * (fake_score.square().mean() + (real_score - 1).square().mean())
        _optimise(parts["second"], loss)
        discriminator.requires_grad_(False)
        total = ADVERSARIAL_WEIGHT * (discriminator(translated) - 1).square().mean()
        if recipe.conditioned:
            compared = mask if recipe.masked else torch.ones_like(mask)
            total = total + CONSISTENCY_WEIGHT * ((translated - partial) * compared).abs().mean()
        total = total + CONTRAST_RENDERED_WEIGHT * _patch_contrast(
            generator, patches, translated, keys, rendered_places, recipe, rng
        )
        other = places[recipe.batch :]
        total = total + CONTRAST_REAL_WEIGHT * _patch_contrast(
            generator, patches, restored, photo_keys, other, recipe, rng
        )
    _optimise(parts["first"], total)
    return float(total.detach())


def step_paired(
    domains: TrainingDomains, recipe: TrainingRecipe, parts: TrainingParts, seeds: tuple[int, int], device: TorchDevice
) -> float:
    """Train the generator alone on pairs, with a fixed discriminator.

    The loss is the distance to the true image and the discriminator's score. Not in the paper, which has no pairs.
    Earlier texture is simulated by the true image, blurred once as by the atlas.

    Returns
    -------
    The loss.
    """
    import torch
    from torch.nn import functional

    generator, discriminator, rng = parts["generator"], parts["discriminator"], np.random.default_rng(seeds)
    pairs = [random_pair_crop(domains.paired, recipe.crop, rng) for _ in range(recipe.batch)]
    plain, mask = crops_to_tensors([crop for crop, _, _ in pairs], device)
    photo, valid = crops_to_tensors([TrainingCrop(image, valid, crop.place) for crop, image, valid in pairs], device)
    if not recipe.conditioned:
        mask = torch.zeros_like(mask)
    discriminator.requires_grad_(False)
    mixed = torch.autocast(device.type, torch.bfloat16, enabled=device.type == "cuda")
    with mixed:
        earlier = functional.avg_pool2d(functional.pad(photo, (1, 1, 1, 1), mode="replicate"), 3, 1)
        partial = torch.where(mask, earlier, plain)
        translated = generator(
            stack_texture_and_grey(partial, plain, mask, recipe), [crop.place for crop, _, _ in pairs]
        ).float()
        distance = ((translated - photo).abs() * valid).sum() / (3 * valid.sum()).clamp(min=1)
        total = PAIR_WEIGHT * distance + ADVERSARIAL_WEIGHT * (discriminator(translated) - 1).square().mean()
    _optimise(parts["first"], total)
    return float(total.detach())


def _optimise(optimiser: Optimizer, loss: Tensor) -> None:
    """Descend a loss by one optimiser step with gradients clipped to MAX_GRADIENT_NORM."""
    import torch

    optimiser.zero_grad()
    loss.backward()
    for group in optimiser.param_groups:
        torch.nn.utils.clip_grad_norm_(group["params"], MAX_GRADIENT_NORM)
    optimiser.step()


def _patch_contrast(
    generator: Generator,
    patches: PatchEmbedding,
    translated: Tensor,
    keys: Sequence[Tensor],
    places: Sequence[tuple[int, int]],
    recipe: TrainingRecipe,
    rng: np.random.Generator,
) -> Tensor:
    """Compute Eq. 2: each output patch against the input patch at its place and at other places."""
    import torch
    from torch.nn import functional

    features = generator.encode(_encoder_input(translated, recipe), places)
    positions = []
    for feature in features:
        size = feature.shape[2] * feature.shape[3]
        positions.append(
            torch.from_numpy(rng.choice(size, min(PATCHES_PER_OUTPUT, size), replace=False)).to(translated.device)
        )
    with torch.no_grad():
        targets = patches(keys, positions)
    loss = 0.0
    for query, key in zip(patches(features, positions), targets, strict=True):
        scores = query.float() @ key.float().transpose(1, 2) / TEMPERATURE
        right = torch.arange(scores.shape[1], device=scores.device).expand(len(scores), -1)
        loss = loss + functional.cross_entropy(scores.flatten(0, 1), right.flatten())
    return loss / len(features)


def crops_to_tensors(crops: Sequence[TrainingCrop], device: TorchDevice) -> tuple[Tensor, Tensor]:
    """Convert crops to images (n, 3, h, w) in -1..1 and masks (n, 1, h, w) bool."""
    import torch

    from facade_core.street.translator.network import image_to_tensor

    mask = torch.from_numpy(np.stack([crop.textured for crop in crops]))[:, None]
    return image_to_tensor(np.stack([crop.image for crop in crops])).to(device), mask.to(device)


def stack_texture_and_grey(partial: Tensor, bare: Tensor, mask: Tensor, recipe: TrainingRecipe) -> Tensor:
    """Compose the generator's input of a partially textured image.

    It is one RGB image, or texture and grey rendering as separate channels.
    """
    import torch

    if recipe.merged:
        return partial
    return torch.cat([torch.where(mask, partial, -torch.ones_like(partial)), bare[:, :1]], 1)


def _encoder_input(image: Tensor, recipe: TrainingRecipe) -> Tensor:
    """Compose the encoder's input of a fully textured image."""
    import torch

    return image if recipe.merged else torch.cat([image, image.mean(1, keepdim=True)], 1)


def tensor_to_image(image: Tensor) -> UInt8Array:
    """Convert (3, h, w) in -1..1 to (h, w, 3) uint8."""
    pixels: UInt8Array = (
        ((image.float().cpu().permute(1, 2, 0).numpy() + 1) * 127.5).round().clip(0, 255).astype(np.uint8)
    )
    return pixels
