"""Occluders of painted facades: trees, parked cars and lamp posts, painted last with their own generator."""

from __future__ import annotations

import cv2
import numpy as np

from benchmarks.painter.canvas import GAMMA, fractal_noise, gaussian_blur, hex_to_linear, smooth_noise
from facade_core.core.arrays import BoolArray, Float32Array, FloatArray, Int32Array, UInt8Array

MAX_HIDDEN_SHARE = 0.40
_LEAF_COLOURS = ("#5f7d3a", "#6f8a3f", "#4f6f3c", "#8a8b3c", "#b08a3a")
_CAR_COLOURS = ("#7d2b2b", "#2f4a6b", "#d9d7d0", "#3a3d40", "#8b9aa0", "#3f5a48", "#c2b280")

Sprite = tuple[Float32Array, Float32Array]  # colour (H, W, 3) linear and alpha (H, W), at twice the image's resolution


def paint_occluders(
    image: UInt8Array, metres_per_pixel: float, count: int, rng: np.random.Generator
) -> tuple[UInt8Array, BoolArray]:
    """Paint occluders over an image.

    Parameters
    ----------
    image : (H, W, 3) uint8 RGB.
    metres_per_pixel : resolution.
    count : number of occluders.
    rng : source of randomness.

    Returns
    -------
    image : (H, W, 3) uint8.
    hidden : (H, W) bool, exactly the pixels that changed.
    """
    hidden = np.zeros(image.shape[:2], bool)
    if count == 0:
        return image, hidden
    painted = (image / np.float32(255)) ** np.float32(GAMMA)
    scale = 2 / metres_per_pixel
    rows, columns = image.shape[0] * 2, image.shape[1] * 2
    kinds = [("tree", "car", "lamp", "tree", "car")[i % 5] for i in range(count)]
    share = min(0.045 + 0.04 * count, 0.24) * float(rng.uniform(0.85, 1.1)) / kinds.count("tree")
    places = (np.arange(count) + rng.uniform(0.25, 0.75, count)) / count
    rng.shuffle(places)
    for kind, place in sorted(zip(kinds, places, strict=True), key=lambda item: ("tree", "lamp", "car").index(item[0])):
        paint = {"tree": _paint_tree, "lamp": _paint_lamp_post, "car": _paint_car}[kind]
        colour, alpha = paint((rows, columns), scale, float(place), share, rng)
        small = cv2.resize(alpha, image.shape[1::-1], interpolation=cv2.INTER_AREA)
        small[small < 0.06] = 0
        if ((small > 0) | hidden).mean() > MAX_HIDDEN_SHARE - 0.01:
            continue
        premultiplied = cv2.resize(colour * alpha[..., None], image.shape[1::-1], interpolation=cv2.INTER_AREA)
        layer = (
            premultiplied
            / np.maximum(cv2.resize(alpha, image.shape[1::-1], interpolation=cv2.INTER_AREA), 1e-3)[..., None]
        )
        painted += small[..., None] * (layer - painted)
        hidden |= small > 0
    result = np.round(255 * np.clip(painted, 0, 1) ** np.float32(1 / GAMMA)).astype(np.uint8)
    result[~hidden] = image[~hidden]
    # Every hidden pixel must differ from the facade, so that the mask equals the changed pixels.
    same = hidden & (result == image).all(2)
    result[same, 1] = np.where(image[same, 1] > 127, image[same, 1] - 1, image[same, 1] + 1)
    return result, hidden


