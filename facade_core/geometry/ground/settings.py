"""Settings of the ground: tuned numbers, one class per step."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CarriagewaySettings:
    """Carriageways and yards between buildings.

    Attributes
    ----------
    assumed_road_m, assumed_pavement_m : widths in metres of a street with a known line only.
    building_clearance_m, min_carriageway_m : metres between a carriageway and the buildings along it.
    max_pavement_m : metres from the kerb to the farthest building that a pavement reaches.
    building_search_m : metres from a way within which buildings are searched.
    gap_sampling_m : metres between the places where the gap along a way is measured.
    max_yard_gap_m, min_yard_m2 : a yard is ground between buildings no farther apart than this, of at least this
        area.
    """

    assumed_road_m: float = 7.0
    assumed_pavement_m: float = 5.0
    building_clearance_m: float = 1.4
    min_carriageway_m: float = 2.6
    max_pavement_m: float = 9.0
    building_search_m: float = 30.0
    gap_sampling_m: float = 4.0
    max_yard_gap_m: float = 24.0
    min_yard_m2: float = 12.0


CARRIAGEWAYS = CarriagewaySettings()


@dataclass(frozen=True, slots=True)
class GroundChartSettings:
    """Charts of the ground.

    Attributes
    ----------
    max_off_plane_m : metres between the terrain and the plane of a ground piece above which the piece is cut finer.
    grid_divisors : divisors of the grid, coarse to fine.
    """

    max_off_plane_m: float = 0.1
    grid_divisors: tuple[int, int, int] = (1, 2, 4)


GROUND_CHARTS = GroundChartSettings()


@dataclass(frozen=True, slots=True)
class LayerSettings:
    """Layers of the ground.

    Attributes
    ----------
    kerb_radius_m, junction_reach_m : radius of a kerb round a corner, and its reach from the junction; metres.
    max_slit_m : narrower slits between two parts of a shape are closed; metres.
    """

    kerb_radius_m: float = 5.0
    junction_reach_m: float = 14.0
    max_slit_m: float = 0.02


LAYERS = LayerSettings()


@dataclass(frozen=True, slots=True)
class MarkSettings:
    """Markings and covers on carriageways.

    Attributes
    ----------
    dash_m, dash_period_m, line_half_width_m : length of a lane's dash, and metres from one dash to the next.
    bar_period_m, bar_half_size_m : metres from one bar of a crossing to the next, and half of a bar's width and
        length.
    parking_place_m, stair_period_m : length of a parking place, and metres from one step of stairs to the next.
    edge_line_offset_m : metres from the kerb to an edge line.
    min_edged_rank, min_bare_edged_rank, stop_line_half_width_m : lowest rank of roads with edge lines, with and
        without a pavement.
    stop_distance_m, stop_kerb_gap_m : metres from a stop line to the middle of the crossing or to the other
        carriageway, and to the kerb.
    min_stop_rank : lowest rank of roads with stop lines before crossings, where lanes are unmarked.
    stop_at_end_share : share of lesser roads with a stop line at their end.
    junction_clearance_m : metres from junctions and crossings to other markings.
    cover_spacing_m, patch_spacing_m, gully_spacing_m : average metres from one manhole cover, patch or gully to the
        next.
    """

    dash_m: float = 3.0
    dash_period_m: float = 9.0
    line_half_width_m: float = 0.06
    bar_period_m: float = 1.0
    bar_half_size_m: tuple[float, float] = (0.25, 1.6)
    parking_place_m: float = 6.0
    stair_period_m: float = 0.35
    edge_line_offset_m: float = 0.55
    min_edged_rank: int = 6
    min_bare_edged_rank: int = 4
    stop_line_half_width_m: float = 0.15
    stop_distance_m: float = 2.9
    stop_kerb_gap_m: float = 0.4
    min_stop_rank: int = 5
    stop_at_end_share: float = 0.4
    junction_clearance_m: float = 10.0
    cover_spacing_m: float = 38.0
    patch_spacing_m: float = 26.0
    gully_spacing_m: float = 24.0


MARKS = MarkSettings()


@dataclass(frozen=True, slots=True)
class ShapeSettings:
    """Tiles of the shapes of the ground.

    Attributes
    ----------
    ground_tile_m : side of a tile, equal to the grid on which ground is cut into charts; metres.
    ground_tile_margin_m : metres around a tile whose ways and areas are drawn with it.
    max_cached_tiles : tiles in memory.
    """

    ground_tile_m: float = 32.0
    ground_tile_margin_m: float = 32.0
    max_cached_tiles: int = 512


SHAPES = ShapeSettings()


@dataclass(frozen=True, slots=True)
class GapSettings:
    """Lines through gaps between buildings.

    Attributes
    ----------
    origin_grid_m : grid step of the local origin in metres.
    min_gap_m : metres; no camera travels through a narrower gap.
    min_square_m2 : square metres of enclosed ground: a smaller one is a yard, a larger one a square with built-over
        entrances.
    min_clearance_m : metres from a street to the nearest building.
    sampling_m : metres between the outline points of the Voronoi diagram.
    tile_m : side in metres of the tiles that bound the memory for a city.
    min_spur_ratio : a blind branch shorter than this many clearances of its junction leads into a corner.
    min_wedge_gain : gain of clearance per metre from the tip of a blind branch that marks a corner: 47 degrees
        between its walls.
    blurs_m : gaussian sigmas in metres; a street is smoothed by the first that keeps it clear of walls.
    simplification_m : tolerance of simplified lines in metres.
    min_length_m : metres; shorter lines are remains of junctions.
    """

    origin_grid_m: float = 1000.0
    min_gap_m: float = 2.5
    min_square_m2: float = 10_000.0
    min_clearance_m: float = 1.0
    sampling_m: float = 1.0
    tile_m: float = 500.0
    min_spur_ratio: float = 1.5
    min_wedge_gain: float = 0.4
    blurs_m: tuple[float, float] = (3.0, 1.0)
    simplification_m: float = 0.1
    min_length_m: float = 5.0


GAPS = GapSettings()


@dataclass(frozen=True, slots=True)
class TerrainSettings:
    """Raster of the terrain.

    Attributes
    ----------
    min_raster_step_m, max_raster_cells, raster_margin_m : raster from the buildings' bases: finest step in metres,
        greatest number of cells, margin around the buildings in metres.
    local_origin_grid_m : grid step of the local origin in metres.
    smooth_m : sigma of the smoothing of the raster in metres.
    outlier_neighbours, min_outlier_m, min_outlier_spreads : a base is an outlier when it is this far in metres, and
        this many median deviations, from the median of its neighbours.
    outline_sampling_m : metres between samples of the ground along an outline.
    """

    min_raster_step_m: float = 2.0
    max_raster_cells: int = 1_000_000
    raster_margin_m: float = 40.0
    local_origin_grid_m: float = 1000.0
    smooth_m: float = 5.0
    outlier_neighbours: int = 8
    min_outlier_m: float = 2.0
    min_outlier_spreads: float = 4.0
    outline_sampling_m: float = 2.0


TERRAIN = TerrainSettings()


@dataclass(frozen=True, slots=True)
class ObjectSettings:
    """Placement of objects on the ground.

    Attributes
    ----------
    max_shift_m : metres by which an object is moved out of a wall or off a carriageway of assumed width; others are
        left out.
    min_crown_m, crown_gap_m : crowns are narrowed to this distance from walls, and trees of narrower ones left out.
    size_factors : bounds of a stated size, as shares of the usual one.
    """

    max_shift_m: float = 2.5
    min_crown_m: float = 1.6
    crown_gap_m: float = 0.2
    size_factors: tuple[float, float] = (0.25, 3.5)


OBJECTS = ObjectSettings()


@dataclass(frozen=True, slots=True)
class KerbObjectSettings:
    """Plausible objects along kerbs.

    Attributes
    ----------
    lamp_offset_m, lamp_spacing_m : metres of lamps from the kerb, and from one to the next.
    parked_share : share of the parking places that are taken.
    door_clearance_m : metres to walls, as any may have a door.
    """

    lamp_offset_m: float = 0.6
    lamp_spacing_m: float = 30.0
    parked_share: float = 0.7
    door_clearance_m: float = 1.4


KERBS = KerbObjectSettings()
