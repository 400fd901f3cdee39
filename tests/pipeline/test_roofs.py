"""A small block with a picture from above over a part of it and a material for the other roofs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from PIL import Image

from facade_core.atlas.store import open_repository
from facade_core.core.provenance import Provenance
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.overhead_view import texel_points
from facade_core.plan.plan_tables import read_plan
from tasks.publish.task import publish_block
from tests.pipeline.stages import BUILDINGS, EAST, NORTH, texture, write_block

rasterio = pytest.importorskip("rasterio")

PIXEL_M = 0.1
GREEN = (40, 200, 60)
TEXELS_PER_METRE = 6


@pytest.fixture(scope="module")
def above(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], float]:
    """The run's folder, its summary, and how far east the picture reaches; its red tells the metre east from there."""
    folder = tmp_path_factory.mktemp("roofs")
    west, south = EAST + min(box[0] for box in BUILDINGS.values()), NORTH - 20
    reach = EAST + 29  # through the middle of two roofs
    columns, rows = round((reach - west + 20) / PIXEL_M), round(50 / PIXEL_M)
    x = reach - (np.arange(columns)[::-1] + 0.5) * PIXEL_M
    image = np.zeros((3, rows, columns), np.uint8)
    image[0] = np.clip(250 - 4 * np.floor(reach - x), 0, 255)
    place = rasterio.Affine(PIXEL_M, 0, reach - columns * PIXEL_M, 0, -PIXEL_M, south + rows * PIXEL_M)
    options = {"count": 3, "height": rows, "width": columns, "dtype": "uint8", "crs": "EPSG:32635"}
    with rasterio.open(folder / "above.tif", "w", driver="GTiff", transform=place, **options) as raster:
        raster.write(image)
    Image.new("RGB", (64, 64), GREEN).save(folder / "green.png")
    block = write_block(
        folder,
        imagery={"aerial": {"path": "above.tif"}},
        texture={
            "texels_per_metre": TEXELS_PER_METRE,
            "walls": "translate",
            "roof_material": {"path": "green.png", "metres_per_pixel": 0.02},
        },
    )
    out = folder / "out"
    return out, publish_block.fn(texture(block, out).run, block), float(reach)


def test_roofs_hold_the_picture_where_it_reaches(above: tuple[Path, dict[str, Any], float]) -> None:
    out, summary, reach = above
    assert summary["facades_failed"] == 0
    session = open_repository(out / "store").readonly_session("main")
    group = zarr.open_group(session.store, mode="r")
    plan = read_plan(session)
    scene, placement = plan.scene, plan.scene.placement
    photographed = bare = 0
    for chart in np.flatnonzero(scene.charts.kind == ChartKind.ROOF).tolist():
        height, width = placement.shape(chart)
        y, x = int(placement.y[chart]), int(placement.x[chart])
        at = (int(placement.page[chart]), slice(y, y + height), slice(x, x + width))
        colour, provenance = group["atlas/colour"][at], group["atlas/provenance"][at]
        points = texel_points(scene, chart, np.arange(height) + 0.5, np.arange(width) + 0.5)
        known = provenance == Provenance.PHOTO
        assert (points[..., 0][known] < reach).all()
        # a texel takes the mean of its own width of the picture
        expected = 250 - 4 * np.floor(reach - points[..., 0])
        assert np.abs(colour[known][:, 0] - np.clip(expected, 0, 255)[known]).max(initial=0) <= 4
        assert (colour[known][:, 1:] == 0).all()
        photographed, bare = photographed + known.sum(), bare + (provenance <= Provenance.TRANSLATED).sum()
    assert photographed > 500
    assert bare > 500


def test_the_others_take_the_material(above: tuple[Path, dict[str, Any], float]) -> None:
    out, _, reach = above
    session = open_repository(out / "store").readonly_session("main")
    group = zarr.open_group(session.store, mode="r")
    plan = read_plan(session)
    scene, placement = plan.scene, plan.scene.placement
    pages = sorted((out / "published" / (out / "current").read_text().strip() / "pages").iterdir())
    checked = 0
    for chart in np.flatnonzero(scene.charts.kind == ChartKind.ROOF).tolist():
        height, width = placement.shape(chart)
        y, x, page = int(placement.y[chart]), int(placement.x[chart]), int(placement.page[chart])
        box = (slice(y, y + height), slice(x, x + width))
        points = texel_points(scene, chart, np.arange(height) + 0.5, np.arange(width) + 0.5)
        # so far from the picture's edge nothing is levelled to it
        bare = (group["atlas/provenance"][(page, *box)] <= Provenance.TRANSLATED) & (points[..., 0] > reach + 10)
        red, green, blue = np.asarray(Image.open(pages[page]))[box][bare].astype(int).T
        assert (green > 2 * red).all()
        assert (green > 2 * blue).all()
        checked += int(bare.sum())
    assert checked > 500
