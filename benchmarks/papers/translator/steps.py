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

from benchmarks.papers.translator.crops import (
    RealPicture,
    TrainingCrop,
    TrainingRendering,
    random_real_crop,
    random_rendering_crop,
)
from facade_core.core.arrays import UInt8Array

if TYPE_CHECKING:
    from torch import Tensor
    from torch import device as TorchDevice  # noqa: N812
    from torch.optim import Optimizer

    from benchmarks.papers.translator.network import Discriminator, Generator, PatchEmbedding

TEMPERATURE = 0.07
PATCHES_PER_OUTPUT = 256
ADVERSARIAL_WEIGHT = 1.0
CONSISTENCY_WEIGHT = 10.0
# Of the difference from the viewpoint's translation alone where nothing is known; without it walls get stripes.
AGREEMENT_WEIGHT = 30.0
CONTRAST_RENDERED_WEIGHT = 0.5
CONTRAST_REAL_WEIGHT = 0.5
# Of squared differences between neighbouring cells of a grid; without it the transforms paint coloured clouds.
SMOOTHNESS_WEIGHT = 20.0
# Of the change of hue and saturation; without it the discriminator's swings colour plaster green and paving blue.
CHROMA_WEIGHT = 5.0
# Without normalisation one crop of sky alone could drive the output to white for good.
MAX_GRADIENT_NORM = 0.5


@dataclass(frozen=True, slots=True)
class TrainingRecipe:
    """Size of the network, length of its training and variants of the method.

    Attributes
    ----------
    width : channels of the first layer.
    steps : number of steps.
    batch : crops of either domain per step.
    check : steps between checkpoints.
    conditioned : input contains earlier texture.
    masked : consistency loss only where texture existed.
    equirectangular : first convolution on the sphere.
    merged : earlier texture and painted rendering in one RGB image.
    """

    width: int
    steps: int
    batch: int
    check: int
    conditioned: bool = True
    masked: bool = True
    equirectangular: bool = True
    merged: bool = True

    @property
    def bands(self) -> int:
        """Return the number of input channels."""
        return 4 if self.merged else 7


@dataclass(frozen=True)
class TrainingDomains:
    """Pictures to learn from and to evaluate by.

    Attributes
    ----------
    rendered, real : renderings and real pictures to learn from.
    judged_rendered, judged_real : renderings and real pictures of other places to evaluate by.
    """

    rendered: Sequence[TrainingRendering]
    real: Sequence[RealPicture]
    judged_rendered: Sequence[TrainingRendering]
    judged_real: Sequence[RealPicture]


class TrainingParts(TypedDict):
    """Networks of a training run with the optimisers of the generator's and of the discriminator's steps."""

    generator: Generator
    discriminator: Discriminator
    patches: PatchEmbedding
    first: Optimizer
    second: Optimizer


def step_unpaired(
    domains: TrainingDomains, recipe: TrainingRecipe, parts: TrainingParts, seeds: tuple[int, int], device: TorchDevice
) -> float:
    """Train the generator and the discriminator by one step.

    Returns
    -------
    The generator's loss.
    """
    import torch

    from benchmarks.papers.translator.network import apply_grid, reduce_image

    generator, discriminator, patches = parts["generator"], parts["discriminator"], parts["patches"]
    rng = np.random.default_rng(seeds)
    rendered = [random_rendering_crop(domains.rendered, rng) for _ in range(recipe.batch)]
    real = [random_real_crop(domains.real, rng) for _ in range(recipe.batch)]
    (plain, given, earlier), (photo, unknown, _) = crops_to_tensors(rendered, device), crops_to_tensors(real, device)
    rendered_places, real_places = [crop.place for crop in rendered], [crop.place for crop in real]
    partial, known, alone = simulate_earlier(generator, plain, given, earlier, rendered_places, recipe)
    with torch.no_grad():
        keys = generator.encode(_encoder_input(plain, recipe), rendered_places)
    inputs = torch.cat([stack_inputs(partial, plain, known, recipe), stack_inputs(photo, photo, unknown, recipe)])
    reduced = reduce_image(inputs)
    features = [reduced]
    places = [*rendered_places, *real_places]
    grids = generator.decode(generator.run_blocks(generator.gather_inputs(reduced, places), False, features), False)
    translated, restored = apply_grid(grids, torch.cat([partial, photo])).split(recipe.batch)
    photo_keys = [feature[recipe.batch :].detach() for feature in features]
    discriminator.requires_grad_(True)
    fake_score, real_score = discriminator(translated.detach()), discriminator(photo)
    loss = 0.5 * (fake_score.square().mean() + (real_score - 1).square().mean())
    _optimise(parts["second"], loss)
    discriminator.requires_grad_(False)
    total = ADVERSARIAL_WEIGHT * (discriminator(translated) - 1).square().mean()
    if recipe.conditioned:
        compared = known if recipe.masked else torch.ones_like(known)
        total = total + CONSISTENCY_WEIGHT * ((translated - partial) * compared).abs().mean()
        total = total + AGREEMENT_WEIGHT * ((translated - alone) * ~compared).abs().mean()
    total = total + CONTRAST_RENDERED_WEIGHT * _patch_contrast(
        generator, patches, translated, keys, rendered_places, recipe, rng
    )
    total = total + CONTRAST_REAL_WEIGHT * _patch_contrast(
        generator, patches, restored, photo_keys, real_places, recipe, rng
    )
    total = total + SMOOTHNESS_WEIGHT * _grid_roughness(grids)
    total = total + CHROMA_WEIGHT * (_chroma(translated) - _chroma(partial)).abs().mean()
    _optimise(parts["first"], total)
    return float(total.detach())


