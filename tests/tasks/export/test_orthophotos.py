"""Orthophotos: what GDAL reads of them is the wall, where the wall is."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pystac
import pytest
import rasterio

from catalogs.features import safe_file_stem
from facade_core.atlas.rasters import read_chart_raster
from tasks.export.formats import export_run
from tasks.publish.published_run import PublishedBlock

Run = tuple[Path, dict[str, Any]]


@pytest.fixture(scope="module")
def folder(undisturbed: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Path(str(export_run(undisturbed[0], "cog", tmp_path_factory.mktemp("export") / "cog").path))


def test_every_facade_is_a_picture_of_its_texels_without_loss(found: PublishedBlock, folder: Path) -> None:
    facades, placement = found.plan.facades, found.plan.scene.placement
    assert {file.stem for file in folder.glob("*.tif")} == {safe_file_stem(name) for name in facades.id}
    for name, chart in zip(facades.id, facades.chart.tolist(), strict=True):
        with rasterio.open(folder / f"{safe_file_stem(name)}.tif") as image:
            texels = np.moveaxis(image.read(), 0, -1)
            assert (texels == read_chart_raster(found.group, placement, chart, "atlas/colour")).all()
            assert (image.dataset_mask() > 0).mean() > 0.4


def test_a_texel_is_where_its_tags_say(found: PublishedBlock, folder: Path) -> None:
    """From column and row by GDAL's transform and the pose to the world, and from there by the atlas to the texel again."""
    scene = found.plan.scene
    for name, chart in zip(found.plan.facades.id, found.plan.facades.chart.tolist(), strict=True):
        with rasterio.open(folder / f"{safe_file_stem(name)}.tif") as image:
            tags, transform = image.tags(), image.transform
            assert 'UNIT["metre",1' in image.crs.to_wkt()
            assert not image.crs.is_geographic
            assert not image.crs.is_projected
            rows, columns = np.nonzero(image.dataset_mask())
            assert image.bounds.left == 0
            assert image.bounds.top == pytest.approx(scene.charts.size[chart, 1])
        assert tags["world_crs"] == found.crs
        origin, along, up, outward = (
            np.array(tags[f"world_{k}"].split(), float) for k in ("origin", "along", "up", "outward")
        )
        x = transform.c + transform.a * (columns + 0.5)
        y = transform.f + transform.e * (rows + 0.5)
        world = origin + np.outer(x, along) + np.outer(y, up)
        row, column = scene.locate_texels(world, np.full(len(world), chart))
        assert (np.abs(row - rows).max(), np.abs(column - columns).max()) <= (1, 1)
        assert np.dot(np.cross(along, up), outward) == pytest.approx(1, abs=1e-5), "x to the right as seen from outside"
        assert abs(up[2]) > 0.99
        mine = scene.mesh.vertices[scene.mesh.triangles[scene.mesh.chart_triangles(chart)].ravel()]
        assert (mine - origin) @ outward == pytest.approx(0, abs=0.02)
        assert ((mine - origin) @ up).min() > -0.02


def test_each_is_a_cloud_optimised_geotiff(folder: Path) -> None:
    files = sorted(folder.glob("*.tif"))
    large = 0
    for file in files:
        with rasterio.open(file) as image:
            assert image.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
            if max(image.shape) > 512:
                large += 1
                assert image.is_tiled
                assert image.overviews(1)
    validator = pytest.importorskip("rio_cogeo.cogeo", reason="rio-cogeo is not there: its validator does not look")
    for file in files:
        valid, errors, warnings = validator.cog_validate(file, strict=True)
        assert valid, (file.name, errors, warnings)


def test_items_are_stac(folder: Path) -> None:
    collection = pystac.Collection.from_file(folder / "collection.json")
    assert {item.id for item in collection.get_items()} == {file.stem for file in folder.glob("*.tif")}
    for file in folder.glob("*.tif"):
        value = json.loads(file.with_suffix(".json").read_text())
        item = pystac.Item.from_dict(value)
        with rasterio.open(file) as image:
            assert value["properties"]["proj:shape"] == list(image.shape)
            assert value["properties"]["proj:transform"] == pytest.approx(list(image.transform)[:6])
        assert item.assets["orthophoto"].href == f"./{file.name}"
        assert item.geometry is None or item.geometry["type"] in ("LineString", "MultiLineString")
