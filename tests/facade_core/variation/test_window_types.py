"""Types of windows by the learnt metric, and its file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from sklearn.metrics import adjusted_rand_score

from facade_core.core.errors import ModelFileError
from facade_core.core.types import Element
from facade_core.facade.variation.group_patches import cut_group_patches
from facade_core.facade.variation.window_features import FEATURE_BLOCKS, compute_window_features
from facade_core.facade.variation.window_types import (
    SHIPPED_WINDOW_METRIC,
    WINDOW_STATES,
    cluster_window_types,
    compare_windows,
    load_window_metric,
)
from training.datasets.window_states import read_window_states
from training.windows import save_window_metric


def paint_windows(seed: int) -> tuple[np.ndarray, list[Element], np.ndarray]:
    """Four rows of six windows on a pale wall: panes, and shutters of slats over all; light falls off to the right."""
    rng = np.random.default_rng(seed)
    image = np.full((360, 420, 3), (200.0, 190, 175))
    planted = rng.integers(2, size=24)
    elements = []
    for i, state in enumerate(planted.tolist()):
        x, y = 20 + 68 * (i % 6), 20 + 86 * (i // 6)
        window = image[y : y + 60, x : x + 36]
        window[:] = (235, 232, 226)
        if state:
            window[2:-2:4] = (180, 178, 172)
        else:
            window[3:-3, 3:16] = window[3:-3, 20:-3] = np.array((52, 60, 72)) + rng.uniform(-8, 8)
        elements.append(Element("window", x, y, x + 36, y + 60))
    image *= np.linspace(1, 0.8, 420)[None, :, None]
    return np.clip(image + rng.normal(0, 4, image.shape), 0, 255).astype(np.uint8), elements, planted


@pytest.mark.parametrize("seed", range(3))
def test_panes_and_shutters_are_two_types_in_light_and_shade(seed: int) -> None:
    image, elements, planted = paint_windows(seed)
    (group,) = cut_group_patches(image, elements)
    types, representatives = cluster_window_types(group)
    assert adjusted_rand_score(planted[group.members], types) >= 0.9
    assert types[representatives].tolist() == list(range(len(representatives)))
    similarity, _, _ = compare_windows(group)
    np.testing.assert_allclose(similarity, similarity.T, atol=1e-9)
    assert np.array_equal(cluster_window_types(group)[0], types)


def test_windows_of_one_state_are_more_alike_than_those_of_two() -> None:
    image, elements, planted = paint_windows(0)
    (group,) = cut_group_patches(image, elements)
    similarity, _, _ = compare_windows(group)
    same = planted[group.members][:, None] == planted[group.members]
    assert similarity[same].mean() > 0.5 > similarity[~same].mean()


@pytest.mark.parametrize("number", [1, 2])
def test_few_windows_have_types(number: int) -> None:
    image, elements, _ = paint_windows(0)
    (group,) = cut_group_patches(image, elements[:number])
    types, _ = cluster_window_types(group)
    assert len(types) == number


def test_features_are_of_their_parts_and_finite() -> None:
    patches = np.random.default_rng(0).uniform(0, 255, (5, 7, 31, 3)).astype(np.float32)
    features = compute_window_features(patches, 128.0)
    assert features.shape == (5, 2 * sum(FEATURE_BLOCKS))
    assert np.isfinite(features).all()
    assert np.abs(np.median(features[:, sum(FEATURE_BLOCKS) :], axis=0)).max() < 1e-9


def test_a_metric_is_read_as_it_was_written_and_refused_once_changed(tmp_path: Path) -> None:
    metric = load_window_metric(SHIPPED_WINDOW_METRIC)
    assert SHIPPED_WINDOW_METRIC.with_suffix(".md").is_file()
    copy = tmp_path / "window_types.json"
    save_window_metric(metric, copy)
    for one, other in zip(metric, load_window_metric(copy), strict=True):
        assert np.array_equal(one, other)
    record = json.loads(copy.read_text())
    for change, message in (
        ({"features": 0}, "another version"),
        ({"model": record["model"] | {"pair_bias": [0, 0, 0]}}, "checksum"),
        ({"model": 1}, "not a metric"),
    ):
        copy.write_text(json.dumps(record | change))
        with pytest.raises(ModelFileError, match=message):
            load_window_metric(copy)
    with pytest.raises(ModelFileError, match="no such metric"):
        load_window_metric(tmp_path / "other.json")


def test_marked_windows_have_known_states_and_are_not_those_of_the_benchmark() -> None:
    marked = read_window_states()
    judged = json.loads((Path(__file__).parents[3] / "benchmarks" / "window_states.json").read_text())["windows"]
    assert not {f"ecp/{name}" for name in judged} & marked.keys()
    assert {state for windows in marked.values() for state in windows.values()} == {*WINDOW_STATES, "slit"}
    assert sum(map(len, marked.values())) == 1619
