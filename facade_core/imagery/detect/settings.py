"""Numbers of the detection of faces, number plates and text."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class DetectionSettings:
    """Numbers of the detection of faces, number plates and text.

    Attributes
    ----------
    hidden_rim_share : Hidden boxes extend detected ones by this share of the longer side: hair, chin and a
        plate's frame.
    seam_overlap_px : Pixels that a panorama strip is continued beyond its right border; no face or plate is
        wider.
    plates_top_share : Number plates are below this share of a picture's height.
    search_top_share : Top of the searched part of a full panorama, as a share of its height: 27 degrees above
        the horizon.
    horizon_share : Horizon of a full panorama; plates are below it.
    search_bottom_share : Bottom of the searched part: 63 degrees below the horizon.
    lower_part_scale : enlargement of the lower part of pictures of ordinary size: of 24 plates marked by eye,
        scale 2 found four and 3 eight.
    max_head_m : height above the lower border that heads of people on the street do not reach: storeys may be
        half as large again as assumed, and a lorry's driver sits high.
    max_plate_m : the same of number plates.
    face_pixels_per_metre : density at which the smallest faces at the wall (0.2 m) are 16 pixels high.
    plate_pixels_per_metre : density at which the smallest plates at the wall (0.11 m) are 16 pixels high.
    min_density_of_faces : pixels per metre below which no face above the street can be recognised.
    min_scale : larger parts are searched at a scale of at least this.
    second_scale : factor of a second search for faces: those on posters and in profile are missed at one
        scale.
    max_second_pixels : parts that then have more pixels are searched once: a megapixel takes a second of one
        core.
    min_face_score : Score from which a face counts.
    max_face_iou : Of two faces that overlap by more than this IoU, only the better one stays.
    face_tile_side : Side in pixels of the network's tiles.
    face_tile_overlap : Overlap of tiles in pixels.
    face_enlargement : Second scale, for smaller pictures: at scale 1 the network misses the smallest faces.
    max_enlarged_pixels : Pictures with more pixels are not enlarged.
    aspect_range : Length over height of a plate, also seen obliquely or in two lines; European plates with
        their frames: 4.7.
    character_count_range : Recognised letters and digits on a plate.
    zone_above_shop_m : signs are in the shop front or at most this far above it.
    min_zone_share : share of the box of a sign there.
    min_name_score : Text that is recognised with a lower score is no name.
    max_hidden_share : Text that is hidden by a larger share is no name.
    min_letters : Letters that a name has at least.
    min_letter_share : Share of a name's characters that are letters.
    phone_digits : This many digits are a telephone number.
    max_names : Names per facade.
    text_tile_side : Side in pixels of the network's tiles.
    text_tile_overlap : Overlap of tiles in pixels.
    min_input_side : smaller sides of a picture are enlarged to this many pixels.
    max_enlargement : largest factor of that enlargement.
    min_pixel_probability : Probability from which a pixel is text.
    min_line_probability : Mean probability from which a box is a line.
    min_line_pixels : Thinner lines, in pixels, are specks.
    unclip_ratio : The network detects the core of a line; the box grows by this times its area over its
        circumference.
    dark_level : pictures with a darker median, of 255, are brightened: signs in the shade are missed
        otherwise (ten photos of benchmarks/shop_signs.json).
    brighten_gamma : exponent of that brightening.
    max_line_overlap : Of two lines that share more than this share of the smaller box, the larger one stays.
    read_height : height in pixels at which a line is recognised.
    min_read_width : least width in pixels at which a line is recognised.
    upright_aspect : Lines that are higher than wide by this factor are upright.
    """

    hidden_rim_share: float = 0.4
    seam_overlap_px: int = 256
    plates_top_share: float = 0.5
    search_top_share: float = 0.35
    horizon_share: float = 0.5
    search_bottom_share: float = 0.85
    lower_part_scale: float = 3.0
    max_head_m: float = 5.0
    max_plate_m: float = 3.0
    face_pixels_per_metre: float = 80.0
    plate_pixels_per_metre: float = 145.0
    min_density_of_faces: float = 40.0
    min_scale: float = 0.25
    second_scale: float = 2.0
    max_second_pixels: int = 2_500_000
    min_face_score: float = 0.3
    max_face_iou: float = 0.3
    face_tile_side: int = 640
    face_tile_overlap: int = 96
    face_enlargement: float = 2.0
    max_enlarged_pixels: int = 4_000_000
    aspect_range: tuple[float, float] = (1.2, 8.0)
    character_count_range: tuple[int, int] = (4, 10)
    zone_above_shop_m: float = 1.0
    min_zone_share: float = 0.5
    min_name_score: float = 0.8
    max_hidden_share: float = 0.3
    min_letters: int = 3
    min_letter_share: float = 0.6
    phone_digits: int = 5
    max_names: int = 12
    text_tile_side: int = 960
    text_tile_overlap: int = 160
    min_input_side: int = 736
    max_enlargement: float = 2.0
    min_pixel_probability: float = 0.3
    min_line_probability: float = 0.5
    min_line_pixels: int = 3
    unclip_ratio: float = 1.6
    dark_level: int = 64
    brighten_gamma: float = 0.5
    max_line_overlap: float = 0.5
    read_height: int = 48
    min_read_width: int = 320
    upright_aspect: float = 1.5


DETECTION = DetectionSettings()
