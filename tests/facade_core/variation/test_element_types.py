import numpy as np
import pytest
from sklearn.metrics import adjusted_rand_score, silhouette_score

from facade_core.facade.variation.appearance import project_on_principal_components, relabelling_cost
from facade_core.facade.variation.element_types import (
    cluster_types,
    compute_descriptors,
    fill_unknown_from_similar,
    mean_shift,
    mean_silhouette,
)


def patches(seed, number=30, types=3):
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 255, (types, 5, 4, 3))
    planted = rng.integers(types, size=number)
    prototypes = low.repeat(6, axis=1).repeat(6, axis=2)
    return np.clip(prototypes[planted] + rng.normal(0, 10, (number, 30, 24, 3)), 0, 255).astype(np.float32), planted


def all_seen(images):
    return np.ones(images.shape[:3], bool)


def types_of(images, seen=None):
    return cluster_types(compute_descriptors(images, all_seen(images) if seen is None else seen))


def test_projected_patches_lie_as_far_apart_as_the_patches():
    images, _ = patches(0)
    rng = np.random.default_rng(0)
    flat = (rng.uniform(0, 20, (30, 5)) @ rng.uniform(0, 10, (5, images[0].size))).reshape(images.shape)
    found = project_on_principal_components(flat)
    assert found.shape == (30, 7)
    apart = np.linalg.norm((flat[:, None] - flat[None]).reshape(30, 30, -1), axis=2)
    np.testing.assert_allclose(np.linalg.norm(found[:, None] - found[None], axis=2), apart, rtol=1e-4, atol=1e-3)
    assert project_on_principal_components(flat[:1]).shape == (1, 1)


def test_planted_types_are_found():
    for seed in range(5):
        images, planted = patches(seed, types=2 + seed)
        types, representatives = types_of(images)
        assert adjusted_rand_score(planted, types) >= 0.9
        assert types[representatives].tolist() == list(range(len(representatives)))


def test_alike_patches_are_one_type_and_a_lone_one_too():
    images, _ = patches(1, types=1)
    for some in (images, images[:1]):
        types, _ = types_of(some)
        assert types.tolist() == [0] * len(some)


def test_flat_parts_beside_strong_edges_have_finite_descriptors():
    images = np.full((6, 200, 120, 3), 128, np.float32)
    images[:, 1:7, ::2] = np.random.default_rng(0).uniform(0, 255, (6, 6, 60, 3))
    assert np.isfinite(compute_descriptors(images, all_seen(images))).all()


def test_a_shadow_makes_no_type():
    images, planted = patches(3, types=3)
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:30, :24] / 27 - 0.5
    for image in images[::2]:
        towards = rng.uniform(0, 2 * np.pi)
        image *= 0.8 + np.clip(0.3 * (x * np.cos(towards) + y * np.sin(towards)), -0.2, 0.2)[..., None]
    types, _ = types_of(images)
    assert adjusted_rand_score(planted, types) >= 0.9


def test_what_hides_an_element_makes_no_type():
    images, planted = patches(4, types=3)
    hidden = np.arange(30) % 3 == 0
    images[hidden, 20:] = (40, 160, 60)
    seen = all_seen(images)
    seen[hidden, 20:] = False
    types, _ = types_of(fill_unknown_from_similar(images, seen), seen)
    assert adjusted_rand_score(planted, types) >= 0.9


def test_hidden_values_are_those_of_the_most_alike():
    values = np.array([[1.0, 5.0], [3.0, 7.0], [2.8, 0.0], [9.0, 0.0]]).reshape(4, 1, 2, 1)
    known = np.array([[True, True], [True, True], [True, False], [True, False]]).reshape(4, 1, 2)
    assert fill_unknown_from_similar(values, known)[:, 0, 1, 0].tolist() == [5, 7, 7, 7]
    known[:, 0, 1] = False
    assert np.array_equal(fill_unknown_from_similar(values, known), values)


def test_mean_shift_puts_the_largest_first():
    points = np.array([[5.0], [0.0], [0.1], [0.2], [5.1], [9.0]])
    assert mean_shift(points, 1.0).tolist() == [1, 0, 0, 0, 1, 2]


def test_silhouette_is_the_usual_one():
    rng = np.random.default_rng(2)
    points, types = rng.random((20, 3)), rng.integers(4, size=20)
    assert mean_silhouette(points, types) == pytest.approx(silhouette_score(points, types))
    assert mean_silhouette(points, np.zeros(20, int)) == 0


def test_cost_is_the_cubed_share_of_the_largest_difference():
    cost = relabelling_cost(np.array([[0.0, 0], [10, 0], [20, 0]]))
    assert np.allclose(cost, cost.T)
    assert cost[0, 2] == 1
    assert cost[0, 1] == pytest.approx((1 / 4) ** 3)
    assert (np.diag(cost) == 0).all()
