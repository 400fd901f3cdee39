"""Round trip of the file of a hierarchy: integers are exact, light is quantised."""

from __future__ import annotations

import io
import json
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facade_core.core.errors import InputError
from facade_core.facade.variation.codec import decode_hierarchy_file, encode_hierarchy_file
from facade_core.facade.variation.contents import ElementGroup


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.integers(0, 3), st.integers(1, 4), st.data())
def test_a_file_holds_what_it_was_given(seed: int, count: int, levels: int, data: st.DataObject) -> None:
    rng = np.random.default_rng(seed)
    photo = rng.integers(0, 256, (int(rng.integers(1, 40)), int(rng.integers(1, 40)), 3), dtype=np.uint8)
    groups = []
    for _ in range(count):
        n = int(rng.integers(1, 6))
        boxes = rng.integers(-(2**31), 2**31, (n, 4)).astype(np.int32)
        groups.append(ElementGroup("window", boxes, rng.uniform(0, 2, n), rng.integers(0, 5, n).astype(np.int32)))
    elements = sum(len(group.boxes) for group in groups)
    shapes = data.draw(st.lists(st.tuples(st.integers(1, 4), st.integers(1, 4)), max_size=3)) if elements else []
    cells = [rng.integers(-1, elements, shape).astype(np.int32) for shape in shapes]
    matrices = [[np.where(c >= 0, rng.integers(0, 5, c.shape), -1).astype(np.int32) for c in cells]] * levels
    representatives = rng.integers(0, max(1, elements), 5).astype(np.int32)

    coded = encode_hierarchy_file(photo, groups, cells, representatives, matrices)
    assert coded == encode_hierarchy_file(photo, groups, cells, representatives, matrices)
    contents = decode_hierarchy_file(coded)
    assert contents.photo.shape == photo.shape
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
        np.testing.assert_array_equal(found.light, np.round(128 * group.light) / 128)
    with pytest.raises(InputError, match="encode the facade again"):
        decode_hierarchy_file(coded[: int(rng.integers(0, len(coded)))])


def test_a_file_of_an_earlier_format_says_what_to_do() -> None:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("header.json", json.dumps({"format": "streetloom variation 2", "groups": []}))
        archive.writestr("wall.webp", b"")
    with pytest.raises(InputError, match=r"format 'streetloom variation 2' is not .*; encode the facade again"):
        decode_hierarchy_file(out.getvalue())
