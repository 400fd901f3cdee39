"""Face detection by CenterFace (Xu et al. 2019): a map of face centres with size and offset."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float32Array, UInt8Array
from facade_core.imagery.detect.image_tiles import split_tiles
from facade_core.imagery.detect.models import FACE_MODEL, model_session
from facade_core.imagery.detect.settings import DETECTION

# The network takes sides that are multiples of this.
_SIDE_MULTIPLE = 32
# Pixels per cell of its output map.
_CELL_PIXELS = 4


def find_faces(image: UInt8Array) -> tuple[Float32Array, Float32Array]:
    """Find faces in an image.

    Parameters
    ----------
    image : (H, W, 3) uint8.

    Returns
    -------
    Boxes (n, 4) x0, y0, x1, y1 in pixels and scores (n,), best first.
    """
    scales = (1.0, DETECTION.face_enlargement) if image.size <= 3 * DETECTION.max_enlarged_pixels else (1.0,)
    found = [_faces_at_scale(image, scale) for scale in scales]
    boxes, scores = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return non_maximum_suppression(boxes, scores, DETECTION.max_face_iou)


def find_faces_at_scale(image: UInt8Array, scale: float) -> Float32Array:
    """Find the faces in an image (H, W, 3), enlarged or reduced by `scale`; boxes (n, 4), best first."""
    return non_maximum_suppression(*_faces_at_scale(image, scale), DETECTION.max_face_iou)[0]


def _faces_at_scale(image: UInt8Array, scale: float) -> tuple[Float32Array, Float32Array]:
    boxes, scores = [np.zeros((0, 4), np.float32)], [np.zeros(0, np.float32)]
    for part, x, y in split_tiles(image, round(DETECTION.face_tile_side / scale), DETECTION.face_tile_overlap):
        tile_boxes, tile_scores = _faces_in_tile(part, scale)
        boxes.append(tile_boxes + np.array([x, y, x, y], np.float32))
        scores.append(tile_scores)
    return np.concatenate(boxes), np.concatenate(scores)


def _faces_in_tile(image: UInt8Array, scale: float) -> tuple[Float32Array, Float32Array]:
    import cv2

    height, width = (round(side * scale) for side in image.shape[:2])
    if scale != 1:
        interpolation = cv2.INTER_CUBIC if scale > 1 else cv2.INTER_AREA
        image = np.asarray(cv2.resize(image, (width, height), interpolation=interpolation), np.uint8)
    below, beside = -height % _SIDE_MULTIPLE, -width % _SIDE_MULTIPLE
    image = np.asarray(cv2.copyMakeBorder(image, 0, below, 0, beside, cv2.BORDER_REPLICATE), np.uint8)
    feed = np.ascontiguousarray(image.transpose(2, 0, 1)[None], np.float32)
    net = model_session(FACE_MODEL)
    centres, sizes, offsets, _ = net.run(None, {net.get_inputs()[0].name: feed})
    row, column = np.nonzero(centres[0, 0] > DETECTION.min_face_score)
    middle = np.stack([column, row]) + offsets[0, ::-1, row, column].T + 0.5
    half = np.exp(sizes[0, ::-1, row, column].T) / 2
    boxes = np.concatenate([middle - half, middle + half]).T * (_CELL_PIXELS / scale)
    limit = np.array([width, height, width, height]) / scale
    return np.clip(boxes, 0, limit).astype(np.float32), centres[0, 0, row, column]


def non_maximum_suppression(
    boxes: Float32Array, scores: Float32Array, max_iou: float
) -> tuple[Float32Array, Float32Array]:
    """Keep the best of boxes that overlap.

    Parameters
    ----------
    boxes : (n, 4) x0, y0, x1, y1.
    scores : (n,).
    max_iou : boxes that overlap a better one by more than this are dropped.

    Returns
    -------
    The kept boxes and scores, best first.
    """
    kept: list[int] = []
    for index in np.argsort(-scores, kind="stable").tolist():
        if not kept or (box_ious(boxes[index], boxes[kept]) <= max_iou).all():
            kept.append(index)
    return boxes[kept], scores[kept]


def box_ious(box: Float32Array, others: Float32Array) -> Float32Array:
    """Compute the intersection over union (n,) of a box (4,) with others (n, 4)."""
    low, high = np.maximum(box[:2], others[:, :2]), np.minimum(box[2:], others[:, 2:])
    shared = np.prod(np.maximum(high - low, 0), axis=1)
    areas = np.prod(others[:, 2:] - others[:, :2], axis=1)
    ious: Float32Array = shared / np.maximum(np.prod(box[2:] - box[:2]) + areas - shared, 1e-9)
    return ious