def _paint_tree(shape: tuple[int, int], scale: float, place: float, share: float, rng: np.random.Generator) -> Sprite:
    """Paint a street tree: a crown of leafy balls, lit from the upper left, with holes that show the wall."""
    rows, columns = shape
    area = share * rows * columns / 0.80
    half_x = min(max(np.sqrt(area / np.pi), area / np.pi / (0.28 * rows)), 0.46 * columns)
    half_y = min(area / np.pi / half_x, 0.28 * rows)
    clear = min(2.0 * scale, 0.2 * rows)
    cx = float(np.clip(place * columns, 0.7 * half_x, columns - 0.7 * half_x))
    cy = max(rows - clear - half_y, half_y)
    y, x = np.mgrid[:rows, :columns].astype(np.float32)
    crown = np.full(shape, -3.0, np.float32)
    for _ in range(26):
        turn, out = rng.uniform(0, 2 * np.pi), np.sqrt(rng.uniform(0, 1)) * 0.68
        bx, by = cx + half_x * out * np.cos(turn), cy + half_y * out * np.sin(turn)
        radius = rng.uniform(0.26, 0.42) * np.sqrt(half_x * half_y)
        y0, y1 = max(0, int(by - radius)), min(rows, int(by + radius) + 1)
        x0, x1 = max(0, int(bx - radius)), min(columns, int(bx + radius) + 1)
        at = (slice(y0, y1), slice(x0, x1))
        ball = 1 - ((x[at] - bx) ** 2 + (y[at] - by) ** 2) / radius**2
        # Each ball is brighter towards the light; the ball in front hides those behind.
        np.maximum(crown[at], ball, out=crown[at])
    leaf = fractal_noise(shape, 0.22 * scale, 3, rng)
    alpha = np.clip((crown + 0.34 * leaf - 0.12) * 9, 0, 1)
    bulk = gaussian_blur(np.clip(crown, 0, 1), 0.10 * scale)
    lit = cv2.Sobel(bulk, cv2.CV_32F, 1, 0, ksize=3) * 0.7 + cv2.Sobel(bulk, cv2.CV_32F, 0, 1, ksize=3)
    height = ((cy - y) / half_y) * 0.30 + ((cx - x) / half_x) * 0.16
    glint = smooth_noise(shape, 0.06 * scale, rng)
    light = np.clip(0.62 + height + 2.4 * lit + 0.22 * leaf + 0.16 * glint, 0.10, 1.6)
    green = hex_to_linear(_LEAF_COLOURS[int(rng.integers(len(_LEAF_COLOURS)))])
    colour = green * light[..., None]
    colour[..., 0] *= 0.75 + 0.35 * np.clip(light, 0, 1.2)
    trunk = np.zeros(shape, np.uint8)
    foot, wide = round(cx), max(2, round(0.14 * scale))
    lean = round(rng.uniform(-0.2, 0.2) * scale)
    taper = np.array(
        [[foot - wide, rows], [foot + wide, rows], [foot + lean + wide // 2, cy], [foot + lean - wide // 2, cy]]
    )
    cv2.fillPoly(trunk, [np.round(taper).astype(np.int32)], 1)
    for turn in rng.uniform(-1.0, 1.0, 4):
        tip = (round(foot + lean + 0.6 * half_x * np.sin(turn)), round(cy - 0.5 * half_y * np.cos(turn)))
        cv2.line(trunk, (foot + lean, round(min(cy + 0.5 * half_y, rows - 1))), tip, 1, max(1, wide // 2))
    bark = hex_to_linear("#6b5a4a") * (np.clip(0.85 - 0.5 * (x - foot) / wide, 0.3, 1.3) * (1 + 0.2 * leaf))[..., None]
    # The trunk's upper part is in the crown's own shade.
    bark *= np.clip(0.35 + (y - cy) / (half_y + 1) * 0.6, 0.3, 1)[..., None]
    colour = np.where((alpha < 0.5)[..., None], bark, colour) if trunk.any() else colour
    return colour.astype(np.float32), np.maximum(alpha, trunk).astype(np.float32)


def _paint_car(shape: tuple[int, int], scale: float, place: float, share: float, rng: np.random.Generator) -> Sprite:
    """Paint a parked car from the side."""
    rows, columns = shape
    long, tall = 4.3, 1.48
    left = float(np.clip(place * columns / scale - long / 2, -0.6, max(columns / scale - long + 0.6, -0.6)))
    ground = rows / scale
    flip = bool(rng.random() < 0.5)
    colour, alpha = np.zeros((*shape, 3), np.float32), np.zeros(shape, np.uint8)

    def px(points: list[tuple[float, float]]) -> Int32Array:
        corners = [((1 - x if flip else x) * long + left, ground - 0.02 - y * tall) for x, y in points]
        return np.round(np.array(corners) * scale).astype(np.int32)

    def fill(points: list[tuple[float, float]], tone: Float32Array) -> None:
        cv2.fillPoly(colour, [px(points)], tone.tolist())
        cv2.fillPoly(alpha, [px(points)], 1)

    paint = hex_to_linear(_CAR_COLOURS[int(rng.integers(len(_CAR_COLOURS)))])
    body = [(0.0, 0.18), (0.0, 0.42), (0.02, 0.55), (0.10, 0.62), (0.22, 0.65), (0.33, 0.95), (0.38, 0.99), (0.52, 1.0)]
    body += [
        (0.70, 0.98),
        (0.80, 0.90),
        (0.92, 0.66),
        (0.98, 0.62),
        (1.0, 0.50),
        (1.0, 0.20),
        (0.97, 0.15),
        (0.03, 0.15),
    ]
    fill(body, paint)
    fill([(0.01, 0.18), (0.99, 0.18), (1.0, 0.36), (0.0, 0.36)], paint * 0.62)
    fill([(0.01, 0.52), (0.99, 0.52), (0.97, 0.57), (0.04, 0.57)], paint * 1.35 + 0.03)
    glass = hex_to_linear("#3a4650")
    fill([(0.255, 0.66), (0.35, 0.92), (0.50, 0.94), (0.50, 0.66)], glass)
    fill([(0.52, 0.66), (0.52, 0.94), (0.70, 0.92), (0.78, 0.85), (0.84, 0.66)], glass)
    fill([(0.30, 0.74), (0.36, 0.90), (0.42, 0.91), (0.34, 0.74)], hex_to_linear("#93a6b2"))
    fill([(0.56, 0.74), (0.58, 0.91), (0.64, 0.91), (0.60, 0.74)], hex_to_linear("#93a6b2"))
    for seam in (0.235, 0.51, 0.735):
        fill([(seam, 0.22), (seam + 0.004, 0.22), (seam + 0.004, 0.64), (seam, 0.64)], paint * 0.4)
    fill([(0.01, 0.44), (0.05, 0.46), (0.05, 0.54), (0.02, 0.54)], hex_to_linear("#eee6c8"))
    fill([(0.96, 0.46), (0.995, 0.44), (0.985, 0.54), (0.96, 0.54)], hex_to_linear("#a22a22"))
    for axle in (0.19, 0.81):
        centre = tuple(int(v) for v in px([(axle, 0.215)])[0])
        for radius, tone in (
            (0.335, "#101113"),
            (0.31, "#1d1e20"),
            (0.20, "#9a9ca0"),
            (0.15, "#5d6064"),
            (0.05, "#b9bbbe"),
        ):
            cv2.circle(colour, centre, max(1, round(radius * scale)), hex_to_linear(tone).tolist(), -1)
            cv2.circle(alpha, centre, max(1, round(radius * scale)), 1, -1)
    return colour, alpha.astype(np.float32)


def _paint_lamp_post(
    shape: tuple[int, int], scale: float, place: float, share: float, rng: np.random.Generator
) -> Sprite:
    """Paint a cast-iron lamp post with one lantern."""
    rows, columns = shape
    tall = min(4.6, 0.8 * rows / scale)
    x, ground = float(np.clip(place * columns / scale, 0.4, columns / scale - 0.4)), rows / scale
    top = ground - tall
    colour, alpha = np.zeros((*shape, 3), np.float32), np.zeros(shape, np.uint8)

    def fill(points: list[tuple[float, float]], tone: FloatArray) -> None:
        corners = [np.round(np.array([(x + dx, y) for dx, y in points]) * scale).astype(np.int32)]
        cv2.fillPoly(colour, corners, tone.tolist())
        cv2.fillPoly(alpha, corners, 1)

    iron, shine = hex_to_linear("#22302c"), hex_to_linear("#5d6f68")
    for half, y0, y1 in ((0.05, top + 0.55, ground), (0.09, ground - 1.1, ground), (0.13, ground - 0.35, ground)):
        fill([(-half, y0), (half, y0), (half, y1), (-half, y1)], iron)
        fill([(-half, y0), (-half * 0.4, y0), (-half * 0.4, y1), (-half, y1)], shine)
    for y in (ground - 1.1, ground - 2.2, top + 0.62):
        fill([(-0.11, y - 0.03), (0.11, y - 0.03), (0.11, y + 0.03), (-0.11, y + 0.03)], iron)
    fill([(-0.10, top + 0.58), (0.10, top + 0.58), (0.19, top + 0.14), (-0.19, top + 0.14)], iron)
    fill([(-0.07, top + 0.55), (0.07, top + 0.55), (0.15, top + 0.17), (-0.15, top + 0.17)], hex_to_linear("#f3e3b0"))
    fill([(-0.012, top + 0.56), (0.012, top + 0.56), (0.012, top + 0.14), (-0.012, top + 0.14)], iron)
    fill([(-0.24, top + 0.15), (0.24, top + 0.15), (0.06, top - 0.02), (-0.06, top - 0.02)], iron)
    return colour, alpha.astype(np.float32)
