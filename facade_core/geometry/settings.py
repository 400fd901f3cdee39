"""Settings of surfaces and charts: tuned numbers, one class per step."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SurfaceSettings:
    """Surfaces of a block.

    Attributes
    ----------
    collinear_tolerance_m : footprint vertices nearer than this to the straight wall do not split it into two facades;
        metres.
    forecourt_m : metres of ground around buildings.
    courtyard_m : half of the widest gap between buildings that ground fills; metres.
    sight_margin_m : metres by which edges of a roof may be outside of the footprint.
    min_prepared_corners : corners of a footprint above which an index of its edges costs less than their scan.
    min_walled_share : a shell with walls along a smaller share of its free outline is a canopy, and ground continues
        below it.
    """

    collinear_tolerance_m: float = 0.2
    forecourt_m: float = 6.0
    courtyard_m: float = 22.0
    sight_margin_m: float = 5.0
    min_prepared_corners: int = 100
    min_walled_share: float = 0.6


BLOCK_SURFACES = SurfaceSettings()


@dataclass(frozen=True, slots=True)
class PackingSettings:
    """Packing of charts on pages.

    Attributes
    ----------
    max_open_pages : pages open for first fit: more would fill pages better, but scatter a building over the atlas.
    """

    max_open_pages: int = 4


PACKING = PackingSettings()


@dataclass(frozen=True, slots=True)
class ChartSettings:
    """Charts.

    Attributes
    ----------
    max_level_sine : sine of the slope below which a chart counts as level: its axis_u points east.
    """

    max_level_sine: float = 0.035


CHARTS = ChartSettings()


@dataclass(frozen=True, slots=True)
class CuttingSettings:
    """Cuts of polygons along planes.

    Attributes
    ----------
    min_wall_piece_m : metres; walls are not cut into shorter pieces.
    on_plane_m : vertices nearer than this to a cutting plane lie on it; metres.
    """

    min_wall_piece_m: float = 0.05
    on_plane_m: float = 1e-6


CUTTING = CuttingSettings()


@dataclass(frozen=True, slots=True)
class DaylightSettings:
    """Daylight at surfaces.

    Attributes
    ----------
    place_spacing_m, rays_per_place : metres between the sample places of a chart, which include its border; light is
        linear between them.
    max_occluder_m : metres; farther surfaces occlude no light.
    ray_lift_m : metres from a surface and its border to the start of rays: vertices are up to centimetres off their
        chart's plane.
    ray_shift_m : metres by which rays start aside, as walls often coincide with whole metres.
    max_back_face_share : a place where a larger share of rays hits back faces is inside a building.
    """

    place_spacing_m: float = 2.0
    rays_per_place: int = 24
    max_occluder_m: float = 20.0
    ray_lift_m: float = 0.05
    ray_shift_m: float = 0.013
    max_back_face_share: float = 0.5


DAYLIGHT = DaylightSettings()


@dataclass(frozen=True, slots=True)
class GrowthSettings:
    """Growth of outlines.

    Attributes
    ----------
    max_outline_corners, max_corners : corners of one outline, and of all, above which an area grows in steps.
    first_step_m : first of the steps in metres; each is twice the step before.
    """

    max_outline_corners: int = 500
    max_corners: int = 20_000
    first_step_m: float = 0.25


GROWTH = GrowthSettings()


@dataclass(frozen=True, slots=True)
class OverheadSettings:
    """Views from above.

    Attributes
    ----------
    overhead_lift_m : metres from a texel to the start of its ray: triangles are up to centimetres off their chart's
        plane.
    min_up_cosine : cosine of a roof's normal with the vertical, 75 degrees; steeper roofs show too few pixels from
        above.
    texels_per_batch : texels sampled together: each needs many times the memory of its colour.
    """

    overhead_lift_m: float = 0.1
    min_up_cosine: float = 0.26
    texels_per_batch: int = 1 << 17


OVERHEAD = OverheadSettings()


@dataclass(frozen=True, slots=True)
class PartyWallSettings:
    """Shares of walls against other buildings.

    Attributes
    ----------
    probe_spacing_m : metres between probes of a wall; texels between four inside probes are inside.
    probe_distance_m : metres from the wall to a probe: neighbours may be that far apart.
    edge_inset_m : metres from the edges of a wall to a probe: a ray from an edge may pass between two surfaces.
    """

    probe_spacing_m: float = 0.5
    probe_distance_m: float = 0.3
    edge_inset_m: float = 0.02


PARTY_WALLS = PartyWallSettings()


@dataclass(frozen=True, slots=True)
class StreetSettings:
    """Streets of a block.

    Attributes
    ----------
    min_street_m : metres; a shorter street has no viewpoint.
    """

    min_street_m: float = 1.0


STREET_VIEWPOINTS = StreetSettings()


@dataclass(frozen=True, slots=True)
class CrossingSettings:
    """Crossings of rays with surfaces.

    Attributes
    ----------
    min_hit_m : metres; nearer hits do not count: a window may be in front of its wall.
    """

    min_hit_m: float = 0.02


CROSSINGS = CrossingSettings()


@dataclass(frozen=True, slots=True)
class DensitySettings:
    """Texels per metre of charts.

    Attributes
    ----------
    full_density_m, half_density_m : metres from a viewpoint up to which a chart that faces it has full and half
        density; all others have a quarter. A pixel of a picture 1,400 wide with a field of view of 75 degrees covers
        1 / 57 m at 16 m.
    min_texels_per_metre : texels per metre of the coarsest chart, so that a window has some eight texels.
    max_party_wall_share : free share of a wall up to which it counts as a party wall, which is hardly ever seen.
    charts_per_batch : charts per query: each is within reach of some twenty viewpoints.
    """

    full_density_m: float = 16.0
    half_density_m: float = 48.0
    min_texels_per_metre: float = 8.0
    max_party_wall_share: float = 0.05
    charts_per_batch: int = 1 << 16


TEXEL_DENSITY = DensitySettings()


@dataclass(frozen=True, slots=True)
class WallSettings:
    """Walls of a building from its charts.

    Attributes
    ----------
    max_joint_m : metres between two opposite walls up to which they touch: party walls, and the joints between
        buildings.
    max_facing_cosine : cosine between the normals of two walls below which they face each other.
    snap_m : grid on which the triangles of one wall meet; metres.
    corner_tolerance_m : metres between the ends of two walls that meet at a corner.
    max_bend_facet_m : metres; walls at least as wide are not joined round a bend.
    min_bend_cosine : cosine between the normals of two walls that are joined round a bend.
    max_unrolled_facet_m, min_unrolled_cosine : joined facets that are narrower, and turn less, hold no whole window:
        the wall is unrolled, and windows bend. Metres, cosine.
    min_unrolled_facet_m : narrower facets are no part of an unrolled wall, metres.
    level_tolerance_m : metres by which the feet and tops of joined walls may differ.
    min_wall_m : metres; a narrower or lower wall is a ledge.
    min_main_surface_m2, min_main_surface_m : smaller or narrower walls and roofs are details, such as roof edges,
        chimneys and skirts; square metres and metres.
    walls_per_batch : walls whose free parts are computed at once: the outlines of a batch are in memory.
    floor_height_m : lowest and greatest floor height in metres, where the height of the building allows it.
    """

    max_joint_m: float = 0.5
    max_facing_cosine: float = -0.94
    snap_m: float = 0.001
    corner_tolerance_m: float = 0.05
    max_bend_facet_m: float = 3.0
    min_bend_cosine: float = 0.86
    max_unrolled_facet_m: float = 1.25
    min_unrolled_cosine: float = 0.94
    min_unrolled_facet_m: float = 0.4
    level_tolerance_m: float = 0.1
    min_wall_m: float = 0.7
    min_main_surface_m2: float = 2.0
    min_main_surface_m: float = 0.6
    walls_per_batch: int = 4096
    floor_height_m: tuple[float, float] = (2.6, 4.5)


FACADE_WALLS = WallSettings()
