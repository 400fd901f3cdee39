"""Evidence of a facade: what a rectified picture shows of it, before it is completed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from facade_core.core.arrays import AnyArray, BoolArray, UInt8Array
from facade_core.core.types import Box, Element, Parsing, Pose
from facade_core.facade.layout.visible_region import dilate_hidden_by_window, visible_region_boxes
from facade_core.imagery.detect.detection import FacesPlatesAndText
from facade_core.imagery.rectify.change_detection import ChangeSinceCapture
from facade_core.imagery.rectify.crop import FacadeCrop
from facade_core.parsing.segmentation import Segmentation


@dataclass(frozen=True, eq=False, kw_only=True)
class Evidence:
    """Rectified picture of a facade with what is known of its pixels, and once it is observed with its parse.

    Attributes
    ----------
    image : (h, w, 3) uint8.
    hidden : (h, w) bool pixels that do not show the facade.
    outside : (h, w) bool sky, street and neighbours, which the parser may use as context; None without any.
    facade : (h, w) bool pixels known to show the facade, where no occluder is searched; None if unknown.
    private : (h, w) bool faces and number plates; None without any.
    is_clean : True for a picture without occluders.
    confidence : (h, w), 0 to 1: resolution of the picture relative to the raster, and its viewing angle; None if unknown.
    segmentation : segmentation of the picture; None before it is made or observed.
    masked : boxes of removed objects.
    masked_share : share of the picture that they cover.
    parsed : parse of the picture; None before it is observed.
    elements : elements seen, wholly or in part.
    source : names of the pictures.
    captured : day of the newest picture, if known.
    seen : faces, plates and text in texels that `hidden` lacks.
    before : change since an earlier capture; None with one capture.
    pictures : path and pose of panoramas.
    picture : (h, w) int8 number of the panorama of each texel, -1 without; None of other pictures.
    photo : facade of a photo in all its pixels; None of other pictures.
    grey : brightness (r, c) uint8 of the wall in each panorama of the newest capture, in the order of `pictures` and at least
        as fine as `image`; 0 where it is not clear.
    """

    image: UInt8Array
    hidden: BoolArray
    outside: BoolArray | None = None
    facade: BoolArray | None = None
    private: BoolArray | None = None
    is_clean: bool = False
    confidence: AnyArray | None = None
    segmentation: Segmentation | None = None
    masked: tuple[Box, ...] = ()
    masked_share: float = 0.0
    parsed: Parsing | None = None
    elements: tuple[Element, ...] = ()
    source: str = ""
    captured: str | None = None
    seen: FacesPlatesAndText = field(default_factory=FacesPlatesAndText)
    before: ChangeSinceCapture | None = None
    pictures: tuple[tuple[Path, Pose], ...] = ()
    picture: AnyArray | None = None
    photo: FacadeCrop | None = None
    grey: tuple[UInt8Array, ...] = ()

    @property
    def parsing(self) -> Parsing:
        """Return the parse of an observed picture."""
        assert self.parsed is not None, "the picture is not observed"
        return self.parsed

    @property
    def surroundings(self) -> BoolArray:
        """Return `outside`, empty where there is none."""
        return np.zeros_like(self.hidden) if self.outside is None else self.outside

    def visible_boxes(self) -> list[tuple[float, float, float, float]]:
        """Return the visible part as `complete` takes it."""
        region = visible_region_boxes(dilate_hidden_by_window(self.hidden, self.elements))
        return region + [(e.x0, e.y0, e.x1, e.y1) for e in self.elements]

    def occluded_parsing(self) -> Parsing:
        """Return the parse with everything hidden marked as occluded."""
        return replace(self.parsing, occluded=self.hidden | self.parsing.occluded)
