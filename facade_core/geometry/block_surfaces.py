"""Buildings and ground into planar charts and a mesh: extruded footprints, roofs, shells and the terrain around them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from facade_core.core.errors import GeometryError
from facade_core.core.types import Building, Street
from facade_core.geometry.buildings.chimneys import chimneys
from facade_core.geometry.buildings.dormers import dormers
from facade_core.geometry.buildings.eaves import LOW_ROOF_M, overhang, parapet
from facade_core.geometry.buildings.extrusion import above, add_extruded
from facade_core.geometry.buildings.facets import Facets, facets, walled
from facade_core.geometry.buildings.gutters import gutters
from facade_core.geometry.buildings.roof_details import Trim
from facade_core.geometry.buildings.roof_edges import OPEN, Around, along_streets
from facade_core.geometry.buildings.roof_shapes import GRID_M, roof_shell
from facade_core.geometry.buildings.shells import add_facets, add_skirt, from_the_ground
from facade_core.geometry.buildings.vents import vents, vents_on_flat
from facade_core.geometry.charts import Charts, Mesh, Pieces
from facade_core.geometry.ground.ground_charts import add_ground
from facade_core.geometry.ground.terrain import Terrain
from facade_core.geometry.neighbours import beside, free_line, in_the_way, on_one_ground

# Footprint vertices nearer than this to the wall they lie on do not split it into two facades.
COLLINEAR_M = 0.2
# Ground reaches this far around buildings, and fills gaps between them up to twice the second figure.
FORECOURT_M = 6.0
COURTYARD_M = 22.0
# A shell with walls along less of its free outline is a canopy: the ground goes on under it, as under what begins above it.
WALLED = 0.6


def block_surfaces(
    buildings: Sequence[Building],
    streets: Sequence[Street],
    *,
    terrain: Terrain,
    ground_margin: float,
    largest: float,
    grid: float = 32.0,
    within: Polygon | None = None,
) -> tuple[Charts, Mesh, tuple[tuple[str, str], ...]]:
    """Charts and mesh of a block: the surfaces of every building, and the ground near the streets on the terrain.

    Third, the buildings without usable surfaces, which are left out: (id, reason).

    Surfaces longer than `max_chart_side` metres, and all ground, are cut on the world grid of `grid` metres (ground finer where it is
    uneven); pieces keep their surface's id. Ground reaches `ground_margin` metres from the centrelines, and fills
    courtyards; it ends straight where a street ends, and FORECOURT_M beyond `within`, where a block has one.
    Raises GeometryError when nothing is left.
    """
    pieces = Pieces()
    refused, outlines = [], []
    buildings = on_one_ground(buildings, terrain)
    tree = shapely.STRtree([building.footprint for building in buildings])
    eyes = along_streets([street.line for street in streets])
    for index, building in enumerate(buildings):
        try:
            party = beside(index, buildings, tree)
            around = Around(in_the_way(index, buildings, tree, terrain), eyes, tree)
            outline, found = add_building(pieces, index, building, terrain, party, around, largest=largest, grid=grid)
        except GeometryError as error:
            refused.append((building.id, str(error)))
            continue
        if building.raised == 0 and (found is None or walled(found, free_line(index, buildings, tree)) >= WALLED):
            outlines.append(outline)
    if streets:
        near = [street.line.buffer(ground_margin, cap_style="square", join_style="mitre") for street in streets]
        built = shapely.union_all(outlines)
        # closing the footprints covers courtyards and gaps that no street comes near
        around = built.buffer(COURTYARD_M).buffer(FORECOURT_M - COURTYARD_M)
        open_ground = shapely.union_all([*near, around]).difference(built)
        if within is not None:
            end = shapely.union_all([within, shapely.union_all(outlines)]).buffer(FORECOURT_M, join_style="mitre")
            open_ground = open_ground.intersection(end)
        parts = sorted(shapely.get_parts(open_ground), key=lambda p: p.bounds)
        add_ground(pieces, [p for p in parts if p.geom_type == "Polygon" and p.area > 0.01], terrain, grid)
    if not len(pieces):
        why = f": {refused[0][0]}: {refused[0][1]}" if refused else "; check its area and input files"
        raise GeometryError(f"the block has neither buildings nor streets{why}")
    return *pieces.values(), tuple(refused)


def add_building(
    pieces: Pieces,
    index: int,
    building: Building,
    terrain: Terrain,
    party: Sequence[Polygon | MultiPolygon] = (),
    around: Around = OPEN,
    *,
    largest: float,
    grid: float = 32.0,
) -> tuple[Polygon | MultiPolygon, Facets | None]:
    """The surfaces of one building behind those in `pieces`. Raises GeometryError where it has none.

    party: the footprints that its roof runs on over; around: what its roof's edge has about it. Returns what it covers, and a
    shell's facets, None of what is built here.
    """
    outline = _outline(building)
    if building.shell is not None:
        shell = from_the_ground(building.shell, terrain.lowest(outline))
    else:
        if not (np.isfinite(building.height) and building.height > building.raised):
            above_what = "where it begins" if building.raised else "0"
            raise GeometryError(f"its height is not above {above_what}; state one or drop it")
        base = terrain.lowest(outline) if building.base is None else building.base
        onto_grid = shapely.transform(outline, lambda xy: np.round(xy / GRID_M) * GRID_M)
        roofed = roof_shell(replace(building, footprint=onto_grid), base, party) if onto_grid.is_valid else None
        beside: list[Trim | None] = []
        assumed = building.roof is not None and building.roof.confidence < 1
        top = base + building.height
        if roofed is None:
            if building.roof is not None and building.roof.shape == "flat" and building.height > LOW_ROOF_M:
                beside.append(parapet(outline, top, around))
                if assumed:
                    beside.append(vents_on_flat(building.id, outline, top, around, building.height))
            add_extruded(pieces, index, outline, base, building.height, terrain, largest, grid, raised=building.raised)
        else:
            closed = above(facets(roofed, outline), top)
            over = overhang(closed, onto_grid, around)
            roof = over.roof
            add_extruded(pieces, index, onto_grid, base, building.height, terrain, largest, grid, roof, building.raised)
            beside += [over.coves, gutters(building.id, over, lambda xy: _foot(terrain, base, building.raised, xy))]
            if assumed:
                stacks = chimneys(building.id, closed, onto_grid)
                lights = dormers(building.id, closed, onto_grid, around, stacks)
                cowls = vents(building.id, closed, onto_grid, around, building.height, [stacks, lights])
                beside += [stacks, lights, cowls]
        for trim in beside:
            if trim is not None:
                add_facets(pieces, index, trim.facets, largest, grid, trim.along)
        return outline, None
    found = facets(shell, outline)
    if len(found) == 0:
        raise GeometryError("its model has no surface; repair or drop it")
    add_facets(pieces, index, found, largest, grid)
    add_skirt(pieces, index, found, outline, terrain, largest, grid)
    return outline, found


def _foot(terrain: Terrain, base: float, raised: float, place: np.ndarray) -> float:
    """Where the walls of a building begin at a place (2,), metres: on the ground, or where it is raised over that."""
    return base + raised if raised else max(base, float(terrain.height(place[None])[0]))


def _outline(building: Building) -> Polygon | MultiPolygon:
    """What a building covers; only a shell may be in several parts."""
    footprint = shapely.orient_polygons(building.footprint.simplify(COLLINEAR_M))
    kinds = ("Polygon",) if building.shell is None else ("Polygon", "MultiPolygon")
    if footprint.geom_type not in kinds or not footprint.area > 0:
        raise GeometryError("its footprint has no area; repair or drop it")
    if not footprint.is_valid:
        raise GeometryError("its footprint crosses itself; repair or drop it")
    return footprint
