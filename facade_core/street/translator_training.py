"""Training of the translation network (street paper, 4 Training). Needs the `train` extra (torch).

Step n depends on the seed, on n and on the state before it only, so that a run that was interrupted and resumed ends in
the same weights as one that was not. The adversarial loss is the least squares one of the method that the paper builds on:
as printed, E[1 - log d], it has no minimum that a discriminator could not push away.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from facade_core.errors import ImageError, ModelError
from facade_core.street.translator_views import Crop, Rendering, bare, real_crop, rendered_crop

Progress = Callable[[str, int, int], None]
# What a checkpoint looks like: step, distance, pictures (h, w, 3) uint8 of inputs above outputs.
Sample = Callable[[int, float, np.ndarray], None]

TEMPERATURE = 0.07
PATCHES = 256
ADVERSARIAL, CONSISTENCY, CONTRAST_RENDERED, CONTRAST_REAL = 1.0, 10.0, 0.5, 0.5
RATE, BETAS = 2e-4, (0.5, 0.999)
WARM_RATE = 4e-4
# Gradients are no longer than this: without normalisation one crop of nothing but sky could end in all white for good.
LONGEST = 0.5
# Share of the steps at the full rate: the paper's 150 of 200 epochs.
CONSTANT = 0.75
# Crops that a checkpoint is judged by, and seed of theirs.
_JUDGED, _JUDGED_SEED = 64, 12345


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


# An hour on two cores; and for an accelerator.
SMALL = Course(width=32, steps=750, warm=250, crop=(96, 192), batch=1, check=250)
FULL = Course(width=64, steps=150_000, warm=3000, crop=(256, 512), batch=4, check=2500)


@dataclass(frozen=True)
class Domains:
    """Renderings and real panoramas (h, w, 3) uint8 to learn from, and those of other places to judge by."""

    rendered: Sequence[Rendering]
    real: Sequence[np.ndarray]
    judged_rendered: Sequence[Rendering]
    judged_real: Sequence[np.ndarray]


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
    """Train a generator and return the checkpoint that is nearest to the real panoramas that were held out.

    state: file that keeps the run's state at every checkpoint, and is read when it is there and of the same run. Raises
    ImageError for an empty domain, ModelError for a state of another run, for a diverged run and where torch is missing.
    """
    try:
        import torch
    except ImportError as error:
        raise ModelError("training the translator needs torch; install the extra `train` (make train-setup)") from error
    from facade_core.street.translator_network import Discriminator, Generator, Patches, initialise

    for name, items in vars(domains).items():
        if not len(items):
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
    identity = f"{seed} {asdict(replace(course, steps=0))} {[len(items) for items in vars(domains).values()]}"
    done, distances = 0, dict[int, float]()
    best = copy.deepcopy(generator.state_dict())
    if state is not None and state.is_file():
        saved = _read_state(state, identity, course)
        for name, part in kept.items():
            part.load_state_dict(saved[name])
        done, distances, best = saved["done"], saved["distances"], saved["best"]
    report = progress or (lambda step, done, total: None)
    for step in range(done, course.steps):
        report("translator", step, course.steps)
        for optimiser in (first, second):
            for group in optimiser.param_groups:
                group["lr"] = WARM_RATE if step < course.warm else RATE * rate(step, course.steps)
        stage = _restore if step < course.warm else _step
        loss = stage(domains, course, kept, (seed, step), device)
        if not math.isfinite(loss):
            raise ModelError(f"training diverged at step {step}: train with another --seed")
        if (step + 1) % course.check == 0 or step + 1 == course.steps:
            distance, sheet = judge(generator, domains, course, device)
            if distance < min(distances.values(), default=math.inf):
                best = copy.deepcopy(generator.state_dict())
            distances[step + 1] = distance
            if sample:
                sample(step + 1, distance, sheet)
            if state is not None:
                parts = {name: part.state_dict() for name, part in kept.items()}
                rest = {
                    "identity": identity,
                    "steps": course.steps,
                    "done": step + 1,
                    "distances": distances,
                    "best": best,
                }
                _save_state(state, parts | rest)
    at = min(distances, key=distances.__getitem__)
    return Trained({name: value.cpu() for name, value in best.items()}, at, distances[at], distances)


def rate(step: int, steps: int) -> float:
    """Share of the highest learning rate: constant, then falling straight to zero."""
    return min(1.0, (steps - step) / max(1.0, (1 - CONSTANT) * steps))


def _restore(domains: Domains, course: Course, kept: Mapping[str, Any], seeds: tuple[int, int], device: Any) -> float:
    """One step of the generator alone: real crops from their light and from what an earlier viewpoint might have known of them.

    Not in the paper: it brings the colours of streets in minutes for which the losses below take a day on two cores.
    """
    import torch

    generator, rng = kept["generator"], np.random.default_rng(seeds)
    real = [real_crop(domains.real, course.crop, rng) for _ in range(course.batch)]
    known = [rendered_crop(domains.rendered, course.crop, rng).textured for _ in range(course.batch)]
    photo, _ = _tensors(real, device)
    grey = [np.repeat(bare(crop.image)[..., None], 3, 2) for crop in real]
    plain, mask = _tensors([Crop(g, k, c.place) for g, k, c in zip(grey, known, real, strict=True)], device)
    if not course.conditioned:
        mask = torch.zeros_like(mask)
    made = generator(seen_by(torch.where(mask, photo, plain), plain, mask, course), [crop.place for crop in real])
    loss = (made - photo).abs().mean()
    _descend(kept["first"], loss)
    return float(loss.detach())


def _step(domains: Domains, course: Course, kept: Mapping[str, Any], seeds: tuple[int, int], device: Any) -> float:
    """One step of the generator and one of the discriminator; returns the generator's loss."""
    import torch
    from torch.nn import functional

    generator, discriminator, patches = kept["generator"], kept["discriminator"], kept["patches"]
    rng = np.random.default_rng(seeds)
    rendered = [rendered_crop(domains.rendered, course.crop, rng) for _ in range(course.batch)]
    real = [real_crop(domains.real, course.crop, rng) for _ in range(course.batch)]
    plain, mask = _tensors(rendered, device)
    photo, _ = _tensors(real, device)
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


def _tensors(crops: Sequence[Crop], device: Any) -> tuple[Any, Any]:
    """Images (n, 3, h, w) in -1..1 and masks (n, 1, h, w) bool."""
    import torch

    from facade_core.street.translator_network import as_input

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


def judge(generator: Any, domains: Domains, course: Course, device: Any) -> tuple[float, np.ndarray]:
    """Kernel distance between what the generator makes of renderings held out and real crops held out, and a sheet of some.

    Every crop is translated bare and then, where it was known, once more on top of that, as a street does.
    """
    import torch

    from facade_core.street.translator_distance import features, kernel_distance

    rng = np.random.default_rng(_JUDGED_SEED)
    rendered = [rendered_crop(domains.judged_rendered, course.crop, rng) for _ in range(_JUDGED)]
    real = [real_crop(domains.judged_real, course.crop, rng) for _ in range(_JUDGED)]
    made = []
    with torch.no_grad():
        for crop in rendered:
            plain, mask = _tensors([crop], device)
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


def as_picture(image: Any) -> np.ndarray:
    """(3, h, w) in -1..1 into (h, w, 3) uint8."""
    return ((image.float().cpu().permute(1, 2, 0).numpy() + 1) * 127.5).round().clip(0, 255).astype(np.uint8)


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