def _grid_roughness(grids: Tensor) -> Tensor:
    """Compute the mean squared difference between neighbouring transforms, in places and in brightness."""
    return sum(grids.diff(dim=axis).square().mean() for axis in (2, 3, 4))


def _chroma(image: Tensor) -> Tensor:
    """Return the colours less their mean over the bands."""
    return image - image.mean(1, keepdim=True)


def simulate_earlier(
    generator: Generator,
    plain: Tensor,
    given: Tensor,
    earlier: Tensor,
    places: Sequence[tuple[int, int]],
    recipe: TrainingRecipe,
) -> tuple[Tensor, Tensor, Tensor]:
    """Simulate what earlier viewpoints left: their translation, blurred once by the atlas.

    Returns
    -------
    partial : (n, 3, h, w) painted images with translated earlier parts.
    known : (n, 1, h, w) bool, given and earlier pixels.
    alone : (n, 3, h, w) translation without earlier parts, which the translation of the others agrees with.
    """
    import torch
    from torch.nn import functional

    from benchmarks.papers.translator.network import apply_grid, reduce_image

    if not recipe.conditioned:
        return plain, torch.zeros_like(given), plain
    with torch.no_grad():
        grids = generator(reduce_image(stack_inputs(plain, plain, given, recipe)), places)
        alone = apply_grid(grids, plain)
        blurred = functional.avg_pool2d(functional.pad(alone, (1, 1, 1, 1), mode="replicate"), 3, 1)
    return torch.where(earlier, blurred, plain), given | earlier, alone


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
        scores = query @ key.transpose(1, 2) / TEMPERATURE
        right = torch.arange(scores.shape[1], device=scores.device).expand(len(scores), -1)
        loss = loss + functional.cross_entropy(scores.flatten(0, 1), right.flatten())
    return loss / len(features)


def crops_to_tensors(crops: Sequence[TrainingCrop], device: TorchDevice) -> tuple[Tensor, Tensor, Tensor]:
    """Convert crops to images (n, 3, h, w) in -1..1, and masks of given and of earlier pixels (n, 1, h, w) bool."""
    import torch

    from benchmarks.papers.translator.network import image_to_tensor

    given, earlier = (
        torch.from_numpy(np.stack(masks))[:, None].to(device)
        for masks in zip(*((crop.given, crop.earlier) for crop in crops), strict=True)
    )
    return image_to_tensor(np.stack([crop.image for crop in crops])).to(device), given, earlier


def stack_inputs(partial: Tensor, plain: Tensor, known: Tensor, recipe: TrainingRecipe) -> Tensor:
    """Compose the generator's input: an image whose known pixels have their colours, and the mask of these.

    Not merged, it is known texture alone, the image without it, and the mask.
    """
    import torch

    mask = 2 * known.to(partial.dtype) - 1
    if recipe.merged:
        return torch.cat([partial, mask], 1)
    return torch.cat([torch.where(known, partial, -torch.ones_like(partial)), plain, mask], 1)


def _encoder_input(image: Tensor, recipe: TrainingRecipe) -> Tensor:
    """Compose the encoder's input of a fully textured image, reduced."""
    import torch

    from benchmarks.papers.translator.network import reduce_image

    everywhere = torch.ones_like(image[:, :1], dtype=torch.bool)
    return reduce_image(stack_inputs(image, image, everywhere, recipe))


def tensor_to_image(image: Tensor) -> UInt8Array:
    """Convert (3, h, w) in -1..1 to (h, w, 3) uint8."""
    pixels: UInt8Array = (
        ((image.float().cpu().permute(1, 2, 0).numpy() + 1) * 127.5).round().clip(0, 255).astype(np.uint8)
    )
    return pixels
