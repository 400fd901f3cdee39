"""Settings of materials: tuned numbers, one class per step."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class ExampleFillSettings:
    """Filling of hidden ground from pictured examples.

    Attributes
    ----------
    max_fill_m : greatest distance of filled ground from known texels.
    source_cell_m : side of the cells that sources are chosen for; still resolves a joint between slabs.
    min_translation_m : shortest translation; shorter ones repeat an object next to itself.
    shading_sigma_m : larger structures count as shading, not texture.
    context_m, max_translations : radius around a hidden cell over which surroundings are compared.
    min_overlap_share : share of the known cells that must overlap under a translation.
    overlap_exponent : power of the overlap share in the score.
    other_kind_cost, no_evidence_cost, cost_per_metre : costs in units of the mean squared difference of two known
        cells: a source of another kind of ground, a source without comparable surroundings, and each metre of
        distance.
    evidence_prior : weight of NO_EVIDENCE_COST, as a share of the surroundings.
    seam_cost : cost of a seam per colour difference (0-1, three channels).
    max_rounds : rounds that fill from previously filled texels, beyond the reach of all translations.
    max_crack_m : narrower gaps are closed by inpainting.
    min_example_m2 : smallest known area that serves as an example.
    """

    max_fill_m: float = 3.5
    source_cell_m: float = 0.2
    min_translation_m: float = 0.8
    shading_sigma_m: float = 2.0
    context_m: float = 1.0
    max_translations: int = 40
    min_overlap_share: float = 0.05
    overlap_exponent: float = 0.25
    other_kind_cost: float = 2.0
    no_evidence_cost: float = 1.0
    cost_per_metre: float = 0.01
    evidence_prior: float = 0.05
    seam_cost: float = 0.02
    max_rounds: int = 6
    max_crack_m: float = 0.4
    min_example_m2: float = 6.0


EXAMPLE_FILL = ExampleFillSettings()


@dataclass(frozen=True, slots=True)
class FieldSettings:
    """Materials of surfaces.

    Attributes
    ----------
    max_tiled_cosine : vertical component of a roof's normal, 15 degrees, above which tiles would leak.
    max_sheet_metal_cosine : vertical component, 3 degrees, above which few roofs are of sheet metal.
    flat_felt_share, flat_gravel_share : shares of these flat roofs.
    max_wall_cosine : vertical component, 6 degrees off the wall, below which a roof counts as a wall.
    min_cool_excess : excess of green or blue over red that no tile has.
    min_north_cosine : north component of a roof's normal above which it has moss.
    max_moss_share : share of moss at the worst place of a roof.
    rough_plaster_share : share of plaster buildings with rough plaster.
    paint_batch_texels : texels per call of the kernel.
    min_open_sky : lower bound of the open sky, for surfaces that face down.
    ground_albedo, surface_albedo : share of light that ground reflects, and other surfaces without a colour of their own.
    typical_light : linear light of most walls of a street under an overcast sky, 1 on level ground in the open; it leaves
        pictures of exemplars as they are.
    """

    max_tiled_cosine: float = 0.966
    max_sheet_metal_cosine: float = 0.9986
    flat_felt_share: float = 0.6
    flat_gravel_share: float = 0.3
    max_wall_cosine: float = 0.1
    min_cool_excess: int = 12
    min_north_cosine: float = 0.25
    max_moss_share: float = 0.55
    rough_plaster_share: float = 1 / 3
    paint_batch_texels: int = 1 << 16
    min_open_sky: float = 0.25
    ground_albedo: float = 0.2
    surface_albedo: float = 0.4
    typical_light: float = 0.5

    @property
    def typical_grey(self) -> float:
        """Brightness of white in the typical light."""
        return math.sqrt(self.typical_light)


MATERIAL_FIELD = FieldSettings()


@dataclass(frozen=True, slots=True)
class GrainSettings:
    """Grain of materials.

    Attributes
    ----------
    values_per_sd : byte values per standard deviation, about 128.
    pixels_per_box : pixels along the box of a level, so that the nearest one is accurate enough.
    """

    values_per_sd: int = 42
    pixels_per_box: int = 4


GRAIN = GrainSettings()


@dataclass(frozen=True, slots=True)
class ReliefSettings:
    """Relief of facades.

    Attributes
    ----------
    opening_depth_m, balcony_depth_m, sill_depth_m, balcony_slab_height_m, sill_height_m : inward depth of openings;
        outward depth of balcony slabs and sills.
    max_shadow_ratio : length of a shadow per depth of its caster.
    shade_window_m : window that a texel's brightness is compared with, to detect a painted shadow.
    """

    opening_depth_m: float = 0.15
    balcony_depth_m: float = 0.45
    sill_depth_m: float = 0.07
    balcony_slab_height_m: float = 0.25
    sill_height_m: float = 0.07
    max_shadow_ratio: float = 2.5
    shade_window_m: float = 1.6


RELIEF = ReliefSettings()


@dataclass(frozen=True, slots=True)
class PicturedGroundSettings:
    """Ground of a surface after what pictures show of it; chosen by eye on three panoramas of Amsterdam.

    Attributes
    ----------
    square_m : side of the squares whose mean colours are compared. Ground this near to other things is not plain.
    max_deviation : difference of such a mean from the typical colour, as a share of it, that still counts as plain.
    max_detail_deviations : deviation of a texel from its square, in medians, beyond which it is a thing of its own.
    shading_m : broader variation is light, not texture.
    spacings_m : distances of windows that are tried, the largest first.
    min_area_m2 : area over which the middles of windows must spread.
    max_windows : windows that are kept.
    """

    square_m: float = 0.4
    max_deviation: float = 0.14
    max_detail_deviations: float = 4.5
    shading_m: float = 2.0
    spacings_m: tuple[float, ...] = (2.4, 1.6, 1.0, 0.7)
    min_area_m2: float = 4.0
    max_windows: int = 400


PICTURED_GROUND = PicturedGroundSettings()


@dataclass(frozen=True, slots=True)
class StainSettings:
    """Stains of walls.

    Attributes
    ----------
    bands_m, kept_sigma, removed_sigma : wavelengths of the bands. A band is the difference of two Gaussians, with
        sigmas as shares of its wavelength.
    photo_deviations, noise_cells_m : target deviation of plain wall in each band, relative to its brightness: between
        the first quartile and the median of rectified photographs of CMP. At the median walls look cloudy, because
        photographs also contain stucco and shadows. The cells of the noise are upright: width and height.
    noise_deviations : deviation in each band per weight of each noise.
    run_m, splash_m : metres below an element or the top, and above the foot, at which stains fall to 1 / e.
    even_share, max_strength : strength of stains far from both, relative to theirs, and the greatest.
    stain_density : samples per metre.
    edge_margin_m : margin around other classes, whose edges would count as variation.
    min_wall_share : share of wall in a sample that counts as wall.
    min_places : samples that are needed for a deviation.
    """

    bands_m: tuple[float, float] = (0.7, 2.6)
    kept_sigma: float = 0.16
    removed_sigma: float = 0.32
    photo_deviations: tuple[float, float] = (0.0186, 0.0189)
    noise_cells_m: tuple[tuple[float, float], tuple[float, float]] = ((0.25, 1.0), (0.9, 3.0))
    noise_deviations: tuple[tuple[float, float], tuple[float, float]] = ((0.137, 0.102), (0.039, 0.145))
    run_m: float = 0.7
    splash_m: float = 0.6
    even_share: float = 0.5
    max_strength: float = 1.4
    stain_density: float = 8.0
    edge_margin_m: float = 0.35
    min_wall_share: float = 0.99
    min_places: int = 150


STAINS = StainSettings()


@dataclass(frozen=True, slots=True)
class TiledMaterialSettings:
    """Tiles of materials from photos.

    Attributes
    ----------
    join_share, join_softness_px, min_side_px : share of a picture's side in which its opposite borders overlap.
    """

    join_share: float = 0.25
    join_softness_px: int = 2
    min_side_px: int = 8


TILED_MATERIAL = TiledMaterialSettings()


class GroundKernelSettings(NamedTuple):
    """Kerbs, gutters, leaves and pictured ground.

    Attributes
    ----------
    kerb_m, kerb_grey, gutter_m : width and tone of a kerb, and width of the gutter beside it.
    gutter_loss : share of its tone that a gutter loses.
    leaf_reach_m : distance of leaves from a kerb.
    leaf_cell_m : a cell has at most one leaf.
    max_leaf_share : share of cells with a leaf in the densest patch.
    leaf_patch_cells : side of a patch of equal density, cells.
    leaf_length_m : longest side of a leaf.
    wheel_offset_m : distance of a wheel track from the middle of its lane.
    window_grain_weight : by how much bright grain decides between windows of pictured ground.
    """

    kerb_m: float = 0.18
    kerb_grey: float = 164.0
    gutter_m: float = 0.3
    gutter_loss: float = 0.12
    leaf_reach_m: float = 0.5
    leaf_cell_m: float = 0.1
    max_leaf_share: float = 0.22
    leaf_patch_cells: int = 24
    leaf_length_m: float = 0.07
    wheel_offset_m: float = 0.85
    window_grain_weight: float = 0.15


GROUND_KERNELS = GroundKernelSettings()


class ProceduralKernelSettings(NamedTuple):
    """Procedural materials.

    Attributes
    ----------
    frame_m : width of the frame of a pane.
    min_width_with_post_m, post_m : panes from this width on have a post in the middle.
    slab_m, board_m : width and length of a slab, and of an endless board.
    streak_length_m, splash_height_m : streaks below a wall's upper edge, splashes above its foot.
    sett_m : width across the street and length of a sett.
    brick_m, joint_m : length of a brick and height of a course, with joints.
    """

    frame_m: float = 0.065
    min_width_with_post_m: float = 0.8
    post_m: float = 0.06
    slab_m: tuple[float, float] = (0.6, 0.4)
    board_m: tuple[float, float] = (0.12, 1e9)
    streak_length_m: float = 5.0
    splash_height_m: float = 1.2
    sett_m: tuple[float, float] = (0.21, 0.15)
    brick_m: tuple[float, float] = (0.25, 0.078)
    joint_m: float = 0.011


PROCEDURAL = ProceduralKernelSettings()


class RoofMaterialSettings(NamedTuple):
    """Materials of roofs.

    Attributes
    ----------
    tile_m : width and visible length of a roof tile.
    sheet_m : width of a sheet of metal.
    slate_m, slate_gap_m : width and visible length of a slate.
    felt_m, felt_lap_m : width and length of a sheet of roofing felt.
    patch_cell_m, patch_share : cells, and the share of them with a patch.
    pool_cells_m, pool_weights : noise cells and weights of the water depth.
    shore_depth, shore_width : depth at the shore of a pool, and its range.
    mean_pool_share, mean_shore_share : mean share of a roof under pools, and at their shores.
    """

    tile_m: tuple[float, float] = (0.24, 0.34)
    sheet_m: float = 0.6
    slate_m: tuple[float, float] = (0.25, 0.2)
    slate_gap_m: float = 0.008
    felt_m: tuple[float, float] = (1.0, 8.0)
    felt_lap_m: float = 0.05
    patch_cell_m: float = 5.0
    patch_share: float = 0.3
    pool_cells_m: tuple[float, float, float] = (5.3, 2.2, 0.7)
    pool_weights: tuple[float, float, float] = (0.7, 0.36, 0.12)
    shore_depth: float = 0.3
    shore_width: float = 0.16
    mean_pool_share: float = 0.146
    mean_shore_share: float = 0.073


ROOF_MATERIALS = RoofMaterialSettings()


class FieldKernelSettings(NamedTuple):
    """Kernels of materials.

    Attributes
    ----------
    occlusion_loss : share of a colour lost where no sky is visible.
    min_roof_fall : roofs that fall less per metre count as flat; seams of sheets run north on them, else down the
        slope.
    roof_pane_axis_z : vertical component of axis_v above which a pane belongs to a roof.
    batch_points : points per batch.
    """

    occlusion_loss: float = 0.65
    min_roof_fall: float = 0.05
    roof_pane_axis_z: float = -0.95
    batch_points: int = 256


FIELD_KERNELS = FieldKernelSettings()


class ReliefKernelSettings(NamedTuple):
    """Shadows of the relief of facades.

    Attributes
    ----------
    edge_width_m, edge_spread : softness of a shadow's edge at the caster, and its growth per metre from there.
    """

    edge_width_m: float = 0.012
    edge_spread: float = 0.12


RELIEF_KERNELS = ReliefKernelSettings()
