"""Faces by CenterFace (Xu et al. 2019): a map of their centres, with the size and the offset of each."""

from __future__ import annotations

import numpy as np

from facade_core.imagery.detect.image_tiles import split_tiles
from facade_core.imagery.detect.models import FACE_MODEL, session

# A face counts from this score on; of two that overlap by more (IoU) the surer one stays.
LEAST_SCORE, OVERLAP = 0.3, 0.3
# Pictures are looked at in tiles that are so wide for the network, smaller ones than so many pixels enlarged as well: at their
# own scale the network misses the smallest faces.
SIDE, OVERLAPPING = 640, 96
ENLARGED, SMALL = 2.0, 4_000_000
# Sides that the network takes, and those of a cell of its map.
_MULTIPLE, _CELL = 32, 4


def find_faces(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The faces in an image (H, W, 3) uint8: boxes (n, 4) x0, y0, x1, y1 in pixels, and their scores (n,), best first."""
    boxes, scores = [np.zeros((0, 4), np.float32)], [np.zeros(0, np.float32)]
    for scale in (1.0, ENLARGED) if image.size <= 3 * SMALL else (1.0,):
        for part, x, y in split_tiles(image, round(SIDE / scale), OVERLAPPING):
            found, score = _in_tile(part, scale)
            boxes.append(found + np.array([x, y, x, y], np.float32))
            scores.append(score)
    return non_maximum_suppression(np.concatenate(boxes), np.concatenate(scores), OVERLAP)


def _in_tile(image: np.ndarray, scale: float) -> tuple[np.ndarray, np.ndarray]:
    import cv2

    height, width = (round(side * scale) for side in image.shape[:2])
    if scale != 1:
        image = cv2.resize(image, (width, height), interpolation=cv2.INTER_CUBIC)
    below, beside = -height % _MULTIPLE, -width % _MULTIPLE
    image = cv2.copyMakeBorder(image, 0, below, 0, beside, cv2.BORDER_REPLICATE)
    feed = np.ascontiguousarray(image.transpose(2, 0, 1)[None], np.float32)
    net = session(FACE_MODEL)
    centres, sizes, offsets, _ = net.run(None, {net.get_inputs()[0].name: feed})
    row, column = np.nonzero(centres[0, 0] > LEAST_SCORE)
    middle = np.stack([column, row]) + offsets[0, ::-1, row, column].T + 0.5
    half = np.exp(sizes[0, ::-1, row, column].T) / 2
    boxes = np.concatenate([middle - half, middle + half]).T * (_CELL / scale)
    limit = np.array([width, height, width, height]) / scale
    return np.clip(boxes, 0, limit).astype(np.float32), centres[0, 0, row, column]


def non_maximum_suppression(boxes: np.ndarray, scores: np.ndarray, overlap: float) -> tuple[np.ndarray, np.ndarray]:
    """Of boxes (n, 4) that overlap by more than `overlap` (IoU) the one with the best score, best first."""
    kept: list[int] = []
    for index in np.argsort(-scores, kind="stable").tolist():
        if not kept or (box_ious(boxes[index], boxes[kept]) <= overlap).all():
            kept.append(index)
    return boxes[kept], scores[kept]


def box_ious(box: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Intersection over union of a box (4,) with others (n, 4): (n,)."""
    low, high = np.maximum(box[:2], others[:, :2]), np.minimum(box[2:], others[:, 2:])
    shared = np.prod(np.maximum(high - low, 0), axis=1)
    areas = np.prod(others[:, 2:] - others[:, :2], axis=1)
    return shared / np.maximum(np.prod(box[2:] - box[:2]) + areas - shared, 1e-9)
