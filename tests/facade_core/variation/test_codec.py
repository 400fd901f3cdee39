"""Whatever a facade's file is given comes back: whole numbers as they were, the rest to its step."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facade_core.errors import InputError
from facade_core.variation.appearance import Basis
from facade_core.variation.codec import code_basis, decode, decode_basis, encode_file, quantise_light
from facade_core.variation.contents import Group


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.integers(0, 3), st.integers(1, 4), st.data())
def test_a_file_holds_what_it_was_given(seed: int, count: int, levels: int, data: st.DataObject) -> None:
    rng = np.random.default_rng(seed)
    wall = rng.integers(0, 256, (int(rng.integers(1, 40)), int(rng.integers(1, 40)), 3), dtype=np.uint8)
    bases, groups = [], []
    for _ in range(count):
        shape = (int(rng.integers(1, 9)), int(rng.integers(1, 9)), 3)
        axes = rng.normal(size=(int(rng.integers(0, 4)), *shape)).astype(np.float32)
        bases.append(code_basis(Basis(rng.uniform(0, 255, shape).astype(np.float32), axes)))
        n = int(rng.integers(1, 6))
        boxes = rng.integers(-(2**31), 2**31, (n, 4)).astype(np.int32)
        light, coordinates = rng.uniform(0, 2, n), rng.normal(0, 300, (n, len(axes)))
        types = rng.integers(0, 5, n).astype(np.int32)
        groups.append(Group("window", decode_basis(*bases[-1]), boxes, light, coordinates, types))
    elements = sum(len(group.boxes) for group in groups)
    shapes = data.draw(st.lists(st.tuples(st.integers(1, 4), st.integers(1, 4)), max_size=3)) if elements else []
    cells = [rng.integers(-1, elements, shape).astype(np.int32) for shape in shapes]
    matrices = [[np.where(c >= 0, rng.integers(0, 5, c.shape), -1).astype(np.int32) for c in cells]] * levels
    representatives = rng.integers(0, max(1, elements), 5).astype(np.int32)

    coded = encode_file(wall, groups, bases, cells, representatives, matrices)
    assert coded == encode_file(wall, groups, bases, cells, representatives, matrices)
    contents = decode(coded)
    assert contents.wall.shape == wall.shape
    np.testing.assert_array_equal(contents.representatives, representatives)
    assert len(contents.levels) == levels
    for one, other in zip(contents.cells, cells, strict=True):
        np.testing.assert_array_equal(one, other)
    for level, given_matrices in zip(contents.levels, matrices, strict=True):
        for one, other in zip(level.grids, given_matrices, strict=True):
            np.testing.assert_array_equal(one, other)
    for found, group in zip(contents.groups, groups, strict=True):
        np.testing.assert_array_equal(found.boxes, group.boxes)
        np.testing.assert_array_equal(found.types, group.types)
        np.testing.assert_array_equal(found.basis.mean, group.basis.mean)
        np.testing.assert_array_equal(found.basis.axes, group.basis.axes)
        np.testing.assert_array_equal(found.light, quantise_light(group.light))
        step = 0.5 * np.sqrt(group.basis.mean.size)
        np.testing.assert_allclose(found.coordinates, group.coordinates, atol=step / 2 + 1e-9)
    with pytest.raises(InputError, match="encode the facade again"):
        decode(coded[: int(rng.integers(0, len(coded)))])
