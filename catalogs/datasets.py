"""Labelled facade sets: where their files lie and how their label ids map to the seven classes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from facade_core.errors import ImageError, InputError
from facade_core.labels import BALCONY, DOOR, ROOF, SHOP, SKY, UNKNOWN, WALL, WINDOW


@dataclass(frozen=True, slots=True)
class LabelledFacade:
    """A rectified facade: image (H, W, 3) uint8 RGB and labels (H, W) uint8, class ids or UNKNOWN."""

    name: str
    image: np.ndarray
    labels: np.ndarray


@dataclass(frozen=True, slots=True)
class DatasetRecipe:
    """A set of images and label maps that share file stems.

    classes maps the set's ids to ours; ids that a file shows and the table lacks are an error. may_train says whether
    the licence lets weights trained on the set be shipped.
    """

    name: str
    images: str
    labels: str
    classes: Mapping[int, int]
    may_train: bool


_PARIS = {0: WALL, 1: WINDOW, 2: BALCONY, 3: DOOR, 4: ROOF, 5: SHOP, 6: SKY, 7: ROOF, 255: UNKNOWN}

ECP = DatasetRecipe("ecp", "images", "labels", _PARIS, may_train=True)
ARTDECO = DatasetRecipe("artdeco", "images", "labels", _PARIS, may_train=False)

RECIPES = {recipe.name: recipe for recipe in (ECP, ARTDECO)}

_IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png")


def ecp(folder: str | Path) -> Iterator[LabelledFacade]:
    """The 83 Haussmann facades of the ECP set; chimneys count as roof."""
    return read(ECP, folder)


def artdeco(folder: str | Path) -> Iterator[LabelledFacade]:
    """The 63 Art-Deco facades (Gadde et al. 2016), for evaluation only: no licence is stated."""
    return read(ARTDECO, folder)


def read(recipe: DatasetRecipe, folder: str | Path) -> Iterator[LabelledFacade]:
    """Read a set in the order of its file names.

    Raises InputError for a folder without the set's files and ImageError for a file that does not fit, both when the
    facade is reached.
    """
    folder = Path(folder)
    images = {path.stem: path for path in _image_files(folder / recipe.images)}
    labels = {path.stem: path for path in _image_files(folder / recipe.labels)}
    if not images:
        raise InputError(f"{folder}: no images in {recipe.images}/; give the folder of the {recipe.name} set")
    if images.keys() != labels.keys():
        odd = min(images.keys() ^ labels.keys())
        raise InputError(f"{folder}: {odd} has an image or a label map but not both; complete the pair or remove it")
    for name, path in images.items():
        image, label_map = _read_image(path, "RGB"), _read_image(labels[name], None)
        yield LabelledFacade(name, image, _map_labels(recipe, labels[name], label_map, image.shape[:2]))


def split(facades: Sequence[LabelledFacade], every: int = 5) -> tuple[list[LabelledFacade], list[LabelledFacade]]:
    """The fixed division for measuring: (training, held out), every fifth facade held out from the first on."""
    held_out = list(facades[::every])
    return [facade for index, facade in enumerate(facades) if index % every], held_out


def _image_files(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    return sorted(path for path in folder.iterdir() if path.suffix.lower() in _IMAGE_SUFFIXES)


def _read_image(path: Path, mode: str | None) -> np.ndarray:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as opened:
            return np.asarray(opened.convert(mode) if mode else opened)
    except (UnidentifiedImageError, OSError) as error:
        raise ImageError(f"{path}: cannot be read as an image; fetch it again or remove the pair") from error


def _map_labels(recipe: DatasetRecipe, path: Path, label_map: np.ndarray, size: tuple[int, ...]) -> np.ndarray:
    if label_map.dtype != np.uint8 or label_map.shape != size:
        raise ImageError(f"{path}: must be one byte a pixel at the image's size {size}, not {label_map.shape}")
    strange = sorted(set(np.unique(label_map).tolist()) - recipe.classes.keys())
    if strange:
        raise ImageError(f"{path}: label ids {strange} are not in the table of {recipe.name}; add or correct them")
    table = np.full(256, UNKNOWN, np.uint8)
    table[list(recipe.classes.keys())] = list(recipe.classes.values())
    return table[label_map]
