"""Projection of building models into the frame of a block, with the outline of each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from catalogs.buildings.settings import SITES
from catalogs.crs import coordinate_transform
from catalogs.features import BuildingModel, BuildingModels, Footprints
from catalogs.reader_errors import fault_reason
from catalogs.readers.settings import LIMITS
from facade_core.core.arrays import Float64Array
from facade_core.core.types import SEMANTICS, BuildingShell

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely import MultiPolygon, Polygon

GROUND = SEMANTICS.index("ground")


def split_off_solids(source: Footprints) -> tuple[Footprints, BuildingModels]:
    """Return the outlines of a source, and its solids as models."""
    solids = tuple(
        BuildingModel(one.id, one.shell, one.height, one.levels, one.name, one.base, one.finish)
        for one in source.items
        if one.shell is not None
    )
    outlines = tuple(one for one in source.items if one.shell is None)
    return replace(source, items=outlines), BuildingModels(source.crs, solids)


def project_models(
    source: BuildingModels, crs: CRS, first_texture: int
) -> Iterator[tuple[BuildingModel, BuildingShell, Polygon | MultiPolygon | str]]:
    """Yield (model, shell in `crs`, outline) of each model.

    The outline of a model that cannot be used is replaced by the reason.

    Parameters
    ----------
    source : models of one source with a CRS.
    crs : frame of the block.
    first_texture : offset of the texture indices.
    """
    assert source.crs is not None, "the block gives a frame to every source"
    to_frame = coordinate_transform(source.crs, crs)
    for model in source.items:
        shell = model.shell
        x, y = to_frame(shell.vertices[:, 0], shell.vertices[:, 1])
        vertices = np.column_stack([x, y, shell.vertices[:, 2]])
        if not np.isfinite(vertices).all():
            yield model, shell, "a corner of it is not a number, or lies outside the block's frame; mend or remove it"
            continue
        texture = np.where(shell.texture >= 0, shell.texture + first_texture, -1).astype(np.int32)
        shell = replace(shell, vertices=vertices, texture=texture)
        if np.ptp(vertices[:, 2]) > LIMITS.max_building_height_m:
            yield model, shell, f"it is over {LIMITS.max_building_height_m:g} m high; check its heights, or remove it"
            continue
        low = float(vertices[:, 2].min())
        if not LIMITS.min_ground_height_m <= low <= LIMITS.max_ground_height_m:
            yield (
                model,
                shell,
                f"it stands at a height of {low:.6g} m; check its heights, buildings.up and buildings.offset, or remove it",
            )
            continue
        try:
            outline = shell_outline(shell)
        except Exception as error:  # an error of GEOS affects this model only
            yield model, shell, fault_reason(error)
            continue
        yield model, shell, outline if not outline.is_empty else "it covers no ground (walls only); give a closed model"


def shell_outline(shell: BuildingShell) -> Polygon | MultiPolygon:
    """Return the plan outline of a shell: its ground surfaces, else all surfaces.

    The outline is empty where all surfaces are vertical.
    """
    corners = shell.vertices[shell.triangles][..., :2]
    edges = corners[:, 1:] - corners[:, :1]
    flat = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]) > 2 * SITES.weld_m
    ground = _union_triangles(corners[flat & (shell.semantic == GROUND)])
    return ground if ground.area > 0 else _union_triangles(corners[flat])


def _union_triangles(triangles: Float64Array) -> Polygon | MultiPolygon:
    covered = shapely.union_all(shapely.polygons(triangles), grid_size=SITES.weld_m)
    closed = covered.buffer(SITES.max_gap_m, join_style="mitre").buffer(-SITES.max_gap_m, join_style="mitre")
    polygons = [part for part in shapely.get_parts(closed) if part.geom_type == "Polygon"]
    return shapely.normalize(shapely.union_all(polygons))
