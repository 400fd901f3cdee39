"""Cloud Optimized GeoTIFFs of a published block's facades in their wall planes, each with a STAC Item."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import TypedDict, cast

import geopandas as gpd
import numpy as np
import pystac
import rasterio
import shapely
from pandas import Timestamp
from pystac import Item
from rasterio.features import rasterize
from rasterio.transform import Affine
from shapely import LineString

from catalogs.features import safe_file_stem
from catalogs.printable_text import escape_invisible, escape_invisible_json
from catalogs.stac.facts import DataSourceFacts
from catalogs.stac.items import PROJECTION
from catalogs.stac.licences import common_license, license_links, licensors
from facade_core.atlas.rasters import read_chart_raster
from facade_core.core.arrays import IntArray, UInt8Array
from facade_core.core.errors import InputError
from facade_core.export.bodies.wall_plane import PLANE_WKT, WallPlane, wall_outlines, wall_plane
from tasks.engine.progress import begin_stage, report_progress
from tasks.export.orthophoto_index import (
    COLLECTION,
    SHEET,
    SheetPicture,
    add_to_collection,
    write_orthophoto_collection,
    write_row_sheet,
)
from tasks.publish.published_run import PublishedBlock

# Side of a tile of the file, texels; small, because facades are small.
TILE_TEXELS = 256


class _FacadeRow(TypedDict):
    """The columns of the catalogue that are read here.

    Attributes
    ----------
    geometry : foot line in WGS 84.
    """

    id: str
    geometry: LineString | None
    updated: Timestamp


def write_cogs(results: PublishedBlock, buildings: IntArray, folder: Path) -> tuple[list[str], list[str]]:
    """Write ID.tif and its STAC Item ID.json for every facade with surfaces, textured or not, and what lists them.

    facades.vrt shows all side by side; collection.json is their STAC Collection.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.
    folder : target folder.

    Returns
    -------
    files : files to open first.
    notes : remarks for the user.
    """
    facades, source = results.plan.facades, results.textured_mesh
    drawn = set(source.select_charts(buildings).tolist())
    chosen = [i for i in np.flatnonzero(np.isin(facades.building, buildings)).tolist() if facades.chart[i] in drawn]
    rows = _read_facade_rows(results)
    begin_stage("export", len(chosen))
    names: list[str] = []
    items: list[Item] = []
    pictures: list[SheetPicture] = []
    for index in chosen:
        name, chart = facades.id[index], int(facades.chart[index])
        plane = wall_plane(source, chart)
        texels = read_chart_raster(results.group, results.plan.scene.placement, chart, "atlas/colour")
        names.append(f"{safe_file_stem(name)}.tif")
        row = rows[name]
        _write_cog(results, folder / names[-1], texels, plane, chart, name)
        item = _item(results, name, row, plane, texels.shape[:2], names[-1])
        add_to_collection(item, results.block)
        items.append(item)
        pictures.append(SheetPicture(names[-1], (texels.shape[1], texels.shape[0]), plane.texel_size, plane.height))
        text = json.dumps(item.to_dict(include_self_link=False), indent=1, ensure_ascii=False, allow_nan=False)
        (folder / f"{safe_file_stem(name)}.json").write_text(escape_invisible_json(text) + "\n", encoding="utf-8")
        report_progress("export", 1)
    write_orthophoto_collection(folder / COLLECTION, results.block, items, results.attribution)
    if pictures:
        write_row_sheet(folder / SHEET, pictures)
    return names, []


def _read_facade_rows(results: PublishedBlock) -> dict[str, _FacadeRow]:
    """Read the catalogue's rows of facades by id, with foot lines in WGS 84."""
    try:
        rows = gpd.read_parquet(io.BytesIO(results.snapshot.items.read_bytes()))
    except (OSError, ValueError) as error:
        raise InputError(f"{results.snapshot.items}: {results.snapshot.remedy}") from error
    found = cast("list[_FacadeRow]", rows[rows.kind == "facade"].to_dict("records"))
    return {row["id"]: row for row in found}


def _write_cog(
    results: PublishedBlock, path: Path, texels: UInt8Array, plane: WallPlane, chart: int, name: str
) -> None:

    height, width = texels.shape[:2]
    polygons = [
        {"type": "Polygon", "coordinates": [ring.tolist() for ring in rings]}
        for rings in wall_outlines(results.textured_mesh, chart)
    ]
    # a texel that the wall touches counts as its own
    wall = rasterize(polygons, out_shape=(height, width), default_value=255, dtype="uint8", all_touched=True)
    profile: dict[str, object] = {
        "driver": "COG",
        "width": width,
        "height": height,
        "count": 3,
        "dtype": "uint8",
        "crs": PLANE_WKT,
        "transform": Affine(*plane.transform),
        "compress": "DEFLATE",
        "predictor": "YES",
        "blocksize": TILE_TEXELS,
        "num_threads": 1,
    }
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.open(path, "w", **profile) as file:
        file.write(np.moveaxis(texels, -1, 0))
        file.write_mask(wall)
        file.update_tags(
            facade=escape_invisible(name),
            building=escape_invisible(results.names[int(results.plan.scene.charts.building[chart])]),
            world_crs=results.crs,
            **{f"world_{key}": " ".join(map(str, value)) for key, value in plane.pose().items()},
            metres_per_texel=f"{plane.texel_size[0]:.9g}",
            TIFFTAG_COPYRIGHT=results.attribution.line,
            **results.attribution.tags(),
        )


def _item(
    results: PublishedBlock, name: str, row: _FacadeRow, plane: WallPlane, shape: tuple[int, ...], file: str
) -> Item:
    """Build the facade's STAC Item: foot line in WGS 84, raster frame by the projection extension, pose."""
    sources = [DataSourceFacts(one.key, one.name, one.licence) for one in results.attribution.sources]
    line = row["geometry"]
    placed = None if line is None or line.is_empty else line
    item = pystac.Item(
        name,
        shapely.geometry.mapping(placed) if placed is not None else None,
        list(placed.bounds) if placed is not None else None,
        row["updated"].to_pydatetime(),
        {
            "title": f"Orthophoto of the facade {name}",
            "license": common_license(sources),
            "providers": [one.to_dict() for one in licensors(sources)],
            "proj:code": None,
            "proj:wkt2": PLANE_WKT,
            "proj:transform": list(plane.transform),
            "proj:shape": list(shape),
            "streetloom:world": {"crs": results.crs, **plane.pose()},
            "streetloom:attribution": results.attribution.to_json(),
        },
        stac_extensions=[PROJECTION],
    )
    item.links = license_links(sources)
    media = "image/tiff; application=geotiff; profile=cloud-optimized"
    item.assets = {"orthophoto": pystac.Asset(f"./{file}", media_type=media, roles=["data", "visual"])}
    return item
