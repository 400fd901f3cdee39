"""Training of the translator: resumable to the bit, judged by a distance, and each part of the recipe does something."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="torch is absent: make train-setup")

import torch

from facade_core.core.errors import ImageError, ModelFileError
from facade_core.street.translator import training
from facade_core.street.translator.equirectangular_taps import gather_taps
from facade_core.street.translator.kernel_distance import image_features, kernel_distance
from facade_core.street.translator.network import Discriminator, Generator, image_to_tensor, initialise_weights
from facade_core.street.translator.network_export import export_generator_onnx, store_half_precision
from facade_core.street.translator.training import learning_rate_share, train_generator
from facade_core.street.translator.training_steps import TrainingDomains, TrainingRecipe, step_paired
from facade_core.street.translator.training_views import TrainingPair, TrainingRendering, random_pair_crop

COURSE = TrainingRecipe(width=4, steps=4, warm=1, crop=(32, 64), batch=1, check=2)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "_EVALUATION_CROPS", 8)


def domains(seed: int = 0) -> TrainingDomains:
    rng = np.random.default_rng(seed)
    views = [TrainingRendering(rng.integers(0, 255, (512, 1024), dtype=np.uint8), rng.random((512, 1024)) < 0.5)]
    photos = [rng.integers(0, 255, (512, 1024, 3), dtype=np.uint8)]
    return TrainingDomains(views, photos, views, photos)


def test_an_interrupted_run_ends_in_the_same_weights(tmp_path: Path) -> None:
    whole = train_generator(domains(), COURSE, seed=1)
    stopped = {"yes": False}

    def stop(_stage: str, done: int, _total: int) -> None:
        if done == 3 and not stopped["yes"]:
            stopped["yes"] = True
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_generator(domains(), COURSE, seed=1, state=tmp_path / "s", progress=stop)
    again = train_generator(domains(), COURSE, seed=1, state=tmp_path / "s")
    assert again.distances == whole.distances
    assert all(torch.equal(again.weights[name], value) for name, value in whole.weights.items())
    with pytest.raises(ModelFileError, match="another training run"):
        train_generator(domains(), COURSE, seed=2, state=tmp_path / "s")
    with pytest.raises(ModelFileError, match="another training run"):
        train_generator(
            domains(), replace(COURSE, steps=8), seed=1, state=tmp_path / "s"
        )  # the rate has fallen already
    assert whole.step == min(whole.distances, key=whole.distances.__getitem__)


@pytest.mark.parametrize("part", ["conditioned", "masked", "equirectangular", "merged"])
def test_every_part_of_the_recipe_changes_what_is_learnt(part: str) -> None:
    course = replace(COURSE, steps=2)
    full, without = (train_generator(domains(), c, seed=1) for c in (course, replace(course, **{part: False})))
    assert any(
        full.weights[name].shape != value.shape or not torch.equal(full.weights[name], value)
        for name, value in without.weights.items()
    )


def test_the_rate_is_constant_and_then_falls_straight() -> None:
    assert [learning_rate_share(step, 200) for step in (0, 149, 175, 199)] == [1.0, 1.0, 0.5, 0.02]


def test_an_empty_domain_is_refused() -> None:
    with pytest.raises(ImageError, match="no pictures in judged_real"):
        train_generator(replace(domains(), judged_real=[]), COURSE, seed=0)


def test_the_exported_network_is_the_trained_one() -> None:
    import onnxruntime

    network = Generator(4)
    initialise_weights(network, torch.Generator().manual_seed(0))
    image = np.random.default_rng(0).integers(0, 255, (32, 64, 3), dtype=np.uint8)
    seen = gather_taps(image_to_tensor(image)[0].numpy(), (0, 32))[None]
    with torch.no_grad():
        expected = network.decode(network.run_blocks(torch.from_numpy(seen), True, []), True).numpy()
    content = export_generator_onnx(network.state_dict(), COURSE)
    for made, near in ((content, 1e-4), (store_half_precision(content), 5e-3)):
        session = onnxruntime.InferenceSession(made, providers=["CPUExecutionProvider"])
        np.testing.assert_allclose(session.run(None, {"seen": seen})[0], expected, atol=near)
    # away from edges, training's taps are those of the translator
    entry = network.gather_inputs(image_to_tensor(image), [(0, 32)])[0].numpy()
    np.testing.assert_allclose(entry[:, 12:20, 8:-8], seen[0, :, 12:20, 8:-8], atol=1e-4)


def test_the_distance_tells_photos_of_one_kind_from_others() -> None:
    rng = np.random.default_rng(0)
    dark, also, bright = (
        image_features([rng.normal(mean, 20, (64, 64, 3)).clip(0, 255).astype(np.uint8) for _ in range(8)])
        for mean in (60, 60, 200)
    )
    assert abs(kernel_distance(dark, also)) < 0.1 * kernel_distance(dark, bright)


def pairs(colour: tuple[int, int, int], columns: int = 512) -> list[TrainingPair]:
    """One, of one colour, which is true in so many columns from the left."""
    true = np.arange(1024) < columns
    image = np.where(true[:, None], np.uint8(colour), np.uint8(0)) * np.ones((512, 1, 1), np.uint8)
    grey = np.random.default_rng(0).integers(100, 255, (512, 1024), dtype=np.uint8)
    return [
        TrainingPair(TrainingRendering(grey, np.ones((512, 1024), bool)), image, np.broadcast_to(true, (512, 1024)))
    ]


def test_crops_of_pairs_show_one_place() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        crop, image, true = random_pair_crop(pairs((200, 40, 30)), (32, 64), rng)
        assert crop.image.shape == image.shape == (32, 64, 3)
        assert (image[true] == (200, 40, 30)).all()
        assert not image[~true].any()
        assert not crop.textured[~true].any(), "nothing is known where nothing is true"


def test_pairs_teach_what_is_true() -> None:
    course = replace(COURSE, width=8, steps=1)
    random = torch.Generator().manual_seed(0)
    kept = {"generator": Generator(8), "discriminator": Discriminator(8)}
    for network in kept.values():
        initialise_weights(network, random)
    kept["first"] = torch.optim.Adam(kept["generator"].parameters(), lr=2e-3)
    given = replace(domains(), paired=pairs((200, 40, 30), 1024))
    losses = [step_paired(given, course, kept, (0, number), torch.device("cpu")) for number in range(60)]
    assert np.mean(losses[-10:]) < 0.7 * np.mean(losses[:10])


def test_half_of_the_steps_are_of_pairs_where_there_are_some() -> None:
    plain, paired = (
        train_generator(d, COURSE, seed=1) for d in (domains(), replace(domains(), paired=pairs((200, 40, 30))))
    )
    assert any(not torch.equal(paired.weights[name], value) for name, value in plain.weights.items())
