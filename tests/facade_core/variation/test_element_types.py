import numpy as np
import pytest
from sklearn.metrics import adjusted_rand_score, silhouette_score

from facade_core.variation.element_types import (
    cluster,
    mean_shift,
    principal_components,
    relabelling_cost,
    silhouette,
)


def patches(seed, number=30, types=3):
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 255, (types, 5, 4, 3))
    planted = rng.integers(types, size=number)
    prototypes = low.repeat(6, axis=1).repeat(6, axis=2)
    return np.clip(prototypes[planted] + rng.normal(0, 10, (number, 30, 24, 3)), 0, 255).astype(np.float32), planted


def test_axes_are_orthonormal_and_rebuild_low_rank_patches():
    images, _ = patches(0)
    basis = principal_components(images)
    axes = basis.axes.reshape(len(basis.axes), -1).astype(float)
    assert len(axes) <= 7
    assert np.allclose(axes @ axes.T, np.eye(len(axes)), atol=1e-4)
    error = basis.patches(basis.project(images)) - images
    assert np.sqrt((error**2).mean()) < 11


def test_planted_types_are_found():
    for seed in range(5):
        images, planted = patches(seed, types=2 + seed)
        basis = principal_components(images)
        types, representatives = cluster(basis.project(images), basis.mean.size)
        assert adjusted_rand_score(planted, types) >= 0.9
        assert types[representatives].tolist() == list(range(len(representatives)))


def test_alike_patches_are_one_type_and_a_lone_one_too():
    images, _ = patches(1, types=1)
    for some in (images, images[:1]):
        basis = principal_components(some)
        types, _ = cluster(basis.project(some), basis.mean.size)
        assert types.tolist() == [0] * len(some)


def test_mean_shift_puts_the_largest_first():
    points = np.array([[5.0], [0.0], [0.1], [0.2], [5.1], [9.0]])
    assert mean_shift(points, 1.0).tolist() == [1, 0, 0, 0, 1, 2]


def test_silhouette_is_the_usual_one():
    rng = np.random.default_rng(2)
    points, types = rng.random((20, 3)), rng.integers(4, size=20)
    distance = np.sqrt(((points[:, None] - points) ** 2).sum(axis=2))
    assert silhouette(distance, types) == pytest.approx(silhouette_score(points, types))
    assert silhouette(distance, np.zeros(20, int)) == 0


def test_cost_is_the_cubed_share_of_the_largest_difference():
    images = np.zeros((3, 2, 2, 3))
    images[1], images[2] = 10, 20
    cost = relabelling_cost(images)
    assert np.allclose(cost, cost.T)
    assert cost[0, 2] == 1
    assert cost[0, 1] == pytest.approx((1 / 4) ** 3)
    assert (np.diag(cost) == 0).all()
