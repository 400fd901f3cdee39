"""Labelled photo sets: folders, and the meaning of their label ids in terms of the seven classes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from catalogs.reader_errors import short_message
from catalogs.readers.json_text import parse_json_object
from catalogs.readers.pictures.decoding import open_picture
from facade_core.core.arrays import AnyArray, UInt8Array
from facade_core.core.errors import ImageError, InputError
from facade_core.core.json_types import JsonObject
from facade_core.core.labels import CLASSES, UNKNOWN, FacadeClass
from facade_core.core.regular_files import MAX_TEXT_BYTES, read_regular

T = TypeVar("T")

# Bit mask of a pixel that may be of any class.
ANY_CLASS = (1 << len(CLASSES)) - 1


@dataclass(frozen=True, slots=True)
class LabelledFacade:
    """Labelled photo.

    Attributes
    ----------
    image : (H, W, 3) uint8 RGB.
    labels : (H, W) uint8 class ids, UNKNOWN where the set does not state one.
    possible : (H, W) uint8; bit i is set where class i may be, all bits where nothing is stated.
    occluder : (H, W) uint8; 1 in front of the facade, 0 not, else UNKNOWN.
    outside : (H, W) uint8; 1 on sky, street or neighbours, 0 on or behind the facade, else UNKNOWN.
    """

    name: str
    image: UInt8Array
    labels: UInt8Array
    possible: UInt8Array
    occluder: UInt8Array
    outside: UInt8Array


@dataclass(frozen=True, slots=True)
class LabelMeaning:
    """Meaning of a set's label id.

    Attributes
    ----------
    classes : classes that its pixels may have; empty if not stated.
    occluder : whether its pixels show something in front of the facade; None if not stated.
    outside : whether its pixels show something next to the facade; implied by the class sky.
    """

    classes: tuple[int, ...] = ()
    occluder: bool | None = None
    outside: bool = False

    @property
    def label_map_values(self) -> tuple[int, int, int, int]:
        """Return the values of LabelledFacade's labels, possible, occluder and outside."""
        label = self.classes[0] if len(self.classes) == 1 else UNKNOWN
        possible = sum(1 << number for number in self.classes) or ANY_CLASS
        outside = 1 if self.outside or self.classes == (FacadeClass.SKY,) else 0 if self.classes else UNKNOWN
        return label, possible, UNKNOWN if self.occluder is None else int(self.occluder), outside


@dataclass(frozen=True, slots=True)
class DatasetRecipe:
    """Set of pictures in images/ and label maps in labels/ that share file stems.

    Attributes
    ----------
    name : name of the set.
    classes : meaning of each id; ids that a file holds and the table lacks are an error.
    may_train : whether the licence allows shipping weights trained on the set.
    """

    name: str
    classes: Mapping[int, LabelMeaning]
    may_train: bool


def _visible_classes(*classes: int) -> LabelMeaning:
    return LabelMeaning(classes, occluder=False)


_UNLABELLED = LabelMeaning()
_OCCLUDER = LabelMeaning(occluder=True)
_PARIS_LABELS: dict[int, LabelMeaning] = {
    **{
        number: _visible_classes(number)
        for number in (
            FacadeClass.WALL,
            FacadeClass.WINDOW,
            FacadeClass.BALCONY,
            FacadeClass.DOOR,
            FacadeClass.ROOF,
            FacadeClass.SHOP,
            FacadeClass.SKY,
        )
    },
    7: _visible_classes(FacadeClass.ROOF),  # chimneys
    255: _UNLABELLED,
}

