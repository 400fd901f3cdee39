"""Texels of any charts, written in any order, are read back, and no other chart's change."""

from __future__ import annotations

import numpy as np
import zarr
from hypothesis import given, settings
from hypothesis import strategies as st

from facade_core.atlas.rasters import TexelLayout, read_rasters, write_rasters
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.geometry.chart_packing import pack_charts

PAGE, CHUNK, GUTTER = 256, 32, 2


@settings(max_examples=12)
@given(
    st.lists(
        st.tuples(st.integers(1, 100), st.integers(1, 4) | st.integers(1, 100), st.integers(-1, 3)),
        min_size=1,
        max_size=12,
    ),
    st.sampled_from([(), (3,)]),
    st.integers(0, 2**32 - 1),
    st.data(),
)
def test_rasters_come_back_and_leave_the_others(
    charts: list[tuple[int, int, int]], bands: tuple[int, ...], seed: int, data: st.DataObject
) -> None:
    rng = np.random.default_rng(seed)
    texels, owner = np.array([chart[:2] for chart in charts]), np.array([chart[2] for chart in charts])
    placement = pack_charts(texels, 1.0, owner, page=PAGE, chunk=CHUNK, gutter=GUTTER)
    spec = AtlasSpec(placement.pages, 20.0, page=PAGE, chunk=CHUNK, gutter=GUTTER)
    shape, chunks = (placement.pages, PAGE, PAGE, *bands), (1, CHUNK, CHUNK, *bands)
    array = zarr.create_array({}, shape=shape, chunks=chunks, dtype=np.uint8)
    whole = TexelLayout.of_charts(placement, range(len(charts)))
    before = rng.integers(0, 256, (whole.total, *bands), dtype=np.uint8)
    write_rasters(array, spec, placement, whole, before)

    chosen = TexelLayout.of_charts(
        placement, data.draw(st.permutations(range(len(charts))))[: int(rng.integers(1, 13))]
    )
    flat = rng.integers(0, 256, (chosen.total, *bands), dtype=np.uint8)
    write_rasters(array, spec, placement, chosen, flat)
    np.testing.assert_array_equal(read_rasters(array, placement, chosen), flat)
    expected = before.copy()
    for chart in chosen.charts.tolist():
        expected[whole.texel_slice(placement, chart)] = flat[chosen.texel_slice(placement, chart)]
    np.testing.assert_array_equal(read_rasters(array, placement, whole), expected)
