"""What is declared of arrays and tables is what is created, resized, written and read."""

from __future__ import annotations

from typing import Any

import icechunk
import numpy as np
import pytest
import zarr
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

from facade_core.atlas.arrays import ARRAYS, create_arrays, journal_array_spec, resize_arrays
from facade_core.atlas.rasters import write_chunks
from facade_core.atlas.store import open_table, write_table
from facade_core.atlas.table_schema import TABLES, TEXT, Table
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.errors import StoreError
from tests.facade_core.atlas.stores import PACKED_STORE, unpack

STAGES = ("poses", "exemplars", "textures", "facades", "streets", "surfaces", "pages", "tiles", "pictures")

specs = st.builds(AtlasSpec, st.integers(1, 3), st.just(20.0), page=st.sampled_from([64, 128]), chunk=st.just(32))
units = st.fixed_dictionaries({stage: st.integers(0, 3) for stage in STAGES})


def _metadata(group: Any) -> dict[str, dict[str, Any]]:
    members = dict(group.members(max_depth=None))
    return {path: node.metadata.to_dict() for path, node in members.items() if not path.startswith("exemplars")}


@settings(max_examples=15, deadline=None)
@given(specs, units, specs, units)
def test_resized_arrays_are_those_created(
    spec: AtlasSpec,
    before: dict[str, int],
    other: AtlasSpec,
    after: dict[str, int],
) -> None:
    resized, created = zarr.create_group({}), zarr.create_group({})
    create_arrays(resized, spec, before, crs="EPSG:32635")
    resize_arrays(resized, other, after)
    create_arrays(created, other, after, crs="EPSG:32635")
    found = _metadata(resized)
    assert found == _metadata(created)
    for array in (*ARRAYS, *map(journal_array_spec, STAGES)):
        assert found[array.path]["dimension_names"] == array.dims
        assert found[array.path]["attributes"]["long_name"] == array.long_name
    assert resized["atlas/colour"].shape == (other.pages, other.page, other.page, 3)
    assert resized["journal/streets"].shape == (after["streets"],)


def test_arrays_are_those_of_the_stores_of_before(tmp_path: Any) -> None:
    """But for attributes, which only say more, and for what there was not yet."""
    from facade_core.atlas.store import open_repository, open_root

    held = open_root(open_repository(unpack(PACKED_STORE, tmp_path) / "store").readonly_session("main"))
    group = zarr.create_group({})
    counts = {stage: held[f"journal/{stage}"].shape[0] if f"journal/{stage}" in held else 0 for stage in STAGES}
    create_arrays(group, AtlasSpec(1, 3.0), counts, crs="EPSG:32635")
    for array in (*ARRAYS, *(journal_array_spec(stage) for stage in STAGES if f"journal/{stage}" in held)):
        before, now = (g[array.path].metadata.to_dict() for g in (held, group))
        assert before.pop("attributes").items() <= now.pop("attributes").items()
        assert before == now


def _column(dims: tuple[str, ...], dtype: str, sizes: dict[str, int]) -> st.SearchStrategy[Any]:
    shape = tuple(sizes[dim] for dim in dims)
    if dtype == TEXT:
        letters = st.text(st.characters(codec="utf-8"), max_size=5)
        return st.lists(letters, min_size=shape[0], max_size=shape[0]).map(tuple)
    return arrays_of.arrays(np.dtype(dtype), shape)


@st.composite
def tables(draw: st.DrawFn) -> tuple[Table, dict[str, Any], dict[str, int]]:
    table = TABLES[draw(st.sampled_from(sorted(TABLES)))]
    sizes = {
        dim: draw(st.integers(0 if dim == dims[0] else 1, 3))
        for dims in (c.dims for c in table.columns)
        for dim in dims
    }
    columns = [column for column in table.columns if not column.is_optional or draw(st.booleans())]
    values = {column.name: draw(_column(column.dims, column.dtype, sizes)) for column in columns}
    return table, values, {name: draw(st.integers(1, 9)) for name in table.attributes}


@settings(max_examples=40, deadline=None)
@given(tables())
def test_tables_come_back(drawn: tuple[Table, dict[str, Any], dict[str, int]]) -> None:
    table, values, attributes = drawn
    session = icechunk.Repository.create(icechunk.in_memory_storage()).writable_session("main")
    write_table(session, table.name, table.to_dataset(values, attributes, "EPSG:32635"))
    found = table.read_columns(open_table(session, table.name).load())
    assert found.keys() == values.keys() | attributes.keys()
    for name, value in (values | attributes).items():
        if isinstance(value, np.ndarray):
            assert found[name].dtype == value.dtype
            np.testing.assert_array_equal(found[name], value)
        else:
            assert found[name] == value


def test_a_column_that_is_not_declared_is_refused() -> None:
    table = TABLES["sightings"]
    rows = {column.name: np.zeros(2) for column in table.columns}
    assert table.to_dataset(rows, {}, "EPSG:32635").sizes == {"sighting": 2}
    for wrong, word in (({**rows, "depth": rows["seen"]}, "depth"), ({"seen": rows["seen"]}, "facade, panorama, pix")):
        with pytest.raises(StoreError, match=f"table sightings: {word}.*declare it"):
            table.to_dataset(wrong, {}, "EPSG:32635")


INSIDE = [(0, 31), (1, 32), (32, 80), (0, 160), (32, 32)]


@pytest.mark.parametrize(
    ("rows", "columns"), [*((one, (0, 32)) for one in INSIDE), *(((0, 32), one) for one in INSIDE)]
)
def test_a_region_begins_and_ends_on_chunks(rows: tuple[int, int], columns: tuple[int, int]) -> None:
    array: Any = zarr.create_array({}, name="colour", shape=(1, 128, 128), chunks=(1, 32, 32), dtype=np.uint8)
    values = np.ones((rows[1] - rows[0], columns[1] - columns[0]), np.uint8)
    with pytest.raises(
        StoreError, match=f"colour: rows {rows[0]}:{rows[1]}, columns {columns[0]}:{columns[1]} of page 0"
    ):
        write_chunks(array, (0, slice(*rows), slice(*columns)), values)
    assert not array[:].any()
    write_chunks(array, (0, slice(32, 96), slice(0, 128)), np.ones((64, 128), np.uint8))
    assert array[:].sum() == 64 * 128
