"""Single steps of training the translation network (street paper, 4 Training). Needs the `train` extra (torch).

The adversarial loss is the least squares one of the method that the paper builds on: as printed, E[1 - log d], it has no
minimum that a discriminator could not push away.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from facade_core.street.translator.training_views import (
    TrainingCrop,
    TrainingPair,
    TrainingRendering,
    imitate_rendering,
    crop_pair,
    crop_panorama,
    crop_rendering,
)

TEMPERATURE = 0.07
PATCHES_PER_OUTPUT = 256
ADVERSARIAL_WEIGHT, CONSISTENCY_WEIGHT, CONTRAST_RENDERED_WEIGHT, CONTRAST_REAL_WEIGHT = 1.0, 10.0, 0.5, 0.5
PAIR_WEIGHT = 10.0
# Gradients are no longer than this: without normalisation one crop of nothing but sky could end in all white for good.
MAX_GRADIENT_NORM = 0.5


@dataclass(frozen=True, slots=True)
class TrainingRecipe:
    """width: channels of the first layer; steps, of which the first `warm` only restore real crops; crop: (h, w) pixels; batch:
    crops of either domain in a step; check: steps between checkpoints. The paper's network is the default of the rest:
    conditioned on earlier texture, in one RGB image, masked."""

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
        return 3 if self.merged else 4


@dataclass(frozen=True)
class TrainingDomains:
    """Renderings and real panoramas (h, w, 3) uint8 to learn from, and those of other places to judge by; pairs to learn from,
    if any."""

    rendered: Sequence[TrainingRendering]
    real: Sequence[np.ndarray]
    judged_rendered: Sequence[TrainingRendering]
    judged_real: Sequence[np.ndarray]
    paired: Sequence[TrainingPair] = ()


def step_restoration(domains: TrainingDomains, recipe: TrainingRecipe, parts: Mapping[str, Any], seeds: tuple[int, int], device: Any) -> float:
    """One step of the generator alone: real crops from their light and from what an earlier viewpoint might have known of them.

    Not in the paper: it brings the colours of streets in minutes for which the losses below take a day on two cores.
    """
    import torch

    generator, rng = parts["generator"], np.random.default_rng(seeds)
    real = [crop_panorama(domains.real, recipe.crop, rng) for _ in range(recipe.batch)]
    known = [crop_rendering(domains.rendered, recipe.crop, rng).textured for _ in range(recipe.batch)]
    photo, _ = crops_to_tensors(real, device)
    grey = [np.repeat(imitate_rendering(crop.image)[..., None], 3, 2) for crop in real]
    plain, mask = crops_to_tensors([TrainingCrop(g, k, c.place) for g, k, c in zip(grey, known, real, strict=True)], device)
    if not recipe.conditioned:
        mask = torch.zeros_like(mask)
    made = generator(generator_input(torch.where(mask, photo, plain), plain, mask, recipe), [crop.place for crop in real])
    loss = (made - photo).abs().mean()
    _optimise(parts["first"], loss)
    return float(loss.detach())


def step_unpaired(domains: TrainingDomains, recipe: TrainingRecipe, parts: Mapping[str, Any], seeds: tuple[int, int], device: Any) -> float:
    """One step of the generator and one of the discriminator; returns the generator's loss."""
    import torch
    from torch.nn import functional

    generator, discriminator, patches = parts["generator"], parts["discriminator"], parts["patches"]
    rng = np.random.default_rng(seeds)
    rendered = [crop_rendering(domains.rendered, recipe.crop, rng) for _ in range(recipe.batch)]
    real = [crop_panorama(domains.real, recipe.crop, rng) for _ in range(recipe.batch)]
    plain, mask = crops_to_tensors(rendered, device)
    photo, _ = crops_to_tensors(real, device)
    places = [crop.place for crop in (*rendered, *real)]
    own = places[: recipe.batch]
    mixed = torch.autocast(device.type, torch.bfloat16, enabled=device.type == "cuda")
    with mixed:
        with torch.no_grad():
            if not recipe.conditioned:
                mask = torch.zeros_like(mask)
            if mask.any():
                # what an earlier viewpoint made of this, once through the atlas: a little softer
                made = generator(generator_input(plain, plain, torch.zeros_like(mask), recipe), own)
                earlier = functional.avg_pool2d(functional.pad(made.float(), (1, 1, 1, 1), mode="replicate"), 3, 1)
                partial = torch.where(mask, earlier, plain)
            else:
                partial = plain
            keys = generator.encode(generator_input(plain, plain, torch.ones_like(mask), recipe), own)
        inputs = torch.cat([generator_input(partial, plain, mask, recipe), _encoder_input(photo, recipe)])
        features = [inputs]
        encoded = generator.blocks_of(generator.entry(inputs, places), False, features)
        made, again = generator.decode(encoded, False).float().split(recipe.batch)
        photo_keys = [feature[recipe.batch :].detach() for feature in features]
        # the discriminator's turn
        discriminator.requires_grad_(True)
        wrong, right = discriminator(made.detach()), discriminator(photo)
        loss = 0.5 * (wrong.square().mean() + (right - 1).square().mean())
        _optimise(parts["second"], loss)
        # the generator's
        discriminator.requires_grad_(False)
        total = ADVERSARIAL_WEIGHT * (discriminator(made) - 1).square().mean()
        if recipe.conditioned:
            compared = mask if recipe.masked else torch.ones_like(mask)
            total = total + CONSISTENCY_WEIGHT * ((made - partial) * compared).abs().mean()
        total = total + CONTRAST_RENDERED_WEIGHT * _patch_contrast(generator, patches, made, keys, own, recipe, rng)
        other = places[recipe.batch :]
        total = total + CONTRAST_REAL_WEIGHT * _patch_contrast(generator, patches, again, photo_keys, other, recipe, rng)
    _optimise(parts["first"], total)
    return float(total.detach())


