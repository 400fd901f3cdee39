"""Balconies: a slab on the wall, and a railing as a plate in front of it."""

from __future__ import annotations

import cv2
import numpy as np

from benchmarks.painter.canvas import Canvas, WallAttachment, fractal_noise, hex_to_linear
from facade_core.core.arrays import Float32Array, Float64Array

BALCONY_DEPTH_M = {"iron": 0.75, "bars": 0.9, "solid": 0.95, "stone": 0.8}
_FLOWER_COLOURS = ("#c8413c", "#d96a8c", "#e0a63a", "#b65bb0", "#f0e6e0")


def paint_balcony(
    canvas: Canvas,
    box: tuple[float, float, float, float],
    railing: str,
    state: str,
    stone: Float32Array,
    render: Float32Array,
    rng: np.random.Generator,
    *,
    spacing: int,
) -> None:
    """Paint a balcony into its box.

    Parameters
    ----------
    canvas : changed in place.
    box : x0, y0, x1, y1 in metres.
    railing : iron, bars, solid or stone.
    state : "flowers" adds a flower box.
    stone, render : (3,) linear light of the slab and of a solid parapet.
    rng : source of randomness.
    spacing : raster pixels from bar to bar.
    """
    x0, y0, x1, y1 = box
    slab = min(0.26, 0.25 * (y1 - y0))
    depth = BALCONY_DEPTH_M[railing] if x1 - x0 > 1.6 or railing != "iron" else 0.45
    canvas.add_moulding(x0, y1 - slab, x1, y1, stone, (depth, depth, depth, 0.8 * depth, 0.6 * depth, 0.45 * depth))
    rows, columns = canvas.region(x0, y0, x1, y1 - slab)
    shape = (rows.stop - rows.start, columns.stop - columns.start)
    if railing in ("solid", "stone"):
        colour, alpha = _parapet(shape, canvas.scale, stone if railing == "stone" else render, railing)
    else:
        colour, alpha = _ironwork(shape, canvas.scale, spacing, is_ornate=railing == "iron")
    if state == "flowers":
        _add_flowers(colour, alpha, canvas.scale, rng)
    canvas.plates.append(WallAttachment(colour, alpha, rows.start, columns.start, depth))


def paint_brackets(canvas: Canvas, places: Float64Array, y: float, stone: Float32Array) -> None:
    """Paint scrolled stone brackets under a slab.

    Parameters
    ----------
    canvas : changed in place.
    places : (n,) x of their centres in metres.
    y : lower edge of the slab in metres.
    stone : (3,) linear light.
    """
    for x in places:
        canvas.add_moulding(x - 0.10, y, x + 0.10, y + 0.36, stone, (0.42, 0.40, 0.26, 0.16, 0.14, 0.05))


