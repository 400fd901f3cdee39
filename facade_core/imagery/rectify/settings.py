"""Tuned numbers of the rectification, crop and checks of pictures of facades."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PhotoChecks:
    """What a photo must show to be used, with the network of 0.1.0.

    Attributes
    ----------
    night_weights, night_bias : log odds of the night by the logarithm of four brightnesses (0 to 255, plus 8): median and 90 %
        of the upper quarter, 99 % of all, median of the rest. Fitted to the set `tuned` of benchmarks/night_photos and 233
        rectified facades of the day.
    min_daylight_exposure : exposure value at ISO 100 below which a scene is lit by lamps: 8 to 9 a few minutes after sunset, 4
        to 5 in a lit street.
    max_rectified_night_sky : largest median brightness (0 to 255) of the sky at night above a rectified facade, and
    max_night_sky_ratio : largest ratio of it to that of the facade: in the shade of a clear day the sky is brighter.
    min_sky_share : share of a rectified picture from which what is above the facade counts as its sky.
    min_lit_brightness : brightness (0 to 255) that a tenth of a facade exceeds by day, also where most of it is in the shade.
    min_upright_evidence : share of a picture with sky and roof above, and doors and shops below, weighed by the distance from
        the middle, from which it is upright.
    turn_weights : log odds of a direction by `photo_state.measure_direction`. Fitted to 463 rectified facades of CMP, ECP and
        Art-Deco and 238 street photos, each in all four directions.
    min_turn_probability : probability of another direction from which a photo is turned: of 701 upright pictures none reaches
        it in cross-validation; of the turned ones 76 % of ECP, 70 % of Art-Deco and 27 % of CMP do.
    """

    night_weights: tuple[float, ...] = (-4.1, -7.2, 6.2, 2.4)
    night_bias: float = 11.3
    min_daylight_exposure: float = 6.5
    max_rectified_night_sky: float = 70.0
    max_night_sky_ratio: float = 0.75
    min_sky_share: float = 0.01
    min_lit_brightness: float = 90.0
    min_upright_evidence: float = 0.03
    turn_weights: tuple[float, ...] = (-0.35, 0.30, 0.34, 0.59, -24.4, -0.38, -9.0, -3.1, 5.6, 1.0)
    min_turn_probability: float = 0.97


PHOTO_CHECKS = PhotoChecks()


@dataclass(frozen=True, slots=True)
class LevelLines:
    """Level lines of a rectified facade: chosen on the tuned halves of benchmarks/street_photos.

    Attributes
    ----------
    max_level_slope_deg : level lines of a facade slope less than this once it is rectified; more are of another wall, a
        tree or a street.
    min_level_share : share of the length of these lines within max_level_deg of the rows, below which a steep median is
        of another plane: above it, lines that slope are braces, gables or fire escapes of a rectified facade.
    max_level_deg : the second number of min_level_share
    working_side_px : longest side in pixels of the picture in which lines are detected, and their least length as a
        share of it.
    min_length_share : the second number of working_side_px
    max_slope_deg : lines up to this angle from the level, in degrees, are counted: steeper ones are upright or of
        gables.
    min_lines : fewer lines say nothing.
    hidden_rim_px : margin around hidden pixels, in pixels of the working picture: their outline is not a line of the
        facade.
    """

    max_level_slope_deg: float = 3.5
    min_level_share: float = 0.3
    max_level_deg: float = 1.5
    working_side_px: int = 900
    min_length_share: float = 0.03
    max_slope_deg: float = 35.0
    min_lines: int = 20
    hidden_rim_px: int = 7


LEVEL_LINES = LevelLines()


@dataclass(frozen=True, slots=True)
class PicturedPlanes:
    """Planes that pictures of a wall show: measured by benchmarks/photo_walls.

    Attributes
    ----------
    line_length_m : shortest and longest line that counts, in metres on the wall's plane: longer ones count as the
        latter.
    min_line_pixels : shortest line in pixels.
    upright_deg : lines within this angle of upright say nothing: upright lines are so on any upright plane.
    end_error_pixels : error of a line's end in pixels, and least error of its slope in degrees, from pose and
        mouldings.
    min_slope_error_deg : the second number of end_error_pixels
    max_turn_error_deg : lines near the camera's height, whose direction is less certain than this, are ignored.
    own_turn_deg : turns up to this are the pose's, or that of a wall which the model simplifies
    other_turn_deg : and from this on another plane's.
    min_support_ratio : a wall is another if its lines support the other direction this many times as much as its own
    min_support_m : by at least this many metres of lines
    min_support_lines : and this many lines: a wire is one.
    cells_per_metre : cells per metre at which two pictures are compared, and blur of their gradients in metres, which
        covers pose errors.
    gradient_blur_m : the second number of cells_per_metre
    min_baseline_m : smallest distance between two cameras, along the wall or up, that determines a depth, in metres.
    depth_shares : tried planes are at these shares of the camera's distance from the wall
    depth_step_m : in steps that displace the pictures against each other by this many metres.
    own_displacement_m : a displacement up to this is the pose's
    other_displacement_m : and from this on another depth's.
    min_depth_correlation : correlation on another plane from which two pictures show it
    min_correlation_gain : its excess over that on the wall's own plane, and the latter's, from which they show the wall
        after all.
    own_correlation : the second number of min_correlation_gain
    min_common_share : share of the wall that both pictures must show on a tried plane.
    """

    line_length_m: tuple[float, float] = (0.6, 6.0)
    min_line_pixels: float = 10.0
    upright_deg: float = 8.0
    end_error_pixels: float = 0.7
    min_slope_error_deg: float = 0.5
    max_turn_error_deg: float = 15.0
    own_turn_deg: float = 5.0
    other_turn_deg: float = 7.0
    min_support_ratio: float = 1.5
    min_support_m: float = 3.0
    min_support_lines: int = 4
    cells_per_metre: float = 6.0
    gradient_blur_m: float = 0.3
    min_baseline_m: float = 2.0
    depth_shares: tuple[float, float] = (0.3, 4.0)
    depth_step_m: float = 0.35
    own_displacement_m: float = 0.8
    other_displacement_m: float = 1.6
    min_depth_correlation: float = 0.35
    min_correlation_gain: float = 0.25
    own_correlation: float = 0.4
    min_common_share: float = 0.15


PLANES = PicturedPlanes()


@dataclass(frozen=True, slots=True)
class FacadeExtent:
    """Extent of a facade in a photo: chosen on the facades of even place of benchmarks/rectification.

    Attributes
    ----------
    grid_cells : cells along the photo's diagonal.
    max_gap_cells : cells that a facade continues between two of its lines.
    min_level_share : where the wall's level lines are a smaller share of all lines but vertical ones, another wall is
        seen.
    min_part_share : parts of the wall, between trees, count if they have this share of the largest part's lines.
    min_level_line_share : share of all lines but vertical ones that are level lines of the wall; a street seen along
        its length has less.
    max_level_deg : lines between the facade's sides within this angle of the level on its plane belong to it too.
    min_lines : lines of each axis that a facade needs.
    stray_share : share of the lines' length at each side that may be outside the facade.
    margin : margin around the outermost lines, as a share of the extent
    roof_margin : and above them: roofs and chimneys have few lines.
    min_cut_share : narrower strips of the photo are not cut off.
    max_obliquity_deg : pixels seen farther from the wall's normal, in degrees, are too stretched.
    max_rectified_shift : a photo whose corners move less than this, in half diagonals, is already rectified and stays
        whole
    min_covered_share : if its lines cover this share of it; else it shows more than the facade.
    """

    grid_cells: int = 96
    max_gap_cells: int = 9
    min_level_share: float = 0.25
    min_part_share: float = 0.05
    min_level_line_share: float = 0.05
    max_level_deg: float = 4.0
    min_lines: int = 12
    stray_share: float = 0.002
    margin: float = 0.03
    roof_margin: float = 0.08
    min_cut_share: float = 0.06
    max_obliquity_deg: float = 77.0
    max_rectified_shift: float = 0.07
    min_covered_share: float = 0.6


EXTENT = FacadeExtent()


@dataclass(frozen=True, slots=True)
class PhotoRectification:
    """Rectification of a photo: chosen on the facades of even place of benchmarks/rectification.

    Attributes
    ----------
    working_side : longer side in pixels at which lines are detected.
    min_line_length : shortest line, as a share of the half diagonal.
    min_photo_side : smallest side of a photo in pixels.
    min_segments : segments that each axis of a facade needs.
    min_axis_share : share of the lines' length that must follow the two axes.
    max_residual_deg : median angle in degrees between the lines and the axes of the result at most.
    max_area_ratio : largest ratio between area scales within the result.
    max_pixel_ratio : pixels of the result over pixels of the photo at most.
    max_result_side : longest side of the result in pixels.
    """

    working_side: int = 1500
    min_line_length: float = 0.02
    min_photo_side: int = 64
    min_segments: int = 8
    min_axis_share: float = 0.3
    max_residual_deg: float = 1.0
    max_area_ratio: float = 60.0
    max_pixel_ratio: float = 1.5
    max_result_side: int = 8192


RECTIFICATION = PhotoRectification()


@dataclass(frozen=True, slots=True)
class WallCrop:
    """Crop to the facade or wall: chosen on the tuned halves of benchmarks/street_photos.

    Attributes
    ----------
    min_facade_share : a facade that covers less of its picture is rejected: the picture stays whole.
    grid_cells : cells per side of the grid on which the box is searched.
    max_street_share : street at the foot of a column covers at most this share of the height. The parser takes bare
        walls as a whole for neighbours.
    min_street_columns : street is accepted if this share of the columns has it: the parser takes plinths for street in
        places.
    min_skyline_step : step of brightness at the skyline in grey levels, over this share of the side.
    step_reach_share : the second number of min_skyline_step
    min_overcast_grey : least grey level of all channels of an overcast sky; excess of blue over red, and least blue, of
        a clear one.
    min_blue : the second number of min_overcast_grey
    min_blue_grey : the second number of min_overcast_grey
    border_rim_pixels : pixels at the border of a rectified wall that mix with what is beside it.
    min_skyline_columns : share of the columns that must have such a step.
    sky_rim_share : clear sky beside a wall begins this near to its top and its side, is so high and at most so wide:
        shares of the sides. Panes that reflect it are lower, and end below the top.
    min_sky_height_share : the second number of sky_rim_share
    max_sky_width_share : the second number of sky_rim_share
    max_edge_spread_share : the inner edge of such sky is the wall's own where nine tenths of it are within this share
        of the width: the wall ends there below the sky too.
    min_edge_rows : a side whose edge is upright and found in this share of the rows ends there in all rows, where at
        most this share of them goes on beyond it: the parser takes bare walls for neighbours up to their windows, and
        between these farther.
    max_past_rows : the second number of min_edge_rows
    hidden_value : value of hidden pixels for the box, which keeps them if that costs nothing.
    """

    min_facade_share: float = 0.25
    grid_cells: int = 192
    max_street_share: float = 0.25
    min_street_columns: float = 0.3
    min_skyline_step: float = 25.0
    step_reach_share: float = 0.01
    min_overcast_grey: int = 225
    min_blue: int = 20
    min_blue_grey: int = 150
    border_rim_pixels: int = 2
    min_skyline_columns: float = 0.08
    sky_rim_share: float = 0.03
    min_sky_height_share: float = 0.2
    max_sky_width_share: float = 0.25
    max_edge_spread_share: float = 0.015
    min_edge_rows: float = 0.3
    max_past_rows: float = 0.1
    hidden_value: float = 1e-4


CROP = WallCrop()


@dataclass(frozen=True, slots=True)
class SameFacade:
    """Matches of local features of two pictures of a facade.

    Attributes
    ----------
    feature_pixels_per_metre : density at which features are found: scales from storeys differ by less than what
        features bear.
    max_features : the second number of feature_pixels_per_metre
    max_distance_ratio : lowe's ratio of the nearest and the second nearest feature. Repeated windows are ambiguous and
        drop out.
    min_inliers : matches that one shift and scale must explain, and their share of all matches.
    min_inlier_share : the second number of min_inliers
    inlier_tolerance_px : pixels by which an inlier may be off.
    min_scale : scales between two pictures of one facade, and their greatest turn as a sine.
    max_scale : the second number of min_scale
    max_turn : the second number of min_scale
    """

    feature_pixels_per_metre: float = 16.0
    max_features: int = 600
    max_distance_ratio: float = 0.75
    min_inliers: int = 14
    min_inlier_share: float = 0.35
    inlier_tolerance_px: float = 4.0
    min_scale: float = 0.5
    max_scale: float = 2.0
    max_turn: float = 0.05


SAME_FACADE = SameFacade()


@dataclass(frozen=True, slots=True)
class BuildingCorner:
    """Corner between two facades of a building.

    Attributes
    ----------
    min_corner_deg : smallest angle in degrees between the two facades of a corner.
    max_second_yaw_deg : largest yaw in degrees of the second facade.
    min_second_share : smallest share that the second facade has of the length of both facades' level lines
    min_separated_share : and smallest share of this length that lies on its own facade's side of the corner.
    """

    min_corner_deg: float = 35.0
    max_second_yaw_deg: float = 84.0
    min_second_share: float = 0.2
    min_separated_share: float = 0.85


CORNER = BuildingCorner()


@dataclass(frozen=True, slots=True)
class PhotoFit:
    """Fit of a photo to its wall: chosen on the tuned halves of benchmarks/street_photos.

    Attributes
    ----------
    max_stretch : a photo whose facade is so many times too wide or too high for its wall shows another wall.
    min_seen_share : a photo as taken shows at least this share of its facade; of less most would be invented.
    max_enlargement : a photo that is enlarged by more than this is blurred on its wall.
    legible_score : lines of text are legible from this score and number of letters on.
    legible_letters : the second number of legible_score
    rim_texels : texels around a photo's holes that count as hidden.
    min_mirrored_signs : signs that only the mirror image of a mirrored photo has.
    """

    max_stretch: float = 2.5
    min_seen_share: float = 0.4
    max_enlargement: float = 2.0
    legible_score: float = 0.85
    legible_letters: int = 4
    rim_texels: int = 2
    min_mirrored_signs: int = 2


PHOTO_FIT = PhotoFit()


@dataclass(frozen=True, slots=True)
class ElementParallax:
    """Depth of elements by parallax: chosen on streets 1 to 4 of benchmarks/depths.

    Attributes
    ----------
    depths_m : least and largest depth that is tried, metres before the wall.
    depth_step_m : step between depths, metres.
    max_other_side_m : depth up to which an opening may stand out and a balcony be set back, metres.
    min_texels_per_metre : texels that a place must move by metre of depth.
    max_pairs : pictures with which that of an element is matched at most.
    max_shift_m : largest shift between two pictures of the wall by their poses, metres.
    min_registration : least correlation of the wall between two pictures.
    surroundings_m : width of the wall around an element on which pictures are registered, metres.
    edge_m : width along the edges of an element that is ignored, as the wall's edges are there, metres.
    min_known_share : least share of an element, or of its surroundings, that both pictures show.
    blur_texels : standard deviation of the blur before gradients are taken.
    limited_gradient : gradient of log brightness per texel that counts half: reflections count no more than bars.
    parts : horizontal parts of an element that are matched apart.
    max_size_ratio : elements of one type differ by at most this ratio in width and height.
    min_members : smaller types are measured with the largest of their class.
    max_matched : elements of one type that are matched at most.
    peak_width_m : other depths within this distance of the best belong to its peak, metres.
    min_peak_share, min_prominence : the outermost peak counts that reaches this share of the largest and rises by so much.
    min_recess_m : an opening that is less recessed must lead over all other depths.
    min_correlation, min_margin : least correlation at the depth, and least lead over those farther out,
    min_margin_errors : and that lead in standard errors.
    max_error_m : largest standard error of a stored depth, metres.
    """

    depths_m: tuple[float, float] = (-0.8, 1.5)
    depth_step_m: float = 0.02
    max_other_side_m: float = 0.1
    min_texels_per_metre: float = 4.0
    max_pairs: int = 3
    max_shift_m: float = 0.4
    min_registration: float = 0.2
    surroundings_m: float = 0.4
    edge_m: float = 0.05
    min_known_share: float = 0.15
    blur_texels: float = 0.7
    limited_gradient: float = 0.03
    parts: int = 2
    max_size_ratio: float = 1.25
    min_members: int = 3
    max_matched: int = 8
    peak_width_m: float = 0.1
    min_peak_share: float = 0.6
    min_prominence: float = 0.05
    min_recess_m: float = 0.06
    min_correlation: float = 0.2
    min_margin: float = 0.1
    min_margin_errors: float = 3.0
    max_error_m: float = 0.05


PARALLAX = ElementParallax()
