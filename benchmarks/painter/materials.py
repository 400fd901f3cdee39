"""Materials of walls and roofs; each function fills a box of the canvas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.painter.canvas import Canvas, fractal_noise, hex_to_linear, smooth_noise
from facade_core.core.arrays import Float32Array
from facade_core.street.materials.grain import (
    GrainKind,
    add_grain,
)
from facade_core.street.materials.grain_file import load_shipped_grain_tables

# Pixels whose grain is computed at once, which bounds memory.
PIXELS_PER_BATCH = 1 << 18
# Strength of the photographic grain: of plaster, from trowelled to roughcast, and of masonry.
PLASTER_GRAIN_WEIGHTS = (1.0, 1.6)
MASONRY_GRAIN_WEIGHT = 1.3


@dataclass(frozen=True)
class MasonryBond:
    """Dimensions of masonry in metres.

    Attributes
    ----------
    course : height of a course with its joint.
    length : length of a stone.
    joint : width of a joint.
    header : length of a short stone after every long one (Flemish bond); 0 for none.
    spread : relative deviation of tone between stones.
    """

    course: float
    length: float
    joint: float
    header: float = 0.0
    spread: float = 0.05


def paint_plaster(
    canvas: Canvas,
    box: tuple[float, float, float, float],
    colour: Float32Array,
    rng: np.random.Generator,
    *,
    rough: float,
) -> None:
    """Paint a rendered wall.

    Parameters
    ----------
    canvas : changed in place.
    box : x0, y0, x1, y1 in metres.
    colour : (3,) linear light.
    rng : source of randomness.
    rough : from 0, trowelled smooth, to 1, roughcast.
    """
    at = canvas.region(*box)
    shape = canvas.relief[at].shape
    grain = smooth_noise(shape, 0.022 * canvas.scale, rng)
    # Grain, trowel strokes, and patches of an arm's reach.
    weight = PLASTER_GRAIN_WEIGHTS[0] + (PLASTER_GRAIN_WEIGHTS[1] - PLASTER_GRAIN_WEIGHTS[0]) * rough
    tone = photographic_grain(
        shape, canvas.scale, GrainKind.PLASTER_ROUGH if rough > 0.4 else GrainKind.PLASTER_FINE, weight, rng
    )
    tone += np.float32(0.02 + 0.03 * rough) * grain + 0.022 * smooth_noise(shape, 0.35 * canvas.scale, rng)
    tone += np.float32(0.010) * smooth_noise(shape, (0.05 * canvas.scale, 0.16 * canvas.scale), rng)
    tone += np.float32(0.014) * smooth_noise(shape, 1.7 * canvas.scale, rng)
    canvas.albedo[at] = colour * tone[..., None]
    canvas.relief[at] = np.float32(0.0006 + 0.0028 * rough) * grain
    canvas.gloss[at] = 0


def paint_masonry(
    canvas: Canvas,
    box: tuple[float, float, float, float],
    colour: Float32Array,
    mortar: Float32Array,
    bond: MasonryBond,
    rng: np.random.Generator,
    *,
    relief: float = 0.0,
    groove: float = 0.006,
    rock_face: float = 0.0,
) -> None:
    """Paint brick or stone with visible joints.

    Parameters
    ----------
    canvas : changed in place.
    box : x0, y0, x1, y1 in metres.
    colour, mortar : (3,) linear light.
    bond : dimensions of the stones.
    rng : source of randomness.
    relief : metres in front of the wall plane.
    groove : depth of the joints in metres.
    rock_face : swelling of each stone in metres.
    """
    at = canvas.region(*box)
    rows, columns = canvas.relief[at].shape
    course = max(2, canvas.to_pixels(bond.course))
    length, header = max(3, canvas.to_pixels(bond.length)), canvas.to_pixels(bond.header)
    joint = max(1, canvas.to_pixels(bond.joint))
    period = length + header
    # Courses are counted from the ground up; each is drawn once as a line and then repeated over its rows.
    up = np.arange(rows)[::-1]
    row, in_row = up // course, up % course
    count = int(row[0]) + 1
    along = np.arange(columns)[None, :] + ((np.arange(count) % 2) * (period // 2))[:, None]
    unit, in_unit = np.divmod(along, period)
    short = in_unit >= length
    stone = 2 * unit + short if header else unit
    value = np.take_along_axis(rng.standard_normal((count, int(stone.max()) + 1), dtype=np.float32), stone, 1)
    upright = np.where(short, in_unit - length, in_unit) < joint
    gap = (in_row >= course - joint)[:, None] | upright[row]
    grain = photographic_grain((rows, columns), canvas.scale, GrainKind.SETTS, MASONRY_GRAIN_WEIGHT, rng)
    tone = 1 + np.float32(bond.spread) * value
    # Firing and quarry beds change the hue as well as the tone.
    redder = tone * (1 + np.float32(0.35 * bond.spread) * np.sin(7 * value))
    for channel in range(3):
        face = (redder if channel == 0 else tone) * colour[channel]
        face[upright] = mortar[channel]
        courses = face[row]
        courses[in_row >= course - joint] = mortar[channel]
        canvas.albedo[at][..., channel] = courses * grain
    height = (np.float32(relief) + np.float32(0.15 * groove) * value)[row]
    if rock_face:
        swell = np.sqrt(np.sin(np.pi * (in_row + 0.5) / course)).astype(np.float32)[:, None]
        height += np.float32(rock_face) * (swell + 0.55 * fractal_noise((rows, columns), 0.16 * canvas.scale, 3, rng))
    height[gap] = relief - groove
    canvas.relief[at] = height
    canvas.gloss[at] = 0


def photographic_grain(
    shape: tuple[int, int], scale: float, kind: int, weight: float, rng: np.random.Generator
) -> Float32Array:
    """Return a factor about 1 of a material's colour: the grain of photographs of it.

    Parameters
    ----------
    shape : rows and columns.
    scale : pixels per metre.
    kind : `GrainKind` of the photographs, see `facade_core.street.materials.grain`.
    weight : strength of the grain.
    rng : source of randomness.

    Returns
    -------
    factor : (H, W) float32, for linear light.
    """
    rows, columns = shape
    out, grains, seed = np.empty(shape, np.float32), load_shipped_grain_tables(), int(rng.integers(1 << 31))
    across = (np.arange(columns) + 0.5) / scale
    batch_rows = max(1, PIXELS_PER_BATCH // max(columns, 1))
    for first in range(0, rows, batch_rows):
        count = min(batch_rows, rows - first)
        y = np.repeat((np.arange(first, first + count) + 0.5) / scale, columns)
        tone = np.ones(len(y))
        add_grain(np.tile(across, count), y, np.full(len(y), 1 / scale), grains, int(kind), weight, seed, tone)
        out[first : first + count] = (tone * tone).reshape(count, columns)  # of display values, nearly GAMMA
    return out


def paint_rustication(
    canvas: Canvas,
    box: tuple[float, float, float, float],
    colour: Float32Array,
    rng: np.random.Generator,
    *,
    course: float,
) -> None:
    """Paint rusticated plaster or stone: broad courses with deep horizontal grooves only.

    Parameters
    ----------
    canvas : changed in place.
    box : x0, y0, x1, y1 in metres.
    colour : (3,) linear light.
    rng : source of randomness.
    course : height of a course in metres.
    """
    paint_plaster(canvas, box, colour, rng, rough=0.25)
    x0, y0, x1, y1 = box
    canvas.relief[canvas.region(*box)] += 0.05
    count = max(2, round((y1 - y0) / course))
    for y in np.linspace(y0, y1, count + 1)[1:-1]:
        at = canvas.region(x0, y - 0.022, x1, y + 0.022)
        canvas.relief[at] = 0.0
        canvas.albedo[at] *= 0.72


def paint_slate(
    canvas: Canvas, box: tuple[float, float, float, float], rng: np.random.Generator, course: float
) -> None:
    """Paint slates on a steep roof; each course laps over the next.

    Parameters
    ----------
    canvas : changed in place.
    box : x0, y0, x1, y1 in metres.
    rng : source of randomness.
    course : height of a course in metres.
    """
    bond = MasonryBond(course=course, length=course * 1.5, joint=0.012, spread=0.13)
    paint_masonry(
        canvas, box, hex_to_linear("#68727c"), hex_to_linear("#3c4248"), bond, rng, relief=-0.02, groove=0.012
    )
    at = canvas.region(*box)
    rows = canvas.relief[at].shape[0]
    lap = (np.arange(rows) % max(2, canvas.to_pixels(course))) / max(2, canvas.to_pixels(course))
    canvas.relief[at] += np.float32(0.02) * lap.astype(np.float32)[:, None]
    canvas.gloss[at] = 0.15


def paint_sheet_metal(
    canvas: Canvas, box: tuple[float, float, float, float], colour: Float32Array, rng: np.random.Generator
) -> None:
    """Paint seamed sheet metal, as on Nordic roofs: a seam every 0.55 m and a lighter upper part.

    Parameters
    ----------
    canvas : changed in place.
    box : x0, y0, x1, y1 in metres.
    colour : (3,) linear light.
    rng : source of randomness.
    """
    at = canvas.region(*box)
    shape = canvas.relief[at].shape
    fade = np.linspace(1.22, 0.92, shape[0], dtype=np.float32)[:, None]
    streaks = smooth_noise(shape, (1.5 * canvas.scale, 0.12 * canvas.scale), rng)
    canvas.albedo[at] = colour * (fade * (1 + 0.05 * streaks))[..., None]
    canvas.relief[at] = -0.02
    canvas.gloss[at] = 0.25
    x0, y0, x1, y1 = box
    count = max(2, round((x1 - x0) / 0.55))
    for x in np.linspace(x0, x1, count + 1)[1:-1]:
        canvas.relief[canvas.region(x - 0.02, y0, x + 0.02, y1)] = 0.03


def paint_panels(
    canvas: Canvas,
    box: tuple[float, float, float, float],
    colour: Float32Array,
    rng: np.random.Generator,
    across: list[float],
    down: list[float],
) -> None:
    """Paint cast panels, each of a slightly different tone, with joints.

    Parameters
    ----------
    canvas : changed in place.
    box : x0, y0, x1, y1 in metres.
    colour : (3,) linear light.
    rng : source of randomness.
    across, down : x and y of the joints in metres.
    """
    paint_plaster(canvas, box, colour, rng, rough=0.3)
    x0, y0, x1, y1 = box
    rows = [y0, *sorted(y for y in down if y0 < y < y1), y1]
    columns = [x0, *across, x1]
    for top, bottom in zip(rows, rows[1:], strict=False):
        for left, right in zip(columns, columns[1:], strict=False):
            canvas.albedo[canvas.region(left, top, right, bottom)] *= np.float32(1 + 0.035 * rng.standard_normal())
    joints = [(x0, y - 0.012, x1, y + 0.012) for y in rows[1:-1]] + [(x - 0.012, y0, x + 0.012, y1) for x in across]
    for joint in joints:
        at = canvas.region(*joint)
        canvas.albedo[at] *= np.float32(0.62)
        canvas.relief[at] = -0.012


def paint_profiled_sheets(
    canvas: Canvas,
    box: tuple[float, float, float, float],
    colour: Float32Array,
    rng: np.random.Generator,
    *,
    is_level: bool,
) -> None:
    """Paint upright ribbed sheets, or level boards that lap over the next.

    Parameters
    ----------
    canvas : changed in place.
    box : x0, y0, x1, y1 in metres.
    colour : (3,) linear light.
    rng : source of randomness.
    is_level : True for boards.
    """
    at = canvas.region(*box)
    shape = canvas.relief[at].shape
    pitch = max(0.16 if is_level else 0.30, 5 / canvas.scale)
    places = np.arange(shape[0 if is_level else 1]) / (pitch * canvas.scale)
    share = (places % 1).astype(np.float32)
    profile = 0.022 * share if is_level else 0.035 * np.clip(4 * np.abs(share - 0.5) - 0.6, 0, 0.8)
    tone = 1 + np.float32(0.05 if is_level else 0.015) * rng.standard_normal(int(places[-1]) + 1, dtype=np.float32)
    along = tone[places.astype(int)] * np.where(share > 0.9 if is_level else share < 0, np.float32(0.8), np.float32(1))
    lines = np.stack([np.asarray(profile, np.float32), along])
    lines = lines[:, :, None] if is_level else lines[:, None, :]
    high, wide = (0.05, 0.9) if is_level else (1.8, 0.3)
    streaks = smooth_noise(shape, (high * canvas.scale, wide * canvas.scale), rng)
    canvas.albedo[at] = colour * (lines[1] * (1 + 0.03 * streaks))[..., None]
    canvas.relief[at] = lines[0]
    canvas.gloss[at] = 0.0 if is_level else 0.08
