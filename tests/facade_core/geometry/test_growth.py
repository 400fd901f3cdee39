"""Growth of outlines: as `buffer` for ordinary ones, and at bounded cost for those of many corners."""

from __future__ import annotations

import time

import numpy as np
import shapely

from facade_core.core.types import Building, IngestSettings, Street
from facade_core.geometry.growth import grow_union
from facade_core.plan.ingest import BlockInputs, build_plan


def star(corners: int) -> shapely.Polygon:
    """Return a star of 6 and 12 metres around the origin."""
    angle = np.arange(corners) * 2 * np.pi / corners
    reach = np.where(np.arange(corners) % 2, 12.0, 6.0)
    return shapely.Polygon(np.column_stack([reach * np.cos(angle), reach * np.sin(angle)]))


def test_an_ordinary_area_grows_exactly_as_by_buffer() -> None:
    outlines = [shapely.box(0, 0, 10, 10), shapely.box(14, 0, 24, 30), star(100)]
    union = shapely.union_all(outlines)
    for join_style in ("round", "mitre"):
        assert grow_union(union, outlines, 22.0, join_style).equals_exact(union.buffer(22.0, join_style=join_style))


def test_an_area_of_many_corners_grows_in_steps_to_the_same_place() -> None:
    outlines = [star(600), shapely.box(30, -5, 40, 5)]
    union = shapely.union_all(outlines)
    grown, expected = grow_union(union, outlines, 22.0), union.buffer(22.0)
    assert grown.symmetric_difference(expected).area < 0.005 * expected.area
    assert shapely.hausdorff_distance(grown, expected) < 0.3


def test_a_star_of_many_corners_is_ingested_in_seconds() -> None:
    begin = time.process_time()
    plan = build_plan(
        BlockInputs(
            [Building("star", star(1000), 9.0, "height")],
            [Street("s", "s", shapely.LineString([(-40, -20), (40, -20)]))],
            floor_height=3.2,
        ),
        IngestSettings(
            texels_per_metre=4.0,
            viewpoint_spacing=20.0,
            viewpoint_height=2.5,
            visibility_range=40.0,
            panorama_width=64,
            walls="exemplar",
        ),
    )
    assert not plan.rejected_buildings
    assert time.process_time() - begin < 40
