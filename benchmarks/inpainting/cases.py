"""Facades with the holes that cut-outs of trees, cars and people make."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from training.datasets.facades import (
    CMP,
    ECP,
    DatasetRecipe,
    LabelledFacade,
    read_dataset,
    split_facades_for_training,
)

_SIDE = 720  # px, longest side of a facade that is measured
_LABELLED = 0.85  # share of a facade's pixels that must have a class
_SHARES = (0.08, 0.30)
# Heights of cut-outs as shares of the facade's, by what they show.
_HEIGHTS = {"tree": (0.35, 0.75), "car": (0.08, 0.16), "truck": (0.14, 0.2), "elec": (0.3, 0.6), "lamp": (0.3, 0.5)}
_OTHER = (0.1, 0.2)
_WIDEST = 0.6  # share of the facade's width


@dataclass(frozen=True, slots=True)
class Case:
    """A facade (H, W, 3) uint8 with true labels (H, W) uint8 and what is hidden of it, mask (H, W) bool."""

    name: str
    truth: np.ndarray
    labels: np.ndarray
    mask: np.ndarray

    @property
    def image(self) -> np.ndarray:
        """The facade, mid-grey where it is hidden."""
        return np.where(self.mask[..., None], np.uint8(128), self.truth)


def cases(data: Path, count: int = 40) -> Iterator[Case]:
    """Facades held out of the training of the parser and the layout model: of ecp as many as there are, at most half, the
    others of cmp, evenly spread over the sets; the same ones for the same count."""
    pieces = _pieces(data / "occluders")
    left = count
    for recipe, most in ((ECP, count // 2), (CMP, count)):
        facades = list(_clean(recipe, data / "facades" / recipe.name))
        share = min(len(facades), most, left)
        left -= share
        for number in np.linspace(0, len(facades) - 1, share).astype(int):
            facade = facades[number]
            rng = np.random.default_rng([len(facade.name), *facade.name.encode()])
            yield Case(
                f"{recipe.name}_{facade.name}", facade.image, facade.labels, hole(facade.labels.shape, pieces, rng)
            )


def _clean(recipe: DatasetRecipe, folder: Path) -> Iterator[LabelledFacade]:
    import cv2

    for facade in split_facades_for_training(list(read_dataset(recipe, folder)))[1]:
        share = np.bincount(facade.possible.ravel(), minlength=256)[:127].sum() / facade.labels.size
        if share < _LABELLED:
            continue
        scale = min(1.0, _SIDE / max(facade.labels.shape))
        size = round(facade.labels.shape[1] * scale), round(facade.labels.shape[0] * scale)
        image = np.asarray(cv2.resize(facade.image, size, interpolation=cv2.INTER_AREA), np.uint8)
        maps = [
            np.asarray(cv2.resize(of, size, interpolation=cv2.INTER_NEAREST), np.uint8)
            for of in (facade.labels, facade.possible, facade.occluder, facade.outside)
        ]
        yield LabelledFacade(facade.name, image, *maps)


def _pieces(folder: Path) -> dict[str, np.ndarray]:
    from PIL import Image

    return {path.stem: np.asarray(Image.open(path).convert("RGBA"))[..., 3] for path in sorted(folder.glob("*.png"))}


def hole(shape: tuple[int, int], pieces: dict[str, np.ndarray], rng: np.random.Generator) -> np.ndarray:
    """What cut-outs (h, w) uint8 alpha that stand on the bottom hide of an image: (H, W) bool, _SHARES of it."""
    import cv2

    mask = np.zeros(shape, bool)
    wanted = rng.uniform(_SHARES[0], 0.9 * _SHARES[1])
    names = sorted(pieces)
    for _ in range(200):
        name = names[rng.integers(len(names))]
        low, high = next((span for kind, span in _HEIGHTS.items() if name.startswith(kind)), _OTHER)
        high = shape[0] * rng.uniform(low, high)
        scale = min(high / pieces[name].shape[0], _WIDEST * shape[1] / pieces[name].shape[1])
        tall, wide = (max(1, round(side * scale)) for side in pieces[name].shape)
        alpha = cv2.resize(pieces[name], (wide, tall), interpolation=cv2.INTER_AREA) >= 64
        solid = cv2.dilate(alpha.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        left = int(rng.integers(-wide // 3, shape[1] - wide * 2 // 3 + 1))
        there = np.zeros(shape, bool)
        a, b = max(0, left), min(shape[1], left + wide)
        there[shape[0] - tall :, a:b] = solid[:, a - left : b - left]
        if (mask | there).mean() <= _SHARES[1]:
            mask |= there
        if mask.mean() >= wanted:
            break
    return mask
