"""What panoramas of one surface agree on: squares of it compared by their mean colours, and thin things that only one shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from facade_core.core.levelling import fill_unknown
from facade_core.imagery.rectify.fusion import View

# Side of the squares by which cameras are compared, metres, and how far apart their colours may be, as logarithms of their
# ratio: what is the same ground in two pictures of one exposure is within it.
SQUARE_M, APART = 0.5, 0.22
# A square of which less is clear is not compared.
LEAST_CLEAR = 0.25
# Side of the cells in which thin things are looked for, metres: trunks, posts, cables, of which a square is not. One is as far
# off the median of so much around it as this, as a logarithm, and goes with a rim of so many cells, unless another camera shows
# that colour within as many cells.
THIN_M, BESIDE_M, THIN, RIM = 0.125, 1.6, 0.3, 2


class SquareAgreement(NamedTuple):
    """Squares of n views, `side` texels each: whether enough of each is clear, whether another view agrees with it there, and
    whether one contradicts it, (n, r, c) bool; the logarithms (n, r, c, 3) of its mean colour."""

    side: int
    is_usable: np.ndarray
    is_confirmed: np.ndarray
    is_contradicted: np.ndarray
    log_colour: np.ndarray

    def unconfirmed_squares(self, view: int) -> np.ndarray:
        """The squares (r, c) bool that one view shows and no other."""
        return self.is_usable[view] & ~self.is_confirmed[view] & ~self.is_contradicted[view]


def compare_squares(views: Sequence[View], density: float) -> SquareAgreement:
    """The squares of views of one exposure; density in texels per metre. A view agrees with another that shows its colour there
    or in a square beside, as a pose may be off by one."""
    side = max(1, round(SQUARE_M * density))
    there = np.stack([_means(view.clear.astype(np.float32), side) for view in views]) > LEAST_CLEAR
    logs = np.stack([_logs(view, side) for view in views])
    supported, opposed = np.zeros(there.shape, bool), np.zeros(there.shape, bool)
    for i in range(len(views)):
        for j in range(len(views)):
            if i == j:
                continue
            both = there[i] & there[j]
            agree = both & _near(logs[i], logs[j], there[j]) & _near(logs[j], logs[i], there[i])
            supported[i] |= agree
            opposed[i] |= both & ~agree
    return SquareAgreement(side, there, supported, opposed, logs)


def find_thin_objects(views: Sequence[View], density: float) -> list[np.ndarray]:
    """Texels (h, w) bool of each view that stand out from the surface around them, which no other view confirms."""
    import cv2

    side = max(1, round(THIN_M * density))
    window = 2 * round(BESIDE_M / THIN_M / 2) + 1
    there = [_means(view.clear.astype(np.float32), side) > LEAST_CLEAR for view in views]
    logs = [_logs(view, side) for view in views]
    found = []
    for i, view in enumerate(views):
        colour = np.rint(fill_unknown(np.exp(logs[i]), there[i])).clip(1, 255).astype(np.uint8)
        usual = np.log(np.maximum(cv2.medianBlur(colour, window), 1).astype(np.float32))
        odd = there[i] & (np.abs(logs[i] - usual).max(axis=2) > THIN)
        for j in range(len(views)):
            if j != i and odd.any():
                odd &= ~_near(logs[i], logs[j], there[j], RIM)
        wide = cv2.dilate(odd.astype(np.uint8), np.ones((2 * RIM + 1,) * 2, np.uint8)) > 0
        found.append(squares_to_texels(wide, side, view.seen.shape))
    return found


def squares_to_texels(squares: np.ndarray, side: int, shape: tuple[int, ...]) -> np.ndarray:
    """Squares (r, c) of `side` texels on the texels (h, w) of a raster."""
    return squares.repeat(side, axis=0).repeat(side, axis=1)[: shape[0], : shape[1]]


def _near(one: np.ndarray, other: np.ndarray, there: np.ndarray, reach: int = 1) -> np.ndarray:
    """Squares (r, c) of which another view shows the colour there or so many beside: a pose may be off by that."""
    found = np.zeros(there.shape, bool)
    rows, columns = there.shape
    padded = np.pad(other, ((reach, reach), (reach, reach), (0, 0)))
    known = np.pad(there, reach)
    for down in range(2 * reach + 1):
        for right in range(2 * reach + 1):
            at = (slice(down, down + rows), slice(right, right + columns))
            found |= known[at] & (np.abs(one - padded[at]).max(axis=2) <= APART)
    return found


def _logs(view: View, side: int) -> np.ndarray:
    """Logarithms of the mean colour of the clear texels of squares: (r, c, 3)."""
    clear = view.clear
    share = _means(clear.astype(np.float32), side)
    total = _means(view.rgb * clear[..., None].astype(np.float32), side)
    return np.log(np.maximum(total / np.maximum(share, 1e-6)[..., None], 1.0))


def _means(array: np.ndarray, side: int) -> np.ndarray:
    """Means over squares of `side` texels of an array (h, w) or (h, w, 3); beyond the border lies 0."""
    import cv2

    rows, columns = (-(-n // side) for n in array.shape[:2])
    padding = (0, rows * side - array.shape[0], 0, columns * side - array.shape[1])
    whole = cv2.copyMakeBorder(array.astype(np.float32), *padding, cv2.BORDER_CONSTANT, value=(0, 0, 0))
    return cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA)
