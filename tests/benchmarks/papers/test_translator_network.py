"""Training of the translator: resumable to the bit, judged by a distance, and each part of the recipe does something."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="torch is absent: make train-setup")

import torch

from benchmarks.papers.translator import network_training as training
from benchmarks.papers.translator.colour_grid import NETWORK_HEIGHT, apply_colour_grid
from benchmarks.papers.translator.crops import RealPicture, TrainingRendering
from benchmarks.papers.translator.equirectangular_taps import gather_taps
from benchmarks.papers.translator.kernel_distance import image_features, kernel_distance
from benchmarks.papers.translator.network import Generator, apply_grid, image_to_tensor, initialise_weights
from benchmarks.papers.translator.network_export import export_generator_onnx
from benchmarks.papers.translator.network_training import learning_rate_share, train_generator
from benchmarks.papers.translator.steps import TrainingDomains, TrainingRecipe, simulate_earlier
from facade_core.core.errors import ImageError, ModelFileError
from tests.training.progress import interrupt_at, listening

RECIPE = TrainingRecipe(width=4, steps=4, batch=1, check=2)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "_EVALUATION_CROPS", 8)


def domains(seed: int = 0) -> TrainingDomains:
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 255, (512, 1024, 3), dtype=np.uint8)
    views = [TrainingRendering(image, rng.random((512, 1024)) < 0.3, rng.random((512, 1024)) < 0.5)]
    photos = [RealPicture(rng.integers(0, 255, (512, 1024, 3), dtype=np.uint8))]
    return TrainingDomains(views, photos, views, photos)


def test_an_interrupted_run_ends_in_the_same_weights(tmp_path: Path) -> None:
    whole = train_generator(domains(), RECIPE, seed=1)
    with pytest.raises(KeyboardInterrupt), listening(interrupt_at(3)):
        train_generator(domains(), RECIPE, seed=1, state=tmp_path / "s")
    again = train_generator(domains(), RECIPE, seed=1, state=tmp_path / "s")
    assert again.distances == whole.distances
    assert all(torch.equal(again.weights[name], value) for name, value in whole.weights.items())
    with pytest.raises(ModelFileError, match="another training run"):
        train_generator(domains(), RECIPE, seed=2, state=tmp_path / "s")
    with pytest.raises(ModelFileError, match="another training run"):
        train_generator(
            domains(), replace(RECIPE, steps=8), seed=1, state=tmp_path / "s"
        )  # the rate has fallen already
    assert whole.step == min(whole.distances, key=whole.distances.__getitem__)


@pytest.mark.parametrize("part", ["conditioned", "masked", "equirectangular", "merged"])
def test_every_part_of_the_recipe_changes_what_is_learnt(part: str) -> None:
    recipe = replace(RECIPE, steps=2)
    full, without = (train_generator(domains(), c, seed=1) for c in (recipe, replace(recipe, **{part: False})))
    assert any(
        full.weights[name].shape != value.shape or not torch.equal(full.weights[name], value)
        for name, value in without.weights.items()
    )


def test_the_rate_is_constant_and_then_falls_straight() -> None:
    assert [learning_rate_share(step, 200) for step in (0, 149, 175, 199)] == [1.0, 1.0, 0.5, 0.02]


def test_an_empty_domain_is_refused() -> None:
    with pytest.raises(ImageError, match="no pictures in judged_real"):
        train_generator(replace(domains(), judged_real=[]), RECIPE, seed=0)


def test_the_exported_network_is_the_trained_one() -> None:
    import onnxruntime

    network = Generator(4)
    initialise_weights(network, torch.Generator().manual_seed(0))
    image = np.random.default_rng(0).integers(0, 255, (NETWORK_HEIGHT, 2 * NETWORK_HEIGHT, 4), dtype=np.uint8)
    seen = gather_taps(image_to_tensor(image)[0].numpy(), (0, NETWORK_HEIGHT))[None]
    with torch.no_grad():
        expected = network.decode(network.run_blocks(torch.from_numpy(seen), True, []), True).numpy()
    session = onnxruntime.InferenceSession(
        export_generator_onnx(network.state_dict(), RECIPE), providers=["CPUExecutionProvider"]
    )
    np.testing.assert_allclose(session.run(None, {"seen": seen})[0], expected, atol=1e-4)
    # away from edges, training's taps are those of the translator
    entry = network.gather_inputs(image_to_tensor(image), [(0, NETWORK_HEIGHT)])[0].numpy()
    np.testing.assert_allclose(entry[:, 40:-40, 24:-24], seen[0, :, 40:-40, 24:-24], atol=1e-4)


def test_training_applies_grids_as_the_translator_does() -> None:
    rng = np.random.default_rng(0)
    grid = (rng.normal(0, 0.2, (12, 8, 6, 12)) + np.eye(3, 4).reshape(12, 1, 1, 1)).astype(np.float32)
    image = rng.integers(0, 255, (48, 96, 3), dtype=np.uint8)
    trained = apply_grid(torch.from_numpy(grid)[None], image_to_tensor(image))[0].permute(1, 2, 0).numpy()
    pixels = np.clip((trained + 1) * 127.5 + 0.5, 0, 255).astype(np.uint8)
    inside = (slice(None), slice(8, -8))  # the translator wraps at the sides
    assert np.abs(apply_colour_grid(grid, image)[inside].astype(int) - pixels[inside]).max() <= 1


def test_earlier_parts_are_translated_and_given_ones_are_not() -> None:
    network = Generator(4)
    initialise_weights(network, torch.Generator().manual_seed(0))
    rng = np.random.default_rng(0)
    plain = image_to_tensor(rng.integers(0, 255, (96, 160, 3), dtype=np.uint8))
    given, earlier = torch.zeros(2, 1, 1, 96, 160, dtype=torch.bool)
    given[..., :40], earlier[..., 80:] = True, True
    partial, known, alone = simulate_earlier(network, plain, given, earlier, [(80, 256)], RECIPE)
    assert torch.equal(partial[..., :80], plain[..., :80])
    assert (partial[..., 80:] != plain[..., 80:]).any()
    assert (alone != plain).any()
    assert torch.equal(known, given | earlier)
    bare = replace(RECIPE, conditioned=False)
    partial, known, _ = simulate_earlier(network, plain, given, earlier, [(80, 256)], bare)
    assert torch.equal(partial, plain)
    assert not known.any()


def test_the_distance_tells_photos_of_one_kind_from_others() -> None:
    rng = np.random.default_rng(0)
    dark, also, bright = (
        image_features([rng.normal(mean, 20, (64, 64, 3)).clip(0, 255).astype(np.uint8) for _ in range(8)])
        for mean in (60, 60, 200)
    )
    assert abs(kernel_distance(dark, also)) < 0.1 * kernel_distance(dark, bright)
