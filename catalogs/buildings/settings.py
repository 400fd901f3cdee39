"""Numbers of the assembly of buildings."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class AssumedRoofs:
    """Roofs that are assumed for buildings that state none, judged by eye on European streets.

    Attributes
    ----------
    flat_roof_since_year : roofs are flat from this year on.
    max_pitched_half_depth_m : deeper wings have flat roofs.
    max_pitched_height_m : higher walls have flat roofs.
    max_shed_area_m2 : smaller buildings have the roofs of sheds.
    max_shed_half_depth_m : narrower buildings have the roofs of sheds.
    min_hall_area_m2 : larger buildings of one floor have flat roofs.
    max_house_area_m2 : detached buildings up to this area are houses.
    max_house_height_m : detached buildings up to this height are houses.
    house_pitch_range_deg : gables of houses.
    row_pitch_range_deg : roofs of a row along a street.
    mansard_pitch_deg : lower slope of mansard roofs.
    church_pitch_deg : gables of churches.
    shed_pitch_deg : skillion roofs of sheds.
    max_row_roof_m : height of gabled roofs; deeper buildings have a flat middle.
    max_church_roof_m : height of roofs of churches.
    max_shed_roof_m : height of roofs of sheds.
    mansard_roof_m : height of mansard roofs.
    mansard_share : mansard roofs in a row.
    hipped_share : hipped roofs in a row; the others have gables.
    min_mansard_half_depth_m : narrower buildings have no mansard roof.
    min_wall_m : lowest walls after a roof is subtracted from a height.
    attached_distance_m : neighbours within this distance are attached.
    """

    flat_roof_since_year: int = 1945
    max_pitched_half_depth_m: float = 15.0
    max_pitched_height_m: float = 30.0
    max_shed_area_m2: float = 30.0
    max_shed_half_depth_m: float = 2.0
    min_hall_area_m2: float = 200.0
    max_house_area_m2: float = 400.0
    max_house_height_m: float = 11.0
    house_pitch_range_deg: tuple[float, float] = (32.0, 42.0)
    row_pitch_range_deg: tuple[float, float] = (24.0, 34.0)
    mansard_pitch_deg: float = 66.0
    church_pitch_deg: float = 45.0
    shed_pitch_deg: float = 8.0
    max_row_roof_m: float = 5.0
    max_church_roof_m: float = 12.0
    max_shed_roof_m: float = 1.0
    mansard_roof_m: float = 4.4
    mansard_share: float = 0.2
    hipped_share: float = 0.15
    min_mansard_half_depth_m: float = 6.7
    min_wall_m: float = 2.5
    attached_distance_m: float = 0.3


ROOFS = AssumedRoofs()


@dataclass(frozen=True, slots=True)
class FacadeStyleRules:
    """Facade styles of buildings by size and age, judged by eye on Helsinki, its suburbs and Delfshaven.

    Attributes
    ----------
    min_street_floors : floors from which a building may be one of a perimeter block.
    max_house_floors : floors up to which a building may be a villa or a hall.
    max_terrace_floors : floors up to which a building may be a house of a terrace.
    max_terrace_area_m2 : attached buildings up to this area are houses of a terrace.
    max_villa_area_m2 : detached buildings up to this area are villas.
    min_hall_area_m2 : detached low buildings from this area are halls.
    min_slab_floors : detached buildings from these floors are slabs.
    first_modern_year : year from which flats have panels and offices glass.
    """

    min_street_floors: int = 3
    max_house_floors: int = 3
    max_terrace_floors: int = 5
    max_terrace_area_m2: float = 180.0
    max_villa_area_m2: float = 300.0
    min_hall_area_m2: float = 800.0
    min_slab_floors: int = 5
    first_modern_year: int = 1958


FACADE_STYLE_RULES = FacadeStyleRules()


@dataclass(frozen=True, slots=True)
class AssumedHeights:
    """Heights of buildings that state none, set by hand on Helsinki (`python -m benchmarks.heights`), without a held-out part.

    Attributes
    ----------
    distance_scale_m : weight of a known building: exponential in the distance.
    log_area_scale : weight of a known building: Gaussian in the natural logarithm of the area ratio.
    far_weight : weight of distance at any distance.
    max_neighbours : nearest known buildings that count.
    max_low_area_m2 : buildings below this area have one floor.
    max_detached_low_area_m2 : detached buildings below this area have one floor.
    fallback_height_m : height where no building of a block has one.
    variation_share : buildings one floor below the median, and the same share above, by eye from tagged
        buildings; avoids blocks of one height.
    """

    distance_scale_m: float = 250.0
    log_area_scale: float = 2.0
    far_weight: float = 1e-3
    max_neighbours: int = 64
    max_low_area_m2: float = 45.0
    max_detached_low_area_m2: float = 100.0
    fallback_height_m: float = 12.0
    variation_share: float = 0.23


HEIGHTS = AssumedHeights()


@dataclass(frozen=True, slots=True)
class PartRules:
    """Parts of buildings, and the outlines that they replace.

    Attributes
    ----------
    min_host_share : share of a part inside its host outline.
    min_support_share : share of a part above the items that support it.
    min_part_wall_m : lowest wall of a part.
    min_half_width_m : half the width of pieces, narrower ones are mapping errors.
    min_open_border_share : share of the border on that of the building; below it a part extends down to its
        support.
    border_tolerance_m : distance within which two borders coincide.
    max_overlap_m2 : smaller overlaps are mapping errors.
    simplify_tolerance_m : corners nearer to a line are dropped.
    min_covered_share : share covered by raised parts, above which a building without a height ends below
        them.
    flat_roof_confidence : Confidence in the flat roof of a part without a stated one.
    """

    min_host_share: float = 0.5
    min_support_share: float = 0.95
    min_part_wall_m: float = 0.3
    min_half_width_m: float = 0.5
    min_open_border_share: float = 0.1
    border_tolerance_m: float = 0.3
    max_overlap_m2: float = 1.0
    simplify_tolerance_m: float = 0.01
    min_covered_share: float = 0.5
    flat_roof_confidence: float = 0.6


PARTS = PartRules()


@dataclass(frozen=True, slots=True)
class SiteRules:
    """Extent and outlines of the buildings of a block.

    Attributes
    ----------
    min_footprint_m2 : smaller outlines are kiosks, masts or mapping errors.
    min_part_m2 : smaller parts of buildings are mapping errors.
    context_distance_m : known heights of buildings within this distance of the area count too.
    max_sliver_share : area share by which repair may change a self-intersecting outline.
    duplicate_share : area share inside a building of an earlier source, above which both are the same.
    max_neighbour_overlap : Area share of the smaller outline by which two buildings of one id may overlap.
    assumed_floor_m : ranks levels among heights.
    area_margin_deg : tolerance around the area of use of a CRS.
    max_swapped_gap_deg : swapped coordinates of one place agree with those of its other files.
    max_median_size_deg : median size of a building in degrees.
    max_local_coordinate : of a model in a frame of its own.
    max_origin_error_deg : of latitude, for 20 km.
    min_buried_m : least depth of a foot below the lowest ground around its building that is cut off.
    min_visible_m : least height that is left above a foot that is cut off.
    square_steps_per_side : positions of the square per side.
    max_building_size_m : the largest halls and terminals are 1 to 3 km long.
    max_block_span_m : span of a block and of a city.
    neighbour_distance_m : buildings nearer than this are neighbours.
    max_stray_share : size of a stray group over that of the largest one.
    cells_per_neighbour_distance : grid cells per NEIGHBOUR_DISTANCE_M.
    max_area_span_m : limit of a search area.
    weld_m : corners within this distance are the same.
    max_gap_m : gaps between triangles up to this width are closed.
    min_common_share : area share of both outlines.
    max_bounds_offset_m : m between the bounds of equal outlines.
    roof_top_quantile : Of the cells of a roof: its top without aerials, chimneys and trees that overhang.
    min_measured_height_m : A lower measured height is no building's: it is gone, or was built later.
    min_roof_cells : Least cells of a roof that are measured on.
    """

    min_footprint_m2: float = 10.0
    min_part_m2: float = 4.0
    context_distance_m: float = 500.0
    max_sliver_share: float = 0.02
    duplicate_share: float = 0.5
    max_neighbour_overlap: float = 0.05
    assumed_floor_m: float = 3.0
    area_margin_deg: float = 2.0
    max_swapped_gap_deg: float = 0.5
    max_median_size_deg: float = 0.05
    max_local_coordinate: float = 20_000.0
    max_origin_error_deg: float = 0.2
    min_buried_m: float = 0.5
    min_visible_m: float = 2.5
    square_steps_per_side: int = 4
    max_building_size_m: float = 5_000.0
    max_block_span_m: float = 50_000.0
    neighbour_distance_m: float = 5_000.0
    max_stray_share: float = 0.5
    cells_per_neighbour_distance: int = 5
    max_area_span_m: float = 200_000.0
    weld_m: float = 0.001
    max_gap_m: float = 0.01
    min_common_share: float = 0.98
    max_bounds_offset_m: float = 0.5
    roof_top_quantile: float = 0.9
    min_measured_height_m: float = 2.5
    min_roof_cells: int = 4


SITES = SiteRules()