ECP = DatasetRecipe("ecp", _PARIS_LABELS, may_train=True)
# Its labels ignore trees and cars, so occluders are unknown.
ARTDECO = DatasetRecipe(
    "artdeco",
    {number: LabelMeaning(told.classes) for number, told in _PARIS_LABELS.items()},
    may_train=False,
)
# Facades of many styles, without classes for sky and roof; ornament is wall, shutters and cornices are ambiguous.
CMP = DatasetRecipe(
    "cmp",
    {
        1: LabelMeaning(outside=True),  # sky, neighbours, street
        2: LabelMeaning((FacadeClass.WALL,)),
        3: LabelMeaning((FacadeClass.WINDOW,)),
        4: LabelMeaning((FacadeClass.DOOR,)),
        5: LabelMeaning((FacadeClass.WALL, FacadeClass.ROOF)),  # cornice
        6: LabelMeaning((FacadeClass.WALL, FacadeClass.BALCONY)),  # sill
        7: LabelMeaning((FacadeClass.BALCONY,)),
        8: LabelMeaning((FacadeClass.WINDOW, FacadeClass.WALL)),  # blind
        9: LabelMeaning((FacadeClass.WALL,)),
        10: LabelMeaning((FacadeClass.WALL,)),
        11: LabelMeaning((FacadeClass.WALL, FacadeClass.SHOP)),  # pillar
        12: LabelMeaning((FacadeClass.SHOP,)),
    },
    may_train=True,
)
RUEMONGE = DatasetRecipe(
    "ruemonge2014",
    {
        0: _UNLABELLED,
        **{
            n + 1: _visible_classes(label)
            for n, label in enumerate(
                (
                    FacadeClass.WINDOW,
                    FacadeClass.WALL,
                    FacadeClass.BALCONY,
                    FacadeClass.DOOR,
                    FacadeClass.ROOF,
                    FacadeClass.SKY,
                    FacadeClass.SHOP,
                )
            )
        },
    },
    may_train=False,
)
LABELMEFACADE = DatasetRecipe(
    "labelmefacade",
    {
        0: _UNLABELLED,
        1: _visible_classes(
            FacadeClass.WALL,
            FacadeClass.WINDOW,
            FacadeClass.BALCONY,
            FacadeClass.DOOR,
            FacadeClass.ROOF,
            FacadeClass.SHOP,
        ),
        2: _OCCLUDER,  # cars
        3: _visible_classes(FacadeClass.DOOR),
        4: LabelMeaning(occluder=False, outside=True),  # pavement
        5: LabelMeaning(occluder=False, outside=True),  # road
        6: _visible_classes(FacadeClass.SKY),
        7: _OCCLUDER,  # vegetation
        8: _visible_classes(FacadeClass.WINDOW),
    },
    may_train=False,
)

# The Swiss street photos have polygons with a category. Most of the uncovered area is sky.
_SWISS_CATEGORIES = {
    "facade": _visible_classes(FacadeClass.WALL, FacadeClass.ROOF, FacadeClass.DOOR),
    "window": _visible_classes(FacadeClass.WINDOW),
    "balcony-fence": _visible_classes(FacadeClass.BALCONY),
    "shop": _visible_classes(FacadeClass.SHOP),
    "street": LabelMeaning(occluder=False, outside=True),
    "non-building-infrastructure": _UNLABELLED,
    "vegetation": _OCCLUDER,
    "car": _OCCLUDER,
    "fence": _OCCLUDER,
    "traffic-infrastructure": _OCCLUDER,
}
_SWISS_BACKGROUND = LabelMeaning(occluder=False, outside=True)

_IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png")


def read_swiss_street_photos(folder: str | Path) -> Iterator[LabelledFacade]:
    """Read the Swiss street photos, labelled by polygons of annotations.coco.json, in the order of that file.

    Smaller polygons are drawn over larger ones. Where a part of a facade overlaps a tree or a car, their order is
    unknown.

    Raises
    ------
    InputError : the file is no list of polygons.
    ImageError : a photo is missing.
    """
    folder = Path(folder)
    path = folder / "annotations.coco.json"
    try:
        record = parse_json_object(read_regular(path, MAX_TEXT_BYTES), str(path))
        meaning = {category["id"]: _SWISS_CATEGORIES[category["name"]] for category in record["categories"]}
        polygons: dict[int, list[JsonObject]] = {photo["id"]: [] for photo in record["images"]}
        for polygon in sorted(record["annotations"], key=lambda polygon: -polygon["area"]):
            polygons[polygon["image_id"]].append(polygon)
    except (InputError, OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{path}: not the polygons of the swiss set ({short_message(error)}); fetch the file again"
        ) from error
    for photo in record["images"]:
        image = _read_image(folder / photo["file_name"], "RGB")
        maps = _draw_polygons(path, polygons[photo["id"]], meaning, image.shape[:2])
        yield LabelledFacade(Path(photo["file_name"]).stem, image, *maps)


