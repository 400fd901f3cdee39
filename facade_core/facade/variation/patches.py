"""Element patches: cut, align and normalise for light; and the wall without elements."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import (
    BoolArray,
    Float32Array,
    Float64Array,
    FloatArray,
    Int32Array,
    IntArray,
    UInt8Array,
)
from facade_core.core.ties import first_maximum

# Wall around the element of a patch.
PATCH_MARGIN_PX = 2
# Largest shift of an element to align with its group.
_ALIGNMENT_REACH_PX = 2
_ALIGNMENT_ROUNDS = 3
# Range of relative light; beyond it the wall is of another material.
_LIGHT_RANGE = (0.75, 1.33)
# Brightness of a wall that is not seen.
_MID_GREY = 128.0


def box_mask(box: IntArray, shape: tuple[int, int]) -> BoolArray:
    """Return a mask (H, W) bool, True inside the half-open pixel boxes (N, 4) int."""
    mask = np.zeros(shape, bool)
    for x0, y0, x1, y1 in box.tolist():
        mask[max(y0, 0) : max(y1, 0), max(x0, 0) : max(x1, 0)] = True
    return mask


def patch_size(box: IntArray) -> tuple[int, int]:
    """Return the (height, width) in pixels of a group's patches: the median with margins."""
    width, height = np.median(box[:, 2:] - box[:, :2], axis=0)
    return round(float(height)) + 2 * PATCH_MARGIN_PX, round(float(width)) + 2 * PATCH_MARGIN_PX


