"""Grain by example: the photograph's histogram and means, no period, the same wherever it is worked out; a checked file."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from facade_core.core.errors import ModelFileError
from facade_core.street.materials.grain import (
    DEFAULT_EXAMPLES,
    EXAMPLE_NAMES,
    GRAIN_LEVELS,
    TILE_PIXELS,
    WeightedGrain,
    add_grain,
    build_grain_tables,
    learn_grain,
)
from facade_core.street.materials.grain_file import (
    SHIPPED_EXAMPLES,
    load_examples,
    load_grain_tables,
    load_shipped_grain_tables,
)
from training.materials import learn_grain_examples, save_examples

# Each that is shipped, as it is.
EXAMPLES = build_grain_tables([WeightedGrain(load_examples()[name]) for name in EXAMPLE_NAMES])


def patch(which: int, density: float, metres: float, seed: int = 3) -> np.ndarray:
    """Tones (n, n) of an example at texels of a density."""
    count = round(metres * density)
    x, y = (a.ravel() for a in np.meshgrid(*[(np.arange(count) + 0.5) / density - 5] * 2))
    out = np.zeros(len(x))
    add_grain(x, y, np.full(len(x), 1 / density), EXAMPLES, which, 1.0, seed, out)
    return out.reshape(count, count)


@pytest.mark.parametrize("which", range(len(EXAMPLE_NAMES)), ids=EXAMPLE_NAMES)
def test_grain_has_no_period(which: int) -> None:
    """Nor does it correlate where the tile would begin again."""
    tone = patch(which, 32, 16.0)
    tone -= tone.mean()
    correlation = np.fft.irfft2(np.abs(np.fft.rfft2(tone)) ** 2, tone.shape)
    period = round(EXAMPLES.width[which] * 32)
    assert np.abs(correlation[[0, period, period], [period, 0, period]] / correlation[0, 0]).max() < 0.1


@pytest.mark.long
@pytest.mark.parametrize("which", range(len(EXAMPLE_NAMES)), ids=EXAMPLE_NAMES)
def test_the_histogram_is_the_examples(which: int) -> None:
    example = load_examples()[EXAMPLE_NAMES[which]]
    wanted = np.quantile(example.table[example.tile], (0.05, 0.25, 0.5, 0.75, 0.95))
    finest = TILE_PIXELS / example.width
    found = np.quantile(patch(which, finest, 16 * example.width), (0.05, 0.25, 0.5, 0.75, 0.95))
    assert np.abs(found - wanted).max() < 0.2 * example.table[example.tile].std()


def test_a_tone_is_the_mean_over_its_footprint_and_fades() -> None:
    for which in range(len(EXAMPLE_NAMES)):
        fine, coarse = patch(which, 128, 4.0), patch(which, 16, 4.0)
        means = fine.reshape(64, 8, 64, 8).mean(axis=(1, 3))
        assert np.corrcoef(means.ravel(), coarse.ravel())[0, 1] > 0.87
        assert np.abs(patch(which, 0.2, 200.0)).std() < 0.05 * fine.std()


def test_a_place_has_one_tone_in_any_order() -> None:
    x, y = np.random.default_rng(0).uniform(-300, 300, (2, 500))
    side = np.random.default_rng(1).uniform(0.005, 2.0, 500)
    whole, parts = np.zeros(500), np.zeros(500)
    add_grain(x, y, side, EXAMPLES, 1, 1.0, 5, whole)
    turned = np.random.default_rng(2).permutation(500)
    for some in np.array_split(turned, 7):
        own = np.zeros(len(some))
        add_grain(x[some], y[some], side[some], EXAMPLES, 1, 1.0, 5, own)
        parts[some] = own
    np.testing.assert_array_equal(whole, parts)


def test_the_example_of_a_picture_keeps_its_colour_and_leaves_out_its_structure() -> None:
    rng = np.random.default_rng(0)
    picture = np.clip(rng.normal((120, 90, 60), 8, (512, 512, 3)), 0, 255).astype(np.uint8)
    picture[:, :256] //= 2
    flat = learn_grain(picture, 1.0, structure=0.02)
    assert flat.colour == pytest.approx(picture.mean(axis=(0, 1)), abs=0.5)
    halves = flat.table[flat.tile][:, :128].mean(), flat.table[flat.tile][:, 128:].mean()
    assert abs(halves[0] - halves[1]) < 0.06  # of 0.67


def test_a_blocks_own_picture_takes_the_place_of_one_material_alone() -> None:
    picture = np.random.default_rng(1).integers(60, 160, (256, 512, 3), np.uint8)
    own = load_grain_tables({"slabs": learn_grain(picture, 0.8)})
    assert own.first.shape == load_shipped_grain_tables().first.shape == (len(DEFAULT_EXAMPLES), GRAIN_LEVELS)
    place = list(DEFAULT_EXAMPLES).index("slabs")
    others = [k for k in range(len(DEFAULT_EXAMPLES)) if k != place]
    for field in ("bits", "tables", "width", "weight", "colour"):
        mine, theirs = getattr(own, field), getattr(load_shipped_grain_tables(), field)
        np.testing.assert_array_equal(mine[others], theirs[others])
        assert not np.array_equal(mine[place], theirs[place], equal_nan=True) or field == "bits"
    assert own.colour[place] == pytest.approx(picture.mean(axis=(0, 1)), abs=0.5)
    assert own.weight[place] == 1


def test_a_file_that_is_broken_is_told(tmp_path: Path) -> None:
    for file in (SHIPPED_EXAMPLES, SHIPPED_EXAMPLES.with_suffix(".json")):
        shutil.copy(file, tmp_path)
    path = tmp_path / SHIPPED_EXAMPLES.name
    assert len(load_examples(path)) == len(EXAMPLE_NAMES)
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(ModelFileError, match=r"checksum differs from materials\.json; fetch both"):
        load_examples(path)
    path.with_suffix(".json").write_text(json.dumps({"format": 0}))
    with pytest.raises(ModelFileError, match="of another version"):
        load_examples(path)
    path.unlink()
    with pytest.raises(ModelFileError, match=r"materials\.npz: cannot be read"):
        load_examples(path)


def test_training_tells_what_picture_is_missing(tmp_path: Path) -> None:
    from facade_core.core.errors import InputError

    with pytest.raises(InputError, match=r"asphalt\.jpg: cannot be read"):
        learn_grain_examples(tmp_path, tmp_path / "out")


def test_the_same_examples_are_the_same_file(tmp_path: Path) -> None:
    examples = load_examples()
    save_examples(examples, tmp_path / "a.npz")
    save_examples(examples, tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
