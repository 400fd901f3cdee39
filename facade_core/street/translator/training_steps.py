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
    Crop,
    Pair,
    Rendering,
    bare,
    paired_crop,
    real_crop,
    rendered_crop,
)

TEMPERATURE = 0.07
PATCHES = 256
ADVERSARIAL, CONSISTENCY, CONTRAST_RENDERED, CONTRAST_REAL = 1.0, 10.0, 0.5, 0.5
SUPERVISED = 10.0
# Gradients are no longer than this: without normalisation one crop of nothing but sky could end in all white for good.
LONGEST = 0.5


@dataclass(frozen=True, slots=True)
class Course:
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
class Domains:
    """Renderings and real panoramas (h, w, 3) uint8 to learn from, and those of other places to judge by; pairs to learn from,
    if any."""

    rendered: Sequence[Rendering]
    real: Sequence[np.ndarray]
    judged_rendered: Sequence[Rendering]
    judged_real: Sequence[np.ndarray]
    paired: Sequence[Pair] = ()


def restore(domains: Domains, course: Course, kept: Mapping[str, Any], seeds: tuple[int, int], device: Any) -> float:
    """One step of the generator alone: real crops from their light and from what an earlier viewpoint might have known of them.

    Not in the paper: it brings the colours of streets in minutes for which the losses below take a day on two cores.
    """
    import torch

    generator, rng = kept["generator"], np.random.default_rng(seeds)
    real = [real_crop(domains.real, course.crop, rng) for _ in range(course.batch)]
    known = [rendered_crop(domains.rendered, course.crop, rng).textured for _ in range(course.batch)]
    photo, _ = tensors(real, device)
    grey = [np.repeat(bare(crop.image)[..., None], 3, 2) for crop in real]
    plain, mask = tensors([Crop(g, k, c.place) for g, k, c in zip(grey, known, real, strict=True)], device)
    if not course.conditioned:
        mask = torch.zeros_like(mask)
    made = generator(seen_by(torch.where(mask, photo, plain), plain, mask, course), [crop.place for crop in real])
    loss = (made - photo).abs().mean()
    _descend(kept["first"], loss)
    return float(loss.detach())


def step(domains: Domains, course: Course, kept: Mapping[str, Any], seeds: tuple[int, int], device: Any) -> float:
    """One step of the generator and one of the discriminator; returns the generator's loss."""
    import torch
    from torch.nn import functional

    generator, discriminator, patches = kept["generator"], kept["discriminator"], kept["patches"]
    rng = np.random.default_rng(seeds)
    rendered = [rendered_crop(domains.rendered, course.crop, rng) for _ in range(course.batch)]
    real = [real_crop(domains.real, course.crop, rng) for _ in range(course.batch)]
    plain, mask = tensors(rendered, device)
    photo, _ = tensors(real, device)
    places = [crop.place for crop in (*rendered, *real)]
    own = places[: course.batch]
    mixed = torch.autocast(device.type, torch.bfloat16, enabled=device.type == "cuda")
    with mixed:
        with torch.no_grad():
            if not course.conditioned:
                mask = torch.zeros_like(mask)
            if mask.any():
                # what an earlier viewpoint made of this, once through the atlas: a little softer
                made = generator(seen_by(plain, plain, torch.zeros_like(mask), course), own)
                earlier = functional.avg_pool2d(functional.pad(made.float(), (1, 1, 1, 1), mode="replicate"), 3, 1)
                partial = torch.where(mask, earlier, plain)
            else:
                partial = plain
            keys = generator.encode(seen_by(plain, plain, torch.ones_like(mask), course), own)
        inputs = torch.cat([seen_by(partial, plain, mask, course), _with_grey(photo, course)])
        features = [inputs]
        encoded = generator.blocks_of(generator.entry(inputs, places), False, features)
        made, again = generator.decode(encoded, False).float().split(course.batch)
        photo_keys = [feature[course.batch :].detach() for feature in features]
        # the discriminator's turn
        discriminator.requires_grad_(True)
        wrong, right = discriminator(made.detach()), discriminator(photo)
        loss = 0.5 * (wrong.square().mean() + (right - 1).square().mean())
        _descend(kept["second"], loss)
        # the generator's
        discriminator.requires_grad_(False)
        total = ADVERSARIAL * (discriminator(made) - 1).square().mean()
        if course.conditioned:
            compared = mask if course.masked else torch.ones_like(mask)
            total = total + CONSISTENCY * ((made - partial) * compared).abs().mean()
        total = total + CONTRAST_RENDERED * _contrast(generator, patches, made, keys, own, course, rng)
        other = places[course.batch :]
        total = total + CONTRAST_REAL * _contrast(generator, patches, again, photo_keys, other, course, rng)
    _descend(kept["first"], total)
    return float(total.detach())


