"""Linear algebra whose sums have a fixed order, so that results have the same bits on every processor.

BLAS and LAPACK choose a kernel for the processor, and each kernel rounds differently. Here every operation is an
addition, product, division or square root of IEEE 754 in the order of the source; numba neither reorders nor fuses them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from facade_core.core.arrays import Float64Array
from facade_core.core.numba_cache import njit

# Largest number of rotations for one eigenvalue; a few suffice.
_MAX_QL_STEPS = 60
# Off-diagonal elements below this share of their neighbours are zero.
_EPSILON = 2.0**-52


def multiply_matrices(left: ArrayLike, right: ArrayLike) -> Float64Array:
    """Return the product of (..., n, k) and (k, m) in double precision; either may be a vector (k,), as for `@`."""
    one, other = np.asarray(left, np.float64), np.asarray(right, np.float64)
    rows = np.ascontiguousarray(one.reshape(math.prod(one.shape[:-1]), one.shape[-1]))
    columns = np.ascontiguousarray(other if other.ndim == 2 else other[:, None])
    if rows.shape[1] != columns.shape[0]:
        raise ValueError(f"matrices of {one.shape} and {other.shape} have no product")
    product: Float64Array = _multiply(rows, columns).reshape(one.shape[:-1] + other.shape[1:])
    return product


def dot_product(left: Float64Array, right: Float64Array) -> float:
    """Return the product of two vectors (k,), as `@` does."""
    return float((left * right).sum())


def vector_length(vector: Float64Array) -> float:
    """Return the length of a vector (k,), as `np.linalg.norm` does."""
    return float(np.sqrt((vector * vector).sum()))


def solve_least_squares(matrix: Float64Array, right: Float64Array) -> Float64Array:
    """Return the (k, m) solution of an overdetermined system (n, k) of full rank with right sides (n, m).

    Orthogonalises columns by the modified method of Gram and Schmidt.
    """
    columns, sides = np.array(matrix, np.float64).T.copy(), np.array(right, np.float64)
    count = len(columns)
    upper, target = np.zeros((count, count)), np.zeros((count, sides.shape[1]))
    for k in range(count):
        upper[k, k] = np.sqrt((columns[k] ** 2).sum())
        columns[k] /= upper[k, k]
        upper[k, k + 1 :] = (columns[k + 1 :] * columns[k]).sum(axis=1)
        columns[k + 1 :] -= upper[k, k + 1 :, None] * columns[k]
        target[k] = (sides.T * columns[k]).sum(axis=1)
        sides -= np.outer(columns[k], target[k])
    for k in range(count - 1, -1, -1):
        target[k] = (target[k] - (upper[k, k + 1 :, None] * target[k + 1 :]).sum(axis=0)) / upper[k, k]
    return target


def principal_coordinates(rows: Float64Array, count: int) -> Float64Array:
    """Project rows (N, d) on the principal components of their centred values.

    Parameters
    ----------
    rows : (N, d).
    count : largest number of components.

    Returns
    -------
    (N, c) coordinates in the rows' unit, the largest component first; c is `count` or N.
    """
    centred = np.asarray(rows, np.float64) - rows.mean(axis=0)
    values, vectors = symmetric_eigenvectors(multiply_matrices(centred, centred.T))
    order = np.argsort(-values, kind="stable")[:count]
    coordinates: Float64Array = vectors[:, order] * np.sqrt(np.maximum(values[order], 0))
    return coordinates


def symmetric_eigenvectors(matrix: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Return the (n,) eigenvalues, in no order, and (n, n) eigenvectors, in columns, of a symmetric matrix (n, n).

    Householder reflections to a tridiagonal matrix, then QL steps with implicit shifts.

    References
    ----------
    Bowdler, Martin, Reinsch & Wilkinson 1968, The QR and QL algorithms for symmetric matrices.
    """
    work = np.array(matrix, np.float64, order="C")
    vectors = np.eye(len(work))
    diagonal, beside = _tridiagonalise(work, vectors)
    _diagonalise(diagonal, beside, vectors)
    return diagonal, np.ascontiguousarray(vectors.T)


