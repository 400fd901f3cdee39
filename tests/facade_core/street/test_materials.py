"""The kernels of materials against plain functions of a point: the same where a footprint is a point, else their mean."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.materials import plain
from facade_core.core.hash_uniform import hash_uniform
from facade_core.street.materials import procedural, roofs

SEED = 5
KERNELS: dict[str, Callable[..., None]] = {
    "asphalt": procedural.asphalt_tone,
    "paving": procedural.paving_tone,
    "roofing": roofs.sheet_metal_tone,
    "tiling": roofs.roof_tile_tone,
    "plaster": procedural.plaster_tone,
    "glass": procedural.glass_reflection,
    "wood": procedural.door_boards_tone,
    "soffit": procedural.soffit_tone,
    "felt": roofs.felt_tone,
    "ballast": roofs.roof_gravel_tone,
}
# Further input of some materials, metres: distance from a centreline, height over the foot of a wall, height of a pane.
OTHER = {"asphalt": 2.1, "plaster": 0.6, "glass": 2.0}


def tones(name: str, x: np.ndarray, y: np.ndarray, side: np.ndarray) -> np.ndarray:
    out, other = np.empty(len(x)), np.full(len(x), OTHER.get(name, 0.0))
    kernel = KERNELS[name]
    if name == "glass":
        kernel(x, y, OTHER[name], side, SEED, out)
    elif name in OTHER:
        kernel(x, y, other, side, SEED, out)
    else:
        kernel(x, y, side, SEED, out)
    return out


def points(name: str, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return plain.MATERIALS[name](x, y, np.full(len(x), OTHER.get(name, 0.0)), SEED)


def mean_of_points(name: str, x: np.ndarray, y: np.ndarray, side: float, samples: int) -> np.ndarray:
    """Means of samples x samples points of squares about x, y (n,)."""
    offset = side * ((np.arange(samples) + 0.5) / samples - 0.5)
    total = [points(name, x + right, y + down) for right in offset for down in offset]
    return np.mean(total, axis=0)


def places(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Below and right of the origin, as doors and panes are."""
    x, y = np.random.default_rng(seed).uniform(0.5, 60, (2, count))
    return x, y


@pytest.mark.parametrize("name", plain.MATERIALS)
def test_a_footprint_of_a_point_is_the_point(name: str) -> None:
    x, y = places(20_000)
    if name not in ("wood", "glass"):
        x, y = x - 30, y - 30
    found, wanted = tones(name, x, y, np.full(len(x), 1e-6)), points(name, x, y)
    off = np.abs(found - wanted) > 2e-4 * np.abs(wanted).mean()
    assert off.mean() < 1e-3  # on the edges of joints
    assert np.corrcoef(found, wanted)[0, 1] > 0.999


@pytest.mark.long
@pytest.mark.parametrize("density", [8.0, 16.0, 32.0])
@pytest.mark.parametrize("name", plain.MATERIALS)
def test_a_tone_is_the_mean_over_its_footprint(name: str, density: float) -> None:
    """As far as samples tell; the grain of wood is finer than a texel, and fades sooner than its mean does."""
    x, y = places(600, 1)
    side = 1 / density
    wanted = mean_of_points(name, x, y, side, 24)
    wrong, stepping = (
        np.sqrt(np.mean((found - wanted) ** 2)) / wanted.std()
        for found in (tones(name, x, y, np.full(len(x), side)), points(name, x, y))
    )
    assert wrong < (0.65 if name == "wood" else 0.06)
    assert wrong < 0.25 * stepping


@pytest.mark.parametrize("name", plain.MATERIALS)
def test_what_is_finer_than_a_footprint_fades(name: str) -> None:
    """From afar a material is its mean: neither its brightness changes, nor does it sparkle."""
    x, y = places(3000, 2)
    y = y % OTHER["glass"] if name == "glass" else y
    near = points(name, x, y)
    for side in (0.3, 1.0, 3.0, 30.0):
        found = tones(name, x, y, np.full(len(x), side))
        assert np.isfinite(found).all()
        assert found.mean() == pytest.approx(near.mean(), abs=0.25 * near.std())
    if name == "glass":  # of which the sky stays
        found = found - 0.55 * (1 - y / OTHER["glass"]) ** 2
    assert found.std() < 0.05 * near.std()


def test_chance_is_even_and_unlike_beside() -> None:
    """What tints and tones are drawn from: no share of the palette is left out, neighbours know nothing of each other."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(-150.0, 150), np.arange(-150.0, 150)))
    drawn = (plain._chance(x, y, 7) - 0.5).reshape(300, 300)
    assert np.abs(np.histogram(drawn, 10)[0] / drawn.size - 0.1).max() < 0.01
    for other in (drawn[:, 1:], drawn[:, 2:], drawn[:, :-1][:, ::-1]):
        here = drawn[:, : other.shape[1]]
        assert abs((here * other).mean()) / drawn.var() < 0.02
    assert abs((drawn[1:] * drawn[:-1]).mean()) / drawn.var() < 0.02
    assert abs((drawn[1:, 1:] * drawn[:-1, :-1]).mean()) / drawn.var() < 0.02
    rows = np.array([int(5 * hash_uniform(number, 7)) for number in range(2000)])
    assert np.bincount(rows, minlength=5).min() > 330


@pytest.mark.parametrize("name", ["felt", "ballast"])
def test_a_flat_roof_is_no_plain_colour_and_the_same_from_afar(name: str) -> None:
    """Sheets, mended places and dried pools are means over footprints, and no brightness is lost where they no longer show."""
    x, y = places(8000, 3)
    point = tones(name, 40 * x, 40 * y, np.full(len(x), 1e-6))
    assert 0.04 < point.std() < 0.12
    assert np.quantile(point, 0.99) - np.quantile(point, 0.01) > 0.2
    for side in (0.06, 0.5, 1.0, 4.0, 40.0):
        found = tones(name, 40 * x, 40 * y, np.full(len(x), side))
        assert found.mean() == pytest.approx(point.mean(), abs=0.25 * point.std())
    assert found.std() < 0.02 * point.std()
    side = 1 / 16
    offset = side * ((np.arange(16) + 0.5) / 16 - 0.5)
    x, y = x[:600], y[:600]
    fine = np.mean([tones(name, x + dx, y + dy, np.full(600, side / 16)) for dx in offset for dy in offset], axis=0)
    wrong = tones(name, x, y, np.full(600, side)) - fine
    assert np.sqrt(np.mean(wrong**2)) < 0.06 * fine.std()