def supervise(domains: Domains, course: Course, kept: Mapping[str, Any], seeds: tuple[int, int], device: Any) -> float:
    """One step of the generator alone, by pairs: the distance to what is true, and the discriminator as it stands.

    Not in the paper, which has no pairs. What was textured earlier is the truth, once through the atlas."""
    import torch
    from torch.nn import functional

    generator, discriminator, rng = kept["generator"], kept["discriminator"], np.random.default_rng(seeds)
    found = [paired_crop(domains.paired, course.crop, rng) for _ in range(course.batch)]
    plain, mask = tensors([crop for crop, _, _ in found], device)
    photo, true = tensors([Crop(image, true, crop.place) for crop, image, true in found], device)
    if not course.conditioned:
        mask = torch.zeros_like(mask)
    discriminator.requires_grad_(False)
    mixed = torch.autocast(device.type, torch.bfloat16, enabled=device.type == "cuda")
    with mixed:
        earlier = functional.avg_pool2d(functional.pad(photo, (1, 1, 1, 1), mode="replicate"), 3, 1)
        partial = torch.where(mask, earlier, plain)
        made = generator(seen_by(partial, plain, mask, course), [crop.place for crop, _, _ in found]).float()
        apart = ((made - photo).abs() * true).sum() / (3 * true.sum()).clamp(min=1)
        total = SUPERVISED * apart + ADVERSARIAL * (discriminator(made) - 1).square().mean()
    _descend(kept["first"], total)
    return float(total.detach())


def _descend(optimiser: Any, loss: Any) -> None:
    """One step of an optimiser down a loss, along a gradient of LONGEST at most."""
    import torch

    optimiser.zero_grad()
    loss.backward()
    for group in optimiser.param_groups:
        torch.nn.utils.clip_grad_norm_(group["params"], LONGEST)
    optimiser.step()


def _contrast(
    generator: Any,
    patches: Any,
    made: Any,
    keys: Sequence[Any],
    places: Sequence[tuple[int, int]],
    course: Course,
    rng: np.random.Generator,
) -> Any:
    """Eq. 2: each patch of an output against the patch of the input at its place and those at other places."""
    import torch
    from torch.nn import functional

    features = generator.encode(_with_grey(made, course), places)
    where = []
    for feature in features:
        size = feature.shape[2] * feature.shape[3]
        where.append(torch.from_numpy(rng.choice(size, min(PATCHES, size), replace=False)).to(made.device))
    with torch.no_grad():
        targets = patches(keys, where)
    loss = 0.0
    for query, key in zip(patches(features, where), targets, strict=True):
        scores = query.float() @ key.float().transpose(1, 2) / TEMPERATURE
        right = torch.arange(scores.shape[1], device=scores.device).expand(len(scores), -1)
        loss = loss + functional.cross_entropy(scores.flatten(0, 1), right.flatten())
    return loss / len(features)


def tensors(crops: Sequence[Crop], device: Any) -> tuple[Any, Any]:
    """Images (n, 3, h, w) in -1..1 and masks (n, 1, h, w) bool."""
    import torch

    from facade_core.street.translator.network import as_input

    mask = torch.from_numpy(np.stack([crop.textured for crop in crops]))[:, None]
    return as_input(np.stack([crop.image for crop in crops])).to(device), mask.to(device)


def seen_by(partial: Any, bare: Any, mask: Any, course: Course) -> Any:
    """What the generator is given of a partially textured image: one RGB image, or texture and grey rendering apart."""
    import torch

    if course.merged:
        return partial
    return torch.cat([torch.where(mask, partial, -torch.ones_like(partial)), bare[:, :1]], 1)


def _with_grey(image: Any, course: Course) -> Any:
    """A fully textured image as the generator's encoder takes it."""
    import torch

    return image if course.merged else torch.cat([image, image.mean(1, keepdim=True)], 1)


def as_picture(image: Any) -> np.ndarray:
    """(3, h, w) in -1..1 into (h, w, 3) uint8."""
    return ((image.float().cpu().permute(1, 2, 0).numpy() + 1) * 127.5).round().clip(0, 255).astype(np.uint8)
