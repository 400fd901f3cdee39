"""Two pictures of one facade, made of a photo of it: what changed between them is known, and what only looks so is there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.painter.occluders import paint_occluders
from facade_core.core.labels import FacadeClass
from facade_core.imagery.rectify.fusion import ChartView
from training.datasets.facades import LabelledFacade

# Metres that the facades are taken to be high: they have five to seven storeys.
HEIGHT_M = 17.0
KINDS = ("nothing", "shop", "sign", "windows", "paint", "scaffold", "house")
# Of the picture's pose: how far its corners are off on the wall, metres; the most that all of it is.
CORNER_M, WHOLE_M = 0.06, 0.25


class Pair(NamedTuple):
    """Views of one facade, newer and older; texels per metre; changed (h, w) bool, where the wall itself differs."""

    newer: ChartView
    older: ChartView
    density: float
    changed: np.ndarray


def pair_of(facade: LabelledFacade, others: Sequence[LabelledFacade], kind: str, rng: np.random.Generator) -> Pair:
    """Two pictures of a facade with a change of a kind between them."""
    density = len(facade.image) / HEIGHT_M
    changed_to, changed = _CHANGES[kind](facade, others, density, rng)
    views = [_taken(image, facade.labels, density, rng) for image in (facade.image, changed_to)]
    return Pair(views[1], views[0], density, changed)


def _taken(image: np.ndarray, labels: np.ndarray, density: float, rng: np.random.Generator) -> ChartView:
    """A wall as a camera shows it on some day: its windows mirror something, light, shadow, things in front, pose, lens."""
    import cv2

    rows, columns = image.shape[:2]
    lit = (_mirrored(image, labels, rng) / np.float32(255)) ** np.float32(2.2)
    lit = lit * _shadow((rows, columns), density, rng)[..., None]
    lit = lit * (rng.uniform(0.6, 1.3) * rng.uniform(0.9, 1.1, 3)).astype(np.float32)
    shown = np.clip(lit, 0, 1) ** np.float32(1 / (2.2 * rng.uniform(0.9, 1.1)))
    shown = np.round(255 * shown).astype(np.uint8)
    shown, hidden = paint_occluders(shown, 1 / density, int(rng.integers(0, 4)), rng)
    corners = np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], np.float32)
    off = rng.normal(0, CORNER_M, (4, 2)) + rng.uniform(-WHOLE_M, WHOLE_M, 2)
    warp = cv2.getPerspectiveTransform(corners, corners + (off * density).astype(np.float32))
    shown = cv2.warpPerspective(shown, warp, (columns, rows), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    # what is hidden is known to within a rim
    around = cv2.dilate(hidden.astype(np.uint8), np.ones((9, 9), np.uint8))
    hidden = cv2.warpPerspective(around, warp, (columns, rows), flags=cv2.INTER_NEAREST).astype(bool)
    seen = cv2.warpPerspective(np.ones((rows, columns), np.uint8), warp, (columns, rows), flags=cv2.INTER_NEAREST)
    share = float(rng.uniform(0.35, 1.0))  # of the texels' resolution
    small = cv2.resize(shown, (round(columns * share), round(rows * share)), interpolation=cv2.INTER_AREA)
    small = np.clip(small + rng.normal(0, rng.uniform(1, 4), small.shape), 0, 255).astype(np.uint8)
    _, jpeg = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(70, 96))])
    shown = cv2.resize(
        np.asarray(cv2.imdecode(jpeg, cv2.IMREAD_COLOR)), (columns, rows), interpolation=cv2.INTER_LINEAR
    )
    return ChartView(
        np.asarray(shown, np.uint8), seen.astype(bool), np.full((rows, columns), share, np.float32), hidden
    )


def _mirrored(image: np.ndarray, labels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """With other things behind and in the panes of four windows in ten: sky, a curtain, a room that is lit."""
    import cv2

    count, parts, boxes, _ = cv2.connectedComponentsWithStats((labels == FacadeClass.WINDOW).astype(np.uint8))
    shown = image.astype(np.float32)
    for part in range(1, count):
        if rng.random() > 0.4 or boxes[part, 4] < 30:
            continue
        x, y, width, height = boxes[part, :4]
        ramp = np.linspace(rng.uniform(0, 1), rng.uniform(0, 1), height, dtype=np.float32)[:, None, None]
        veil = ramp * rng.uniform(60, 235, 3).astype(np.float32)
        own, at = shown[y : y + height, x : x + width], parts[y : y + height, x : x + width] == part
        own[at] = (own + rng.uniform(0.15, 0.6) * (veil - own) * np.ones_like(own))[at]
    return shown


def _shadow(shape: tuple[int, int], density: float, rng: np.random.Generator) -> np.ndarray:
    """Light (h, w) float32: 1, and less where a house opposite, or a cornice, shades the wall, in two of three pictures."""
    import cv2

    light = np.ones(shape, np.float32)
    if rng.random() < 1 / 3:
        return light
    rows, columns = shape
    edge = rng.uniform(0, 1, 3) * rows
    line = np.array([[0, edge[0]], [columns / 2, edge[1]], [columns, edge[2]], [columns, rows], [0, rows]])
    if rng.random() < 0.5:  # from one side
        line = np.array([[0, 0], [edge[0] / rows * columns, 0], [edge[1] / rows * columns, rows], [0, rows]])
    cv2.fillPoly(light, [line.astype(np.int32)], float(rng.uniform(0.3, 0.7)))
    return cv2.GaussianBlur(light, (0, 0), max(1.0, rng.uniform(0.02, 0.3) * density))


_Changed = tuple[np.ndarray, np.ndarray]


def _nothing(
    facade: LabelledFacade, others: Sequence[LabelledFacade], density: float, rng: np.random.Generator
) -> _Changed:
    return facade.image, np.zeros(facade.labels.shape, bool)


def _pasted(facade: LabelledFacade, other: np.ndarray, box: tuple[int, int, int, int]) -> _Changed:
    """A picture laid into a box x0, y0, x1, y1."""
    import cv2

    x0, y0, x1, y1 = box
    image, changed = facade.image.copy(), np.zeros(facade.labels.shape, bool)
    image[y0:y1, x0:x1] = cv2.resize(other, (x1 - x0, y1 - y0), interpolation=cv2.INTER_AREA)
    changed[y0:y1, x0:x1] = True
    return image, changed


def _shop(
    facade: LabelledFacade, others: Sequence[LabelledFacade], density: float, rng: np.random.Generator
) -> _Changed:
    """Another house's ground floor, on all of the width or half of it."""
    rows, columns = facade.labels.shape
    other = others[int(rng.integers(len(others)))]
    shop = np.flatnonzero((other.labels == FacadeClass.SHOP).mean(axis=1) > 0.2)
    top = shop[0] if len(shop) else round(0.8 * len(other.labels))
    own = np.flatnonzero((facade.labels == FacadeClass.SHOP).mean(axis=1) > 0.2)
    y0 = int(own[0]) if len(own) else round(0.8 * rows)
    x0, x1 = [(0, columns), (0, columns // 2), (columns // 2, columns)][int(rng.integers(3))]
    return _pasted(facade, other.image[top:], (x0, min(y0, rows - 20), x1, rows))


def _sign(
    facade: LabelledFacade, others: Sequence[LabelledFacade], density: float, rng: np.random.Generator
) -> _Changed:
    """A board with letters over the ground floor."""
    import cv2

    rows, columns = facade.labels.shape
    high, wide = round(rng.uniform(0.7, 1.4) * density), round(rng.uniform(0.5, 0.95) * columns)
    board = np.full((high, wide, 3), rng.integers(0, 256, 3), np.uint8)
    text = "".join(rng.choice(list("ABCDEFGHKLMNORSTU"), 9))
    ink = (255 - board[0, 0]).tolist()
    cv2.putText(board, text, (4, round(0.75 * high)), cv2.FONT_HERSHEY_DUPLEX, high / 36, ink, max(1, high // 14))
    x0, y0 = int(rng.integers(0, columns - wide + 1)), round(rng.uniform(0.68, 0.8) * rows)
    return _pasted(facade, board, (x0, y0, x0 + wide, y0 + high))


def _windows(
    facade: LabelledFacade, others: Sequence[LabelledFacade], density: float, rng: np.random.Generator
) -> _Changed:
    """Some storeys of another house: other windows, at other places."""
    rows, columns = facade.labels.shape
    other = others[int(rng.integers(len(others)))].image
    share = rng.uniform(0.15, 0.5)
    y0, from_y = (int(rng.uniform(0.1, 0.75 - share) * n) for n in (rows, len(other)))
    return _pasted(
        facade, other[from_y : from_y + round(share * len(other))], (0, y0, columns, y0 + round(share * rows))
    )


def _paint(
    facade: LabelledFacade, others: Sequence[LabelledFacade], density: float, rng: np.random.Generator
) -> _Changed:
    """The wall in another colour, all of it or some storeys."""
    rows = len(facade.labels)
    changed = facade.labels == FacadeClass.WALL
    changed[: round(rng.choice([0.0, 0.0, 0.3, 0.5]) * rows)] = False
    tone = np.array([[0.9, 0.55, 0.5], [0.55, 0.75, 0.95], [1.0, 0.85, 0.5], [0.6, 0.85, 0.6], [0.95, 0.65, 0.35]])
    image = facade.image.copy()
    image[changed] = np.round(image[changed] * tone[rng.integers(len(tone))])
    return image, changed


def _scaffold(
    facade: LabelledFacade, others: Sequence[LabelledFacade], density: float, rng: np.random.Generator
) -> _Changed:
    """Tubes, boards and a net before a part of the wall."""
    import cv2

    rows, columns = facade.labels.shape
    x0, x1 = sorted(
        [0 if rng.random() < 0.5 else int(rng.uniform(0, 0.4) * columns), int(rng.uniform(0.6, 1) * columns)]
    )
    y0 = int(rng.uniform(0, 0.4) * rows)
    image, changed = facade.image.copy(), np.zeros((rows, columns), bool)
    changed[y0:, x0:x1] = True
    net, sheer = rng.uniform(90, 230, 3), rng.uniform(0.45, 0.8)
    image[changed] = np.round(image[changed] * (1 - sheer) + sheer * net)
    thick = max(1, round(0.07 * density))
    for y in range(y0, rows, round(2.0 * density)):
        cv2.rectangle(image, (x0, y), (x1, y + 3 * thick), (120, 95, 60), -1)
        cv2.line(image, (x0, y - round(density)), (x1, y - round(density)), (160, 160, 165), thick)
    for x in range(x0, x1, round(2.5 * density)):
        cv2.line(image, (x, y0), (x, rows), (150, 150, 155), thick)
    return np.where(changed[..., None], image, facade.image), changed


def _house(
    facade: LabelledFacade, others: Sequence[LabelledFacade], density: float, rng: np.random.Generator
) -> _Changed:
    """Another house in its place."""
    rows, columns = facade.labels.shape
    return _pasted(facade, others[int(rng.integers(len(others)))].image, (0, 0, columns, rows))


_CHANGES: dict[str, Callable[..., _Changed]] = {
    "nothing": _nothing,
    "shop": _shop,
    "sign": _sign,
    "windows": _windows,
    "paint": _paint,
    "scaffold": _scaffold,
    "house": _house,
}
