"""Image evidence for proposed elements: a parse's confidence over their visible pixels."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import AnyArray, Float64Array, Int64Array
from facade_core.core.errors import LayoutError
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES
from facade_core.core.types import Parsing

# Error rate of a parser with full confidence.
_CONFIDENCE_MARGIN = 0.01
# Upper bound of the prior: the picture may contradict even a regular facade.
_MAX_PROBABILITY = 0.95


def apply_image_evidence(
    probability: Float64Array,
    box: Float64Array,
    label: AnyArray,
    evidence: Parsing,
    domain: tuple[float, float, float, float],
) -> Float64Array:
    """Update the probabilities of rectangles by the parse of their visible pixels.

    The odds are multiplied by those of the parser's mean confidence in the label over the visible pixels, to the
    power of the visible share. A wholly hidden rectangle keeps its probability.

    Parameters
    ----------
    probability : (N,) prior probabilities.
    box : (N, 4) x0, y0, x1, y1 in the unit of the domain.
    label : (N,) index into ELEMENT_CLASSES.
    evidence : parse of the image that the domain covers.
    domain : (x0, y0, x1, y1) of the facade.

    Returns
    -------
    (N,) posterior probabilities.

    Raises
    ------
    LayoutError
        For a parse without confidences.
    """
    height, width = evidence.occluded.shape
    if evidence.confidence.shape != (height, width, len(CLASSES)):
        raise LayoutError(
            f"evidence: confidence has the shape {evidence.confidence.shape}, not {(height, width, len(CLASSES))}; "
            "give what `parse` returns"
        )
    visible = ~evidence.occluded
    scale = np.array([width / (domain[2] - domain[0]), height / (domain[3] - domain[1])] * 2)
    corner = np.rint((box - np.array(domain[:2] * 2)) * scale).astype(int)
    corner[:, [0, 2]] = corner[:, [0, 2]].clip(0, width)
    corner[:, [1, 3]] = corner[:, [1, 3]].clip(0, height)
    area = np.maximum((corner[:, 2] - corner[:, 0]) * (corner[:, 3] - corner[:, 1]), 1)
    seen = _box_sums(visible.astype(np.float64), corner)
    sure = np.zeros(len(box))
    for k in np.unique(label).tolist():
        of = label == k
        channel = evidence.confidence[:, :, CLASSES.index(ELEMENT_CLASSES[k])]
        sure[of] = _box_sums(np.where(visible, channel, 0).astype(np.float64), corner[of])
    mean = np.divide(sure, seen, out=np.full(len(box), 0.5), where=seen > 0)
    odds = (mean + _CONFIDENCE_MARGIN) / (1 - mean + _CONFIDENCE_MARGIN)
    adjusted: Float64Array = 1 / (1 + (1 / probability.clip(1e-6, _MAX_PROBABILITY) - 1) * odds ** -(seen / area))
    return adjusted


def _box_sums(values: Float64Array, corner: Int64Array) -> Float64Array:
    """Sum values (H, W) over (N, 4) rectangles of whole pixels."""
    table = np.zeros((values.shape[0] + 1, values.shape[1] + 1))
    table[1:, 1:] = values.cumsum(axis=0).cumsum(axis=1)
    x0, y0, x1, y1 = corner.T
    sums: Float64Array = table[y1, x1] - table[y0, x1] - table[y1, x0] + table[y0, x0]
    return sums
