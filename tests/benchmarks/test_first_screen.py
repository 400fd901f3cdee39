from pathlib import Path

import numpy as np
import shapely

from benchmarks.first_screen import PAGE, bare
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.types import Building, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.scene import Scene

ROOT = Path(__file__).parents[2]


def test_bare_geometry_is_grey_and_darker_at_its_foot() -> None:
    street = Street("s", None, shapely.LineString([(-10, -8), (30, -8)]))
    box = Building("a", shapely.box(0, 0, 20, 10), 12.0, "height")
    charts, mesh, _ = build_block_surfaces(
        [box], [street], terrain=build_terrain([], None), ground_margin=10, largest=90
    )
    placement = pack_charts(charts.size, 8, charts.building, page=1024, chunk=128, gutter=2)
    scene = Scene(mesh, charts, placement, AtlasSpec(placement.pages, 8.0, page=1024))
    roof, wall = (bare(scene, int(np.flatnonzero(charts.kind == kind)[0])) for kind in (ChartKind.ROOF, ChartKind.WALL))
    assert (np.ptp(wall, axis=2) == 0).all()
    assert roof.mean() > wall.mean() > 90
    assert wall[-1].mean() < wall[0].mean() - 20


def test_the_page_shows_pictures_that_are_there() -> None:
    assert (ROOT / "docs" / "street.html").read_text("utf-8") == PAGE
    for name in ("street.jpg", "street-bare.jpg"):
        assert f'src="{name}"' in PAGE
        assert (ROOT / "docs" / name).stat().st_size > 10_000
