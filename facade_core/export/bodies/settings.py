"""Settings of the closed bodies of buildings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from facade_core.core.types import Element
from facade_core.imagery.rectify.settings import PARALLAX


@dataclass(frozen=True, slots=True)
class BodySettings:
    """Numbers of the closed bodies of buildings.

    Attributes
    ----------
    grid_m : grid of written corners, metres.
    max_weld_m : corners closer than this are merged, metres: eaves, hips and walls miss each other by
        millimetres.
    max_off_edge_m : an edge is split at corners closer than this, metres.
    max_off_plane_m : maximum distance of a planar polygon's corners from its plane, metres.
    min_normal_cosine : minimum cosine between a planar polygon's normal and those of its triangles.
    max_foot_height_m : open edges up to this height above the lowest corner belong to the foot of a building,
        metres.
    wall_margin_m : roof triangles this far outside of the walls are separate from the body, metres.
    max_hole_perimeter_m : holes up to this perimeter are closed, metres; edges up to half of it may collapse.
    min_area_share : minimum share of the connected area that a body keeps.
    max_added_area_share : maximum horizontal area that closing may add, as share of the body's area.
    max_group_gap_m : attachments whose boxes are closer than this form one part, metres.
    """

    grid_m: float = 0.001
    max_weld_m: float = 0.01
    max_off_edge_m: float = 0.006
    max_off_plane_m: float = 0.006
    min_normal_cosine: float = 0.96
    max_foot_height_m: float = 2.0
    wall_margin_m: float = 0.02
    max_hole_perimeter_m: float = 0.4
    min_area_share: float = 0.4
    max_added_area_share: float = 0.1
    max_group_gap_m: float = 0.05


BODIES = BodySettings()


@dataclass(frozen=True, slots=True)
class FootprintSettings:
    """Numbers of footprints.

    Attributes
    ----------
    snap_grid_m : grid on which corners are snapped so that nearly shared edges meet, metres.
    min_below_roof_m : ceilings of passages are at least this far below the lowest corner of the roofs, metres.
    max_ceiling_gap_m : maximum distance between a ceiling and the upper edge of a wall below it, metres.
    min_part_m2 : minimum area of a part of a footprint, m2.
    """

    snap_grid_m: float = 0.001
    min_below_roof_m: float = 0.4
    max_ceiling_gap_m: float = 0.01
    min_part_m2: float = 0.1


FOOTPRINTS = FootprintSettings()


@dataclass(frozen=True, slots=True)
class OpeningSettings:
    """Numbers of windows and doors in a wall.

    Attributes
    ----------
    max_area_difference : maximum relative difference between the areas of a polygon and its triangles.
    min_opening_m2 : minimum area of an opening, m2.
    min_opening_width_m : minimum width of an opening, metres.
    wall_edge_m : distance of openings from the border of the wall, metres.
    opening_gap_m : distance between openings, metres.
    shallow_recess_m : depth of openings whose own depth has no room, metres; flush if this has none either.
    min_recess_clearance_m : minimum distance to surfaces behind the wall, metres.
    """

    max_area_difference: float = 1e-3
    min_opening_m2: float = 0.05
    min_opening_width_m: float = 0.15
    wall_edge_m: float = 0.05
    opening_gap_m: float = 0.06
    shallow_recess_m: float = 0.05
    min_recess_clearance_m: float = 0.03


WALL_OPENINGS = OpeningSettings()


@dataclass(frozen=True, slots=True)
class AlignmentSettings:
    """Numbers of the alignment of openings with their picture.

    Attributes
    ----------
    max_shift_m : a side moves by at most this, two texels of 12 a metre, and to half of the gap to the next opening, metres.
    max_inward_share : a side moves inward by at most this share of the opening.
    step_m : width of the strips at either side of an edge that are compared, metres.
    side_share : middle share of a side whose edge counts.
    min_step : steps below this are no edge, grey levels.
    high_share : steps of at least this share of the highest are high; the outermost of them is the edge.
    """

    max_shift_m: float = 0.17
    max_inward_share: float = 0.25
    step_m: float = 0.08
    side_share: float = 0.7
    min_step: float = 12.0
    high_share: float = 0.5


ALIGNMENT = AlignmentSettings()


@dataclass(frozen=True, slots=True)
class BalconySettings:
    """Numbers of balconies.

    Attributes
    ----------
    platform_width_m, platform_height_m : minimum width, and minimum and maximum height of a balcony with a platform;
        others are railings of windows, metres. Codes of buildings have railings of 0.9 to 1.1 m, above a slab.
    floor_thickness_m : thickness of a balcony's floor, metres.
    railing_thickness_m : thickness of a railing, metres.
    min_balcony_m : minimum width and height of a balcony, metres.
    max_above_railing_m : a window that ends at most this far above a railing continues behind it, metres.
    max_beside_railing_m : such a window ends at most this far beside the railing, metres.
    sill_above_floor_m : height above the balcony's floor at which such a window ends, metres.
    """

    platform_width_m: float = 1.8
    platform_height_m: tuple[float, float] = (0.75, 1.3)
    floor_thickness_m: float = 0.15
    railing_thickness_m: float = 0.06
    min_balcony_m: float = 0.5
    max_above_railing_m: float = 0.25
    max_beside_railing_m: float = 0.1
    sill_above_floor_m: float = 0.1


BALCONY_SHAPES = BalconySettings()


@dataclass(frozen=True, slots=True)
class RailingSettings:
    """Numbers of railings that are seen through. Codes of buildings allow gaps of 0.10 to 0.12 m.

    Attributes
    ----------
    handrail_m : height and depth of the handrail, metres.
    bar_spacing_m : distance from bar to bar, metres.
    bar_width_m : width of a bar, metres.
    min_contrast : minimum standard deviation of a railing's column means, grey levels. Parapets of the balconies on
        which it was chosen have up to 12, railings 13 to 37.
    """

    handrail_m: float = 0.06
    bar_spacing_m: float = 0.12
    bar_width_m: float = 0.025
    min_contrast: float = 12.5


RAILINGS = RailingSettings()


class ElementDepth(NamedTuple):
    """Depth of an element.

    Attributes
    ----------
    outward_m : metres before the plane of the wall; negative behind it.
    source : "parallax" if pictures measure it, "assumed" if it follows from the class.
    """

    outward_m: float
    source: str


# Depths by class, and of balconies by size, metres outward, where no pictures measure them. Openings: a recess between half a
# brick, 0.10 m (4 inches by London's Building Act of 1709; 0.075 m in Trafford's design code of today), and a brick, 0.21 m.
# Stone and plaster of the 19th century are deeper. Balconies: room for a chair; before a single window a railing without a
# platform.
ELEMENT_DEPTHS = {"window": -0.15, "door": -0.15, "shop": -0.15, "balcony": 0.9, "railing": 0.15}
# Elements of all models stand out by at most this: pictures are not searched farther out.
MAX_OUTWARD_M = PARALLAX.depths_m[1]


def element_depth(element: Element, texels_per_metre: float = 1.0) -> ElementDepth:
    """Return the depth of an element, or that of its class and size: a balcony has a platform, or is a railing."""
    if element.depth_m is not None:
        return ElementDepth(element.depth_m, element.depth_source)
    width, height = element.width / texels_per_metre, element.height / texels_per_metre
    lowest, highest = BALCONY_SHAPES.platform_height_m
    is_platform = width >= BALCONY_SHAPES.platform_width_m and lowest <= height <= highest
    is_railing = element.label == "balcony" and not is_platform
    return ElementDepth(ELEMENT_DEPTHS["railing" if is_railing else element.label], "assumed")


@dataclass(frozen=True, slots=True)
class MouldingSettings:
    """Numbers of the bands of a wall.

    Attributes
    ----------
    max_moulding_height_m : lower bands are mouldings (cornice, string course, edge of a plinth), metres.
    min_colour_step : minimum step of the row colour at the border of two bands, grey levels.
    step_window_m : rows above and below that are averaged, metres; more than a course of bricks.
    min_free_share : minimum share of free wall in a row whose colour counts.
    element_margin_m : margin around elements that is ignored, metres.
    profile_samples : colour samples from the top of a band to its foot.
    """

    max_moulding_height_m: float = 0.7
    min_colour_step: float = 11.0
    step_window_m: float = 0.15
    min_free_share: float = 0.03
    element_margin_m: float = 0.1
    profile_samples: int = 12


MOULDINGS = MouldingSettings()


@dataclass(frozen=True, slots=True)
class LedgeSettings:
    """Numbers of ledges.

    Attributes
    ----------
    ledge_depth_m : depth of a ledge, metres.
    min_ledge_height_m : minimum height of a ledge, metres.
    max_ledge_height_m : maximum height of a ledge, metres.
    min_ledge_length_m : minimum length of a ledge, metres.
    min_lighter_share : minimum contrast of a ledge to the wall, as share of the wall's light.
    element_clearance_m : distance of a ledge from openings and balconies, metres.
    """

    ledge_depth_m: float = 0.08
    min_ledge_height_m: float = 0.08
    max_ledge_height_m: float = 0.6
    min_ledge_length_m: float = 0.8
    min_lighter_share: float = 0.06
    element_clearance_m: float = 0.06


LEDGES = LedgeSettings()
