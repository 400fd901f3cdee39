"""Settings of the shells of buildings: tuned numbers, one class per step."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ChimneySettings:
    """Chimneys on roofs of assumed shape.

    Attributes
    ----------
    min_roof_m2, min_roof_of_two_m2 : square metres of footprint from which a pitched roof has a chimney, and two.
    chimney_share : share of such roofs with chimneys.
    candidates : random places per roof; the highest ones are used.
    min_inset_m, min_spacing_m : metres from the outline to a chimney, and between two chimneys.
    width_m, length_m, height_m : metres; ranges of the length and of the height over the roof at the middle.
    buried_m : metres from the lowest roof around a chimney down to its foot.
    """

    min_roof_m2: float = 60.0
    min_roof_of_two_m2: float = 900.0
    chimney_share: float = 0.7
    candidates: int = 24
    min_inset_m: float = 1.6
    min_spacing_m: float = 6.0
    width_m: float = 0.6
    length_m: tuple[float, float] = (0.7, 1.5)
    height_m: tuple[float, float] = (0.8, 1.3)
    buried_m: float = 0.05


CHIMNEYS = ChimneySettings()


@dataclass(frozen=True, slots=True)
class ClosingSettings:
    """Walls that modelled shells lack.

    Attributes
    ----------
    max_foot_m : open lower edges of walls up to this height over the lowest point of a shell are its foot, metres.
    min_missing_m2, min_missing_m : smaller or narrower gaps stay open: square metres and metres.
    max_overhang_m : roofs overhang the wall below them by at most this; metres.
    max_joint_m : walls closer than this to a missing one are in its place; metres.
    min_covered_share : share of a missing wall that has a wall in its place or behind it from which it is not
        missing.
    min_wall_share : a shell without this share of its walls is a canopy or a roof on posts, and stays open.
    max_open_edges : a shell with more open edges is a scan, not a model of surfaces, and stays open.
    min_parallel_cosine : cosine between the normals of parallel walls.
    """

    max_foot_m: float = 2.0
    min_missing_m2: float = 0.5
    min_missing_m: float = 0.1
    max_overhang_m: float = 1.5
    max_joint_m: float = 0.05
    min_covered_share: float = 0.5
    min_wall_share: float = 0.2
    max_open_edges: int = 500
    min_parallel_cosine: float = 0.9


CLOSING = ClosingSettings()


@dataclass(frozen=True, slots=True)
class CurtainSettings:
    """Walls below open edges of a shell.

    Attributes
    ----------
    grid_m : grid of the corners, metres.
    min_curtain_m : edges up to this length and walls up to its square in area are left out, metres.
    max_off_line_m : maximum distance of an edge's ends from a line, seen from above, metres.
    """

    grid_m: float = 0.001
    min_curtain_m: float = 0.01
    max_off_line_m: float = 0.02


CURTAINS = CurtainSettings()


@dataclass(frozen=True, slots=True)
class DormerSettings:
    """Dormers and rooflights on roofs of assumed shape.

    Attributes
    ----------
    min_slope, min_dormer_slope, min_mansard_slope : slopes (rise over run) from which roofs have rooflights and
        dormers, and from which they are lower parts of mansards.
    dormer_share, rooflight_share, mansard_dormer_share, max_per_row : shares of roofs with dormers and with
        rooflights, and of mansards with dormers.
    max_rows : rows per building.
    end_distance_m : metres from the end of the eaves to the middle of a row's first.
    dormer_width_m, front_height_m, front_above_eaves_m, min_front_height_m : ranges in metres: width, height of the
        front, and height of its foot over the eaves.
    min_setback_m : metres from the eaves back to the front.
    gabled_share, gable_height_m : share of buildings whose dormers have gables, and the height of a gable in metres.
    shed_slope : slope of the roof of a dormer without a gable, down to the front.
    edge_clearance_m, ridge_clearance_m : metres to the edges of the roof facet, and to its upper end.
    jamb_m, sill_m, head_m, window_relief_m : metres from a dormer's window to the sides, the foot and the top of the
        front, and out of it.
    buried_m : metres from the roof down to the foot of a dormer.
    rooflight_size_m : width of a rooflight and its height along the slope, metres.
    rooflight_above_eaves_m : range of metres from the eaves up to the lower edge of a rooflight.
    """

    min_slope: float = 0.25
    min_dormer_slope: float = 0.45
    min_mansard_slope: float = 1.2
    dormer_share: float = 0.35
    rooflight_share: float = 0.3
    mansard_dormer_share: float = 0.9
    max_per_row: int = 8
    max_rows: int = 5
    end_distance_m: float = 1.2
    dormer_width_m: tuple[float, float] = (1.1, 1.5)
    front_height_m: tuple[float, float] = (1.2, 1.5)
    front_above_eaves_m: tuple[float, float] = (0.35, 0.6)
    min_front_height_m: float = 1.0
    min_setback_m: float = 0.2
    gabled_share: float = 0.5
    gable_height_m: float = 0.45
    shed_slope: float = 0.08
    edge_clearance_m: float = 0.05
    ridge_clearance_m: float = 0.15
    jamb_m: float = 0.13
    sill_m: float = 0.16
    head_m: float = 0.12
    window_relief_m: float = 0.03
    buried_m: float = 0.04
    rooflight_size_m: tuple[float, float] = (0.78, 1.18)
    rooflight_above_eaves_m: tuple[float, float] = (1.0, 1.6)


DORMERS = DormerSettings()


@dataclass(frozen=True, slots=True)
class EavesSettings:
    """Overhangs and parapets of assumed roofs.

    Attributes
    ----------
    overhang_m, verge_m : metres from the wall to the edge of a roof, over eaves and over gables.
    cove_depth_m : metres from the lower edge of an overhang down to the foot of its cove at the wall.
    max_drop_m : metres by which an overhang may drop below the eaves.
    max_overhang_slope, steep_overhang_slope : overhangs of steeper roofs (rise over run) continue at the second
        slope.
    parapet_m, coping_m : height and depth of a parapet in metres.
    min_parapet_roof_m : lowest roof with a parapet, metres over the ground.
    max_edges : a roof with more edges is round, and gets neither overhang nor parapet.
    max_mitre_ratio : longest mitre as a multiple of the width.
    mitre_level_m : metres by which the heights of two overhangs may differ at their mitre.
    """

    overhang_m: float = 0.4
    verge_m: float = 0.2
    cove_depth_m: float = 0.22
    max_drop_m: float = 0.3
    max_overhang_slope: float = 1.0
    steep_overhang_slope: float = 0.2
    parapet_m: float = 0.4
    coping_m: float = 0.3
    min_parapet_roof_m: float = 4.0
    max_edges: int = 48
    max_mitre_ratio: float = 2.5
    mitre_level_m: float = 5e-3


EAVES = EavesSettings()


@dataclass(frozen=True, slots=True)
class FacetSettings:
    """Plane facets of a shell.

    Attributes
    ----------
    weld_m : grid on which vertices are merged; metres.
    min_facet_m2 : square metres; smaller facets are dropped.
    max_upright_nz, max_leaning_nz : |nz| below which a surface is upright, and below which one is that its source
        calls a wall, window or door.
    side_probe_m : metres off a wall of the points that decide which side is inside the footprint.
    underside_m : metres above the lowest point of a building up to which surfaces that face down are its underside.
    """

    weld_m: float = 1e-3
    min_facet_m2: float = 0.01
    max_upright_nz: float = 0.2
    max_leaning_nz: float = 0.7
    side_probe_m: float = 0.05
    underside_m: float = 0.5


FACETS = FacetSettings()


@dataclass(frozen=True, slots=True)
class GutterSettings:
    """Gutters and downpipes of assumed roofs.

    Attributes
    ----------
    gutter_share : share of buildings with gutters.
    min_eaves_m, max_eaves_slope_m : metres; shorter eaves have no gutter, and eaves rise less than the second figure
        along their length.
    rim_m, belly_m, back_m, trough_m : points of a gutter's section, metres out of the roof's edge and above it; the
        back is inside the cove.
    taper_m : metres over which a gutter tapers at its free end.
    pipe_section_m : section of a pipe, metres along the wall from its middle and out of the wall.
    pipe_end_distance_m, pipe_bend_m : metres from the end of the eaves to the middle of a pipe, and from the cove
        down to its bend.
    max_pipe_spacing_m : metres of gutter from one pipe to the next.
    outlet_overhang_m, outlet_drop_m : metres from the roof's edge out and down to where a pipe leaves its gutter.
    min_pipe_m : metres; lower walls have no pipe.
    """

    gutter_share: float = 0.92
    min_eaves_m: float = 1.5
    max_eaves_slope_m: float = 0.02
    rim_m: tuple[float, float] = (0.11, 0.0)
    belly_m: tuple[float, float] = (0.085, -0.085)
    back_m: tuple[float, float] = (-0.09, -0.1)
    trough_m: tuple[float, float] = (-0.03, -0.045)
    taper_m: float = 0.05
    pipe_section_m: tuple[tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float]] = (
        (-0.05, 0.012),
        (-0.032, 0.095),
        (0.032, 0.095),
        (0.05, 0.012),
    )
    pipe_end_distance_m: float = 0.16
    pipe_bend_m: float = 0.12
    max_pipe_spacing_m: float = 14.0
    outlet_overhang_m: float = 0.03
    outlet_drop_m: float = 0.07
    min_pipe_m: float = 2.0


GUTTERS = GutterSettings()


@dataclass(frozen=True, slots=True)
class NeighbourSettings:
    """Buildings beside a building.

    Attributes
    ----------
    neighbour_gap_m : metres between outlines of buildings that touch.
    min_height_ratio : a roof continues over neighbours of at least this share of its own wall height.
    eaves_tolerance_m : a neighbour that ends this far below the eaves does not obstruct them; metres.
    """

    neighbour_gap_m: float = 0.3
    min_height_ratio: float = 0.5
    eaves_tolerance_m: float = 0.5


NEIGHBOURS = NeighbourSettings()


@dataclass(frozen=True, slots=True)
class PassageSettings:
    """Passages through buildings.

    Attributes
    ----------
    on_wall_m : metres from a wall within which an edge of a passage lies on it.
    min_area_m2 : square metres; smaller areas are rounding errors.
    """

    on_wall_m: float = 1e-5
    min_area_m2: float = 0.01


PASSAGES = PassageSettings()


@dataclass(frozen=True, slots=True)
class RoofEdgeSettings:
    """Edges of roofs in sight of a street.

    Attributes
    ----------
    min_edge_m : metres; shorter pieces of edges are dropped.
    neighbour_clearance_m : metres between a roof's edge and a neighbour that obstructs it.
    max_touch_m : metres by which a neighbour may overlap the end of an edge without obstructing it.
    max_sight_m, street_sampling_m : metres from a street to the farthest edge in sight, and between sample points on
        streets.
    max_sight_lines : nearest street points that are tested per edge.
    outline_tolerance_m : metres from the outline to an edge on it.
    """

    min_edge_m: float = 0.6
    neighbour_clearance_m: float = 0.1
    max_touch_m: float = 0.05
    max_sight_m: float = 60.0
    street_sampling_m: float = 4.0
    max_sight_lines: int = 8
    outline_tolerance_m: float = 5e-3


ROOF_EDGES = RoofEdgeSettings()


@dataclass(frozen=True, slots=True)
class RoofShapeSettings:
    """Shapes of assumed roofs.

    Attributes
    ----------
    grid_m : grid of outlines and ridges in metres, so that the regions of a roof share their corners exactly.
    steep_run_share, steep_rise_share : steep part of gambrel and mansard roofs: share of the run to the ridge, and of
        the rise.
    half_hip_share : share of the height up to which a half-hipped roof is a gable.
    upper_pitch_deg : degrees of the upper part of a mansard roof whose pitch is known.
    min_rectangle_fill : share of its smallest rectangle that a rectangular footprint fills.
    max_jog_m : jogs of the outline that a roof ignores; metres.
    weld_m : metres by which lines on the grid may miss the corner of the outline at which they meet; they are moved
        to it.
    max_gap_m : half of the widest gap between neighbours that a roof closes; metres.
    min_shared_m : metres of outline that neighbours share at least.
    neighbour_reach_m : metres of the neighbours that are part of the skeleton where the pitch is unknown.
    max_gable_side_m, max_square_cosine : the side at the end of a wing: greatest length in metres, and cosine of its
        corners, about 90 degrees.
    gable_extension : share of its length by which such a side is moved outwards: above half of it no hip reaches
        back.
    """

    grid_m: float = 1e-3
    steep_run_share: float = 0.25
    steep_rise_share: float = 0.6
    half_hip_share: float = 0.5
    upper_pitch_deg: float = 18.0
    min_rectangle_fill: float = 0.95
    max_jog_m: float = 0.6
    weld_m: float = 5e-3
    max_gap_m: float = 0.15
    min_shared_m: float = 2.0
    neighbour_reach_m: float = 25.0
    max_gable_side_m: float = 18.0
    max_square_cosine: float = 0.35
    gable_extension: float = 0.7


ROOF_SHAPES = RoofShapeSettings()


@dataclass(frozen=True, slots=True)
class ShellSettings:
    """Feet and bottoms of shells.

    Attributes
    ----------
    min_skirt_m : metres; wider gaps between a building and the terrain are closed by a skirt.
    max_foot_m : metres from the lowest point of a shell up to the lower edges of its walls.
    min_buried_m, min_visible_m : a shell is lifted to the ground if it is at least this deep below it, and this high
        above; metres.
    max_lowered_m : a building that stands at most this high above its lowest ground is lowered to it; metres. Higher
        ones get a skirt: their walls would be hidden by more than that on the other side.
    """

    min_skirt_m: float = 0.05
    max_foot_m: float = 2.0
    min_buried_m: float = 0.5
    min_visible_m: float = 2.5
    max_lowered_m: float = 1.0


SHELLS = ShellSettings()


@dataclass(frozen=True, slots=True)
class SkeletonSettings:
    """Straight skeleton of an outline.

    Attributes
    ----------
    grid_m : grid of ridges in metres.
    slab_tolerance_m : metres by which a point may be outside of a slab that it counts to.
    min_corner_bend : 1 + the cosine between the normals at a corner; below it the corner is a spike, whose motorcycle
        has no speed.
    corner_tolerance_share : share of an edge's length beyond its ends within which a motorcycle that runs into a
        corner meets it.
    max_depth_cells : points times edges whose depth is computed at once: 100 bytes each.
    min_corner_sine : sine of the turn below which a corner is straight.
    """

    grid_m: float = 0.01
    slab_tolerance_m: float = 0.02
    min_corner_bend: float = 0.02
    corner_tolerance_share: float = 1e-6
    max_depth_cells: int = 1 << 20
    min_corner_sine: float = 1e-6


SKELETON = SkeletonSettings()


@dataclass(frozen=True, slots=True)
class VentSettings:
    """Vents on roofs of assumed shape.

    Attributes
    ----------
    vent_share : share of roofs with vents.
    max_vents : vents per roof.
    spacing_m : metres of edge per vent.
    slope_range : slopes (rise over run) of pitched roofs with vents.
    end_distance_m, clearance_m : metres from the ends of an edge, and from other details of the roof.
    eye_height_m : eye height over the ground in metres.
    buried_m : metres from the lowest roof around a vent down to its foot.
    visible_top : a vent is in sight where its part above this share of its height is.
    """

    vent_share: float = 0.7
    max_vents: int = 4
    spacing_m: float = 7.0
    slope_range: tuple[float, float] = (0.12, 1.2)
    end_distance_m: float = 0.8
    clearance_m: float = 0.25
    eye_height_m: float = 1.6
    buried_m: float = 0.04
    visible_top: float = 0.8


VENTS = VentSettings()
