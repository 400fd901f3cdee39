"""Exact ties and near-ties go to the first candidate, and linear algebra has the same bits under every BLAS kernel."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from facade_core.core.fixed_order import (
    multiply_matrices,
    multiply_vector,
    principal_coordinates,
    solve_least_squares,
    symmetric_eigenvectors,
)
from facade_core.core.ties import first_maximum, first_minimum
from facade_core.facade.variation.element_types import choose_representatives
from facade_core.facade.variation.icm import initial_icm_state, run_icm
from facade_core.facade.variation.structure import regularise_structure_matrix

# Relative margins of rounding.
NOISE = (0.0, 1e-15, -1e-15)
# Kernels without fused operations, with other vector lengths, that every x86-64 processor of the last decade runs.
KERNELS = ("Nehalem", "Sandybridge")
DIGEST_OF_TYPES = """
import hashlib
import numpy as np
from facade_core.core.fixed_order import principal_coordinates
from facade_core.facade.variation.appearance import project_on_principal_components
from facade_core.facade.variation.element_types import cluster_types, compute_descriptors
rng = np.random.default_rng(0)
kinds = rng.uniform(0, 255, (4, 40, 24, 3))
patches = kinds[rng.integers(4, size=24)].astype(np.float32) + rng.normal(0, 8, (24, 40, 24, 3)).astype(np.float32)
descriptors = compute_descriptors(patches, np.ones(patches.shape[:3], bool))
results = (descriptors, *cluster_types(descriptors), project_on_principal_components(patches))
print(hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in results)).hexdigest())
"""


@pytest.mark.parametrize("noise", NOISE)
@pytest.mark.parametrize(("choose", "sign"), [(first_minimum, 1.0), (first_maximum, -1.0)])
def test_near_ties_go_to_the_first(choose: Callable[..., int], sign: float, noise: float) -> None:
    values = sign * np.array([7.0, 3.0 * (1 + noise), 3.0, 5.0, np.inf])
    assert choose(values) == 1
    assert choose(values[::-1]) == 2
    assert choose(sign * np.array([3.0 + 1e-6, 3.0])) == 1


def test_what_differs_by_less_than_a_tolerance_is_equal() -> None:
    assert first_minimum([3.0 + 1e-6, 3.0], 1e-5) == 0


@pytest.mark.parametrize("noise", NOISE)
@pytest.mark.parametrize("seed", range(8))
def test_the_first_of_a_pair_represents_it(seed: int, noise: float) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 60, (2, 7))
    points[1] *= 1 + noise * rng.integers(1, 4, 7)
    lone = rng.normal(0, 60, (1, 7))
    pair = np.concatenate([lone, points])
    assert choose_representatives(pair, np.array([1, 0, 0], np.int32)).tolist() == [1, 0]
    equal = np.repeat(points[:1], 5, axis=0) * (1 + noise * rng.integers(0, 4, (5, 7)))
    assert choose_representatives(equal, np.zeros(5, np.int32)).tolist() == [0]


@pytest.mark.parametrize("noise", NOISE)
def test_equal_moves_and_merges_go_to_the_first_type(noise: float) -> None:
    structure = np.array([[0, 1, 2, 1, 2, 1, 2]], np.int32)
    cost = np.array([[0, 1, 1 + noise], [1, 0, 1], [1 + noise, 1, 0]]) * 0.3
    reference = run_icm_labels(structure, cost * 0 + 0.3 * (1 - np.eye(3)), 0.4)
    assert run_icm_labels(structure, cost, 0.4) == reference
    halves = np.array([[0, 1]], np.int32)
    lopsided = np.array([[0.0, 1.0 + noise], [1.0, 0.0]]) * 1e9  # no weight of regularity is worth a change
    last = regularise_structure_matrix(halves, lopsided)[-1]
    assert last.labels.tolist() == [[0, 0]]


def run_icm_labels(structure: np.ndarray, cost: np.ndarray, alpha: float) -> list[list[int]]:
    state = initial_icm_state(structure, len(cost))
    run_icm(state, np.ascontiguousarray(cost), alpha)
    return state.labels.tolist()


@pytest.mark.parametrize("size", [1, 2, 3, 10, 60])
def test_eigenvectors_match_lapack(size: int) -> None:
    rows = np.random.default_rng(size).uniform(0, 255, (size, 90))
    rows[size // 2 :: 3] = rows[size // 2]  # equal rows: eigenvalues of 0
    products = multiply_matrices(rows, rows.T)
    np.testing.assert_allclose(products, rows @ rows.T, rtol=1e-12)
    assert np.array_equal(products, products.T)
    values, vectors = symmetric_eigenvectors(products)
    scale = values.max()
    np.testing.assert_allclose(np.sort(values), np.linalg.eigvalsh(products), atol=1e-13 * scale)
    np.testing.assert_allclose(vectors * values @ vectors.T, products, atol=1e-13 * scale)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(size), atol=1e-12)
    found = principal_coordinates(rows, 7)
    left, strength, _ = np.linalg.svd(rows - rows.mean(axis=0), full_matrices=False)
    np.testing.assert_allclose(np.abs(found), np.abs(left * strength)[:, : found.shape[1]], atol=1e-5 * np.sqrt(scale))


def test_products_of_vectors_have_the_shapes_of_numpy() -> None:
    matrix, vector = np.arange(6.0).reshape(2, 3), np.arange(3.0)
    assert np.array_equal(multiply_matrices(matrix, vector), matrix @ vector)
    assert np.array_equal(multiply_matrices(vector, matrix.T), vector @ matrix.T)
    assert np.array_equal(multiply_vector(matrix, vector), matrix @ vector)
    assert multiply_matrices(vector, vector).shape == ()
    rays = np.arange(24.0).reshape(2, 4, 3)
    assert np.array_equal(multiply_matrices(rays, matrix.T), rays @ matrix.T)
    for shape in ((0, 0), (0, 3), (2, 0)):
        assert multiply_matrices(np.zeros(shape), np.zeros((shape[1], 4))).tolist() == np.zeros((shape[0], 4)).tolist()
    with pytest.raises(ValueError, match="no product"):
        multiply_matrices(matrix, matrix)


def test_least_squares_match_lapack() -> None:
    rng = np.random.default_rng(0)
    matrix, right = rng.normal(size=(12, 5)) * np.geomspace(1e-3, 1e2, 12)[:, None], rng.normal(size=(12, 3))
    expected = np.linalg.lstsq(matrix, right, rcond=None)[0]
    np.testing.assert_allclose(solve_least_squares(matrix, right), expected, rtol=1e-8)


@pytest.mark.skipif(
    platform.machine() not in ("x86_64", "AMD64")
    or not any(pool["internal_api"] == "openblas" for pool in threadpool_info()),
    reason="no OpenBLAS for x86-64 here",
)
def test_types_have_the_same_bits_under_every_kernel_of_openblas() -> None:
    chosen = {key: value for key, value in os.environ.items() if key != "OPENBLAS_CORETYPE"}
    kernels = [{"OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1"} for kernel in KERNELS]
    digests = {
        subprocess.run(
            [sys.executable, "-c", DIGEST_OF_TYPES],
            env=chosen | kernel,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for kernel in ({"OPENBLAS_NUM_THREADS": "1"}, {"OPENBLAS_NUM_THREADS": "4"}, *kernels)
    }
    assert len(digests) == 1
