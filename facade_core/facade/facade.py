"""Facade after all of its stages."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.types import Box, Completion, Element, Lattice
from facade_core.facade.variation.hierarchy import Hierarchy
from facade_core.parsing.confidence import FacadeEstimates


@dataclass(frozen=True)
class Facade:
    """Facade after all of its stages.

    Attributes
    ----------
    evidence : (h, w, 3) uint8 image before completion.
    image : (h, w, 3) uint8 completed image.
    labels : (h, w) uint8 completed class ids.
    occluded : (h, w) bool.
    provenance : (h, w) uint8 Provenance.
    masked : boxes (x0, y0, x1, y1) of trees, cars, people and the like that were removed from the image.
    masked_share : share of the image that they hid.
    lattice : irregular lattice of the labels.
    elements : elements with the probability that they exist times their visible share as confidence; 1 without a
        photo.
    hierarchy : variation-factored hierarchy, None without elements.
    completion : completed layout, None if nothing was completed.
    estimates : window share, number of windows and of floors, with intervals; None without a photo.
    floors : number of floors, the ground floor included; 0 without windows.
    seconds : seconds of each stage.
    plausibility : logarithm of the layout's probability, of its ten scores; None with a photo, or without elements.
    foreign_share, inpainting_doubt : as in `facade_core.facade.texture_faults`; None without pictures.
    """

    evidence: UInt8Array
    image: UInt8Array
    labels: UInt8Array
    occluded: BoolArray
    provenance: UInt8Array
    masked: tuple[Box, ...]
    masked_share: float
    lattice: Lattice
    elements: tuple[Element, ...]
    hierarchy: Hierarchy | None
    completion: Completion | None
    estimates: FacadeEstimates | None
    floors: int
    seconds: dict[str, float] = field(compare=False)
    plausibility: float | None = None
    foreign_share: float | None = None
    inpainting_doubt: float | None = None


@contextmanager
def time_stage(seconds: dict[str, float], stage: str) -> Iterator[None]:
    """Add the seconds of a `with` block to those of a stage."""
    start = time.perf_counter()
    yield
    seconds[stage] = seconds.get(stage, 0.0) + time.perf_counter() - start
