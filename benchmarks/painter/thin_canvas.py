"""Canvas of thin occluders: tubes, boxes, discs and polygons in metres, with soft edges."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array, UInt8Array

RGB = tuple[int, int, int]
Point = tuple[float, float]

# Canvas pixels per picture pixel, along each side.
_OVERSAMPLING = 3
# Fractional bits of the corners of polygons.
_SHIFT = 4
# Light across a tube, from its left edge: start and end as shares of its width, and brightness.
_TUBE_SHADES = ((0.0, 1.0, 0.62), (0.0, 0.72, 1.0), (0.18, 0.4, 1.28))


class ThinCanvas:
    """Transparent picture on which occluders are drawn.

    Positions are metres: x from the left border, y above the ground.

    Parameters
    ----------
    shape : height and width of the picture in pixels.
    metres_per_pixel : resolution of the picture.
    foot : row of the ground in pixels.
    """

    def __init__(self, shape: tuple[int, int], metres_per_pixel: float, foot: float) -> None:
        self.shape = shape
        self.scale = _OVERSAMPLING / metres_per_pixel
        self.foot = foot * _OVERSAMPLING
        size = (shape[0] * _OVERSAMPLING, shape[1] * _OVERSAMPLING)
        self.rgba = np.zeros((*size, 4), np.uint8)

    @property
    def width_m(self) -> float:
        """Return the width of the picture."""
        return self.rgba.shape[1] / self.scale

    @property
    def top_m(self) -> float:
        """Return the height of its upper border above the ground."""
        return self.foot / self.scale

    @property
    def bottom_m(self) -> float:
        """Return the height of its lower border above the ground."""
        return (self.foot - self.rgba.shape[0]) / self.scale

    def polygon(self, corners: Sequence[Point], colour: RGB, opacity: float = 1.0) -> None:
        """Fill a polygon."""
        points = np.array(corners, np.float64) * (self.scale, -self.scale) + (0, self.foot)
        fixed = np.round(np.clip(points, -1e5, 1e5) * 2**_SHIFT).astype(np.int32)
        cv2.fillPoly(self.rgba, [fixed], (*colour, round(255 * opacity)), cv2.LINE_8, _SHIFT)

    def box(self, x: float, y: float, width: float, height: float, colour: RGB, opacity: float = 1.0) -> None:
        """Fill an upright box around x, from y up."""
        left, right = x - width / 2, x + width / 2
        self.polygon([(left, y), (right, y), (right, y + height), (left, y + height)], colour, opacity)

    def disc(self, x: float, y: float, radius: float, colour: RGB) -> None:
        """Fill a disc."""
        turn = np.linspace(0, 2 * np.pi, 28, endpoint=False)
        self.polygon(
            list(zip((x + radius * np.cos(turn)).tolist(), (y + radius * np.sin(turn)).tolist(), strict=True)), colour
        )

    def tube(self, line: Sequence[Point], widths: tuple[float, float], colour: RGB, rng: np.random.Generator) -> None:
        """Draw a round bar along a line, lit from a side, with widths at its start and end."""
        points = np.array(line, np.float64)
        width = np.linspace(*widths, len(points))
        normal = _line_normals(points)
        shades = _TUBE_SHADES if max(widths) * self.scale > 3 else ((0.0, 1.0, 0.9),)
        flip = -1 if rng.random() < 0.5 else 1
        for start, end, light in shades:
            tone = (
                min(255, round(colour[0] * light)),
                min(255, round(colour[1] * light)),
                min(255, round(colour[2] * light)),
            )
            sides = [points + normal * (flip * (share - 0.5) * width)[:, None] for share in (start, end)]
            # quads: a whole outline of a strongly bent line would fill its inside
            for number in range(len(points) - 1):
                pair = slice(number, number + 2)
                corners = np.concatenate([sides[0][pair], sides[1][pair][::-1]])
                self.polygon([(float(x), float(y)) for x, y in corners], tone)


def composite_canvas(
    image: UInt8Array, canvas: ThinCanvas, *, blur: float, gain: float
) -> tuple[UInt8Array, Float32Array]:
    """Composite a canvas over a picture.

    Parameters
    ----------
    image : (H, W, 3) uint8 RGB.
    canvas : canvas of the picture's size.
    blur : standard deviation of the blur of its edges, pixels; none below 0.2.
    gain : brightness of what is drawn.

    Returns
    -------
    image : (H, W, 3) uint8.
    alpha : (H, W) float32 opacity, 0 to 1.
    """
    alpha: Float32Array = np.zeros(canvas.shape, np.float32)
    left, top, width, height = cv2.boundingRect(np.ascontiguousarray(canvas.rgba[..., 3]))
    if not width:
        return image, alpha
    margin = _OVERSAMPLING * round(3 * blur + 1)
    y0, x0 = (max(0, start - margin) // _OVERSAMPLING for start in (top, left))
    y1, x1 = (
        min(side, -(-(start + length + margin) // _OVERSAMPLING))
        for side, start, length in zip(canvas.shape, (top, left), (height, width), strict=True)
    )
    part = canvas.rgba[y0 * _OVERSAMPLING : y1 * _OVERSAMPLING, x0 * _OVERSAMPLING : x1 * _OVERSAMPLING]
    opaque = part[..., 3:].astype(np.float32) / 255
    premultiplied = np.dstack([part[..., :3] * opaque, opaque])
    small = cv2.resize(premultiplied, (x1 - x0, y1 - y0), interpolation=cv2.INTER_AREA)
    if blur >= 0.2:
        small = cv2.GaussianBlur(small, (0, 0), blur)
    alpha[y0:y1, x0:x1] = small[..., 3]
    colour = small[..., :3] * np.float32(max(gain, 0.3))
    painted = image.copy()
    mixed = image[y0:y1, x0:x1] * (1 - small[..., 3:]) + colour
    painted[y0:y1, x0:x1] = np.clip(np.rint(mixed), 0, 255).astype(np.uint8)
    return painted, alpha


def choose_colour(colours: Sequence[RGB], rng: np.random.Generator) -> RGB:
    """Return one of the colours."""
    return colours[int(rng.integers(len(colours)))]


def jitter_colour(colour: RGB, rng: np.random.Generator, spread: float = 12.0) -> RGB:
    """Return a colour of a slightly other brightness and tint."""
    light = rng.normal(0, spread)
    red, green, blue = (int(np.clip(value + light + rng.normal(0, spread / 3), 0, 255)) for value in colour)
    return red, green, blue


def _line_normals(points: Float64Array) -> Float64Array:
    """Compute the unit normals (n, 2) of a line (n, 2) at its points."""
    along = np.gradient(points, axis=0)
    length = np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    normals: Float64Array = np.column_stack([along[:, 1], -along[:, 0]]) / length
    return normals