def _ironwork(
    shape: tuple[int, int], scale: float, spacing: int, *, is_ornate: bool
) -> tuple[Float32Array, Float32Array]:
    rows, columns = shape
    alpha = np.zeros(shape, np.uint8)
    rail = max(2, round(0.05 * scale))
    # As many bars as fit, spread so that both ends close on one.
    count = max(2, round(columns / spacing))
    for x in np.linspace(0, columns - 1, count + 1):
        alpha[:, max(0, round(x) - 1) : round(x) + 1] = 190
    if is_ornate:
        band = round(0.22 * rows)
        radius = max(3, round(0.075 * scale))
        for x in np.linspace(0, columns - 1, max(2, round(columns / (2 * spacing))) + 1):
            cv2.circle(alpha, (round(x), band), radius, 215, max(1, round(0.018 * scale)))
            cv2.circle(alpha, (round(x), round(0.66 * rows)), radius, 215, max(1, round(0.018 * scale)))
        alpha[round(0.40 * rows) : round(0.40 * rows) + 2] = 200
    alpha[:rail] = 255
    alpha[-rail:] = 235
    alpha[:, :2] = alpha[:, -2:] = 255
    colour = np.full((*shape, 3), hex_to_linear("#23272a"), np.float32)
    colour[: max(1, rail // 2)] = hex_to_linear("#5b6166")
    return colour, np.asarray(alpha.astype(np.float32) / 255, np.float32)


def _parapet(
    shape: tuple[int, int], scale: float, colour: Float32Array, railing: str
) -> tuple[Float32Array, Float32Array]:
    rows, columns = shape
    alpha = np.ones(shape, np.float32)
    y = ((np.arange(rows) + 0.5) / rows)[:, None]
    x = (np.arange(columns) + 0.5) / columns
    if railing == "solid":
        # Rounded ends turn away from the sun on the right, towards it on the left.
        end = min(0.45, 0.55 * scale / columns)
        round_off = 1 + 0.06 * np.clip(1 - x / end, 0, 1) ** 2 - 0.48 * np.clip(1 - (1 - x) / end, 0, 1) ** 2
        ribs = 1 + 0.05 * np.sin(2 * np.pi * x * round(columns / scale / 0.28))
        image = colour * (round_off * ribs * (0.98 - 0.16 * y**3))[..., None]
        rail = max(2, round(0.05 * scale))
        gap = max(2, round(0.24 * scale))
        alpha[rail:gap] = 0
        image[:rail] = hex_to_linear("#4a4e50")
        for post in np.linspace(2, columns - 3, max(2, round(columns / scale / 0.9))):
            alpha[rail:gap, round(post) - 1 : round(post) + 2] = 1
            image[rail:gap, round(post) - 1 : round(post) + 2] = hex_to_linear("#4a4e50")
        image[gap : gap + max(1, rail // 2)] *= 1.15
        return image.astype(np.float32), alpha
    count = max(3, round(columns / scale / 0.24))
    phase = (x * count) % 1 * 2 - 1
    # A baluster: thin neck, round belly below the middle, and a foot.
    profile = 0.34 + 0.42 * np.exp(-(((y - 0.62) / 0.17) ** 2)) + 0.30 * (y < 0.24) + 0.35 * (y > 0.86)
    alpha = (np.abs(phase) < profile).astype(np.float32)
    image = colour * (1.05 - 0.38 * np.clip(phase / profile, -1, 1) - 0.12)[..., None]
    solid = (y < 0.17) | (y > 0.90) | (x < 0.3 * scale / columns) | (x > 1 - 0.3 * scale / columns)
    alpha = np.maximum(alpha, solid)
    image = np.where(solid[..., None], colour * np.where(y < 0.06, 1.12, 0.98)[..., None], image)
    return image.astype(np.float32), alpha.astype(np.float32)


def _add_flowers(colour: Float32Array, alpha: Float32Array, scale: float, rng: np.random.Generator) -> None:
    """Add a flower box along the rail: overhanging leaves, and blossom of one colour."""
    rows = alpha.shape[0]
    box = slice(0, min(rows, round(0.42 * scale)))
    shape = alpha[box].shape
    hang = np.linspace(1.5, -1.6, shape[0], dtype=np.float32)[:, None]
    leaves = fractal_noise(shape, 0.11 * scale, 2, rng) + hang > 0
    tone = 1 + 0.35 * fractal_noise(shape, 0.05 * scale, 2, rng)
    green = hex_to_linear("#557a3c") * np.clip(tone, 0.4, 1.8)[..., None]
    blossom = leaves & (fractal_noise(shape, 0.07 * scale, 2, rng) > 0.75)
    petal = hex_to_linear(_FLOWER_COLOURS[int(rng.integers(len(_FLOWER_COLOURS)))]) * np.clip(tone, 0.7, 1.3)[..., None]
    colour[box] = np.where(blossom[..., None], petal, np.where(leaves[..., None], green, colour[box]))
    alpha[box] = np.maximum(alpha[box], leaves)
