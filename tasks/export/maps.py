"""Map of a published block: the catalogue and the outlines of its surfaces as GeoPackage or GeoParquet."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import geopandas as gpd
import numpy as np
import pandas as pd
import shapely

from catalogs.features import safe_file_stem
from catalogs.published import geoparquet
from catalogs.published.geopackage import GeoPackageWriter
from catalogs.published.map_layers import MapContent, build_map_layers
from facade_core.core.arrays import IntArray
from facade_core.core.grouping import group_rows
from facade_core.export.bodies.footprints import building_footprints
from facade_core.export.bodies.map_surfaces import chart_world_polygons, height_range
from facade_core.geometry.charts import ChartKind
from tasks.engine.progress import begin_stage, report_progress
from tasks.export.city_objects import is_facade
from tasks.publish.published_run import PublishedBlock

# Columns of building materials and colours, stated or corrected.
APPEARANCE_COLUMNS = ("wall_material", "wall_colour", "roof_material", "roof_colour")


def write_geopackage(results: PublishedBlock, buildings: IntArray, folder: Path) -> tuple[list[str], list[str]]:
    """Write BLOCK.gpkg with the layers of `map_layers` and QGIS styles.

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
    begin_stage("export", 1)
    layers, updated = map_layers(results, buildings)
    name = f"{safe_file_stem(results.block)}.gpkg"
    writer = GeoPackageWriter(folder / name, results.attribution.tags(), updated)
    for layer, rows in layers.items():
        writer.append_layer(layer, rows)
    writer.write_styles()
    report_progress("export", 1)
    return [name], []


def write_geoparquet(results: PublishedBlock, buildings: IntArray, folder: Path) -> tuple[list[str], list[str]]:
    """Write LAYER.parquet for each layer of `map_layers`.

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
    begin_stage("export", 1)
    layers, _ = map_layers(results, buildings)
    for layer, rows in layers.items():
        encoded = [geoparquet.encode_layer(rows)]
        geoparquet.write_geoparquet(folder / f"{layer}.parquet", encoded, results.attribution.tags())
    report_progress("export", 1)
    return [f"{layer}.parquet" for layer in layers], []


def map_layers(
    results: PublishedBlock, buildings: IntArray
) -> tuple[dict[str, gpd.GeoDataFrame | pd.DataFrame], datetime | None]:
    """Build the layers facades, buildings, roofs, ground, streets and set_aside of some buildings.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.

    Returns
    -------
    layers : tables by name.
    updated : time of the newest row of the catalogue; None without rows.
    """
    plan, charts = results.plan, results.plan.scene.charts
    chart = plan.facades.chart
    across = charts.axis_u[chart] * charts.size[chart, :1]
    down = charts.axis_v[chart] * charts.size[chart, 1:]
    top = charts.origin[chart]
    feet = np.stack([top + down, top + down + across], axis=1)
    z = np.concatenate([feet, feet - down[:, None]], axis=1)[..., 2].round(3)
    outlines = building_footprints(results.textured_mesh)
    of_building = group_rows(charts.building[results.textured_mesh.mesh.chart])
    table = results.buildings
    chosen = {results.names[b] for b in buildings.tolist()}
    return build_map_layers(
        MapContent(
            items=results.snapshot.items,
            crs=results.crs,
            walls={
                facade: {"low_z": low, "high_z": high, "geometry": foot}
                for facade, low, high, foot in zip(
                    plan.facades.id, z.min(1).tolist(), z.max(1).tolist(), shapely.linestrings(feet), strict=True
                )
            },
            buildings=[
                {
                    "id": name,
                    "name": table["name"][b] or None,
                    "height_m": float(table["height"][b]),
                    **_height_columns(results, of_building[b]),
                    "height_source": table["height_source"][b],
                    "levels": int(table["levels"][b]) or None,
                    "roof_shape": table["roof_shape"][b] or None if "roof_shape" in table else None,
                    "roof_height_m": float(table["roof_height"][b]) if "roof_height" in table else None,
                    "roof_confidence": float(table["roof_confidence"][b]) if "roof_confidence" in table else None,
                    **{what: table[what][b] or None for what in APPEARANCE_COLUMNS if what in table},
                    "geometry": outlines[b],
                }
                for b, name in results.names.items()
                if name in chosen and b in outlines
            ],
            roofs=_surfaces(results, ChartKind.ROOF, buildings),
            ground=_surfaces(results, ChartKind.GROUND, np.array([-1])),
            streets=[{"id": s.id, "name": s.name, "geometry": s.line} for s in plan.streets],
            chosen=chosen,
            no_facades=[facade for facade in plan.facades.id if not is_facade(results, facade)],
        )
    )


def _height_columns(results: PublishedBlock, triangles: IntArray) -> dict[str, float]:
    """Compute the lowest and highest z of a building, with chimneys and parapets, in the block's heights."""
    low, high = height_range(results.textured_mesh, triangles)
    return {"base_z": round(low, 3), "top_z": round(high, 3)}


def _surfaces(results: PublishedBlock, kind: int, buildings: IntArray) -> list[dict[str, object]]:
    """List surfaces of one kind as rows with outline, heights, slope and area; building -1 is the ground."""
    source = results.textured_mesh
    charts = source.select_charts(buildings)
    charts = charts[source.charts.kind[charts] == kind]
    normal = source.charts.normals()
    rows = []
    for chart, polygon in chart_world_polygons(source, charts).items():
        z = [corner[2] for part in polygon.geoms for corner in part.exterior.coords]
        building = int(source.charts.building[chart])
        rows.append(
            {
                **({"building": results.names[building]} if building >= 0 else {}),
                "low_z": round(float(min(z)), 3),
                "high_z": round(float(max(z)), 3),
                "slope_deg": round(float(np.degrees(np.arccos(np.clip(normal[chart, 2], -1, 1)))), 2),
                "area_m2": round(polygon.area / max(abs(float(normal[chart, 2])), 1e-3), 2),
                "geometry": polygon,
            }
        )
    return rows