@njit(cache=True)
def multiply_vector(matrix: Float64Array, vector: Float64Array) -> Float64Array:
    """Return the product of a matrix (n, k) and a vector (k,), in kernels; numba's `@` calls BLAS."""
    result = np.zeros(matrix.shape[0])
    for i in range(matrix.shape[0]):
        for k in range(matrix.shape[1]):
            result[i] += matrix[i, k] * vector[k]
    return result


@njit(cache=True)
def _multiply(left: Float64Array, right: Float64Array) -> Float64Array:
    result = np.zeros((left.shape[0], right.shape[1]))
    for i in range(left.shape[0]):
        for k in range(left.shape[1]):
            factor = left[i, k]
            for j in range(right.shape[1]):
                result[i, j] += factor * right[k, j]
    return result


@njit(cache=True)
def _tridiagonalise(a: Float64Array, vectors: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Return the diagonal (n,) and the elements beside it (n,), the last 0; `vectors` (n, n) gets the basis in rows."""
    n = len(a)
    axis, image = np.zeros(n), np.zeros(n)
    for k in range(n - 2):
        square = 0.0
        for i in range(k + 2, n):
            square += a[i, k] * a[i, k]
        if square == 0.0:
            continue
        length = np.sqrt(square + a[k + 1, k] * a[k + 1, k])
        if a[k + 1, k] > 0:
            length = -length
        for i in range(k + 1, n):
            axis[i] = a[i, k]
        axis[k + 1] -= length
        factor = 2 / (square + axis[k + 1] * axis[k + 1])
        overlap = 0.0
        for i in range(k + 1, n):
            image[i] = 0.0
        for j in range(k + 1, n):  # rows of a symmetric matrix are its columns
            for i in range(k + 1, n):
                image[i] += axis[j] * a[j, i]
        for i in range(k + 1, n):
            image[i] *= factor
            overlap += axis[i] * image[i]
        for i in range(k + 1, n):
            image[i] -= factor / 2 * overlap * axis[i]
        for i in range(k + 1, n):
            for j in range(k + 1, n):
                a[i, j] -= axis[i] * image[j] + image[i] * axis[j]
        a[k, k + 1] = a[k + 1, k] = length
        for j in range(n):
            image[j] = 0.0
        for i in range(k + 1, n):
            for j in range(n):
                image[j] += axis[i] * vectors[i, j]
        for i in range(k + 1, n):
            for j in range(n):
                vectors[i, j] -= factor * axis[i] * image[j]
    diagonal, beside = np.zeros(n), np.zeros(n)
    for k in range(n):
        diagonal[k] = a[k, k]
        if k + 1 < n:
            beside[k] = a[k + 1, k]
    return diagonal, beside


@njit(cache=True)
def _diagonalise(d: Float64Array, e: Float64Array, vectors: Float64Array) -> None:
    """Rotate a tridiagonal matrix to its eigenvalues, in `d` (n,), and the rows of `vectors` to eigenvectors."""
    n = len(d)
    for first in range(n):
        for _ in range(_MAX_QL_STEPS):
            last = first
            while last < n - 1 and abs(e[last]) > _EPSILON * (abs(d[last]) + abs(d[last + 1])):
                last += 1
            if last == first:
                break
            shift = (d[first + 1] - d[first]) / (2 * e[first])
            root = np.sqrt(shift * shift + 1)
            shift = d[last] - d[first] + e[first] / (shift + (root if shift >= 0 else -root))
            sine, cosine, moved = 1.0, 1.0, 0.0
            finished = True
            for i in range(last - 1, first - 1, -1):
                across, along = sine * e[i], cosine * e[i]
                root = np.sqrt(across * across + shift * shift)
                e[i + 1] = root
                if root == 0.0:
                    d[i + 1] -= moved
                    e[last] = 0.0
                    finished = False
                    break
                sine, cosine = across / root, shift / root
                shift = d[i + 1] - moved
                root = (d[i] - shift) * sine + 2 * cosine * along
                moved = sine * root
                d[i + 1] = shift + moved
                shift = cosine * root - along
                for k in range(vectors.shape[1]):
                    upper, lower = vectors[i + 1, k], vectors[i, k]
                    vectors[i + 1, k] = sine * lower + cosine * upper
                    vectors[i, k] = cosine * lower - sine * upper
            if finished:
                d[first] -= moved
                e[first] = shift
                e[last] = 0.0
