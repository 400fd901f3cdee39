"""Training sets of the parser: occluder maps from detections, and painted facades."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping

import numpy as np

from catalogs.learning.datasets import LabelledFacade
from catalogs.learning.occluder_boxes import OccluderBoxes
from facade_core.core.labels import CLASSES, FacadeClass
from facade_core.parsing.occluder_labels import occluders_from_labels
from facade_core.parsing.training_views import ANY_CLASS
from facade_core.synth.exemplars import paint_exemplar_set


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
