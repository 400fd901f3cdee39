"""Draw a hierarchy level as in Fig. 1 of the variation paper: the facade above its element types."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.facade.variation.hierarchy import Hierarchy
from facade_core.facade.variation.rendering import element_boxes

# Height of a type's picture, as a share of the facade's.
_INSET_SHARE = 0.045
# Gap between pictures.
_GAP_PX = 4
_BACKGROUND = 255


def draw_level(hierarchy: Hierarchy, level: int) -> UInt8Array:
    """Draw the facade at a level above its types, the most frequent first, each by its representative.

    A bar below every type is as long as its share of the elements. Raises InputError for a level that does not exist.

    Returns
    -------
    (H', W, 3) uint8.
    """
    import cv2

    facade = hierarchy.reconstruct(level)
    types, counts = np.unique(hierarchy.types_at(level), return_counts=True)
    if not len(types):
        return facade
    height, width = facade.shape[:2]
    tall = max(12, round(_INSET_SHARE * height))
    boxes = element_boxes(hierarchy.groups)[hierarchy.representatives]
    rows = [np.full((tall + 2 * _GAP_PX, width, 3), _BACKGROUND, np.uint8)]
    at = _GAP_PX
    for t in types[np.lexsort((types, -counts))]:
        x0, y0, x1, y1 = np.clip(boxes[t], 0, (width, height, width, height)).tolist()
        across = min(max(6, round((x1 - x0) * tall / max(1, y1 - y0))), width - 2 * _GAP_PX, 2 * tall)
        if min(x1 - x0, y1 - y0, across) < 1:
            continue
        if at + across > width - _GAP_PX:
            rows.append(np.full_like(rows[0], _BACKGROUND))
            at = _GAP_PX
        inset = rows[-1][_GAP_PX : _GAP_PX + tall, at : at + across]
        inset[:] = cv2.resize(hierarchy.photo[y0:y1, x0:x1], (across, tall), interpolation=cv2.INTER_AREA)
        share = counts[types == t][0] / counts.sum()
        rows[-1][_GAP_PX + tall : _GAP_PX + tall + 2, at : at + max(1, round(share * across))] = (180, 85, 45)
        at += across + _GAP_PX
    return np.concatenate([facade, *rows])
