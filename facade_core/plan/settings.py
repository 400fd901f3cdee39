"""Settings of the plan of a block: tuned numbers, one class per step."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class DoorSettings:
    """Doors of assumed facades.

    Attributes
    ----------
    corner_cosines : cosines of the turns between a wall that cuts off a corner and both adjacent walls: 75 and 15
        degrees.
    min_door_wall_m : metres; narrower back walls have no door.
    min_backs_for_two_doors : back walls of a building from which the two widest have a door, not one.
    """

    corner_cosines: tuple[float, float] = (0.26, 0.966)
    min_door_wall_m: float = 1.6
    min_backs_for_two_doors: int = 5


DOORS = DoorSettings()


@dataclass(frozen=True, slots=True)
class ExemplarChoiceSettings:
    """Choice of the exemplar of a facade.

    Attributes
    ----------
    random_cost : greatest random cost, for variety among exemplars and ground floors that fit.
    floors_cost, floor_height_cost : costs per log ratio of floors and of floor height.
    quality_cost : cost of an exemplar whose upper floors have no quality; quality beats variety.
    min_body : quality of the upper floors, as a share of the best one's, below which an exemplar is not taken: that of all
        falls with the density of the block.
    neighbourhood_m : buildings with walls within this distance are neighbours, which are seen together; metres.
    same_exemplar_cost, similar_cost : cost of the exemplar of a distant neighbour, twice that of one beside it, and
        greatest cost of a similar exemplar.
    same_form_cost, form_distance : greatest cost of a neighbour's form in other colours, and the form distance at
        which it has fallen to 1 / e.
    families_per_street, other_family_cost : families of exemplars per street, and the cost of another family.
    shop_cost : cost of a ground floor without shops where the map has some.
    min_foot : quality of a ground floor below which another's is shown.
    foot_cost, plain_cost : costs of a ground floor of no quality, and of a plain one of the exemplar's own body, in style
        distances.
    unfit_cost, min_front_share : cost of a ground floor with shops where the map has none, or whose narrowest shop is wider
        than the wall if it were squeezed to this share.
    other_style_cost : cost of a shipped exemplar of another style than the building, which beats all other costs.
    """

    random_cost: float = 0.8
    floors_cost: float = 1.5
    floor_height_cost: float = 0.7
    quality_cost: float = 10.0
    min_body: float = 0.65
    neighbourhood_m: float = 60.0
    same_exemplar_cost: float = 3.0
    similar_cost: float = 1.2
    same_form_cost: float = 3.0
    form_distance: float = 0.5
    families_per_street: int = 3
    other_family_cost: float = 1.0
    shop_cost: float = 1.4
    min_foot: float = 0.75
    foot_cost: float = 10.0
    plain_cost: float = 3.0
    unfit_cost: float = 5.0
    min_front_share: float = 0.8
    other_style_cost: float = 100.0


EXEMPLAR_CHOICE = ExemplarChoiceSettings()


@dataclass(frozen=True, slots=True)
class ExemplarStyleSettings:
    """Families of exemplars.

    Attributes
    ----------
    family_size, max_families : exemplars per family, and families per library.
    colour_components : leading components that describe the colour.
    """

    family_size: int = 5
    max_families: int = 8
    colour_components: int = 3


EXEMPLAR_STYLE = ExemplarStyleSettings()


@dataclass(frozen=True, slots=True)
class FacadeSettings:
    """Facades of a block from its walls.

    Attributes
    ----------
    min_facade_width_m, min_facade_height_m, min_seen_share : smallest street facade in metres, and share of it that
        the street sees.
    min_facade_texels : texels per side; a smaller wall holds nothing to parse.
    min_free_share : share of a wall off the streets without a neighbour against it.
    samples_per_axis : sample points of a wall across and down.
    foot_probe_distance_m, foot_probe_shares, foot_probe_height_m : probes of the surface below a wall's foot: metres
        before the wall, shares of its width, metres above the foot.
    max_ground_drop_m : metres from the foot of a high wall down to the ground, for doors and shops.
    tagged_floor_height_m : floor height range in metres where levels are tagged, which can contradict the height;
        else FLOOR_HEIGHT_M.
    off_outline_m : metres from the outline of a building to walls inside its passages; outlines are simplified by
        less.
    """

    min_facade_width_m: float = 3.0
    min_facade_height_m: float = 2.5
    min_seen_share: float = 0.25
    min_facade_texels: int = 16
    min_free_share: float = 0.25
    samples_per_axis: tuple[int, int] = (5, 4)
    foot_probe_distance_m: float = 0.5
    foot_probe_shares: tuple[float, float, float, float, float] = (0.1, 0.3, 0.5, 0.7, 0.9)
    foot_probe_height_m: float = 1.0
    max_ground_drop_m: float = 2.0
    tagged_floor_height_m: tuple[float, float] = (2.2, 6.0)
    off_outline_m: float = 0.25


PLANNED_FACADES = FacadeSettings()


@dataclass(frozen=True, slots=True)
class HeadroomSettings:
    """Headroom of passages.

    Attributes
    ----------
    min_headroom_m : metres from a viewpoint up to the ceiling of a passage.
    """

    min_headroom_m: float = 0.3


HEADROOM = HeadroomSettings()


@dataclass(frozen=True, slots=True)
class PanoramaChoiceSettings:
    """Choice of the panoramas of a facade.

    Attributes
    ----------
    min_relative_quality : quality (points_shown), relative to the best panorama, from which a panorama covers a point
        of a facade.
    min_covered_share : share of its visible points with which a facade is covered; slivers need no panorama of their
        own.
    """

    min_relative_quality: float = 0.5
    min_covered_share: float = 0.95


PANORAMA_CHOICE = PanoramaChoiceSettings()


@dataclass(frozen=True, slots=True)
class PicturedDensitySettings:
    """Texels per metre of facades with pictures.

    Attributes
    ----------
    density_step, max_density_factor : steps of densities, and the largest, as multiples of the block's density.
    max_pictured_density : texels per metre up to which pictures raise a facade: a view of the street resolves 57
        (`texel_density`).
    min_shown_share : share of a facade that a picture must show to raise its density.
    max_added_texels : texels that pictures add to a building, as a multiple of those of its charts.
    """

    density_step: float = 0.25
    max_density_factor: float = 2.0
    max_pictured_density: float = 48.0
    min_shown_share: float = 0.5
    max_added_texels: float = 1.0


PICTURED_DENSITY = PicturedDensitySettings()


@dataclass(frozen=True, slots=True)
class PlanningSettings:
    """Plan of a block.

    Attributes
    ----------
    max_pose_shift_m : metres; refinement moves a pose by less.
    """

    max_pose_shift_m: float = 3.0


PLANNING = PlanningSettings()


@dataclass(frozen=True, slots=True)
class PosedPictureSettings:
    """Pictures with poses.

    Attributes
    ----------
    min_off_street_share : share of a facade off the streets that a panorama must show to texture it.
    """

    min_off_street_share: float = 0.3


POSED_PICTURES = PosedPictureSettings()


@dataclass(frozen=True, slots=True)
class SurroundingSettings:
    """Ground and buildings around a block.

    Attributes
    ----------
    distance_m : metres from the block's ground to which the ground goes on.
    ground_grid_m : step of the grid that the ground is cut on.
    tolerance_m : simplification of the outlines of its surfaces.
    seam_m : gap within the block's ground that is closed.
    storey_m, bay_m : height of a storey, where no levels are stated, and width of a bay; each has a window.
    window : left, top, right and bottom of a window as shares of its bay and storey.
    pane_colours : colours of a pane at its top, in the shade of the wall, and at its bottom.
    window_lift_m : distance of windows from the wall.
    """

    distance_m: float = 150.0
    ground_grid_m: float = 64.0
    tolerance_m: float = 0.3
    seam_m: float = 0.05
    storey_m: float = 3.3
    bay_m: float = 3.0
    window: tuple[float, float, float, float] = (0.29, 0.2, 0.71, 0.7)
    pane_colours: tuple[tuple[int, int, int], tuple[int, int, int]] = ((38, 42, 48), (92, 100, 108))
    window_lift_m: float = 0.05


SURROUNDINGS = SurroundingSettings()
