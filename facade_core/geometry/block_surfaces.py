"""Construction of a block's charts and mesh: extruded footprints, roofs, modelled shells and ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from facade_core.core.arrays import Float64Array
from facade_core.core.errors import GeometryError
from facade_core.core.types import Building, Street
from facade_core.geometry.buildings.chimneys import build_chimneys
from facade_core.geometry.buildings.closing import concatenate_facets, missing_walls
from facade_core.geometry.buildings.dormers import build_dormers
from facade_core.geometry.buildings.eaves import build_overhang, build_parapet
from facade_core.geometry.buildings.extrusion import Extrusion, add_extrusion_charts, facets_entirely_above
from facade_core.geometry.buildings.facets import Facets, extract_shell_facets, line_share_with_walls
from facade_core.geometry.buildings.gutters import build_gutters
from facade_core.geometry.buildings.neighbours import (
    neighbour_area_above_eaves,
    outline_without_party_walls,
    roof_continuation_footprints,
    unify_building_part_bases,
)
from facade_core.geometry.buildings.passages import passage_openings, standing_outline
from facade_core.geometry.buildings.roof_details import RoofDetail
from facade_core.geometry.buildings.roof_edges import OPEN_SURROUNDINGS, RoofSurroundings, sample_streets
from facade_core.geometry.buildings.roof_shapes import build_shell_with_roof
from facade_core.geometry.buildings.settings import EAVES, ROOF_EDGES, ROOF_SHAPES
from facade_core.geometry.buildings.shells import add_facet_charts, add_skirt_charts, lift_to_ground, lower_to_ground
from facade_core.geometry.buildings.vents import build_flat_roof_vents, build_vents
from facade_core.geometry.charts import ChartBuilder, Charts, Mesh, SurfaceTarget
from facade_core.geometry.ground.ground_charts import add_ground_charts
from facade_core.geometry.ground.terrain import Terrain
from facade_core.geometry.growth import grow_union
from facade_core.geometry.settings import BLOCK_SURFACES


def build_block_surfaces(
    buildings: Sequence[Building],
    streets: Sequence[Street],
    *,
    terrain: Terrain,
    ground_margin: float,
    largest: float,
    grid: float = 32.0,
    within: Polygon | None = None,
) -> tuple[Charts, Mesh, tuple[tuple[str, str], ...]]:
    """Build the charts and the mesh of a block.

    Surfaces longer than `largest`, and all ground, are cut on the world grid, uneven ground finer; pieces keep the id
    of their surface. Ground covers courtyards too. It ends straight where a street ends, and `forecourt_m` beyond
    `within`.

    Parameters
    ----------
    terrain : ground heights below the block.
    ground_margin : metres of ground on both sides of the centrelines.
    largest : metres; longer surfaces are cut.
    grid : step of the world grid in metres.
    within : outline of the block; None where unknown.

    Returns
    -------
    Charts, mesh, and the buildings without usable surfaces as (id, reason).

    Raises
    ------
    GeometryError Where the block has neither buildings nor ground.
    """
    pieces = ChartBuilder()
    refused, outlines = [], []
    buildings = unify_building_part_bases(buildings, terrain)
    tree = shapely.STRtree([building.footprint for building in buildings])
    # sight lines are tested against an index of the edges
    shapely.prepare(tree.geometries[shapely.get_num_coordinates(tree.geometries) > BLOCK_SURFACES.min_prepared_corners])
    eyes = sample_streets([street.line for street in streets])
    eye_tree = shapely.STRtree(shapely.points(eyes))
    for index, building in enumerate(buildings):
        try:
            adjoining = roof_continuation_footprints(index, buildings, tree)
            # of streets out of reach one is left, because without any every edge counts as in sight
            reached = np.sort(
                eye_tree.query(
                    building.footprint,
                    predicate="dwithin",
                    distance=ROOF_EDGES.max_sight_m + BLOCK_SURFACES.sight_margin_m,
                )
            )
            in_reach = eyes[reached] if len(reached) else eyes[:1]
            obstacles = neighbour_area_above_eaves(index, buildings, tree, terrain)
            surroundings = RoofSurroundings(obstacles, in_reach, tree)
            target = SurfaceTarget(pieces, index, largest, grid)
            outline, found = add_building_charts(target, building, terrain, adjoining, surroundings)
        except GeometryError as error:
            refused.append((building.id, str(error)))
            continue
        if building.raised == 0 and (
            found is None
            or line_share_with_walls(found, outline_without_party_walls(index, buildings, tree))
            >= BLOCK_SURFACES.min_walled_share
        ):
            outlines.append(outline)
    if streets:
        near = [street.line.buffer(ground_margin, cap_style="square", join_style="mitre") for street in streets]
        built = shapely.union_all(outlines)
        # closing the footprints covers courtyards and gaps far from streets
        near_buildings = grow_union(built, outlines, BLOCK_SURFACES.courtyard_m).buffer(
            BLOCK_SURFACES.forecourt_m - BLOCK_SURFACES.courtyard_m
        )
        open_ground = shapely.union_all([*near, near_buildings]).difference(built)
        if within is not None:
            end = shapely.union_all([within, shapely.union_all(outlines)]).buffer(
                BLOCK_SURFACES.forecourt_m, join_style="mitre"
            )
            open_ground = open_ground.intersection(end)
        parts = sorted(shapely.get_parts(open_ground), key=lambda p: p.bounds)
        add_ground_charts(pieces, [p for p in parts if p.geom_type == "Polygon" and p.area > 0.01], terrain, grid)
    if not len(pieces):
        why = f": {refused[0][0]}: {refused[0][1]}" if refused else "; check its area and input files"
        raise GeometryError(f"the block has neither buildings nor streets{why}")
    return *pieces.build(), tuple(refused)


def add_building_charts(
    target: SurfaceTarget,
    building: Building,
    terrain: Terrain,
    adjoining: Sequence[Polygon | MultiPolygon] = (),
    surroundings: RoofSurroundings = OPEN_SURROUNDINGS,
) -> tuple[Polygon | MultiPolygon, Facets | None]:
    """Add the charts and triangles of one building to a chart builder.

    Parameters
    ----------
    target : place of the surfaces.
    adjoining : footprints that its roof continues over.
    surroundings : surroundings of its roof edges.

    Returns
    -------
    The covered ground, and the facets of a modelled shell; None of an extruded building.

    Raises
    ------
    GeometryError
        Where the building has no usable surface.
    """
    outline = _valid_outline(building)
    building = lower_to_ground(building, outline, terrain)
    if building.shell is not None:
        shell = lift_to_ground(building.shell, terrain.lowest_along(outline))
    else:
        if not (np.isfinite(building.height) and building.height > building.raised):
            above_what = "where it begins" if building.raised else "0"
            raise GeometryError(f"its height is not above {above_what}; state one or drop it")
        base = terrain.lowest_along(outline) if building.base is None else building.base
        onto_grid = shapely.transform(outline, lambda xy: np.round(xy / ROOF_SHAPES.grid_m) * ROOF_SHAPES.grid_m)
        roof_shell = (
            build_shell_with_roof(replace(building, footprint=onto_grid), base, adjoining)
            if onto_grid.is_valid
            else None
        )
        details: list[RoofDetail | None] = []
        assumed = building.roof is not None and building.roof.confidence < 1
        top = base + building.height
        if roof_shell is None:
            if (
                building.roof is not None
                and building.roof.shape == "flat"
                and building.height > EAVES.min_parapet_roof_m
            ):
                details.append(build_parapet(outline, top, surroundings))
                if assumed:
                    details.append(build_flat_roof_vents(building.id, outline, top, surroundings, building.height))
            openings = passage_openings(building, outline, base, terrain)
            add_extrusion_charts(target, Extrusion(outline, base, building.height, building.raised, openings), terrain)
        else:
            closed = facets_entirely_above(extract_shell_facets(roof_shell, outline), top)
            over = build_overhang(closed, onto_grid, surroundings)
            roof = over.roof
            openings = passage_openings(building, onto_grid, base, terrain)
            walls = Extrusion(onto_grid, base, building.height, building.raised, openings)
            add_extrusion_charts(target, walls, terrain, roof)
            details += [
                over.coves,
                build_gutters(building.id, over, lambda xy: _wall_foot(terrain, base, building.raised, xy)),
            ]
            if assumed:
                stacks = build_chimneys(building.id, closed, onto_grid)
                lights = build_dormers(building.id, closed, onto_grid, surroundings, stacks)
                cowls = build_vents(building.id, closed, onto_grid, surroundings, building.height, [stacks, lights])
                details += [stacks, lights, cowls]
        for trim in details:
            if trim is not None:
                add_facet_charts(target, trim.facets, trim.along)
        return standing_outline(outline, openings), None
    found = extract_shell_facets(shell, outline)
    if len(found) == 0:
        raise GeometryError("its model has no surface; repair or drop it")
    if (missing := missing_walls(found)) is not None:
        found = concatenate_facets(found, missing)
    add_facet_charts(target, found)
    add_skirt_charts(target, found, outline, terrain)
    return outline, found


def _wall_foot(terrain: Terrain, base: float, raised: float, place: Float64Array) -> float:
    """Return the height in metres at which walls begin at a place (2,)."""
    return base + raised if raised else max(base, float(terrain.interpolate(place[None])[0]))


def _valid_outline(building: Building) -> Polygon | MultiPolygon:
    """Return the simplified outline of a building; only a shell may have several parts."""
    footprint = shapely.orient_polygons(building.footprint.simplify(BLOCK_SURFACES.collinear_tolerance_m))
    kinds = ("Polygon",) if building.shell is None else ("Polygon", "MultiPolygon")
    if footprint.geom_type not in kinds or not footprint.area > 0:
        raise GeometryError("its footprint has no area; repair or drop it")
    if not footprint.is_valid:
        raise GeometryError("its footprint crosses itself; repair or drop it")
    return footprint
