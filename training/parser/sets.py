"""Training sets of the parser: occluder maps from detections, painted facades, and painted thin occluders."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping

import cv2
import numpy as np

from benchmarks.painter.exemplars import paint_exemplar_set
from benchmarks.painter.thin_occluders import THIN_KINDS, paint_before_wall
from facade_core.core.arrays import UInt8Array
from facade_core.core.labels import CLASSES, UNKNOWN, FacadeClass
from training.datasets.facades import ANY_CLASS, LabelledFacade
from training.datasets.occluder_boxes import OccluderBoxes
from training.parser.occluder_labels import occluders_from_labels

# Most thin occluders in a view, and shares of their kinds in the order of THIN_KINDS.
_MAX_THIN_OCCLUDERS = 4
_KIND_SHARES = (0.22, 0.15, 0.17, 0.2, 0.08, 0.08, 0.05, 0.05)
# Share of views in which they are of low contrast, and their least contrast.
_PALE_SHARE, _LEAST_CONTRAST = 0.4, 0.5
# Largest standard deviation of the blur in front of the wall, pixels.
_MAX_BLUR = 1.3


def relabel_occluders(
    name: str, facades: Iterable[LabelledFacade], detections: Mapping[str, OccluderBoxes]
) -> list[LabelledFacade]:
    """Replace the occluder maps of a data set by detections of photos "set/name".

    Parameters
    ----------
    name : name of the data set.
    facades : labelled facades.
    detections : occluder boxes by "set/name".
    """
    told = []
    for facade in facades:
        found, doubtful = detections.get(f"{name}/{facade.name}", (None, ()))
        occluder = occluders_from_labels(facade.image, facade.labels, facade.possible, found, doubtful)
        told.append(dataclasses.replace(facade, occluder=occluder))
    return told


def paint_labelled_facades(number: int, *, seed: int) -> list[LabelledFacade]:
    """Paint facades with ground truth; trees, cars and lamps hide parts of a quarter of them."""
    return [
        LabelledFacade(
            f"{seed}-{index}",
            facade.image,
            facade.labels,
            np.where(facade.labels < len(CLASSES), 1 << np.minimum(facade.labels, 7), ANY_CLASS).astype(np.uint8),
            facade.occluded.astype(np.uint8),
            (facade.labels == FacadeClass.SKY).astype(np.uint8),
        )
        for index, facade in enumerate(paint_exemplar_set(number, seed=seed, occluded_share=0.25))
    ]


def paint_random_occluders(
    image: UInt8Array, metres_per_pixel: float, foot: float, rng: np.random.Generator
) -> tuple[UInt8Array, UInt8Array]:
    """Paint one to four thin occluders of random kinds and distances over a view, sharp or blurred, in any contrast.

    Parameters
    ----------
    image : (H, W, 3) uint8 RGB.
    metres_per_pixel : resolution of the wall.
    foot : row of the wall's foot in pixels.
    rng : random generator.

    Returns
    -------
    image : (H, W, 3) uint8.
    occluder : (H, W) uint8; 1 on covered pixels, UNKNOWN on faint ones, else 0.
    """
    occluder = np.zeros(image.shape[:2], np.uint8)
    wall = metres_per_pixel * float(np.exp(rng.normal(0, 0.15)))
    covered = image
    for kind in rng.choice(list(THIN_KINDS), int(rng.integers(1, _MAX_THIN_OCCLUDERS + 1)), p=_KIND_SHARES):
        covered, painted = paint_before_wall(covered, str(kind), wall, foot, rng)
        either = np.where((painted == 1) | (occluder == 1), 1, UNKNOWN)
        occluder = np.where(painted == 0, occluder, either).astype(np.uint8)
    change = covered.astype(np.float32) - image
    if (blur := float(rng.uniform(-_MAX_BLUR, _MAX_BLUR))) > 0:
        change = np.asarray(cv2.GaussianBlur(change, (0, 0), max(blur, 0.2)), np.float32)
    if rng.random() < _PALE_SHARE:
        change *= np.float32(rng.uniform(_LEAST_CONTRAST, 1))
    return np.clip(np.rint(image + change), 0, 255).astype(np.uint8), occluder