def step_paired(domains: TrainingDomains, recipe: TrainingRecipe, parts: Mapping[str, Any], seeds: tuple[int, int], device: Any) -> float:
    """One step of the generator alone, by pairs: the distance to what is true, and the discriminator as it stands.

    Not in the paper, which has no pairs. What was textured earlier is the truth, once through the atlas."""
    import torch
    from torch.nn import functional

    generator, discriminator, rng = parts["generator"], parts["discriminator"], np.random.default_rng(seeds)
    found = [crop_pair(domains.paired, recipe.crop, rng) for _ in range(recipe.batch)]
    plain, mask = crops_to_tensors([crop for crop, _, _ in found], device)
    photo, true = crops_to_tensors([TrainingCrop(image, true, crop.place) for crop, image, true in found], device)
    if not recipe.conditioned:
        mask = torch.zeros_like(mask)
    discriminator.requires_grad_(False)
    mixed = torch.autocast(device.type, torch.bfloat16, enabled=device.type == "cuda")
    with mixed:
        earlier = functional.avg_pool2d(functional.pad(photo, (1, 1, 1, 1), mode="replicate"), 3, 1)
        partial = torch.where(mask, earlier, plain)
        made = generator(generator_input(partial, plain, mask, recipe), [crop.place for crop, _, _ in found]).float()
        apart = ((made - photo).abs() * true).sum() / (3 * true.sum()).clamp(min=1)
        total = PAIR_WEIGHT * apart + ADVERSARIAL_WEIGHT * (discriminator(made) - 1).square().mean()
    _optimise(parts["first"], total)
    return float(total.detach())


def _optimise(optimiser: Any, loss: Any) -> None:
    """One step of an optimiser down a loss, along a gradient of MAX_GRADIENT_NORM at most."""
    import torch

    optimiser.zero_grad()
    loss.backward()
    for group in optimiser.param_groups:
        torch.nn.utils.clip_grad_norm_(group["params"], MAX_GRADIENT_NORM)
    optimiser.step()


def _patch_contrast(
    generator: Any,
    patches: Any,
    made: Any,
    keys: Sequence[Any],
    places: Sequence[tuple[int, int]],
    recipe: TrainingRecipe,
    rng: np.random.Generator,
) -> Any:
    """Eq. 2: each patch of an output against the patch of the input at its place and those at other places."""
    import torch
    from torch.nn import functional

    features = generator.encode(_encoder_input(made, recipe), places)
    where = []
    for feature in features:
        size = feature.shape[2] * feature.shape[3]
        where.append(torch.from_numpy(rng.choice(size, min(PATCHES_PER_OUTPUT, size), replace=False)).to(made.device))
    with torch.no_grad():
        targets = patches(keys, where)
    loss = 0.0
    for query, key in zip(patches(features, where), targets, strict=True):
        scores = query.float() @ key.float().transpose(1, 2) / TEMPERATURE
        right = torch.arange(scores.shape[1], device=scores.device).expand(len(scores), -1)
        loss = loss + functional.cross_entropy(scores.flatten(0, 1), right.flatten())
    return loss / len(features)


def crops_to_tensors(crops: Sequence[TrainingCrop], device: Any) -> tuple[Any, Any]:
    """Images (n, 3, h, w) in -1..1 and masks (n, 1, h, w) bool."""
    import torch

    from facade_core.street.translator.network import image_to_tensor

    mask = torch.from_numpy(np.stack([crop.textured for crop in crops]))[:, None]
    return image_to_tensor(np.stack([crop.image for crop in crops])).to(device), mask.to(device)


def generator_input(partial: Any, bare: Any, mask: Any, recipe: TrainingRecipe) -> Any:
    """What the generator is given of a partially textured image: one RGB image, or texture and grey rendering apart."""
    import torch

    if recipe.merged:
        return partial
    return torch.cat([torch.where(mask, partial, -torch.ones_like(partial)), bare[:, :1]], 1)


def _encoder_input(image: Any, recipe: TrainingRecipe) -> Any:
    """A fully textured image as the generator's encoder takes it."""
    import torch

    return image if recipe.merged else torch.cat([image, image.mean(1, keepdim=True)], 1)


def tensor_to_image(image: Any) -> np.ndarray:
    """(3, h, w) in -1..1 into (h, w, 3) uint8."""
    return ((image.float().cpu().permute(1, 2, 0).numpy() + 1) * 127.5).round().clip(0, 255).astype(np.uint8)
