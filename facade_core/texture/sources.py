"""Where a hidden patch is copied from: candidate translations and their price (floors paper, section 3.2.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy import fft
from scipy.spatial.distance import cdist

BAND = 8  # px around a patch over which the source must agree with what is known
_DRIFT = 6  # px by which floors and bays stray from an even spacing; strays beyond 2 px cost
_ROWS = 0.2  # price of taking rows (columns) from rows of another look
_COLUMNS = 0.1  # weight of columns' looks beside rows'
_GUIDE = 1.0  # price of a source whose elements are not where the layout has them
_SIDEWAYS = 0.01  # price of not cloning straight up or down
_STRAY = 0.002  # price of a pixel by which a translation strays from a multiple, beyond 2 px
_FAR = 8
_TRIED = 400  # translations of smallest SSD that get a full price where all are searched


@dataclass(frozen=True, slots=True)
class Scene:
    """What does not change while a hole is filled.

    image (H, W, 3) float32 in 0-1; known (H, W) bool; row_look (H, H) and column_look (W, W), how different rows and
    columns look; guide (H, W) uint8, class ids where they are known or planned, 255 elsewhere; floor and bay in px.
    """

    image: np.ndarray
    known: np.ndarray
    row_look: np.ndarray
    column_look: np.ndarray
    guide: np.ndarray
    floor: int | None
    bay: int | None


def looks(image: np.ndarray, labels: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How different rows look, (H, H) float32, and columns, (W, W): city-block distance between what is visible of them.

    Compared are the mean colour, 0-1, and the share of every label.
    """
    onehot = (labels[..., None] == np.arange(7)).astype(np.float32)
    features = np.concatenate([image, onehot], 2) * known[..., None]
    out = []
    for axis in (1, 0):
        count = known.sum(axis).astype(np.float32)
        mean = features.sum(axis) / np.maximum(count, 1.0)[:, None]
        enough = count >= 0.1 * known.shape[axis]
        if enough.any():  # rows that are hidden altogether look like the nearest that are not
            rows = np.flatnonzero(enough)
            nearest = rows[np.abs(np.arange(len(mean))[:, None] - rows[None]).argmin(1)]
            mean = mean[nearest]
        out.append(cdist(mean, mean, "cityblock").astype(np.float32))
    return out[0], out[1]


def candidates(pitch_y: int | None, pitch_x: int | None, shape: tuple[int, int]) -> np.ndarray:
    """Translations (n, 3): dy, dx in multiples of the floor height and bay width, and how far they stray from them.

    Any straight vertical or horizontal translation is one too, at the price of straying far.
    """
    steps = [_steps(pitch, size) for pitch, size in ((pitch_y, shape[0]), (pitch_x, shape[1]))]
    (dy, stray_y), (dx, stray_x) = steps
    both = [
        np.stack([np.repeat(dy, len(dx)), np.tile(dx, len(dy))], 1),
        (np.repeat(stray_y, len(dx)) + np.tile(stray_x, len(dy)))[:, None],
    ]
    table = np.concatenate(both, 1)
    straight = (table[:, 0] == 0) ^ (table[:, 1] == 0)
    exact = (table[:, 2] == 0) & (table[:, 0] % 2 == 0) & (table[:, 1] % 2 == 0)
    oblique = exact & (table[:, 0] != 0) & (table[:, 1] != 0)
    lines = [np.arange(-size + BAND, size - BAND + 1) for size in shape]
    anywhere = [
        np.stack([lines[0], 0 * lines[0], 0 * lines[0] + _FAR], 1),
        np.stack([0 * lines[1], lines[1], 0 * lines[1] + _FAR], 1),
    ]
    return np.concatenate([table[straight | oblique], *(a[a[:, :2].any(1)] for a in anywhere)])


def _steps(pitch: int | None, size: int) -> tuple[np.ndarray, np.ndarray]:
    if pitch is None:
        return np.zeros(1, int), np.zeros(1, int)
    count = size // pitch
    stray = np.arange(-_DRIFT, _DRIFT + 1)
    at = [np.zeros(1, int)] + [k * pitch + stray for k in range(-count, count + 1) if k]
    off = [np.zeros(1, int)] + [np.maximum(np.abs(stray) - 2, 0) for k in range(-count, count + 1) if k]
    return np.concatenate(at), np.concatenate(off)


