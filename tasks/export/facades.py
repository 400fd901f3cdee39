"""Facades of a published block as annotated pictures, and the catalogue as a GeoPackage."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.features import safe_file_stem
from facade_core.core.arrays import IntArray
from tasks.engine.progress import begin_stage, report_progress
from tasks.publish.published_run import PublishedBlock

if TYPE_CHECKING:
    from facade_core.export.pictures.annotations import AnnotatedFacade


def write_coco(results: PublishedBlock, buildings: IntArray, folder: Path) -> tuple[list[str], list[str]]:
    """Write annotations.json and images/ID.png: rectified facades without occluders, with their elements.

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
    from facade_core.export.pictures.annotations import coco_document

    (folder / "images").mkdir()
    facades = list(_annotate_facades(results, buildings, folder, "images/"))
    value = coco_document(
        facades, f"Facades of {results.block}, elements of the completed facades", results.attribution
    )
    (folder / "annotations.json").write_text(json.dumps(value, indent=1, allow_nan=False) + "\n")
    return ["annotations.json"], _note_missing(results, buildings, len(facades))


def write_labelme(results: PublishedBlock, buildings: IntArray, folder: Path) -> tuple[list[str], list[str]]:
    """Write ID.png and ID.json for every facade.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.
    folder : target folder.

    Returns
    -------
    files : the ID.json files.
    notes : remarks for the user.
    """
    from facade_core.export.pictures.annotations import labelme_document

    facades = list(_annotate_facades(results, buildings, folder, ""))
    names = [f"{safe_file_stem(facade.facade)}.json" for facade in facades]
    for name, facade in zip(names, facades, strict=True):
        (folder / name).write_text(
            json.dumps(labelme_document(facade, results.attribution), indent=2, allow_nan=False) + "\n"
        )
    return names, _note_missing(results, buildings, len(facades))


def _annotate_facades(
    results: PublishedBlock, buildings: IntArray, folder: Path, within: str
) -> Iterator[AnnotatedFacade]:
    """Write the picture of every finished facade and yield its annotations."""
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    from facade_core.export.pictures.annotations import AnnotatedFacade
    from facade_core.export.pictures.stage_pictures import read_chart_raster

    facades = results.select_finished_facades(buildings)
    said = PngInfo()
    said.add_itxt("Copyright", results.attribution.line)
    begin_stage("export", len(facades))
    for index in facades:
        name = results.plan.facades.id[index]
        chart = int(results.plan.facades.chart[index])
        texture = read_chart_raster(results.group, results.plan.scene.placement, chart, "atlas/seed")
        file = f"{within}{safe_file_stem(name)}.png"
        Image.fromarray(texture).save(folder / file, pnginfo=said)
        metres = 1 / float(results.plan.scene.placement.texels_per_metre[chart])
        yield AnnotatedFacade(name, file, texture.shape[1], texture.shape[0], metres, results.elements(index))
        report_progress("export", 1)


def _note_missing(results: PublishedBlock, buildings: IntArray, written: int) -> list[str]:
    missing = int(np.isin(results.plan.facades.building, buildings).sum()) - written
    if not missing:
        return []
    return [f"{missing} facades without a layout are left out; `streetloom query` says why"]


# Columns of building materials and colours, stated or corrected.
APPEARANCE_COLUMNS = ("wall_material", "wall_colour", "roof_material", "roof_colour")


def write_geopackage(results: PublishedBlock, buildings: IntArray, folder: Path) -> tuple[list[str], list[str]]:
    """Write BLOCK.gpkg with the layers facades, walls, buildings, roofs, ground and streets.

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
    import shapely

    from catalogs.published.geopackage import GeoPackageContent, write_geopackage_layers
    from facade_core.core.grouping import group_rows
    from facade_core.export.bodies.footprints import building_footprints
    from facade_core.geometry.charts import ChartKind
    from tasks.export.city import is_facade

    plan, charts = results.plan, results.plan.scene.charts
    begin_stage("export", 1)
    chart = plan.facades.chart
    across = charts.axis_u[chart] * charts.size[chart, :1]
    down = charts.axis_v[chart] * charts.size[chart, 1:]
    top = charts.origin[chart]
    walls = shapely.polygons(np.stack([top + down, top + down + across, top + across, top], axis=1))
    outlines = building_footprints(results.textured_mesh)
    of_building = group_rows(charts.building[results.textured_mesh.mesh.chart])
    table = results.buildings
    chosen = {results.names[b] for b in buildings.tolist()}
    name = f"{safe_file_stem(results.block)}.gpkg"
    write_geopackage_layers(
        folder / name,
        GeoPackageContent(
            items=results.snapshot.items,
            crs=results.crs,
            walls=dict(zip(plan.facades.id, walls.tolist(), strict=True)),
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
            attribution=results.attribution.tags(),
        ),
    )
    report_progress("export", 1)
    return [name], []


def _height_columns(results: PublishedBlock, triangles: IntArray) -> dict[str, float]:
    """Compute the lowest and highest z of a building, with chimneys and parapets, in the block's heights."""
    from facade_core.export.bodies.map_surfaces import height_range

    low, high = height_range(results.textured_mesh, triangles)
    return {"base_z": round(low, 3), "top_z": round(high, 3)}


def _surfaces(results: PublishedBlock, kind: int, buildings: IntArray) -> list[dict[str, object]]:
    """List surfaces of one kind as rows with outline, heights, slope and area; building -1 is the ground."""
    from facade_core.export.bodies.map_surfaces import chart_world_polygons

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