def align_boxes(image: UInt8Array, box: Int32Array, size: tuple[int, int]) -> IntArray:
    """Move boxes by up to 2 px so that the edges of their patches agree with the group's mean edges.

    Edges, since an element's frame is stable while shutters and blinds change its interior.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    box : (N, 4) int pixels.
    size : (height, width) of the patches.

    Returns
    -------
    (N, 4) int.
    """
    if len(box) < 3:
        return box
    import cv2

    grey = _cut_with_margin(
        image,
        box,
        PATCH_MARGIN_PX + _ALIGNMENT_REACH_PX,
        (size[0] + 2 * _ALIGNMENT_REACH_PX, size[1] + 2 * _ALIGNMENT_REACH_PX),
    ).mean(axis=3)
    # Separate horizontal and vertical edges; the root keeps a single strong edge from dominating.
    edges = np.stack([np.sqrt(np.abs(cv2.Sobel(g, -1, *axis))) for g in grey for axis in ((1, 0), (0, 1))])
    edges = edges.reshape(len(box), 2, *grey.shape[1:])
    reach = range(2 * _ALIGNMENT_REACH_PX + 1)
    windows = [edges[..., dy : dy + size[0], dx : dx + size[1]] for dy in reach for dx in reach]
    best = np.full(len(box), len(windows) // 2)
    for _ in range(_ALIGNMENT_ROUNDS):
        template = np.mean([windows[s][i] for i, s in enumerate(best)], axis=0)
        template -= template.mean()
        agreement = [(w * template).sum(axis=(1, 2, 3), dtype=np.float64) for w in windows]
        best = np.array([first_maximum(own) for own in np.transpose(agreement)])
    aligned: IntArray = box + np.tile(
        np.stack([best % len(reach), best // len(reach)], axis=1) - _ALIGNMENT_REACH_PX, 2
    )
    return aligned


def cut_patches(image: UInt8Array | Float32Array, box: IntArray, size: tuple[int, int]) -> Float32Array:
    """Cut each box with its margin and resample it to `size`.

    Parameters
    ----------
    image : (H, W) or (H, W, 3).
    box : (N, 4) int pixels.
    size : (h, w) of the patches.

    Returns
    -------
    (N, h, w[, 3]) float32 in the image's range.
    """
    return _cut_with_margin(image, box, PATCH_MARGIN_PX, size)


def crop_box(image: UInt8Array, box: IntArray) -> Float32Array:
    """Crop a box (4,) with its margin at its own size, (h, w, 3) float32; border pixels repeat beyond the image."""
    rows = np.clip(np.arange(box[1] - PATCH_MARGIN_PX, box[3] + PATCH_MARGIN_PX), 0, image.shape[0] - 1)
    columns = np.clip(np.arange(box[0] - PATCH_MARGIN_PX, box[2] + PATCH_MARGIN_PX), 0, image.shape[1] - 1)
    cropped: Float32Array = image[rows[:, None], columns].astype(np.float32)
    return cropped


def _cut_with_margin(
    image: UInt8Array | Float32Array, box: IntArray, margin: int, size: tuple[int, int]
) -> Float32Array:
    import cv2

    # Alignment may move a box beyond the image.
    pad = margin + _ALIGNMENT_REACH_PX
    padded = cv2.copyMakeBorder(image, pad, pad, pad, pad, cv2.BORDER_REPLICATE)
    patches = np.empty((len(box), *size, *image.shape[2:]), np.float32)
    for patch, (x0, y0, x1, y1) in zip(patches, (box + pad).tolist(), strict=True):
        crop = padded[y0 - margin : y1 + margin, x0 - margin : x1 + margin]
        patch[:] = cv2.resize(crop, size[::-1], interpolation=cv2.INTER_LINEAR)
    return patches


def wall_integral_images(image: UInt8Array, mask: BoolArray) -> tuple[Int32Array, Int32Array]:
    """Return integral images (H + 1, W + 1) of the wall's brightness and number of pixels.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    mask : (H, W) bool, True on elements.
    """
    import cv2

    wall = (~mask).astype(np.uint8)
    light = cv2.integral(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) * wall)
    return np.asarray(light, np.int32), np.asarray(cv2.integral(wall), np.int32)


def relative_wall_brightness(sums: tuple[Int32Array, Int32Array], box: Int32Array) -> tuple[Float64Array, float]:
    """Return the brightness of the wall around each box relative to the median, within [0.75, 1.33], and the median.

    A shadow darkens an element and the wall next to it alike, a drawn blind only the element.

    Parameters
    ----------
    sums : integral images of `wall_integral_images`.
    box : (N, 4) int pixels.

    Returns
    -------
    (N,), and the median in grey levels, that of mid grey where no box has a wall around it.
    """
    reach = np.maximum(3, (0.25 * (box[:, 2:] - box[:, :2])).round().astype(int))
    limit = np.array(sums[0].shape[::-1]) - 1
    (x0, y0), (x1, y1) = np.clip(box[:, :2] - reach, 0, limit).T, np.clip(box[:, 2:] + reach, 0, limit).T

    def over(sums: Int32Array) -> Int32Array:
        total: Int32Array = sums[y1, x1] - sums[y0, x1] - sums[y1, x0] + sums[y0, x0]
        return total

    pixels = over(sums[1])
    mean = over(sums[0]) / np.maximum(pixels, 1)
    known = (pixels >= 8) & (mean >= 4)
    if not known.any():
        return np.ones(len(box)), _MID_GREY
    median = float(np.median(mean[known]))
    return np.where(known, np.clip(mean / median, *_LIGHT_RANGE), 1.0), median


def bare_wall(image: UInt8Array, mask: BoolArray) -> UInt8Array:
    """Fill masked pixels smoothly from their surroundings by pull-push over an image pyramid.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    mask : (H, W) bool, True where to fill.
    """
    import cv2

    if mask.all():
        return np.full_like(image, image.mean(axis=(0, 1)).round())
    if not mask.any():
        return image
    known = (~mask).astype(np.float32)
    colours: list[Float32Array] = [image.astype(np.float32) * known[..., None]]
    weights: list[Float32Array] = [known]
    while weights[-1].min() < 1e-3 and min(weights[-1].shape) > 1:
        colours.append(np.asarray(cv2.pyrDown(colours[-1]), np.float32))
        weights.append(np.asarray(cv2.pyrDown(weights[-1]), np.float32))
    filled: FloatArray = colours[-1] / np.maximum(weights[-1], 1e-6)[..., None]
    for colour, weight in zip(colours[-2::-1], weights[-2::-1], strict=True):
        up = cv2.resize(filled, weight.shape[::-1], interpolation=cv2.INTER_LINEAR)
        filled = colour + (1 - weight[..., None]) * up
    return np.where(mask[..., None], np.clip(filled.round(), 0, 255).astype(np.uint8), image)
