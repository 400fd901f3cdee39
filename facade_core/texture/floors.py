"""Filling a hole with large patches a whole number of floors away (floors paper, Code 2)."""

from __future__ import annotations

import cv2
import numpy as np
from scipy import ndimage

from facade_core.labels import UNKNOWN
from facade_core.texture.pitch import bay_width, floor_height
from facade_core.texture.seams import level, seam
from facade_core.texture.sources import BAND, Scene, any_source, best_source, candidates, looks
from facade_core.texture.structure import structure

_SLIVER = 3  # px, patches below this width or height are left to diffusion
_ALIKE = 0.3  # difference of looks (as priced in sources) below which two floors are of one kind
_GOOD = 0.1  # price of a source up to which a patch is not split
_FAIR = 0.25  # the same for a patch of few pixels' width or height

Box = tuple[int, int, int, int]


def fill_by_floors(
    image: np.ndarray, mask: np.ndarray, labels: np.ndarray | None, guide: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """image (H, W, 3) uint8 with the pixels of mask (H, W) filled; guide (H, W) uint8 as in Scene.

    The hole is cut at the borders of the ground floor and the roof where labels show them; each part is cloned as one
    patch if it finds a source, else it is split in two. Parts with most known neighbours come first.
    """
    picture = image.astype(np.float32) / 255.0
    visible = np.full(mask.shape, UNKNOWN, np.uint8) if labels is None else np.where(mask, UNKNOWN, labels)
    row_look, column_look = looks(picture, visible, ~mask)
    scene = Scene(
        picture, ~mask, row_look, column_look, guide, floor_height(image, mask, rng), bay_width(image, mask, rng)
    )
    shifts = candidates(scene.floor, scene.bay, mask.shape)
    filled, done = picture.copy(), ~mask
    filled[mask] = 0.0
    parts = [part for box in _zones(visible, mask) for part in _components(mask, box)]
    while parts:
        part = parts.pop(_most_known(parts, mask, done))
        hidden = _hidden(mask & ~done, part)
        if not hidden.any():
            continue
        shift = _source(scene, filled, done, part, shifts)
        if shift is not None:
            _clone(scene, filled, done, part, shift)
        elif max(part[1] - part[0], part[3] - part[2]) > 2 * _SLIVER:
            parts += [piece for half in _split(part) for piece in _components(mask & ~done, half)]
    return _finish(image, filled, done)


def _zones(labels: np.ndarray, mask: np.ndarray) -> list[Box]:
    """Row bands (y0, y1, x0, x1) of roof, floors and ground, so that none is filled from another by one patch."""
    height, width = mask.shape
    found = structure(labels) if (labels != UNKNOWN).any() else None
    cuts = {0, height}
    if found is not None:
        cuts |= {found.floor_cuts[0], found.floor_cuts[sum(k == "roof" for k in found.kinds)], found.ground_top}
    lines = sorted(cuts)
    return [(a, b, 0, width) for a, b in zip(lines, lines[1:], strict=False)]


def _components(hidden: np.ndarray, box: Box) -> list[Box]:
    numbered, _ = ndimage.label(hidden[box[0] : box[1], box[2] : box[3]])
    return [
        (box[0] + a.start, box[0] + a.stop, box[2] + b.start, box[2] + b.stop)
        for a, b in ndimage.find_objects(numbered)
    ]


def _hidden(hidden: np.ndarray, box: Box) -> np.ndarray:
    return hidden[box[0] : box[1], box[2] : box[3]]


def _around(box: Box, shape: tuple[int, int], margin: int) -> Box:
    return (
        max(0, box[0] - margin),
        min(shape[0], box[1] + margin),
        max(0, box[2] - margin),
        min(shape[1], box[3] + margin),
    )


def _most_known(parts: list[Box], mask: np.ndarray, done: np.ndarray) -> int:
    shares = []
    for part in parts:
        y0, y1, x0, x1 = _around(part, mask.shape, BAND)
        outside = (y1 - y0) * (x1 - x0) - (part[1] - part[0]) * (part[3] - part[2])
        known = done[y0:y1, x0:x1].sum() - done[part[0] : part[1], part[2] : part[3]].sum()
        shares.append(known / max(outside, 1))
    return int(np.argmax(shares))


def _positions(done: np.ndarray, part: Box) -> tuple[np.ndarray, np.ndarray]:
    """Patch and band J: pixels (k, 2) to fill, and filled ones within BAND px of them."""
    y0, y1, x0, x1 = _around(part, done.shape, BAND)
    inner = np.zeros((y1 - y0, x1 - x0), np.uint8)
    inside = np.s_[part[0] - y0 : part[1] - y0, part[2] - x0 : part[3] - x0]
    inner[inside] = ~done[part[0] : part[1], part[2] : part[3]]
    near = cv2.dilate(inner, np.ones((2 * BAND + 1, 2 * BAND + 1), np.uint8)) > 0
    offset = np.array([y0, x0])
    return np.argwhere(inner > 0) + offset, np.argwhere(near & done[y0:y1, x0:x1]) + offset


def _source(
    scene: Scene, filled: np.ndarray, done: np.ndarray, part: Box, shifts: np.ndarray
) -> tuple[int, int] | None:
    patch, band = _positions(done, part)
    if not len(band):
        return None
    small = min(part[1] - part[0], part[3] - part[2]) <= 3 * BAND
    found = best_source(scene, filled, patch, band, shifts[shifts[:, 1] == 0])
    if found is None or found[1] > _GOOD:
        if scene.floor is not None and _floor_beside(scene, part) and not small:
            return None
        found = best_source(scene, filled, patch, band, shifts)
    tiny = max(part[1] - part[0], part[3] - part[2]) <= 2 * BAND
    if found is not None and (found[1] <= (_FAIR if small else _GOOD) or tiny):
        return found[0]
    if (scene.floor is None and scene.bay is None) or tiny:
        anywhere = any_source(scene, filled, patch, band)
        return None if anywhere is None else anywhere[0]
    return None


def _floor_beside(scene: Scene, part: Box) -> bool:
    """Whether a floor of known texture of the same look lies right above or below: then nothing is cloned sideways."""
    floor = scene.floor or 0
    y0, y1, x0, x1 = part
    rows = np.arange(y0, y1)
    for step, (a, b) in ((-floor, (y0 - floor, y0)), (floor, (y1, y1 + floor))):
        if a < 0 or b > scene.known.shape[0] or not scene.known[a:b, x0:x1].all():
            continue
        there = np.clip(rows + step, 0, scene.known.shape[0] - 1)
        if scene.row_look[rows, there].mean() < _ALIKE:
            return True
    return False


def _split(part: Box) -> tuple[Box, Box]:
    y0, y1, x0, x1 = part
    if x1 - x0 > y1 - y0:
        middle = (x0 + x1) // 2
        return (y0, y1, x0, middle), (y0, y1, middle, x1)
    middle = (y0 + y1) // 2
    return (y0, middle, x0, x1), (middle, y1, x0, x1)


def _clone(scene: Scene, filled: np.ndarray, done: np.ndarray, part: Box, shift: tuple[int, int]) -> None:
    """Copy the patch from part + shift, extended over cloned pixels up to the best seam, its colours levelled."""
    height, width = done.shape
    box = _around(part, done.shape, 2 * BAND)
    y0, y1 = max(box[0], -shift[0]), min(box[1], height - shift[0])
    x0, x1 = max(box[2], -shift[1]), min(box[3], width - shift[1])
    here = np.s_[y0:y1, x0:x1]
    there = np.s_[y0 + shift[0] : y1 + shift[0], x0 + shift[1] : x1 + shift[1]]
    source, valid = scene.image[there], scene.known[there]
    new = np.zeros((y1 - y0, x1 - x0), bool)
    inside = np.s_[part[0] - y0 : part[1] - y0, part[2] - x0 : part[3] - x0]
    new[inside] = ~done[here][inside]
    ring = cv2.dilate(new.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    rim = (ring & ~new & done[here] & valid).astype(np.float32)
    if rim.any():
        source = source + level((filled[here] - source) * 255.0, rim) / 255.0
    old = filled[here]
    cloned = done[here] & ~scene.known[here] & valid
    reach = cv2.dilate(new.astype(np.uint8), np.ones((2 * BAND + 1, 2 * BAND + 1), np.uint8)) > 0
    shown = new
    if (cloned & reach).any():
        loose = cloned & reach
        shown = seam(old, source, ~(new | loose), new) & (new | loose)
    filled[here] = np.where(shown[..., None], np.clip(source, 0.0, 1.0), old)
    done[here] |= new


def _finish(image: np.ndarray, filled: np.ndarray, done: np.ndarray) -> np.ndarray:
    """To uint8; slivers that found no source are diffused from around."""
    out = np.clip(np.rint(filled * 255.0), 0, 255).astype(np.uint8)
    if not done.all():
        return np.asarray(cv2.inpaint(out, (~done).astype(np.uint8), 3, cv2.INPAINT_TELEA))
    return out
