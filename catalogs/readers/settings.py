"""Numbers of the readers of inputs: sizes beyond which an input is refused, and tolerances."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class InputLimits:
    """Sizes and values beyond which an input is a mistake or an attack.

    Attributes
    ----------
    min_double_face_area_m2 : smallest double area of a face.
    max_coordinate : larger than any coordinate of a real CRS.
    max_corners : corners of a face or an outline; triangulation takes quadratic time.
    min_double_triangle_area_m2 : smallest double area of a triangle.
    max_triangles : triangles of a file of models; a city quarter has a million.
    max_features : features of a file; a block has thousands.
    max_outline_corners : corners of a building's outline, as of a way of OpenStreetMap: memory of a plan
        grows by their square.
    simplify_shares : tolerances of the simplification as shares of an outline's diagonal: a centimetre to a
        metre of 100 m.
    max_id_length : letters of an id.
    max_name_length : letters of a name; longer names are cut.
    max_centreline_points : points of a centreline.
    max_street_length_m : span of a block and bends; viewpoints are a few metres apart.
    min_ground_height_m : lower heights of the ground are errors.
    max_ground_height_m : larger heights of the ground are errors.
    max_building_height_m : taller buildings are errors of the data.
    max_unpack_ratio : unpacked size over the size of the file: texts of numbers compress to a tenth.
    """

    min_double_face_area_m2: float = 1e-6
    max_coordinate: float = 1e9
    max_corners: int = 10_000
    min_double_triangle_area_m2: float = 1e-9
    max_triangles: int = 5_000_000
    max_features: int = 5_000_000
    max_outline_corners: int = 2000
    simplify_shares: tuple[float, float, float, float, float] = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
    max_id_length: int = 1000
    max_name_length: int = 200
    max_centreline_points: int = 100_000
    max_street_length_m: float = 60_000.0
    min_ground_height_m: float = -1000.0
    max_ground_height_m: float = 10_000.0
    max_building_height_m: float = 1500.0
    max_unpack_ratio: int = 50


LIMITS = InputLimits()


@dataclass(frozen=True, slots=True)
class VectorReading:
    """Numbers of the readers of vector files and OpenStreetMap.

    Attributes
    ----------
    duplicate_tolerance : degrees or metres; lines that differ by less are equal.
    max_colour_text_length : letters of a colour.
    min_colour_channel : darkest channel of a finish, of 255.
    max_colour_channel : brightest channel of a finish, of 255.
    min_joined_length : letters of known names whose words other maps join (BuildingHeight); shorter ones are
        words of their own.
    ground_range_m : other numbers are codes for unknown.
    max_cell_length : letters of a cell that are read.
    above_ground_range_m : heights above the ground of buildings whose heights count from the datum.
    storey_range_m : median height of a storey.
    max_median_height_m : median height of all buildings of a file.
    min_unique_share : Share of unique values above which a column is used as ids.
    min_unpack_limit_bytes : files unpack to this size or to `LIMITS.max_unpack_ratio`, the larger of both.
    rows_per_batch : rows of GeoParquet decoded at once.
    max_place_deg : span of a block whose coordinates are swapped, and of no site in metres.
    max_tagged_height_m : higher tags are errors.
    min_wall_height_m : lowest walls.
    max_list_length : letters of a list of OpenStreetMap.
    roof_floor_height_m : floor under a roof, as in most renderers of OpenStreetMap.
    default_roof_pitch_deg : roofs without a tagged height.
    default_skillion_pitch_deg : skillion roofs without a tagged height.
    max_default_roof_height_m : roofs of wide buildings are flatter.
    max_roof_height_m : larger tags are errors.
    max_code_page_bytes : size of a .cpg.
    min_solid_height_m : lower geometries are outlines.
    min_solid_walls : upright faces of a solid.
    max_solid_wall_slope : plan area of a wall by its area.
    min_face_area_m2 : smaller faces are no walls.
    max_nesting_depth : nesting of geometries.
    """

    duplicate_tolerance: float = 1e-7
    max_colour_text_length: int = 64
    min_colour_channel: int = 24
    max_colour_channel: int = 238
    min_joined_length: int = 6
    ground_range_m: tuple[float, float] = (-500.0, 9000.0)
    max_cell_length: int = 10_000
    above_ground_range_m: tuple[float, float] = (2.0, 80.0)
    storey_range_m: tuple[float, float] = (1.5, 7.0)
    max_median_height_m: float = 200.0
    min_unique_share: float = 0.6
    min_unpack_limit_bytes: int = 64 * 2**20
    rows_per_batch: int = 500
    max_place_deg: float = 2.0
    max_tagged_height_m: float = 1000.0
    min_wall_height_m: float = 2.0
    max_list_length: int = 10_000
    roof_floor_height_m: float = 2.5
    default_roof_pitch_deg: float = 30.0
    default_skillion_pitch_deg: float = 10.0
    max_default_roof_height_m: float = 5.0
    max_roof_height_m: float = 100.0
    max_code_page_bytes: int = 4096
    min_solid_height_m: float = 1.0
    min_solid_walls: int = 3
    max_solid_wall_slope: float = 0.1
    min_face_area_m2: float = 1e-4
    max_nesting_depth: int = 8


VECTORS = VectorReading()


@dataclass(frozen=True, slots=True)
class CameraReading:
    """Numbers of the readers of cameras, and of their placement in the frame of a block.

    Attributes
    ----------
    max_focal_widths : largest focal length, in widths of the picture.
    min_focal_widths : smallest focal length, in widths of the picture.
    max_coefficient : largest coefficient of a distortion.
    max_side_px : largest side of a picture of a calibration.
    max_position : Largest magnitude of a position in any frame, metres (geocentric ones have 6.4 million).
    max_axis_error : Largest error of the axes of a rotation from unit length and right angles.
    max_rows : rows of a table of cameras.
    min_focal_px : smaller focal lengths are in millimetres.
    max_file_bytes : size of a file of cameras.
    max_aspect_error : Largest difference of the proportions of a picture and of its calibration.
    upside_down_sine : sine of the tilt of a picture that is upside down.
    tilted_sines : sines of the tilt of pictures that are neither upright nor on their side.
    skyward_sine : sine of the tilt of a picture that looks at the sky.
    max_upside_down_share : pictures upside down, above which a file is refused.
    max_tilted_share : tilted pictures, above which a file is refused.
    max_cameras_bytes : size of cameras.txt or .bin.
    max_images_bytes : size of images.txt or .bin, which lists the points of each.
    max_images : pictures of a model.
    max_name_bytes : name of a picture.
    max_line_bytes : Bytes of a line that lists points of a picture.
    min_gps_pictures : pictures with GPS that a placement needs.
    min_gps_span_m : distance that they must span.
    gps_sigma_m : Expected error of GPS, metres; larger ones count less.
    max_gps_residual_m : Median residual, metres, from which GPS and model do not belong together.
    min_control_points : control points that a placement needs.
    min_control_width : width of their triangle as a share of its length.
    max_control_residual : Largest residual of control points, as a share of what they span.
    mirror_ratio : A mirrored fit explains the places so many times better where the axes are left-handed.
    max_tilt_sine : Median of the tilt of the right axes of pictures, as a sine, from which they have no
        common vertical.
    ahead_weight : Weight of the axes ahead against the right axes: streets are looked along and across, not
        up and down.
    placement_rounds : rounds of reweighting.
    """

    max_focal_widths: float = 100.0
    min_focal_widths: float = 0.05
    max_coefficient: float = 1e4
    max_side_px: int = 200_000
    max_position: float = 1e8
    max_axis_error: float = 0.02
    max_rows: int = 200_000
    min_focal_px: float = 100.0
    max_file_bytes: int = 256 * 2**20
    max_aspect_error: float = 0.01
    upside_down_sine: float = 0.5
    tilted_sines: tuple[float, float] = (0.5, 0.9)
    skyward_sine: float = 0.7
    max_upside_down_share: float = 0.5
    max_tilted_share: float = 0.25
    max_cameras_bytes: int = 64 * 2**20
    max_images_bytes: int = 4 * 2**30
    max_images: int = 200_000
    max_name_bytes: int = 4096
    max_line_bytes: int = 64 * 2**20
    min_gps_pictures: int = 3
    min_gps_span_m: float = 15.0
    gps_sigma_m: float = 3.0
    max_gps_residual_m: float = 15.0
    min_control_points: int = 3
    min_control_width: float = 0.02
    max_control_residual: float = 0.1
    mirror_ratio: float = 4.0
    max_tilt_sine: float = 0.35
    ahead_weight: float = 0.05
    placement_rounds: int = 20


CAMERAS = CameraReading()


@dataclass(frozen=True, slots=True)
class PictureReading:
    """Numbers of the readers of pictures, poses and rasters.

    Attributes
    ----------
    max_aerial_pixels_decoded : Pixels decoded at once; larger parts are downsampled.
    max_aerial_pixels_read : Pixels of a part before downsampling: 150 m at 1 cm.
    max_profile_bytes : Largest profile that is read: those of printing presses have up to 3 MB.
    max_srgb_error : Profiles that move no colour by more than this, of 255, are sRGB by another name.
    min_linear_gamma : of a PNG's gAMA; usual ones are 0.45.
    max_pixels : The largest cameras have 151 megapixels. Pillow holds 4 bytes per pixel: 640 MB.
    max_webp_pixels : The WebP decoder holds 15 bytes per pixel.
    min_side_px : Facades on fewer pixels show no windows.
    strip_pixels : pixels converted at once.
    min_elevation_cell_m : facades show no smaller details of the ground.
    max_elevation_cells : cells of the ground of a block.
    elevation_margin_cells : cells around the block, for interpolation at its border.
    elevation_range_m : other values mark unknown heights, declared or not.
    max_median_slope : metres of height a metre; over that of tree tops in a surface model.
    max_elevation_cells_read : cells before averaging: 3.5 km at 0.25 m.
    max_vrt_depth : nesting of virtual rasters.
    panorama_aspect_tolerance : A full panorama is twice as wide as high; stitchers round sides to multiples
        of up to 32 pixels.
    max_full_side_px : Largest plausible side of a full panorama, pixels.
    bit_depths : bit depths of cameras and scanners; the first that holds all values is assumed.
    min_opacity_share : opaque or transparent pixels of a band of opacity; infrared has values between.
    overview_side_px : largest sides of the reading of an orthophoto that its values are judged by.
    min_peak_value : Smallest maximum, of 255: darker pictures are black or hold other values.
    max_values_per_read : values read at once, over all bands.
    default_material_width_m : width of a material without one in its name.
    material_width_range_m : widths that a name may state.
    max_material_aspect_error : Largest difference of the aspect ratio from a whole number.
    max_panorama_distance_m : Panoramas farther from the buildings, in metres, show none at a useful size.
    nearby_panorama_m : distance of pictures that may show two states of a street.
    max_age_gap_days : gap between their days, above which that is noted.
    min_epoch_s : smaller numbers are no times (1973).
    min_epoch_ms : times from this number on are in milliseconds.
    max_epoch_s : larger numbers are no times (2096).
    max_field_name_length : letters of the name of a field in a note.
    max_list_depth : nesting of lists of records in JSON.
    max_poses_bytes : size of a poses file; parsed JSON of nested lists takes twenty times its size.
    max_sidecar_bytes : size of an XMP sidecar.
    max_panorama_tilt_deg : larger tilts are noted.
    gdal_cache_bytes : A row of blocks must fit into the cache, else GDAL decodes the blocks again for every
        few rows.
    max_row_cells : cells in a row of a part that is read.
    min_cell_side : shorter sides of a cell, in units of the CRS, are below rounding.
    max_cell_side : longer sides of a cell span the Earth.
    max_projection_bytes : size of a .prj.
    max_vrt_bytes : size of a virtual raster.
    """

    max_aerial_pixels_decoded: int = 4_000_000
    max_aerial_pixels_read: int = 225_000_000
    max_profile_bytes: int = 20_000_000
    max_srgb_error: int = 3
    min_linear_gamma: float = 0.9
    max_pixels: int = 160_000_000
    max_webp_pixels: int = 50_000_000
    min_side_px: int = 16
    strip_pixels: int = 1_000_000
    min_elevation_cell_m: float = 1.0
    max_elevation_cells: int = 4_000_000
    elevation_margin_cells: int = 2
    elevation_range_m: tuple[float, float] = (-1000.0, 10_000.0)
    max_median_slope: float = 2.0
    max_elevation_cells_read: int = 200_000_000
    max_vrt_depth: int = 4
    panorama_aspect_tolerance: float = 0.02
    max_full_side_px: float = 1e6
    bit_depths: tuple[int, int, int, int, int] = (8, 10, 12, 14, 16)
    min_opacity_share: float = 0.5
    overview_side_px: int = 1024
    min_peak_value: int = 16
    max_values_per_read: int = 4_000_000
    default_material_width_m: float = 1.0
    material_width_range_m: tuple[float, float] = (0.1, 20.0)
    max_material_aspect_error: float = 0.03
    max_panorama_distance_m: float = 1000.0
    nearby_panorama_m: float = 30.0
    max_age_gap_days: int = 400
    min_epoch_s: float = 1e8
    min_epoch_ms: float = 1e11
    max_epoch_s: float = 4e9
    max_field_name_length: int = 40
    max_list_depth: int = 3
    max_poses_bytes: int = 40_000_000
    max_sidecar_bytes: int = 4_000_000
    max_panorama_tilt_deg: float = 45.0
    gdal_cache_bytes: int = 256_000_000
    max_row_cells: int = 16_384
    min_cell_side: float = 1e-9
    max_cell_side: float = 1e7
    max_projection_bytes: int = 100_000
    max_vrt_bytes: int = 4_000_000


PICTURES = PictureReading()


@dataclass(frozen=True, slots=True)
class ModelReading:
    """Numbers of the readers of building models: CityGML, CityJSON, meshes and walls.

    Attributes
    ----------
    area_margin_share : tolerance around a CRS's area of use, as a share of its extent: EPSG:25832 is used in
        Passau, 1.5 degrees east of its area.
    max_area_margin_deg : limit of that tolerance.
    max_texture_excess : coordinates of a texture beyond its picture, as a share of it, that are rounding.
    max_levels : larger floor counts are codes for unknown, such as 9999.
    max_member_bytes : memory of one member of CityGML: a building, or the coordinates of one picture.
    max_member_tags : tags of one member.
    min_unpack_limit_bytes : files unpack to this size or to `LIMITS.max_unpack_ratio`, the larger of both.
    min_model_height_m : lower models have no height.
    max_stated_height_m : larger heights are codes for unknown, such as 9999.
    max_ground_height_m : larger heights of the ground are errors.
    max_type_name_length : characters of the name of a type in a note.
    max_wall_slope : share of the normal that points up; steeper faces are roofs.
    max_gltf_nodes : nodes of a glTF.
    max_unbacked_count : numbers of an accessor without data.
    max_npz_bytes : unpacked arrays of an .npz.
    max_face_colours : colours of faces that are kept apart; more are those of a photograph.
    face_colour_step : step of a channel, of 255, in which more colours are counted.
    min_building_height_m : lower models are ground, streets and water.
    max_median_height_m : median height of all buildings of a file.
    min_largest_model_m : length of the largest model of a file.
    max_map_height_m : of z in a frame of a map.
    weld_m : corners within this distance are the same.
    max_plan_offset_m : offset of a window in front of its wall.
    min_overlap_share : overlap of two components of one building.
    min_up_axis_advantage : of one axis over the other.
    min_floor_share : of the area: a floor without an equal roof above it.
    max_other_floor_share : of that share: along the other axis.
    assumed_depth_m : depth of a building behind a single wall.
    wall_tolerance_m : distance within which walls meet and are upright.
    """

    area_margin_share: float = 0.3
    max_area_margin_deg: float = 2.0
    max_texture_excess: float = 0.01
    max_levels: float = 300.0
    max_member_bytes: int = 256 * 2**20
    max_member_tags: int = 4_000_000
    min_unpack_limit_bytes: int = 32 * 2**20
    min_model_height_m: float = 0.01
    max_stated_height_m: float = 1500.0
    max_ground_height_m: float = 9000.0
    max_type_name_length: int = 60
    max_wall_slope: float = 0.5
    max_gltf_nodes: int = 50_000
    max_unbacked_count: int = 1000
    max_npz_bytes: int = 512 * 2**20
    max_face_colours: int = 64
    face_colour_step: int = 32
    min_building_height_m: float = 0.3
    max_median_height_m: float = 400.0
    min_largest_model_m: float = 1.0
    max_map_height_m: float = 20_000.0
    weld_m: float = 1e-3
    max_plan_offset_m: float = 0.1
    min_overlap_share: float = 0.3
    min_up_axis_advantage: float = 1.25
    min_floor_share: float = 0.05
    max_other_floor_share: float = 0.3
    assumed_depth_m: float = 10.0
    wall_tolerance_m: float = 0.1


MODELS = ModelReading()
