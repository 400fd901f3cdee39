"""Settings of the pictures of a block."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CameraSettings:
    """Numbers of the cameras of views.

    Attributes
    ----------
    aerial_margin : free space around the block in the aerial picture, as a factor.
    search_width_px : width of the panoramas that rank viewpoints of a street, pixels.
    full_worth_distance_m : nearer surfaces count less in proportion, metres.
    open_street_m : A street that ends nearer counts less: a wall at its end fills the picture and shows little,
        metres.
    eye_height_m : height of a pedestrian's eyes, metres.
    street_yaw_deg : angle between the street and the camera, degrees.
    street_pitch_deg : pitch of the street camera, degrees.
    close_up_distance_m : distance of the close-up camera from its facade, metres.
    close_up_offset_m : sideways offset of the close-up camera, metres.
    close_up_target_m : height that the close-up camera looks at, metres.
    max_close_ups_tried : facades that are tried for the close-up, because occluders may hide one.
    """

    aerial_margin: float = 1.04
    search_width_px: int = 64
    full_worth_distance_m: float = 30.0
    open_street_m: float = 60.0
    eye_height_m: float = 1.7
    street_yaw_deg: float = 40.0
    street_pitch_deg: float = 7.0
    close_up_distance_m: float = 8.0
    close_up_offset_m: float = 6.0
    close_up_target_m: float = 3.4
    max_close_ups_tried: int = 12


VIEW_CAMERAS = CameraSettings()


@dataclass(frozen=True, slots=True)
class ContactSheetSettings:
    """Sizes on a contact sheet.

    Attributes
    ----------
    columns : columns of a page.
    rows : rows of a page.
    picture_size_px : largest height and width of a picture, pixels.
    line_px : height of a line of text, pixels.
    text_lines : lines below a picture.
    line_letters : letters of a line.
    gap_px : space between pictures, pixels.
    """

    columns: int = 5
    rows: int = 6
    picture_size_px: tuple[int, int] = (230, 260)
    line_px: int = 13
    text_lines: int = 4
    line_letters: int = 40
    gap_px: int = 10


CONTACT_SHEETS = ContactSheetSettings()


@dataclass(frozen=True, slots=True)
class DrawingSettings:
    """Numbers of pictures of layouts, occluders and crops.

    Attributes
    ----------
    mosaic_px : side of the mosaic squares that show occluders, pixels.
    max_preview_px : maximum side of a preview, pixels.
    min_completed_share : elements hidden by more than this share come from the completion.
    min_layout_height_px : minimum height of drawn layouts, pixels, so that lines over small facades stay thin.
    """

    mosaic_px: int = 12
    max_preview_px: int = 640
    min_completed_share: float = 0.3
    min_layout_height_px: int = 480


DRAWINGS = DrawingSettings()


@dataclass(frozen=True, slots=True)
class ViewSettings:
    """Numbers of the views of a block.

    Attributes
    ----------
    preview_size : height and width of the preview, pixels.
    samples_per_pixel_side : rays along each side of a pixel where charts meet.
    photo_worth : extra worth of a facade from a photo over one from an exemplar.
    shaded_worth : worth of a surface in its own shade relative to a sunlit one.
    max_street_views : streets with a view.
    max_viewpoints_tried : viewpoints of a street that are tried for its view.
    """

    preview_size: tuple[int, int] = (540, 960)
    samples_per_pixel_side: int = 2
    photo_worth: int = 4
    shaded_worth: float = 0.4
    max_street_views: int = 3
    max_viewpoints_tried: int = 24


BLOCK_VIEWS = ViewSettings()
