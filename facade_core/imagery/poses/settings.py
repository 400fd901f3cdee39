"""Tuned numbers of the search for the poses of panoramas and photos."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BundleAdjustmentSettings:
    """Bundle adjustment of panoramas.

    Attributes
    ----------
    match_sigma_m : expected error of a match in metres.
    match_cauchy_scale : Cauchy scale of matches, in expected errors.
    line_cauchy_deg : Cauchy scale of lines in degrees.
    max_independent_matches : matches of a pair that count as independent.
    max_steps : Gauss-Newton steps at most.
    converged_step : the iteration ends when no change exceeds this, in metres or degrees.
    derivative_step : step of numerical derivatives in metres or degrees.
    """

    match_sigma_m: float = 0.05
    match_cauchy_scale: float = 3.0
    line_cauchy_deg: float = 0.5
    max_independent_matches: int = 40
    max_steps: int = 40
    converged_step: float = 1e-5
    derivative_step: float = 1e-4


ADJUSTMENT = BundleAdjustmentSettings()


@dataclass(frozen=True, slots=True)
class BundleSettings:
    """Bundles of panoramas that are refined together.

    Attributes
    ----------
    max_bundle_size : panoramas per bundle: their pictures are in memory together, and the equations are dense.
    min_wall_share : share of a wall that a panorama must show for a comparison.
    max_days_apart : pictures taken more days apart may show two states of a street and are not compared.
    first_square_m : side in metres of the world's squares that first divide larger groups.
    """

    max_bundle_size: int = 12
    min_wall_share: float = 0.25
    max_days_apart: int = 400
    first_square_m: float = 4096.0


PANORAMA_BUNDLES = BundleSettings()


@dataclass(frozen=True, slots=True)
class GroupOutlineSettings:
    """Alignment of a group of photos to outlines.

    Attributes
    ----------
    max_photos : photos that are compared; more take longer and say no more.
    search_along_m : search along the line of the cameras, in metres: range to each side, and step.
    search_across_m : search across that line, in metres: range to each side, and step.
    search_log_scale : search of the logarithm of the scale: range to each side, and step.
    max_starts : best changes of the search from which refinements start: outlines fit by chance in several places.
    search_resolution : pixels of a full turn, and blur in pixels, of the search.
    coarse_resolution : the same of the refinements.
    fine_resolution : the same of the last refinement.
    first_steps : first steps of a refinement: along, across and up in metres, turn in degrees, logarithm of the scale.
    prior_cost : cost, as a loss of fit, of one squared standard error of a place by GPS, of the mean height, and of the
        heading.
    heading_sigma_deg : standard error of the heading in degrees.
    min_fit : fit of the outlines from which an alignment is accepted.
    min_cost_decrease : decrease of the cost that an alignment needs.
    max_gps_increase : largest increase of the sum of squares of GPS, in its standard errors.
    """

    max_photos: int = 60
    search_along_m: tuple[float, float] = (4.0, 0.5)
    search_across_m: tuple[float, float] = (1.0, 0.5)
    search_log_scale: tuple[float, float] = (0.15, 0.03)
    max_starts: int = 6
    search_resolution: tuple[int, float] = (384, 2.0)
    coarse_resolution: tuple[int, float] = (768, 2.0)
    fine_resolution: tuple[int, float] = (1536, 2.0)
    first_steps: tuple[float, ...] = (0.125, 0.125, 0.1, 0.2, 0.01)
    prior_cost: float = 0.005
    heading_sigma_deg: float = 0.25
    min_fit: float = 0.3
    min_cost_decrease: float = 0.005
    max_gps_increase: float = 12.0


GROUP_OUTLINES = GroupOutlineSettings()


@dataclass(frozen=True, slots=True)
class JointRefinementSettings:
    """Joint refinement of panoramas that show the same walls.

    Attributes
    ----------
    max_turn_pixels : pixels of a full turn at which pictures are compared: a texel of 10 cm at 60 m.
    first_search_m : largest offset of a wall in metres in the first round.
    later_search_m : the same in later rounds.
    rounds : rounds of matching and adjustment.
    sigma_with_outlines : least expected errors of a pose from single refinement, where outlines determined the position:
        metres east, north and up, degrees of tilt (two) and heading.
    sigma_without_outlines : the same where outlines did not determine it.
    max_misfit_increase : a joint pose is rejected if the misfit of its lines grows by a larger share.
    max_correlation_loss : a joint pose is rejected if the correlation of its walls drops by more.
    max_distance_increase_m : a joint pose is rejected if held-out patches are farther apart by more metres.
    max_shift_m : a joint pose is rejected if it moves horizontally by more metres.
    min_holdout_walls : walls are held out whole from this number on; of fewer, a part of each.
    pose_digits : poses are rounded to so many digits, millimetres and thousandths of a degree, so that smaller changes
        make no unit stale.
    """

    max_turn_pixels: int = 4096
    first_search_m: float = 2.6
    later_search_m: float = 0.8
    rounds: int = 3
    sigma_with_outlines: tuple[float, ...] = (0.03, 0.03, 0.03, 0.05, 0.05, 0.05)
    sigma_without_outlines: tuple[float, ...] = (0.5, 0.5, 1.5, 0.5, 0.5, 1.0)
    max_misfit_increase: float = 0.1
    max_correlation_loss: float = 0.02
    max_distance_increase_m: float = 0.01
    max_shift_m: float = 1.2
    min_holdout_walls: int = 4
    pose_digits: int = 3


JOINT = JointRefinementSettings()


@dataclass(frozen=True, slots=True)
class MisplacementSettings:
    """Detection of wrong poses.

    Attributes
    ----------
    min_other_fit : outlines fit elsewhere from this fit on; by chance they reach .4 in real pictures.
    min_fit_gain : elsewhere they must also fit better by this.
    min_outline_groups : groups of visible outlines that distinguish positions.
    min_turn_deg : tried headings differ from the stated one by at least this many degrees.
    turn_step_deg : step of the tried headings in degrees.
    max_move_m : tried positions are at most this many metres away in each direction.
    move_step_m : step of the tried positions in metres.
    grid_resolution : pixels of a full turn, and blur in pixels, for the grid: coarse enough that a step does not miss a
        fit.
    max_stated_error_m : a position within this many metres of the stated one confirms it.
    mirror_offsets_m : offsets in metres, east and north, at which the mirror image is tried.
    mirror_turns_deg : turns in degrees at which the mirror image is tried.
    """

    min_other_fit: float = 0.5
    min_fit_gain: float = 0.12
    min_outline_groups: int = 40
    min_turn_deg: float = 5.0
    turn_step_deg: float = 1.0
    max_move_m: float = 8.0
    move_step_m: float = 0.5
    grid_resolution: tuple[int, float] = (768, 2.0)
    max_stated_error_m: float = 1.5
    mirror_offsets_m: tuple[float, ...] = (-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
    mirror_turns_deg: tuple[float, ...] = (-2.0, -1.0, 0.0, 1.0, 2.0)


MISPLACED = MisplacementSettings()


@dataclass(frozen=True, slots=True)
class ModelAlignmentSettings:
    """Alignment of cameras and points of structure from motion to the walls of a block.

    Attributes
    ----------
    start_turns_deg : headings from which the alignment starts, degrees from that of GPS.
    round_scales_m : distances in metres at which a point counts half, by round: the first reach what GPS leaves, the last
        what facades vary.
    max_points : points that are compared; more take longer and say no more.
    independent_points : so many points count as independent of each other: those of one facade share its errors.
    gps_sigma_m : expected error of GPS in metres.
    model_sigma_m : expected error of the model in metres.
    level_sigma_deg : expected error in degrees of the vertical that pictures of all headings agree on.
    pitch_sigma_deg : expected error in degrees of pictures of one heading about their right axis.
    height_sigma_m : expected error of the mean height of cameras in metres.
    gps_outlier_sigmas : GPS farther off than so many of its errors counts less.
    max_gps_increase : an alignment may raise the sum of squares of GPS, in its errors, by so much over the best fit to
        GPS: four unknowns explain 15 of it at 99.5 %.
    max_gps_sigmas : errors of GPS that an outlier counts at most.
    on_wall_m : metres from a wall within which a point is on it.
    min_on_wall_share : least share of the points on walls.
    min_points : least number of points.
    behind_cost : cost of a point behind a wall against one before it.
    max_wall_slope : largest vertical part of the normal of a wall.
    """

    start_turns_deg: tuple[float, ...] = (0.0, -6.0, 6.0, -12.0, 12.0, -20.0, 20.0)
    round_scales_m: tuple[float, ...] = (3.0, 2.0, 1.5, 1.0, 0.7, 0.5, 0.3, 0.3, 0.2, 0.2)
    max_points: int = 4000
    independent_points: float = 80.0
    gps_sigma_m: float = 3.0
    model_sigma_m: float = 0.2
    level_sigma_deg: float = 1.5
    pitch_sigma_deg: float = 20.0
    height_sigma_m: float = 0.3
    gps_outlier_sigmas: float = 3.0
    max_gps_increase: float = 20.0
    max_gps_sigmas: float = 4.0
    on_wall_m: float = 0.5
    min_on_wall_share: float = 0.2
    min_points: int = 100
    behind_cost: float = 3.0
    max_wall_slope: float = 0.3


ALIGNMENT = ModelAlignmentSettings()


@dataclass(frozen=True, slots=True)
class OutlineSettings:
    """Outlines of the mesh in a picture, and the position of a camera from them.

    Attributes
    ----------
    max_outline_distance_m : farther edges, in metres, do not constrain a position.
    sample_spacing_m : distance between samples in metres.
    samples_per_group : samples that are judged together.
    outline_tolerance_m : a sample is visible if no surface is nearer to the camera by more than this, in metres.
    side_offset_deg : angle from a sample at which the surfaces on its two sides are looked up.
    same_normal_deg : surfaces count as one if the angle between their normals is smaller than this, in degrees,
    same_plane_m : and their planes differ by less than this, in metres.
    coarse_resolution : pixels of a full turn, and blur in pixels, of the panorama that finds the position.
    fine_resolution : the same of the panorama that refines it.
    full_step : grey levels of a step that counts fully, such as sky behind eaves; a moulding below has less.
    inner_weight : weight of edges that are not in front of the sky. Corners between walls of one brick are often
        invisible.
    search_horizontal_m : horizontal search range to each side in metres.
    horizontal_step_m : horizontal step of the search in metres.
    search_vertical_m : search range up and down in metres.
    vertical_step_m : vertical step of the search in metres.
    horizontal_cost : cost of a horizontal offset per square metre.
    stated_height_cost : cost of an offset in height per square metre, where the height is stated.
    assumed_height_cost : the same where the height is assumed.
    turn_cost : cost of a turn by the expected error of the heading; grows with its square.
    sigma_cost : cost of a pose that is one standard error off.
    max_sigma : largest standard errors east, north and up, in metres, and of the heading, in degrees.
    max_assumed_height_sigma_m : largest standard error of an assumed height, in metres.
    """

    max_outline_distance_m: float = 60.0
    sample_spacing_m: float = 0.25
    samples_per_group: int = 10
    outline_tolerance_m: float = 0.15
    side_offset_deg: float = 0.7
    same_normal_deg: float = 10.0
    same_plane_m: float = 0.25
    coarse_resolution: tuple[int, float] = (2048, 3.0)
    fine_resolution: tuple[int, float] = (4096, 2.0)
    full_step: float = 80.0
    inner_weight: float = 0.15
    search_horizontal_m: float = 1.0
    horizontal_step_m: float = 0.25
    search_vertical_m: float = 1.0
    vertical_step_m: float = 0.5
    horizontal_cost: float = 0.08
    stated_height_cost: float = 0.02
    assumed_height_cost: float = 0.25
    turn_cost: float = 0.02
    sigma_cost: float = 0.01
    max_sigma: tuple[float, ...] = (0.25, 0.25, 1.0, 0.5)
    max_assumed_height_sigma_m: float = 0.3


OUTLINES = OutlineSettings()


@dataclass(frozen=True, slots=True)
class PhotoMatchingSettings:
    """Matching of photos to walls.

    Attributes
    ----------
    camera_height_m : height of hand-held cameras above the ground in metres.
    ray_height_m : height above the ground of the rays that look for the wall: above cars, below balconies.
    position_sigma_m : standard error of a stated position in each direction, metres.
    heading_sigma_deg : standard error of a stated heading, degrees.
    wrong_heading_share : share of stated headings that are plainly wrong.
    roof_log_sigma : standard error of the logarithm of a roof's height in the photo.
    no_wall_weight : weight of the case that the photo shows none of the walls, as a share of matching rays.
    position_samples : sampled positions per wall.
    max_wall_distance_m : farther walls, in metres, are not considered.
    max_obliquity_deg : walls seen farther from their normal, in degrees, are not considered.
    roof_columns_share : share of the photo's columns, around its middle, in which the roof is searched.
    min_sky_share : share of these columns that must show sky above the roof.
    """

    camera_height_m: float = 1.65
    ray_height_m: float = 2.5
    position_sigma_m: float = 5.0
    heading_sigma_deg: float = 20.0
    wrong_heading_share: float = 0.02
    roof_log_sigma: float = 0.15
    no_wall_weight: float = 0.005
    position_samples: int = 256
    max_wall_distance_m: float = 60.0
    max_obliquity_deg: float = 70.0
    roof_columns_share: float = 0.06
    min_sky_share: float = 0.5


PHOTO_MATCHING = PhotoMatchingSettings()


@dataclass(frozen=True, slots=True)
class PhotoPairSettings:
    """Pairs of photos that may overlap.

    Attributes
    ----------
    next_photos : photos before and after each by name.
    nearest_photos : nearest photos of each.
    max_pair_distance_m : largest distance in metres of the nearest photos.
    """

    next_photos: int = 12
    nearest_photos: int = 12
    max_pair_distance_m: float = 40.0


PHOTO_PAIRS = PhotoPairSettings()


@dataclass(frozen=True, slots=True)
class RefinementSettings:
    """Single refinement of panorama poses.

    Attributes
    ----------
    min_lines : fewer lines do not determine a rotation.
    min_line_length : nor does a smaller sum of their lengths in radians.
    max_turn_deg : larger rotations are rejected.
    min_misfit_decrease : a rotation is accepted if it lowers the misfit of the lines by this share.
    min_outline_groups : groups of outline samples that a position needs.
    min_lens_outline_groups : the same in a picture of a lens, which has them on one side: on a painted street 12 moved a
        true pose by 0.4 m.
    min_outline_length : sum of their lengths in radians that a position needs.
    min_fit : a position is accepted if its fit is at least this, and trusted; true ones fit from .57 on in painted streets,
    min_fit_gain : and better by this.
    heading_sigma_deg : expected error of the heading in degrees, as stated.
    line_heading_sigma_deg : the same after lines have corrected it.
    start_heights_m : heights above the stated one, in metres, from which the search starts too: other eaves are in front
        of the sky there.
    min_restart_m : the search restarts from a position that is higher or lower than its start by more than this, in
        metres,
    max_restarts : this often at most.
    max_offset_m : positions farther from the stated one are rejected: metres horizontally and vertically.
    height_change_error : share of a height correction that may be the model's error.
    max_misfit_increase : a position is rejected if the misfit of the lines grows by a larger share.
    min_height_agreement : a changed height needs so large a share of the outlines whose buildings agree,
    min_place_agreement : and a place so large a share.
    max_agreement_loss : a building agrees where its own outlines fit by this less, at most, than anywhere near,
    agreement_reach_m : by these metres east, north and up.
    min_height_change_m : smaller changes of a height are within the error of outlines, and left.
    """

    min_lines: int = 24
    min_line_length: float = 0.8
    max_turn_deg: float = 6.0
    min_misfit_decrease: float = 0.05
    min_outline_groups: int = 10
    min_lens_outline_groups: int = 30
    min_outline_length: float = 0.5
    min_fit: float = 0.5
    min_fit_gain: float = 0.06
    heading_sigma_deg: float = 1.0
    line_heading_sigma_deg: float = 0.1
    start_heights_m: tuple[float, float] = (-2.0, 2.0)
    min_restart_m: float = 0.15
    max_restarts: int = 2
    max_offset_m: tuple[float, float] = (1.5, 3.0)
    height_change_error: float = 0.3
    max_misfit_increase: float = 0.02
    min_height_agreement: float = 0.87
    min_place_agreement: float = 0.75
    max_agreement_loss: float = 0.1
    agreement_reach_m: tuple[float, float, float] = (1.5, 1.5, 4.0)
    min_height_change_m: float = 0.5


REFINEMENT = RefinementSettings()


@dataclass(frozen=True, slots=True)
class SharedWallSettings:
    """Common patches of walls and ground in panoramas.

    Attributes
    ----------
    texels_per_metre : density at which walls are compared.
    patch_side_m : side of a patch in metres.
    max_patch_offset_m : largest offset of a patch from its wall's shift in metres.
    min_wall_correlation : correlation from which a wall counts as found.
    min_patch_correlation : correlation from which a patch counts as found.
    repeat_distance_m : a wall's shift is ambiguous if, this many metres away or farther,
    max_repeat_ratio : its correlation reaches this share of the best: its windows repeat.
    max_views : views of a wall that are compared with each other, the best ones.
    min_patch_contrast : standard deviation of the gradient that a patch needs.
    min_patch_seen_share : share of a patch that must be visible.
    min_common_share : share of a wall that both pictures must show.
    aligned_texels : texels by which aligned pictures may still be shifted.
    """

    texels_per_metre: float = 10.0
    patch_side_m: float = 4.0
    max_patch_offset_m: float = 0.6
    min_wall_correlation: float = 0.3
    min_patch_correlation: float = 0.5
    repeat_distance_m: float = 1.0
    max_repeat_ratio: float = 0.9
    max_views: int = 3
    min_patch_contrast: float = 2.0
    min_patch_seen_share: float = 0.8
    min_common_share: float = 0.05
    aligned_texels: int = 1


SHARED_WALLS = SharedWallSettings()


@dataclass(frozen=True, slots=True)
class WallLineSettings:
    """Lines on walls, and the rotation of a panorama from them.

    Attributes
    ----------
    scan_width : width in pixels of the scan that finds the walls.
    max_walls : walls that are used at most.
    min_wall_share_of_sphere : smallest share of the sphere of a wall.
    min_facing_deg : lines on walls seen at flatter angles are too stretched.
    max_pixels_per_metre : finest raster of a wall.
    max_raster_side : longest side of that raster in pixels.
    min_line_pixels : shortest line that counts, in pixels.
    min_line_m : the same in metres.
    max_axis_angle_deg : largest angle between a line and its axis.
    cauchy_scales_deg : Cauchy scales in degrees, one round of reweighting each.
    prior_sigma_deg : expected error of the stated rotation in degrees,
    line_sigma_deg : against that of a line of one radian.
    """

    scan_width: int = 512
    max_walls: int = 14
    min_wall_share_of_sphere: float = 5e-4
    min_facing_deg: float = 18.0
    max_pixels_per_metre: float = 30.0
    max_raster_side: int = 1200
    min_line_pixels: float = 14.0
    min_line_m: float = 0.45
    max_axis_angle_deg: float = 9.0
    cauchy_scales_deg: tuple[float, ...] = (3.0, 2.0, 1.0, 0.6, 0.4, 0.3, 0.3, 0.3)
    prior_sigma_deg: float = 3.0
    line_sigma_deg: float = 0.15


WALL_LINES = WallLineSettings()
