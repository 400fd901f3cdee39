"""Tuned numbers of the selection and fusion of the pictures of cameras on ground and walls."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class AgreementSettings:
    """Agreement of cameras about a surface.

    Attributes
    ----------
    compared_square_m : side in metres of the squares by which cameras are compared.
    max_log_difference : colours of one surface in two pictures of one exposure differ by no more than this, as a log ratio.
    min_clear_share : share of a square that must be clear for a comparison.
    thin_cell_m : side in metres of the cells that find trunks, posts and cables, which are narrower than a square.
    median_window_m : side in metres of the window whose median a cell is compared with.
    min_thin_contrast : log ratio to that median from which a cell is a thin object.
    thin_rim_cells : cells around a thin object that are removed too, and in which another camera may confirm its colour.
    min_line_m : least length of a line on the ground, metres.
    min_line_widths : least length of a line, as a multiple of its spread across.
    min_line_distance_m : a line passes the camera's foot at this distance at least, metres; what stands points at it.
    """

    compared_square_m: float = 0.5
    max_log_difference: float = 0.22
    min_clear_share: float = 0.25
    thin_cell_m: float = 0.125
    median_window_m: float = 1.6
    min_thin_contrast: float = 0.3
    thin_rim_cells: int = 2
    min_line_m: float = 1.5
    min_line_widths: float = 4.0
    min_line_distance_m: float = 0.8


AGREEMENT = AgreementSettings()


@dataclass(frozen=True, slots=True)
class CameraViewSettings:
    """Fused views of cameras.

    Attributes
    ----------
    min_piece_m2 : smaller pieces, in square metres, are left to the material.
    min_piece_width_m : narrower pieces, in metres, are left to the material.
    """

    min_piece_m2: float = 2.0
    min_piece_width_m: float = 0.6


CAMERA_VIEWS = CameraViewSettings()


@dataclass(frozen=True, slots=True)
class ExposureSettings:
    """Common exposure of cameras, from the colours of the ground around them.

    Attributes
    ----------
    grid_square_m : side in metres of the world grid's squares whose colours are compared; larger than the error of a pose.
    min_sample_distance_m : distance in metres from the camera at which ground samples begin.
    max_sample_distance_m : distance in metres from the camera at which ground samples end.
    rays_per_turn : rays per turn that look for the ground.
    ray_rows : rows of these rays.
    max_depression_deg : steepest row, in degrees below the horizon.
    min_depression_deg : flattest row, in degrees below the horizon.
    min_square_samples : samples that a square's colour needs.
    min_shared_squares : squares that a pair's ratio or a typical ground colour needs.
    exposed_range : grey levels of well exposed colours.
    max_factor : larger factors mean that two pictures do not show the same thing.
    factor_damping : weight that holds each camera to a factor of one, against a pair's weight of the square root of its
        squares. A shared difference is a difference between pictures, not a sign that all are too dark.
    factor_step : factors are multiples of this, so that small changes do not make units stale.
    """

    grid_square_m: float = 2.0
    min_sample_distance_m: float = 4.0
    max_sample_distance_m: float = 14.0
    rays_per_turn: int = 240
    ray_rows: int = 32
    max_depression_deg: float = 40.0
    min_depression_deg: float = 8.0
    min_square_samples: int = 3
    min_shared_squares: int = 6
    exposed_range: tuple[int, int] = (8, 247)
    max_factor: float = 2.0
    factor_damping: float = 0.3
    factor_step: float = 1 / 64


EXPOSURE = ExposureSettings()


@dataclass(frozen=True, slots=True)
class GroundViewSettings:
    """Views of the ground.

    Attributes
    ----------
    min_ground_distance_m : nearer than this, in metres, the camera's own vehicle hides the ground.
    min_confirmed_share : share of the squares seen by other cameras that these must confirm before unconfirmed ones of a
        view are trusted.
    max_log_deviation : unconfirmed ground differs from the typical ground colour by at most this log ratio,
    max_deviation_spreads : or by this many times its median absolute deviation.
    doubt_rim_m : metres around a doubted square that are removed too: objects reach over its border.
    """

    min_ground_distance_m: float = 3.4
    min_confirmed_share: float = 0.5
    max_log_deviation: float = 0.35
    max_deviation_spreads: float = 3.0
    doubt_rim_m: float = 0.3


GROUND = GroundViewSettings()


@dataclass(frozen=True, slots=True)
class MatchingDetailSettings:
    """Detail of a surface that two views share.

    Attributes
    ----------
    detail_cell_m : side in metres of the cells whose colours are correlated.
    window_cells : cells along a side of the windows of the correlation.
    min_shared_share : share of a window that both views must show.
    min_correlation : correlation from which views show the same detail, where both have detail.
    min_detail : standard deviation of log brightness that is detail. Sensor noise and compression have less.
    neighbour_cells : cells along a side of the neighbourhood of a cell: single cells agree by chance, and windows reach over
        the outline of an object.
    min_alike_share : more than this share of that neighbourhood must be alike.
    min_parallax : distance between two cameras over the larger height above the surface, from which an object 0.3 m high is
        shifted by 0.15 m.
    """

    detail_cell_m: float = 0.125
    window_cells: int = 9
    min_shared_share: float = 0.5
    min_correlation: float = 0.6
    min_detail: float = 0.03
    neighbour_cells: int = 5
    min_alike_share: float = 0.8
    min_parallax: float = 0.5


DETAIL = MatchingDetailSettings()


@dataclass(frozen=True, slots=True)
class OccluderMaskSettings:
    """Masks of occluders in a panorama, from perspective views that the parser labels: it was trained on such pictures.

    Attributes
    ----------
    view_count : views around a panorama.
    view_width_deg : width and height of a view in degrees.
    downward_tilt_deg : downward tilt of a view in degrees.
    view_side : side of a view in pixels.
    ground_top_deg : the ground is searched from this many degrees above the horizon
    ground_bottom_deg : to this many below it; steeper rays meet the camera's own vehicle.
    building_top_deg : walls and roofs are searched from this many degrees above the horizon
    building_bottom_deg : to this many below it.
    upward_tilt_deg : upward tilt in degrees of the second ring of views.
    pixels_per_degree : pixels of the mask per degree.
    min_occluder_pixels : smaller parts of a view, in pixels, are no occluders.
    occluder_rim_deg : rim around an occluder in degrees: feet, wheels and shadows reach beyond the parser's mask.
    edge_rim_deg : rim around the model's edges in degrees: 0.07 m at 15 m, twice the error of refined poses. Flat roofs
        seen from a street are hardly wider.
    """

    view_count: int = 6
    view_width_deg: float = 75.0
    downward_tilt_deg: float = 12.0
    view_side: int = 480
    ground_top_deg: float = 2.0
    ground_bottom_deg: float = 48.0
    building_top_deg: float = 66.0
    building_bottom_deg: float = 30.0
    upward_tilt_deg: float = 32.0
    pixels_per_degree: int = 4
    min_occluder_pixels: int = 100
    occluder_rim_deg: float = 1.25
    edge_rim_deg: float = 0.25


OCCLUDERS = OccluderMaskSettings()


@dataclass(frozen=True, slots=True)
class WallViewSettings:
    """Views of walls.

    Attributes
    ----------
    max_unconfirmed_drop_m : texels farther below the camera than this, in metres, may show a bicycle, a bin or a hedge and
        need a second camera. Cameras are 2.5 m above the ground, and higher above the ground of a model that is too low.
    """

    max_unconfirmed_drop_m: float = 1.3


WALLS = WallViewSettings()
