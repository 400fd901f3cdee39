"""The neural translator: taps on the sphere, transforms of colours that keep edges and wrap, crops, and broken files."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from benchmarks.papers.translator import neural_translator
from benchmarks.papers.translator.colour_grid import BRIGHTNESS_BINS, COEFFICIENTS, TRAINED_ROWS, apply_colour_grid
from benchmarks.papers.translator.crops import (
    CROP,
    PANORAMA_HEIGHT,
    RealPicture,
    TrainingRendering,
    random_real_crop,
    random_rendering_crop,
    resample_photo,
)
from benchmarks.papers.translator.equirectangular_taps import KERNEL_SIZE, TAP_COUNT, gather_taps, kernel_taps
from facade_core.core.errors import ModelFileError
from facade_core.street.lighting.sky import add_sky

RNG = np.random.default_rng(3)
ROWS, COLUMNS = 8, 16


def noise(height: int) -> np.ndarray:
    return RNG.integers(0, 255, (height, 2 * height, 3), dtype=np.uint8)


def random_grid() -> np.ndarray:
    """Return transforms near the identity."""
    offsets = RNG.normal(0, 0.2, (COEFFICIENTS, BRIGHTNESS_BINS, ROWS, COLUMNS))
    return (offsets + np.eye(3, 4).reshape(COEFFICIENTS, 1, 1, 1)).astype(np.float32)


def test_at_the_equator_the_taps_are_the_pixels_around() -> None:
    rows, columns = kernel_taps(256)
    down, right = np.divmod(np.arange(TAP_COUNT), KERNEL_SIZE)
    for row in (127, 128):
        np.testing.assert_allclose(rows[row], row + down - KERNEL_SIZE // 2, atol=0.02)
        np.testing.assert_allclose(columns[row], right - KERNEL_SIZE // 2, atol=0.02)
    plane = RNG.random((1, 256, 512), np.float32)
    around = np.stack([np.roll(plane[0, 127 + dy], -dx) for dy in range(-3, 4) for dx in range(-3, 4)])
    np.testing.assert_allclose(gather_taps(plane, (127, 128))[:, 0], around, atol=0.03)


def test_towards_the_poles_the_taps_spread_as_the_meridians_close_in() -> None:
    _, columns = kernel_taps(256)
    at_60_degrees = columns[round(256 / 6)].reshape(KERNEL_SIZE, KERNEL_SIZE)[KERNEL_SIZE // 2]
    np.testing.assert_allclose(at_60_degrees, 2 * np.arange(-3, 4), rtol=0.03, atol=0.05)
    rows, columns = kernel_taps(64)
    assert rows.min() >= -0.5
    assert rows.max() <= 63.5
    assert np.abs(columns[0]).max() > 32  # beyond the zenith is the other side


def test_a_turned_panorama_is_seen_turned() -> None:
    plane = RNG.random((2, 32, 64), np.float32)
    turned = gather_taps(np.ascontiguousarray(np.roll(plane, 17, axis=2)), (0, 32))
    np.testing.assert_array_equal(turned, np.roll(gather_taps(plane, (0, 32)), 17, axis=2))


def plain_transform(grid: np.ndarray, image: np.ndarray) -> np.ndarray:
    """Apply a grid pixel by pixel: the weighted mean of the eight matrices around each."""
    height, width = image.shape[:2]
    out = np.empty_like(image)
    for i, j in np.ndindex(height, width):
        colour = image[i, j] / 127.5 - 1
        brightness = colour @ [0.299, 0.587, 0.114]
        y = np.clip((i + 0.5) * ROWS / height - 0.5, 0, ROWS - 1)
        x = (j + 0.5) * COLUMNS / width - 0.5
        b = np.clip((brightness + 1) / 2 * BRIGHTNESS_BINS - 0.5, 0, BRIGHTNESS_BINS - 1)
        matrix = np.zeros(COEFFICIENTS)
        for row in range(ROWS):
            for column in (int(np.floor(x)), int(np.floor(x)) + 1):
                for level in range(BRIGHTNESS_BINS):
                    near = [1 - abs(a - c) for a, c in ((y, row), (x, column), (b, level))]
                    matrix += np.prod(np.maximum(near, 0)) * grid[:, level, row, column % COLUMNS]
        value = matrix.reshape(3, 4) @ np.append(colour, 1)
        out[i, j] = np.clip((value + 1) * 127.5 + 0.5, 0, 255)
    return out


def test_transforms_are_interpolated_between_places_and_brightness() -> None:
    grid, image = random_grid(), noise(24)
    ours, plain = apply_colour_grid(grid, image), plain_transform(grid, image)
    assert np.abs(ours.astype(int) - plain).max() <= 1
    assert np.abs(ours.astype(int) - image).mean() > 5


def test_the_identity_changes_nothing() -> None:
    grid = np.zeros((COEFFICIENTS, BRIGHTNESS_BINS, ROWS, COLUMNS), np.float32)
    grid += np.eye(3, 4, dtype=np.float32).reshape(COEFFICIENTS, 1, 1, 1)
    image = noise(32)
    np.testing.assert_array_equal(apply_colour_grid(grid, image), image)


def test_transforms_wrap_at_180_degrees() -> None:
    grid, image = random_grid(), noise(32)
    turned = apply_colour_grid(np.roll(grid, 3, axis=3), np.roll(image, 3 * 64 // COLUMNS, axis=1))
    np.testing.assert_array_equal(turned, np.roll(apply_colour_grid(grid, image), 3 * 64 // COLUMNS, axis=1))


def test_the_pretrained_network_keeps_every_edge_at_any_size() -> None:
    network = neural_translator.load_colour_network()
    for height in (100, 256):
        image = np.full((height, 2 * height, 3), 90, np.uint8)
        image[:, 70:100] = 150  # a stripe
        out = network.translate_image(image, np.zeros(image.shape[:2], bool))
        steps = np.abs(np.diff(out[height // 2].astype(int).mean(axis=1)))
        assert set(np.argsort(steps)[-2:].tolist()) == {69, 99}


def test_the_pretrained_network_keeps_a_turned_panorama() -> None:
    network, image = neural_translator.load_colour_network(), noise(256)
    known = RNG.random((256, 512)) < 0.5
    whole = network.translate_image(image, known)
    turned = network.translate_image(np.roll(image, 64, axis=1), np.roll(known, 64, axis=1))
    assert np.abs(turned.astype(int) - np.roll(whole, 64, axis=1)).max() <= 1


def test_broken_files_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match=r"none\.onnx: no such file"):
        neural_translator.load_colour_network(tmp_path / "none.onnx")
    path = tmp_path / "t.onnx"
    record = json.loads(neural_translator.PRETRAINED_NETWORK.with_suffix(".json").read_text())
    path.write_bytes(neural_translator.PRETRAINED_NETWORK.read_bytes()[:-1])
    path.with_suffix(".json").write_text(json.dumps(record))
    with pytest.raises(ModelFileError, match="checksum differs"):
        neural_translator.load_colour_network(path)
    neural_translator.write_translator(b"not a network", path, {"version": neural_translator.TRANSLATOR_VERSION})
    with pytest.raises(ModelFileError, match="not a model that onnxruntime reads"):
        neural_translator.load_colour_network(path)
    neural_translator.write_translator(neural_translator.PRETRAINED_NETWORK.read_bytes(), path, {"version": 1})
    with pytest.raises(ModelFileError, match="another version"):
        neural_translator.load_colour_network(path)
    path.with_suffix(".json").write_text("[]")
    with pytest.raises(ModelFileError, match="not the record of a translator"):
        neural_translator.load_colour_network(path)


def test_crops_show_the_street_and_know_where_they_are() -> None:
    rows = np.repeat(np.arange(PANORAMA_HEIGHT)[:, None] // 2, 2 * PANORAMA_HEIGHT, 1).astype(np.uint8)
    image = np.repeat(rows[..., None], 3, 2)
    views = [TrainingRendering(image, rows < 100, rows > 120)]
    rng, earlier = np.random.default_rng(0), 0
    for _ in range(40):
        crop = random_rendering_crop(views, rng)
        first, height = crop.place
        assert crop.image.shape == (*CROP, 3)
        assert TRAINED_ROWS[0] * height - 1 <= first
        assert first + CROP[0] / 2 <= TRAINED_ROWS[1] * height + 1
        assert crop.image[0, 0, 0] == first
        np.testing.assert_array_equal(crop.given, crop.image[..., 0] < 100)
        earlier += bool(crop.earlier.any())
    assert 0 < earlier < 40
    real = random_real_crop([RealPicture(image)], rng)
    assert real.image.shape == (*CROP, 3)
    assert not real.given.any()


@pytest.mark.parametrize("size", [(300, 400), (400, 300), (90, 400)])
def test_a_photo_takes_its_place_around_the_horizon(size: tuple[int, int]) -> None:
    photo = np.zeros((*size, 3), np.uint8)
    photo[: size[0] // 2] = 200
    found = resample_photo(photo)
    assert found.image.shape == (*CROP, 3)
    assert found.top == (PANORAMA_HEIGHT - CROP[0]) // 2
    assert (found.image[: CROP[0] // 2 - 2] > 190).all()
    assert (found.image[CROP[0] // 2 + 2 :] < 10).all()
    assert random_real_crop([found], np.random.default_rng(0)).place == (found.top // 2, PANORAMA_HEIGHT // 2)


def test_known_pixels_and_the_sky_stay_as_they_are() -> None:
    """Every viewpoint translates what the ones before it left, so that a change of known pixels would add up."""
    height = 64
    image = noise(height)
    known = RNG.random((height, 2 * height)) < 0.5
    depth = np.full((height, 2 * height), 5.0, np.float32)
    depth[:10] = np.inf
    panorama = SimpleNamespace(rgb=image, textured=known, depth=depth)
    painter = SimpleNamespace(translate=lambda panorama: panorama.rgb)
    network = neural_translator.load_colour_network()
    out = neural_translator.NeuralTranslator(network, cast(Any, painter)).translate(cast(Any, panorama))
    kept = known & np.isfinite(depth)
    np.testing.assert_array_equal(out[kept], image[kept])
    np.testing.assert_array_equal(out[:10], add_sky(image, depth)[:10])
    assert (out[~known & np.isfinite(depth)] != image[~known & np.isfinite(depth)]).any()
