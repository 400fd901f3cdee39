"""Style of facades: descriptors, their distances, and the families of a library of exemplars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array, UInt8Array
from facade_core.core.facade_styles import OTHER_STYLE
from facade_core.core.labels import FacadeClass
from facade_core.plan.settings import EXEMPLAR_STYLE

# Clearly visible difference of each component of a style descriptor.
_DESCRIPTOR_SCALES = np.array([12.0, 8.0, 10.0, 0.10, 0.35, 0.30, 0.06, 0.12, 3.0])


@dataclass(frozen=True)
class ExemplarLibrary:
    """Exemplars to choose from, as columns of k.

    Attributes
    ----------
    height : metres.
    floors : number of floors.
    shops : share of the width with shops.
    fronts : metres of the narrowest shop; 0 without shops.
    body, foot : quality of the upper floors and of the ground floor, 0 to 1, `facade_core.facade.exemplar_quality`.
    descriptors : (k, 9), see `style_descriptor`.
    style : number of the style of shipped exemplars, OTHER_STYLE of others; None: all are others.
    """

    height: Sequence[float]
    floors: Sequence[float]
    shops: Sequence[float]
    fronts: Sequence[float]
    body: Sequence[float]
    foot: Sequence[float]
    descriptors: Sequence[Sequence[float]]
    style: Sequence[int] | None = None

    def is_other_style(self, style: Int64Array) -> BoolArray:
        """Return whether each exemplar is a shipped one of another style than (n,) numbers of styles, (n, k)."""
        own = np.full(len(self.floors), OTHER_STYLE) if self.style is None else np.asarray(self.style)
        return np.asarray((own != OTHER_STYLE) & (style[:, None] != OTHER_STYLE) & (own != style[:, None]))

    @cached_property
    def distance(self) -> Float64Array:
        """Return the distances between style descriptors, (k, k); 1 is clearly visible."""
        return self._descriptor_distances(0)

    @cached_property
    def form(self) -> Float64Array:
        """Return the distances without the colour components, (k, k)."""
        return self._descriptor_distances(EXEMPLAR_STYLE.colour_components)

    def _descriptor_distances(self, first: int) -> Float64Array:
        looks = (np.asarray(self.descriptors, float).reshape(len(self.floors), -1) / _DESCRIPTOR_SCALES)[:, first:]
        distances: Float64Array = np.sqrt(((looks[:, None] - looks[None]) ** 2).sum(axis=-1))
        return distances

    @cached_property
    def family(self) -> Int64Array:
        """Return the family of each exemplar, (k,) from 0, by average linkage of the descriptors."""
        from scipy.cluster.hierarchy import fcluster, linkage
        from scipy.spatial.distance import squareform

        count = len(self.floors)
        most = int(np.clip(round(count / EXEMPLAR_STYLE.family_size), 1, EXEMPLAR_STYLE.max_families))
        if count < 2 or most < 2:
            return np.zeros(count, np.int64)
        tree = linkage(squareform(self.distance, checks=False), "average")
        families: Int64Array = fcluster(tree, most, "maxclust").astype(np.int64) - 1
        return families


def style_descriptor(image: UInt8Array, labels: UInt8Array, metres_per_pixel: float) -> list[float]:
    """Compute the style descriptor of a facade.

    Its components are the CIELAB colour of the wall; the share of windows, log of their height to width, and log of
    their pitch in metres; the shares of balconies and roof; ornament, the mean lightness step of the wall within 10 cm.

    Parameters
    ----------
    image : (height, width, 3) RGB.
    labels : (height, width) class ids.
    metres_per_pixel : resolution of the picture.

    Returns
    -------
    9 numbers.
    """
    import cv2

    lab = cv2.cvtColor(image.astype(np.float32) / 255, cv2.COLOR_RGB2LAB)
    wall = labels == FacadeClass.WALL
    colour = np.median(lab[wall], axis=0) if wall.any() else np.zeros(3)
    count, _, boxes, _ = cv2.connectedComponentsWithStats((labels == FacadeClass.WINDOW).astype(np.uint8))
    tall, pitch = 0.0, 0.0
    if count > 1:
        width, height = (np.median(boxes[1:, side]) for side in (cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT))
        tall = float(np.log(height / width))
        wall_area = labels.size * metres_per_pixel**2
        pitch = float(0.5 * np.log(wall_area / (count - 1)))
    # at 10 cm a pixel, steps measure ornament without grain and joints
    small = max(8, round(image.shape[0] * metres_per_pixel * 10)), max(8, round(image.shape[1] * metres_per_pixel * 10))
    light = cv2.resize(lab[..., 0], small[::-1], interpolation=cv2.INTER_AREA)
    plain = cv2.resize(wall.astype(np.float32), small[::-1], interpolation=cv2.INTER_AREA)[1:, 1:] > 0.99
    step = np.abs(np.diff(light, axis=0))[:, 1:] + np.abs(np.diff(light, axis=1))[1:]
    ornament = float(step[plain].mean()) if plain.any() else 0.0
    share = [float((labels == one).mean()) for one in (FacadeClass.WINDOW, FacadeClass.BALCONY, FacadeClass.ROOF)]
    return [round(float(v), 4) for v in (*colour, share[0], tall, pitch, share[1], share[2], ornament)]