def best_source(
    scene: Scene, filled: np.ndarray, patch: np.ndarray, band: np.ndarray, shifts: np.ndarray
) -> tuple[tuple[int, int], float] | None:
    """The cheapest translation of (n, 3) shifts under which the patch falls on known pixels only, and its price.

    patch, band (k, 2) int32 pixel positions y, x. The price is the mean squared difference SSD(t) over the band's
    pixels that fall on known ones, plus the prices of another look of rows and columns, another guide, and straying.
    """
    if not len(shifts):
        return None
    thin = band[:: max(1, len(band) // 300)]
    sample = patch[:: max(1, len(patch) // 300)]
    best, price = _cheapest(
        scene.image, scene.known, filled, scene.guide, scene.row_look, scene.column_look, patch, thin, sample,
        shifts.astype(np.int64),
    )  # fmt: skip
    return None if best < 0 else ((int(shifts[best, 0]), int(shifts[best, 1])), float(price))


@njit(cache=True)
def _falls_on(known, pixels, dy, dx):
    for k in range(len(pixels)):
        y, x = pixels[k, 0] + dy, pixels[k, 1] + dx
        if y < 0 or y >= known.shape[0] or x < 0 or x >= known.shape[1] or not known[y, x]:
            return False
    return True


@njit(cache=True)
def _cheapest(image, known, filled, guide, row_look, column_look, patch, band, sample, shifts):
    height, width = known.shape
    best, lowest = -1, np.inf
    for n in range(len(shifts)):
        dy, dx = shifts[n, 0], shifts[n, 1]
        # The sample is spread over the patch, so that it turns most misfits down early.
        if not _falls_on(known, sample, dy, dx):
            continue
        look, wrong, planned = 0.0, 0.0, 0
        for k in range(len(sample)):
            y, x = sample[k, 0], sample[k, 1]
            if dy != 0:
                look += row_look[y, y + dy]
            if dx != 0:
                look += _COLUMNS * column_look[x, x + dx]
            if guide[y, x] != 255 and guide[y + dy, x + dx] != 255:
                planned += 1
                wrong += guide[y, x] != guide[y + dy, x + dx]
        price = _ROWS * look / len(sample) + _GUIDE * wrong / max(planned, 1) + _STRAY * shifts[n, 2]
        price += _SIDEWAYS * (dx != 0)
        squared, seen = 0.0, 0
        for k in range(len(band)):
            if price + squared / len(band) >= lowest:
                break
            y, x = band[k, 0] + dy, band[k, 1] + dx
            if 0 <= y < height and 0 <= x < width and known[y, x]:
                seen += 1
                for c in range(3):
                    squared += (filled[band[k, 0], band[k, 1], c] - image[y, x, c]) ** 2
        price += squared / max(seen, 1)
        if price < lowest and 2 * seen >= len(band) and _falls_on(known, patch, dy, dx):
            best, lowest = n, price
    return best, lowest


def any_source(
    scene: Scene, filled: np.ndarray, patch: np.ndarray, band: np.ndarray
) -> tuple[tuple[int, int], float] | None:
    """The cheapest among all translations: SSD by fast Fourier transforms, full prices for the best; None if none fits."""
    height, width = scene.known.shape
    shape = [fft.next_fast_len(2 * n, real=True) for n in (height, width)]

    def forward(array: np.ndarray) -> np.ndarray:
        return fft.rfft2(array, shape)

    def correlate(template: np.ndarray, spectrum: np.ndarray) -> np.ndarray:
        return fft.irfft2(np.conj(forward(template)) * spectrum, shape)

    place, ring = np.zeros((height, width)), np.zeros((height, width))
    place[patch[:, 0], patch[:, 1]] = 1.0
    ring[band[:, 0], band[:, 1]] = 1.0
    known = scene.known.astype(np.float64)
    visible = scene.image * known[..., None]
    spectrum = forward(known)
    covered = correlate(place, spectrum)
    seen = correlate(ring, spectrum)
    squared = correlate(ring, forward((visible**2).sum(2)))
    for c in range(3):
        template = filled[..., c] * ring
        squared -= 2.0 * correlate(template, forward(visible[..., c]))
        squared += correlate(template**2, spectrum)
    price = np.where(
        (covered > len(patch) - 0.5) & (seen >= max(1.0, 0.6 * len(band))), squared / np.maximum(seen, 1), np.inf
    )
    likely = np.argsort(price, axis=None, kind="stable")[:_TRIED]
    likely = likely[np.isfinite(price.flat[likely])]
    dy, dx = (
        np.where(t < n, t, t - s) for t, n, s in zip(np.divmod(likely, shape[1]), (height, width), shape, strict=True)
    )
    return best_source(scene, filled, patch, band, np.stack([dy, dx, np.full(len(likely), _FAR)], 1))
