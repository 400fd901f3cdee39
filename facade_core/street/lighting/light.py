"""Light on generated colours: sky, sun and reflections in linear light, then the exposure and tone curve of a camera."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, FloatArray, UInt8Array
from facade_core.core.numba_cache import njit
from facade_core.core.types import Sun
from facade_core.geometry.scene import Scene
from facade_core.street.lighting.ambient import ambient_light
from facade_core.street.lighting.settings import SUNLIGHT, TONE_CURVE
from facade_core.street.lighting.sun import SUN_LIGHT, sunlight_share
from facade_core.street.materials.settings import MATERIAL_FIELD

# Charts whose light is kept: a chart and those beside it that it is levelled to.
MAX_CACHED_CHARTS = 8
NO_TONES = np.ones((1, 1), np.float32)
_PIVOT, _CONTRAST, _SATURATION = TONE_CURVE.pivot, TONE_CURVE.contrast, TONE_CURVE.saturation
# Shares of red, green and blue in the brightness of an encoded colour.
_GREY = np.array([0.299, 0.587, 0.114])


class SceneLight:
    """Light on the charts of a scene, computed on demand.

    Colours are encoded with an exponent of about two, so that they are multiplied by the root of linear light.

    Attributes
    ----------
    sun : position of the sun; None under an overcast sky.
    """

    def __init__(self, scene: Scene, reflectance: Float64Array, sun: Sun | None) -> None:
        """Prepare the light; `reflectance` (charts, 3) are the shares of light that charts reflect."""
        self.sun = sun
        self._scene, self._reflectance = scene, reflectance
        self._light = lru_cache(maxsize=MAX_CACHED_CHARTS)(self._compute_light)

    def _compute_light(self, chart: int) -> tuple[Float32Array, Float32Array]:
        """Return ambient light (rows, columns, 3) and the share of sunlight (h, w), (0, 0) without a sun."""
        ambient = ambient_light(self._scene, chart, self._reflectance, self.sun)
        share = np.zeros((0, 0), np.float32) if self.sun is None else sunlight_share(self._scene, chart, self.sun)
        return _exposed(ambient, self.sun).astype(np.float32), share

    def sunlight(self, chart: int) -> Float32Array:
        """Return the share of sunlight (h, w) on a chart; (0, 0) without a sun."""
        return self._light(chart)[1]

    def lay(
        self,
        chart: int,
        colour: UInt8Array,
        where: BoolArray,
        *,
        start: tuple[int, int] = (0, 0),
        sunlight: Float32Array | None = None,
        tones: Float32Array = NO_TONES,
        has_tone: BoolArray | None = None,
    ) -> None:
        """Light texels of a chart, in place.

        Parameters
        ----------
        chart : row of the chart.
        colour : (r, c, 3) uint8, the whole chart or a part.
        where : (r, c) bool, texels to light.
        start : first row and column of the part.
        sunlight : (h, w) share of sunlight in place of the chart's own, as of relief.
        tones : (k, m) grid of factors, evenly spaced, half a step inside the border.
        has_tone : (r, c) bool, texels that `tones` apply to.
        """
        if not where.any():
            return
        ambient, own = self._light(chart)
        size = np.array([*self._scene.placement.shape(chart), *start])
        share = own if sunlight is None else sunlight
        sun = _exposed(SUN_LIGHT, self.sun)
        apply_light(colour, where, size, ambient, share, sun, tones, where if has_tone is None else has_tone)

    def factor(self, chart: int) -> Float32Array:
        """Return the factor (h, w, 3) by which the material of a chart is darker than in full light, before the tone curve."""
        light, share = self._light(chart)
        for axis, texels in enumerate(self._scene.placement.shape(chart)):
            light = interpolate_axis(light, axis, texels)
        if share.size:
            light = light + share[..., None] * _exposed(SUN_LIGHT, self.sun).astype(np.float32)
        factor: Float32Array = np.sqrt(light) * np.float32(MATERIAL_FIELD.typical_grey)
        return factor


def _exposed(light: FloatArray, sun: Sun | None) -> Float64Array:
    """Return light relative to what leaves colours as they are."""
    return light.astype(np.float64) * ((SUNLIGHT.exposure if sun else 1.0) / MATERIAL_FIELD.typical_light)


def interpolate_axis(grid: Float32Array, axis: int, texels: int) -> Float32Array:
    """Interpolate a grid linearly along an axis at the centres of `texels` texels; the grid spans border to border."""
    at = (np.arange(texels, dtype=np.float32) + np.float32(0.5)) / texels * (grid.shape[axis] - 1)
    below = np.minimum(at.astype(np.int64), grid.shape[axis] - 2)
    part = (at - below).reshape(-1, *(1,) * (grid.ndim - 1 - axis))
    interpolated: Float32Array = grid.take(below, axis) * (1 - part) + grid.take(below + 1, axis) * part
    return interpolated


@njit(cache=True, inline="always")
def _bilinear(grid: Float32Array, row: int, column: int, down: float, right: float) -> float:
    upper = grid[row, column] * (1 - right) + grid[row, column + 1] * right
    light: float = upper * (1 - down) + (grid[row + 1, column] * (1 - right) + grid[row + 1, column + 1] * right) * down
    return light


@njit(cache=True, inline="always")
def _tone(value: float) -> float:
    """Return the tone of a brightness, 1 where a camera without a curve shows white: a power, then an exponential shoulder."""
    if value < _PIVOT:
        return float(_PIVOT * (value / _PIVOT) ** _CONTRAST)
    return float(_PIVOT + (1 - _PIVOT) * (1 - np.exp(_CONTRAST * (_PIVOT - value) / (1 - _PIVOT))))


def invert_tones(colour: UInt8Array) -> Float32Array:
    """Return the exposures (..., 3), in 0..255 and above, of the colours (..., 3) that `apply_light` writes."""
    tone = np.clip(colour @ _GREY, 0.5, 254.5)[..., None] / 255
    above = _PIVOT - (1 - _PIVOT) / _CONTRAST * np.log(np.minimum(1 - tone, 1 - _PIVOT) / (1 - _PIVOT))
    grey = np.where(tone < _PIVOT, _PIVOT * (tone / _PIVOT) ** (1 / _CONTRAST), above)
    exposure = grey + (colour / 255 - tone) * grey / tone / _SATURATION
    found: Float32Array = np.maximum(255 * exposure, 0).astype(np.float32)
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def apply_light(
    colour: UInt8Array,
    where: BoolArray,
    size: Float64Array,
    ambient: Float32Array,
    sunlight: Float32Array,
    sun: Float64Array,
    tones: Float32Array,
    has_tone: BoolArray,
) -> None:
    """Multiply colours by light and give them the tones of a photograph, in place.

    Parameters
    ----------
    colour : (r, c, 3) uint8, part of a chart.
    where : (r, c) bool, texels to change.
    size : height and width of the chart in texels, and first row and column of the part.
    ambient : (k, m, 3) grid from border to border.
    sunlight : (h, w) share of sunlight on the chart; (0, 0) without a sun.
    sun : (3,) light of a share of 1.
    tones : (k, m) grid, evenly spaced, half a step inside the border; (1, 1) without any.
    has_tone : (r, c) bool, texels that `tones` apply to.
    """
    height, width, top, left = size
    rows, columns, tall, wide = ambient.shape[0], ambient.shape[1], tones.shape[0], tones.shape[1]
    has_sun, has_tones, exposure = sunlight.size > 0, tones.size > 1, np.empty(3)
    for row in range(where.shape[0]):
        share = (top + row + 0.5) / height
        v, w = share * (rows - 1), min(max(share * tall - 0.5, 0.0), tall - 1.0)
        v0, w0 = min(int(v), rows - 2), min(int(w), tall - 2)
        for column in range(where.shape[1]):
            if not where[row, column]:
                continue
            share = (left + column + 0.5) / width
            u = share * (columns - 1)
            u0, tone, direct = min(int(u), columns - 2), 1.0, 0.0
            if has_sun:
                direct = float(sunlight[top + row, left + column])
            if has_tones and has_tone[row, column]:
                x = min(max(share * wide - 0.5, 0.0), wide - 1.0)
                x0 = min(int(x), wide - 2)
                tone = _bilinear(tones, w0, x0, w - w0, x - x0)
            grey = 0.0
            for band in range(3):
                light = _bilinear(ambient[:, :, band], v0, u0, v - v0, u - u0) + sun[band] * direct
                exposure[band] = colour[row, column, band] * tone * np.sqrt(light) / 255.0
                grey += _GREY[band] * exposure[band]
            brightness = _tone(grey)
            gain = _SATURATION * brightness / max(grey, 1e-6)
            for band in range(3):
                shown = 255.0 * (brightness + gain * (exposure[band] - grey))
                colour[row, column, band] = np.uint8(min(max(shown + 0.5, 0.0), 255.0))