def read_dataset(recipe: DatasetRecipe, folder: str | Path) -> Iterator[LabelledFacade]:
    """Read a set in the order of its file names.

    Raises
    ------
    InputError : the folder lacks files of the set.
    ImageError : a file does not fit; raised when its facade is reached.
    """
    folder = Path(folder)
    images = {path.stem: path for path in _image_files(folder / "images")}
    labels = {path.stem: path for path in _image_files(folder / "labels")}
    if not images:
        raise InputError(f"{folder}: no images in images/; give the folder of the {recipe.name} set")
    if images.keys() != labels.keys():
        odd = min(images.keys() ^ labels.keys())
        raise InputError(f"{folder}: {odd} has an image or a label map but not both; complete the pair or remove it")
    for name, path in images.items():
        image, label_map = _read_image(path, "RGB"), _read_image(labels[name], None)
        yield LabelledFacade(name, image, *_map_labels(recipe, labels[name], label_map, image.shape[:2]))


def split_facades_for_training(facades: Sequence[T], every: int = 5) -> tuple[list[T], list[T]]:
    """Split facades into (training, held out): every fifth is held out from the first on."""
    held_out = list(facades[::every])
    return [facade for index, facade in enumerate(facades) if index % every], held_out


def _image_files(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    return sorted(path for path in folder.iterdir() if path.suffix.lower() in _IMAGE_SUFFIXES)


def _read_image(path: Path, mode: str | None) -> AnyArray:
    try:
        with open_picture(path) as image:
            return np.asarray(image.convert(mode) if mode else image)
    except (ImageError, OSError) as error:
        raise ImageError(f"{path}: cannot be read as an image; fetch it again or remove the pair") from error


def _map_labels(recipe: DatasetRecipe, path: Path, label_map: AnyArray, size: tuple[int, ...]) -> list[UInt8Array]:
    if label_map.dtype != np.uint8 or label_map.shape != size:
        raise ImageError(f"{path}: must be one byte a pixel at the image's size {size}, not {label_map.shape}")
    strange = sorted(set(np.unique(label_map).tolist()) - recipe.classes.keys())
    if strange:
        raise ImageError(f"{path}: label ids {strange} are not in the table of {recipe.name}; add or correct them")
    table = np.zeros((256, 4), np.uint8)
    table[list(recipe.classes)] = [meaning.label_map_values for meaning in recipe.classes.values()]
    return [table[:, part][label_map] for part in range(4)]


def _draw_polygons(
    path: Path, polygons: Sequence[JsonObject], meaning: Mapping[int, LabelMeaning], size: tuple[int, ...]
) -> list[UInt8Array]:
    import cv2

    labels, possible, occluder, outside = (
        np.full(size, value, np.uint8) for value in _SWISS_BACKGROUND.label_map_values
    )
    for polygon in polygons:
        try:
            corners = np.rint(np.array(polygon["segmentation"], np.float64).reshape(-1, 1, 2)).astype(np.int32)
            label_meaning = meaning[polygon["category_id"]]
        except (KeyError, ValueError, TypeError) as error:
            raise InputError(
                f"{path}: polygon {polygon.get('id')} has no corners or category; fetch it again"
            ) from error
        inside = cv2.fillPoly(np.zeros(size, np.uint8), [corners], 1) == 1
        behind = inside & (occluder == 1) if label_meaning.occluder is False else np.zeros(size, bool)
        for layer, value in zip((labels, possible, occluder, outside), label_meaning.label_map_values, strict=True):
            layer[inside] = value
        occluder[behind] = UNKNOWN
    return [labels, possible, occluder, outside]
